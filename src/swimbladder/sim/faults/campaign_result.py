"""Results of a fault campaign: which missions are recoverable, recovered, and detected how soon."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from swimbladder.control.supervisor import Reason
from swimbladder.io.answers import Answer, attributes
from swimbladder.physics.arrays import Array, Flags
from swimbladder.sim.engine.advance import DONE, LEFT_WATER
from swimbladder.sim.faults.draw import STAY, Course, FaultRow, Result, reached
from swimbladder.sim.faults.kinds import KINDS, not_drawn
from swimbladder.units import rounded, say

_say = partial(say, "sim", "faults")

_FIELDS = [
    ("start", np.float64),  # m
    ("deepest", np.float64),  # m, set-point
    ("bottom", np.float64),  # m
    ("supply", np.float64),  # V
    ("faults", np.float64, (2, len(FaultRow._fields))),  # kind 0: none
    ("flights", np.float64, (4, len(Result._fields))),  # see `run.FaultCampaign.flights`
]
ROW = np.dtype(_FIELDS)
"""A mission of a campaign."""
TOGETHER = "two faults at once"
_LOST = (
    "lost lost_early filled cut_short lost_share_without_supervisor=lost_without_supervisor "
    "lost_share_without_supervisor_of_all=all_lost_without_supervisor"
)
MILD = 0.3  # of the recoverable; fewer lost without a supervisor ask little of it


class Outcome(IntEnum):
    """How a mission ended."""

    SURFACED = 0
    BEYOND = 1
    BOTTOM = 2
    NOT_UP = 3
    STOPPED = 4
    FILLED = 5

    @property
    def words(self) -> str:
        """What a reader of the table sees."""
        return (
            "surfaced",
            "beyond the rated depth",
            "on the bottom",
            "not at the surface",
            "the simulation stopped",
            "surfaced and was filled by the leak",
        )[self]


def outcomes(results: Array, tick: float) -> Array:
    """Return the Outcome of each result [n, len(Result)]; tick [s]: the controller's sample time.

    A vehicle that leaps out of the water surfaced too. One that was at the surface and then
    heavy with all its volume out was filled: no command helps it any more.
    """
    r = Result(*results.T)
    up = (r.last - r.arrived) * tick >= math.floor(STAY / tick) * tick
    found = np.full(len(results), float(Outcome.NOT_UP))
    found[up] = Outcome.SURFACED
    found[(r.stop != DONE) & (r.stop != LEFT_WATER)] = Outcome.STOPPED
    found[r.stop == LEFT_WATER] = Outcome.SURFACED
    found[r.bottom == 1.0] = Outcome.BOTTOM
    found[~np.isnan(r.beyond)] = Outcome.BEYOND
    ended = (found != Outcome.SURFACED) & (found != Outcome.STOPPED)
    found[ended & ~np.isnan(r.up) & (r.filled == 1.0)] = Outcome.FILLED
    return found


def reason_words(code: float) -> str:
    """Return a reason in words; of a code that bits which flipped have made, as the C has it."""
    if code == 0.0:
        return ""
    return Reason(int(code)).words if code in set(Reason) else "unknown"


class Line(NamedTuple):
    """What became of the missions of one kind."""

    name: str
    family: str
    missions: int
    recoverable: int
    recovered: int  # of them, with the supervisor
    lost_without_supervisor: int  # of them, without
    recovered_by_supervisor: int  # of them, with the supervisor and not without
    unrecoverable_surfaced: int  # surfaced although they were not counted on
    latched: int
    detection_time_median: float  # s from onset to the reason; nan: never
    detection_time_95: float
    deepest: float  # m, supervised


def rule_of_three(found: int, trials: int) -> float:
    """Return the upper end of the one-sided 95 % interval of a probability (Clopper-Pearson).

    With nothing found it is 1 - 0.05^(1/n), about 3/n.
    """
    return 1.0 if found >= trials else float(betaincinv(found + 1, trials - found, 0.95))


def _results(rows: NDArray[np.void], flight: int, field: str) -> Array:
    return np.asarray(rows["flights"][:, flight, Result._fields.index(field)])


@dataclass(frozen=True, kw_only=True)
class FaultResult(Answer):
    """Missions with faults and without, a ROW each; see `run`."""

    course: Course
    seed: int
    faulty: NDArray[np.void]
    healthy: NDArray[np.void]
    program: str  # hash of the C that was flown, which `firmware` prints too

    @property
    def tick(self) -> float:
        """The controller's sample time [s]."""
        return self.course.tick

    def fault_row(self, which: int, field: str) -> Array:
        """Return a field of the first (0) or the second (1) fault of each mission."""
        return np.asarray(self.faulty["faults"][:, which, FaultRow._fields.index(field)])

    def result(self, flight: int, field: str) -> Array:
        """Return a field of the flight: 0 supervised, 1 not, 2 and 3 with ideal detection."""
        return _results(self.faulty, flight, field)

    def outcome(self, flight: int) -> Array:
        """Return the Outcome of a flight of each mission with faults."""
        return outcomes(self.faulty["flights"][:, flight], self.tick)

    @cached_property
    def recoverable(self) -> Flags:
        """Whether full buoyancy, 60 s after the last fault begins to act, brings each up."""
        return np.asarray(self.outcome(2) == Outcome.SURFACED)

    def came_up(self, flight: int, *, ideal: int = 2) -> Flags:
        """Whether each mission of a flight surfaced, or was filled but up no later than in `ideal`.

        That flight, with ideal detection, stays for a minute; a leak fills both in the end.
        """
        found = self.outcome(flight)
        sooner = self.result(flight, "up") <= self.result(ideal, "up")
        return np.asarray((found == Outcome.SURFACED) | ((found == Outcome.FILLED) & sooner))

    @cached_property
    def lost(self) -> NDArray[np.intp]:
        """Numbers of the recoverable missions that the supervisor lost."""
        return np.flatnonzero(self.recoverable & ~self.came_up(0))

    @cached_property
    def filled(self) -> NDArray[np.intp]:
        """Numbers of the recoverable vehicles that were up no later, and were filled all the same.

        They count as recovered: the sea drives a heavy vehicle down, whatever is commanded.
        """
        return np.flatnonzero(
            self.recoverable & self.came_up(0) & (self.outcome(0) == Outcome.FILLED)
        )

    @cached_property
    def lost_early(self) -> NDArray[np.intp]:
        """Numbers of those lost that full buoyancy 60 s after the first of two faults recovers.

        60 s after the second acts it does not: it is too late by then, or the second is a block
        that has not shown before. A fault that is there from the start is no first one: full
        buoyancy 60 s later comes before the other has begun.
        """
        ideal: Flags = self.outcome(3) == Outcome.SURFACED
        there = [number for number, kind in KINDS.items() if kind.from_start]
        begun = np.isin([self.fault_row(which, "kind") for which in (0, 1)], there).any(axis=0)
        return np.flatnonzero(ideal & ~self.recoverable & ~self.came_up(0, ideal=3) & ~begun)

    @cached_property
    def detection_time(self) -> Array:
        """Time from when the first fault acts to the supervisor's reason [s]; nan: it had none."""
        return np.asarray((self.result(0, "latched") - self.result(0, "acting")) * self.tick)

    @property
    def lost_without_supervisor(self) -> float:
        """Share of the recoverable vehicles that are lost without the supervisor."""
        unsupervised = self.recoverable & ~self.came_up(1)
        return int(unsupervised.sum()) / max(1, int(self.recoverable.sum()))

    @property
    def all_lost_without_supervisor(self) -> float:
        """Share of all vehicles with faults that are lost without the supervisor."""
        return float(np.mean(~self.came_up(1)))

    @property
    def false_alarms(self) -> NDArray[np.intp]:
        """Numbers of the healthy missions in which the supervisor had a reason but their length."""
        reasons = self._healthy_reasons
        return np.flatnonzero((reasons > 0.0) & (reasons != float(Reason.TIME_LIMIT)))

    @property
    def too_slow(self) -> NDArray[np.intp]:
        """Numbers of the healthy missions that the law did not end within the time limit."""
        return np.flatnonzero(self._healthy_reasons == float(Reason.TIME_LIMIT))

    @property
    def _healthy_reasons(self) -> Array:
        """The code of the supervisor's reason in each healthy mission; 0: it had none."""
        return _results(self.healthy, 0, "reason")

    @cached_property
    def cut_short(self) -> NDArray[np.intp]:
        """Numbers of the missions whose time limit acts before their depth is off by 3 m."""
        ends = [
            max(reached(FaultRow(*row), self.tick) for row in rows)
            for rows in self.faulty["faults"].tolist()
        ]
        return np.flatnonzero(np.array(ends) > self.course.time_limit)

    @property
    def healthy_lost(self) -> NDArray[np.intp]:
        """Numbers of the healthy missions that did not end at the surface."""
        found = outcomes(self.healthy["flights"][:, 0], self.tick)
        return np.flatnonzero(found != Outcome.SURFACED)

    @property
    def passed(self) -> bool:
        """Whether every recoverable vehicle surfaced, with no false alarm in health."""
        return len(self.lost) == 0 and len(self.false_alarms) == 0

    @property
    def sentences(self) -> list[str]:
        """What was flown, and what it comes to."""
        return list(self._words())

    def _words(self) -> Iterator[str]:
        course = self.course
        assert course.vehicle.controller is not None
        sea = "" if course.column is None else f" in the water of {course.water}"
        depths = course.depths
        between = f"between {rounded(depths.least, 3)} and {rounded(depths.most, 3)} m"
        missions = f"{len(self.faulty)} missions with faults {between} ({depths.limit})"
        law = f"law {course.vehicle.controller.law}"
        limit = f"time limit {course.time_limit:.0f} s, C {self.program}"
        yield f"{course.vehicle.name}{sea}, {law}: {missions}, {limit}"
        for part, names in not_drawn(self.course.vehicle).items():
            yield f"not drawn, as it lacks {part}: {', '.join(names)}"
        able, total = int(self.recoverable.sum()), len(self.faulty)
        gone = self.lines()[-1]
        yield _say(
            "recoverable", able=able, total=total, gone=gone, found=self, others=total - able
        )
        if len(self.lost_early):
            yield _say("lost early", lost_early=len(self.lost_early))
        if len(self.filled):
            yield _say("filled", filled=len(self.filled))
        if len(self.cut_short):
            yield _say("time limit", cut_short=len(self.cut_short))
        if self.lost_without_supervisor < MILD:
            few = f"less than {MILD:.0%} of the recoverable missions were lost"
            yield f"the faults are mild for this law: without the supervisor {few}"
        alarms, trials = len(self.false_alarms), len(self.healthy)
        most = f"at most {rule_of_three(alarms, trials):.2g} of them (95 %)"
        below = f"{len(self.healthy_lost)} did not come up"
        yield f"healthy: {alarms} false alarms in {trials} missions, {most}; {below}"
        if len(self.too_slow):
            slow = f"{len(self.too_slow)} healthy missions had not ended at the time limit"
            yield f"{slow}, and the supervisor ended them: the law is slow for them"

    def lines(self) -> list[Line]:
        """Return a line for each kind of fault that came alone, one for pairs, and one for all."""
        first, two = self.fault_row(0, "kind"), self.fault_row(1, "kind") > 0.0
        found = [
            self._line(kind.name, kind.family, (first == fault) & ~two)
            for fault, kind in KINDS.items()
        ]
        every = np.ones(len(first), bool)
        return [
            line
            for line in (*found, self._line(TOGETHER, "", two), self._line("all", "", every))
            if line.missions
        ]

    def _line(self, name: str, family: str, chosen: Flags) -> Line:
        able = self.recoverable & chosen
        recovered, unsupervised = self.came_up(0), self.came_up(1)
        latch = self.detection_time[chosen & ~np.isnan(self.detection_time)]
        return Line(
            name=name,
            family=family,
            missions=int(chosen.sum()),
            recoverable=int(able.sum()),
            recovered=int((able & recovered).sum()),
            lost_without_supervisor=int((able & ~unsupervised).sum()),
            recovered_by_supervisor=int((able & recovered & ~unsupervised).sum()),
            unrecoverable_surfaced=int((chosen & ~able & recovered).sum()),
            latched=len(latch),
            detection_time_median=float(np.median(latch)) if len(latch) else math.nan,
            detection_time_95=float(np.quantile(latch, 0.95)) if len(latch) else math.nan,
            deepest=float(self.result(0, "deepest")[chosen].max()) if chosen.any() else math.nan,
        )

    def reason(self, number: int) -> str:
        """Return the supervisor's reason in a mission, in words; empty where it had none."""
        return reason_words(self.result(0, "reason")[number])

    def description(self, number: int) -> str:
        """Return what happened to a mission, in a line."""
        parts = []
        for code, first, _, *times in self.faulty["faults"][number].tolist():
            if code:
                kind, (begin, end) = KINDS[int(code)], (tick * self.tick for tick in times)
                lasts = f" for {end - begin:.0f} s" if math.isfinite(end) else ""
                how = f"{kind.name} {kind.size(first)}".rstrip()
                parts.append(f"{how} at {begin:.0f} s{lasts}")
        late, reason = self.detection_time[number], self.reason(number)
        seen = f"{reason} {late:.0f} s after the first onset" if reason else "not detected"
        ended = Outcome(int(self.outcome(0)[number])).words
        return f"mission {number}: {', '.join(parts)}: {seen}, {ended}"

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        course, healthy = self.course, attributes(self, "too_slow lost=healthy_lost")
        trials, alarms = len(self.healthy), self.false_alarms
        counts = {"missions": trials, "false_alarms": alarms}
        return {
            **attributes(self, "vehicle=course.vehicle.name water=course.water"),
            "law": course.vehicle.controller and course.vehicle.controller.law,
            **attributes(self, "sha256_of_c=program seed"),
            "missions": len(self.faulty),
            "depths_m": [course.depths.least, course.depths.most],
            "time_limit_s": course.time_limit,
            "not_drawn": not_drawn(course.vehicle),
            "recoverable": int(self.recoverable.sum()),
            **attributes(self, _LOST),
            "kinds": list(self.lines()),
            "healthy": counts | {"bound_95": rule_of_three(len(alarms), trials)} | healthy,
            "passed": self.passed,
        }
