"""``swimbladder firmware``: an Arduino library of a vehicle's controller, with a golden trace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.common import working
from swimbladder.cli.options import Files, Golden, Options, TimeLimit, VehicleName, grouped, valued
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError
from swimbladder.units import quantity, with_one_unit

if TYPE_CHECKING:
    from swimbladder.codegen.pool import PoolOptions
    from swimbladder.vehicle import Vehicle


def _volumes(text: str, option: str) -> tuple[float | None, float | None]:
    """Return two changes of volume [m3], the same twice where there is one."""
    found = [quantity(part, "m3", option) for part in with_one_unit(text.split(":", 1))]
    return found[0], found[-1]


class Pool(Options):
    """The pool procedure, as `codegen.pool.PoolOptions` has it."""

    bottom_depth: Given = valued("DEPTH", "Depth of the bottom: adds the pool procedure.")
    clearance: Given = valued("LENGTH", "Distance from bottom and surface (0.75 m).")
    volume_changes: Given = valued(
        "FIRST:LAST", "Volume changes in the pool (20:75 cm3).", read=_volumes
    )
    rounds: int | None = valued("N", "Rounds in the pool (4).")

    def options(self) -> PoolOptions | None:
        """Return what is said of the pool, None where nothing is."""
        from swimbladder.codegen.pool import PoolOptions

        if self.bottom_depth is None:
            why = "it sets the pool procedure, and there is none"
            self.refuse(why, 'Give --bottom-depth, like --bottom-depth "4.5 m"')
            return None
        return PoolOptions(**self.given())


_LAW = typer.Option(metavar="LAW", help="Law that the controller has to be of.")


@grouped("law time_limit bottom_depth", out=Path("swimbladder-firmware"))
def firmware(
    vehicle: VehicleName,
    law: Annotated[str | None, _LAW] = None,
    *,
    limit: TimeLimit,
    golden: Golden,
    pool: Pool,
    to: Files,
) -> None:
    """Write the vehicle's controller as an Arduino library in C99 and float32.

    The library holds the law, a supervisor that brings the vehicle up when a fault is detected (see
    [supervisor] in the vehicle's file), sketches with two functions to fill in, and a
    golden trace: a depth step flown by the law's twin in float32, equal to the C to the last bit.
    The board of a float with pump and valve commands seconds of them (kind pump-valve).
    With --bottom-depth it also holds the pool procedure (a)-(d), which identify and pool --follow
    read.
    Exit code 1 where the controller does not bring the vehicle through that step, or the procedure
    does not come to its end on the vehicle's model.
    """
    v = limit.flashed(vehicle)
    _check_law(v, law)
    options, asked = pool.options(), golden.given()
    with working("flying the golden trace") as advance:
        from swimbladder.codegen.library import firmware as make

        made = make(v, **asked, pool=options, advance=advance)
    to.answer(made)


def _check_law(vehicle: Vehicle, law: str | None) -> None:
    """Raise InputError where the vehicle's controller is not of the law that was asked for."""
    own = None if vehicle.controller is None else vehicle.controller.law
    if law is None or law == own:
        return
    from swimbladder.control.registry import law_by_name

    law_by_name(law)
    found = "not there" if own is None else f"of the law {own!r}, and so are its parameters"
    why = f"the controller of the vehicle {vehicle.name!r} is {found}"
    remedy = f'Give a vehicle file whose [controller] has law = "{law}" and its parameters'
    raise InputError(why, field="--law", value=law, remedy=remedy)
