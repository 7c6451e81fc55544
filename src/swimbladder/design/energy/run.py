"""`energy`: joules per volume over depth, where they go, and what a thruster would take instead.

A buoyancy engine and a thruster are compared in two tasks: hovering with a weight error, and
profiling. The question is that of J. Falcao Carneiro et al., IEEE J. Oceanic Eng. (2020); its text
was not at hand, so that what follows is ours, from momentum theory and the vehicle's own numbers.

Hovering: the vehicle weighs so much too much. The engine pumps that volume out once, and then
holds it; the thruster pushes all the time. After the break-even time the engine has taken less.

Profiling: down to a depth and back at a constant speed. The engine makes the vehicle heavier than
the water by the drag, then lighter, and follows the neutral volume on the way; the thruster's
vehicle keeps one volume, neutral half-way between its extremes, and pushes against drag and what is
left of weight. Processor and sensors take the same in both and are left out.

What a thruster takes to hold a force, at rest or under way, is by momentum theory. An ideal disc of
area A that pushes with T gives the water the speed 2 v behind it, where

    T = 2 rho A v (w + v),    P = T (w + v)/eta

with w the speed of advance (Rankine and Froude; J. Carlton, Marine Propellers and Propulsion, 4th
ed. 2019, chapter 8). At rest P = T^1.5/(2 rho A)^0.5/eta. eta is what blades, duct, motor and
driver leave of that, and taken as constant.

The defaults are a small ducted thruster of a remotely operated vehicle: Blue Robotics' T200, whose
propeller has 76 mm. Its maker's bollard pull against electrical power (t200_thrust_power.js in
github.com/bluerobotics/bluerobotics.github.io, 12 V ahead) has eta from 0.35 to 0.44 between 2 and
36 N. Below 1 N eta falls, to 0.14 at 0.4 N, the least it pushes with: some 0.2 W go into
turning at all, which `idle_power` of 0 leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from swimbladder.design.energy.fit import PumpFit, voltage_factor
from swimbladder.errors import check_number
from swimbladder.io.answers import Answer, as_json, attributes
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import DriveMap, drive_map, oil_note, steady_point
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import Cast, Column, cast_column, uniform_column
from swimbladder.physics.seawater.cast import above_rating, check_cast_unit
from swimbladder.physics.steady_drives import SteadyPoint
from swimbladder.units import in_unit, read_numbers, rounded
from swimbladder.vehicle import Vehicle

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
    """Return the water of a cast, or a vehicle's own, and warnings about it.

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
        return whole, above_rating(cast.name, whole.deepest, down, "max_depth")
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


def _ratio(a: Array, b: Array, where: Flags) -> Array:
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


@dataclass(frozen=True)
class Thruster:
    """One or several equal thrusters; numbers may be texts with units.

    Raises InputError where a number makes no sense.
    """

    diameter: float = in_unit("m", 0.076)  # of the propeller; the T200's
    efficiency: float = in_unit("", 0.35)  # of the ideal disc's power; the T200's, rounded down
    number: int = 1
    # of each while it turns: friction, controller; 0 favours thrusters
    idle_power: float = in_unit("W", 0.0)

    def __post_init__(self) -> None:
        """Read texts with units, and check."""
        read_numbers(self)
        check_number(self.diameter, "diameter", "m", above=0.0)
        remedy = 'Give a share above 0 and up to 1; "35 %" is 0.35'
        check_number(self.efficiency, "efficiency", above=0.0, most=1.0, remedy=remedy)
        check_number(self.number, "number", least=1)
        check_number(self.idle_power, "idle_power", "W", least=0.0)

    def power(self, thrust: Any, density: Any, speed: Any = 0.0) -> Any:
        """Return the electrical power [W] for a `thrust` [N]; arrays too.

        density: of the water [kg/m3]; speed: of advance in the direction of the thrust [m/s]. A
        thrust against the motion is computed as at rest: braking is not paid back.
        """
        area = self.number * math.pi / 4.0 * self.diameter**2
        size = np.abs(np.asarray(thrust, float))
        ahead = np.where(np.asarray(thrust) > 0.0, speed, 0.0)
        induced = np.sqrt(ahead**2 / 4.0 + size / (2.0 * density * area)) - ahead / 2.0
        pushed = size * (ahead + induced) / self.efficiency
        return (pushed + self.number * self.idle_power * (size > 0.0))[()]


_POINTS = 200  # depths at which a dive is computed


