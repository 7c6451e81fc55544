"""The pool procedure for a vehicle's board: what fits pool, stroke and actuator; its numbers.

A day is rehearsed on the vehicle's model by the float32 twin of what the board does.

The C is the translated `control.protocol` and ``templates/swb_pool_day.c.j2``, which puts the
supervisor above it.
"""

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, InitVar, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.codegen.twin import supervisor_twin, twin
from swimbladder.control.cascade import CascadeParameters
from swimbladder.control.law import NEVER, Law, Measurement, leaves
from swimbladder.control.protocol import MARGIN, POOL, Does, Phase, PoolParameters, procedure_for
from swimbladder.control.registry import bind
from swimbladder.control.sea_cascade import SeaCascadeParameters, sea_cascade_gains
from swimbladder.control.supervisor import Reason, SupervisorParameters, Watched
from swimbladder.errors import InputError, NoAnswerError, check_counts
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Flags
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.sim.closed_loop import simulate
from swimbladder.units import in_unit, read_numbers
from swimbladder.vehicle import Vehicle

_LONGEST = 3600.0  # s, that a round may take in a rehearsal
_AFLOAT = 60.0  # s, at the surface before it begins
_AFTER = 120.0  # s, for coming up once it is over
_DONE = 8  # the first phase in which it is over


class Rehearsal(NamedTuple):
    """A pool day flown by the twin under its supervisor, tick by tick."""

    depth: NDArray[np.float32]  # m, measured
    volume: NDArray[np.float32]  # m3, measured
    may_begin: Flags
    command: NDArray[np.float32]  # V
    phase: NDArray[np.int8]
    minutes: float  # from the word to begin until it is done


@dataclass(eq=False)
class PoolTwin:
    """What the board does on a pool day, tick by tick: the procedure under its supervisor."""

    parameters: PoolParameters
    limits: SupervisorParameters
    _: KW_ONLY
    procedure: Law
    supervisor: Law
    after_reset: InitVar[bool] = False

    def __post_init__(self, after_reset: bool) -> None:
        unseen = Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
        self.watch = self.supervisor.initial(self.limits, unseen, 1.0 if after_reset else 0.0)
        blind = Measurement(0.0, math.nan, math.nan)
        self.state = self.procedure.initial(self.parameters, blind, 0.0)

    @property
    def phase(self) -> Phase:
        """The phase that it is in."""
        if self.state.phase < 0.0:
            return Phase("", Does.WAIT)
        return self.parameters.phases[int(self.state.phase)]

    @property
    def reason(self) -> Reason | None:
        """The supervisor's first reason; None while the procedure commands."""
        number = int(self.watch.recovery.reason)
        return Reason(number) if number else None

    def tick(self, seen: Watched, *, may_begin: bool) -> Any:
        """Return the command [V] from this tick on; once the supervisor has a reason it is over."""
        go = -1.0 if self.watch.recovery.reason > 0 else 1.0 if may_begin else 0.0
        measured = Measurement(0.0, seen.depth, seen.volume)
        wanted, self.state, _ = self.procedure.step(self.parameters, self.state, measured, go)
        seen = seen._replace(missed=0, reference=math.nan)  # a day is asked for no depth
        command, self.watch, _ = self.supervisor.step(self.limits, self.watch, seen, wanted)
        return command


def float32_twin(parameters: PoolParameters, limits: SupervisorParameters) -> PoolTwin:
    """Return the twin that equals the C to the bit."""
    return PoolTwin(parameters, limits, procedure=twin(POOL), supervisor=supervisor_twin())


