"""The options of `swimbladder pool`: what is rehearsed, followed, done and sought."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import console, quantity
from swimbladder.cli.logs import pair, pairs
from swimbladder.cli.options import Options, Read
from swimbladder.cli.settings import deviation
from swimbladder.errors import UnitError
from swimbladder.units import parse_quantity

if TYPE_CHECKING:
    from swimbladder.design.pool_day import GrowingLog, Operator, Target
    from swimbladder.vehicle import Vehicle

_NOISE = 2e-3  # m


@dataclass(frozen=True)
class Rehearsed(Options):
    """A rehearsal in simulated water."""

    truth: Annotated[
        str | None,
        typer.Option(metavar="VEHICLE", help="The vehicle in the simulated water (VEHICLE)."),
    ] = None
    speed: Annotated[
        float | None,
        typer.Option(
            help="Simulated seconds a second (60 on a terminal, else as fast as it goes)."
        ),
    ] = None
    sensor_std: Annotated[
        str | None,
        typer.Option(
            metavar="DEPTH", help="Noise of the simulated depth (the vehicle's; 2 mm if none)."
        ),
    ] = None
    seed: Annotated[int, typer.Option(help="Seed of the simulated noise.", min=0)] = 0
    most: Annotated[int, typer.Option(help="Experiments after which a rehearsal ends.", min=1)] = 16

    def operator(self, vehicle: Vehicle, bottom: float) -> Operator:
        """Return who rehearses: the vehicle in simulated water `bottom` [m] deep."""
        from swimbladder.design.pool_day import Operator
        from swimbladder.design.pool_day.follow import check_waiting
        from swimbladder.io.config import load_vehicle

        truth = vehicle if self.truth is None else load_vehicle(self.truth, sampled=True)
        std = self.read()["sensor_std"]
        if std is None and truth.sensors.depth_noise == truth.sensors.depth_quantum == 0.0:
            std = _NOISE
            console.print(
                f"{truth.name} states no noise of its depth: {1e3 * std:g} mm (1 sigma) is taken; "
                "--sensor-std says another",
                soft_wrap=True,
            )
        with self.said_as_typed(depth_noise="sensor_std"):
            check_waiting(speed=self.speed)
            if std is not None:
                truth = truth.with_sensors(depth_noise=std)
            return Operator(vehicle, truth, pool_depth=bottom, seed=self.seed)


@dataclass(frozen=True)
class Followed(Options):
    """A log that is being written."""

    columns: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="NAME=COLUMN",
            help=r'As in depth_m="Depth \[cm]" or depth_m=Depth@cm.',
        ),
        Read(pairs),
    ] = None
    log_format: Annotated[
        str | None, typer.Option(metavar="FORMAT", help=r"TOML file with a \[log] table.")
    ] = None
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for more, or take the log as finished.")
    ] = True
    timeout: Annotated[
        str, typer.Option(metavar="TIME", help="End when the log has not grown for so long.")
    ] = "15 min"

    def tail(self, vehicle: Vehicle, log: Path) -> tuple[GrowingLog, float]:
        """Return what reads the log, and how long it waits for more [s]."""
        from swimbladder.design.pool_day import GrowingLog
        from swimbladder.design.pool_day.follow import check_waiting
        from swimbladder.io.log_format import LogFormat, log_format

        given = self.read()
        with self.said_as_typed():
            check_waiting(timeout=given["timeout"])
        form = LogFormat() if self.log_format is None else log_format(self.log_format)
        if self.wait:  # one bad row must not end the day
            form = form.model_copy(update={"bad_rows": "drop"})
        tail = GrowingLog(log, vehicle, columns=given["columns"] or {}, log_format=form)
        return tail, given["timeout"]


@dataclass(frozen=True)
class Procedure(Options):
    """What is done in the pool."""

    pool_depth: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Depth of the bottom (4.5 m in a rehearsal)."),
    ] = None
    travel: Annotated[
        str, typer.Option(metavar="DISTANCE", help="An experiment is over after this.")
    ] = "3 m"
    plan: Annotated[
        Path | None,
        typer.Option(
            metavar="PLAN", help="What to do, from design-experiment (the paper's experiments)."
        ),
    ] = None


def _targets(text: str, option: str) -> list[Target]:
    from swimbladder.design.pool_day import Target
    from swimbladder.estimation.motion.model import NAMES

    found = []
    for item in text.split(","):
        name, value = pair(item, option)
        try:
            found.append(Target(name, parse_quantity(value, "")))
        except UnitError:
            unit = NAMES[name].unit if name in NAMES else ""
            std = quantity(value, unit, f"{option} {name}")
            assert std is not None
            found.append(Target(name, std, relative=False))
    return found


@dataclass(frozen=True)
class Goals(Options):
    """How well parameters are to be known."""

    target_std: Annotated[
        str | None,
        typer.Option(metavar="SHARE", help="How well each but psi is to be known (2 %)."),
    ] = None
    target: Annotated[
        str | None,
        typer.Option(metavar="NAME=STD,...", help='Or each by itself, as in "K2=2%,T2=3%".'),
        Read(_targets),
    ] = None
    neutral_std: Annotated[
        str,
        typer.Option(metavar="VOLUME", help="How well a rest tells the neutral volume."),
        deviation("m3"),
    ] = "0.5 cm3"