@dataclass(frozen=True, kw_only=True)
class Hovering:
    """Holding a depth with a weight error; arrays over the column's depths [n]."""

    weight_error: float  # m3 of water that it weighs too much
    thrust: Array  # N
    thruster_power: Array  # W
    engine_energy: Array  # J, once; NaN beyond stall
    engine_power: Array  # W, of holding the volume and pressing out what leaks in
    break_even: Array  # s, after which the engine has taken less; inf where never


@dataclass(frozen=True, kw_only=True)
class Profiling:
    """A dive to each depth and back; arrays over the depths [k]. NaN where it cannot be done."""

    speed: float  # m/s
    depth: Array  # m, of the turn
    engine: Array  # J
    thruster: Array  # J
    drag: Array  # J, done on the water by the drag down and up: 2 F z where that is the same
    stroke_depth: float  # m, down to which the stroke suffices
    break_even: float  # m, from where on the engine takes less; inf where never, 0 where always


def hovering(found: DriveEnergy, thruster: Thruster, *, weight_error: float) -> Hovering:
    """Return what holding each depth costs with a `weight_error` [m3], by engine and thruster.

    Raises InputError where the weight error is not above 0.
    """
    check_number(weight_error, "weight_error", "m3", above=0.0)
    column, m = found.column, found.map
    weight = column.density * column.gravity * weight_error
    power = thruster.power(weight, column.density)
    once = found.per_volume * (weight_error + m.start_volume) - m.start_saving
    hold = m.holding_power + np.where(m.leakage > 0.0, m.leakage * found.per_volume, 0.0)
    spared = power - hold
    later = np.divide(once, spared, out=np.full(spared.shape, np.inf), where=spared > 0.0)
    return Hovering(
        weight_error=weight_error,
        thrust=weight,
        thruster_power=power,
        engine_energy=once,
        engine_power=hold,
        break_even=np.where(np.isfinite(once), later, np.inf),
    )


def profiling(found: DriveEnergy, thruster: Thruster, *, speed: float) -> Profiling:
    """Return what a dive to each depth and back costs at a constant `speed` [m/s].

    Raises InputError where the speed is not above 0.
    """
    check_number(speed, "speed", "m/s", above=0.0)
    vehicle, column = found.vehicle, found.column
    z = np.linspace(0.0, column.deepest, _POINTS + 1)
    over_depth = (neutral_volume(vehicle, column), column.density)
    neutral, density = (np.interp(z, column.depth, values) for values in over_depth)
    force, back = drag_force(vehicle.drag, speed), -drag_force(vehicle.drag, -speed)
    weight = density * column.gravity
    out = np.interp(z, column.depth, found.per_volume)
    flows = np.isfinite(found.per_volume_in)  # at the very surface nothing presses the oil in
    into = np.full(z.shape, np.nan)  # nothing comes in: a battery too weak for the valve
    if flows.any():
        into = np.interp(z, column.depth[flows], found.per_volume_in[flows])
    m = found.map
    idle = m.holding_power + np.where(m.leakage > 0.0, m.leakage * found.per_volume, 0.0)
    rest = np.interp(z, column.depth, idle)
    sinking, rising = neutral - force / weight, neutral + back / weight
    down = _along(sinking, out, into)
    up = _along(rising[::-1], out[::-1], into[::-1])
    up = up[-1] - up[::-1]  # from each depth to the surface
    turn = (rising - sinking) * out
    surface = (rising[0] - sinking[0]) * into[0]
    held = 2.0 * cumulative_trapezoid(rest, z, initial=0) / speed
    engine = np.where(np.isfinite(turn), down + turn + up + surface + held, np.nan)
    highest = np.maximum.accumulate(np.maximum(rising, sinking))
    lowest = np.minimum.accumulate(np.minimum(rising, sinking))
    fits = (highest <= vehicle.stroke.maximum) & (lowest >= vehicle.stroke.minimum)
    engine = np.where(fits, engine, np.nan)

    def pushing(k: int) -> float:
        """Return the energy [J] of the thruster for a dive to the k-th depth and back."""
        part = neutral[: k + 1]
        lift = weight[: k + 1] * (0.5 * (part.min() + part.max()) - part)
        down, up = (
            thruster.power(drag + way * lift, density[: k + 1], speed)
            for drag, way in ((force, 1.0), (back, -1.0))
        )
        return float(np.trapezoid(down + up, z[: k + 1]) / speed)

    pushed = np.array([pushing(k) for k in range(z.size)])
    reached = z[: np.argmin(fits)].max(initial=-math.inf)  # before the first that does not fit
    return Profiling(
        speed=speed,
        depth=z,
        engine=engine,
        thruster=pushed,
        drag=(force + back) * z,
        stroke_depth=math.inf if fits.all() else float(reached),
        break_even=_crossing(z, engine, pushed),
    )


