"""The paper's eight pool experiments fitted jointly: by the package and by its peers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.scipy_fit import INTEGRATORS, Answer, Flight, Task, descend, profile, solve
from benchmarks.table import number, ratio, render
from studies.campaign import arguments, logs, vehicle
from studies.scenarios import NEUTRAL_STD, SCENARIOS, Campaign, draw
from swimbladder.estimation.motion import Identification, identify

__all__ = ["GOALS", "Timing", "fits", "report"]

GOALS = {"swimbladder": 0.1, "swimbladder, with profiles": 1.0}  # s
POINTS = 8  # of a profile, as many as the package takes at least
_PAPER = SCENARIOS[0]


@dataclass(frozen=True)
class Timing:
    """A way to fit: how long it took, where it ended, and how far that is from the best end."""

    name: str
    seconds: float  # wall time, the least of its repetitions
    K2: float  # 1/m2/s
    T2: float  # s
    cost: float | None = None  # sum of squares beyond the least that any way found
    runs: int | None = None  # of all eight experiments, where it is known
    remark: str = ""


def fits(*, quick: bool, note: Callable[[str], None]) -> list[Timing]:
    """Return the timings of all ways, the package's first; `note` is told what runs."""
    campaign = draw(_PAPER, seed=1, index=0)
    ours = _ours(campaign, note, repetitions=3 if quick else 10)
    answer = ours[0][1]
    flights = tuple(Flight(k.time, k.depth, k.volume) for k in campaign.kept)
    guess = campaign.guess
    task = Task(
        flights,
        guess["psi"],
        _PAPER.psi_std * campaign.truth["psi"],
        NEUTRAL_STD,
        answer.depth_noise,
        (guess["K2"], guess["T2"], guess["psi"]),
    )
    theirs: list[tuple[str, float, Answer, str]] = []
    for name, depths in INTEGRATORS.items():
        if quick and name != "odeint":
            continue
        note(f"least squares on {name}")
        begin = perf_counter()
        found = solve(task, depths, most=2 if quick else None)
        alone = perf_counter() - begin
        theirs.append((f"least_squares on {name}", alone, found, ""))
        if name == "odeint" and not quick:
            note("profiles on odeint")
            begin = perf_counter()
            profile(task, depths, found, POINTS)
            one = perf_counter() - begin
            remark = "one profile run, its time counted for each of the three"
            theirs.append(
                (f"least_squares on {name}, with profiles", alone + 3 * one, found, remark)
            )
    note("Nelder-Mead on odeint")
    most = 30 if quick else 4_000
    begin = perf_counter()
    found = descend(task, INTEGRATORS["odeint"], most=most)
    remark = f"stopped after {most:,} evaluations" if found.evaluations >= most else ""
    theirs.append(("Nelder-Mead on odeint", perf_counter() - begin, found, remark))
    least = min(found.cost for _, _, found, _ in theirs)
    return [
        *(
            Timing(name, seconds, *(a.parameters[n].value for n in ("K2", "T2")))
            for name, a, seconds in ours
        ),
        *(
            Timing(
                name,
                seconds,
                float(np.exp(a.x[0])),
                float(np.exp(a.x[1])),
                a.cost - least,
                a.evaluations,
                remark,
            )
            for name, seconds, a, remark in theirs
        ),
    ]


def _ours(
    campaign: Campaign, note: Callable[[str], None], *, repetitions: int
) -> list[tuple[str, Identification, float]]:
    given = logs(campaign.kept), vehicle(_PAPER, campaign)
    options: dict[str, Any] = arguments(_PAPER, campaign)
    identify(*given, **options, profiles=False)  # compiled and loaded
    found = []
    for name, extra in (
        ("swimbladder", {"profiles": False}),
        ("swimbladder, with profiles", {"profiles": True}),
        ("swimbladder, all it does", {"profiles": True, "choices": True}),
    ):
        note(name)
        seconds = np.inf
        for _ in range(repetitions):
            begin = perf_counter()
            answer = identify(*given, **(options | extra))
            seconds = min(seconds, perf_counter() - begin)
        found.append((name, answer, float(seconds)))
    return found


def report(timings: list[Timing]) -> str:
    """Return the timings as a table, with ratios to the package's fit of the same kind."""
    of = {t.name: t.seconds for t in timings}
    rows = []
    for t in timings:
        kind = "swimbladder, with profiles" if "profiles" in t.name else "swimbladder"
        rows.append(
            (
                t.name,
                number(t.seconds),
                number(GOALS.get(t.name)),
                ratio(t.seconds, of[kind]),
                f"{t.K2:.0f}",
                f"{t.T2:.2f}",
                number(t.cost),
                number(t.runs),
            )
        )
    headings = ("Joint fit", "s", "goal", "against ours", "K2", "T2", "cost", "runs")
    remarks = [f"{t.name}: {t.remark}" for t in timings if t.remark]
    return "\n".join(
        [
            "Eight pool experiments of the paper, simulated; 27 unknowns, with intervals\n",
            render(headings, rows),
            "\ncost: sum of squares beyond the best; the package weighs outliers and estimates the"
            "\nnoise of each record, the others are told it; runs: of all eight experiments",
            *remarks,
        ]
    )
