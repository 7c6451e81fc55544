"""``swimbladder reproduce``: the paper redone, in a report that opens from disk."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.common import aside, compile_notice, emit_json, labelled, progress, say


def reproduce(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the report.")
    ] = Path("report/paper"),
    seed: Annotated[
        int, typer.Option(help="Seed of the sensors' noise in the pool, 0 or more.")
    ] = 2023,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Redo the paper: every figure, table and number, in one report.

    Falcao Carneiro et al. 2023, doi 10.3390/act12100380, from simulation. Exit code 1 when a
    number of the paper, an equation or an independent check is not met and it is not known why.
    """
    with progress("loading the simulator"):
        from swimbladder.paper import AMOUNT
        from swimbladder.paper import reproduce as make_report
    with compile_notice(), progress("redoing the paper", AMOUNT) as advance:
        found = make_report(out, seed=seed, advance=advance)
    page = (out / "index.html").resolve()
    if json:
        emit_json({**found, "report": str(page)})
    else:
        v = found["verdicts"]
        say(
            f"published numbers and claims: {v['AGREES']} agree, {v['EXPLAINED']} differ and it is "
            f"known why, {v['FAILS']} fail",
            f"equations: {sum(c['passed'] for c in found['equations'])} of "
            f"{len(found['equations'])} checked and met",
            f"wrote {page}",
        )
    if not found["passed"]:
        aside(*labelled("fails", found["failures"]))
        raise typer.Exit(1)
