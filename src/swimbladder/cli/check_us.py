"""``swimbladder reproduce``: the paper redone, in a report that opens from disk."""

from pathlib import Path

import typer

from swimbladder.cli.common import aside, compile_notice, progress
from swimbladder.cli.options import Files, Options, grouped, valued


class Noise(Options):
    """What its noise is drawn from."""

    seed: int = valued("N", "Seed of the sensors' noise.", 2023, min=0)


@grouped(out=Path("report/paper"))
def reproduce(*, asked: Noise, to: Files) -> None:
    """Reproduce the paper: every figure, table and number, in one report.

    Falcao Carneiro et al. 2023, doi 10.3390/act12100380, from simulation. Exit code 1 when a
    number of the paper, an equation or an independent check is not met and it is not known why.
    """
    with progress("loading the simulator"):
        from swimbladder.paper import AMOUNT
        from swimbladder.paper import reproduce as make_report
        from swimbladder.show.parts import REPORT
    with compile_notice(), progress("redoing the paper", AMOUNT) as advance:
        found = make_report(to.out, seed=asked.seed, advance=advance)
    page = (to.out / REPORT).resolve()
    v, met = found["verdicts"], [c["passed"] for c in found["equations"]]
    differ = f"{v['EXPLAINED']} differ and it is known why"
    compared = f"{v['AGREES']} agree, {differ}, {v['FAILS']} fail"
    claims = f"published numbers and claims: {compared}"
    shown = [claims, f"equations: {sum(met)} of {len(met)} checked and met", f"wrote {page}"]
    to.show({**found, "report": str(page)}, shown)
    if not found["passed"]:
        aside(*(f"fails: {failure}" for failure in found["failures"]))
        raise typer.Exit(1)
