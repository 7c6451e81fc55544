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
from swimbladder.control.supervisor_records import Reason
from swimbladder.physics.seawater import Column
from swimbladder.sim.faults.c_interface import IDEAL, SUPERVISED, UNSUPERVISED
from swimbladder.sim.faults.campaign_result import Campaign, Outcome, outcomes
from swimbladder.sim.faults.draw import Course, Mission, course_of, draw
from swimbladder.sim.faults.flight import FULL, OWN
from swimbladder.sim.faults.kinds import KINDS, Fault
from swimbladder.sim.faults.mission_records import Result, Trace
from swimbladder.sim.faults.run import FaultCampaign, board_of
from swimbladder.vehicle import Vehicle

MISSION_COLUMNS = (
    "mission", "fault_1", "severity_1", "onset_1_s", "end_1_s", "fault_2", "severity_2",
    "onset_2_s", "end_2_s", "start_depth_m", "deepest_setpoint_m", "bottom_m", "supply_V",
    "recoverable", "supervised", "reason", "latched_s", "release_s", "deepest_m", "resets",
    "unsupervised", "unsupervised_deepest_m",
)  # fmt: skip
TRACE_COLUMNS = (
    "time_s", "depth_m", "speed_m_s", "volume_m3", "command", "applied", "battery_V",
    "reference_depth_m", "depth_seen_m", "depth_age_s", "volume_seen_m3", "leak_seen",
    "lost_ticks", "board", "reason", "water_m3",
)  # fmt: skip
assert len(TRACE_COLUMNS) == 1 + len(Trace._fields)


def missions_csv(flown: Campaign) -> str:
    """Return a row for each mission with faults; times in s from its start."""
    tick = flown.tick
    supervised, unsupervised = flown.outcome(0), flown.outcome(1)
    facts = flown.faulty
    latched, released = flown.result(0, "latched") * tick, flown.result(0, "released") * tick
    deepest, resets = flown.result(0, "deepest"), flown.result(0, "resets")
    without = flown.result(1, "deepest")
    fault_rows = [
        [flown.fault_row(which, field) for field in ("kind", "first", "begin", "end")]
        for which in (0, 1)
    ]
    lines = [",".join(MISSION_COLUMNS)]
    for n in range(len(facts)):
        cells: list[str] = [str(n)]
        for kind, first, begin, end in fault_rows:
            code = int(kind[n])
            if not code:
                cells += ["", "", "", ""]
                continue
            known = KINDS[Fault(code)]
            cells += [
                known.name, "" if known.first is None else f"{first[n]:.6g}",
                f"{begin[n] * tick:.6g}", _number(end[n] * tick),
            ]  # fmt: skip
        cells += [_number(x) for x in facts[n, 2:6]]
        cells += [
            str(int(flown.recoverable[n])), Outcome(int(supervised[n])).words, flown.reason(n),
            _number(latched[n]), _number(released[n]), _number(deepest[n]), str(int(resets[n])),
            Outcome(int(unsupervised[n])).words, _number(without[n]),
        ]  # fmt: skip
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def trace_csv(rows: NDArray[np.float64], tick: float) -> str:
    """Return a row per tick [n, len(Trace)] of one mission."""
    lines = [",".join(TRACE_COLUMNS)]
    for k, row in enumerate(rows):
        lines.append(",".join(_cells((k * tick, *row))))
    return "\n".join(lines) + "\n"


def _cells(values: Iterable[float]) -> list[str]:
    return [repr(float(value)) if math.isfinite(value) else "nan" for value in values]


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
        code = int(self.results[0].reason)
        return Reason(code).words if code else ""

    def outcome(self, flight: int) -> Outcome:
        """Return how a flight ended."""
        found = outcomes(
            np.array([self.results[flight]]), tick=self.tick,
            stay=self.mission.condition.stay * self.tick,
        )  # fmt: skip
        return Outcome(int(found[0]))

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
        for fault, fault_row in zip(m.faults, m.fault_rows, strict=True):
            kind = KINDS[fault]
            how = "" if kind.first is None else f": {fault_row[1]:.3g} {kind.first.unit}".rstrip()
            end = f" to {fault_row[4] * self.tick:.0f} s" if math.isfinite(fault_row[4]) else " on"
            said.append(
                f"from {fault_row[3] * self.tick:.0f} s{end}: {kind.name}, {kind.words}{how}"
            )
        if self.reason:
            said.append(f"the supervisor took over at {self.latched:.0f} s: {self.reason}")
        else:
            said.append("the supervisor detected no fault")
        names = ("with the supervisor", "without it", "with full buoyancy 60 s after fault onset")
        for n, name in enumerate(names[: len(self.results)]):
            r = self.results[n]
            said.append(f"{name}: {self.outcome(n).words}, deepest {r.deepest:.1f} m, at the end "
                        f"{max(r.depth, 0.0):.1f} m")  # fmt: skip
        return said

    def to_json(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        return {
            "vehicle": self.course.vehicle.name,
            "water": self.course.water,
            "mission": self.mission.number,
            "healthy": self.healthy,
            "faults": [
                {
                    "kind": KINDS[fault].name, "severity": row[1], "onset_s": row[3] * self.tick,
                    "end_s": row[4] * self.tick,
                }
                for fault, row in zip(self.mission.faults, self.mission.fault_rows, strict=True)
            ],
            "latched_s": self.latched,
            "reason": self.reason,
            "outcomes": {
                name: self.outcome(n).words for n, name in enumerate(NAMES[: len(self.results)])
            },
        }  # fmt: skip


def fly_one(
    vehicle: Vehicle, number: int, *, healthy: bool = False, seed: int = 1,
    depths: tuple[float, float] | None = None, column: Column | None = None,
) -> Flown:  # fmt: skip
    """Return mission `number` of a seed, as a campaign flew it, with its trajectories.

    Raises InputError as `run_missions` does.
    """
    own_law(vehicle, sampled=False)
    course = course_of(vehicle, depths, column)
    mission = draw(course, seed=seed, number=number, healthy=healthy)
    ways = [(SUPERVISED, OWN), (UNSUPERVISED, OWN), (IDEAL, FULL)][: 2 if healthy else 3]
    with board_of(course) as board:
        campaign = FaultCampaign(course, board)
        flown = [campaign.traced(mission, who, how) for who, how in ways]
    return Flown(
        course=course, mission=mission, healthy=healthy,
        results=tuple(Result(*result) for result, _ in flown),
        rows=tuple(rows for _, rows in flown),
    )  # fmt: skip
