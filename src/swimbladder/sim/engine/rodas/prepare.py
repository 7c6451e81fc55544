"""From a vehicle and its water to the arrays that RODAS moves.

The oil line has numbers, and columns of the table, of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import NoAnswerError
from swimbladder.physics.actuator import leakage_coefficient
from swimbladder.physics.buoyancy_engine import drive_map, pressure_ratio, running_pump
from swimbladder.physics.dynamics import drag_terms
from swimbladder.physics.hull import heat_expansion, layered_volume, neutral_volume
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.pump_start import POLYTROPIC, LineCurves, line_curves
from swimbladder.physics.seawater import Column, look_up
from swimbladder.physics.seawater.column import slopes
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.engine.modes import DEEPEST
from swimbladder.sim.engine.rodas.names import At, Given, Now, Table
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Vehicle

Array = NDArray[np.float64]
_BEYOND = 1.2  # of the column's pressure: so far the line is tabulated


class _Line(NamedTuple):
    actuator: PumpAndValve
    curves: LineCurves
    warmth: Array  # J/K [n, 2] by which `curves.energy`, of 15 degC, grows in warmer water


def line_given(vehicle: Vehicle, column: Column) -> dict[Given, float]:
    """Return what the kernel takes of a vehicle's oil line; zeros without one."""
    line = _line(vehicle, column)
    if line is None:
        return dict.fromkeys(list(Given)[int(Given.LINE) : int(Given.COUNT)], 0.0)
    a = line.actuator
    assert a.line is not None
    air = (ATMOSPHERIC_PRESSURE / a.internal_pressure) ** (1.0 / POLYTROPIC)
    return {
        Given.LINE: a.line.volume,
        Given.LINE_GAS: a.line.volume * a.line.trapped_air * air,
        Given.LINE_MODULUS: a.line.bulk_modulus,
        Given.LINE_POWER: 1.0 / POLYTROPIC,
        Given.LINE_RATIO: pressure_ratio(a),
        Given.RESERVOIR: a.internal_pressure,
        Given.HEAD_AFLOAT: ATMOSPHERIC_PRESSURE - a.internal_pressure,
        Given.SLIP: _slip(vehicle, a),
        Given.RUN_UP: a.start_volume,
        Given.LINE_STEP: line.curves.step,
        Given.LINE_TOP: line.curves.top,
    }


def line_columns(vehicle: Vehicle, column: Column) -> dict[Table, Array]:
    """Return columns over the line's pressure with their slopes [n, 2]; none without a line."""
    line = _line(vehicle, column)
    if line is None:
        return {}
    return {
        Table.FILLING: line.curves.time,
        Table.FILL_ENERGY: line.curves.energy - REFERENCE_TEMPERATURE * line.warmth,
        Table.FILL_WARMTH: line.warmth,
        Table.EMPTYING: line.curves.falling,
    }


def _line(vehicle: Vehicle, column: Column) -> _Line | None:
    a = vehicle.actuator
    if not isinstance(a, PumpAndValve) or a.line is None:
        return None
    oil, highest = a.line, _BEYOND * float(column.pressure[-1]) + ATMOSPHERIC_PRESSURE

    def curves(temperature: float) -> LineCurves:
        return line_curves(
            oil,
            lambda dp: running_pump(vehicle, a, dp, temperature)[0],
            lambda dp: running_pump(vehicle, a, dp, temperature)[1],
            highest - a.internal_pressure,
            len(column.depth),
            slip=_slip(vehicle, a),
            reservoir=a.internal_pressure,
            ratio=pressure_ratio(a),
        )

    found, warmer = curves(REFERENCE_TEMPERATURE), curves(REFERENCE_TEMPERATURE + 1.0)
    return _Line(a, found, warmer.energy - found.energy)