def rehearse(
    vehicle: Vehicle,
    beside: PoolTwin,
    *,
    bottom_depth: float,
    seed: int | None,
    fly: Callable[[Watched, bool], float] | None = None,
    advance: Advance = silent,
) -> Rehearsal:
    """Return a pool day of a vehicle under a twin: from afloat, through all rounds, and up again.

    fly: what gives the commands in the twin's place. Raises NoAnswerError where the procedure does
    not come to its end.
    """
    tick, p = beside.limits.S_p, plant(vehicle)
    rows: list[tuple[Any, ...]] = []
    over: list[int] = []

    def every_tick(seen: Measurement, _: float) -> tuple[float, float]:
        """Return (command [V], time to the next call [s]); endless when the rehearsal is over."""
        may_begin = len(rows) * tick >= _AFLOAT
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0)
        command = beside.tick(watched, may_begin=may_begin)
        given = command if fly is None else fly(watched, may_begin)
        phase = int(beside.state.phase)
        rows.append((seen.depth, seen.volume, may_begin, command, phase))
        if phase >= _DONE:
            over.append(len(rows))
        ends = over and (len(rows) - over[0]) * tick > _AFTER
        return float(given), math.inf if ends else 0.0

    flown = simulate(
        vehicle,
        setpoints=[(0.0, bottom_depth)],
        law=every_tick,
        sample_time=tick,
        seed=seed,
        duration=_AFLOAT + _AFTER + beside.parameters.rounds * _LONGEST,
        start_depth=p.z_surface,
        start_volume=beside.limits.volume.volume_high,
        bottom_depth=bottom_depth,
        advance=advance,
        checked=False,
    )
    kinds = ("f4", "f4", "?", "f4", "i1")
    columns = zip(zip(*rows, strict=True), kinds, strict=True)
    depth, volume, may_begin, command, phase = (np.array(*of) for of in columns)
    if not flown.finished:
        raise NoAnswerError(f"The rehearsed pool day ended early: {flown.stop.value}")
    _check_done(beside, phase)
    minutes = float(np.sum((phase >= 0) & (phase < _DONE))) * tick / 60.0
    return Rehearsal(depth, volume, may_begin, command, phase, minutes)


def _check_done(beside: PoolTwin, phase: NDArray[np.int8]) -> None:
    """Raise NoAnswerError unless every round was done and no reason found to end it."""
    if beside.phase.does is Does.DONE and beside.reason is None:
        return
    last = int(phase[phase < _DONE][-1])
    name = beside.parameters.phases[last].words if last >= 0 else "waiting"
    at = f"in {name}, round {int(beside.state.completed) + 1}"
    if beside.reason is not None:
        said = f"ended {at}: the supervisor said {beside.reason.words!r}"
        remedy = "Say more of the vehicle in its [supervisor] table, as bottom_depth"
    else:
        patience = f"{beside.parameters.patience:g} s"
        said = f"did not come to its end: {at} it took longer than {patience}"
        remedy = "Tune the vehicle's cascade, or change volumes or pool"
    raise NoAnswerError(f"The rehearsed pool day {said}. {remedy}")


BY_VOLTAGE = "procedure changes the volume by a voltage for a time"
# over the sample time, of a loop made for want of a cascade: docs/explanation/laws.md
_BANDWIDTH = 0.1
_LEAST_TRAVEL = 0.3  # m, between the depths of rest, as guide.rules has it for a glide
_DEEPER = "Choose a deeper pool or a smaller `clearance=`"
_OVER = 1.0  # m, deeper than the bottom, that a depth may be and count as one


@dataclass(frozen=True)
class PoolOptions:
    """What a person says of the pool and of the day.

    bottom_depth [m]: where the vehicle stands on it; clearance [m]: from bottom and surface to the
    depths of rest; volume_changes [m3]: of the first round and the last, the paper's least and
    largest; rounds: as many as the paper's.
    """

    bottom_depth: float = in_unit("m")
    clearance: float = in_unit("m", 0.75)
    volume_changes: tuple[float, float] = in_unit("m3", (20e-6, 75e-6))
    rounds: int = 4

    def __post_init__(self) -> None:
        read_numbers(self)

    @property
    def volumes(self) -> str:
        """The changes of volume as text."""
        first, last = (f"{volume * 1e6:g}" for volume in self.volume_changes)
        return f"{first} cm3" if first == last else f"{first} to {last} cm3"


