"""Time every peer in turn, measure how right each is, and print it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks import campaign, year
from benchmarks.identify import fits, report
from benchmarks.memory import GOAL as MEMORY_GOAL
from benchmarks.memory import LANES as MEMORY_LANES
from benchmarks.memory import peak
from benchmarks.mission import DURATION, Array, Fleet, Mission, fleet, mission
from benchmarks.peers import Peer, peers
from benchmarks.reference import Reference, reference
from benchmarks.startup import GOALS, startup
from benchmarks.table import machine, number, ratio, render
from swimbladder.io.files import write_atomically

__all__ = ["main"]

# Vehicles whose right answer is computed: 0 is feup-em itself, 15 and 31 have the short stroke.
CHECKED = (0, 1, 3, 4, 15, 31)
AGREES = 1e-3  # m; a peer further off than this runs another mission


@dataclass
class Score:
    """What was measured of a peer; times are for one hour of one vehicle [ms]."""

    single_cpu: float | None = None
    single_wall: float | None = None
    fleet_cpu: float | None = None
    fleet_wall: float | None = None
    threaded_wall: float | None = None
    errors: dict[int, tuple[float, float]] = field(default_factory=dict)  # lane: largest, rms [m]

    @property
    def per_core(self) -> float | None:
        """Time of a vehicle of the fleet on a core: of one alone, where only that can be run."""
        return self.single_cpu if self.fleet_cpu is None else self.fleet_cpu

    def error(self, lanes: list[int], which: int) -> float | None:
        """Return the largest of the largest (0) or rms (1) errors [m] over lanes."""
        return max(
            (self.errors[lane][which] for lane in lanes if lane in self.errors), default=None
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return the exit code."""
    options = _options(arguments)
    result: dict[str, Any] = {"machine": machine()}
    print("; ".join(f"{name} {value}" for name, value in result["machine"].items()), "\n")
    begin = perf_counter()
    apart = {"c", "startup"} if options.quick else {"c"}  # c: among the peers
    for part in options.parts or [part for part in PARTS if part not in apart]:
        result |= PARTS[part](options)
    print(f"\nTook {perf_counter() - begin:.0f} s")
    if options.json is not None:
        write_atomically(options.json, json.dumps(result, indent=1, default=asdict) + "\n")
    return 0


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "parts",
        nargs="*",
        choices=[[], *PARTS],
        metavar="PART",
        help=f"only these: {', '.join(PARTS)} (all; c: the package against C alone)",
    )
    parser.add_argument("--quick", action="store_true", help="a smoke run of some seconds")
    parser.add_argument("--lanes", type=int, default=4096, help="vehicles of the fleet (4096)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the numbers there")
    options = parser.parse_args(arguments)
    if options.lanes <= max(CHECKED):
        parser.error(f"--lanes: at least {max(CHECKED) + 1}, the checked vehicles are among them")
    return options


def _identify(options: argparse.Namespace) -> dict[str, Any]:
    timings = fits(quick=options.quick, note=_note)
    _note("")
    print(report(timings), "\n")
    return {"identify": [vars(t) for t in timings]}


def _year(options: argparse.Namespace) -> dict[str, Any]:
    return _compared("year", "a year of ten-day cycles", year, options)


def _campaign(options: argparse.Namespace) -> dict[str, Any]:
    return _compared("campaign", "a campaign by threads, processes and dask", campaign, options)


def _compared(
    name: str, what: str, module: ModuleType, options: argparse.Namespace
) -> dict[str, Any]:
    """Compare by a module of peers, and print its report."""
    _note(what)
    found = module.compare(quick=options.quick)
    _note("")
    print(module.report(found), "\n")
    return {name: [vars(one) for one in found]}


def _memory(options: argparse.Namespace) -> dict[str, Any]:
    lanes = 512 if options.quick else MEMORY_LANES
    found = {"lanes": lanes, **peak(lanes, 60.0 if options.quick else DURATION)}
    print(
        f"\nMemory of {lanes:,} vehicles that keep summaries: {found['peak_MB']:.0f} MB, of which"
        f" {found['before_MB']:.0f} MB before they start; goal {MEMORY_GOAL:.0f} MB\n"
    )
    return {"memory": found}


