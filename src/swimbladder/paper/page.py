"""The report put together: figures, tables, verdicts, into one page and one JSON object."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from swimbladder import __version__
from swimbladder.paper import tables
from swimbladder.paper.actuation import CLEARANCE, POOL_DEPTH
from swimbladder.paper.errata import ERRATA, SILENT
from swimbladder.paper.evidence import SENSORS, Evidence
from swimbladder.paper.verdict import EquationCheck, Finding, Verdict
from swimbladder.show.plots import paper
from swimbladder.show.report.html import Picture, drawn_inline, render
from swimbladder.sim.pool import Fit

FIGURES = (
    Picture(
        "figure-12", "Figure 12, simulated",
        "The first run, steps (a) to (d): depth, as it is and as the noisy sensor has it, and "
        "volume against time. (b) ends at the surface, (d) on the bottom.",
        lambda e: paper.draw_procedure(e.runs[0]),
    ),
    Picture(
        "figure-13", "Figure 13, simulated",
        "Vertical speed after each change of volume. Marks: centred differences of the simulated "
        "noisy depth. Lines: eq. (26) with the average K and T of our Table 2, row (26), driven by "
        "the piston's sensor.",
        lambda e: paper.draw_speeds(e.experiments, e.table2[0]),
    ),
    Picture(
        "figure-14", "Figure 14, simulated",
        "Depth after each change of volume. Marks: the simulated noisy depth sensor. Lines: eq. "
        "(27) with the average K and T of our Table 2, row (27), driven by the piston's sensor.",
        lambda e: paper.draw_depths(e.experiments, e.table2[1]),
    ),
    Picture(
        "figure-psi", "K2 and T2 as found without psi",
        "Each experiment fitted alone by eq. (27). The smaller the step, the larger both come out.",
        lambda e: paper.draw_neglect(
            e.experiments, e.depth_fits, e.still_curve, Fit(e.motion.K2, e.motion.T2, 0.0)
        ),
    ),
    Picture(
        "figure-16", "Figure 16, simulated",
        "Depth steps of different amplitude and direction; the set-points are ours.",
        lambda e: paper.draw_steps(e.steps),
    ),
    Picture(
        "figure-17", "Figure 17, simulated",
        "A longer step, (a) whole and (b) around the target; the set-points are ours.",
        lambda e: paper.draw_long_step(e.long_step),
    ),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Every comparison of the report."""

    published: Sequence[Finding]
    independent: Sequence[Finding]
    equations: Sequence[EquationCheck]

    @property
    def failures(self) -> tuple[str, ...]:
        """What failed, a line each."""
        found = [f for f in (*self.published, *self.independent) if f.verdict is Verdict.FAILS]
        return (
            *(f"{f.where}, {f.what}: {f.paper} against {f.ours}" for f in found),
            *(f"eq. ({c.number}): {c.result}" for c in self.equations if not c.passed),
        )


def draw(e: Evidence, advance: Callable[[float], None]) -> dict[str, Figure]:
    """Return every figure by its name; `advance` is called for each."""
    figures = {}
    for picture in FIGURES:
        figures[picture.name] = picture.draw(e)
        advance(1.0)
    return figures


