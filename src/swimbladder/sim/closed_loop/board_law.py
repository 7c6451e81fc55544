"""What a board knows of its pump and valves: rates over depth as polynomials, volumes, times."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from swimbladder.control.law import Law
from swimbladder.control.pump_valve import DriveParameters, timed
from swimbladder.control.records import leaves
from swimbladder.errors import InputError
from swimbladder.io.answers import as_json
from swimbladder.physics.buoyancy_engine import at_voltage, drive_map, running_pump
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.closed_loop.floats import surfacing_of
from swimbladder.sim.closed_loop.supervision import Supervision, supervision_of
from swimbladder.vehicle import PumpAndValve, Vehicle

_BEYOND = 0.05  # of the stroke, pumped beyond what lacks at the surface: what seeped in, and errors
_MOST = 0.02  # of the rate, by which its polynomial may be off
_LONGEST_TICK = 1000.0  # s, so that microseconds of 32 bits count two of them
_LOW = 0.9  # of the full battery, to which its effect on the pump is linear
_FINE = 801  # depths at which the polynomials are compared


class BoardLaw(NamedTuple):
    """The law of a board that commands seconds, its parameters, and how well they fit."""

    law: Law
    parameters: Any
    rate_error: float  # -, most by which the polynomial of the pump's rate is off
    start_error: float  # m3, most by which that of what a start falls short is off

    @property
    def rate_percent(self) -> str:
        """The error of the rate as text."""
        return f"{max(100.0 * self.rate_error, 1e-3):.2g} %"

    def summary(self) -> str:
        """Return what the command line says of the fit, one line."""
        drive = self.parameters.drive
        fitted = f"by a polynomial down to {1.0 / drive.per_depth:.4g} m"
        short = f"a start falls short by {drive.short_0 * 1e6:.3g} cm3 at the surface"
        return f"drive: the pump's rate {fitted}, off by {self.rate_percent} at most; {short}"

    def to_dict(self) -> dict[str, float]:
        """Return what a program wants to know of the fit, in SI."""
        depth = 1.0 / self.parameters.drive.per_depth
        return {"fitted_to_m": depth, **as_json(self, "rate_error start_error_m3")}


def board_law(
    vehicle: Vehicle, law: Law, parameters: Any, tick: float, *, deepest: float
) -> BoardLaw:
    """Return a law of volume changes as the board of a vehicle takes it, fitted down to a depth.

    deepest [m]. Raises InputError for a sample time that the clock cannot count, a rate that the
    polynomial does not follow, and hulls where the sea does not come in at all.
    """
    a = vehicle.engine
    assert isinstance(a, PumpAndValve)
    if tick > _LONGEST_TICK:
        what = "the board's clock does not count so long a tick"
        remedy = f"Give at most {_LONGEST_TICK:g} s: the law sleeps anyway"
        raise InputError(what, field="controller.sample_time", value=tick, unit="s", remedy=remedy)
    depth = 0.5 * deepest * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, _FINE)))
    weight = vehicle.water.specific_weight
    drive = drive_map(vehicle, depth * weight, power=False)
    x = depth / deepest
    rate, rate_error = _fitted(x, drive.rate_out, 4, drive.rate_out)
    if not rate_error <= _MOST:
        off = f"off by {rate_error:.1%} somewhere above {deepest:.4g} m"
        what = f"the board's polynomial of the pump's delivery is {off}"
        remedy, limit = "Give a smaller depth limit, above which the delivery bends less", deepest
        raise InputError(what, field="supervisor.depth_limit", value=limit, unit="m", remedy=remedy)
    battery = _battery(vehicle, a, depth * weight + ATMOSPHERIC_PRESSURE - a.internal_pressure)
    short, start_error = _fitted(x, drive.start_volume, 2, np.ones_like(x))
    surface, pause = surfacing_of(vehicle, leaves(parameters))
    stroke, made = vehicle.stroke, timed(law)
    whole = stroke.maximum - stroke.minimum
    longest = a.longest_run or 2.0 * whole / float(np.min(drive.rate_out))
    board = DriveParameters(
        tick=tick,
        per_depth=1.0 / deepest,
        **{f"pump_{n}": of for n, of in enumerate(rate)},
        **battery,
        **{f"short_{n}": of for n, of in enumerate(short)},
        head_0=ATMOSPHERIC_PRESSURE - a.internal_pressure,
        head_1=weight,
        valve_flow=a.valve.flow,
        valve_laminar=math.sqrt(a.valve.laminar_pressure),
        bypass_flow=0.0 if a.bypass is None else a.bypass.flow,
        bypass_laminar=0.0 if a.bypass is None else math.sqrt(a.bypass.laminar_pressure),
        quantum=a.quantum,
        longest=longest,
        longest_for_law=min(longest, pause),
        pause=pause,
        longest_wait=law.longest_wait(parameters) if law.longest_wait else math.inf,
        volume_least=stroke.minimum,
        volume_most=stroke.maximum,
        beyond=_BEYOND * whole,
    )
    return BoardLaw(made, made.parameters(parameters, surface, board), rate_error, start_error)


def _battery(vehicle: Vehicle, a: PumpAndValve, head: NDArray[np.float64]) -> dict[str, float]:
    """Return what the board knows of a pump's battery, of heads from the surface on [Pa] [n].

    A motor at a steady load is as much slower as its voltage is lower, at every depth. A pump as
    measured knows of no voltage.
    """
    if vehicle.supply is None:
        return dict.fromkeys(("battery_full", "per_volt", "sag_0", "sag_1"), 0.0)
    full = vehicle.supply.voltage
    low = at_voltage(vehicle, _LOW * full)
    rate, power = running_pump(vehicle, a, head, REFERENCE_TEMPERATURE)
    slower = rate - running_pump(low, a, head, REFERENCE_TEMPERATURE)[0]
    sag = np.nan_to_num(power[[0, -1]]) / full * vehicle.supply.internal_resistance
    return {
        "battery_full": full,
        "per_volt": float(np.mean(slower)) / ((1.0 - _LOW) * full),
        "sag_0": float(sag[0]),
        "sag_1": float(sag[1] - sag[0]),
    }


def flown_law(
    vehicle: Vehicle, law: Law, parameters: Any, tick: float, supervised: bool | None
) -> tuple[Law, Any, Supervision | tuple[()]]:
    """Return (law, parameters, supervisor) of a vehicle as they are flown.

    tick [s]. supervised: as of `supervision_of`. Under a supervisor a law of volume changes is that
    of its board. Raises InputError as `board_law` and `supervision_of` do.
    """
    watch = supervision_of(vehicle, tick, supervised, laws=[(law, parameters)])
    if watch and vehicle.command == "volume change":
        board = board_law(vehicle, law, parameters, tick, deepest=watch.reach)
        law, parameters = board.law, board.parameters
    return law, parameters, watch


def _fitted(
    x: NDArray[np.float64], y: NDArray[np.float64], degree: int, unit: NDArray[np.float64]
) -> tuple[list[float], float]:
    """Return the coefficients of a polynomial, and the most by which it is off, in a unit [n]."""
    if np.ptp(y) == 0.0:
        return [float(y[0])] + degree * [0.0], 0.0
    found = Polynomial.fit(x, y, degree, w=1.0 / unit).convert()
    off = float(np.max(np.abs(found(x) - y) / unit))
    return [*map(float, found.coef), *(degree + 1 - len(found.coef)) * [0.0]], off
