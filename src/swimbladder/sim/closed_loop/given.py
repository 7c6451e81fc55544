"""What an ensemble is given, each for all lanes or lane by lane, checked and as arrays."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.records import leaves
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.block import Schedule


def vary_plants(
    p: Plant, numbers: Any, vary: Mapping[str, ArrayLike], count: int
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return plants [len(Plant), count] and the law's parameters by name, each [count].

    Raises InputError for a name that neither has, or a mass or time constant that cannot be.
    """
    plants = np.repeat(np.array(p)[:, None], count, axis=1)
    values = {name: np.full(count, float(value)) for name, value in leaves(numbers).items()}
    for name, given in vary.items():
        array = spread(given, count, f"vary[{name!r}]", "")
        if name in Plant._fields and not np.isnan(getattr(p, name)):
            plants[Plant._fields.index(name)] = array
        elif name in values:
            values[name] = array
        else:
            own = [field for field in Plant._fields if not np.isnan(getattr(p, field))]
            known = (*own, *values)
            near = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                "neither the plant nor the law has such a parameter",
                field=f"vary[{name!r}]",
                value=name,
                remedy=(f"Did you mean {near[0]!r}? " if near else "")
                + f"Known: {', '.join(known)}",
            )
    for name in ("T1", "a_b", "a_s"):
        least = plants[Plant._fields.index(name)].min()
        if least <= 0.0:
            raise InputError(
                "must be above 0 in every lane", field=f"vary[{name!r}]", value=float(least)
            )
    return plants, values


def spread(given: ArrayLike, count: int, field: str, unit: str) -> NDArray[np.float64]:
    """Return a number or an array as [count]; raises InputError where it is neither."""
    array = np.asarray(given, float)
    if array.shape not in ((), (count,)):
        raise InputError(
            f"has the shape {array.shape}, not ({count},)", field=field, unit=unit or None,
            remedy="Give one number, or one for each lane",
        )  # fmt: skip
    if np.isnan(array).any():
        raise InputError("holds a value that is not a number", field=field, unit=unit or None)
    return np.broadcast_to(array, (count,)).copy()


def series(
    given: ArrayLike | None, clock: Schedule, count: int, field: str, unit: str
) -> NDArray[np.float64] | None:
    """Return what was given for every sample as [ticks + 1, count]; nothing where nothing was.

    Raises InputError for another shape, or for a value that is no finite number.
    """
    if given is None:
        return None
    array = np.asarray(given, float)
    samples = clock.ticks + 1
    if array.shape not in ((samples, count), (samples, 1)):
        raise InputError(
            f"has the shape {array.shape}, not ({samples}, {count}) or ({samples}, 1)",
            field=field, unit=unit, remedy="Give a row for each sample, both ends included",
        )  # fmt: skip
    if not np.isfinite(array).all():
        raise InputError("holds a value that is no finite number", field=field, unit=unit)
    return np.broadcast_to(array, (samples, count))


def check_starts(
    plants: NDArray[np.float64], z: NDArray[np.float64], V: NDArray[np.float64]
) -> None:
    """Raise InputError for the first lane that cannot start where it should."""
    row = Plant._fields.index
    for name, values, bad, why in (
        ("start_depth", z, z > plants[row("z_bottom")], "is below the bottom"),
        ("start_depth", z, z <= plants[row("z_air")], "is outside the water"),
        ("start_volume", V, plants[row("V_max")] < V, "is beyond the stroke's maximum"),
        ("start_volume", V, plants[row("V_min")] > V, "is beyond the stroke's minimum"),
    ):
        if bad.any():
            lane = int(np.argmax(bad))
            raise InputError(
                f"lane {lane} of {len(z)} {why}", field=name, value=float(values[lane]),
                unit="m" if values is z else "m3", remedy="Start within the water and the stroke",
            )  # fmt: skip
