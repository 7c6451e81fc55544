"""``swimbladder reproduce``: the paper redone, in a report that opens from disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from swimbladder.cli.common import aside, compile_notice, emit_json, labelled, progress, say
from swimbladder.cli.options import Options, flag, grouped, valued


@dataclass(frozen=True)
class Asked(Options):
    """Where the report goes, and what its noise is drawn from."""

    out: Path = valued("DIR", "Folder for the report.", Path("report/paper"))
    seed: int = valued(None, "Seed of the sensors' noise in the pool, 0 or more.", 2023)
    json: bool = flag("--json", "Print one JSON object and nothing else.")


@grouped()
def reproduce(*, asked: Asked) -> None:
    """Reproduce the paper: every figure, table and number, in one report.

    Falcao Carneiro et al. 2023, doi 10.3390/act12100380, from simulation. Exit code 1 when a
    number of the paper, an equation or an independent check is not met and it is not known why.
    """
    with progress("loading the simulator"):
        from swimbladder.paper import AMOUNT
        from swimbladder.paper import reproduce as make_report
        from swimbladder.show.report.html import REPORT
    with compile_notice(), progress("redoing the paper", AMOUNT) as advance:
        found = make_report(asked.out, seed=asked.seed, advance=advance)
    page = (asked.out / REPORT).resolve()
    if asked.json:
        emit_json({**found, "report": str(page)})
    else:
        v, met = found["verdicts"], [c["passed"] for c in found["equations"]]
        differ = f"{v['EXPLAINED']} differ and it is known why"
        compared = f"{v['AGREES']} agree, {differ}, {v['FAILS']} fail"
        say(f"published numbers and claims: {compared}")
        say(f"equations: {sum(met)} of {len(met)} checked and met", f"wrote {page}")
    if not found["passed"]:
        aside(*labelled("fails", found["failures"]))
        raise typer.Exit(1)
