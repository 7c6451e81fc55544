"""``swimbladder firmware``: an Arduino library of a vehicle's controller, with a golden trace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import compile_notice, emit_json, output, progress, quantity
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.firmware.library import Library
    from swimbladder.parameters import Vehicle

__all__ = ["firmware"]

_START, _TARGET, _DURATION = 1.5, 3.0, 400.0
_OPTIONS = {
    "start_depth": "--start",
    "setpoints[0].depth": "--target",
    "duration": "--duration",
}


def firmware(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    law: Annotated[
        str | None, typer.Option(metavar="LAW", help="What its controller has to be, to be sure.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="DEPTH", help=f"Golden trace: start ({_START} m)")
    ] = None,
    target: Annotated[
        str | None, typer.Option(metavar="DEPTH", help=f"Golden trace: set-point ({_TARGET} m)")
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help=f"Golden trace: how long ({_DURATION:g} s)")
    ] = None,
    seed: Annotated[int, typer.Option(help="Golden trace: seed of the sensors' noise.", min=0)] = 1,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the library.")
    ] = Path("swimbladder-firmware"),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Write the vehicle's controller as an Arduino library in C99 and float32.

    The library holds the law, a supervisor that brings the vehicle up whatever the law says (see
    [supervisor] in the vehicle's file), sketches with two functions to fill in, and a
    golden trace: a depth step flown by the law's twin in float32, equal to the C to the last bit.
    Exit code 1 where the controller does not bring the vehicle through that step.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place
    from swimbladder.io.mission import Mission, Setpoint, check_mission

    v = load_vehicle(vehicle)
    _check_law(v, law)
    depth, goal, time = (
        default if (given := quantity(text, unit, option)) is None else given
        for text, unit, option, default in (
            (start, "m", "--start", _START),
            (target, "m", "--target", _TARGET),
            (duration, "s", "--duration", _DURATION),
        )
    )
    if time <= 0.0:
        raise InputError(
            "it must be above 0", field="--duration", value=duration, unit="s",
            remedy="Check the number and its unit",
        )  # fmt: skip
    task = Mission(
        name="golden", start_depth=depth, duration=time, setpoints=(Setpoint(time=0.0, depth=goal),)
    )
    check_mission(v, task, names=_OPTIONS)
    check_place(out)
    with progress("loading the simulator"):
        from swimbladder.firmware.library import make_library, write_library

    assert v.controller is not None
    ticks, done = time / v.controller.sample_time, 0
    with compile_notice(), progress("flying the golden trace", ticks) as advance:

        def report(flown: int) -> None:
            nonlocal done
            advance(flown - done)
            done = flown

        made = make_library(
            v, start_depth=depth, target=goal, duration=time, seed=seed, progress=report
        )
    files = write_library(made, out)
    if json:
        emit_json({**made.to_json(), "files": [str(path) for path in files]})
    else:
        _print(made, files)


def _check_law(vehicle: Vehicle, law: str | None) -> None:
    """Raise InputError where the vehicle's controller is not of the law that was asked for."""
    own = None if vehicle.controller is None else vehicle.controller.law
    if law is None or law == own:
        return
    from swimbladder.control.registry import law_by_name

    law_by_name(law)
    raise InputError(
        f"the controller of the vehicle {vehicle.name!r} is "
        + ("not there" if own is None else f"of the law {own!r}, and so are its parameters"),
        field="--law",
        value=law,
        remedy=f'Give a vehicle file whose [controller] has law = "{law}" and its parameters',
    )


def _print(made: Library, files: list[Path]) -> None:
    from swimbladder.firmware.meanings import summary

    golden, unit = made.golden, "V" if made.law.command == "voltage" else "m3"
    low, high = made.limits
    for line in (
        f"{made.vehicle.name}: law {made.law.name} every {made.tick_s:.9g} s, "
        f"command {low:.6g} to {high:.6g} {unit}",
        f"golden trace: {made.start_depth:g} to {made.target:g} m in {len(golden.depth)} ticks; "
        f"float32 moves the vehicle by at most {golden.difference * 1e3:.2g} mm",
        summary(made.supervisor),
        "to do: fill in the two functions of an example; README.md says how, and how to check",
    ):
        output.print(line, soft_wrap=True)
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)
