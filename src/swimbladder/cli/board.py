"""``swimbladder board``: hardware in the loop, a board's own C against the vehicle's model."""

from pathlib import Path

from swimbladder.cli.common import aside, working
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


class Line(Options):
    """Where the board is."""

    port: str = valued("PORT", "Serial port: /dev/ttyUSB0, COM3.", ...)
    baud: int | None = valued("N", "Baud rate (115200).", min=1)
    real_time: bool = flag("--real-time", "One tick per sample time, not as fast as possible.")


class More(Options):
    """What is flown beside the golden mission, as `codegen.board.Flights` has it."""

    steps: bool = flag("--steps", "Also fly steps.")
    missions: int = valued("N", "Missions with faults.", 0, min=0)
    depth_range: Given = valued("LEAST:MOST", "Depth range of these missions.")


@grouped("port time_limit missions steps", out=Path("swimbladder-board"))
def board(
    vehicle: VehicleName,
    *,
    line: Line,
    limit: TimeLimit,
    golden: Golden,
    more: More,
    to: Files,
) -> None:
    """Simulate the vehicle with the C on a board at a serial port: hardware in the loop.

    The board runs the sketch HardwareInTheLoop of the library that firmware writes. It flies the
    golden mission (see firmware), steps, missions with faults (see faults), each from a board that
    is disarmed and then armed, and a reset; every command and all that the supervisor says is
    compared with the float32 twin to the bit. Needs pyserial.
    Exit code 1 where board and twin differ, or the board answers no more; the log of each flight is
    written as it grows, and stays.
    """
    v = limit.flashed(vehicle)
    given = golden.given() | more.given()
    from swimbladder.codegen.board import Flights
    from swimbladder.codegen.board import board as fly

    how, before = line.given(), _logs(to.out)
    try:
        with working("flying on the board") as advance:
            answer = fly(v, how.pop("port"), Flights(**given), **how, out=to.out, advance=advance)
    except BaseException:
        if _logs(to.out) != before:
            aside(f"the log so far is in {to.out}")
        raise
    to.answer(answer, [flight.log for flight in answer.flights])


def _logs(out: Path) -> dict[Path, int]:
    """Return the logs in a folder, and when they were written."""
    return {path: path.stat().st_mtime_ns for path in out.glob("*.csv")}
