"""Messages on dives that differ from each other, and on weakly determined parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from swimbladder.estimation.motion.deep_dive import DeepDive
from swimbladder.estimation.motion.deep_fit import DeepFit
from swimbladder.estimation.motion.deep_model import DEEP

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
    near: list[str] = []
    off: list[str] = []
    apart: list[str] = []
    for name in weak:
        prior = fit.priors[name]
        if fit.identified_singly(name):
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
            "Not better known than by the prior, though the joint fit differs from it: "
            f"{', '.join(off)}."
        )
    if apart:
        found.append(
            "Identified by the random effects ('random_effects' in deep.json), not by the joint "
            f"fit: {', '.join(apart)}."
        )
    return found


def differences(fit: DeepFit, dives: Sequence[DeepDive]) -> list[str]:
    """Say how far dives differ, and what of that the intervals have."""
    kept = effects_json(fit)
    if kept is None:
        seldom = sum(int(np.sum(np.diff(dive.time) > _SELDOM)) for dive in dives)
        late = (
            f" {seldom} sample{'s come' if seldom > 1 else ' comes'} more than half an hour after "
            "the one before; the model alone covers the time between."
            if seldom
            else ""
        )
        return [
            "The intervals are of this dive: the variance between dives is not identifiable from "
            f"one.{late} Nor can one dive distinguish an error of the cast from the hull: "
            "compressibility, stiffening and thermal_expansion absorb it. Give several dives "
            "with casts of their own, or what you know of the hull (--prior)."
        ]
    found = []
    if fit.tempering < _CONTRADICT:
        found.append(
            f"The dives are overdispersed: {fit.tempering**-0.5:.2g} times farther apart than "
            "their intervals imply. Something differs between them that has no parameter."
        )
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
        found.append(
            "The joint fit of all dives differs from the random effects: "
            f"{named}. It predicts dives best; the intervals include the difference."
        )
    if len(dives) == 2:
        found.append(
            "Two dives hardly determine the variance between dives: it is dominated by its prior, "
            "a third of the parameters' priors. Give several dives."
        )
    return found
