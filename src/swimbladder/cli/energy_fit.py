"""``swimbladder energy --fit``: a pump's power law and delivery from logged runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.common import json_text, output, progress

if TYPE_CHECKING:
    from swimbladder.cli.casts import CastReading
    from swimbladder.cli.energy import Runs
    from swimbladder.cli.options import Files
    from swimbladder.design.energy import PumpFit
    from swimbladder.vehicle import Vehicle


def fit_runs(path: Path, v: Vehicle | None, reading: CastReading, runs: Runs, to: Files) -> None:
    """Find a pump in a CSV of its runs, print what it is and write the files."""
    from swimbladder.errors import InputError

    table_form, asked = reading.read(), runs.read()
    with progress("reading and fitting"), runs.said_as_typed():
        from swimbladder.design.energy import PumpRuns, fit_pump, fitted_vehicle
        from swimbladder.design.energy.fitted_pump import pump_and_valve
        from swimbladder.design.energy.messages import fit_sentences
        from swimbladder.io.pump_runs import read_pump_runs
        from swimbladder.show.report.energy import fit_json, write_fit

        if v is not None:
            pump_and_valve(v)
        table = read_pump_runs(
            path, columns=table_form["columns"] or {}, where=table_form["where"] or {}
        )
        limit = None if v is None else v.hull.depth_limit
        try:
            found = fit_pump(PumpRuns(**table._asdict()), depth_limit=limit, **asked)
        except InputError as error:
            raise (error if error.field in asked else error.at(file=path)) from None
        fitted = None if v is None else fitted_vehicle(v, found)
        said = fit_sentences(found, fitted)
        answer = {**fit_json(found), "sentences": said, "report": table.report}
        files = write_fit(found, fitted, to.out, answer=json_text(answer))
    to.answer(answer, files, lambda: _print_fit(found, said, table.report))


def _print_fit(found: PumpFit, said: tuple[str, ...], report: Sequence[str]) -> None:
    from rich.table import Table

    from swimbladder.design.energy import efficiency_bands

    for sentence in said:
        output.print(sentence, soft_wrap=True)
    output.print("")
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    for heading in ("parameter", "value", "95 % from", "to", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    shown = {
        "W/Pa": ("mW/dbar", 1e7), "m3/s": ("mL/s", 1e6), "m3/s/Pa": ("mL/s/MPa", 1e12),
        "m3": ("mL", 1e6),
    }  # fmt: skip
    for name, e in found.parameters.items():
        unit, factor = shown.get(e.unit, (e.unit, 1.0))
        numbers = (e.value, *e.ci95)
        table.add_row(name, *(f"{x * factor:.4g}" for x in numbers), unit)
    output.print(table)
    output.print("")
    bands = efficiency_bands(found)
    if bands:
        rows = Table(box=None, pad_edge=False, collapse_padding=True)
        for heading in ("dbar", "runs", "mL a run", "J a run", "efficiency", "by the law"):
            rows.add_column(heading, justify="right")
        for b in bands:
            rows.add_row(
                f"{b.pressure / 1e4:.0f}", f"{b.runs}", f"{1e6 * b.volume:.3g}",
                f"{b.energy:.4g}", f"{b.efficiency:.3f}", f"{b.fitted:.3f}",
            )  # fmt: skip
        output.print(rows)
        output.print("")
    for line in report:
        output.print(line, soft_wrap=True)
