"""Joules per volume over depth, and where they go on the way from the battery to the water."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.buoyancy_engine import DriveMap, drive_map, steady_point
from swimbladder.physics.seawater import Cast, Column, cast_column, uniform_column
from swimbladder.physics.seawater.cast_unit import above_rating, check_cast_unit
from swimbladder.physics.steady_drives import SteadyPoint
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]
SHARES = np.linspace(0.025, 1.0, 40)  # of the full voltage, in the efficiency map
_DEEP = 100.0  # m, where neither the user nor the vehicle's rating says how deep
_DEEPEST_SEA = 1.12e8  # Pa, the bottom of the Challenger Deep: further down there is no stall


@dataclass(frozen=True, kw_only=True)
class DriveEnergy:
    """An actuator over the depths of a column; arrays over its depths [n]."""

    vehicle: Vehicle
    column: Column
    map: DriveMap
    per_volume: Array  # J/m3 from the battery, pressed out; NaN where nothing comes out
    per_volume_in: Array  # J/m3 let or drawn in; negative where the sea charges the battery
    efficiency: Array  # -, p dV over the energy from the battery; NaN where nothing comes out
    stages: dict[str, Array]  # -, its factors; empty where only the whole is known
    stall: float  # Pa above the atmosphere; inf where it has none
    stall_depth: float  # m; extrapolated below the column; inf where it has none
    shares: Array  # -, of the full voltage [m]; empty where the voltage is not known
    efficiencies: Array  # -, at each share and depth [m, n]; NaN where nothing comes out


def drive_energy(vehicle: Vehicle, column: Column) -> DriveEnergy:
    """Return the cost of displacing volume at each depth of a column.

    Raises NoAnswerError, naming the fields, where the electrical power is not known.
    """
    p = column.pressure
    found = drive_map(vehicle, p, temperature=column.temperature)
    per_volume, efficiency = _out(p, found.rate_out, found.power_out)
    per_in = _ratio(found.power_in, found.rate_in, found.rate_in > 0.0)
    point = steady_point(vehicle, p)
    stages = {} if point is None else _stages(p, found, point)
    shares = SHARES if point is not None else np.empty(0)
    points = [steady_point(vehicle, p, share=share) for share in shares.tolist()]
    rows = [_out(p, np.asarray(at.drive.volume_rate), at.cells)[1] for at in points if at]
    stall = stall_pressure(vehicle)
    return DriveEnergy(
        vehicle=vehicle,
        column=column,
        map=found,
        per_volume=per_volume,
        per_volume_in=per_in,
        efficiency=efficiency,
        stages=stages,
        stall=stall,
        stall_depth=_depth(column, stall),
        shares=shares,
        efficiencies=np.reshape(rows, (-1, p.size)),
    )


def sea(
    vehicle: Vehicle, cast: Cast | None = None, deepest: float | None = None
) -> tuple[Column, list[str]]:
    """Return the water of a cast, or a vehicle's own, and what is in doubt of it.

    deepest [m]; None: the rating, or where the cast ends above that. Raises InputError where a
    cast may be in another unit.
    """
    rating = vehicle.hull.depth_limit
    down = rating if deepest is None else deepest
    if cast is None:
        down = _DEEP if down is None else down
        return uniform_column(vehicle.water, down, step=min(1.0, abs(down) / 100.0)), []
    check_cast_unit(cast, deepest, rating)
    whole = cast_column(cast, None)
    if deepest is None and (down is None or whole.deepest <= down):
        return whole, above_rating(cast.name, whole.deepest, down, "deepest")
    return cast_column(cast, down), []


def stall_pressure(vehicle: Vehicle) -> float:
    """Return the pressure above the atmosphere [Pa] at which nothing more is pressed out.

    inf where that is deeper than any sea.
    """

    def rate(pressure: float) -> float:
        return float(drive_map(vehicle, [pressure], power=False).rate_out[0])

    if rate(_DEEPEST_SEA) > 0.0:
        return float("inf")
    if rate(0.0) <= 0.0:
        return 0.0
    low, high = 0.0, _DEEPEST_SEA
    while high - low > 1.0:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rate(middle) > 0.0 else (low, middle)
    return low


def _depth(column: Column, pressure: float) -> float:
    """Return the depth of a pressure [m]; below the column with the density at its end."""
    if pressure <= column.pressure[-1]:
        return float(np.interp(pressure, column.pressure, column.depth))
    weight = float(column.density[-1]) * column.gravity
    return float(column.depth[-1] + (pressure - column.pressure[-1]) / weight)


def _out(p: Array, rate: Array, power: Array) -> tuple[Array, Array]:
    """Return energy per volume [J/m3] and efficiency [-] where volume is pressed out."""
    drawn = (rate > 0.0) & (power > 0.0)
    per_volume = _ratio(power, rate, drawn)
    return per_volume, _ratio(p, per_volume, drawn)


def _ratio(a: Array, b: Array, where: NDArray[np.bool_]) -> Array:
    """Return a/b, NaN elsewhere."""
    return np.asarray(np.divide(a, b, out=np.full(where.shape, np.nan), where=where))


def _stages(p: Array, found: DriveMap, point: SteadyPoint) -> dict[str, Array]:
    """Return the factors of the efficiency; NaN where nothing is pressed against a pressure."""
    d = point.drive
    works = (found.rate_out > 0.0) & (p > 0.0)
    pumped = np.asarray(d.sea + d.leakage)
    shaft = pumped + d.transmission

    powers = {  # from the cells to the water: what is left after each
        "battery": point.terminals,
        "driver": d.supply,
        "motor": shaft,
        "transmission": pumped,
        "leakage": d.sea,
        "reservoir": p * np.asarray(d.volume_rate),
    }
    pairs = zip(powers.items(), (point.cells, *powers.values()), strict=False)
    return {stage: _ratio(np.asarray(out), np.asarray(into), works) for (stage, out), into in pairs}
