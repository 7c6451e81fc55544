"""Hardware in the loop: a board's own C flies the plant of `simulate` and `faults` over a wire.

The board is a law of their loop: at each tick it gets what the sensors see and returns its command,
which is compared, with all else that it says, with that of its float32 twin.
"""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np

from swimbladder.codegen.clock import VehicleTwin
from swimbladder.codegen.golden import BoardProgram, Mission, fly_float
from swimbladder.codegen.library import digest, plan_program
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import twin
from swimbladder.codegen.wire import BAUD, Said, Wire
from swimbladder.control.law import Measurement
from swimbladder.control.supervisor import SUPERVISOR, Reason, Watched
from swimbladder.errors import InputError, NoAnswerError, SwimbladderError
from swimbladder.io.files import check_place, make_folder
from swimbladder.io.progress import Advance, silent
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.faults.c_interface import SUPERVISED
from swimbladder.sim.faults.campaign_result import Outcome, outcomes
from swimbladder.sim.faults.draw import Mission as FaultMission
from swimbladder.sim.faults.draw import course_of, draw
from swimbladder.sim.faults.flight import OWN
from swimbladder.sim.faults.kinds import KINDS, On
from swimbladder.sim.faults.mission_records import Result
from swimbladder.sim.faults.run import FaultCampaign
from swimbladder.vehicle import Vehicle

_LATE = 0.1  # of a sample time, by which a tick may be late
_MOST_FAULTS = 100_000  # missions


@dataclass(frozen=True, kw_only=True)
class Flights:
    """What is flown: the golden mission, steps to and fro, and missions of the catalogue of faults.

    start_depth, target [m], duration [s]: of the golden mission, see `library.make_library`; seed:
    of noise and faults; depths [m]: of the missions with faults, as `sim.faults` has them.
    """

    start_depth: float | None = None
    target: float | None = None
    duration: float | None = None
    seed: int | None = 1
    steps: bool = False
    faults: int = 0
    depths: tuple[float, float] | None = None


class Difference(NamedTuple):
    """Where a board first said something else than its twin."""

    tick: int
    field: str  # of `wire.Said`
    board: float
    twin: float


