"""The package itself, through its public functions, with all that they keep and check."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.mission import BOTTOM, Array, Fleet, Mission
from swimbladder.sim.closed_loop import StopReason, simulate, simulate_ensemble
from swimbladder.vehicle import Vehicle

__all__ = ["depth", "depths", "summaries"]


def depth(mission: Mission, fleet: Fleet, lane: int) -> Array:
    """Return the depth of one vehicle at the samples; keeps the whole trajectory and the balance.

    Without the checks of the question before it is simulated, as the peers have none.
    """
    found = simulate(
        _vehicle(mission, fleet, lane),
        setpoints=mission.setpoints,
        duration=mission.duration,
        start_depth=float(fleet.start_depth[lane]),
        bottom_depth=BOTTOM,
        checked=False,
        supervised=False,
    )
    if found.stop is not StopReason.FINISHED:
        raise ArithmeticError(found.stop.value)
    return found.depth


def depths(mission: Mission, fleet: Fleet) -> Array:
    """Return the depths [lane, sample] of a fleet."""
    return np.asarray(_ensemble(mission, fleet, 1, keep="trajectory")["depth"]).T


def summaries(mission: Mission, fleet: Fleet, threads: int = 1) -> dict[str, Array]:
    """Return the package's summaries of each vehicle."""
    found = _ensemble(mission, fleet, threads, keep="summary")
    return {"z": found["final_depth"].values}


def _ensemble(mission: Mission, fleet: Fleet, threads: int, **keep: Any) -> Any:
    found = simulate_ensemble(
        mission.vehicle,
        count=len(fleet),
        setpoints=mission.setpoints,
        duration=mission.duration,
        start_depth=fleet.start_depth,
        vary=fleet.plants,
        bottom_depth=BOTTOM,
        supervised=False,
        workers=threads,
        **keep,
    )
    if found["stop"].values.any():
        raise ArithmeticError("a vehicle of the fleet stopped before its end")
    return found


def _vehicle(mission: Mission, fleet: Fleet, lane: int) -> Vehicle:
    """Return the vehicle that has the plant of a lane."""
    p, fields = fleet.plant(lane), mission.vehicle.model_dump()
    fields["actuator"]["T1"] = p.T1
    fields["hull"]["psi"] = p.psi
    fields["motion"] |= {"K2": p.a_b / p.d_l, "T2": 1.0 / p.d_l}
    fields["stroke"] = {"minimum": p.V_min, "maximum": p.V_max}
    return Vehicle(**fields)
