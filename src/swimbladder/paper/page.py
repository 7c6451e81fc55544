"""The report put together: figures, tables, verdicts, into one page, one JSON object and curves.

The tables of the report, as texts; every number comes from the evidence.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swimbladder import __version__
from swimbladder.control.registry import bind
from swimbladder.io.answers import as_json, attributes
from swimbladder.io.progress import Advance
from swimbladder.paper.evidence import CLEARANCE, POOL_DEPTH, SENSORS, Evidence
from swimbladder.paper.verdict import EquationCheck, Finding, Verdict, texts
from swimbladder.physics.actuator import reduced, unified
from swimbladder.show import paper
from swimbladder.show.html import page_figure, render
from swimbladder.show.picture import Picture
from swimbladder.sim.closed_loop import StepMetrics
from swimbladder.sim.pool import Fit, PoolRun, average, response

Rows = Sequence[Sequence[str]]


class Table(NamedTuple):
    """A table: caption, heads, rows of texts."""

    caption: str
    head: Sequence[str]
    rows: Rows


def tables(e: Evidence) -> dict[str, Table]:
    """Return the tables by name, with what page.toml has to stand over them."""
    rows = (table1, table2, table3, experiments, neglect, pulses, steps, pairs)
    return {
        made.__name__: Table(about["caption"], about["head"], made(e))
        for made in rows
        for about in (_PAGE["tables"][made.__name__],)
    }


def table1(e: Evidence) -> Rows:
    """Return Table 1 with the constants of both examples, and the ratios of the prototype."""
    examples = [unified(v.engine, v.water) for v in (e.hydraulic, e.screw)]
    ratios = reduced(e.vehicle.engine, e.vehicle.water)
    b = [v.water.specific_weight for v in (e.hydraulic, e.screw, e.vehicle)]
    rows = [("k_b", "buoyancy per volume", *(f"{x:.6g} N/m3" for x in b))]
    for symbol, meaning, field, unit, known in reversed(_PAGE["tables"]["table1"]["constants"]):
        values = (f"{getattr(u, field):.4g} {unit}" for u in examples)
        rows.insert(0, (symbol, meaning, *values, known.format(p=ratios)))
    return rows


def experiments(e: Evidence) -> Rows:
    """Return the eight experiments and their fits."""
    rows = []
    fits = zip(e.speed_fits, e.depth_fits, e.known_fits, strict=True)
    for x, (by_speed, by_depth, known) in zip(e.experiments, fits, strict=True):
        done = f"{_signed(x.achieved * 1e6, 4)} cm3", f"{_signed(x.neutral_error * 1e6, 2)} cm3"
        pulse = f"{x.pulse:+.2f} V, {x.pulse_time:.1f} s"
        row = (f"({x.step}) {_signed(x.dV * 1e6, 4)} cm3", pulse, *done, *_fit(by_speed))
        rows.append((*row, *_fit(by_depth), f"{by_depth.rms * 1e3:.1f} mm", *_fit(known)))
    return rows


def table2(e: Evidence) -> Rows:
    """Return Table 2: paper, ours, ours without noise, and what was simulated."""
    by_speed, by_depth = e.table2
    known = average(e.known_fits)
    return [
        ("(26), V to dz/dt", "-7935.54", "36.3", *_k(by_speed), *_k(e.still_average[0])),
        ("(27), V to z", "-7634.95", "35.7", *_k(by_depth), *_k(e.still_average[1])),
        ("(32), V to z, psi known", "", "", *_k(known), *_k(e.still_known)),
        ("the simulated vehicle", "", "", *_k(Fit(e.motion.K2, e.motion.T2, 0.0)), "", ""),
    ]


def neglect(e: Evidence) -> Rows:
    """Return K2 and T2 without noise against the size of the step."""
    fits = {f"{dV * 1e6:g} cm3": fit for dV, fit in e.still if dV > 0.0} | {
        "average of the eight": e.still_average[1],
        "all eight jointly": e.still_joint,
        "all eight jointly, psi known": e.still_known,
    }
    return [
        (name, *_fit(fit), f"{fit.K2 / fit.T2:.1f}", f"{fit.rms * 1e3:.2f} mm")
        for name, fit in fits.items()
    ]


def pulses(e: Evidence) -> Rows:
    """Return the timed voltages: asked for, when the voltage ends, once the motor stands."""
    rows = []
    for p in e.pulses:
        row = [f"{_signed(p.dx * 1e3, 3)} mm", f"{p.depth:g} m"]
        row += [f"{p.voltage:+.2f} V, {p.time:.1f} s"]
        for x in p.simulated:
            row += [f"{_signed(x * 1e3, 4)} mm", f"{_signed(100 * (x / p.dx - 1), 2)} %"]
        rows.append(row)
    return rows


def table3(e: Evidence) -> Rows:
    """Return Table 3 as printed and in SI."""
    assert e.vehicle.controller is not None
    law, gains = bind(e.vehicle.controller)
    printed = (
        ("C_V, k_p", "k_pV", "1002 V/dm3"),
        ("C_z, k_p", "k_pz", "-0.1043 dm3/m"),
        ("C_z, k_i", "k_iz", "-7.486e-4 dm3/s/m"),
        ("C_z, k_d", "k_dz", "-2.341 dm3 s/m"),
    )
    return [(*row, f"{getattr(gains, row[1]):.6g} {law.units[row[1]]}") for row in printed]


def steps(e: Evidence) -> Rows:
    """Return the steps of Fig. 16 in numbers."""
    rows = []
    for s in e.step_rows:
        way = "down" if s.target > s.start else "up"
        least, most = (_signed(V * 1e6, 3) for V in (s.lowest_volume, s.highest_volume))
        volume = f"{least} to {most} cm3"
        rows.append((f"{s.start:g} to {s.target:g} m", way, *_metrics(s.metrics), volume))
    return rows


def pairs(e: Evidence) -> Rows:
    """Return the overshoot up and down between the same depths."""
    rows = []
    for p in e.pairs:
        down, up = p.down.overshoot_pct, p.up.overshoot_pct
        more = f"{_signed(up - down, 2)} points"
        rows.append((f"{p.shallow:g} and {p.deep:g} m", f"{down:.2f} %", f"{up:.2f} %", more))
    return rows


def _fit(fit: Fit) -> tuple[str, str]:
    return f"{fit.K2:.0f}", f"{fit.T2:.1f}"


def _k(fit: Fit) -> tuple[str, str]:
    return f"{-fit.K2:.2f}", f"{fit.T2:.1f}"


def _metrics(m: StepMetrics) -> tuple[str, ...]:
    times = ("never" if t is None else f"{t:.1f} s" for t in (m.rise90_s, m.settle2_s))
    return f"{m.overshoot_pct:.1f} %", *times


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}g}"


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
_PAGE = texts("page")
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
        "figures": {
            name: page_figure(name, f, said=_PAGE["figures"]) for name, f in figures.items()
        },
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