def _slip(vehicle: Vehicle, a: PumpAndValve) -> float:
    """Return what flows back through a pump that stands, of the water [m3/s/Pa]."""
    if isinstance(a.pump, PowerLawPump):
        return a.pump.slip
    water, drive = vehicle.water, a.pump.drive
    leak = leakage_coefficient(
        k_pl=drive.pump_leakage, rho=water.density, g=water.gravity, n_h=drive.area_ratio
    )
    return leak / water.specific_weight


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Tolerances of a step, and what counts as rest.

    relative [-]; depth [m], speed [m/s], volume [m3]; rest_deep, rest_afloat: amplitudes of an
    oscillation [m] that is too small to be followed.
    """

    relative: float = 1e-4
    depth: float = 1e-3
    speed: float = 1e-5
    volume: float = 1e-10
    rest_deep: float = 1e-2
    rest_afloat: float = 5e-2


def make_table(vehicle: Vehicle, column: Column) -> tuple[Array, str]:
    """Return the table over depth [n, Table.WIDTH], and why no energy is known ("": it is)."""
    why = ""
    try:
        drive = drive_map(vehicle, column.pressure, temperature=column.temperature)
    except NoAnswerError as error:
        why = str(error)
        drive = drive_map(vehicle, column.pressure, temperature=column.temperature, power=False)
    columns = {
        Table.PRESSURE: column.pressure,
        Table.NEUTRAL: neutral_volume(vehicle, column),
        Table.RATE_OUT: drive.rate_out,
        Table.POWER_OUT: drive.power_out,
        Table.RATE_IN: drive.rate_in,
        Table.POWER_IN: drive.power_in,
        Table.BYPASS: drive.bypass_in,
        Table.POWER_BYPASS: drive.power_bypass,
        Table.LEAKAGE: drive.leakage,
        Table.HOLDING: drive.holding_power,
        Table.START: drive.start_volume,
        Table.LAYERS: layered_volume(vehicle, column),
        Table.TEMPERATURE: column.temperature,
    }
    table = np.zeros((len(column.depth), int(Table.WIDTH)))
    for place, values in columns.items():
        # NaN: not known, or a load beyond the battery, at which nothing is moved
        table[:, place] = np.nan_to_num(values, nan=0.0)
        table[:, place + 1] = slopes(table[:, place], column.step)
    for place, pair in line_columns(vehicle, column).items():
        table[:, place : place + 2] = np.nan_to_num(pair, nan=0.0)
    return np.ascontiguousarray(table), why


def given_of(
    vehicle: Vehicle, column: Column, *, bottom: float, accuracy: Accuracy,
    asked: dict[Given, float] | None = None,
) -> Array:  # fmt: skip
    """Return what does not change of a vehicle [Given.COUNT], over a bottom [m].

    asked: what a mission adds; without it nothing limits depth, charge and time, and the drive does
    what the vehicle's file says.
    """
    hull, stroke, m, a = vehicle.hull, vehicle.stroke, vehicle.mass, vehicle.actuator
    lag = hull.thermal_time_constant
    d_l, d_b, d_0, d_t, epsilon = drag_terms(vehicle.drag, m)
    surface_weight = float(column.density[0]) * column.gravity
    values = {
        Given.STEP: column.step,
        Given.MASS: m,
        Given.D_L: d_l,
        Given.D_B: d_b,
        Given.D_0: d_0,
        Given.D_T: d_t,
        Given.EPSILON: epsilon,
        Given.A_S: surface_weight * hull.waterplane_area / m,
        Given.Z_SURFACE: hull.emergence_depth,
        Given.Z_AIR: hull.emergence_depth - hull.height,
        Given.Z_BOTTOM: bottom,
        Given.V_MIN: stroke.minimum,
        Given.V_MAX: stroke.maximum,
        Given.TRIM: 0.0,
        Given.GIVE: 0.0,
        Given.BY_VOLUME: 0.0 if isinstance(a, PumpAndValve) else 1.0,
        Given.QUANTUM: a.quantum if isinstance(a, PumpAndValve) else 0.0,
        Given.LONGEST: (a.longest_run or math.inf) if isinstance(a, PumpAndValve) else math.inf,
        Given.DELIVERY: 1.0,
        Given.NOISE: vehicle.sensors.depth_noise,
        Given.RESOLUTION: vehicle.sensors.depth_quantum,
        Given.DEEPEST: math.inf,
        Given.NEUTRAL_TOP: vehicle.trim_error,
        Given.SHALLOW: 0.0,
        Given.EMPTY: -math.inf,
        Given.RESERVE: -math.inf,
        Given.LAST_TIME: math.inf,
        Given.LAST_CYCLE: math.inf,
        Given.SURFACING: 0.0,
        Given.SELF_DISCHARGE: 0.0,
        Given.RTOL: accuracy.relative,
        Given.ATOL_Z: accuracy.depth,
        Given.ATOL_W: accuracy.speed,
        Given.ATOL_V: accuracy.volume,
        Given.REST_DEEP: accuracy.rest_deep,
        Given.REST_AFLOAT: accuracy.rest_afloat,
        Given.LONGEST_STEP: math.inf,
        Given.Z_LOST: DEEPEST,
        Given.CHARGE: 0.0,
        Given.HELD: 0.0,
        Given.RISING: vehicle.drag.rising_ratio,
        Given.FLOW: 1.0,
        Given.OPEN: 0.0,
        Given.MAKES_UP: 1.0,
        Given.FOLLOWS: 1.0 / lag if lag > 0.0 else 0.0,
        Given.EXPANSION: heat_expansion(vehicle) if lag > 0.0 else 0.0,
        Given.VOLUME_NOISE: vehicle.sensors.volume_noise,
        Given.VOLUME_QUANTUM: vehicle.sensors.volume_quantum,
    } | line_given(vehicle, column) | (asked or {})  # fmt: skip
    return np.array([values[key] for key in list(Given)[: int(Given.COUNT)]])


def first_lane(
    given: Array, table: Array, z: float, *, volume: float | None = None,
    temperature: float | None = None, seed: int | None = None,
) -> tuple[Array, NDArray[np.int64]]:  # fmt: skip
    """Return a vehicle before the start: numbers of `Now` and whole numbers of `At`.

    At the depth of 0 it floats with all volume out; at another z [m] it rests, with its neutral
    volume or the one that is given [m3]. Its hull is as warm as the water there, or has the
    temperature that is given [degC]. seed: of the sensors' noise.
    """
    g = given
    x, at = np.zeros(int(Now.COUNT)), np.zeros(int(At.COUNT), dtype=np.int64)
    step = float(g[Given.STEP])
    x[Now.H], x[Now.CHARGE] = 1.0, g[Given.CHARGE]
    at[At.SEED] = -1 if seed is None else seed
    at[At.SHUT] = 1  # the line is at the pressure of its reservoir
    there = look_up(table, step, Table.TEMPERATURE, max(z, 0.0))[0]
    x[Now.HULL] = there if temperature is None else temperature
    grown = float(g[Given.EXPANSION] * (x[Now.HULL] - there))  # m3, beyond what the table says
    if z == 0.0:
        top = float(g[Given.Z_SURFACE])
        v = float(g[Given.V_MAX])
        force = look_up(table, step, Table.PRESSURE, top)[1] / g[Given.MASS]
        light = v + grown - look_up(table, step, Table.NEUTRAL, top)[0] - g[Given.TRIM]
        z = top - max(force * light / g[Given.A_S], 0.0)
        at[At.PLACE] = 1
    else:
        v = float(look_up(table, step, Table.NEUTRAL, z)[0] + g[Given.TRIM] + g[Given.GIVE] * z)
        v = v - grown if volume is None else volume
        at[At.PLACE] = 1 if z < g[Given.Z_SURFACE] else 0
    x[Now.Z], x[Now.V], x[Now.Z_MOST] = z, v, z
    x[Now.V_LEAST], x[Now.V_MOST] = v, -math.inf
    x[Now.T_LOOK], x[Now.T_MOVE], x[Now.V_MOVE] = 0.0, math.inf, math.nan
    x[Now.T_ARRIVAL], x[Now.T_AFLOAT] = math.nan, math.nan
    return x, at
