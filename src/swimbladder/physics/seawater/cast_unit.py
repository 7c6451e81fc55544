"""Whether a cast that goes so deep may be in another unit of pressure than it is taken to be in.

Physics detects a wrong unit at times, and readers refuse it then. Mostly it does not: water that is
cold at 200 m is as real as water that is cold at 2000. What the vehicle is for says more, and
where it speaks for another unit the file has to say which, in a header at least: a vehicle
ballasted for the wrong water is lost.
"""

from swimbladder.errors import InputError, Parameter, column_as
from swimbladder.physics.seawater.cast import Cast
from swimbladder.units import unit_factor

_LARGER, _SMALLER = ("bar", "MPa"), ("kPa", "mbar", "psi")
_NEAR = (0.75, 1.25)  # of the rating, where a cast for a vehicle ends
_DEEPER = 2.2  # of the rating: deep casts are taken for shallower vehicles too, 2000 m for 1000
_BEYOND = 4.0  # times the depth asked for: as deep as a cast for it goes, where there is no rating
_SHALLOW = 0.25  # of the rating: less is no cast for the vehicle
_FAR_ABOVE = 0.5  # of the rating: a cast that ends above it may be in another unit
_SHOWN = 10.0  # m below which a depth is shown with a decimal


def check_cast_unit(cast: Cast, asked: float | None, rating: float | None) -> str:
    """Raise InputError for a cast whose file states no unit and that fits the vehicle in another.

    Where a header states dbar, return what is to be warned of; "" where nothing is.
    asked: the deepest place [m] that is asked for, none: near the rating. rating [m], none: not
    known.
    """
    if asked is None:
        asked = 0.0 if rating is None else _NEAR[0] * rating
    others = _others(cast, asked, rating)
    if not others:
        return ""
    name = cast.pressure_column
    fits = " or ".join(f"{_metres(depth)} if it is in {unit}" for unit, depth in others.items())
    rated = "" if rating is None else f"; the vehicle is rated for {rating:g} m"
    said = " or ".join(column_as("pressure_dbar", f"{name}@{unit}") for unit in (*others, "dbar"))
    ends = f"the cast ends at {_metres(_down(cast, 'dbar'))} if it is in dbar, at {fits}{rated}"
    remedy = f"Say which, with {said}"
    if not cast.unit_named:
        what = f"the column {name!r} states no unit: {ends}"
        raise InputError(what, file=cast.name or None, field="pressure_dbar", remedy=remedy)
    return f"{cast.name}: the column {name!r} is taken at its word: {ends}. {remedy}"


def above_rating(name: str, end: float, rating: float | None, asked: str) -> list[str]:
    """Return what is said of a cast that ends above the rating [m] though no depth was asked for.

    asked: the field that asks for a depth. Raises InputError where it ends far above.
    """
    if rating is None:
        return []
    if end < _FAR_ABOVE * rating:
        what = f"it ends at {end:.0f} m, and the vehicle is rated for {rating:g} m"
        bar = column_as("pressure_dbar", "NAME@bar")
        remedy = "Do its rows below lack a temperature or salinity, or is its pressure in bar, not "
        remedy += f"dbar? Then map it with {bar}. If not, say how deep it is to go: "
        remedy += f"`{asked}='{end:.0f} m'`"
        raise InputError(what, file=name, field=Parameter("cast"), remedy=remedy)
    # the grid of a cast that was taken down to the rating ends within a metre of it
    if end >= rating - 1.0:
        return []
    return [
        f"{name} ends at {end:.0f} m, the vehicle is rated for {rating:g} m: nothing is said of "
        "the water below"
    ]


def _others(cast: Cast, asked: float, rating: float | None) -> dict[str, float]:
    """Return the units in which a cast would fit the vehicle better, with the depth [m] of its end.

    None where the user or physics determines the unit, or the cast fits in dbar.
    """
    if cast.pressure_column is None:
        return {}
    end = _down(cast, "dbar")
    most = _BEYOND * asked if rating is None else max(_NEAR[1] * rating, asked)
    least = asked
    if rating is not None and end > most:  # in kPa it may even end above what is asked for
        least = min(asked, _SHALLOW * rating)
    elif rating is not None and end >= asked:  # it does; only a cast for this vehicle is ambiguous
        least = max(asked, _NEAR[0] * rating)
    if least <= end <= most:
        return {}
    deeper = most
    if rating is not None and cast.unit_named:  # believed unless another unit fits exactly
        least = max(least, _NEAR[0] * rating)
    elif rating is not None:
        deeper = max(_DEEPER * rating, asked)
    limits = dict.fromkeys(_LARGER, deeper) | dict.fromkeys(_SMALLER, most)
    if cast.unit_named:  # who writes dbar is believed where the other unit is off by little
        del limits["psi"]
    ends = {unit: _down(cast, unit) for unit in limits}
    return {unit: depth for unit, depth in ends.items() if least <= depth <= limits[unit]}


def _down(cast: Cast, unit: str) -> float:
    """Return the depth [m] at which a cast ends if its numbers are in a unit of pressure."""
    import gsw

    return -float(gsw.z_from_p(cast.pressure[-1] * unit_factor(unit, "dbar"), cast.latitude))


def _metres(depth: float) -> str:
    return f"{depth:.1f} m" if depth < _SHOWN else f"{depth:.0f} m"
