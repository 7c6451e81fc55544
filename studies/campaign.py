"""One simulated campaign through `identify`, and what came of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from time import perf_counter
from typing import Any

import numpy as np

from studies.bound import bounds
from studies.scenarios import DENSITY, K_B, NEUTRAL_STD, Campaign, Kept, Scenario, draw
from studies.summary import Z95
from studies.truth import Array
from swimbladder.errors import NoAnswerError
from swimbladder.estimation.motion import Prior, identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from swimbladder.vehicle import Drag, IdentifiedMotion, PhysicalMotion, Vehicle

__all__ = ["arguments", "logs", "outcome", "vehicle"]
_DISPLACED = 0.75  # of the mass that is accelerated: the rest is water that moves along


def outcome(scenario: Scenario, *, seed: int, index: int, profiles: bool = False) -> dict[str, Any]:
    """Return what `identify` says of the campaign of this number, beside the truth.

    Of each parameter: truth, value, low and high end of the 95 % interval, and the least standard
    deviation that is possible, as a share of the truth. distance: of the truth from the values, by
    the intervals and their correlation; its square is chi-squared where these are right.
    """
    campaign = draw(scenario, seed=seed, index=index)
    least = bounds(
        campaign.body,
        campaign.motor,
        campaign.experiments,
        campaign.noise,
        scenario.names,
        {"neutral_error": NEUTRAL_STD, "psi": scenario.psi_std * abs(campaign.truth["psi"])},
    )
    found: dict[str, Any] = {"scenario": scenario.name, "index": index, "parameters": {}}
    begin = perf_counter()
    try:
        answer = identify(
            logs(campaign.kept),
            vehicle(scenario, campaign),
            **arguments(scenario, campaign),
            profiles=profiles,
        )
    except NoAnswerError as error:
        return {**found, "identified": False, "why": str(error)}
    found |= {"seconds": perf_counter() - begin, "identified": answer.identified, "why": ""}
    if not answer.identified:
        found["why"] = "; ".join(f.sentence for f in answer.findings if f.severity == "no")
    for name in scenario.names:
        estimate = answer.parameters[name]
        found["parameters"][name] = {
            "truth": campaign.truth[name],
            "value": estimate.value,
            "low": estimate.ci95[0],
            "high": estimate.ci95[1],
            "bound": least[name] / (abs(campaign.truth["psi"]) if name == "psi" else 1.0),
        }
    found["distance"] = _distance(scenario, found["parameters"], answer.correlation)
    return found


def _distance(
    scenario: Scenario, parameters: Mapping[str, Mapping[str, float]], correlation: Array
) -> float:
    """Return the distance of Mahalanobis of the truth from the values."""
    off = []
    for name, p in parameters.items():
        scaled = np.log if scenario.logarithmic(name) else float
        half = 0.5 * (scaled(p["high"]) - scaled(p["low"])) / Z95
        off.append((scaled(p["value"]) - scaled(p["truth"])) / half)
    return math.sqrt(float(np.array(off) @ np.linalg.solve(correlation, np.array(off))))


def arguments(scenario: Scenario, campaign: Campaign) -> dict[str, Any]:
    """Return what `identify` is told: what is free, what is known of psi."""
    chosen: dict[str, Any] = {
        "free": scenario.names,
        "drag": scenario.drag,
        "neutral_std": NEUTRAL_STD,
        "drift_std": 0.0,  # as the campaigns are drawn, and as the bound has it
        "delay_std": 0.0,
        "choices": False,
    }
    psi = campaign.guess["psi"]
    if scenario.psi_std == 0.0:
        chosen["fixed"] = {"psi": campaign.truth["psi"]}
    elif math.isfinite(scenario.psi_std):
        known = scenario.psi_std * abs(campaign.truth["psi"])
        chosen["priors"] = {"psi": Prior(psi, known)}
    return chosen


def logs(kept: tuple[Kept, ...]) -> list[Log]:
    """Return the records as logs; the zero of their volume is arbitrary."""
    return [
        Log(
            source=f"experiment {j}",
            time=record.time,
            depth=record.depth,
            volume=record.volume + 1e-4,
            line=np.arange(len(record.time)) + 2,
        )
        for j, record in enumerate(kept, start=1)
    ]


def vehicle(scenario: Scenario, campaign: Campaign) -> Vehicle:
    """Return the vehicle that the experimenter believes to have, its hull measured and weighed."""
    guess, truth = campaign.guess, campaign.truth
    paper = load_vehicle("feup-em")
    mass = truth["mass"] if "mass" in truth else truth["T2"] * K_B / truth["K2"]
    dry = _DISPLACED * mass  # neutral in the pool
    motion: IdentifiedMotion | PhysicalMotion
    if scenario.drag == "linear":
        motion = IdentifiedMotion(K2=guess["K2"], T2=guess["T2"])
    else:
        k_dl = K_B / guess["K2"] if scenario.drag == "blended" else 0.0
        along = (guess["T2"] * k_dl if k_dl else guess["mass"]) - dry
        drag = Drag(law=scenario.drag, k_dl=k_dl, k_dt=guess["drag_quadratic"])
        motion = PhysicalMotion(dry_mass=dry, added_mass=max(along, 0.0), drag=drag)
    update = {"psi": guess["psi"]}
    if scenario.random:  # of another mass than the paper's: it displaces less than is accelerated
        update["displaced_volume"] = dry / DENSITY
    hull = paper.hull.model_copy(update=update)
    return paper.model_copy(update={"motion": motion, "hull": hull})
