"""``swimbladder board``: hardware in the loop, a board's own C against the vehicle's model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.common import aside, compile_notice, progress
from swimbladder.cli.options import (
    Files,
    Golden,
    Options,
    TimeLimit,
    VehicleName,
    flag,
    grouped,
    valued,
)
from swimbladder.cli.texts import Given
from swimbladder.units import rounded

if TYPE_CHECKING:
    from swimbladder.codegen.board import BoardAnswer, FlightAnswer


@dataclass(frozen=True)
class Line(Options):
    """Where the board is."""

    port: str = valued("PORT", "Serial port: /dev/ttyUSB0, COM3.", ...)
    baud: int | None = valued("N", "Its baud rate (115200).", min=1)
    real_time: bool = flag("--real-time", "A tick every sample time, not as soon as it can.")


@dataclass(frozen=True)
class More(Options):
    """What is flown beside the golden mission, as `codegen.board.Flights` has it."""

    steps: bool = flag("--steps", "Fly steps to and fro as well.")
    faults: int = valued("N", "Fly so many missions with faults as well.", 0, min=0)
    depths: Given = valued("LEAST:MOST", "Depths that these are flown at.", name="--depth")


@grouped(out=Path("swimbladder-board"))
def board(
    vehicle: VehicleName,
    *,
    line: Line,
    limit: TimeLimit,
    golden: Golden,
    more: More,
    to: Files,
) -> None:
    """Fly the vehicle's model by the C on a board at a serial port: hardware in the loop.

    The board runs the sketch HardwareInTheLoop of the library that firmware writes. It flies the
    golden mission (see firmware), steps, missions with faults (see faults), each from a board that
    is disarmed and then armed, and a reset; every command and all that the supervisor says is
    compared with the float32 twin to the bit. Needs pyserial.
    Exit code 1 where board and twin differ, or the board answers no more; the log of each flight is
    written as it grows, and stays.
    """
    v = limit.flashed(vehicle)
    given = golden.given() | more.given()
    to.check()
    with progress("loading the simulator"):
        from swimbladder.codegen.board import Flights
        from swimbladder.codegen.board import board as fly

    how, before = line.given(), _logs(to.out)
    flying = progress("flying on the board", 1.0)
    try:
        with golden.said_as_typed(), more.said_as_typed(), compile_notice(), flying as advance:
            answer = fly(v, how.pop("port"), Flights(**given), **how, out=to.out, advance=advance)
    except BaseException:
        if _logs(to.out) != before:
            aside(f"the log so far is in {to.out}")
        raise
    logs, why = [flight.log for flight in answer.flights], list(map(_said, answer.flights))
    to.answer(answer.to_dict(), logs, _shown(answer), good=answer.equal, why=why)


def _logs(out: Path) -> dict[Path, int]:
    """Return the logs in a folder, and when they were written."""
    return {path: path.stat().st_mtime_ns for path in out.glob("*.csv")}


def _said(flight: FlightAnswer) -> str:
    """Return how a flight went, in a sentence."""
    first = flight.difference
    said = f"{flight.name}: equal at all {flight.ticks} ticks"
    if first is not None:
        both = f"{first.field} {first.board:.9g} on the board, {first.twin:.9g} of the twin"
        said = f"{flight.name}: first differs at tick {first.tick}: {both}"
        said += f"; {flight.unequal} of {flight.ticks} ticks differ"
    faults = f"; {flight.ended}" if flight.ended else ""
    alarm = f"; the supervisor took over: {flight.reason}" if flight.reason else ""
    return f"{said}{faults}, at {flight.depth:.2f} m{alarm}"


def _shown(answer: BoardAnswer) -> Iterator[object]:
    """Give what is printed: how each flight went, the board's times, the line's frames."""
    from swimbladder.codegen.board import Spread
    from swimbladder.codegen.library import digest

    made, times = answer.made, answer.times
    where = f"{answer.port}, {answer.baud} baud, C {digest(made).hex()}"
    yield f"{answer.vehicle.name}: law {made.law.name} every {made.tick_s:.9g} s on {where}"
    yield from map(_said, answer.flights)
    if answer.not_flown:
        yield f"not flown over a wire: {', '.join(answer.not_flown)}"
    listed = [("step on the board", times.steps), ("until the answer", times.trips)]
    if answer.real_time:
        listed.append(("between ticks, off the sample time", times.intervals))
    for name, taken in listed:
        if (spread := Spread.of(taken)) is not None:
            median, worst, jitter = (f"{1e3 * time:.3f} ms" for time in spread)
            yield f"{name}: median {median}, worst {worst}, jitter {jitter}"
    late = f"; {times.late} ticks were late" if answer.real_time else ""
    yield f"speed: {rounded(answer.speed, 3)} times real time{late}"
    counts = "{sent} sent, {lost} lost; corrupt: {corrupt} here, {corrupt_at_board} at the board"
    yield f"frames: {counts.format(**answer.frames)}"
    left = answer.stack_left
    yield f"stack left: {'not known on this board' if left is None else f'{left} bytes'}"
    yield "equal" if answer.equal else "DIFFERENT"