class PoolDay(NamedTuple):
    """A pool day of a vehicle: what was asked for, the numbers, and how it went on the model."""

    options: PoolOptions
    parameters: PoolParameters
    own_loop: bool  # the depth is held with the gains of the vehicle's controller
    neutral: float  # m3, at the surface
    rehearsal: Rehearsal

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        return {
            "depth_m": self.options.bottom_depth,
            "rounds": self.options.rounds,
            "minutes": self.rehearsal.minutes,
            "parameters": in_float32(self.parameters, POOL),
        }


def in_float32(parameters: Any, law: Law) -> dict[str, dict[str, Any]]:
    """Return numbers as the board has them, with units; None for a limit of it that is off."""

    def on_board(value: float) -> float | None:
        if isinstance(value, int):
            return None if value == NEVER else value
        return None if math.isinf(value) else float(np.float32(value))

    units = law.units
    return {n: {"value": on_board(v), "unit": units[n]} for n, v in leaves(parameters).items()}


def plan_pool_day(
    vehicle: Vehicle, options: PoolOptions, limits: SupervisorParameters, *, seed: int | None
) -> PoolDay:
    """Return a pool day that a vehicle comes through, flown by the float32 twin.

    Raises InputError as `board_procedure`, NoAnswerError as `rehearse`.
    """
    parameters, depth = board_procedure(vehicle, options, limits), options.bottom_depth
    board = float32_twin(parameters, limits)
    flown = rehearse(vehicle, board, bottom_depth=depth, seed=seed)
    own = _own_loop(vehicle, limits.S_p) is not None
    return PoolDay(options, parameters, own, plant(vehicle).V_0, flown)


def pool_summary(day: PoolDay) -> str:
    """Return what the command line says of a pool day, one line."""
    options, p = day.options, day.parameters
    return (
        f"pool day: {options.rounds} rounds of {options.volumes} between {p.deep:.4g} and "
        f"{p.shallow:.4g} m; on the model it takes {day.rehearsal.minutes:.0f} min"
    )


def board_procedure(
    vehicle: Vehicle, options: PoolOptions, limits: SupervisorParameters
) -> PoolParameters:
    """Return the procedure for a vehicle; limits: its supervisor's, whose sensor limits it takes.

    The depth is held by the vehicle's own cascade where its controller has such gains, else by one
    made from the model: a cascade has no filter that a vehicle yet to be identified could mislead.
    Raises InputError for what does not fit pool, stroke or actuator.
    """
    p = plant(vehicle)
    if p.positioner > 0.0:
        what = f"the {BY_VOLTAGE}, and this actuator takes positions"
        remedy = "Do the steps by hand, with the sketch that holds a depth"
        raise InputError(what, field="bottom_depth", value=vehicle.actuator.kind, remedy=remedy)
    S_p = limits.S_p
    sensors = vehicle.sensors
    margin = max(MARGIN, 6.0 * sensors.depth_noise + 2.0 * sensors.depth_quantum)
    _check_pool(options, p, limits, margin)
    _check_volumes(options, p, limits)
    top = limits.volume.volume_high
    lifts = top > p.V_0 + limits.neutral.neutral_range + p.psi * options.bottom_depth
    loop = _own_loop(vehicle, S_p)
    if loop is None:
        made = sea_cascade_gains(p.a_b, p.d_l, p.gain, bandwidth=_BANDWIDTH / S_p, S_p=S_p)
        loop = CascadeParameters(*made, S_p)
    one = procedure_for(
        loop,
        rate_per_volt=p.gain,
        limit=p.supply,
        load_voltage=p.load_drive + p.k_l / p.gain,
        bottom_depth=options.bottom_depth,
        clearance=options.clearance,
        change=options.volume_changes[0],
    )
    return one._replace(
        shallow=p.z_surface + options.clearance,
        surface=p.z_surface + margin,
        bottom=options.bottom_depth - margin,
        rounds=float(options.rounds),
        more=float(np.diff(options.volume_changes)[0]) / max(options.rounds - 1, 1),
        depth_least=limits.depth.depth_least,
        depth_most=options.bottom_depth + _OVER,
        volume_least=limits.volume.volume_least,
        volume_most=limits.volume.volume_most,
        end_volume=top if lifts else p.V_max,
    )


