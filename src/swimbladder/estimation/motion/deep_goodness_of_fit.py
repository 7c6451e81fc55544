"""Goodness of fit of each deep dive: whether one set of parameters describes all of them.

A fit to dives that do not belong together has narrow intervals as any other. Where a dive's volume
balance, or its pressures from sample to sample, are off by many times what sensors, moving water,
the cast's error and drifting volumes explain, the parameters do not describe it and are not
identified.
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

Array = NDArray[np.float64]

# Of `Misfit`, and of how far dives are apart over what they say. Simulated dives of
# `studies.deep_calibration` have 1.1 at most, and six real dives of `studies.deep_dives` together
# 2.1; two made-up dives whose valve let in a tenth more than that of two others 2.8, which widens
# the intervals. Real dives of several seasons with a cast of one, simulated dives of several
# vehicles, and made-up ones with valves of 0.9 and 1.5 have 4.8 to 30.
MANY, BEYOND = 2.5, 4.0
_MEDIAN = float(ndtri(0.75))  # of the size of a normal number, in its deviations


class Misfit(NamedTuple):
    """By how many times the noise a dive is off, 1 where all is as it should be; by the median.

    apart: how far it is by itself from what fits all, in its deviations.
    """

    imbalance: float
    speeds: float
    distance: float

    @property
    def most(self) -> float:
        """The larger of imbalance and speeds."""
        return max(self.imbalance, self.speeds)


def misfit_of(body: Body, fit: DeepFit, k: int, dive: DeepDive) -> Misfit:
    """Return how far volume balance and speeds of dive `k` of a fit are off."""
    off = balance(body, fit.values, float(fit.starts[k]), dive)
    return Misfit(
        imbalance=_times(off / _noise(body, fit, dive)) if len(off) else 0.0,
        speeds=_times(fit.innovations[k]),
        distance=fit.distance[k],
    )


def _times(ratio: Array) -> float:
    return float(np.median(np.abs(ratio))) / _MEDIAN


def _noise(body: Body, fit: DeepFit, dive: DeepDive) -> Array:
    """Return the expected imbalance of a dive's volumes at each piece [m3] [n], 1 sigma.

    Noise counts at most for its prior value times its factor: a fit that cannot describe a dive
    takes all for noise.
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


def inconsistent(found: Sequence[Misfit], tempering: float) -> bool:
    """Whether dives are off, or apart, by over `BEYOND`: no set of parameters describes them.

    tempering: power of their likelihood, by how far they are apart.
    """
    return any(one.most > BEYOND for one in found) or tempering < BEYOND**-2


def messages(
    names: Sequence[str], found: Sequence[Misfit], imbalances: Sequence[float], tempering: float
) -> list[str]:
    """Say which dives are off by many times the noise; imbalances: rms of each [m3]."""
    bad = inconsistent(found, tempering)
    wrong = [one.most > MANY for one in found]
    if bad and not any(wrong):  # their own estimates show which
        farthest = max(one.distance for one in found)
        wrong = [one.distance > min(BEYOND, 0.999 * farthest) for one in found]
    if not any(wrong):
        return []
    which = "; ".join(
        f"{name} (volume imbalance {1e6 * imbalance:.2g} mL rms, {one.imbalance:.2g} times the "
        f"noise; pressures from sample to sample {one.speeds:.2g} times; identified alone, its "
        f"parameters differ by {one.distance:.2g} standard deviations)"
        for name, one, imbalance, off in zip(names, found, imbalances, wrong, strict=True)
        if off
    )
    if not bad:
        return [
            f"Residuals many times the noise: {which}. The model lacks something: compare the "
            "parameters without it."
        ]
    return [
        f"Not identified: one set of parameters cannot describe these dives. Too far off: {which}. "
        "The likely reason is a cast of another season or place, or a log of another float: give "
        "each dive a cast of its own (--cast once for each), or leave it out. The values are no "
        "parameters of the vehicle, and intervals are not given."
    ]


def water_messages(noise: Noise) -> list[str]:
    """Say where the water would have to move more than is known of it before."""
    if noise.water <= NOISES.water * np.exp(FACTOR.water):
        return []
    return [
        f"The residuals need water that moves by {1e3 * noise.water:.0f} mm/s, where "
        f"{1e3 * NOISES.water:.0f} mm/s are usual. If the sea was not that rough below, the cast "
        "is of another season or place, or a column of the log is not what it is taken for."
    ]
