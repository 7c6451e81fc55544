"""``swimbladder stability``: how stable a vehicle is under its law, and from where it recovers."""

from pathlib import Path

from swimbladder.cli.common import working
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.texts import Given, Several


def _all(texts: list[str], _: str) -> tuple[str, ...]:
    return tuple(texts)


class Asked(Options):
    """What is looked at, as `design.stability.stability` has it."""

    depth_range: str = valued("LEAST:MOST", "Depth range.", "0:10 m")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    within: Given = valued("TIME", "Recovery time (600 s; floats: 1.5 times the way and an hour).")
    cells: int = valued("N", "Cells of a map per side.", 21)
    voltage_quantum: str = valued("VOLTAGE", "Voltage step of the motor's driver (none).", "0 V")
    maps: bool = flag("--maps/--no-maps", "Recovery maps.", True)
    robustness: bool = flag("--robustness", "Vary the gain (0.5 to 2) and the delay.")
    laws: Several = valued("LAW", "Law tuned first, for --robustness; repeatable.", read=_all)
    runs: int = valued("N", "Runs of each case, for --robustness.", 200)
    supervised: bool | None = supervised()


@grouped("depth_range law robustness maps", out=Path("swimbladder-stability"))
def stability(vehicle: VehicleName, *, asked: Asked, to: Files) -> None:
    r"""Analyse stability under the law: small motions, limit cycles, large motions.

    Eigenvalues and margins over the 95 % parameter region; limit cycles of dead zones, quanta and
    limits, predicted and simulated; maps of what it recovers from. Maps and --robustness include
    the supervisor where the file has a table [supervisor]. Exit code 1: it is unstable; the
    parameters are named. A run that is killed resumes.
    """
    from swimbladder.io.files import unfinished

    v = loaded(vehicle)
    options = asked.given()
    keep = unfinished(to.out)
    with working("looking for what is unstable", keep=keep) as advance:
        from swimbladder.design.stability import stability as find

        found = find(v, **options, keep=keep, advance=advance)
    to.answer(found, keep=keep)
