"""The result of `swimbladder identify` on the terminal: the answer first, then its basis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import output

if TYPE_CHECKING:
    from swimbladder.estimation.motion import Identification
    from swimbladder.estimation.motion.paper_method import PaperFits
    from swimbladder.estimation.motion.posterior import Posterior


def print_found(found: Identification, paper: PaperFits | None, seconds: float) -> None:
    """Print what was found: the answer first, then its basis."""
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import correlations, findings, headlines, reading

    samples = sum(int((e.weight > 0.0).sum()) for e in found.experiments)
    count = len(found.experiments)
    output.print(
        f"{found.result_vehicle.name}, {count} log{'s' if count > 1 else ''}, {samples} samples, "
        f"{found.law} drag, {1e3 * found.depth_noise:.2g} mm of noise, {seconds:.2g} s",
        soft_wrap=True,
    )
    if not found.identified:
        output.print("\nNot identifiable from these logs:", style="bold red")
    output.print("")
    for sentence in headlines(found):
        output.print(sentence, style=None if found.identified else "bold", soft_wrap=True)
    said = findings(found)
    for kind, style in (("warning", "bold yellow"), ("note", None)):
        listed = [f.sentence for f in said if f.severity == kind]
        if listed:
            output.print("")
        for sentence in listed:
            output.print(f"{kind}: {sentence}", style=style, soft_wrap=True)
    output.print("")
    output.print(_parameters(found))
    if found.posterior is not None:
        output.print(_posterior(found.posterior))
    for a, b, r in correlations(found):
        output.print(f"correlation of {a} and {b}: {r:+.2f}")
    if found.choices:
        output.print("")
        output.print(_choices(found))
    output.print("")
    output.print(_logs(found))
    output.print("")
    if paper is not None:
        output.print(f"{paper.sentence}\n", soft_wrap=True)
    for sentence in found.assumptions:
        output.print(f"assumed: {sentence}", soft_wrap=True)
    for note in reading(found, labels(found)):
        output.print(f"note: {note}", soft_wrap=True)


def _posterior(drawn: Posterior) -> Any:
    """Return median and interval of the draws as a table."""
    from swimbladder.estimation.motion.model import NAMES
    from swimbladder.units import shown_unit, unit_factor

    table = number_table(("posterior", "median", "95 % of the draws", "unit"))
    for name in drawn.names:
        unit = NAMES[name].unit
        shown = shown_unit(unit)
        low, median, high = (x * unit_factor(unit, shown) for x in drawn.interval(name))
        table.add_row(name, f"{median:.4g}", f"{low:.4g} to {high:.4g}", shown)
    return table


def number_table(headings: Sequence[str]) -> Any:
    """Return a table of names, and numbers to the right of them."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column(headings[0], overflow="fold")
    for heading in headings[1:]:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _parameters(found: Identification) -> object:
    from swimbladder.show.report.text import rows

    table = number_table(("", "value", "1 sigma", "95 % interval", "unit", "from"))
    words = {"data": "the logs", "prior": "its prior", "set": "set"}
    for r in rows(found):
        table.add_row(r.name, r.value, r.std, r.ci95, r.unit, words[r.origin])
    return table


def _choices(found: Identification) -> object:
    table = number_table(("drag", "psi", "rms", "behind the best", "probability"))
    words = {"free": "estimated", "prior": "with its prior", "set": "as set", "zero": "left out"}
    best = min(c.bic for c in found.choices)
    for c in found.choices:
        table.add_row(
            f"{c.drag}{' (reported)' if c.reported else ''}",
            words[c.psi],
            f"{1e3 * c.rms:.2f} mm",
            f"{c.bic - best:.1f}",
            f"{100.0 * c.weight:.1f} %",
        )
    return table


def _logs(found: Identification) -> object:
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import row

    table = number_table(("log", "rms", "samples", "outliers", "neutral-volume error"))
    for label, e in zip(labels(found), found.experiments, strict=True):
        r = row("", e.estimates["neutral_error"])
        table.add_row(
            label,
            f"{1e3 * e.rms:.1f} mm",
            str(int((e.weight > 0.0).sum())),
            str(e.outliers),
            f"{r.value} +- {r.std} {r.unit}" if r.std else "-",
        )
    return table
