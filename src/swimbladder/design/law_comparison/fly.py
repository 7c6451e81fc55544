"""One law on one scenario: many runs, each with noise of its own, and what came of them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.law_comparison.contenders import BAND, Contender, Placed
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning import trial
from swimbladder.errors import NoAnswerError
from swimbladder.physics.buoyancy_engine import check_power_known, winding
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.swell import depth_error
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


_SHOWN = 900.0  # s of the first run of a hold that are kept to be drawn; of a step all of it


def no_energy(vehicle: Vehicle) -> str | None:
    """Return why the electrical energy is not known; None where it is."""
    if vehicle.command == "volume change":
        try:
            check_power_known(vehicle)
        except NoAnswerError as error:
            return str(error)
        return None
    if winding(vehicle) is not None:
        return None
    if vehicle.command == "volume":
        return "nothing is known of the motor behind the positioner"
    return "R and k_T of the motor are not known"


def fly_scenario(
    vehicle: Vehicle, who: Contender, placed: Placed, drawn: trial.Drawn
) -> tuple[trial.Measured, Array, Array]:
    """Return what was measured, and time [s] and depth [m] of the first run, to be looked at.

    A run that the supervisor ends counts as lost. drawn: how many, in which water, and from which
    region where the scenario draws them. Every law meets the same noise, waves, drift and vehicles:
    those of the seed. Of a float `starts` are all
    runs of its drive.
    """
    s, h, column = placed.scenario, who.sample_time, drawn.column
    supervised = who.supervised and drawn.supervised
    pumped = vehicle.command == "volume change"
    before = trial.held_before(h) if supervised and not pumped else None
    whole = placed.duration + (before or 0.0)
    medium = medium_of(vehicle, column, reach=max(placed.start, placed.target))
    given: dict[str, Any] = {"vary": {}}
    runs, seed = drawn.runs, drawn.seed
    if s.drawn:
        assert drawn.region is not None
        given["vary"] = trial.draw(drawn.region, runs=runs, seed=seed, medium=medium)
    if vehicle.voltage_driven:
        given["vary"]["supply"] = s.supply * plant(vehicle).supply
    if s.swell is not None:
        time = trial.sample_times(whole, h)
        given["depth_error"] = depth_error(
            s.swell, vehicle, time, depth=placed.target, runs=runs, seed=seed
        )
    if s.drift > 0.0:
        given["neutral_change"] = trial.random_walk(s.drift, whole, drawn, sample_time=h)
    if not pumped:  # neutral is otherwise what its stepper makes of it
        given["start_volume"] = medium.neutral_volume(placed.start)
    flown = trial.fly(
        vehicle,
        BoundLaw(who.law, who.parameters, h),
        target=placed.target,
        duration=placed.duration,
        before=before,
        supervised=supervised,
        count=runs,
        start_depth=placed.start,
        seed=seed,
        column=column,
        books=no_energy(vehicle) is None,
        workers=1,
        **given,
    )
    time, depth = flown.time, flown.depth
    rating = math.inf if vehicle.hull.depth_limit is None else vehicle.hull.depth_limit
    found = trial.measure(flown, s.counted)
    lost = np.maximum(found.lost, np.nanmax(depth, axis=0) > rating)
    found = found._replace(lost=np.maximum(lost, found.alarms))
    if pumped:
        settle = trial.arrivals(time, ~(np.abs(depth - placed.target) <= BAND)) - h
        starts, turns = flown.drive_runs / float(time[-1]), np.zeros(runs)
        found = found._replace(settle=np.maximum(settle, 0.0), starts=starts, turns=turns)
    kept = time <= (placed.duration if placed.is_step else _SHOWN)
    return found, time[kept], depth[kept, 0]
