"""A design as files: the plan to follow, a page to print, and pictures."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

from swimbladder.design.experiments import Design, plan_file
from swimbladder.design.experiments.findings import percent
from swimbladder.io.files import publish, write_atomically
from swimbladder.show.plots.design import draw_design, draw_plan
from swimbladder.show.plots.style import save
from swimbladder.show.report.design_text import comparison, headlines, instruction, moves
from swimbladder.show.report.html import render
from swimbladder.show.report.text import row


def write_design(
    design: Design, out: Path, *, answer: str, command: str,
    advance: Callable[[float], None] = lambda _: None,
) -> list[Path]:  # fmt: skip
    """Write plan, page, numbers and pictures into the folder `out` and return the paths.

    answer: the text of design.json; command: how the page says that it was made; advance: called
    with the share of the work done. Raises InputError where the folder cannot be written.
    """
    names = ["plan.toml", "plan.html", "plan.png", "design.png", "design.json"]

    def write(folder: Path) -> None:
        images = {}
        for name, draw in (("plan", draw_plan), ("design", draw_design)):
            path = save(draw(design), folder / f"{name}.png")
            images[name] = f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"
            advance(0.4)
        write_atomically(folder / "plan.toml", plan_file(design.plan(), head=_head(design)))
        write_atomically(folder / "design.json", answer + "\n")
        write_atomically(folder / "plan.html", _page(design, images, command))
        advance(0.2)

    publish(out, write)
    return [out / name for name in names]


def _head(design: Design) -> str:
    lines = ["Experiments by swimbladder design-experiment. Volumes count from the one at rest."]
    lines += headlines(design)
    for k in range(len(design.chosen.releases)):
        lines.append(f"{k + 1}. {instruction(design, k)}")
    return "\n".join(lines)


def _page(design: Design, images: dict[str, str], command: str) -> str:
    w = design.chosen
    names = w.prediction.names
    experiments = [
        {
            "number": k + 1,
            "start": f"{release.start:g} m",
            "moves": moves(release, design.piston_area),
            "seconds": f"{flight.duration:.0f} s",
            "after": [percent(after[name]) for name in names],
        }
        for k, (release, flight, after) in enumerate(
            zip(w.releases, w.flights, w.after, strict=True)
        )
    ]
    values = {
        "design": design,
        "headlines": headlines(design),
        "names": names,
        "experiments": experiments,
        "rows": [row(name, e) for name, e in w.prediction.parameters.items()],
        "shares": [percent(w.prediction.share[name]) for name in names],
        "ranges": [f"{percent(w.spread[n][0])} to {percent(w.spread[n][1])}" for n in names],
        "rivals": [f"{design.gains[name]:.1f}" for name in names] if design.gains else [],
        "comparison": comparison(design),
        "images": images,
        "command": command,
        "findings": sorted(design.findings, key=lambda f: f.severity == "note"),
    }
    return render("plan.html.j2", values)
