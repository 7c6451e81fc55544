"""``swimbladder pool``: the pool procedure as a guided run, simulated or on a growing log."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import compile_notice, console, emit_json, output, progress
from swimbladder.cli.logs import LogColumns, LogForm, depth, names
from swimbladder.cli.pool_options import asked_of, rules_of
from swimbladder.cli.pool_sources import operator_of, tail_of
from swimbladder.cli.pool_view import View, parameter_table
from swimbladder.errors import InputError, SwimbladderError

if TYPE_CHECKING:
    from swimbladder.design.pool_day import News, PoolDay
    from swimbladder.design.pool_day.files import Kept
    from swimbladder.io.plan import Plan
    from swimbladder.vehicle import Vehicle

__all__ = ["pool"]

_POOL = 4.5  # m


def pool(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Rehearse on the simulated vehicle.")
    ] = False,
    follow: Annotated[
        Path | None, typer.Option(metavar="LOG", help="Follow a log that is being written.")
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(metavar="VEHICLE", help="The vehicle in the simulated water (VEHICLE)."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Simulated seconds a second (60 on a terminal, else as fast as it goes)."
        ),
    ] = None,
    sensor_std: Annotated[
        str | None,
        typer.Option(
            metavar="DEPTH", help="Noise of the simulated depth (the vehicle's; 2 mm if none)."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated noise.", min=0)] = 0,
    most: Annotated[
        int, typer.Option(help="Experiments after which a rehearsal ends.", min=1)
    ] = 16,
    column: LogColumns = None,
    log_format: LogForm = None,
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for more, or take the log as finished.")
    ] = True,
    timeout: Annotated[
        str, typer.Option(metavar="TIME", help="End when the log has not grown for so long.")
    ] = "15 min",
    pool_depth: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Depth of the bottom (4.5 m in a rehearsal)."),
    ] = None,
    travel: Annotated[
        str, typer.Option(metavar="DISTANCE", help="An experiment is over after this.")
    ] = "3 m",
    plan: Annotated[
        Path | None,
        typer.Option(
            metavar="PLAN", help="What to do, from design-experiment (the paper's experiments)."
        ),
    ] = None,
    target_std: Annotated[
        str | None,
        typer.Option(metavar="SHARE", help="How well each but psi is to be known (2 %)."),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(metavar="NAME=STD,...", help='Or each by itself, as in "K2=2%,T2=3%".'),
    ] = None,
    free: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="What is identified, as in identify.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help='Known, as in psi="4e-6 m3/m".'),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE+-STD", help='As in psi="4e-6 +- 4e-7 m3/m".'),
    ] = None,
    drag: Annotated[
        str | None, typer.Option(metavar="LAW", help="linear, quadratic or blended.")
    ] = None,
    neutral_std: Annotated[
        str, typer.Option(metavar="VOLUME", help="How well a rest tells the neutral volume.")
    ] = "0.5 cm3",
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "swimbladder-pool"
    ),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Guide the pool procedure: what to do next, what is known, when to stop.

    Exit code 0 when the parameters are good enough, 1 when they are not, with the reason. What is
    known is in DIR at all times; a run in the same folder goes on from there.
    """
    from swimbladder.io.config import load_vehicle

    if simulate == (follow is not None):
        raise InputError(
            "a guided run is either simulated or follows a log", field="--simulate, --follow",
            remedy="Give --simulate to rehearse, or --follow LOG at the pool",
        )  # fmt: skip
    if simulate:
        _refuse(
            "it is for a log that is followed", {"--column": column, "--log-format": log_format}
        )
    else:
        _refuse(
            "it is for a rehearsal",
            {"--truth": truth, "--speed": speed, "--sensor-std": sensor_std},
        )
    v = load_vehicle(vehicle, sampled=True)
    chosen = _plan(plan, pool_depth)
    bottom = depth(pool_depth, "--pool-depth") if pool_depth else (
        chosen.pool_depth if chosen else _POOL if simulate else None
    )  # fmt: skip
    with progress("loading the fit"):
        from swimbladder.design.pool_day import PoolDay, finished, paper_tasks, plan_tasks, rehearse
        from swimbladder.design.pool_day import follow as follow_log

        asked = asked_of(
            v, free=names(free), fixed=set_ or [], priors=prior or [], drag=drag,
            neutral_std=neutral_std, target=target, target_std=target_std,
        )  # fmt: skip
        rules = rules_of(v, bottom, travel, chosen)
        tasks = plan_tasks(chosen) if chosen else paper_tasks(v, pool_depth=bottom)
    mode = "simulated" if simulate else "followed"
    # What is wrong with the input is said before anything is touched.
    if simulate:
        operator = operator_of(v, truth, bottom or _POOL, speed, sensor_std, seed)
    else:
        assert follow is not None
        tail, limit = tail_of(v, follow, column or [], log_format, timeout, wait=wait)
    with compile_notice(), _no_empty_folder(out):
        day = PoolDay(
            v, out, rules=rules, tasks=tasks, asked=asked, mode=mode, kept=_begin(out, v, mode)
        )
        view, begun = View(day, quiet=json), day.found
        files: list[Path] = []
        if simulate:
            files = [out / "pool.csv"]
            pace = speed or (60.0 if view.live else math.inf)
            _through(view, rehearse(day, operator, most=most, speed=pace, whole=files[0]))
        else:
            happening = follow_log(day, tail, timeout=limit) if wait else finished(day, tail)
            _through(view, happening)
            for line in tail.report:
                console.print(f"note: {line}", markup=False, soft_wrap=True)
        latest = day.found
        day.settle()
        told = not view.live and day.found is latest is not begun
    day.save()
    answer = day.answer()
    answer["files"] += [str(path) for path in files]
    if json:
        emit_json(answer)
    else:
        _print_end(day, files, told=told)
    if not day.verdict.good:
        raise typer.Exit(1)