def _along(volume: Array, out: Array, into: Array) -> Array:
    """Return the energy [J] of following a volume up to each of its places."""
    change = np.diff(volume)
    price = np.where(change > 0.0, out[1:] + out[:-1], -(into[1:] + into[:-1]))
    cost = np.where(change == 0.0, 0.0, 0.5 * price * change)
    return np.concatenate(([0.0], np.cumsum(cost)))


def _crossing(z: Array, engine: Array, thruster: Array) -> float:
    """Return the depth from which on the engine takes less than the thruster, as far as known."""
    known = np.isfinite(engine) & (z > 0.0)
    dearer = known & (engine >= thruster)
    if not known.any():
        return math.inf
    if not dearer.any():
        return 0.0
    last = int(np.flatnonzero(dearer)[-1])
    if last == int(np.flatnonzero(known)[-1]):
        return math.inf
    gap = engine[last : last + 2] - thruster[last : last + 2]
    return float(z[last] + (z[last + 1] - z[last]) * gap[0] / (gap[0] - gap[1]))


_ROWS = 201  # depths in tables, at most
_DRIVE = "vehicle=vehicle.name actuator=vehicle.actuator.kind stall_depth_m stall_pressure_Pa=stall"
_HOVERING = "thrust_N thruster_power_W engine_energy_J engine_power_W break_even_s"


@dataclass(frozen=True)
class Energy(Answer):
    """The drive's energy over depth, and two tasks beside a thruster's.

    warnings: of the water.
    """

    drive: DriveEnergy
    hover: Hovering
    dive: Profiling
    thruster: Thruster
    warnings: tuple[str, ...]

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle whose drive it is."""
        return self.drive.vehicle

    @property
    def sentences(self) -> list[str]:
        """The answer in words."""
        versus = versus_sentences(self.hover, self.dive, self.drive)
        return [*self.warnings, *drive_sentences(self.drive), *versus]

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What is taken for granted."""
        thruster, usual, assumed = self.thruster, Thruster(), ""
        stated = ("diameter", "efficiency", "idle_power")
        if any(getattr(thruster, name) == getattr(usual, name) for name in stated):
            assumed = (
                "; if not said, 76 mm, 35 % and no idle power, after the maker's curves of a T200"
            )
        said = [
            f"the water: {self.drive.column.source}, {self.drive.column.deepest:g} m deep",
            f"{thruster.number} thruster{'s' if thruster.number > 1 else ''} of "
            f"{thruster.diameter * 1e3:.3g} mm with {100.0 * thruster.efficiency:.0f} % of an "
            f"ideal disc's efficiency and {thruster.idle_power:g} W of idle power each "
            f"(`diameter=`, `efficiency=`, `number=`, `idle_power=`{assumed})",
            "steady speeds at full voltage; processor, sensors and driver's standby not counted",
            oil_note(self.vehicle),
            *self.drive.column.report,
        ]
        return tuple(line for line in said if line is not None)

    def columns(self) -> dict[str, Any]:
        """Return the columns of energy.csv: a row per depth."""
        return depth_columns(self.drive, self.hover)

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers of the answer, SI units, every depth of the tables."""
        found, hover, dive = self.drive, self.hover, self.dive
        rows = spread_indices(found.column.depth.size, _ROWS)
        return {
            **attributes(found, _DRIVE),
            "depths": depth_columns(found, hover),
            "efficiency_map": {
                "voltage_share": found.shares,
                "depth_m": found.column.depth[rows],
                "efficiency": found.efficiencies[:, rows],
            },
            "hovering": {
                "depth_m": found.column.deepest,
                "weight_error_m3": hover.weight_error,
                **{key: values[-1] for key, values in attributes(hover, _HOVERING).items()},
            },
            "profiling": {
                "speed_m_s": dive.speed,
                **dive_columns(dive),
                **attributes(dive, "stroke_depth_m break_even_m"),
            },
            "thruster": as_json(self.thruster, "diameter_m efficiency number idle_power_W"),
            **attributes(self, "sentences assumptions"),
        }


def energy(
    vehicle: Vehicle,
    cast: Cast | None = None,
    *,
    max_depth: float | None = None,
    weight_error: float = 10e-6,
    speed: float = 0.1,
    thruster: Thruster | None = None,
) -> Energy:
    """Find what changing the volume costs at each depth, and what a thruster would.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.
    max_depth
        How deep [m]; none: the vehicle's rating, or where the cast ends above that.
    weight_error
        By which the vehicle is too heavy while it hovers [m3].
    speed
        Of dives [m/s].
    thruster
        What the drive is compared with; none: as `Thruster` has it.

    Returns
    -------
    Energy
        Energy per volume and efficiency over depth, hovering and dives beside the thruster.

    Raises
    ------
    InputError
        A number makes no sense, or the cast may be in another unit.
    NoAnswerError
        The drive's electrical power is not known.
    """
    water, warnings = sea(vehicle, cast, max_depth)
    found, thruster = drive_energy(vehicle, water), thruster or Thruster()
    hover = hovering(found, thruster, weight_error=weight_error)
    return Energy(found, hover, profiling(found, thruster, speed=speed), thruster, tuple(warnings))


def depth_columns(found: DriveEnergy, hover: Hovering) -> dict[str, Any]:
    """Return the columns over some of the depths, evenly spread."""
    columns = {
        **attributes(found.column, "depth_m pressure_Pa"),
        **attributes(found.map, "rate_out_m3_s power_out_W"),
        **attributes(found, "energy_per_volume_J_m3=per_volume efficiency"),
        **{f"efficiency_{name}": values for name, values in found.stages.items()},
        **attributes(found.map, "rate_in_m3_s power_in_W holding_power_W leakage_m3_s"),
        "start_volume_m3": found.map.start_volume,
        "break_even_s": hover.break_even,
    }
    rows = spread_indices(found.column.depth.size, _ROWS)
    return {name: column[rows] for name, column in columns.items()}


def dive_columns(dive: Profiling) -> dict[str, Any]:
    """Return the columns of dives, a row per depth."""
    return attributes(dive, "depth_m engine_J thruster_J drag_J")


def spread_indices(count: int, most: int) -> Any:
    """Return which of `count` stand in a table of at most so many: the first and the last in."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


