"""The least time of each step, found in a process of its own: some programs take very long."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

from swimbladder.design.planning import least_time
from swimbladder.errors import SwimbladderError
from swimbladder.vehicle import Vehicle


class Asked(NamedTuple):
    """A step [m] with the supply's voltage [V], None for a positioner."""

    start: float
    target: float
    supply: float | None


def least_times(vehicle: Vehicle, steps: Sequence[Asked], *, limit: float) -> list[dict[str, Any]]:
    """Return for each step its least time [s] as ``time``, or in words ``why`` there is none.

    limit [s]: after which no more are waited for; ``late`` says that one was not.
    """
    asked = json.dumps({"vehicle": vehicle.model_dump_json(), "steps": [list(s) for s in steps]})
    try:
        ran = subprocess.run(
            [sys.executable, "-c", f"from {__name__} import answer; answer()"],
            input=asked.encode(), stdout=subprocess.PIPE, timeout=limit, check=False,
        )  # fmt: skip
        printed = ran.stdout
    except subprocess.TimeoutExpired as expired:
        printed = expired.stdout or b""
    whole = printed[: printed.rfind(b"\n") + 1].decode()
    found: list[dict[str, Any]] = [json.loads(line) for line in whole.splitlines()]
    why = f"the linear programs took longer than {limit:g} s (swimbladder plan has no limit)"
    return found + [{"why": why, "late": True}] * (len(steps) - len(found))


def _one(vehicle: Vehicle, step: Asked) -> dict[str, Any]:
    try:
        return {"time": least_time(vehicle, step.start, step.target, supply=step.supply).time}
    except SwimbladderError as error:
        return {"why": str(error)}


def answer() -> None:
    """Read a vehicle and steps from stdin, print a line of JSON for each: the process itself."""
    given = json.loads(sys.stdin.read())
    vehicle = Vehicle.model_validate_json(given["vehicle"])
    for step in given["steps"]:
        print(json.dumps(_one(vehicle, Asked(*step))), flush=True)
