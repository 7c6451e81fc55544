"""A design as files: the plan to follow, a page to print, and pictures.

In plain words: what to do, in which order, and its predicted errors.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from swimbladder.design.experiments import Design
from swimbladder.design.experiments.conditions import Release
from swimbladder.design.experiments.result import percent
from swimbladder.design.plan import Move, plan_file
from swimbladder.show.plots.design import draw_design, draw_plan
from swimbladder.show.report.html import REPORT, PageFigure, page_figure, render
from swimbladder.show.report.text import row


def volume(value: float, area: float | None) -> str:
    """Return a volume [m3] as text, with the travel of the piston where there is one."""
    text = f"{1e6 * value:+.3g} cm3" if value else "0 cm3"
    return text if area is None or not value else f"{text} ({1e3 * value / area:+.2g} mm)"


def moves(release: Release, area: float | None) -> str:
    """Return the changes of volume of a release, short."""
    return ", ".join(_move(move, area) for move in release.moves)


def _move(move: Move, area: float | None) -> str:
    what = volume(move.volume, area)
    if move.depth is None:
        return what
    return f"at {move.depth:g} m going {move.going} {what}"


def rows(design: Design) -> list[tuple[str, ...]]:
    """Return start, changes of volume, duration and errors after it of each experiment."""
    w, found = design.chosen, []
    for release, flight, errors in zip(w.releases, w.flights, w.after, strict=True):
        what = f"{release.start:g} m", moves(release, design.vehicle.piston_area)
        after = (percent(errors[name]) for name in w.prediction.names)
        found.append((*what, f"{flight.duration:.0f} s", *after))
    return found


def instruction(design: Design, k: int) -> str:
    """Return what to do in experiment k, counted from 0, in sentences."""
    w, s, area = design.chosen, design.conditions.setting, design.vehicle.piston_area
    release, flight = w.releases[k], w.flights[k]
    said = [f"Come to rest at {release.start:g} m."]
    for move in release.moves:
        to = f"volume to {volume(move.volume, area)} against the one at rest."
        if move.depth is not None:
            where = f"When it passes {move.depth:g} m on its way {move.going}"
        said.append(to.capitalize() if move.depth is None else f"{where}: {to}")
    passed = {"shallowest": s.shallowest, "deepest": s.deepest}.get(flight.ended)
    end = "to the end" if passed is None else f"until it passes {passed:g} m"
    said.append(f"Record {end}, {s.longest:g} s at most; about {flight.duration:.0f} s.")
    return " ".join(said)


def headlines(design: Design) -> list[str]:
    """Return how long it takes, and the predicted standard errors."""
    w = design.chosen
    count = len(w.releases)
    prediction = w.prediction
    errors = ", ".join(f"{name} {percent(share)}" for name, share in prediction.share.items())
    return [
        f"{count} experiment{'s' if count > 1 else ''} in {w.time / 60.0:.0f} min, "
        f"{design.conditions.setting.settling / 60.0:.1f} min of settling before each included.",
        f"Predicted standard errors: {errors}.",
    ]


def comparison(design: Design) -> list[str]:
    """Return how the set compares with the other, none where there is no other."""
    if design.against is None:
        return []
    other = design.against
    errors = ", ".join(
        f"{name} {percent(share)} ({design.gains[name]:.1f} times as much)"
        for name, share in other.prediction.share.items()
    )
    said = [f"Against {design.rival}, in {other.time / 60.0:.0f} min: {errors}."]
    if other.psi is not None and design.chosen.psi is not None:
        from swimbladder.estimation.motion.diagnose import describe

        shift = f"psi left out would shift {describe(other.psi.refit)}"
        there, here = (f"at {1e3 * w.psi.rms:.1f} mm" for w in (other, design.chosen) if w.psi)
        said.append(f"There, {shift}, {there} rms; here {here}.")
    return said


def design_files(design: Design, answer: Mapping[str, Any], command: str = "") -> dict[str, object]:
    """Return the contents of the files: plan, page, numbers and pictures.

    command: how the page says that it was made; answer: design.json.
    """
    pictures = {"plan": draw_plan(design), "design": draw_design(design)}
    files: dict[str, object] = {
        "plan.toml": plan_file(design.plan(), head=_head(design)),
        **{f"{name}.png": made for name, made in pictures.items()},
        "design.json": answer,
    }
    figures = {n: page_figure(n, made, f"experiments-{n}") for n, made in pictures.items()}
    return {REPORT: _page(design, figures, list(files), command), **files}


def _head(design: Design) -> str:
    lines = ["Experiments by swimbladder design-experiment. Volumes count from the one at rest."]
    lines += headlines(design)
    for k in range(len(design.chosen.releases)):
        lines.append(f"{k + 1}. {instruction(design, k)}")
    return "\n".join(lines)


def _page(
    design: Design, figures: Mapping[str, PageFigure], files: Sequence[str], command: str
) -> str:
    w = design.chosen
    names = w.prediction.names
    experiments = [
        {"number": number, "start": start, "moves": change, "seconds": takes, "after": after}
        for number, (start, change, takes, *after) in enumerate(rows(design), start=1)
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
        "figures": figures,
        "files": files,
        "command": command,
        "listed": sorted(design.findings, key=lambda f: f.severity == "note"),
    }
    return render("plan.html.j2", values)
