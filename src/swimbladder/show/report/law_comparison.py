"""Laws compared, as files: a page that opens from disk, a table, pictures, and every tuned law.

A comparison as rows of text, for the terminal, the page and the CSV file.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path

from swimbladder.design.law_comparison import LawComparison
from swimbladder.design.law_comparison.contenders import BAND
from swimbladder.design.law_comparison.run import RESULT, Row
from swimbladder.io.answers import as_json
from swimbladder.io.files import make_folder, publish, write_atomically
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.law_comparison import draw_pareto, draw_steps
from swimbladder.show.plots.style import save, svg_text
from swimbladder.show.report.html import inline_svg, render

SOON = ("law", "settles [s]", "of bound", "95 % [s]", "over [%]", "deep [%]", "lost")
STILL = ("law", "hold", "swell", "deep", "drift", "L/h", "starts", "turns", "J/h")
HEADINGS = (*SOON, *STILL[1:])
STEP_HEADINGS = (
    "law", "settled", "median [s]", "95 % [s]", "of the bound", "overshoot [%]", "95 % [%]",
    "L/h", "lost",
)  # fmt: skip
HOLD_HEADINGS = (
    "law", "rms [mm]", "farthest [cm]", "L/h", "starts/h", "turns/h", "J/h", "lost",
)  # fmt: skip
_NOTES = (
    "*: no other row is nowhere worse and somewhere better in settling, hold, drift, L/h, and "
    "starts with turns.",
    "settles: median of the runs, step of 1.5 m, for good within 2 %; 95 %: of the runs with drawn "
    "vehicles and a low battery. over, deep: overshoot in 95 % of the runs, worst shallow step and "
    "step at the greatest depth. lost: runs of the worst scenario that left the water or the rated "
    "depths, or went below any sea.",
    "hold, swell, deep, drift: depth error, mm rms. L/h, starts, turns, J/h: an hour of holding in "
    "the noise of the sensor. A motor that never rests starts seldom and turns often.",
)
_FLOAT_NOTES = (
    _NOTES[0],
    f"settles: median of the runs, step of 100 m, for good within {BAND:g} m; 95 %: of the runs "
    "with drawn vehicles. over, deep: overshoot in 95 % of the runs, worst shallow step and step "
    "at the greatest depth. lost: runs of the worst scenario that left the water or the rated "
    "depths, or went below any sea.",
    "hold, swell, deep, drift: depth error, mm rms. L/h, J/h: an hour of holding in the noise of "
    "the sensor; starts: runs of pump and valve.",
)


def notes(comparison: LawComparison) -> tuple[str, ...]:
    """Return what the columns of HEADINGS mean, and why the energy is not known."""
    said = _FLOAT_NOTES if comparison.vehicle.command == "volume change" else _NOTES
    if comparison.no_energy is None:
        return said
    return (*said, f"J/h is unknown: {comparison.no_energy}.")


def summary(comparison: LawComparison) -> list[tuple[str, ...]]:
    """Return a row of HEADINGS for each contender."""
    bound = comparison.bounds.get("step-down", math.nan)
    return [
        (
            row.who.name + (" *" if unbeaten else ""),
            _number(row.cost("step-down", "settle_median"), 1.0, "{:.1f}"),
            _number(row.cost("step-down", "settle_median"), 1.0 / bound, "{:.2f}"),
            _number(row.cost("step-uncertain", "settle_95"), 1.0, "{:.1f}"),
            _percent(over), _percent(deep), _share(lost),
            *(
                _number(row.cost(name, "rms"), 1e3, "{:.1f}")
                for name in ("hold", "hold-swell", "hold-deep", "hold-drift")
            ),
            *_moved(row, "hold", comparison),
        )
        for row, unbeaten, over, deep, lost in zip(
            comparison.rows, comparison.unbeaten, comparison.worst_overshoot("shallow"),
            comparison.worst_overshoot("deep"), comparison.lost, strict=True,
        )
    ]  # fmt: skip


def steps(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of STEP_HEADINGS for each contender on one step."""
    bound = comparison.bounds.get(scenario, math.nan)
    return [
        (
            row.who.name, f"{100.0 * r.settled:.0f} %",
            _number(r.settle_median, 1.0, "{:.1f}"), _number(r.settle_95, 1.0, "{:.1f}"),
            _number(r.settle_median, 1.0 / bound, "{:.2f}"),
            _percent(r.overshoot_median), _percent(r.overshoot_95),
            _number(r.volume_rate, 3.6e6, "{:.3g}"), _share(r.lost),
        )
        for row in comparison.rows
        for r in (row.results[scenario],)
    ]  # fmt: skip


