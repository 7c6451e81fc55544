"""Hardware in the loop: a board's own C flies the plant of `simulate` and `faults` over a wire.

The board is a law of their loop: at each tick it gets what the sensors see and returns its command,
which is compared, with all else that it says, with that of its float32 twin.
"""

from __future__ import annotations

import ctypes
import io
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from swimbladder.codegen.golden import BoardProgram, Mission, fly_float
from swimbladder.codegen.library import digest, plan_program
from swimbladder.codegen.twin import VehicleTwin, arming_twin
from swimbladder.codegen.wire import BAUD, Said, Wire
from swimbladder.control.law import Measurement
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.control.supervisor_limits import check_time_limit
from swimbladder.errors import InputError, NoAnswerError, Parameter, SwimbladderError, check_counts
from swimbladder.io.answers import Answer, attributes
from swimbladder.io.files import check_place, make_folder
from swimbladder.io.progress import Advance, silent
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.faults.c_interface import SUPERVISED
from swimbladder.sim.faults.campaign_result import Outcome, outcomes
from swimbladder.sim.faults.draw import Mission as FaultMission
from swimbladder.sim.faults.draw import Result, course_of, draw
from swimbladder.sim.faults.flight import OWN
from swimbladder.sim.faults.kinds import KINDS, On
from swimbladder.sim.faults.run import FaultCampaign
from swimbladder.units import in_unit, read_numbers, rounded
from swimbladder.vehicle import Vehicle

_ON_DECK, _RESET = 3, 5  # ticks before it is armed; before and after a reset
_LATE = 0.1  # of a sample time, by which a tick may be late


@dataclass(frozen=True, kw_only=True)
class Flights:
    """What is flown: the golden mission, steps to and fro, missions with faults, and a reset.

    step [m], duration [s]: of the golden mission, see `library.firmware`; seed: of noise and
    faults; missions with faults, and their depth_range [m], as `sim.faults` has them.
    """

    step: tuple[float, float] | None = in_unit("m", None)
    duration: float | None = in_unit("s", None)
    seed: int | None = 1
    steps: bool = False
    missions: int = 0
    depth_range: tuple[float, float] | None = in_unit("m", None)

    def __post_init__(self) -> None:
        read_numbers(self)


class Difference(NamedTuple):
    """Where a board first said something else than its twin."""

    tick: int  # of the flight; below 0: on deck, before it was armed
    field: str  # of `wire.Said`
    board: float
    twin: float


