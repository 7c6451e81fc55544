"""What differs from float to float: trim, hull, drag, pump, mass, and the water it is in.

For Sobol indices floats are drawn by a design of their own. Which input, or group of correlated
ones, does the variance of an output come from? The first-order index is the share that goes when
the input is known, the total index the share that stays when all the others are (Saltelli et al.,
Comput. Phys. Commun. 181, 2010, 259). The noise of the sensors is an input like the others: it is
drawn anew for each float.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.physics.arrays import Array
from swimbladder.sim.engine.rodas.records import made
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle.spread import INPUTS, Spread

_CUT = 3.0  # sigma; a share of -1 or a drag of 0 is no float


class Drawn(IntEnum):
    """What is drawn for a float."""

    TRIM = 0  # m3, more neutral volume
    PSI = 1  # m3/m, more of it per metre
    DRAG = 2  # -, factor
    PUMP = 3  # -, factor
    MASS = 4  # -, factor
    CAST = 5  # which water
    COUNT = 6


def draw(spread: Spread, *, seed: int, number: int, casts: int) -> Array:
    """Return what float `number` of a seed is like: of `Drawn`; the same in every campaign."""
    random = np.random.default_rng([seed, number])
    z = random.standard_normal(4)
    cast = float(random.integers(casts))
    return drawn_of(spread, np.append(z, random.standard_normal()), cast)


def drawn_of(spread: Spread, z: Array, cast: float) -> Array:
    """Return a float of standard normal numbers z [inputs] and its water: of `Drawn`."""
    if spread.correlation:
        values, vectors = np.linalg.eigh(spread.matrix)
        z = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T @ z
    middle = np.array([0.0, 0.0, 1.0, 1.0, 1.0])  # what is added, and factors
    wide = np.array([getattr(spread, name) for name in INPUTS])
    return np.append(middle + wide * np.clip(z, -_CUT, _CUT), cast)


def varied(plan: Plan, drawn: Array) -> Plan:
    """Return a plan for a float that differs so; the table is shared, not copied."""
    given = made(plan.given.dtype, plan.given)
    given["trim"] += drawn[Drawn.TRIM]
    given["give"] += drawn[Drawn.PSI]
    given["delivery"] *= drawn[Drawn.PUMP]
    given["mass"] *= drawn[Drawn.MASS]
    given["a_s"] /= drawn[Drawn.MASS]
    for place in ("d_l", "d_b", "d_0", "d_t"):
        given[place] *= drawn[Drawn.DRAG] / drawn[Drawn.MASS]
    return replace(plan, given=given)


_FEWEST = 16  # rows
_RESAMPLES = 999
_CAST, _NOISE = "cast", "sensor noise"


@dataclass(frozen=True)
class Design:
    """Floats in rows of 2 + groups: of matrix A, of B, and of A with one group's inputs from B.

    rows: a power of 2.
    """

    spread: Spread
    groups: tuple[tuple[str, ...], ...]
    rows: int
    casts: int
    seed: int

    @classmethod
    def of(cls, spread: Spread, *, casts: int, noisy: bool, seed: int, floats: int) -> Design:
        """Return the largest design of at most so many floats; raises InputError for too few."""
        groups: list[tuple[str, ...]] = [*spread.groups]
        groups += [(_CAST,)] * (casts > 1) + [(_NOISE,)] * noisy
        width = 2 + len(groups)
        if not groups:
            what = "nothing spreads, so that nothing can be sensitive to it"
            remedy = "Give a spread, like `trim='5 cm3'`"
            raise InputError(what, field="sensitivity", remedy=remedy)
        if floats < _FEWEST * width:
            what = f"too few floats for the indices of {len(groups)} inputs"
            remedy = f"Give {_FEWEST * width} at least; thousands say more"
            raise InputError(what, field="floats", value=floats, remedy=remedy)
        rows = 1 << ((floats // width).bit_length() - 1)
        return cls(spread, tuple(groups), rows, casts, seed)

    @property
    def width(self) -> int:
        """Floats of a row."""
        return 2 + len(self.groups)

    @property
    def floats(self) -> int:
        """How many floats it takes."""
        return self.rows * self.width

    @property
    def names(self) -> list[str]:
        """What the groups are called."""
        return [" and ".join(group) for group in self.groups]

    @cached_property
    def _points(self) -> Array:
        """Quasi-random points in the unit cube [rows, 2, inputs and cast]."""
        from scipy.stats import qmc

        size = len(INPUTS) + 1
        sobol = qmc.Sobol(2 * size, rng=np.random.default_rng([self.seed, self.rows]))
        return np.asarray(sobol.random(self.rows)).reshape(self.rows, 2, size)

    def drawn(self, number: int) -> tuple[Array, int]:
        """Return what float `number` is like: of `draw.Drawn`, and the seed of its noise."""
        from scipy.special import ndtri

        row, block = divmod(number, self.width)
        chosen = self.groups[block - 2] if block >= 2 else ()
        inputs = (*INPUTS, _CAST)
        other = np.array([block == 1 or name in chosen for name in inputs])
        u = np.where(other, self._points[row, 1], self._points[row, 0])
        noise = 2 * row + (block == 1 or _NOISE in chosen)
        cast = float(min(int(u[-1] * self.casts), self.casts - 1))
        return drawn_of(self.spread, ndtri(np.clip(u[:-1], 1e-12, 1.0 - 1e-12)), cast), noise


class Index(NamedTuple):
    """Indices of an output for a group of inputs, with intervals of 95 %."""

    first: float
    first_ci95: tuple[float, float]
    total: float
    total_ci95: tuple[float, float]


def indices(values: Array, *, seed: int = 1) -> list[Index]:
    """Return the indices of an output for each group; its values are [rows, 2 + groups], finite.

    Intervals by a bootstrap over the rows, its 2.5 and 97.5 percentiles.
    """
    from scipy.stats import bootstrap, sobol_indices

    def both(chosen: NDArray[np.int64]) -> Array:
        part = values[chosen]
        # twice the same output: with one alone SciPy drops an axis too many for a single input
        pair: Any = {
            "f_A": np.tile(part[:, 0], (2, 1)),
            "f_B": np.tile(part[:, 1], (2, 1)),
            "f_AB": np.repeat(part[:, None, 2:].T, 2, axis=1),
        }
        found = sobol_indices(func=pair, n=len(part))
        orders = (found.first_order, found.total_order)
        return np.array([np.reshape(order, (2, -1))[0] for order in orders])

    rows = np.arange(len(values))
    how: dict[str, Any] = dict(n_resamples=_RESAMPLES, vectorized=False, method="percentile")
    random = np.random.default_rng(seed)
    spread = bootstrap((rows,), both, confidence_level=0.95, rng=random, **how)
    low, high = spread.confidence_interval
    (first, total), ends = both(rows).tolist(), np.stack((low, high), axis=-1).tolist()
    firsts, totals = ([tuple(pair) for pair in of_order] for of_order in ends)
    return [Index(*index) for index in zip(first, firsts, total, totals, strict=True)]
