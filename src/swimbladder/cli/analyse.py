"""``swimbladder analyse``: linear models, stability, margins and what depth does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.common import aside, progress
from swimbladder.cli.options import Files, Options, VehicleName, grouped, loaded, valued

if TYPE_CHECKING:
    from swimbladder.design.analysis import Analysis


class Asked(Options):
    """Where the vehicle rests."""

    depth: str = valued("DEPTH", "Depth of the operating point.", "0 m")


@grouped(out=None)
def analyse(vehicle: VehicleName, *, asked: Asked, to: Files) -> None:
    """Linear models: poles, Routh's table, margins of the sampled loop.

    The depth is in m, or carries a unit: --depth "50 m". Exit code 1 when the vehicle has a
    controller and its closed loop is not stable, or cannot rest at the depth. Files are written
    with --out.
    """
    with progress("analysing"):
        a = _analysis(vehicle, asked.read()["depth"])
    if not a.rests:
        aside(f"no rest: stroke or supply do not hold {a.vehicle.name} at {a.depth:g} m")
    to.answer(a)


def _analysis(vehicle: str, depth: float) -> Analysis:
    from swimbladder.design.analysis import DOWN
    from swimbladder.design.analysis import analyse as analyse_vehicle
    from swimbladder.errors import InputError, check_number
    from swimbladder.io.config import locate

    check_number(depth, "--depth", "m", least=0.0, remedy=DOWN)
    v = loaded(vehicle)
    try:
        return analyse_vehicle(v, depth=depth)
    except InputError as error:
        raise (locate(error, vehicle) if Path(vehicle).is_file() else error) from None
