"""From a vehicle and its water to the arrays that RODAS moves.

The oil line has numbers, and columns of the table, of its own.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.physics.actuator import leakage_coefficient
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import drive_map, pressure_ratio, running_pump
from swimbladder.physics.dynamics import drag_terms
from swimbladder.physics.hull import heat_expansion, layered_volume, neutral_volume
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column, look_up
from swimbladder.physics.seawater.column import slopes
from swimbladder.physics.steady_drives import (
    POLYTROPIC,
    REFERENCE_TEMPERATURE,
    LineCurves,
    OilLine,
    line_curves,
)
from swimbladder.sim.engine.modes import DEEPEST
from swimbladder.sim.engine.rodas.records import AT, GIVEN, GIVEN_WITH_LINE, NOW, Table, made
from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle

_BEYOND = 1.2  # of the column's pressure: so far the line is tabulated


class _Line(NamedTuple):
    actuator: PumpAndValve
    curves: LineCurves
    warmth: Array  # J/K [n, 2] by which `curves.energy`, of 15 degC, grows in warmer water


def line_given(vehicle: Vehicle, column: Column) -> dict[str, float]:
    """Return what the kernel takes of a vehicle's oil line; nothing without one."""
    line = _line(vehicle, column)
    if line is None:
        return {}
    a = line.actuator
    assert a.line is not None
    air = (ATMOSPHERIC_PRESSURE / a.internal_pressure) ** (1.0 / POLYTROPIC)
    return {
        "line": a.line.volume,
        "line_gas": a.line.volume * a.line.trapped_air * air,
        "line_modulus": a.line.bulk_modulus,
        "line_power": 1.0 / POLYTROPIC,
        "line_ratio": pressure_ratio(a),
        "reservoir": a.internal_pressure,
        "head_afloat": ATMOSPHERIC_PRESSURE - a.internal_pressure,
        "slip": _slip(vehicle, a),
        "run_up": a.start_volume,
        "line_step": line.curves.step,
        "line_top": line.curves.top,
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
    a = vehicle.engine
    if not isinstance(a, PumpAndValve) or a.line is None:
        return None
    line = OilLine(a.line, a.internal_pressure, pressure_ratio(a))
    highest = _BEYOND * float(column.pressure[-1]) + ATMOSPHERIC_PRESSURE - a.internal_pressure
    count, slip = len(column.depth), _slip(vehicle, a)

    def curves(temperature: float) -> LineCurves:
        def rate(dp: Array) -> Array:
            return running_pump(vehicle, a, dp, temperature)[0]

        def power(dp: Array) -> Array:
            return running_pump(vehicle, a, dp, temperature)[1]

        return line_curves(line, rate, power, highest, count, slip=slip)

    found, warmer = curves(REFERENCE_TEMPERATURE), curves(REFERENCE_TEMPERATURE + 1.0)
    return _Line(a, found, warmer.energy - found.energy)


def _slip(vehicle: Vehicle, a: PumpAndValve) -> float:
    """Return what flows back through a pump that stands, of the water [m3/s/Pa]."""
    if not isinstance(a.pump, DatasheetPump):
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
    """Return the table over depth [n, 2 len(Table)], and why no energy is known ("": it is)."""
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
    table = np.zeros((len(column.depth), 2 * len(Table)))
    for place, values in columns.items():
        # NaN: not known, or a load beyond the battery, at which nothing is moved
        table[:, place] = np.nan_to_num(values, nan=0.0)
        table[:, place + 1] = slopes(table[:, place], column.step)
    for place, pair in line_columns(vehicle, column).items():
        table[:, place : place + 2] = np.nan_to_num(pair, nan=0.0)
    return np.ascontiguousarray(table), why


def given_of(vehicle: Vehicle, column: Column, *, bottom: float, accuracy: Accuracy) -> np.record:
    """Return what does not change of a vehicle, over a bottom [m]; what is not named here is 0.

    Nothing limits depth, charge and time, and the drive does what the vehicle's file says.
    """
    hull, stroke, m, a = vehicle.hull, vehicle.stroke, vehicle.mass, vehicle.engine
    lag = hull.thermal_time_constant
    surface_weight = float(column.density[0]) * column.gravity
    values = {
        "step": column.step,
        "mass": m,
        "a_s": surface_weight * hull.waterplane_area / m,
        "z_surface": hull.emergence_depth,
        "z_air": hull.emergence_depth - hull.height,
        "z_bottom": bottom,
        "v_min": stroke.minimum,
        "v_max": stroke.maximum,
        "by_volume": 0.0 if isinstance(a, PumpAndValve) else 1.0,
        "quantum": a.quantum if isinstance(a, PumpAndValve) else 0.0,
        "longest": (a.longest_run or math.inf) if isinstance(a, PumpAndValve) else math.inf,
        "noise": vehicle.sensors.depth_noise,
        "resolution": vehicle.sensors.depth_quantum,
        "neutral_top": vehicle.trim_error,
        "rtol": accuracy.relative,
        "atol_z": accuracy.depth,
        "atol_w": accuracy.speed,
        "atol_v": accuracy.volume,
        "rest_deep": accuracy.rest_deep,
        "rest_afloat": accuracy.rest_afloat,
        "z_lost": DEEPEST,
        "rising": vehicle.drag.rising_ratio,
        "follows": 1.0 / lag if lag > 0.0 else 0.0,
        "expansion": heat_expansion(vehicle) if lag > 0.0 else 0.0,
        "volume_noise": vehicle.sensors.volume_noise,
        "volume_quantum": vehicle.sensors.volume_quantum,
    }
    line = line_given(vehicle, column)
    found = made(GIVEN_WITH_LINE if line else GIVEN)
    values |= drag_terms(vehicle.drag, m)._asdict() | line
    values |= dict.fromkeys(("deepest", "last_time", "last_cycle", "longest_step"), math.inf)
    values |= dict.fromkeys(("empty", "reserve"), -math.inf)
    values |= dict.fromkeys(("delivery", "flow", "makes_up"), 1.0)
    for name, value in values.items():
        found[name] = value
    return found


def first_lane(
    given: np.record,
    table: Array,
    z: float,
    *,
    volume: float | None = None,
    temperature: float | None = None,
    seed: int | None = None,
) -> tuple[np.record, np.record]:
    """Return a vehicle before the start: records of NOW and AT.

    At the depth of 0 it floats with all volume out; at another z [m] it rests, with its neutral
    volume or the one that is given [m3]. Its hull is as warm as the water there, or has the
    temperature that is given [degC]. seed: of the sensors' noise.
    """
    g = given
    x, at = made(NOW), made(AT)
    step = float(g["step"])
    x["h"], x["charge"] = 1.0, g["charge"]
    at["seed"] = -1 if seed is None else seed
    at["shut"] = 1  # the line is at the pressure of its reservoir
    there = look_up(table, step, Table.TEMPERATURE, max(z, 0.0))[0]
    x["hull"] = there if temperature is None else temperature
    grown = float(g["expansion"] * (x["hull"] - there))  # m3, beyond what the table says
    if z == 0.0:
        top = float(g["z_surface"])
        v = float(g["v_max"])
        force = look_up(table, step, Table.PRESSURE, top)[1] / g["mass"]
        light = v + grown - look_up(table, step, Table.NEUTRAL, top)[0] - g["trim"]
        z = top - max(force * light / g["a_s"], 0.0)
        at["place"] = 1
    else:
        v = float(look_up(table, step, Table.NEUTRAL, z)[0] + g["trim"] + g["give"] * z)
        v = v - grown if volume is None else volume
        at["place"] = 1 if z < g["z_surface"] else 0
    x["z"], x["v"], x["z_most"] = z, v, z
    x["v_least"], x["v_most"] = v, -math.inf
    x["t_sample"], x["t_move"], x["v_move"] = 0.0, math.inf, math.nan
    x["t_arrival"], x["t_afloat"] = math.nan, math.nan
    return x, at
