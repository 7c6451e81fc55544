"""A tuning as files: the vehicle with its controller, a page, numbers and pictures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from swimbladder.control.records import leaves
from swimbladder.design.tuning import Tuning
from swimbladder.design.tuning.margins import WANTED
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.show.plots.tune import draw_sensitivity, draw_tuning
from swimbladder.show.report.html import REPORT, TEXTS, PageFigure, page_figure, render
from swimbladder.units import shown_unit, unit_factor


def tuning_files(found: Tuning, answer: Mapping[str, Any], command: str = "") -> dict[str, object]:
    """Return the contents of vehicle.toml, report.html, tune.json and pictures.

    Gains that do not keep what they have to are in unproven.toml instead. command: how the page
    says that it was made; answer: tune.json. A law without margins has no sensitivity.png.
    """
    pictures = {"tune": draw_tuning(found)}
    if found.margins is not None:
        pictures["sensitivity"] = draw_sensitivity(found)
    head = f"Tuned by swimbladder tune, law {found.law.name}, goal {found.goal}."
    text = vehicle_file(found.result_vehicle, head="\n".join([head, *found.sentences]))
    files: dict[str, object] = {"vehicle.toml" if found.proven else "unproven.toml": text}
    files |= {"tune.json": answer, **{f"{name}.png": made for name, made in pictures.items()}}
    figures = {name: page_figure(name, made) for name, made in pictures.items()}
    return {REPORT: _page(found, figures, list(files), command), **files}


def _page(
    found: Tuning, figures: Mapping[str, PageFigure], files: Sequence[str], command: str
) -> str:
    values = {
        "found": found,
        "figures": figures,
        "files": files,
        "command": command,
        "trials": _trials(found),
        "margins": _margins(found),
        "rests": bool(found.margins and (found.knobs.dead or found.knobs.pause)),
        "depths": ", ".join(f"{z:g}" for z in found.judged),
        "parameters": [
            (name, f"{float(value) * unit_factor(unit, shown_unit(unit)):.5g}", shown_unit(unit))
            for name, value in leaves(found.parameters).items()
            for unit in (found.law.units[name],)
        ],
    }
    return render("tune.html.j2", values)


def _trials(found: Tuning) -> list[tuple[str, str, str]]:
    rows = TEXTS["tune"]["floats" if found.band else "volume"]
    table = []
    for label, form, factor, name in rows:
        values = [float(getattr(t, name)) for t in (found.nominal, found.region)]
        if not (name in ("energy", "power") and math.isnan(values[0])):
            cells = [_cell(form, factor * value) for value in values]
            table.append((label.format(band=found.band), cells[0], cells[1]))
    return table


def _cell(form: str, value: float) -> str:
    if not math.isfinite(value):
        return "not in the time watched"
    return form.format(round(value) if ":d" in form else value)


def _margins(found: Tuning) -> list[tuple[str, str, str]]:
    m, w = found.margins, WANTED
    if m is None:
        return []
    degrees = math.degrees
    return [
        ("gain may grow by", _factor(m.gain_up), _factor(w.gain_up)),
        ("gain may fall to", _factor(m.gain_down), _factor(w.gain_down)),
        ("phase margin", f"{degrees(m.phase):.0f} degrees", f"{degrees(w.phase):.0f} degrees"),
        ("more delay", f"{m.delay:.2g} s", "-"),
        ("peak sensitivity", f"{m.peak_sensitivity:.2f}", f"{w.peak_sensitivity:.2f}"),
        ("balanced disk margin", f"{m.disk:.2f}", f"{w.disk:.2f}"),
    ]


def _factor(gain: float) -> str:
    if gain == 0.0 or math.isinf(gain):
        return "any"
    return f"{gain:.2g} ({20.0 * math.log10(gain):+.1f} dB)"
