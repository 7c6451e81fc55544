"""The command line: ``swimbladder COMMAND VEHICLE ...``.

Each group of commands is a module of this package that holds what is registered under a command's
name: a function, or a ``typer.Typer`` where the command has commands of its own. Only the module of
the command that was asked for is imported, so that ``--help`` answers at once. Exit codes: 0 done,
1 the answer is "no", 2 bad input, 130 interrupted, 143 terminated.
"""

import gc
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from swimbladder.cli.common import run, stop_on_terminate

__all__ = ["COMMANDS", "GROUPS", "command_of", "main"]

GROUPS = {
    "Describe a vehicle": {
        "vehicle": "List, show, change and write vehicle files.",
        "size": "Select drive, motor, stroke and battery for a dive.",
        "ballast": "Neutral volume, ballast and stroke in a CTD cast.",
        "energy": "Energy per volume over depth; fit a pump to runs.",
    },
    "Predict what it does": {
        "simulate": "Simulate depth steps or a mission in closed loop.",
        "mission": "Simulate missions of months: dive, park, profile.",
        "campaign": "Simulate many different floats on one mission.",
        "analyse": "Transfer functions, poles, margins and stall depth.",
        "plan": "Time-, effort- or energy-optimal depth step.",
    },
    "Measure its parameters": {
        "design-experiment": "Optimal pool experiments, with predicted errors.",
        "pool": "Guide a day at the pool, simulated or on a growing log.",
        "identify": "K2, T2, psi and drag from logs, with intervals.",
        "identify-actuator": "K1, T1, dead zone, asymmetry and rate from logged steps.",
        "compare": "Compare the model with a measured log.",
    },
    "Control it": {
        "tune": "Gains with margins over the 95 % parameter region.",
        "compare-laws": "Compare all laws on the same scenarios.",
        "stability": "Eigenvalues, limit cycles, recovery maps.",
        "firmware": "The controller as an Arduino library in C.",
        "board": "Hardware in the loop: the C on a board.",
        "faults": "Fault campaign with the vehicle's C and supervisor.",
    },
    "Check us": {"reproduce": "Reproduce the paper's figures, tables and numbers."},
}
COMMANDS = {name: words for group in GROUPS.values() for name, words in group.items()}
PANELS = {name: panel for panel, commands in GROUPS.items() for name in commands}
MODULES = dict(zip(GROUPS, ("describe", "predict", "measure", "control", "check_us"), strict=True))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line on `arguments` (the process's own when None); return the exit code."""
    if arguments is None:  # a process of our own: start-up makes many objects and no garbage
        gc.set_threshold(100_000, 50, 50)
        stop_on_terminate()
    given = list(sys.argv[1:] if arguments is None else arguments)
    completing = "_SWIMBLADDER_COMPLETE" in os.environ
    named = next((word for word in given if not word.startswith("-")), None)
    # to read typer's own options before the command takes pydantic, given or not
    before = completing or named not in COMMANDS or given[0] != named
    app: Any = _app(set(COMMANDS) if completing else {named} & set(COMMANDS), before=before)
    if completing:
        from swimbladder.cli.completion import with_offers

        app = with_offers(typer.main.get_command(app))
    return run(lambda: app(args=given, prog_name="swimbladder"), json="--json" in given)


def _app(wanted: set[str | None], *, before: bool) -> typer.Typer:
    """Return the command line with the `wanted` commands loaded, the others by name only.

    before: with typer's own options that stand before the command, of help and completion.
    """
    app = typer.Typer(
        name="swimbladder",
        help="Variable-buoyancy vehicles: from datasheet to model, from pool log to parameters, "
        "from parameters to a depth controller.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        add_completion=before,
        add_help_option=before,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for name, summary in COMMANDS.items():
        how: dict[str, Any] = {"help": summary, "rich_help_panel": PANELS[name]}
        if name not in wanted:
            app.command(name, **how)(_not_loaded)
            continue
        command = command_of(name)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, **how)
        else:
            app.command(name)(command)
    return app


def command_of(name: str) -> Any:
    """Return what is registered as a command, from the module of its group."""
    home = import_module(f"swimbladder.cli.{MODULES[PANELS[name]]}")
    return getattr(home, name.replace("-", "_"))


def _not_loaded() -> None:
    """Stand in the list of commands for one that was not asked for."""
    raise AssertionError("a command that was asked for is always loaded")


def _print_version(asked: bool) -> None:
    if asked:
        from swimbladder import __version__

        print(f"swimbladder {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Hold the options that stand before the command."""
