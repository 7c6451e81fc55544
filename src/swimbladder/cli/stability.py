"""``swimbladder stability``: how stable a vehicle is under its law, and from where it recovers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.common import compile_notice, kept, labelled, progress, table
from swimbladder.cli.options import Files, Options, VehicleName, flag, grouped, valued, watched
from swimbladder.cli.texts import Given, Several
from swimbladder.errors import NoAnswerError

if TYPE_CHECKING:
    from swimbladder.design.stability import Stability


def _all(texts: list[str], _: str) -> tuple[str, ...]:
    return tuple(texts)


@dataclass(frozen=True)
class Asked(Options):
    """What is looked at, as `design.stability.stability` has it."""

    depths: str = valued("LEAST:MOST", "Depth range.", "0:10 m", name="--depth")
    delay: str = valued("SHARE", "Computation delay, as a share of the sample time.", "10 %")
    within: Given = valued(
        "TIME",
        "Recovery time (600 s; floats: 1.5 times the way and an hour).",
    )
    cells: int = valued("N", "Cells of a map per side.", 21)
    voltage_quantum: str = valued("VOLTAGE", "Voltage step of the motor's driver (none).", "0 V")
    no_maps: bool = flag("--no-maps", "Skip the recovery maps.")
    with_robustness: bool = flag("--robustness", "Vary the gain (0.5 to 2) and the delay.")
    laws: Several = valued(
        "LAW", "--robustness: also this law, tuned first.", name="--law", read=_all
    )
    draws: int = valued("N", "--robustness: vehicles per case.", 200)
    supervised: bool = watched()


@grouped("depth law robustness no_maps", out=Path("swimbladder-stability"))
def stability(vehicle: VehicleName, *, asked: Asked, to: Files) -> None:
    r"""Analyse stability under the law: small motions, limit cycles, large motions.

    Eigenvalues and margins over the 95 % parameter region; limit cycles of dead zones, quanta and
    limits, predicted and simulated; maps of what it recovers from. Maps and --robustness include
    the supervisor where the file has a table [supervisor]. Exit code 1: it is unstable; the
    parameters are named. A run that is killed resumes.
    """
    from swimbladder.io.config import load_vehicle
    from swimbladder.io.files import unfinished

    v = load_vehicle(vehicle)
    options = asked.given()
    options["maps"] = not options.pop("no_maps")
    to.check()
    keep = unfinished(to.out)
    with progress("loading the simulator"):
        from swimbladder.design.stability import stability as find
    doing = "looking for what is unstable"
    with kept(keep), compile_notice(), progress(doing, 1.0) as advance:
        found = find(v, **options, keep=keep, advance=advance)
    to.answer(found, _shown(found), keep=keep)
    if not found.stable:
        raise NoAnswerError("the loop is not stable over the range that was asked for")


def _shown(found: Stability) -> Iterator[object]:
    """Give what is printed, the answer first."""
    from swimbladder.design.stability.run import cycle_rows, robustness_rows

    yield f"{found.vehicle}, {found.flown}, sampled every {found.sample_time:g} s"
    yield from found.sentences
    if found.cycles:
        headings = ["limit cycle from", "kind", "predicted", "every", "simulated", "every", "error"]
        yield table(headings, cycle_rows(found.cycles), left=headings[:2])
    if found.stood:
        gains = sorted({s.gain for s in found.stood})
        headings = ["settle (over) [%]", "late", *(f"gain {g:g}" for g in gains)]
        yield table(headings, robustness_rows(found.stood), left=headings[:2])
    yield from labelled("assumed", found.words)
