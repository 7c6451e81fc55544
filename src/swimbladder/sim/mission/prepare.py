"""From a vehicle, a mission and the water to the arrays that the kernel flies.

Among them how deep the water lets the vehicle come up again at full buoyancy, by a flight of the
mission's own kernel, and the swell as a free vehicle meets it: vehicle and surface go up and down
with the water. Depths of a mission are those of pressure, which under waves over deep water stays
the same along the path of a parcel of water (linear theory: the pressure of the wave and that of
the way up and down cancel; Kundu, Cohen, Dowling, *Fluid Mechanics*, 5th ed., section 7.4). A
vehicle as heavy as the water goes its way; so its depth below the surface, where the surface stands
at 0, does not see the swell but for the second order in its steepness. What a pressure sensor at
the top of the hull does see is how far the water there goes beyond the mean of the water along the
hull, of height H:

    a e^(-k z) (1 - (1 - e^(-k H))/(k H)) sin(2 pi t/period + phase),   k = (2 pi/period)^2/g
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from swimbladder.control.law import leaves, numbers
from swimbladder.control.rate import RATE
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.physics.arrays import Array
from swimbladder.physics.battery import hotel_power, surfacing_energy, usable_charge
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import heat_expansion
from swimbladder.physics.seawater import (
    Cast,
    Column,
    WaterMotion,
    cast_column,
    check_motion,
    check_rows,
    look_up,
    motion_table,
    uniform_column,
)
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.floats import surfacing_of
from swimbladder.sim.closed_loop.pumped import BOARD
from swimbladder.sim.closed_loop.supervision import Supervision
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.sim.engine.advance import DONE, advance, begin, new_lane
from swimbladder.sim.engine.chain import base_steps
from swimbladder.sim.engine.modes import Where
from swimbladder.sim.engine.rodas.prepare import Accuracy, first_lane, given_of, make_table
from swimbladder.sim.engine.rodas.records import (
    NOTE,
    WORK,
    Account,
    Lane,
    Records,
    Stop,
    Table,
    made,
)
from swimbladder.sim.mission.core.hooks import DEAD, fly
from swimbladder.sim.mission.core.phases import CYCLE, ROW, STAGE, Grounding, Holding, Kind, Phases
from swimbladder.sim.mission.orders import (
    PhaseLaw,
    approach_time,
    flown_laws,
    hold_parameters,
    law_parameters,
)
from swimbladder.vehicle import Vehicle

_NO_LAYER = 1e-12  # m3: what rounding makes of water of uniform density
_MARGIN = 1.1  # of the deepest phase: how far down the vehicle's own water is tabulated, and
_BELOW = 50.0  # m more


def water_of(vehicle: Vehicle, mission: Mission, cast: Cast | None = None) -> Column:
    """Return the water of a cast, or the vehicle's own, as deep as a mission goes.

    Parameters
    ----------
    vehicle, mission
        As `load_vehicle` and `load_mission` return them.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.

    Returns
    -------
    Column
        The water over depth. Where the cast may be in another unit, its report says it.

    Raises
    ------
    InputError
        The cast is in another unit, it begins far below the surface, or the mission gives the
        latitude of a cast that there is not.
    """
    deepest = max([mission.start_depth, *(mission.reached(phase) for phase in mission.phases)])
    if cast is None:
        if (place := mission.latitude) is not None:
            why = "it says where a cast was taken, and there is none"
            how = "Give `cast=`, or leave it out"
            raise InputError(why, field="latitude", value=place, unit="deg", remedy=how)
        return uniform_column(vehicle.water, _MARGIN * deepest + _BELOW)
    warning = check_cast_unit(cast, deepest, vehicle.hull.depth_limit)
    column = cast_column(cast)
    check_rows(column)
    return replace(column, report=(*column.report, warning)) if warning else column


def seen_share(wavenumber: float, height: float) -> float:
    """Return what a sensor at the top sees of the water's displacement there [-].

    wavenumber [1/m]; height of the hull [m].
    """
    x = wavenumber * height
    return 1.0 + math.expm1(-x) / x


def waves_of(motion: WaterMotion, height: float, gravity: float) -> Array:
    """Return the waves as the kernel takes them [n, 6], see `seawater.motion_table`.

    Internal waves as they are. Swell with the amplitude that the sensor sees and a last column of
    -inf: it moves nothing. height: of the hull [m].
    """
    table = motion_table(motion, gravity)
    for row in table:
        if row[4] > 0.0:
            row[0] *= seen_share(float(row[4]), height)
            row[5] = -math.inf
    return table


def medium_for(vehicle: Vehicle, mission: Mission, column: Column) -> Medium:
    """Return the vehicle in the water of a mission; in water of uniform density as in its own."""
    depths = [phase.depth for phase in mission.phases if phase.depth is not None]
    reach = max([mission.start_depth, *depths])
    found = medium_of(vehicle, column, reach=reach, bottom_depth=mission.bottom)
    own = medium_of(vehicle, None, reach=reach, bottom_depth=mission.bottom)
    even = found.layers.largest <= _NO_LAYER
    return own if even and math.isclose(found.plant.a_b, own.plant.a_b, rel_tol=1e-9) else found


_HASTE = 2.0  # times the speed that is asked for: so fast it may sink while nobody looks
_FINE = 0.005  # of the depth at which it could not even rest: so near the return depth is found
_LONGEST = 86400.0  # s to come up in
_HELD = 10.0  # s, of a step with a held input at the longest
_GONE = 2.0  # times the depth at which it could not even rest: it is lost
_START_ROWS = 200  # of a trajectory, in which a start is over
_OUT = 1e-10  # m3: so much pressed out is no rounding


def return_depth(vehicle: Vehicle, mission: Mission, plan: Plan) -> float:
    """Return the depth below which a vehicle could not come up [m]; infinite where it always could.

    There its neutral volume is beyond the stroke less what safety.stroke keeps back, or the drive
    stalls; or, where such a depth is, it sinks through it before all is pressed out, from twice the
    speed of the fastest phase: it is flown from there.
    """
    g, neutral = plan.given, plan.table[:, Table.NEUTRAL]
    step = float(g["step"])
    most = g["v_max"] - mission.safety.stroke * (g["v_max"] - g["v_min"])
    lost = (neutral > most) | (plan.table[:, Table.RATE_OUT] <= 0.0)
    lost[: int(g["z_surface"] / step) + 1] = False
    slope = float(plan.table[-1, Table.NEUTRAL + 1])
    if lost.any():
        limit = float(np.argmax(lost)) * step
    elif slope > 0.0:  # beyond the table the neutral volume goes on straight
        limit = float(step * (len(neutral) - 1) + (most - neutral[-1]) / slope)
    else:
        return math.inf
    speed = _HASTE * float(np.max(plan.stages["speed"]))
    held = drag_force(vehicle.drag, speed) / vehicle.water.specific_weight
    comes_up = partial(_comes_up, plan, speed=speed, less=held)
    if plan.water is not None:
        free = replace(plan.water, plant=plan.water.plant._replace(z_bottom=math.inf))
        comes_up = partial(_emerges, free, speed=speed, less=held, gone=_GONE * limit)
    low, high = 0.0, limit
    if comes_up(limit):
        return limit
    while high - low > _FINE * limit:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if comes_up(middle) else (low, middle)
    return low


def _comes_up(plan: Plan, depth: float, *, speed: float, less: float) -> bool:
    """Return whether a vehicle that sinks at a depth [m] by a speed [m/s] is afloat within a day.

    less [m3]: below the neutral volume.
    """
    plan, state, _ = _pressing(plan, depth, less)
    x, at, _ = state
    x["w"] = speed
    fly(plan.under_way(state))
    return Stop(int(at["stop"])) is Stop.PASSED_DEPTH


def _emerges(medium: Medium, depth: float, *, speed: float, less: float, gone: float) -> bool:
    """Return what `_comes_up` does of a vehicle that sampled laws fly, with its input held.

    By the step that every law's kernel has in it, which need not be compiled for this. gone [m]: so
    deep it is lost.
    """
    p, layers = medium.plant, medium.layers
    volume = max(medium.neutral_volume(depth) - less, p.V_min)
    h, t = _HELD / base_steps(p, _HELD, speed, layers), 0.0
    lane = new_lane(np.array(p), layers, np.array([0.0, volume, depth, speed]))
    mode, full = begin(lane), p.V_max if p.positioner else p.supply
    while t < _LONGEST and lane.x[2] < gone:
        mode, why = advance(lane, mode, full, h, t)
        t += h
        if why != DONE or mode // 20 == Where.EMERGING:
            return bool(why == DONE)
    return False


def start_time(plan: Plan, depth: float) -> float:
    """Return how long the pump runs at a depth [m] before anything is pressed out [s].

    Its line is empty, and its runs have no end; infinite where nothing is pressed out in a day.
    """
    plan, state, volume = _pressing(plan, depth, 0.0)
    plan.given["longest"] = math.inf
    flown = plan.under_way(state, rows=_START_ROWS)
    fly(flown)
    rows = flown.rows[: flown.lane.counts[0]]
    out = rows["v"] - volume
    if not np.any(out > _OUT):
        return math.inf
    n = int(np.argmax(out > _OUT))
    rate = look_up(plan.table, float(plan.given["step"]), Table.RATE_OUT, rows["z"][n])[0]
    return float(rows["t"][n] - out[n] / (rate * plan.given["delivery"]))


def _pressing(plan: Plan, depth: float, less: float) -> tuple[Plan, Any, float]:
    """Return a plan without bottom, waves and battery, and a state in it that begins to press out.

    depth [m]; less [m3]: below the neutral volume; the volume is the last that is returned.
    """
    given = made(plan.given.dtype, plan.given)
    given["z_bottom"], given["deepest"], given["empty"] = math.inf, math.inf, -math.inf
    neutral = look_up(plan.table, float(given["step"]), Table.NEUTRAL, depth)[0]
    volume = max(float(neutral) - less, float(given["v_min"]))
    x, at = first_lane(given, plan.table, depth, volume=volume)
    x["t_end"], at["alarm"] = _LONGEST, 1
    accounts = np.zeros(len(Account) + len(Holding) * len(plan.stages))
    return replace(plan, given=given, waves=plan.waves[:0]), (x, at, accounts), volume


State = tuple[np.record, np.record, Array]  # of `first_state`

_MOST = 10**9  # samples of a mission: minutes
_MANY = 5e7  # of them, from which on they are worth a word
_SAMPLE, _TICK = 2e-7, 1.5e-6  # s that one takes to compute, of a float's board; over a month
HELD = 0.9  # share of its time that a park or hold has to be within its tolerance
_SEEN = 6.0  # standard deviations of the depth that are no change of it
_TOO_MUCH = 0.1  # share of the stroke that is let in without sinking only on the bottom
SHALLOW = 5.0  # m; a float of the MERMAID kind counts as diving from 0.5 bar on


@dataclass(frozen=True, kw_only=True)
class DriveError:
    """What a drive really gives, over what its processor takes the vehicle's file to say.

    starts: whether a run is longer by what its start falls short of.
    """

    pump: float = 1.0
    valve: float = 1.0
    starts: bool = True


@dataclass(frozen=True)
class Plan:
    """What the kernel takes that does not change: see `engine.rodas.records`."""

    given: np.record
    table: Array
    waves: Array
    stages: Records
    energy_known: str  # why no electrical energy is known; "" where it is
    laws: tuple[PhaseLaw, ...] = ()  # of each phase; none: the mission's own rule flies
    water: Medium | None = None  # the vehicle as of its file in the water in which the laws fly it
    back: float = math.inf  # m, see `return_depth`
    watch: Supervision | tuple[()] = ()  # the supervisor over the laws, as it begins

    @property
    def supervised(self) -> bool:
        """Whether a supervisor watches the laws."""
        return bool(self.watch)

    @property
    def by_laws(self) -> bool:
        """Whether other laws than `rate` fly it, whose speeds nobody has stated."""
        return bool(self.laws) and (self.laws[0].law.within or self.laws[0].law) is not RATE

    @property
    def longest(self) -> float:
        """How long the mission lasts at most [s]."""
        cycle = float(np.sum(self.stages["duration"] + self.stages["timeout"]))
        return min(float(self.given["last_time"]), cycle * float(self.given["last_cycle"]))

    def medium(self, vehicle: Vehicle) -> Medium:
        """Return the vehicle in its water: a float of this plan may differ from its file."""
        assert self.water is not None  # sampled laws fly it
        g, p = self.given, self.water.plant
        delivery = float(g["delivery"])
        mass = float(g["mass"]) / vehicle.mass
        own = p._replace(
            V_0=p.V_0 + float(g["trim"]),
            psi=p.psi + float(g["give"]),
            gain=p.gain * delivery,
            rate=p.rate * delivery,
            kappa=p.kappa / delivery,
            a_b=p.a_b / mass,
            a_s=p.a_s / mass,
            d_l=float(g["d_l"]),
            d_b=float(g["d_b"]),
            d_0=float(g["d_0"]),
            d_t=float(g["d_t"]),
        )
        return replace(self.water, plant=own)

    def under_way(self, state: State, *, rows: int = 0, notes: int = 0, cycles: int = 1) -> Phases:
        """Return the mission in a state of `first_state`, with buffers of so many lines."""
        kept, counts = np.zeros(notes, NOTE), np.zeros(3, np.int64)
        lane = Lane(self.given, self.table, self.waves, *state, kept, counts, np.zeros(WORK))
        made = np.zeros(rows, ROW), np.zeros(cycles, CYCLE)
        laws = self.laws if self.water is None else ()
        own = [list(numbers(law.parameters)) for law in laws] or [[]] * len(self.stages)
        return Phases(lane, self.stages, *made, board=np.zeros(BOARD), numbers=np.array(own, float))


def cost_words(mission: Mission, laws: Sequence[PhaseLaw]) -> list[str]:
    """Say what laws cost that are called very often in all cycles, but where they may rest.

    Raises NoAnswerError where that is too often to be flown.
    """
    cycle, span = sum(phase.duration or 0.0 for phase in mission.phases), mission.span
    cycles = mission.cycles or (math.inf if math.isfinite(span) else 1)
    if cycle > 0.0 and math.isfinite(span):
        cycles = min(cycles, max(math.ceil(span / cycle), 1))
    awake = [
        (cycles * phase.duration / law.sample_time, phase, law)
        for phase, law in zip(mission.phases, laws, strict=False)
        if law.sampled and phase.duration and phase.rest_band is None
    ]
    samples = sum(count for count, _, _ in awake)
    if samples < _MANY:
        return []
    _, phase, law = max(awake, key=lambda one: one[0])
    board = law.law.within is not None
    what = (
        f"{samples / 1e6:.4g} million samples in {cycles:g} cycle{'s' if cycles > 1 else ''}, most "
        f"by the law {law.law.name!r} every {law.sample_time:g} s in the phase {phase.title!r}: "
        f"about {samples * (_TICK if board else _SAMPLE):.0f} s of computing"
    )
    remedy = (
        "Let it rest (rest_band, of a park or hold), take a longer sample_time, or write "
        f'law = "{RATE.name}" in every phase, which samples seldom'
    )
    if board:
        remedy = "Give its [controller] a longer sample_time, or `supervised=False`"
    if samples > _MOST:
        raise NoAnswerError(f"{what}, and more than the {_MOST / 1e6:g} million flown. {remedy}")
    return [f"{what}. {remedy}"]


def make_plan(
    vehicle: Vehicle,
    mission: Mission,
    column: Column,
    *,
    waves: Array | None = None,
    accuracy: Accuracy | None = None,
    drive_error: DriveError | None = None,
    supervised: bool | None = None,
) -> Plan:
    """Return a mission as the kernel takes it.

    waves: of `waves_of`, in the place of the mission's. drive_error: what the drive
    gives over what its processor assumes. supervised: as of `phase_laws.watch_of`, which raises its
    InputError; another is raised for a temperature at the start of a hull that has the water's.
    """
    laws, watch = flown_laws(vehicle, mission, supervised)
    _check_warmth(vehicle, mission)
    given = given_of(vehicle, column, bottom=mission.bottom, accuracy=accuracy or Accuracy())
    table, why = make_table(vehicle, column)
    moving = waves
    if moving is None:
        check_motion(mission.water_motion, column)
        moving = waves_of(mission.water_motion, vehicle.hull.height, column.gravity)
    floats = vehicle.command == "volume change"
    sampled = any(law.sampled for law in laws)
    water = medium_for(vehicle, mission, column) if sampled and not floats else None
    cold = coldest(mission, table, float(given["step"]))
    for name, value in _asked(vehicle, mission, cold).items():
        given[name] = value
    of = drive_error or DriveError()
    given["delivery"], given["flow"], given["makes_up"] = of.pump, of.valve, float(of.starts)
    stages = _stages(vehicle, mission, table, float(given["step"]))
    for n, law in enumerate(() if sampled else laws):  # of volume changes
        up, pause = surfacing_of(vehicle, leaves(law.parameters))
        stages["law"][n, [0, DEAD]] = up.slack / stages["speed"][n] ** 2, pause
    plan = Plan(given, table, moving, stages, why, laws, water, watch=watch)
    back = return_depth(vehicle, mission, plan)
    limit = vehicle.hull.depth_limit or math.inf
    given["deepest"] = mission.safety.deepest or min(limit, back)
    return replace(plan, back=back)


def ground_volume(vehicle: Vehicle, mission: Mission) -> float:
    """Return the volume by which it takes itself to be grounded [m3].

    Raises InputError for one that is more than the stroke.
    """
    ground, stroke = mission.grounding, vehicle.stroke
    assert ground is not None
    whole = stroke.maximum - stroke.minimum
    if ground.volume is not None and ground.volume >= whole:
        what = f"the whole stroke is {1e6 * whole:.4g} cm3"
        remedy, field = "Give less, or leave it out", "grounding.volume"
        raise InputError(what, field=field, value=ground.volume, unit="m3", remedy=remedy)
    return ground.volume or _TOO_MUCH * whole


def _check_warmth(vehicle: Vehicle, mission: Mission) -> None:
    if mission.start_temperature is None:
        return
    if vehicle.hull.thermal_time_constant > 0.0 and heat_expansion(vehicle) != 0.0:
        return
    what = (
        f"it changes nothing: the hull of {vehicle.name!r} has the water's temperature at once, or "
        "does not expand"
    )
    remedy = (
        "Leave it out, or give the vehicle hull.thermal_time_constant and [[hull.parts]] with a "
        "thermal_expansion"
    )
    field, value = "start_temperature", mission.start_temperature
    raise InputError(what, field=field, value=value, unit="degC", remedy=remedy)


def shallow_depth(vehicle: Vehicle, mission: Mission) -> float:
    """Return the depth above which the vehicle is about to dive, or has come up [m]."""
    laws = ((phase, law_parameters(vehicle, phase)) for phase in mission.phases)
    depths = [phase.depth - law.tolerance for phase, law in laws if phase.depth is not None]
    top = vehicle.hull.emergence_depth
    return max(min(SHALLOW, 0.5 * min(depths, default=0.0)), top + 0.1 * vehicle.hull.height)


def _asked(vehicle: Vehicle, mission: Mission, cold: float) -> dict[str, float]:
    """Return what a mission limits and asks for, by the names of the record; cold [degC]."""
    empty, reserve, charge = _battery(vehicle, mission.safety.battery, cold)
    shallow = shallow_depth(vehicle, mission)
    once = math.inf if math.isfinite(mission.span) else 1.0
    return {
        "v_min": vehicle.stroke.lowest,  # a limit switch ends what the drive can do
        "v_max": vehicle.stroke.highest,
        "shallow": shallow,
        "empty": empty,
        "reserve": reserve,
        "last_time": mission.span,
        "last_cycle": mission.cycles or once,
        "surfacing": surfacing_energy(vehicle),
        "self_discharge": _self_discharge(vehicle),
        "charge": charge,
        "held": HELD,
        **_avoided(vehicle, mission, shallow),
    }


def _avoided(vehicle: Vehicle, mission: Mission, shallow: float) -> dict[str, float]:
    """Return how it finds bottom and ice, and what it does then, by the names of the record.

    shallow: depth above which it counts as at the surface [m].
    """
    found = {"ice_temperature": -math.inf}
    if (ground := mission.grounding) is not None:
        found["ground_volume"] = ground_volume(vehicle, mission)
        if mission.bottom <= shallow:
            counts = f"down to {shallow:.3g} m the vehicle counts as at the surface"
            what, field = f"{counts}, and finds no bottom", "bottom_depth"
            remedy = "Leave [grounding] out, and ask for depths above the bottom"
            raise InputError(what, field=field, value=mission.bottom, unit="m", remedy=remedy)
        noise = _SEEN * vehicle.sensors.depth_noise
        if ground.change <= noise:
            what = f"the noise of the depth alone changes it by up to {noise:.3g} m"
            remedy, field = "Give more, or a better sensor", "grounding.change"
            raise InputError(what, field=field, value=ground.change, unit="m", remedy=remedy)
        found["ground_change"], found["ground_time"] = ground.change, ground.time
        found["ground_shift"], found["ground_least"] = ground.shift, ground.least_depth
    if (ice := mission.ice) is not None:
        if ice.stop_depth <= shallow:
            what = f"from {shallow:.3g} m up the vehicle counts as at the surface"
            remedy, field = "Turn back deeper", "ice.stop_depth"
            raise InputError(what, field=field, value=ice.stop_depth, unit="m", remedy=remedy)
        found["ice_temperature"] = ice.temperature
        found["ice_from"], found["ice_to"] = ice.start_depth, ice.stop_depth
        found["ice_wait"] = ice.wait
        found["ice_longest"] = math.inf if ice.longest is None else ice.longest
    return found


def _self_discharge(vehicle: Vehicle) -> float:
    """Return it [1/s]; 0 where what is in the battery is not known."""
    supply = vehicle.supply
    return supply.self_discharge if supply is not None and supply.capacity is not None else 0.0


def _battery(vehicle: Vehicle, reserve: float, cold: float) -> tuple[float, float, float]:
    """Return the charges [J] at which the battery is empty, at which its reserve begins, and full.

    reserve: share that is kept. Empty is what the coldest water, `cold` [degC], holds back;
    infinite where nothing is known.
    """
    supply = vehicle.supply
    if supply is None or supply.capacity is None:
        return -math.inf, -math.inf, 0.0
    full = supply.capacity
    usable = float(usable_charge(supply, full, cold))
    return full - usable, full - usable * (1.0 - reserve), full


def coldest(mission: Mission, table: Array, step: float) -> float:
    """Return the lowest temperature on the way of a mission [degC]."""
    depths = [mission.reached(phase) for phase in mission.phases]
    within = step * np.arange(len(table)) <= max([*depths, mission.start_depth])
    return float(np.min(table[within, Table.TEMPERATURE]))


def _stages(vehicle: Vehicle, mission: Mission, table: Array, step: float) -> Records:
    stages = np.zeros(len(mission.phases), STAGE)
    before = mission.start_depth
    for n, (stage, phase) in enumerate(zip(stages, mission.phases, strict=True)):
        law = law_parameters(vehicle, phase)
        depth, reached = 0.0 if phase.depth is None else phase.depth, mission.reached(phase)
        way = abs(depth - before)
        stage["kind"] = Kind[phase.kind.upper()]
        stage["depth"] = depth
        stage["tolerance"] = law.tolerance
        stage["speed"] = law.far_speed
        stage["duration"] = phase.duration or 0.0
        stage["timeout"] = phase.timeout or 2.0 * approach_time(law, way) + 3600.0
        stage["loads"] = hotel_power(vehicle, phase.kind)
        stage["law"] = law
        stays = "stay" if phase.kind in ("park", "hold") else "next"
        stage["grounding"] = Grounding[(phase.grounding or stays).upper()]
        shift = math.inf if mission.grounding is None else mission.grounding.shift
        if phase.grounding == "shift" and law.tolerance >= shift:
            what = f"it is not less than the {shift:g} m that the phase goes above the bottom"
            remedy, field = "Give less, or a larger grounding.shift", f"phases[{n}].tolerance"
            raise InputError(what, field=field, value=law.tolerance, unit="m", remedy=remedy)
        psi = look_up(table, step, Table.NEUTRAL, reached)[1]
        rate = min(look_up(table, step, k, reached)[0] for k in (Table.RATE_OUT, Table.RATE_IN))
        holds = None if phase.depth is None else hold_parameters(vehicle, phase, law, psi, rate)
        if holds is not None:
            stage["capture"], stage["hold"] = holds
        before = depth
    return stages


def first_state(
    plan: Plan, mission: Mission, *, seed: int | None = None, volume: float | None = None
) -> State:
    """Return the state before the start: numbers, whole numbers and accounts.

    At the depth of 0 it floats with all volume out; elsewhere it rests, with its neutral volume or
    the one that is given [m3]. Its hull is as warm as the water there, or as the mission says.
    """
    warmth = mission.start_temperature
    x, at = first_lane(
        plan.given, plan.table, mission.start_depth, volume=volume, temperature=warmth, seed=seed
    )
    at["new_phase"], x["t_ice"] = 1, -math.inf
    return x, at, np.zeros(len(Account) + len(Holding) * len(plan.stages))