def page(e: Evidence, judged: Judged, figures: dict[str, Figure], files: Sequence[str]) -> str:
    """Return the report as HTML."""
    verdicts = Counter(f.verdict for f in judged.published)
    lasts = [_last_minute(run) for run in e.runs]
    largest, smallest = e.still[-1][1].K2, e.still[0][1].K2
    supply = e.vehicle.supply
    assert supply is not None
    return render(
        "paper.html.j2",
        {
            "version": __version__,
            "seed": e.seed,
            "count": {
                "total": len(judged.published),
                "agrees": verdicts[Verdict.AGREES],
                "explained": verdicts[Verdict.EXPLAINED],
                "fails": verdicts[Verdict.FAILS],
            },
            "published": judged.published,
            "independent": judged.independent,
            "failed_independent": sum(f.verdict is not Verdict.AGREES for f in judged.independent),
            "equations": judged.equations,
            "failed_equations": sum(not c.passed for c in judged.equations),
            "table1": tables.table1(e),
            "table2": tables.table2(e),
            "table3": tables.table3(e),
            "experiments": tables.experiments(e),
            "neglect_table": tables.neglect(e),
            "pulses": tables.pulses(e),
            "steps": tables.steps(e),
            "pairs": tables.pairs(e),
            "pool": {
                "depth": f"{POOL_DEPTH:g}",
                "clearance": f"{CLEARANCE:g}",
                "noise": f"{SENSORS.depth_noise * 1e3:g}",
                "quantum": f"{SENSORS.depth_quantum * 1e3:g}",
                "jitter": f"{min(lasts) * 1e6:.0f} to {max(lasts) * 1e6:.0f}",
            },
            "neglect": {
                "neutral": f"{e.vehicle.hull.psi * 3e6:.0f}",
                "smallest": f"{smallest:.0f}",
                "largest": f"{largest:.0f}",
                "truth": f"{e.motion.K2:.0f}",
                "rms": f"{e.still_joint.rms * 1e3:.1f}",
            },
            "timed": {
                "before": f"{e.actuator.K1 * supply.voltage * e.actuator.T1 * 1e3:.2f}",
                "difference": f"{_pulse_difference(e):.0e}",
            },
            "figures": {p.name: {**p._asdict(), "svg": _svg(figures[p.name], p)} for p in FIGURES},
            "errata": ERRATA,
            "silent": SILENT,
            "files": files,
        },
    )


def _svg(figure: Figure, picture: Picture) -> Markup:
    label = f"{picture.title}. {picture.caption}"
    return drawn_inline(figure, name=picture.name, label=label)


def _last_minute(run: Any) -> float:
    """Return the standard deviation of the true volume in the minute before step (b) [m3]."""
    s, released = run.solution, run.experiments[0].released
    part = (s.time > released - 60.0) & (s.time < released - run.parameters.halt)
    return float(np.std(s.volume[part]))


def _pulse_difference(e: Evidence) -> float:
    """Return the largest difference between formula and simulation over dx."""
    return max(
        abs((ours - formula) / p.dx)
        for p in e.pulses
        for ours, formula in zip(p.simulated, p.formula, strict=True)
    )


def answer(e: Evidence, judged: Judged, files: Sequence[str]) -> dict[str, Any]:
    """Return the report's numbers for a machine, SI."""
    by_speed, by_depth = e.table2
    verdicts = Counter(f.verdict for f in judged.published)
    return {
        "paper": "10.3390/act12100380",
        "version": __version__,
        "seed": e.seed,
        "vehicle": e.vehicle.name,
        "passed": not judged.failures,
        "failures": judged.failures,
        "verdicts": {v.name: verdicts[v] for v in Verdict},
        "published": judged.published,
        "independent": judged.independent,
        "equations": [
            {"number": c.number, "checked": c.checked, "value": c.value, "limit": c.limit,
             "passed": c.passed, "note": c.note}
            for c in judged.equations
        ],
        "table2": {"row_26": by_speed, "row_27": by_depth},
        "experiments": [
            {"step": x.step, "volume_asked_m3": x.dV, "volume_achieved_m3": x.achieved,
             "neutral_error_m3": x.neutral_error, "pulse_V": x.pulse, "pulse_s": x.pulse_time,
             "released_s": x.released, "ended_s": x.ended, "eq_26": w, "eq_27": z, "eq_32": k}
            for x, w, z, k in zip(
                e.experiments, e.speed_fits, e.depth_fits, e.known_fits, strict=True
            )
        ],
        "without_noise": {
            "experiments": [{"volume_m3": dV, "eq_27": fit} for dV, fit in e.still],
            "joint": e.still_joint, "joint_with_psi": e.still_known,
            "average_26": e.still_average[0],
        },
        "timed_voltages": e.pulses,
        "figure_16": e.step_rows,
        "figure_17": e.long_metrics,
        "overshoot_pairs": e.pairs,
        "files": files,
    }  # fmt: skip
