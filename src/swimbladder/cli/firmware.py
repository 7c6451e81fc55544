"""``swimbladder firmware``: an Arduino library of a vehicle's controller, with a golden trace."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import (
    compile_notice,
    emit_json,
    output,
    progress,
    quantity,
    said_as_typed,
)
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.codegen.library import Library
    from swimbladder.codegen.pool import PoolOptions
    from swimbladder.vehicle import Vehicle

__all__ = ["firmware"]

_START, _TARGET, _DURATION = 1.5, 3.0, 400.0
_ARRIVED = 0.1  # of the step, within which a golden trace has arrived
_OPTIONS = {
    "start_depth": "--start",
    "setpoints[0].depth": "--target",
    "duration": "--duration",
}


def firmware(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    law: Annotated[
        str | None, typer.Option(metavar="LAW", help="Refuse a controller of another law.")
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
    pool: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Add the pool procedure, for a pool this deep."),
    ] = None,
    pool_clearance: Annotated[
        str | None,
        typer.Option(metavar="DEPTH", help="Its rests, from bottom and surface (0.75 m)."),
    ] = None,
    pool_volumes: Annotated[
        str | None,
        typer.Option(metavar="FIRST:LAST", help="Its changes of volume (20:75 cm3)."),
    ] = None,
    pool_rounds: Annotated[
        int | None, typer.Option(metavar="N", help="Its number of rounds (4).")
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the library.")
    ] = Path("swimbladder-firmware"),
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Write the vehicle's controller as an Arduino library in C99 and float32.

    The library holds the law, a supervisor that brings the vehicle up when a fault is detected (see
    [supervisor] in the vehicle's file), sketches with two functions to fill in, and a
    golden trace: a depth step flown by the law's twin in float32, equal to the C to the last bit.
    With --pool it also holds the pool procedure (a)-(d), which identify and pool --follow read.
    Exit code 1 where the controller does not bring the vehicle through that step, or the procedure
    does not come to its end on the vehicle's model.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import check_place

    v = load_vehicle(vehicle, sampled=True)
    _check_law(v, law)
    options = _pool(pool, pool_clearance, pool_volumes, pool_rounds)
    depth, goal, time = (
        default if (given := quantity(text, unit, option)) is None else given
        for text, unit, option, default in (
            (start, "m", "--start", _START),
            (target, "m", "--target", _TARGET),
            (duration, "s", "--duration", _DURATION),
        )
    )
    check_place(out)
    with progress("loading the simulator"):
        from swimbladder.codegen.library import make_library, write_library

    ticks = None if v.controller is None else time / v.controller.sample_time
    done = 0
    typed = {"--start": start, "--target": target, "--duration": duration}
    with (
        said_as_typed(typed, **_OPTIONS), compile_notice(),
        progress("flying the golden trace", ticks) as advance,
    ):  # fmt: skip

        def report(flown: int) -> None:
            nonlocal done
            advance(flown - done)
            done = flown

        made = make_library(
            v, start_depth=depth, target=goal, duration=time, seed=seed, pool=options,
            progress=report,
        )  # fmt: skip
    files = write_library(made, out)
    if json:
        emit_json({**made.to_json(), "files": [str(path) for path in files]})
    else:
        _print(made, files)


def _pool(
    depth: str | None, clearance: str | None, volumes: str | None, rounds: int | None
) -> PoolOptions | None:
    """Return what is said of the pool, None where nothing is."""
    from swimbladder.codegen.pool import PoolOptions

    others = {"--pool-clearance": clearance, "--pool-volumes": volumes, "--pool-rounds": rounds}
    metres = quantity(depth, "m", "--pool")
    if metres is None:
        for option, given in others.items():
            if given is not None:
                raise InputError(
                    "it sets the pool procedure, and there is none",
                    field=option, value=given, remedy='Give --pool, like --pool "4.5 m"',
                )  # fmt: skip
        return None
    options = PoolOptions(metres)
    apart = quantity(clearance, "m", "--pool-clearance")
    if apart is not None:
        options = options._replace(clearance=apart)
    if volumes is not None:
        first, colon, last = volumes.partition(":")
        if re.fullmatch(r"[\d.eE+\s-]+", first):  # "20:75 cm3": both in cm3
            first += " " + re.sub(r"^[\d.eE+\s-]+", "", last)
        least = quantity(first, "m3", "--pool-volumes")
        most = quantity(last, "m3", "--pool-volumes") if colon else least
        assert least is not None
        assert most is not None
        options = options._replace(first=least, last=most)
    if rounds is not None:
        options = options._replace(rounds=rounds)
    return options


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
    from swimbladder.codegen.meanings import summary
    from swimbladder.codegen.pool import pool_summary

    golden, unit = made.golden, "V" if made.law.command == "voltage" else "m3"
    low, high = made.limits
    end = float(golden.depth[-1])
    late = []
    if not abs(end - made.target) <= _ARRIVED * abs(made.target - made.start_depth):
        late.append(
            f"the golden trace ends at {end:.3g} m, before the vehicle has arrived: it tests less "
            "of the C than one with a longer --duration"
        )
    for line in (
        f"{made.vehicle.name}: law {made.law.name} every {made.tick_s:.9g} s, "
        f"command {low:.6g} to {high:.6g} {unit}",
        f"golden trace: {made.start_depth:g} to {made.target:g} m in {len(golden.depth)} ticks; "
        f"float32 moves the vehicle by at most {golden.difference * 1e3:.2g} mm",
        *late,
        summary(made.supervisor),
        *([] if made.pool is None else [pool_summary(made.pool)]),
        "to do: fill in the two functions of an example; README.md says how, and how to check",
    ):
        output.print(line, soft_wrap=True)
    for path in files:
        output.print(f"wrote {path}", soft_wrap=True)
