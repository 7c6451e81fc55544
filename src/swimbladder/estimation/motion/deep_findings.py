"""Messages on dives that differ, on weakly determined parameters, and on the goodness of fit.

Goodness of fit is whether one set of parameters describes all dives. A fit to dives that do not
belong together has narrow intervals as any other. Where a dive's volume balance, or its pressures
from sample to sample, are off by many times what sensors, moving water, the cast's error and
drifting volumes explain, the parameters do not describe it and are not identified.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from swimbladder.estimation.estimates import sentence
from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.estimation.motion.deep_filter import displaced_variance
from swimbladder.estimation.motion.deep_fit import FACTOR, NOISES, DeepFit, balance
from swimbladder.estimation.motion.deep_model import (
    DEEP,
    Body,
    Noise,
    cast_volume,
    drag_volume,
    run_volumes,
)
from swimbladder.estimation.series import Array

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
        sentence("deep", "misfit", name=name, rms=imbalance, off=one)
        for name, one, imbalance, off in zip(names, found, imbalances, wrong, strict=True)
        if off
    )
    return [sentence("deep", "inconsistent" if bad else "lacks", which=which)]


def water_messages(noise: Noise) -> list[str]:
    """Say where the water would have to move more than is known of it before."""
    if noise.water <= NOISES.water * np.exp(FACTOR.water):
        return []
    return [sentence("deep", "rough", found=noise.water, usual=NOISES.water)]


_SELDOM = 1800.0  # s, between two samples
_CONTRADICT = 0.5  # tempering: chance leaves more, with some 50 squares
_OFF, _MOST = 1.96, 3  # deviations beyond which a parameter is named, and how many are


def effects_json(fit: DeepFit) -> dict[str, Any] | None:
    """Return the random effects of the dives, by name in SI; None for one dive."""
    found = fit.random_effects
    if found is None:
        return None
    return {
        name: {
            "value": fit.priors[name].mean + fit.priors[name].std * float(found.value[i]),
            "std": fit.priors[name].std * float(np.sqrt(found.covariance[i, i])),
            "between_std": fit.priors[name].std * float(found.spread[i]),
        }
        for i, name in enumerate(fit.names)
    }


def weakly_determined(fit: DeepFit, weak: Sequence[str]) -> list[str]:
    """Name weakly determined parameters: near the prior, away from it, per dive."""
    found: dict[str, list[str]] = {"near": [], "off": [], "apart": []}
    for name in weak:
        prior = fit.priors[name]
        near = abs(fit.values[name] - prior.mean) <= prior.std
        found["apart" if fit.identified_singly(name) else "near" if near else "off"].append(name)
    return [sentence("deep", how, names=", ".join(n)) for how, n in found.items() if n]


def differences(fit: DeepFit, dives: Sequence[DeepDive]) -> list[str]:
    """Say how far dives differ, and what of that the intervals have."""
    kept = effects_json(fit)
    if kept is None:
        seldom = sum(int(np.sum(np.diff(dive.time) > _SELDOM)) for dive in dives)
        come = f"{seldom} sample{'s come' if seldom > 1 else ' comes'}"
        late = sentence("deep", "alone", "late", seldom=come) if seldom else ""
        return [sentence("deep", "alone", late=late)]
    found = []
    if fit.tempering < _CONTRADICT:
        found.append(sentence("deep", "overdispersed", times=fit.tempering**-0.5))
    assert fit.random_effects is not None
    deviation = np.sqrt(np.diag(fit.random_effects.covariance))
    at = np.array([(fit.values[n] - fit.priors[n].mean) / fit.priors[n].std for n in fit.names])
    off = np.abs(at - fit.random_effects.value) / deviation
    far = [i for i in np.argsort(-off)[:_MOST].tolist() if off[i] > _OFF]
    if far:
        named = "; ".join(
            f"{fit.names[i]} {fit.values[fit.names[i]]:.4g} against "
            f"{kept[fit.names[i]]['value']:.4g} +- {kept[fit.names[i]]['std']:.2g} "
            f"{DEEP[fit.names[i]].unit}".rstrip()
            for i in far
        )
        found.append(sentence("deep", "differs", named=named))
    if len(dives) == 2:
        found.append(sentence("deep", "two"))
    return found