def _startup(options: argparse.Namespace) -> dict[str, Any]:
    times = startup(1 if options.quick else 5)
    rows = [
        (what, f"{wall:.2f}", f"{cpu:.2f}", number(GOALS.get(what)))
        for what, (wall, cpu) in times.items()
    ]
    print(render(["Command line", "s", "of processor", "goal"], rows))
    return {"startup_s": times}


def _against_c(options: argparse.Namespace) -> dict[str, Any]:
    return _side_by_side(options, only="C")


def _side_by_side(options: argparse.Namespace, only: str = "") -> dict[str, Any]:
    task = mission(300.0 if options.quick else DURATION)
    many = fleet(task.vehicle, 256 if options.quick else options.lanes)
    checked = CHECKED[-2:] if options.quick or only else CHECKED
    with ExitStack() as stack:
        found, absent = peers(task, many, stack, quick=options.quick, only=only)
        right = {lane: _reference(task, many, lane) for lane in checked}
        scores = {peer.name: Score() for peer in found}
        for peer in found:
            _note(f"accuracy of {peer.name}")
            _check(peer, right, scores[peer.name])
        for lane in checked:
            for peer in found:
                if peer.depth is not None:
                    _note(f"one vehicle: {peer.name}")
                    _time_single(peer, lane, task, right[lane], scores[peer.name])
        for turn in range(2 if options.quick else 5):
            for peer in found:
                if peer.fleet is not None and turn < peer.repetitions:
                    _note(f"{len(many):,} vehicles: {peer.name}")
                    _time_fleet(peer, task, many, right, scores[peer.name])
    _note("")
    _print(task, many, right, scores, absent)
    remarks = {peer.name: peer.remark for peer in found if peer.remark}
    for name, remark in remarks.items():
        print(f"\n{name.split(',')[0]},{name.split(',')[1]}, ms by shape: {remark}")
    return {
        "mission": {"duration_s": task.duration, "lanes": len(many), "setpoints": task.setpoints},
        "touched": {lane: answer.touched for lane, answer in right.items()},
        "absent": absent,
        "remarks": remarks,
        "scores": {name: vars(score) for name, score in scores.items()},
    }


PARTS: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "identify": _identify,
    "year": _year,
    "campaign": _campaign,
    "peers": _side_by_side,
    "c": _against_c,
    "memory": _memory,
    "startup": _startup,
}


def _reference(task: Mission, many: Fleet, lane: int) -> Reference:
    _note(f"the right answer for vehicle {lane}")
    return reference(task, many, lane)


def _check(peer: Peer, right: dict[int, Reference], score: Score) -> None:
    """Measure the depth error of both ways of a peer, and keep the larger."""
    lanes = list(right)
    runs: list[tuple[int, Array]] = []
    if peer.depths is not None:
        runs += zip(lanes, peer.depths(lanes), strict=True)
    for lane, depth in runs:
        _enter_error(peer, lane, depth, right[lane], score)


def _enter_error(peer: Peer, lane: int, depth: Array, right: Reference, score: Score) -> None:
    error = depth - right.depth
    largest, rms = float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))
    if not largest < AGREES:
        raise ArithmeticError(f"{peer.name} is {largest:g} m off on vehicle {lane}")
    before = score.errors.get(lane, (0.0, 0.0))
    score.errors[lane] = max(before[0], largest), max(before[1], rms)


def _time_single(peer: Peer, lane: int, task: Mission, right: Reference, score: Score) -> None:
    assert peer.depth is not None
    run = peer.depth
    for _ in range(peer.repetitions):
        depth, wall, cpu = _timed(lambda: run(lane))
        score.single_wall = _less(score.single_wall, wall * 1e3 * DURATION / task.duration)
        score.single_cpu = _less(score.single_cpu, cpu * 1e3 * DURATION / task.duration)
    _enter_error(peer, lane, depth, right, score)


def _time_fleet(
    peer: Peer, task: Mission, many: Fleet, right: dict[int, Reference], score: Score
) -> None:
    assert peer.fleet is not None
    run, per = peer.fleet, 1e3 * DURATION / task.duration / len(many)
    last, wall, cpu = _timed(lambda: run(1))
    for lane, answer in right.items():
        if not abs(last["z"][lane] - answer.depth[-1]) < AGREES:
            raise ArithmeticError(f"{peer.name}: vehicle {lane} of the fleet ends somewhere else")
    score.fleet_wall = _less(score.fleet_wall, wall * per)
    score.fleet_cpu = _less(score.fleet_cpu, cpu * per)
    if peer.threads > 1:
        _, wall, _ = _timed(lambda: run(peer.threads))
        score.threaded_wall = _less(score.threaded_wall, wall * per)