@dataclass(kw_only=True)
class FlightAnswer:
    """One flight on the board, and how its plant ended."""

    name: str
    log: Path
    ticks: int = 0
    unequal: int = 0  # ticks at which anything differed
    difference: Difference | None = None
    reason: str = ""  # of the supervisor, empty without one
    depth: float = math.nan  # m, at the end
    ended: str = ""
    duration: float = 0.0  # s, of the flight
    wall: float = 0.0  # s that it took

    @property
    def sentence(self) -> str:
        """How the flight went."""
        first = self.difference
        said = f"{self.name}: equal at all {self.ticks} ticks"
        if first is not None:
            both = f"{first.field} {first.board:.9g} on the board, {first.twin:.9g} of the twin"
            said = f"{self.name}: first differs at tick {first.tick}: {both}"
            said += f"; {self.unequal} of {self.ticks} ticks differ"
        faults = f"; {self.ended}" if self.ended else ""
        alarm = f"; the supervisor took over: {self.reason}" if self.reason else ""
        return f"{said}{faults}, at {self.depth:.2f} m{alarm}"

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI."""
        keys = "name ticks unequal_ticks=unequal reason ended final_depth_m=depth duration_s wall_s"
        first = self.difference and self.difference._asdict()
        return attributes(self, keys) | {"first_difference": first}


class Spread(NamedTuple):
    """Median, worst and standard deviation of times."""

    median_s: float
    worst_s: float
    jitter_s: float

    @classmethod
    def of(cls, times: Sequence[float]) -> Spread | None:
        """Return that of times [s]; None of none."""
        if not times:
            return None
        return cls(float(np.median(times)), float(np.max(np.abs(times))), float(np.std(times)))


@dataclass(kw_only=True)
class Times:
    """What is measured at each tick [s]."""

    steps: list[float] = field(default_factory=list)  # of law and supervisor, by the board's clock
    trips: list[float] = field(default_factory=list)  # until the answer was there
    intervals: list[float] = field(default_factory=list)  # between ticks less the sample time
    late: int = 0  # ticks that began too late in real time


@dataclass(frozen=True, kw_only=True)
class BoardAnswer(Answer):
    """What a board did."""

    vehicle: Vehicle
    made: BoardProgram
    port: str
    baud: int
    real_time: bool
    flights: tuple[FlightAnswer, ...]
    not_flown: tuple[str, ...]  # faults that take more than a wire
    times: Times
    frames: dict[str, int]
    stack_left: int | None  # bytes, None: the board does not say

    @property
    def equal(self) -> bool:
        """Whether board and twin said the same to the bit at every tick."""
        return all(flight.difference is None for flight in self.flights)

    @property
    def speed(self) -> float:
        """Times real time."""
        return sum(one.duration for one in self.flights) / sum(one.wall for one in self.flights)

    @property
    def sentences(self) -> list[str]:
        """How each flight went, the board's times, the line's frames."""
        return list(self._words())

    def _words(self) -> Iterator[str]:
        made, times = self.made, self.times
        where = f"{self.port}, {self.baud} baud, C {digest(made).hex()}"
        yield f"{self.vehicle.name}: law {made.law.name} every {made.tick_s:.9g} s on {where}"
        yield "equal" if self.equal else "DIFFERENT"
        yield from (flight.sentence for flight in self.flights)
        if self.not_flown:
            yield f"not flown over a wire: {', '.join(self.not_flown)}"
        listed = [("step on the board", times.steps), ("until the answer", times.trips)]
        if self.real_time:
            listed.append(("between ticks, off the sample time", times.intervals))
        for name, taken in listed:
            if (spread := Spread.of(taken)) is not None:
                median, worst, jitter = (f"{1e3 * time:.3f} ms" for time in spread)
                yield f"{name}: median {median}, worst {worst}, jitter {jitter}"
        late = f"; {times.late} ticks were late" if self.real_time else ""
        yield f"speed: {rounded(self.speed, 3)} times real time{late}"
        counts = (
            "{sent} sent, {lost} lost; corrupt: {corrupt} here, {corrupt_at_board} at the board"
        )
        yield f"frames: {counts.format(**self.frames)}"
        left = self.stack_left
        yield f"stack left: {'not known on this board' if left is None else f'{left} bytes'}"

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        spreads = {"step": self.times.steps, "round_trip": self.times.trips}
        if self.real_time:
            spreads["interval_error"] = self.times.intervals
        found = {name: Spread.of(times) for name, times in spreads.items()}
        keys = "port baud real_time equal not_flown times_real_time=speed frames stack_left_bytes"
        return {
            "vehicle": self.vehicle.name,
            "law": self.made.law.name,
            "sha256_of_c": digest(self.made).hex(),
            **attributes(self, keys),
            "flights": [flight.to_dict() for flight in self.flights],
            "late_ticks": self.times.late if self.real_time else None,
            **{name: spread and spread._asdict() for name, spread in found.items()},
        }


def board(
    vehicle: Vehicle,
    port: str,
    flights: Flights | None = None,
    *,
    baud: int = BAUD,
    real_time: bool = False,
    out: Path,
    advance: Advance = silent,
) -> BoardAnswer:
    """Fly a vehicle's model by the board at a serial port; return where it differs from its twin.

    The board runs HardwareInTheLoop of the vehicle's library.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it, with a controller and a time limit of its supervisor.
    port
        Name of the serial port.
    flights
        What is flown; none: the golden mission.
    baud
        Of the serial port [Bd].
    real_time
        Whether a tick comes every sample time, and not as soon as it can.
    out
        The folder that the flights' logs are written into as they grow.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    BoardAnswer
        Each flight with the first difference between board and twin, and what was measured of times
        and frames.

    Raises
    ------
    InputError
        The vehicle, the port or the board is not the right one.
    NoAnswerError
        The board answers no more: the model then gets full buoyancy.
    """
    asked = flights or Flights()
    check_time_limit(vehicle)
    check_counts(seed=(asked.seed, 0), missions=(asked.missions, 0))
    mission, made = plan_program(vehicle, (*(asked.step or (None, None)), asked.duration))
    faults = _FaultMissions(vehicle, asked)
    check_place(out)
    with Wire(port, digest(made), baud=baud) as wire:
        session = _Session(made, wire, real_time, out)
        share = 1.0 / (2 + asked.steps + len(faults.missions))
        found = []
        for name, turns in _set_points(made, mission, asked.steps):
            with session.flight(name, advance, share) as flight:
                _fly_depths(flight, vehicle, mission, turns, asked.seed)
            found.append(flight.answer)
        for one in faults.missions:
            with session.flight(f"fault mission {one.number}", advance, share) as flight:
                faults.fly(flight, one)
            found.append(flight.answer)
        with session.flight("reset", advance, share) as flight:
            _reset(flight, vehicle, mission.start)
        found.append(flight.answer)
        stack, corrupt = wire.status()
    return BoardAnswer(
        vehicle=vehicle,
        made=made,
        port=port,
        baud=baud,
        real_time=real_time,
        flights=tuple(found),
        not_flown=faults.not_flown,
        times=session.times,
        frames=wire.frames | {"corrupt_at_board": corrupt},
        stack_left=stack,
    )


class _Session:
    """What the flights on a board have in common."""

    def __init__(self, made: BoardProgram, wire: Wire, real_time: bool, out: Path) -> None:
        self.made, self.wire, self.real_time, self.times = made, wire, real_time, Times()
        self.full = made.limits[1]  # the command that makes the vehicle lightest
        self.twin = partial(made.board, made.twin())
        self._out = out

    @contextmanager
    def flight(self, name: str, advance: Advance, share: float) -> Iterator[_Flight]:
        """Give a flight to fly, of so large a share of the work; raise what has stopped it."""
        path, began = self._out / f"{name.replace(' ', '-')}.csv", time.perf_counter()
        answer = FlightAnswer(name=name, log=path)
        flight = _Flight(self, answer, lambda done: advance(done * share))
        try:
            yield flight
        except SwimbladderError:
            if flight.stopped is None:
                raise
        finally:
            flight.log.close()
        answer.wall, stop = time.perf_counter() - began, flight.stopped
        answer.duration = answer.ticks * self.made.tick_s
        if isinstance(stop, NoAnswerError):
            at = f"tick {answer.ticks} ({answer.duration:.4g} s) of the {name}"
            safe = f"the model had full buoyancy from there on, and ended at {answer.depth:.1f} m"
            remedy = "Check the cable and the board's power, and fly again"
            raise NoAnswerError(f"{stop}, at {at}; {safe}. {remedy}") from stop
        if stop is not None:
            raise stop


class _Flight:
    """A flight: the board and its twin, called side by side, and the log of what they say.

    Once it is stopped, the board is not asked again, and the command is full buoyancy.
    """

    def __init__(self, session: _Session, answer: FlightAnswer, advance: Advance) -> None:
        self.session, self.answer, self.advance = session, answer, advance
        self._twin = session.twin()
        self.log: TextIO = io.StringIO()  # until there is a first tick
        self.stopped: BaseException | None = None  # by this, which cannot pass compiled code
        self._clock = 0  # ticks, of the board
        self._due, self._last = 0.0, -1  # s, us: of the next tick, and of the last by its clock

    def begin(self, *, after_reset: bool) -> None:
        """Switch the board on and arm it after some ticks on deck; or reset it, armed as it is."""
        self._twin = self.session.twin(before=self._twin.state, after_reset=after_reset)
        self._clock, self._last = 0, -1
        if self.stopped is None:
            try:
                self.session.wire.begin(after_reset=after_reset)
                if not after_reset:
                    self._arm()
            except BaseException as error:
                self.stopped = error

    def _arm(self) -> None:
        """See that the board is disarmed on deck as its twin is, and arm both."""
        limits, wire = self.session.made.arming, self.session.wire
        self._twin.switch_on(arming_twin(), limits)
        deck = Watched(limits.submerged - 1.0, 0.0, 0.0, math.nan, False, 0, 0)
        for n in range(-_ON_DECK, 0):
            self._said_by_both(n, _in_float32(deck), np.float32(0.0))
        wire.arm()
        self._twin.arm()

    def _said_by_both(
        self, n: int, seen: Watched, reference: Any
    ) -> tuple[Said, Said, int, int, float]:
        """Return what board and twin say at tick n, compared.

        And when the board began and how long it took [us], and the time until its answer [s].
        """
        asked = time.perf_counter()
        said, began, took = self.session.wire.tick(seen, float(reference))
        trip = time.perf_counter() - asked
        expected, answer = _said(self._twin, self._twin.tick(seen, reference)), self.answer
        different = [name for name in Said._fields if _bits(said, name) != _bits(expected, name)]
        if different:
            both = (float(getattr(one, different[0])) for one in (said, expected))
            answer.difference = answer.difference or Difference(n, different[0], *both)
            answer.unequal += 1
        return said, expected, began, took, trip

    def tick(self, seen: Watched, reference: float) -> Said:
        """Return what the board says, or what is safe where it says nothing any more."""
        if self.stopped is None:
            try:
                return self._compared(_in_float32(seen), np.float32(reference))
            except BaseException as error:
                self.stopped = error
        return Said(True, self.session.full, math.nan, 0, 0, 0, False, False)

    def _compared(self, seen: Watched, reference: Any) -> Said:
        """Ask board and twin, compare and note what they say."""
        times, tick_s, answer = self.session.times, self.session.made.tick_s, self.answer
        if not answer.ticks:
            self._begin_log()
        self._wait(1 + seen.lost)
        said, expected, began, took, trip = self._said_by_both(answer.ticks, seen, reference)
        if said.reason and not answer.reason:
            answer.reason = Reason(said.reason).words
        times.steps.append(took * 1e-6)
        times.trips.append(trip)
        if self._last >= 0 and seen.lost == 0:
            times.intervals.append((began - self._last) % 2**32 * 1e-6 - tick_s)
        self._last = began
        self._clock += seen.lost
        row = [f"{self._clock * tick_s:.9g}", seen.depth, seen.volume, np.float32(said.command)]
        row += [reference, said.reason, expected.command, seen.depth_age, seen.battery]
        row += [int(seen.leak), seen.lost, took, round(trip * 1e6)]
        self.log.write(",".join(map(str, row)) + "\n")
        self._clock += 1
        answer.ticks += 1
        return said

    def _begin_log(self) -> None:
        """Begin the log, once there is something to write into it."""
        path, facts = self.answer.log, self.session.made.facts
        make_folder(path.parent)
        try:
            self.log = path.open("w", encoding="utf-8", newline="\n", buffering=1)
        except OSError as error:
            what, remedy = f"cannot write the log: {error.strerror}", "Choose another folder"
            raise InputError(what, file=path, field=Parameter("out"), remedy=remedy) from error
        more = "depth_age_s,battery_V,leak,lost_ticks,step_us,round_trip_us"
        self.log.write(f"{facts['header']},supervisor_reason,twin_{facts['column']},{more}\n")

    def _wait(self, ticks: int) -> None:
        """Wait, in real time, until the tick is due that comes so many after the last."""
        if not self.session.real_time:
            return
        now, tick_s = time.perf_counter(), self.session.made.tick_s
        self._due = self._due + ticks * tick_s if self.answer.ticks else now
        if now < self._due:
            time.sleep(self._due - now)
        self.session.times.late += time.perf_counter() - self._due > _LATE * tick_s


def _in_float32(seen: Watched) -> Watched:
    """Return what is seen as the wire has it."""
    depth, age, volume = np.float32(seen.depth), np.float32(seen.depth_age), np.float32(seen.volume)
    rounded: dict[str, Any] = {"depth": depth, "depth_age": age, "volume": volume}
    return seen._replace(**rounded, battery=np.float32(seen.battery))  # type: ignore[arg-type]


def _said(board: VehicleTwin, command: Any) -> Said:
    """Return what a twin says beside its command at a tick."""
    return Said(
        armed=board.armed,
        command=command,
        allowed=board.state.proof.allowed,
        reasons=sum(1 << (reason - 1) for reason in board.reasons),
        missed=min(board.controller.missed, 0xFFFF),
        reason=board.reason or 0,
        release=board.release,
        wide=board.controller.seconds and board.wide,
    )


def _bits(said: Said, name: str) -> bytes | int:
    """Return a field of what was said to compare: the bits of a float, one NaN for all."""
    value = getattr(said, name)
    if name not in ("command", "allowed"):
        return int(value)
    return b"nan" if math.isnan(value) else np.float32(value).tobytes()


def _set_points(
    made: BoardProgram, mission: Mission, steps: bool
) -> Iterator[tuple[str, list[tuple[float, float]]]]:
    """Give the flights to depths: their names, and (share of the time, depth [m]) of each."""
    start, target, _ = mission
    floats = made.drive is not None
    yield "golden mission", [(0.0, target), (2.0 / 3.0, 0.0)] if floats else [(0.0, target)]
    if steps and floats:
        yield "steps", [(0.0, target), (0.4, 0.5 * target), (0.55, target), (0.7, 0.0)]
    elif steps:
        yield "steps", [(0.0, target), (1.0 / 3.0, start), (2.0 / 3.0, target)]


def _fly_depths(
    flight: _Flight,
    vehicle: Vehicle,
    mission: Mission,
    turns: Sequence[tuple[float, float]],
    seed: int | None,
) -> None:
    """Fly to depths from rest; its board has no battery and leak sensor."""
    made, advance = flight.session.made, flight.advance
    flight.begin(after_reset=False)

    def tick(seen: Measurement, reference: float) -> Said:
        """Return the board's answer to a measurement: depth and volume alone."""
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0)
        return flight.tick(watched, reference)

    def seconds(seen: Measurement, reference: float) -> tuple[float, bool]:
        said = tick(seen, reference)
        return said.command, said.wide

    if made.drive is not None:
        n = mission.ticks(made.tick_s)
        shares = np.array([share for share, _ in turns]) * n
        at = np.searchsorted(shares, np.arange(n), side="right") - 1
        asked = np.array([depth for _, depth in turns])[at]
        given: dict[str, Any] = {"tick": made.tick_s, "start_depth": mission.start}
        rows = fly_float(vehicle, seconds, asked=asked, seed=seed, advance=advance, **given)
        flight.answer.depth = float(rows[-1, 0])
        return
    flown = simulate(
        vehicle,
        law=lambda seen, reference: tick(seen, reference).command,
        setpoints=[(share * mission.duration, depth) for share, depth in turns],
        duration=mission.duration,
        start_depth=mission.start,
        seed=seed,
        sample_time=made.tick_s,
        supervised=False,
        advance=advance,
    )
    flight.answer.depth = float(flown.depth[-1])
    flight.answer.ended = "" if flown.finished else flown.stop.value


