"""What is said of dives that differ from each other, and of parameters they hardly tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.estimation.motion.deep_fit import DeepFit
from swimbladder.estimation.motion.deep_model import DEEP

__all__ = ["between_json", "differences", "hardly"]

_SELDOM = 1800.0  # s, between two looks
_CONTRADICT = 0.5  # of what dives say that counts: chance leaves more, with some 50 squares
_OFF, _MOST = 1.96, 3  # deviations beyond which a parameter is named, and how many are


def between_json(fit: DeepFit) -> dict[str, Any] | None:
    """Return what dives tell each by itself, by name in SI; None for one dive."""
    found = fit.between
    if found is None:
        return None
    return {
        name: {
            "value": fit.priors[name].mean + fit.priors[name].std * float(found.value[i]),
            "std": fit.priors[name].std * float(np.sqrt(found.covariance[i, i])),
            "differ": fit.priors[name].std * float(found.differ[i]),
        }
        for i, name in enumerate(fit.names)
    }


def hardly(fit: DeepFit, untold: Sequence[str]) -> list[str]:
    """Say what dives hardly tell, near what was known before and elsewhere."""
    near: list[str] = []
    off: list[str] = []
    apart: list[str] = []
    for name in untold:
        prior = fit.priors[name]
        if fit.told_apart(name):
            apart.append(name)
        else:
            (near if abs(fit.values[name] - prior.mean) <= prior.std else off).append(name)
    found = []
    if near:
        found.append(
            f"Dominated by the prior, hardly determined by these dives: {', '.join(near)}."
        )
    if off:
        found.append(
            "Known no better than before, though the set that fits all dives has them elsewhere: "
            f"{', '.join(off)}."
        )
    if apart:
        found.append(
            "Told by each dive by itself ('between' in deep.json), and not by the set that fits "
            f"all: {', '.join(apart)}."
        )
    return found


def differences(fit: DeepFit, dives: Sequence[DeepDive]) -> list[str]:
    """Say how far dives differ, and what of that the intervals have."""
    kept = between_json(fit)
    if kept is None:
        seldom = sum(int(np.sum(np.diff(dive.time) > _SELDOM)) for dive in dives)
        late = (
            f" {seldom} look{'s come' if seldom > 1 else ' comes'} more than half an hour after "
            "the one before, and what happened between counts as the model has it."
            if seldom
            else ""
        )
        return [
            "The intervals are of this dive: one cannot tell by how much dives of this vehicle "
            f"differ.{late} Nor does one tell a wrong cast from another hull: compressibility, "
            "stiffening and thermal_expansion take up what the cast is off by. Give several dives "
            "with casts of their own, or what you know of the hull (--prior)."
        ]
    found = []
    if fit.worth < _CONTRADICT:
        found.append(
            f"The dives are {fit.worth**-0.5:.2g} times farther apart than each says by itself: "
            "something differs between them that has no parameter."
        )
    assert fit.between is not None
    deviation = np.sqrt(np.diag(fit.between.covariance))
    at = np.array([
        (fit.values[n] - fit.priors[n].mean) / fit.priors[n].std for n in fit.names
    ])  # fmt: skip
    off = np.abs(at - fit.between.value) / deviation
    far = [i for i in np.argsort(-off)[:_MOST].tolist() if off[i] > _OFF]
    if far:
        named = "; ".join(
            f"{fit.names[i]} {fit.values[fit.names[i]]:.4g} against "
            f"{kept[fit.names[i]]['value']:.4g} +- {kept[fit.names[i]]['std']:.2g} "
            f"{DEEP[fit.names[i]].unit}".rstrip()
            for i in far
        )
        found.append(
            "The set that fits all dives is not where each by itself has its own: "
            f"{named}. It tells dives best; the intervals reach as far as the two are apart."
        )
    if len(dives) == 2:
        found.append(
            "Two dives hardly tell by how much dives differ: the intervals lean on what is usual, "
            "a third of what was known before. Give several dives."
        )
    return found
