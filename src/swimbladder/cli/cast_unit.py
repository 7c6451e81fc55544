"""Whether a cast that goes so deep may be in another unit of pressure than it is taken to be in.

Physics tells a wrong unit at times, and readers refuse it then. Mostly it does not: water that is
cold at 200 m is as real as water that is cold at 2000. What the vehicle is for tells more.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from swimbladder.cli.common import console
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.units import unit_factor

if TYPE_CHECKING:
    from swimbladder.seawater import Cast

__all__ = ["doubted_unit"]

_UNITS = ("bar", "MPa", "kPa", "mbar")  # a power of ten off dbar: others are off by little
_NEAR = (0.75, 1.25)  # of the rating, where a cast for a vehicle ends
_BEYOND = 4.0  # times the depth asked for: as deep as a cast for it goes, where there is no rating
_SHALLOW = 0.25  # of the rating: less is no cast for the vehicle
_SHOWN = 10.0  # m below which a depth is shown with a decimal


@contextmanager
def doubted_unit(casts: list[Cast], asked: float, rating: float | None) -> Iterator[None]:
    """Warn on stderr of casts that would fit the vehicle in another unit of pressure.

    asked: the deepest place [m] that is asked for. An error from inside about a cast that ends
    above it says so too.
    """
    doubts = [text for cast in casts if (text := _doubt(cast, asked, rating))]
    if not doubts:
        yield
        return
    try:
        yield
    except NoAnswerError as error:
        raise NoAnswerError(". ".join([str(error).rstrip("."), *doubts])) from None
    except InputError as error:
        raise type(error)(
            error.what, file=error.file, line=error.line, field=error.field, value=error.value,
            unit=error.unit, remedy=". ".join([(error.remedy or "").rstrip("."), *doubts]),
        ) from None  # fmt: skip
    for text in doubts:
        console.print(f"warning: {text}", soft_wrap=True, markup=False)


def _doubt(cast: Cast, asked: float, rating: float | None) -> str | None:
    """Return what is said of a cast whose end fits in another unit; None where there is none."""
    import gsw

    if cast.pressure_column is None:
        return None

    def down(unit: str) -> float:
        return -float(gsw.z_from_p(cast.pressure[-1] * unit_factor(unit, "dbar"), cast.latitude))

    end = down("dbar")
    most = _BEYOND * asked if rating is None else max(_NEAR[1] * rating, asked)
    least = asked
    if rating is not None and end > most:  # in kPa it may even end above what is asked for
        least = min(asked, _SHALLOW * rating)
    elif rating is not None and end >= asked:  # it does; only a cast for this vehicle is a doubt
        least = max(asked, _NEAR[0] * rating)
    if least <= end <= most:
        return None
    fits = {unit: depth for unit in _UNITS if least <= (depth := down(unit)) <= most}
    if not fits:
        return None
    others = " or ".join(f"{_metres(depth)} if it is in {unit}" for unit, depth in fits.items())
    rated = "" if rating is None else f", the vehicle is rated for {rating:g} m"
    said = " or ".join(f'"pressure_dbar={cast.pressure_column}@{unit}"' for unit in (*fits, "dbar"))
    return (
        f"{cast.name or 'the cast'} ends at {_metres(end)} if its pressure is in dbar, at {others}"
        f"{rated}: say which, with --column {said}"
    )


def _metres(depth: float) -> str:
    return f"{depth:.1f} m" if depth < _SHOWN else f"{depth:.0f} m"