@contextlib.contextmanager
def _no_empty_folder(out: Path) -> Iterator[None]:
    """Take a folder away that was made for nothing, where there is no log to follow."""
    made = not out.exists()
    try:
        yield
    except SwimbladderError:
        if made and out.is_dir() and not any(out.iterdir()):
            out.rmdir()
        raise


def _refuse(why: str, options: Mapping[str, object]) -> None:
    """Raise InputError for an option of the other kind of run."""
    for name, given in options.items():
        if given not in (None, []):
            raise InputError(why, field=name, value=given, remedy="Leave it out")


def _plan(path: Path | None, pool_depth: str | None) -> Plan | None:
    from swimbladder.io.plan import load_plan

    if path is not None and pool_depth is not None:
        raise InputError(
            "the plan says this already", field="--pool-depth", value=pool_depth,
            remedy="Leave it out, or the plan",
        )  # fmt: skip
    return None if path is None else load_plan(path)


def _through(view: View, happening: Iterable[News | None]) -> None:
    """Show what happens, until it is over or interrupted."""
    try:
        view.show(happening)
    except KeyboardInterrupt:
        console.print("interrupted; what is known is written")
        view.show(view.day.end_log())


def _begin(out: Path, vehicle: Vehicle, mode: str) -> list[Kept]:
    """Make the folder; return the experiments of an earlier run that is gone on with.

    A rehearsal begins anew. Raises InputError where the folder holds the run of another vehicle, or
    one of the other kind.
    """
    from swimbladder.design.pool_day.files import STATE, earlier, read_state
    from swimbladder.io.files import make_folder

    state = read_state(make_folder(out))
    if state is None:
        return []
    for name, now in (("vehicle", vehicle.name), ("mode", mode)):
        if state.get(name) != now:
            raise InputError(
                f"the folder holds a run whose {name} is another than {now}", file=out / STATE,
                field="--out", value=state.get(name), remedy="Choose another folder with --out",
            )  # fmt: skip
    kept = earlier(out, state)
    if mode == "followed":
        if kept:
            console.print(f"goes on from {len(kept)} experiments in {out}", soft_wrap=True)
        return kept
    for one in kept:
        one.path.unlink()
    (out / STATE).unlink()
    return []


def _print_end(day: PoolDay, files: list[Path], *, told: bool) -> None:
    """Print the verdict where it has not been told already, what is next, and the files."""
    if not told:
        output.print(day.verdict.sentence, soft_wrap=True)
        if day.found is not None:
            output.print(parameter_table(day))
    if not day.verdict.good:
        output.print(f"Next: {day.next.sentence()}", soft_wrap=True)
    for path in [k.path for k in day.kept] + [day.folder / "pool.json"] + files:
        output.print(f"wrote {path}", soft_wrap=True)
