"""``swimbladder energy --fit``: a pump's power law and delivery from logged runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from swimbladder.cli.casts import pairs
from swimbladder.cli.common import emit_json, json_text, output, progress, quantity

if TYPE_CHECKING:
    from swimbladder.design.energy import PumpFit
    from swimbladder.vehicle import Vehicle

__all__ = ["fit_runs"]


def fit_runs(
    path: Path,
    v: Vehicle | None,
    column: list[str],
    where: list[str],
    power_at: str,
    shortest: str,
    out: Path,
    json: bool,
) -> None:
    """Find a pump in a CSV of its runs, print what it is and write `out`."""
    from swimbladder.errors import InputError
    from swimbladder.vehicle import PowerLawPump, PumpAndValve

    if power_at not in ("mean", "end"):
        raise InputError(
            "a power is not read then", field="--power-at", value=power_at,
            remedy="Allowed: mean (over the run), end (of it)",
        )  # fmt: skip
    if v is not None and not isinstance(v.actuator, PumpAndValve):
        raise InputError(
            "a pump that runs or not is no part of this actuator", field="actuator.kind",
            value=v.actuator.kind, remedy="Give a vehicle of kind pump-valve, or none",
        )  # fmt: skip
    least = quantity(shortest, "s", "--shortest") or 0.0
    at: Literal["mean", "end"] = "end" if power_at == "end" else "mean"
    with progress("reading and fitting"):
        from swimbladder.design.energy import PumpRuns, check_runs, fit_pump, fitted_vehicle
        from swimbladder.design.energy.logged_runs import usable_runs
        from swimbladder.design.energy.messages import fit_sentences
        from swimbladder.io.pump_runs import read_pump_runs
        from swimbladder.show.report.energy import fit_json, write_fit

        table = read_pump_runs(
            path,
            columns=pairs(column, "--column"),
            where=pairs(where, "--where"),
        )
        runs = PumpRuns(**table._asdict())
        limit = None if v is None else v.hull.depth_limit
        try:
            check_runs(runs, usable_runs(runs, least), depth_limit=limit)
        except InputError as error:
            raise error.at(file=path) from None
        found = fit_pump(runs, power_at=at, shortest=least)
        fitted = None
        if v is not None and isinstance(v.actuator, PumpAndValve):
            if "delivery" not in found.parameters and not isinstance(v.actuator.pump, PowerLawPump):
                raise InputError(
                    "without measured volumes the pump of the vehicle keeps its delivery, and one "
                    "from datasheets has none to keep", field="volume_m3",
                    remedy="Log the volume of each run, give the vehicle's pump as kind power-law, "
                    "or leave the vehicle out",
                )  # fmt: skip
            fitted = fitted_vehicle(v, found)
        said = fit_sentences(found, fitted)
        answer = {**fit_json(found), "sentences": said, "report": table.report}
        files = write_fit(found, fitted, out, answer=json_text(answer))
    if json:
        emit_json({**answer, "files": [str(path) for path in files]})
        return
    _print_fit(found, said)
    for line in table.report:
        output.print(line, soft_wrap=True)
    for written in files:
        output.print(f"wrote {written}", soft_wrap=True)


def _print_fit(found: PumpFit, said: tuple[str, ...]) -> None:
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