def _own_loop(vehicle: Vehicle, S_p: float) -> CascadeParameters | None:
    """Return the cascade of a vehicle's controller, where it has one."""
    own = None if vehicle.controller is None else bind(vehicle.controller)[1]
    if isinstance(own, SeaCascadeParameters):
        return CascadeParameters(*own.gains, S_p)
    return own if isinstance(own, CascadeParameters) else None


def _of_depth(depth: float, what: str, remedy: str, option: str = "bottom_depth") -> InputError:
    return InputError(what, field=option, value=depth, unit="m", remedy=remedy)


def _check_pool(
    options: PoolOptions, p: Plant, limits: SupervisorParameters, margin: float
) -> None:
    """Raise InputError unless there is room between surface and bottom."""
    clearance = options.clearance
    if not clearance > 2.0 * margin:
        near = f"a vehicle within {margin:.3g} m of surface or bottom"
        what = f"{near} counts as arrived there, and has to rest clear of it"
        remedy = f"Give more than {2.0 * margin:.3g} m"
        raise _of_depth(clearance, what, remedy, "clearance")
    travel = options.bottom_depth - p.z_surface - 2.0 * clearance
    if not travel >= _LEAST_TRAVEL:
        leaves = f"this leaves {travel:.3g} m between the depths of rest"
        what, remedy = f"{leaves}, {clearance:.3g} m from surface and bottom", _DEEPER
        raise _of_depth(options.bottom_depth, what, remedy)
    if not options.bottom_depth < limits.deep.depth_limit:
        remedy = f"Stay above {limits.deep.depth_limit:.4g} m, or see supervisor.depth_limit"
        raise _of_depth(
            options.bottom_depth, "the supervisor brings the vehicle up from there", remedy
        )


def _check_volumes(options: PoolOptions, p: Plant, limits: SupervisorParameters) -> None:
    """Raise InputError unless stroke and trim leave room for every change of volume."""
    check_counts(rounds=(options.rounds, 1))
    first, last = options.volume_changes
    if options.rounds == 1 and first != last:
        given = f"{first * 1e6:g}:{last * 1e6:g} cm3"
        what = "one round has one change of volume"
        remedy = "Give a single volume, or more `rounds=`"
        raise InputError(what, field="volume_changes", value=given, remedy=remedy)
    deep = p.V_0 + p.psi * (options.bottom_depth - options.clearance)
    shallow = p.V_0 + p.psi * (p.z_surface + options.clearance)
    high, low = max(deep, shallow), min(deep, shallow)
    ends, unsure = limits.volume, limits.neutral.neutral_range
    fits = min(ends.volume_high - high, low - ends.volume_low) - unsure
    should = f"should the neutral volume be off by {unsure * 1e6:.3g} cm3"
    if not fits > 0.0:
        what = f"the stroke has no room for a change of volume, {should} (supervisor.neutral_range)"
        raise _of_depth(options.bottom_depth, what, "Trim the vehicle to mid-stroke")
    for change in options.volume_changes:
        what = f"a change of volume has to be above 0 and to fit the stroke, {should}"
        remedy = f"Give at most {fits * 1e6:.3g} cm3, or a smaller supervisor.neutral_range"
        if not 0.0 < change <= fits:
            option, cm3 = "volume_changes", change * 1e6
            raise InputError(what, field=option, value=cm3, unit="cm3", remedy=remedy)
