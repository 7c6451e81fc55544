"""``swimbladder pool``: the pool procedure as a guided run, simulated or on a growing log.

Its options say what is rehearsed, followed, done and sought; what it shows are lines as things
happen or, on a terminal, a panel that lives.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from swimbladder.cli.common import aside, compile_notice, console, output, progress
from swimbladder.cli.options import (
    Files,
    Given,
    Options,
    Several,
    Sought,
    VehicleName,
    deviation,
    flag,
    grouped,
    loaded,
    pair,
    valued,
)
from swimbladder.errors import InputError, SwimbladderError, UnitError
from swimbladder.show.text import rich_table
from swimbladder.units import parse_quantity, quantity

if TYPE_CHECKING:
    from swimbladder.design.plan import Plan
    from swimbladder.design.pool_day import GrowingLog, News, Operator, PoolDay, Target
    from swimbladder.design.pool_day.day import Kept
    from swimbladder.vehicle import Vehicle

_LATEST = 6  # lines of news in the panel
_STYLES = {"refused": "yellow", "identified": "bold", "log": "dim", "turned": "dim"}


class View:
    """Shows a day's news: nothing where quiet, a panel on a terminal, else lines on stderr."""

    def __init__(self, day: PoolDay, *, quiet: bool) -> None:
        self.day, self.quiet = day, quiet
        self.live = output.is_terminal and not quiet
        self._news: deque[News] = deque(maxlen=_LATEST)

    def show(self, happening: Iterable[News | None]) -> None:
        """Show everything that happens."""
        with self._panel() as update:
            for news in happening:
                if news is not None:
                    self._tell(news)
                update()

    def _tell(self, news: News) -> None:
        self._news.append(news)
        if not (self.quiet or self.live):
            aside(_line(news))

    @contextlib.contextmanager
    def _panel(self) -> Iterator[Any]:
        if not self.live:
            yield lambda: None
            return
        from rich.live import Live

        with Live(self._drawn(), console=output, refresh_per_second=8, transient=True) as live:
            yield lambda: live.update(self._drawn())

    def _drawn(self) -> RenderableType:
        from rich.panel import Panel

        from swimbladder.show.pool import experiment_table, parameter_table

        day = self.day
        parts: list[RenderableType] = [self._state(), Text(day.advice, style="bold cyan"), Text()]
        if day.kept:
            parts += [rich_table(experiment_table(day)), Text()]
        if day.found is not None:
            parts += [rich_table(parameter_table(day)), Text()]
        parts += [Text(_line(n), style=_STYLES.get(n.kind, "")) for n in self._news]
        title = f"swimbladder pool, {day.vehicle.name}, {day.mode}"
        return Panel(Group(*parts), title=title, title_align="left")

    def _state(self) -> RenderableType:
        day, sample = self.day, self.day.latest
        if sample is None:
            return Text("waiting for the log", style="dim")
        words = Text()
        for name in ("moving", "at rest", "under way"):
            words.append(f" {name} ", style="reverse" if day.doing == name else "dim")
        speed = "" if math.isnan(day.speed) else f"   {1e3 * day.speed:+.1f} mm/s over a minute"
        volume = f"volume {1e6 * sample.volume:+.1f} cm3{speed}"
        words.append(f"   {_clock(sample.time)}   depth {sample.depth:.2f} m   {volume}")
        return words


def _line(news: News) -> str:
    when = f"{_clock(news.time)}  " if news.kind != "log" else ""
    return f"{when}{news.sentence}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(0, math.floor(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


_NOISE = 2e-3  # m


