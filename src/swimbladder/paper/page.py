"""The report put together: figures, tables, verdicts, into one page, one JSON object and curves."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder import __version__
from swimbladder.io.answers import as_json, attributes
from swimbladder.io.progress import Advance
from swimbladder.paper.actuation import CLEARANCE, POOL_DEPTH
from swimbladder.paper.evidence import SENSORS, Evidence
from swimbladder.paper.tables import tables
from swimbladder.paper.verdict import EquationCheck, Finding, Verdict, texts
from swimbladder.show import paper
from swimbladder.show.html import page_figure, render
from swimbladder.show.picture import Picture
from swimbladder.sim.pool import Fit, PoolRun, response

FIGURES: dict[str, Callable[[Evidence], Picture]] = {
    "figure-12": lambda e: paper.draw_procedure(e.runs[0]),
    "figure-13": lambda e: paper.draw_speeds(e.experiments, e.table2[0]),
    "figure-14": lambda e: paper.draw_depths(e.experiments, e.table2[1]),
    "figure-psi": lambda e: paper.draw_neglect(
        e.experiments, e.depth_fits, e.still_curve, Fit(e.motion.K2, e.motion.T2, 0.0)
    ),
    "figure-16": lambda e: paper.draw_steps(e.steps),
    "figure-17": lambda e: paper.draw_long_step(e.long_step),
}
_ABOUT = texts("page")["figures"]
_EQUATION = "number checked value limit passed note"
_EXPERIMENT = (
    "step volume_asked_m3=dV volume_achieved_m3=achieved neutral_error_m3 pulse_V "
    "pulse_s=pulse_time released_s ended_s"
)
_STEPS = "timed_voltages=pulses figure_16=step_rows figure_17=long_metrics overshoot_pairs=pairs"
ERRATA: dict[str, list[dict[str, str]]] = texts("errata")
"""Where the paper's text is wrong, `errata`, or `silent`, and what is done about it here."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Every comparison of the report."""

    published: Sequence[Finding]
    independent: Sequence[Finding]
    equations: Sequence[EquationCheck]

    @property
    def verdicts(self) -> dict[str, int]:
        """How many of the published numbers and claims have each verdict."""
        counted = Counter(f.verdict for f in self.published)
        return {verdict.name: counted[verdict] for verdict in Verdict}

    @property
    def failures(self) -> tuple[str, ...]:
        """What failed, a line each."""
        found = [f for f in (*self.published, *self.independent) if f.verdict is Verdict.FAILS]
        return (
            *(f"{f.where}, {f.what}: {f.paper} against {f.ours}" for f in found),
            *(f"eq. ({c.number}): {c.result}" for c in self.equations if not c.passed),
        )


def draw(e: Evidence, advance: Advance) -> dict[str, Picture]:
    """Return every figure by its name; `advance` is called for each."""
    figures = {}
    for name, drawn in FIGURES.items():
        figures[name] = drawn(e)
        advance(1.0)
    return figures


def page(e: Evidence, judged: Judged, figures: dict[str, Picture], files: Sequence[str]) -> str:
    """Return the report as HTML."""
    context = {
        "version": __version__,
        "e": e,
        "judged": judged,
        "tables": tables(e),
        "pool": {"depth": POOL_DEPTH, "clearance": CLEARANCE, "sensors": SENSORS},
        "jitter": [1e6 * _last_minute(run) for run in e.runs],
        "difference": _pulse_difference(e),
        "figures": {name: page_figure(name, f, said=_ABOUT) for name, f in figures.items()},
        "files": files,
    }
    return render("paper.html.j2", context | ERRATA)


def _last_minute(run: Any) -> float:
    """Return the standard deviation of the true volume in the minute before step (b) [m3]."""
    s, released = run.solution, run.experiments[0].released
    part = (s.time > released - 60.0) & (s.time < released - run.parameters.halt)
    return float(np.std(s.volume[part]))


def _pulse_difference(e: Evidence) -> float:
    """Return the largest difference between formula and simulation over dx."""
    return max(float(np.max(np.abs(np.subtract(p.simulated, p.formula) / p.dx))) for p in e.pulses)


def answer(e: Evidence, judged: Judged, files: Sequence[str]) -> dict[str, Any]:
    """Return the report's numbers for a machine, SI."""
    by_speed, by_depth = e.table2
    return {
        "paper": "10.3390/act12100380",
        "version": __version__,
        "seed": e.seed,
        "vehicle": e.vehicle.name,
        "passed": not judged.failures,
        **attributes(judged, "failures verdicts published independent"),
        "equations": [as_json(c, _EQUATION) for c in judged.equations],
        "table2": {"row_26": by_speed, "row_27": by_depth},
        "experiments": [
            {**as_json(x, _EXPERIMENT), **dict(zip(("eq_26", "eq_27", "eq_32"), by, strict=True))}
            for x, *by in zip(e.experiments, e.speed_fits, e.depth_fits, e.known_fits, strict=True)
        ],
        "without_noise": {
            "experiments": [{"volume_m3": dV, "eq_27": fit} for dV, fit in e.still],
            "joint": e.still_joint,
            "joint_with_psi": e.still_known,
            "average_26": e.still_average[0],
        },
        **attributes(e, _STEPS),
        "files": files,
    }


_CURVES = (
    "time_s reference_depth_m=reference depth_m speed_m_s volume_m3 "
    "reference_volume_m3=volume_reference voltage_V"
)


def trajectories(e: Evidence) -> dict[str, dict[str, Any]]:
    """Return every curve of the report: file name -> columns, SI."""
    by_speed, by_depth = e.table2
    found: dict[str, dict[str, Any]] = {
        "figure-12.csv": _run(e.runs[0]),
        **{f"pool-run-{i}.csv": _run(run) for i, run in enumerate(e.runs[1:], start=2)},
    }
    for i, x in enumerate(e.experiments, start=1):
        r = x.record
        found[f"experiment-{i}.csv"] = {
            **attributes(r, "time_s volume_above_neutral_m3=volume depth_seen_m=depth"),
            "depth_by_eq27_m": r.start + _response(r, by_depth)[0],
            "speed_by_eq26_m_s": _response(r, by_speed)[1],
        }
    found["figure-16.csv"] = attributes(e.steps, _CURVES)
    found["figure-17.csv"] = attributes(e.long_step, _CURVES)
    found["figure-psi.csv"] = {
        "volume_change_m3": [dV for dV, _ in e.still_curve],
        "K2_1_m2_s": [fit.K2 for _, fit in e.still_curve],
        "T2_s": [fit.T2 for _, fit in e.still_curve],
    }
    return found


def _response(record: Any, fit: Fit) -> Any:
    return response(record.time, record.volume, K2=fit.K2, T2=fit.T2)


def _run(run: PoolRun) -> dict[str, Any]:
    """Return one run of the pool procedure; step 1 to 4 are (a) to (d), 0 is after them."""
    s = run.solution
    times = [time for time, _, _ in run.phases]
    letters = [step for _, step, _ in run.phases]
    index = np.searchsorted(times, s.time + 1e-9) - 1
    numbers = np.array([" abcd".index(letter) if letter else 0 for letter in letters])
    return {
        "time_s": s.time,
        "step": numbers[index],
        "depth_m": s.depth,
        "depth_seen_m": run.seen_depth,
        **attributes(s, "speed_m_s volume_m3"),
        "volume_seen_m3": run.seen_volume,
        "voltage_V": s.voltage,
    }