_LEAST, _MOST = 0.1, 1.1  # efficiencies that no pump has are beyond
_DAY, _HOUR, _MINUTE = 86400.0, 3600.0, 60.0


def drive_sentences(found: DriveEnergy) -> Iterator[str]:
    """Yield what volume costs at the deepest depth, and where the drive stalls."""
    z, m, rating = found.column.deepest, found.map, found.vehicle.hull.depth_limit
    if rating is not None and z > rating * (1.0 + 1e-9):
        yield f"{z:g} m is deeper than the vehicle is rated for, {rating:g} m."
    if m.rate_out[-1] > 0.0:
        rate = f"{m.rate_out[-1] * 1e6:.3g} mL/s with {m.power_out[-1]:.3g} W"
        takes = f"Increasing the volume at {z:g} m takes {found.per_volume[-1] * 1e-6:.3g} J/mL"
        yield f"{takes}: {rate}, an efficiency of {100.0 * found.efficiency[-1]:.0f} %."
    else:
        yield f"At {z:g} m the drive stalls."
    if math.isinf(found.stall):
        yield "It stalls at no depth of the sea."
    else:
        yield f"It stalls at {rounded(found.stall_depth)} m ({rounded(found.stall / 1e5)} bar)."
    if m.holding_power[-1] > 0.0:
        yield f"Holding the volume there takes {m.holding_power[-1]:.3g} W all the time."
    if m.start_volume[-1] > 0.0:
        yield f"Each start of the pump there loses {m.start_volume[-1] * 1e6:.3g} mL."