class Rehearsed(Options):
    """A rehearsal in simulated water."""

    simulate: bool = flag("--simulate", "Rehearse on the simulated vehicle.")
    truth: Given = valued("VEHICLE", "The vehicle in the simulated water (VEHICLE).")
    real_time_factor: float | None = valued(
        "FACTOR", "Simulated seconds per second (60 on a terminal, else unlimited)."
    )
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's; 2 mm if none).")
    seed: int = valued("N", "Seed of the sensors' noise.", 0, min=0)
    max_experiments: int = valued("N", "Largest number of experiments in a rehearsal.", 16, min=1)

    def operator(self, vehicle: Vehicle, bottom: float) -> Operator:
        """Return who rehearses: the vehicle in simulated water `bottom` [m] deep."""
        from swimbladder.design.pool_day import Operator
        from swimbladder.design.pool_day.rehearsal import check_waiting

        truth = vehicle if self.truth is None else loaded(self.truth, sampled=True)
        std = self.read()["depth_noise"]
        if std is None and truth.sensors.depth_noise == truth.sensors.depth_quantum == 0.0:
            std = _NOISE
            taken = f"{1e3 * std:g} mm (1 sigma) is taken; --depth-noise says another"
            aside(f"{truth.name} states no noise of its depth: {taken}")
        check_waiting(real_time_factor=self.real_time_factor)
        if std is not None:
            truth = truth.with_sensors(depth_noise=std)
        return Operator(vehicle, truth, bottom_depth=bottom, seed=self.seed)


class Followed(Options):
    """A log that is being written."""

    follow: Path | None = valued("LOG", "Follow a log that is being written.")
    columns: Several = valued("NAME=COLUMN", r'Column of the log: "depth_m=Depth \[cm]" or @cm.')
    log_format: Given = valued("FORMAT", r"Format of the log: TOML file with a \[log] table.")
    wait: bool = flag("--wait/--no-wait", "Wait for more rows, or stop at the end.", True)
    timeout: str = valued("TIME", "Stop if the log has not grown for this time.", "15 min")

    def tail(self, vehicle: Vehicle) -> tuple[GrowingLog, float]:
        """Return what reads the log, and how long it waits for more [s]."""
        from swimbladder.design.pool_day import GrowingLog
        from swimbladder.design.pool_day.rehearsal import check_waiting
        from swimbladder.io.log_format import LogFormat, log_format

        given = self.read()
        check_waiting(timeout=given["timeout"])
        form = LogFormat() if self.log_format is None else log_format(self.log_format)
        if self.wait:  # one bad row must not end the day
            form = form.model_copy(update={"bad_rows": "drop"})
        assert self.follow is not None
        tail = GrowingLog(self.follow, vehicle, columns=given["columns"] or {}, log_format=form)
        return tail, given["timeout"]


class Procedure(Options):
    """What is done in the pool."""

    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (4.5 m in a rehearsal).")
    travel: str = valued("LENGTH", "Travel that ends an experiment.", "3 m")
    plan: Path | None = valued("PLAN", "Plan from design-experiment (the paper's experiments).")


def _targets(text: str, option: str) -> list[Target] | float:
    if "=" not in text:
        return quantity(text, "", option)
    from swimbladder.design.pool_day import Target
    from swimbladder.estimation.motion.problem import NAMES

    found = []
    for item in text.split(","):
        name, value = pair(item, option)
        try:
            found.append(Target(name, parse_quantity(value, "")))
        except UnitError:
            unit = NAMES[name].unit if name in NAMES else ""
            std = quantity(value, unit, f"{option} {name}")
            found.append(Target(name, std, relative=False))
    return found


class Goals(Options):
    """How well parameters are to be known."""

    target_std: Given = valued(
        "SHARE", 'Target standard error, all but psi (2 %); or "K2=2%,T2=3%".', read=_targets
    )
    neutral_std: str = valued(
        "VOLUME", "Prior of each log's neutral volume, 1 sigma.", "0.5 cm3", read=deviation("m3")
    )
    drift_std: str = valued("RATE", "Drift of each log's neutral volume, 1 sigma.", "0.1 cm3/min")
    delay_std: str = valued("TIME", "Delay of the volumes' time stamps, 1 sigma.", "0.2 s")


_POOL = 4.5  # m