@dataclass(frozen=True, kw_only=True)
class FlightAnswer:
    """One flight on the board, and how its plant ended."""

    name: str
    ticks: int
    unequal: int  # ticks at which anything differed
    difference: Difference | None
    reason: str  # of the supervisor, empty without one
    depth: float  # m, at the end
    ended: str
    duration: float  # s, of the flight
    wall: float  # s that it took
    log: Path

    def to_json(self) -> dict[str, Any]:
        """Return it in SI."""
        first = self.difference
        return {
            "name": self.name,
            "ticks": self.ticks,
            "unequal_ticks": self.unequal,
            "first_difference": None if first is None else first._asdict(),
            "reason": self.reason,
            "ended": self.ended,
            "final_depth_m": self.depth,
            "duration_s": self.duration,
            "wall_s": self.wall,
        }


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Median, worst and standard deviation of times [s]."""

    median: float
    worst: float
    jitter: float

    @classmethod
    def of(cls, times: Sequence[float]) -> Spread | None:
        """Return that of times [s]; None of none."""
        if not times:
            return None
        median, worst = float(np.median(times)), float(np.max(np.abs(times)))
        return cls(median=median, worst=worst, jitter=float(np.std(times)))

    def to_json(self) -> dict[str, float]:
        """Return it in SI."""
        return {"median_s": self.median, "worst_s": self.worst, "jitter_s": self.jitter}


@dataclass(kw_only=True)
class Times:
    """What is measured at each tick [s]."""

    steps: list[float] = field(default_factory=list)  # of law and supervisor, by the board's clock
    trips: list[float] = field(default_factory=list)  # until the answer was there
    intervals: list[float] = field(default_factory=list)  # between ticks less the sample time
    late: int = 0  # ticks that began too late in real time


@dataclass(frozen=True, kw_only=True)
class BoardAnswer:
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
        wall = sum(flight.wall for flight in self.flights)
        return sum(flight.duration for flight in self.flights) / wall

    def to_json(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        spreads = {"step": self.times.steps, "round_trip": self.times.trips}
        if self.real_time:
            spreads["interval_error"] = self.times.intervals
        found = {name: Spread.of(times) for name, times in spreads.items()}
        return {
            "vehicle": self.vehicle.name,
            "law": self.made.law.name,
            "library": digest(self.made).hex(),
            "port": self.port,
            "baud": self.baud,
            "real_time": self.real_time,
            "equal": self.equal,
            "flights": [flight.to_json() for flight in self.flights],
            "not_flown": list(self.not_flown),
            "times_real_time": self.speed,
            "late_ticks": self.times.late if self.real_time else None,
            **{name: spread and spread.to_json() for name, spread in found.items()},
            "frames": self.frames,
            "stack_left_bytes": self.stack_left,
        }


def fly_board(
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

    The board runs HardwareInTheLoop of the vehicle's library. flights: the golden mission where not
    given; real_time: a tick comes every sample time, not as soon as it can; out: the folder that
    the flights' logs are written into as they grow.
    Raises InputError where the vehicle, the port or the board is not the right one, and
    NoAnswerError where the board answers no more: the model then gets full buoyancy.
    """
    asked = flights or Flights()
    if not 0 <= asked.faults <= _MOST_FAULTS:
        what = f"must be a whole number from 0 to {_MOST_FAULTS}"
        raise InputError(what, field="--faults", value=asked.faults, remedy="Give some tens")
    depths = {name: getattr(asked, name) for name in ("start_depth", "target", "duration")}
    mission, made = plan_program(vehicle, **depths)
    faults = _FaultMissions(vehicle, asked)
    check_place(out)
    with Wire(port, digest(made), baud=baud) as wire:
        make_folder(out)
        session = _Session(vehicle, made, wire, real_time, out)
        share = 1.0 / (1 + asked.steps + len(faults.missions))
        found = []
        for name, turns in _set_points(made, mission, asked.steps):
            with session.flight(name, advance, share) as flight:
                _fly_depths(flight, vehicle, mission, turns, asked.seed)
            found.append(flight.answer())
        for one in faults.missions:
            with session.flight(f"fault mission {one.number}", advance, share) as flight:
                faults.fly(flight, one)
            found.append(flight.answer())
        stack, corrupt = wire.status()
        frames = vars(wire.counts) | {"corrupt_at_board": corrupt}
    return BoardAnswer(
        vehicle=vehicle,
        made=made,
        port=port,
        baud=baud,
        real_time=real_time,
        flights=tuple(found),
        not_flown=faults.not_flown,
        times=session.times,
        frames=frames,
        stack_left=stack,
    )


class _Session:
    """What the flights on a board have in common."""

    def __init__(
        self, vehicle: Vehicle, made: BoardProgram, wire: Wire, real_time: bool, out: Path
    ) -> None:
        self.vehicle, self.made, self.wire = vehicle, made, wire
        self.real_time, self.out, self.times = real_time, out, Times()
        self.full = made.limits[1]  # the command that makes the vehicle lightest
        self._law, self._supervisor = made.twin(), twin(SUPERVISOR, read_law(SUPERVISOR, Watched))

    def twin(self, *, before: Any, after_reset: bool) -> VehicleTwin:
        """Return the board's twin; before: its state at the reset."""
        return VehicleTwin(
            self.made.controller(self._law),
            self.made.supervisor,
            supervisor=self._supervisor,
            after_reset=after_reset,
            before=before,
        )

    @contextmanager
    def flight(self, name: str, advance: Advance, share: float) -> Iterator[_Flight]:
        """Give a flight to fly, of so large a share of the work; raise what has stopped it."""
        path, began = self.out / f"{name.replace(' ', '-')}.csv", time.perf_counter()
        with path.open("w", encoding="utf-8", newline="\n", buffering=1) as log:
            flight = _Flight(self, name, log, lambda done: advance(done * share))
            try:
                yield flight
            except SwimbladderError:
                if flight.stopped is None:
                    raise
        flight.wall = time.perf_counter() - began
        stop = flight.stopped
        if isinstance(stop, NoAnswerError):
            at = f"tick {flight.ticks} ({flight.ticks * self.made.tick_s:.4g} s) of the {name}"
            safe = f"the model had full buoyancy from there on, and ended at {flight.depth:.1f} m"
            remedy = "Check the cable and the board's power, and fly again"
            raise NoAnswerError(f"{self.wire.port}: {stop}, at {at}; {safe}. {remedy}") from stop
        if stop is not None:
            raise stop