def _timed(run: Callable[[], Any]) -> tuple[Any, float, float]:
    wall, cpu = perf_counter(), process_time()
    found = run()
    return found, perf_counter() - wall, process_time() - cpu


def _less(best: float | None, value: float) -> float:
    return value if best is None else min(best, value)


def _print(
    task: Mission,
    many: Fleet,
    right: dict[int, Reference],
    scores: dict[str, Score],
    absent: list[str],
) -> None:
    ours, *others = scores.values()
    yardstick = others[0]
    print(f"One vehicle, {task.samples:,} samples of {task.sample_time:g} s; ms per vehicle-hour\n")
    alone = [
        (name, number(s.single_wall), number(s.single_cpu), ratio(s.single_cpu, ours.single_cpu))
        for name, s in scores.items()
        if s.single_cpu is not None
    ]
    print(render(["", "wall", "on the core", "to ours"], alone))
    print(f"\n{len(many):,} vehicles; ms per vehicle-hour\n")
    together = [
        (
            name,
            number(s.per_core),
            ratio(s.per_core, ours.per_core),
            ratio(s.per_core, yardstick.per_core),
            "together" if s.fleet_cpu is not None else "one by one",
            number(s.threaded_wall),
        )
        for name, s in scores.items()
    ]
    first = list(scores)[1].split(",")[0]
    headings = ["", "per core", "to ours", f"to {first}", "run", "two threads, wall"]
    print(render(headings, together))
    free = [lane for lane, answer in right.items() if not answer.touched]
    contact = [lane for lane in right if lane not in free]
    print("\nLargest and rms depth error [m] against DOP853 at 1e-12\n")
    errors = [
        (name, *(number(s.error(lanes, which), 2) for lanes in (free, contact) for which in (0, 1)))
        for name, s in scores.items()
        if s.errors
    ]
    print(render(["", "in open water", "rms", "in contact", "rms"], errors))
    for lane, answer in right.items():
        print(f"  vehicle {lane} touches: {answer.touched or 'nothing'}")
    for line in absent:
        print(f"  absent: {line}")
    if task.duration == DURATION:  # in less the cost of a call shows
        goals = [
            (what, number(wanted, 4), number(found), "yes" if met else "NO")
            for what, wanted, found, met in _goals(scores)
        ]
        print("\n" + render([f"Goals for {len(many):,} vehicles", "wanted", "found", "met"], goals))


def _goals(scores: dict[str, Score]) -> list[tuple[str, float, float, bool]]:
    """Return (goal, wanted, found, met) of the package's fleet, as far as its rivals are here."""
    ours, *_ = scores.values()
    assert ours.per_core is not None
    goals: list[tuple[str, float, float, bool]] = []

    def enter(what: str, wanted: float, found: float, *, least: bool) -> None:
        goals.append((what, wanted, found, found >= wanted if least else found <= wanted))

    enter("ms per vehicle-hour and core, at most", 0.20, ours.per_core, least=False)
    enter(
        "largest depth error [m], at most", 2e-6, ours.error([*ours.errors], 0) or 0.0, least=False
    )
    for start, wanted in (("C, RK4", 1.25), ("JAX", 20.0), ("SciPy", 5000.0)):
        times = [
            s.per_core
            for name, s in scores.items()
            if name.startswith(start) and s.per_core is not None
        ]
        if times:
            alone = [s.single_cpu for name, s in scores.items() if name.startswith(start)]
            if start == "C, RK4" and alone[0] and ours.single_cpu:
                found = ours.single_cpu / alone[0]
                enter("one vehicle, times C, at most", 1.5, found, least=False)
            rival = "SciPy's fastest" if start == "SciPy" else start
            enter(f"{rival}, times ours, at least", wanted, min(times) / ours.per_core, least=True)
    return goals


def _note(text: str) -> None:
    """Say on a terminal what is being waited for."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