@grouped("simulate follow bottom_depth plan truth target_std", out=Path("swimbladder-pool"))
def pool(
    vehicle: VehicleName,
    *,
    rehearsed: Rehearsed,
    followed: Followed,
    procedure: Procedure,
    goals: Goals,
    sought: Sought,
    to: Files,
) -> None:
    """Guide the pool procedure: next step, present estimates, when to stop.

    Exit code 0 when the parameters are good enough, 1 when they are not, with the reason. What is
    known is in DIR at all times; a run in the same folder goes on from there.
    """
    simulate = rehearsed.simulate
    if simulate == (followed.follow is not None):
        why = "a guided run is either simulated or follows a log"
        remedy = "Give --simulate to rehearse, or --follow LOG at the pool"
        raise InputError(why, field="--simulate, --follow", remedy=remedy)
    if simulate:
        followed.refuse("it is for a log that is followed", "Leave it out", "wait", "timeout")
    else:
        rehearsed.refuse("it is for a rehearsal", "Leave it out", "seed", "max_experiments")
    v = loaded(vehicle, sampled=True)
    done = procedure.read()
    chosen = _plan(procedure)
    bottom = done["bottom_depth"]
    if bottom is None:
        bottom = chosen.bottom_depth if chosen else _POOL if simulate else None
    with progress("loading the fit"):
        from swimbladder.design.pool_day import PoolDay, finished, paper_tasks, plan_tasks, rehearse
        from swimbladder.design.pool_day import follow as follow_log
        from swimbladder.design.pool_day.day import asked_of, rules_of
        from swimbladder.design.pool_day.verdict import Asked

        before, aims = sought.given(), goals.given()
        errors = {name: aims.pop(f"{name}_std") for name in ("neutral", "drift", "delay")}
        known = Asked(**before, **{f"{name}_std": std for name, std in errors.items()})
        asked = asked_of(v, known, **aims)
        rules = rules_of(v, bottom_depth=bottom, travel=done["travel"], plan=chosen)
        tasks = plan_tasks(chosen) if chosen else paper_tasks(v, bottom_depth=bottom)
    mode = "simulated" if simulate else "followed"
    # What is wrong with the input is said before anything is touched.
    if simulate:
        operator = rehearsed.operator(v, bottom or _POOL)
    else:
        tail, limit = followed.tail(v)
    with compile_notice(), _no_empty_folder(to.out):
        kept = _begin(to.out, v, mode)
        day = PoolDay(v, to.out, rules=rules, tasks=tasks, asked=asked, mode=mode, kept=kept)
        view = View(day, quiet=to.json)
        files = [to.out / "pool.csv"] if simulate else []
        if simulate:
            pace = rehearsed.real_time_factor or (60.0 if view.live else math.inf)
            most = rehearsed.max_experiments
            _through(view, rehearse(day, operator, most=most, speed=pace, whole=files[0]))
        else:
            growing = follow_log(day, tail, timeout=limit) if followed.wait else finished(day, tail)
            _through(view, growing)
            aside(*(f"note: {note}" for note in tail.report))
        day.settle()
    to.answer(day, [*(one.path for one in (*day.kept, *day.aside)), *files])


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


def _plan(procedure: Procedure) -> Plan | None:
    from swimbladder.design.plan import load_plan

    if procedure.plan is None:
        return None
    if (depth := procedure.bottom_depth) is not None:
        why, remedy = "the plan says this already", "Leave it out, or the plan"
        raise InputError(why, field="--bottom-depth", value=depth, remedy=remedy)
    return load_plan(procedure.plan)


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
    from swimbladder.design.pool_day.day import STATE, earlier, read_state
    from swimbladder.io.files import make_folder

    state = read_state(make_folder(out))
    if state is None:
        return []
    for name, now in (("vehicle", vehicle.name), ("mode", mode)):
        if state.get(name) != now:
            place, why = out / STATE, f"the folder holds a run whose {name} is another than {now}"
            other, remedy = state.get(name), "Choose another folder with --out"
            raise InputError(why, file=place, field="--out", value=other, remedy=remedy)
    kept = earlier(out, state)
    if mode == "followed":
        if kept:
            console.print(f"goes on from {len(kept)} experiments in {out}", soft_wrap=True)
        return kept
    for one in kept:
        one.path.unlink()
    (out / STATE).unlink()
    return []
