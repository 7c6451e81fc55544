"""One mission of a campaign again, with everything that happened in it.

As CSV it has a row per tick; the missions of a campaign have a row each.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.registry import own_law
from swimbladder.physics.seawater import Column
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED
from swimbladder.sim.faults.campaign_result import FaultResult, Outcome, outcomes, reason_words
from swimbladder.sim.faults.draw import Course, Mission, course_of, draw
from swimbladder.sim.faults.flight import FULL, OWN
from swimbladder.sim.faults.kinds import KINDS
from swimbladder.sim.faults.mission_records import Result, Trace
from swimbladder.sim.faults.run import FaultCampaign, board_of
from swimbladder.vehicle import Vehicle

_MOTION = ("time_s", "depth_m", "speed_m_s", "volume_m3")
_DRIVE = ("command", "applied", "battery_V", "reference_depth_m")
_SEEN = ("depth_seen_m", "depth_age_s", "volume_seen_m3", "leak_seen")
TRACE_COLUMNS = (*_MOTION, *_DRIVE, *_SEEN, "lost_ticks", "board", "reason", "water_m3")
assert len(TRACE_COLUMNS) == 1 + len(Trace._fields)


def missions_csv(flown: FaultResult) -> str:
    """Return a row for each mission with faults; times in s from its start."""
    tick, facts = flown.tick, flown.faulty
    columns: dict[str, Iterable[str]] = {"mission": map(str, range(len(facts)))}
    for n in (1, 2):
        kinds = [KINDS.get(int(code)) for code in flown.fault_row(n - 1, "kind")]
        sizes = zip(kinds, map(_number, flown.fault_row(n - 1, "first")), strict=True)
        columns[f"fault_{n}"] = [kind.name if kind else "" for kind in kinds]
        columns[f"severity_{n}"] = [size if kind and kind.first else "" for kind, size in sizes]
        for name, field in (("onset", "begin"), ("end", "end")):
            times = map(_number, flown.fault_row(n - 1, field) * tick)
            columns[f"{name}_{n}_s"] = [
                time if kind else "" for kind, time in zip(kinds, times, strict=True)
            ]
    columns |= {
        "start_depth_m": map(_number, facts["start"]),
        "deepest_setpoint_m": map(_number, facts["deepest"]),
        "bottom_m": map(_number, facts["bottom"]),
        "supply_V": map(_number, facts["supply"]),
        "recoverable": map(_number, flown.recoverable),
        "supervised": [Outcome(int(how)).words for how in flown.outcome(0)],
        "reason": map(flown.reason, range(len(facts))),
        "latched_s": map(_number, flown.result(0, "latched") * tick),
        "release_s": map(_number, flown.result(0, "released") * tick),
        "deepest_m": map(_number, flown.result(0, "deepest")),
        "resets": map(_number, flown.result(0, "resets")),
        "unsupervised": [Outcome(int(how)).words for how in flown.outcome(1)],
        "unsupervised_deepest_m": map(_number, flown.result(1, "deepest")),
    }
    return _csv(columns, zip(*columns.values(), strict=True))


def trace_csv(rows: NDArray[np.float64], tick: float) -> str:
    """Return a row per tick [n, len(Trace)] of one mission."""
    times = (np.arange(len(rows)) * tick)[:, None]
    return _csv(TRACE_COLUMNS, (map(_exact, row) for row in np.hstack((times, rows))))


def _csv(names: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    return "".join(",".join(cells) + "\n" for cells in (names, *rows))


def _exact(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else "nan"


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "nan"


Array = NDArray[np.float64]

NAMES = ("supervised", "unsupervised", "ideal_detection")


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A mission: supervised, with the law alone, and with ideal detection after 60 s."""

    course: Course
    mission: Mission
    healthy: bool
    results: tuple[Result, ...]
    rows: tuple[Array, ...]  # [ticks, len(Trace)] of each

    @property
    def tick(self) -> float:
        """The controller's sample time [s]."""
        return self.mission.condition.tick

    @property
    def latched(self) -> float:
        """Time [s] at which the supervisor took over; nan: never."""
        return self.results[0].latched * self.tick

    @property
    def reason(self) -> str:
        """Its reason in words; empty without one."""
        return reason_words(self.results[0].reason)

    def outcome(self, flight: int) -> Outcome:
        """Return how a flight ended."""
        return Outcome(int(outcomes(np.array([self.results[flight]]), self.tick)[0]))

    def lines(self) -> list[str]:
        """Return what happened, for a reader."""
        m, label = self.mission, "h" if self.healthy else ""
        said = [
            f"mission {label}{m.number}: set-points "
            + ", ".join(
                f"{z:.1f} m at {k * self.tick:.0f} s"
                for k, z in zip(m.turns, m.depths, strict=True)
            )
        ]
        for fault, (_, first, _, *times) in zip(m.faults, m.fault_rows, strict=True):
            kind, (begin, end) = KINDS[fault], (tick * self.tick for tick in times)
            how = ": ".join(filter(None, (kind.words, kind.size(first))))
            until = f" to {end:.0f} s" if math.isfinite(end) else " on"
            said.append(f"from {begin:.0f} s{until}: {kind.name}, {how}")
        if self.reason:
            said.append(f"the supervisor took over at {self.latched:.0f} s: {self.reason}")
        else:
            said.append("the supervisor detected no fault")
        names = ("with the supervisor", "without it", "with full buoyancy 60 s after fault onset")
        for n, (name, r) in enumerate(zip(names, self.results, strict=False)):
            ends = f"deepest {r.deepest:.1f} m, at the end {max(r.depth, 0.0):.1f} m"
            said.append(f"{name}: {self.outcome(n).words}, {ends}")
        return said

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        tick, names = self.tick, NAMES[: len(self.results)]
        return {
            "vehicle": self.course.vehicle.name,
            "water": self.course.water,
            "mission": self.mission.number,
            "healthy": self.healthy,
            "faults": [
                {"kind": KINDS[int(kind)].name, "severity": first}
                | {"onset_s": begin * tick, "end_s": end * tick}
                for kind, first, _, begin, end in self.mission.fault_rows
            ],
            "latched_s": self.latched,
            "reason": self.reason,
            "outcomes": {name: self.outcome(n).words for n, name in enumerate(names)},
        }


def fly_one(
    vehicle: Vehicle,
    number: int,
    *,
    healthy: bool = False,
    seed: int = 1,
    depths: tuple[float, float] | None = None,
    column: Column | None = None,
) -> Flown:
    """Return mission `number` of a seed, as a campaign flew it, with its trajectories.

    Raises InputError as `faults` does.
    """
    own_law(vehicle, sampled=False)
    course = course_of(vehicle, depths, column)
    mission = draw(course, seed=seed, number=number, healthy=healthy)
    ways = [(SUPERVISED, OWN), (UNSUPERVISED, OWN), (IDEAL, FULL)][: 2 if healthy else 3]
    with board_of(course) as board:
        campaign = FaultCampaign(course, board)
        flown = [campaign.traced(mission, who, how) for who, how in ways]
    return Flown(
        course=course,
        mission=mission,
        healthy=healthy,
        results=tuple(Result(*result) for result, _ in flown),
        rows=tuple(rows for _, rows in flown),
    )