def versus_sentences(hover: Hovering, dive: Profiling, found: DriveEnergy) -> Iterator[str]:
    """Yield who takes less, and from where on."""
    z = found.column.deepest
    once, power, later = hover.engine_energy[-1], hover.thruster_power[-1], hover.break_even[-1]
    what = f"Hovering at {z:g} m with {hover.weight_error * 1e6:.3g} mL too heavy"
    if math.isnan(once):
        yield f"{what}: not by this engine, it has stalled; a thruster takes {power:.3g} W."
    elif math.isinf(later):
        yield f"{what}: the thruster takes less, {power:.3g} W, however long it lasts."
    else:
        held = f" and {hover.engine_power[-1]:.2g} W" if hover.engine_power[-1] > 0.0 else ""
        takes = f"the engine takes {rounded(once, 3)} J once{held}, a thruster {power:.3g} W"
        yield f"{what}: {takes}; after {_time(later)} the engine has taken less."
    what = f"Down to {z:g} m and back at {dive.speed:g} m/s"
    engine, thruster, drag = (rounded(x[-1]) for x in (dive.engine, dive.thruster, dive.drag))
    if math.isnan(dive.engine[-1]):
        why = "the drive stalls on the way"
        if dive.stroke_depth < z:
            why = f"the stroke suffices to {rounded(max(dive.stroke_depth, 0.0))} m only"
        yield f"{what}: not by this engine, {why}; a thruster takes {thruster} J."
        return
    takes = f"the engine takes {engine} J, a thruster {thruster} J"
    yield f"{what}: {takes}; the drag alone is {drag} J."
    if dive.break_even == 0.0:
        yield "The engine takes less on dives to any depth."
    elif math.isinf(dive.break_even):
        yield "The thruster takes less on dives to any depth down to there."
    else:
        yield f"The engine takes less on dives to {rounded(dive.break_even, 3)} m or deeper."


def fit_sentences(fit: PumpFit, vehicle: Vehicle | None = None) -> Iterator[str]:
    """Yield the result of a fit, how well dives are predicted, and what a vehicle got."""
    runs = f"{int(fit.kept.sum())} runs" + (f" of {fit.clusters} dives" if fit.dives else "")
    if fit.refusal:
        yield f"Not identified: {fit.refusal}."
    off = fit.volume_rms
    volumes = "" if math.isnan(off) else f", volumes within {off * 1e6:.2g} mL"
    yield f"{runs}: power within {fit.power_rms:.2g} W rms{volumes}."
    energies = [d.predicted / d.energy - 1.0 for d in fit.dives if d.energy > 0.0]
    pressed = [d.predicted_volume / d.volume - 1.0 for d in fit.dives if d.volume > 0.0]
    for what, errors in (("energy predicted from the others", energies), ("volume", pressed)):
        if errors:
            middle, worst = (_percent(f(np.abs(errors))) for f in (np.median, np.max))
            yield f"Each dive's {what}: within {middle} (median), {worst} at worst."
    if fit.by_volume:
        yield "The runs were commanded by volume, which hardly differs: it is their times that err."
    if "delivery" in fit.parameters and "slip" not in fit.parameters:
        yield "The runs deliver no less under pressure: there is no slip that they show."
    slope = fit.value("power_per_pressure")
    if "delivery" in fit.parameters and slope > 0.0:
        reaches = fit.value("delivery") / slope  # of the power that grows with the pressure
        usual = "" if _LEAST < reaches < _MOST else ": check them"
        share = f"of what more pressure takes, {_percent(reaches)} would reach the water"
        scale = "A wrong scale of pressures or volumes shows in the efficiency only"
        yield f"{scale}: {share} (pumps: 30 to 90 %){usual}."
    yield from _voltage(fit, vehicle)
    left = int((~fit.kept).sum())
    if left:
        which = "too short, there already, without pressure or power, or a valve's"
        yield f"{left} runs were left out: {which}."
    if "delivery" not in fit.parameters:
        yield "No volumes were measured: the delivery is not identifiable."


def _voltage(fit: PumpFit, vehicle: Vehicle | None) -> Iterator[str]:
    """Yield what the battery's voltage has to do with the powers."""
    volts = np.array([]) if fit.runs.voltage is None else fit.runs.voltage[fit.kept]
    volts = volts[volts > 0.0]
    span = f"{volts.min():.4g} to {volts.max():.4g} V" if volts.size else ""
    if fit.reference_voltage is not None:
        at = f"the numbers are those at {fit.reference_voltage:.4g} V, the median"
        yield f"Power goes with the battery's voltage under load, {span}; {at}."
        if vehicle is not None and vehicle.supply is not None:
            factor = voltage_factor(vehicle.supply, fit)
            what = "power and delivery are" if "delivery" in fit.parameters else "power is"
            given = f"{factor * fit.reference_voltage:.4g} V under that load"
            yield f"The vehicle's supply gives {given}: its {what} {factor:.3g} times that."
    elif span:
        why = "dives are predicted no better with it, or it hardly varies, or too few runs have one"
        yield f"The voltage, {span}, is not counted: {why}."


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _time(seconds: float) -> str:
    for size, name in ((_DAY, "d"), (_HOUR, "h"), (_MINUTE, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {name}"
    return f"{seconds:.3g} s"