class _Flight:
    """A flight: the board and its twin, called side by side, and the log of what they say.

    After `stopped` is set, the board is not asked again, and the command is full buoyancy.
    """

    def __init__(self, session: _Session, name: str, log: TextIO, advance: Advance) -> None:
        self.session, self.name, self._log, self.advance = session, name, log, advance
        self.twin = session.twin(before=None, after_reset=False)
        self.ticks, self.unequal, self.reason = 0, 0, 0
        self.difference: Difference | None = None
        self.stopped: BaseException | None = None
        self.depth, self.ended, self.wall = math.nan, "", 0.0
        self._clock = 0  # ticks, of the board
        self._due, self._last = 0.0, -1  # s, us: of the next tick, and of the last by its clock
        column = session.made.facts["column"]
        more = "depth_age_s,battery_V,leak,lost_ticks,step_us,round_trip_us"
        log.write(f"{session.made.facts['header']},supervisor_reason,twin_{column},{more}\n")

    def begin(self, *, after_reset: bool) -> None:
        """Switch the board on, or reset it."""
        if self.stopped is not None:
            return
        try:
            self.session.wire.begin(after_reset=after_reset)
        except BaseException as error:  # none can pass through compiled code: kept for its end
            self.stopped = error
        self.twin = self.session.twin(before=self.twin.state, after_reset=after_reset)
        self._clock, self._last = 0, -1

    def tick(self, seen: Watched, reference: float) -> Said:
        """Return what the board says, or what is safe where it says nothing any more."""
        if self.stopped is None:
            try:
                return self._compared(_in_float32(seen), np.float32(reference))
            except BaseException as error:  # as above
                self.stopped = error
        return Said(self.session.full, math.nan, 0, 0, 0, False, False)

    def answer(self) -> FlightAnswer:
        """Return how it went."""
        return FlightAnswer(
            name=self.name,
            ticks=self.ticks,
            unequal=self.unequal,
            difference=self.difference,
            reason=Reason(self.reason).words if self.reason else "",
            ended=self.ended,
            depth=self.depth,
            duration=self.ticks * self.session.made.tick_s,
            wall=self.wall,
            log=Path(self._log.name),
        )

    def _compared(self, seen: Watched, reference: Any) -> Said:
        """Ask board and twin, compare and note what they say."""
        times, tick_s = self.session.times, self.session.made.tick_s
        self._wait(1 + seen.lost)
        asked = time.perf_counter()
        told = self.session.wire.tick(seen, float(reference))
        trip = time.perf_counter() - asked
        self._clock += seen.lost
        expected = _said(self.twin, self.twin.tick(seen, reference))
        different = [n for n in Said._fields if _bits(told.said, n) != _bits(expected, n)]
        if different:
            self.unequal += 1
            name = different[0]
            both = (float(getattr(one, name)) for one in (told.said, expected))
            self.difference = self.difference or Difference(self.ticks, name, *both)
        times.steps.append(told.took * 1e-6)
        times.trips.append(trip)
        if self._last >= 0 and seen.lost == 0:
            took = (told.began - self._last) % 2**32
            times.intervals.append(took * 1e-6 - tick_s)
        self._last, self.reason = told.began, self.reason or told.said.reason
        command = np.float32(told.said.command)
        row = [f"{self._clock * tick_s:.9g}", seen.depth, seen.volume, command, reference]
        row += [told.said.reason, expected.command, seen.depth_age, seen.battery]
        row += [int(seen.leak), seen.lost, told.took, round(trip * 1e6)]
        self._log.write(",".join(map(str, row)) + "\n")
        self._clock += 1
        self.ticks += 1
        return told.said

    def _wait(self, ticks: int) -> None:
        """Wait, in real time, until the tick is due that comes so many after the last."""
        if not self.session.real_time:
            return
        now, tick_s = time.perf_counter(), self.session.made.tick_s
        self._due = self._due + ticks * tick_s if self.ticks else now
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
    state = board.state
    return Said(
        command=command,
        allowed=state.proof.allowed,
        reasons=int(state.rescue.reasons),
        missed=min(board.controller.missed, 0xFFFF),
        reason=int(state.rescue.reason),
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
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0)
        return flight.tick(watched, reference)

    def seconds(seen: Measurement, reference: float) -> tuple[float, bool]:
        said = tick(seen, reference)
        return said.command, said.wide

    if made.drive is not None:
        n = max(math.ceil(mission.duration / made.tick_s - 1e-9), 1) + 1
        shares = np.array([share for share, _ in turns]) * n
        at = np.searchsorted(shares, np.arange(n), side="right") - 1
        asked = np.array([depth for _, depth in turns])[at]
        rows = fly_float(
            vehicle,
            seconds,
            tick=made.tick_s,
            start_depth=mission.start,
            asked=asked,
            seed=seed,
            advance=advance,
        )
        flight.depth = float(rows[-1, 0])
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
    flight.depth = float(flown.depth[-1])
    flight.ended = "" if flown.finished else flown.stop.value


