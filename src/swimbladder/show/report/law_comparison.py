"""Laws compared, as files: a page that opens from disk, a table, pictures, and every tuned law.

Rows of text are the same on the terminal, on the page and in the CSV file.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from swimbladder.design.law_comparison import LawComparison
from swimbladder.design.law_comparison.contenders import BAND
from swimbladder.design.law_comparison.run import RESULT, Row
from swimbladder.io.answers import as_json
from swimbladder.io.tables import rows_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.law_comparison import draw_pareto, draw_steps
from swimbladder.show.report.html import REPORT, TEXTS, PageFigure, page_figure, render

SOON = ("law", "settles [s]", "of bound", "95 % [s]", "over [%]", "deep [%]", "lost")
STILL = ("law", "hold", "swell", "deep", "drift", "L/h", "starts", "turns", "J/h")
HEADINGS = (*SOON, *STILL[1:])
_SETTLED = ("settled", "median [s]", "95 % [s]", "of the bound")
STEP_HEADINGS = ("law", *_SETTLED, "overshoot [%]", "95 % [%]", "L/h", "lost")
HOLD_HEADINGS = ("law", "rms [mm]", "farthest [cm]", "L/h", "starts/h", "turns/h", "J/h", "lost")


def notes(comparison: LawComparison) -> tuple[str, ...]:
    """Return what the columns of HEADINGS mean, and why the energy is not known."""
    floats = comparison.vehicle.command == "volume change"
    said = TEXTS["laws"]["floats" if floats else "moving"]
    unknown = comparison.no_energy
    return (
        TEXTS["laws"]["best"],
        *(text.format(band=BAND) for text in said),
        *([] if unknown is None else [f"J/h is unknown: {unknown}."]),
    )


def summary(comparison: LawComparison) -> list[tuple[str, ...]]:
    """Return a row of HEADINGS for each contender."""
    bound, rows = comparison.bounds.get("step-down", math.nan), []
    worst = (comparison.worst_overshoot(where) for where in ("shallow", "deep"))
    flown = zip(comparison.rows, comparison.unbeaten, *worst, comparison.lost, strict=True)
    for row, unbeaten, over, deep, lost in flown:
        median = row.cost("step-down", "settle_median")
        settles = _number(median), _number(median, 1.0 / bound, "{:.2f}")
        uncertain = _number(row.cost("step-uncertain", "settle_95"))
        soon = (*settles, uncertain, _percent(over), _percent(deep), _share(lost))
        holds = ("hold", "hold-swell", "hold-deep", "hold-drift")
        still = [_number(row.cost(name, "rms"), 1e3) for name in holds]
        still += _moved(row, "hold", comparison)
        rows.append((row.who.name + (" *" if unbeaten else ""), *soon, *still))
    return rows


def steps(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of STEP_HEADINGS for each contender on one step."""
    bound = comparison.bounds.get(scenario, math.nan)
    rows: list[tuple[str, ...]] = []
    for row in comparison.rows:
        r = row.results[scenario]
        settles = _number(r.settle_median), _number(r.settle_95)
        relative = _number(r.settle_median, 1.0 / bound, "{:.2f}")
        over = _percent(r.overshoot_median), _percent(r.overshoot_95)
        moved = _number(r.rate, 3.6e6, "{:.3g}")
        settled = f"{100.0 * r.settled:.0f} %"
        rows.append((row.who.name, settled, *settles, relative, *over, moved, _share(r.lost)))
    return rows


def holds(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of HOLD_HEADINGS for each contender on one hold."""
    rows: list[tuple[str, ...]] = []
    for row in comparison.rows:
        r, moved = row.results[scenario], _moved(row, scenario, comparison)
        off = _number(r.rms, 1e3), _number(r.farthest, 100.0)
        rows.append((row.who.name, *off, *moved, _share(r.lost)))
    return rows


def _moved(row: Row, scenario: str, comparison: LawComparison) -> tuple[str, ...]:
    """Return L/h, starts/h, turns/h and J/h."""
    energy = _number(row.cost(scenario, "power"), 3600.0, "{:.3g}")
    return (
        _number(row.cost(scenario, "rate"), 3.6e6, "{:.3g}"),
        _number(row.cost(scenario, "starts"), 3600.0, "{:.0f}"),
        _number(row.cost(scenario, "turns"), 3600.0, "{:.0f}"),
        "unknown" if comparison.no_energy else energy,
    )


def _share(x: float) -> str:
    return f"{100.0 * x:.0f} %" if x > 0.0 else ""


def _percent(x: float) -> str:
    """Return an overshoot; of one beyond ten times the step only that it is."""
    return "> 999" if x > 9.99 else _number(x, 100.0)


def _number(x: float, factor: float = 1.0, form: str = "{:.1f}") -> str:
    return form.format(x * factor) if math.isfinite(x * factor) else "-"


def table_csv(comparison: LawComparison) -> str:
    """Return every result of every law on every scenario as CSV, in SI units."""
    rows = [
        {"law": row.who.law.name, "tuning": row.who.tuning, "scenario": name} | as_json(r, RESULT)
        for row in comparison.rows
        for name, r in row.results.items()
    ]
    return rows_csv(rows[0], (row.values() for row in rows))


def comparison_files(
    comparison: LawComparison, answer: Mapping[str, Any], command: str = ""
) -> dict[str, object]:
    """Return the contents of page, table, numbers, pictures and a vehicle file for each law.

    command: how the page says that it was made; answer: laws.json.
    """
    pictures = {"pareto": draw_pareto(comparison), "steps": draw_steps(comparison)}
    files: dict[str, object] = {"laws.csv": table_csv(comparison), "laws.json": answer}
    files |= {f"{name}.png": made for name, made in pictures.items()}
    for row in comparison.rows:
        flown = comparison.vehicle.model_copy(update={"controller": row.who.controller()})
        head = f"As flown by swimbladder compare-laws: {row.who.name}."
        files[f"vehicles/{row.who.slug}.toml"] = vehicle_file(flown, head=head)
    figures = {name: page_figure(name, made) for name, made in pictures.items()}
    return {REPORT: _page(comparison, figures, list(files), command), **files}


def _page(
    comparison: LawComparison,
    figures: Mapping[str, PageFigure],
    files: Sequence[str],
    command: str,
) -> str:
    flown = [
        {
            "words": p.scenario.words,
            "name": p.scenario.name,
            "where": f"{p.start:.4g} to {p.target:.4g} m" if p.is_step else f"at {p.target:.4g} m",
            "bound": comparison.bounds.get(p.scenario.name),
            "no_bound": comparison.no_bound.get(p.scenario.name),
            "headings": STEP_HEADINGS if p.is_step else HOLD_HEADINGS,
            "rows": (steps if p.is_step else holds)(comparison, p.scenario.name),
        }
        for p in comparison.placed
    ]
    table = {"headings": HEADINGS, "rows": summary(comparison), "notes": notes(comparison)}
    values = {"comparison": comparison, "flown": flown, "figures": figures}
    values |= {"files": files, "command": command}
    return render("law_comparison.html.j2", table | values)
