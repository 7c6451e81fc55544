"""Each deep dive held against the noise: whether one set of parameters tells it at all.

A fit to dives that do not belong together has narrow intervals as any other. Where a dive's book of
volumes, or its pressures from look to look, are off by many times what sensors, moving water, the
cast's error and wandering volumes make of them, it is not told, and neither are the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.estimation.motion.deep_fit import FACTOR, NOISES, DeepFit, balance
from swimbladder.estimation.motion.deep_model import Body, cast_volume, drag_volume, run_volumes
from swimbladder.estimation.motion.deep_path import Noise
from swimbladder.estimation.motion.deep_water import displaced_variance

__all__ = ["BEYOND", "MANY", "Held", "doubted", "doubts", "held", "restless"]

Array = NDArray[np.float64]

# Of `Held`, and of how far dives are apart over what they say. Simulated dives of
# `studies.deep_calibration` have 1.1 at most, and six real dives of `studies.deep_dives` together
# 2.1; two made-up dives whose valve let in a tenth more than that of two others 2.8, which widens
# the intervals. Real dives of several seasons with a cast of one, simulated dives of several
# vehicles, and made-up ones with valves of 0.9 and 1.5 have 4.8 to 30.
MANY, BEYOND = 2.5, 4.0
_MEDIAN = float(ndtri(0.75))  # of the size of a normal number, in its deviations


class Held(NamedTuple):
    """By how many times the noise a dive is off, 1 where all is as it should be; by the median.

    apart: how far it is by itself from what fits all, in its deviations.
    """

    book: float
    speeds: float
    apart: float

    @property
    def most(self) -> float:
        """The larger of book and speeds."""
        return max(self.book, self.speeds)


def held(body: Body, fit: DeepFit, k: int, dive: DeepDive) -> Held:
    """Return how far the book and the speeds of dive `k` of a fit are off."""
    off = balance(body, fit.values, float(fit.starts[k]), dive)
    return Held(
        book=_times(off / _book_noise(body, fit, dive)) if len(off) else 0.0,
        speeds=_times(fit.innovations[k]),
        apart=fit.apart[k],
    )


def _times(ratio: Array) -> float:
    return float(np.median(np.abs(ratio))) / _MEDIAN


def _book_noise(body: Body, fit: DeepFit, dive: DeepDive) -> Array:
    """Return what a dive's book may be off by at each piece [m3] [n], 1 sigma.

    Noise counts for what is known of it before, times its factor, at most: a fit that finds no way
    to tell a dive takes all for noise.
    """
    noise = Noise(*(
        min(found, typical * float(np.exp(width)))
        for found, typical, width in zip(fit.noise, NOISES, FACTOR, strict=True)
    ))  # fmt: skip
    p = dive.pieces
    per_speed = 2.0 * np.abs(
        drag_volume(fit.values, p.speed, p.density, dive.gravity) / _no_zero(p.speed)
    )
    measured = np.sqrt(2.0) * noise.pressure / (p.density * dive.gravity * p.duration)
    layers = np.interp(p.pressure, dive.water_pressure, dive.water_layers)
    moved = displaced_variance(noise.water**2, noise.lasts)
    variance = per_speed**2 * (noise.water**2 + measured**2)
    variance += noise.drift**2 * p.elapsed
    variance += noise.runs**2 * (p.before @ run_volumes(fit.values, dive) ** 2)
    variance += layers**2 * moved + cast_volume(body, fit.priors, layers) ** 2
    return np.asarray(np.sqrt(variance))


def _no_zero(speed: Array) -> Array:
    return np.where(speed == 0.0, np.finfo(float).tiny, speed)


def doubted(found: Sequence[Held], worth: float) -> bool:
    """Whether dives are off, or apart, beyond doubt, so that parameters and intervals are nothing.

    worth: share of what they say that counts, by how far they are apart.
    """
    return any(one.most > BEYOND for one in found) or worth < BEYOND**-2


def doubts(
    names: Sequence[str], found: Sequence[Held], books: Sequence[float], worth: float
) -> list[str]:
    """Say which dives are off by many times the noise; books: rms of each [m3]."""
    doubt = doubted(found, worth)
    wrong = [one.most > MANY for one in found]
    if doubt and not any(wrong):  # what they say by themselves tells which
        farthest = max(one.apart for one in found)
        wrong = [one.apart > min(BEYOND, 0.999 * farthest) for one in found]
    if not any(wrong):
        return []
    which = "; ".join(
        f"{name} (book off by {1e6 * book:.2g} mL rms, {one.book:.2g} times the noise; pressures "
        f"from look to look {one.speeds:.2g} times; by itself its parameters would be elsewhere by "
        f"{one.apart:.2g} deviations)"
        for name, one, book, off in zip(names, found, books, wrong, strict=True)
        if off
    )
    if not doubt:
        return [
            f"Off by many times the noise: {which}. Something in it has no parameter: see how the "
            "parameters differ without it."
        ]
    return [
        f"Not identified: one set of parameters does not tell these dives. Too far off: {which}. "
        "The likely reason is a cast of another season or place, or a log of another float: give "
        "each dive a cast of its own (--cast once for each), or leave it out. The values are no "
        "parameters of the vehicle, and intervals are not given."
    ]


def restless(noise: Noise) -> list[str]:
    """Say where the water would have to move more than is known of it before."""
    if noise.water <= NOISES.water * np.exp(FACTOR.water):
        return []
    return [
        f"The dives are told only by water that moves by {1e3 * noise.water:.0f} mm/s, where "
        f"{1e3 * NOISES.water:.0f} mm/s are usual. If the sea was not that rough below, the cast "
        "is of another season or place, or a column of the log is not what it is taken for."
    ]