class _Functions:
    """The functions of a board for the loop of `sim.faults`, which calls them by address."""

    size = 1  # bytes of memory here: the board has its own
    _TICK = ctypes.CFUNCTYPE(ctypes.c_float, ctypes.c_void_p, *[ctypes.POINTER(ctypes.c_float)] * 2)
    _BEGIN = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int)

    def __init__(self) -> None:
        self.addresses: dict[str, tuple[int, int]] = {}
        self._kept: tuple[Any, ...] = ()

    def call(self, flight: _Flight) -> None:
        """Let a flight be what is called."""

        def begin(_memory: Any, after_reset: int) -> None:
            flight.begin(after_reset=after_reset != 0)

        def tick(_memory: Any, seen: Any, said: Any) -> float:
            depth, age, volume, battery, leak, lost, reference = seen[:7]
            watched = Watched(depth, age, volume, battery, leak > 0.5, int(lost), 0)
            told = flight.tick(watched, reference)
            said[0], said[1], said[2], said[3] = told.reason, told.release, 0.0, told.wide
            return told.command

        self._kept = self._BEGIN(begin), self._TICK(tick)  # else they would be collected
        begins, ticks = (ctypes.cast(one, ctypes.c_void_p).value or 0 for one in self._kept)
        self.addresses[SUPERVISED] = begins, ticks


class _FaultMissions:
    """Missions of a catalogue's seed that a board can fly.

    A law that hangs is found out by asking it, which is undone in the memory of a board at hand;
    missions with that fault are not flown.
    """

    _hangs = frozenset(number for number, kind in KINDS.items() if kind.on == On.HANG)

    def __init__(self, vehicle: Vehicle, asked: Flights) -> None:
        self.missions: list[FaultMission] = []
        self._functions = _Functions()
        if not asked.faults:
            return
        course = course_of(vehicle, asked.depths)
        self._campaign = FaultCampaign(course, self._functions)
        drawn = (draw(course, seed=asked.seed or 0, number=n, healthy=False) for n in count())
        able = (mission for mission in drawn if not self._hangs.intersection(mission.faults))
        self.missions += islice(able, asked.faults)

    @property
    def not_flown(self) -> tuple[str, ...]:
        """Faults that no mission has."""
        return tuple(KINDS[n].name for n in sorted(self._hangs)) if self.missions else ()

    def fly(self, flight: _Flight, mission: FaultMission) -> None:
        """Fly a mission to its end."""
        self._functions.call(flight)
        result = self._campaign.flown(mission, SUPERVISED, OWN)
        ended = Outcome(int(outcomes(result[None], mission.condition.tick)[0])).words
        kinds = " and ".join(KINDS[fault].name for fault in mission.faults)
        flight.depth, flight.ended = Result(*result).depth, f"{kinds}: {ended}"