def _reset(flight: _Flight, vehicle: Vehicle, depth: float) -> None:
    """Reset the board under way: it stays armed, and says why it brings the vehicle up.

    The vehicle rests at the depth [m] meanwhile.
    """
    made, answer = flight.session.made, flight.answer
    volume = vehicle.neutral_volume(depth) if made.drive is None else math.nan
    seen = Watched(depth, 0.0, volume, math.nan, False, 0, 0)
    said: list[Said] = []
    for after_reset in (False, True):
        flight.begin(after_reset=after_reset)
        said += [flight.tick(seen, depth) for _ in range(_RESET)]
    stays = said[-1].armed and said[-1].reason == Reason.RESTARTED
    answer.ended, answer.depth = "armed as before" if stays else "NOT armed as before", depth
    flight.advance(1.0)


_TICK = ctypes.CFUNCTYPE(ctypes.c_float, ctypes.c_void_p, *[ctypes.POINTER(ctypes.c_float)] * 2)
_BEGIN = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int)
_INSIDE = frozenset(n for n, kind in KINDS.items() if kind.on in (On.HANG, On.FLIP, On.WAITS))


class _FaultMissions:
    """Missions of a seed's catalogue that a board can fly, and its functions, called by address.

    A law that hangs is found out by asking it, which is undone in the memory of a board at hand,
    and bits flip there; missions with faults inside the board are not flown.
    """

    size = 1  # bytes of memory here: the board has its own

    def __init__(self, vehicle: Vehicle, asked: Flights) -> None:
        self.missions: list[FaultMission] = []
        self.addresses: dict[str, tuple[int, int]] = {}
        if asked.missions:
            course = course_of(vehicle, asked.depth_range)
            self._campaign = FaultCampaign(course, self)
            drawn = (draw(course, seed=asked.seed or 0, number=n, healthy=False) for n in count())
            able = (mission for mission in drawn if not _INSIDE.intersection(mission.faults))
            self.missions += islice(able, asked.missions)

    @property
    def not_flown(self) -> tuple[str, ...]:
        """Faults that no mission has."""
        return tuple(KINDS[n].name for n in sorted(_INSIDE)) if self.missions else ()

    def fly(self, flight: _Flight, mission: FaultMission) -> None:
        """Fly a mission to its end."""

        def begin(_memory: Any, after_reset: int) -> None:
            flight.begin(after_reset=after_reset != 0)

        def tick(_memory: Any, seen: Any, said: Any) -> float:
            """Ask the board; write reason, release and width of its answer into `said`."""
            depth, age, volume, battery, leak, lost, reference = seen[:7]
            watched = Watched(depth, age, volume, battery, leak > 0.5, int(lost), 0)
            answer = flight.tick(watched, reference)
            said[0], said[1], said[3] = answer.reason, answer.release, answer.wide
            return answer.command

        functions = _BEGIN(begin), _TICK(tick)  # kept here while they are called
        begins, ticks = (ctypes.cast(one, ctypes.c_void_p).value or 0 for one in functions)
        self.addresses[SUPERVISED] = begins, ticks
        result = self._campaign.flown(mission, SUPERVISED, OWN)
        ended = Outcome(int(outcomes(result[None], mission.condition.tick)[0])).words
        kinds = " and ".join(KINDS[fault].name for fault in mission.faults)
        flight.answer.depth = Result(*result).depth
        flight.answer.ended = f"{kinds}: {ended}"
