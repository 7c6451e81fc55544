"""``swimbladder identify-actuator``: K1, T1, dead zone, asymmetry and rate from logged steps."""

import time
from pathlib import Path
from typing import Annotated

import typer

from swimbladder.cli.common import progress
from swimbladder.cli.logs import LogReading
from swimbladder.cli.options import Files, LogFiles, Options, grouped, loaded, valued
from swimbladder.cli.texts import Given, Several, pair
from swimbladder.units import quantity


class Sought(Options):
    """What is known of the actuator, and what is to be identified."""

    fixed: Several = valued("NAME=VALUE", 'Parameter fixed at a value: "dead_zone=0.5 V".')
    required: Given = valued(
        "NAME,...",
        "Exit with 1 unless identified: K1, T1, dead_zone, load_voltage, asymmetry, "
        "rate (K1 and T1; without a voltage T1 and rate; of a positioner the rate).",
    )


@grouped("where column fixed required", out=Path("swimbladder-identify-actuator"))
def identify_actuator(
    logs: LogFiles,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE",
            help="Preset or TOML file: piston area, load of the sea, supply; written anew.",
        ),
    ] = None,
    *,
    reading: LogReading,
    sought: Sought,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw steps.png.")] = False,
    to: Files,
) -> None:
    """Identify K1, T1, dead zone, asymmetry and rate of an actuator.

    From logs of voltage steps, or of moves at full speed where no voltage was logged. Several logs
    are of one actuator. Exit code 1: what was asked for is not identifiable from the logs.
    """
    from swimbladder.estimation.actuator import PARAMETERS

    v = None if vehicle is None else loaded(vehicle, sampled=True)
    set_to = (pair(text, "--fixed") for text in sought.fixed or [])
    fixed = {n: quantity(text, PARAMETERS.get(n, ""), f"--fixed {n}") for n, text in set_to}
    required = sought.read()["required"]
    needs, chosen = ("time_s",), enumerate(reading.chosen(logs))
    given = [reading.log(one, v, quiet=k > 0, required=needs) for k, one in chosen]
    with progress("loading the fit"):
        from swimbladder.estimation.actuator import identify_actuator as identify

    begun = time.perf_counter()
    with progress("identifying the actuator", 1.0) as advance:
        found = identify(given, v, fixed=fixed, required=required, advance=advance)
    seconds = time.perf_counter() - begun
    from swimbladder.show.actuator import ActuatorIdentificationShown

    to.answer(ActuatorIdentificationShown(found, seconds=seconds, pictures=plot))
