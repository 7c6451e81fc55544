"""Laws compared, as files: a page that opens from disk, a table, pictures, and every tuned law."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from swimbladder.design.law_comparison import LawComparison
from swimbladder.io.files import make_folder, publish, write_atomically
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.law_comparison import draw_pareto, draw_steps
from swimbladder.show.plots.style import save, svg_text
from swimbladder.show.report.html import inline_svg, render
from swimbladder.show.report.law_comparison_text import (
    HEADINGS,
    HOLD_HEADINGS,
    STEP_HEADINGS,
    holds,
    notes,
    steps,
    summary,
    table_csv,
)

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