def holds(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of HOLD_HEADINGS for each contender on one hold."""
    return [
        (
            row.who.name, _number(r.rms, 1e3, "{:.1f}"), _number(r.farthest, 100.0, "{:.1f}"),
            *_moved(row, scenario, comparison), _share(r.lost),
        )
        for row in comparison.rows
        for r in (row.results[scenario],)
    ]  # fmt: skip


def _moved(row: Row, scenario: str, comparison: LawComparison) -> tuple[str, ...]:
    """Return L/h, starts/h, turns/h and J/h."""
    return (
        _number(row.cost(scenario, "volume_rate"), 3.6e6, "{:.3g}"),
        _number(row.cost(scenario, "starts"), 3600.0, "{:.0f}"),
        _number(row.cost(scenario, "turns"), 3600.0, "{:.0f}"),
        "unknown"
        if comparison.no_energy
        else _number(row.cost(scenario, "power"), 3600.0, "{:.3g}"),
    )


def _share(x: float) -> str:
    return f"{100.0 * x:.0f} %" if x > 0.0 else ""


def _percent(x: float) -> str:
    """Return an overshoot; of one beyond ten times the step only that it is."""
    return "> 999" if x > 9.99 else _number(x, 100.0, "{:.1f}")


def _number(x: float, factor: float, form: str) -> str:
    return form.format(x * factor) if math.isfinite(x * factor) else "-"


def table_csv(comparison: LawComparison) -> str:
    """Return every result of every law on every scenario as CSV, in SI units."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    mentioned = False
    for row in comparison.rows:
        for name, r in row.results.items():
            numbers = as_json(r, RESULT)
            if not mentioned:
                writer.writerow(["law", "tuning", "scenario", *numbers])
                mentioned = True
            known = ["nan" if x is None else x for x in numbers.values()]
            writer.writerow([row.who.law.name, row.who.tuning, name, *known])
    return text.getvalue()


_FOLDER = "vehicles"


def write_comparison(
    comparison: LawComparison, out: Path, *, answer: str, command: str
) -> list[Path]:
    """Write page, table, numbers, pictures and a vehicle file for each law into `out`.

    answer: the text of laws.json; command: how the page says that it was made. Returns the paths;
    raises InputError where the folder cannot be written.
    """
    figures = {"pareto": draw_pareto(comparison), "steps": draw_steps(comparison)}
    vehicles = [f"{_FOLDER}/{row.who.slug}.toml" for row in comparison.rows]
    names = ["laws.html", "laws.csv", "laws.json", "pareto.png", "steps.png", *vehicles]

    def write(folder: Path) -> None:
        for name, figure in figures.items():
            save(figure, folder / f"{name}.png")
        make_folder(folder / _FOLDER)
        for row, name in zip(comparison.rows, vehicles, strict=True):
            flown = comparison.vehicle.model_copy(update={"controller": row.who.controller()})
            head = f"As flown by swimbladder compare-laws: {row.who.name}."
            write_atomically(folder / name, vehicle_file(flown, head=head))
        write_atomically(folder / "laws.csv", table_csv(comparison))
        write_atomically(folder / "laws.json", answer + "\n")
        images = {
            "pareto": inline_svg(
                svg_text(figures["pareto"]), name="pareto",
                label="Settling and holding of every law against the volume it moves.",
            ),
            "steps": inline_svg(
                svg_text(figures["steps"]), name="steps", label="Depth of every law after a step."
            ),
        }  # fmt: skip
        write_atomically(folder / "laws.html", _page(comparison, images, command))

    publish(out, write)
    return [out / name for name in names]


def _page(comparison: LawComparison, images: Mapping[str, str], command: str) -> str:
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
    values = {
        "comparison": comparison,
        "headings": HEADINGS,
        "rows": summary(comparison),
        "notes": notes(comparison),
        "flown": flown,
        "images": images,
        "command": command,
    }
    return render("law_comparison.html.j2", values)
