"""One law on one scenario: many runs, each with noise of its own, and what came of them.

What swell does to the depth that a drifting vehicle reads is by linear wave theory. A body as light
as the water it displaces, and small against the waves, is moved by them as that water is: the
pressure gradient drives its mass and its added mass alike, so that against the water it keeps the
speed it had, and drag sees no waves. The pressure of water that goes its own way does not change
(D'Asaro, *J. Atmos. Oceanic Technol.* 32, 2015, "Surface wave measurements from subsurface
floats"). What a sensor reads of the waves is then only what the hull's length leaves: the hull goes
with the mean of the water along it, the sensor sits at one end::

    reading - depth in the water = sum a cos(w t + f) [exp(-k z) - exp(-k z_c) sinh(k L/2)/(k L/2)]

w^2 = g k (deep water; Dean and Dalrymple, *Water Wave Mechanics for Engineers and Scientists*,
1991, ch. 3 and 4), z the depth of the sensor, z_c that of the hull's middle, L its length. Depths
in swell are depths in the water: below the surface that goes with it.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.law_comparison.contenders import BAND, Contender, Placed, Swell
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning import trial
from swimbladder.errors import NoAnswerError
from swimbladder.physics.buoyancy_engine import check_power_known, winding
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.block import schedule
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]


def wavenumber(period: float, g: float) -> float:
    """Return the wave number k [1/m] of a wave in deep water: w^2 = g k."""
    return (2.0 * math.pi / period) ** 2 / g


def amplitude(swell: Swell) -> float:
    """Return the amplitude of each of the waves [m]: sixteen times the variance is the height^2."""
    return swell.height * math.sqrt(2.0 / (16.0 * len(swell.periods)))


def depth_error(
    swell: Swell, vehicle: Vehicle, time: Array, drawn: trial.Drawn, *, depth: float
) -> Array:
    """Return what the sensor reads beyond the depth in the water [samples, runs] in m.

    time [s, samples]; depth [m]: of the sensor, about which the vehicle is held. The phases of the
    waves are each run's own.
    """
    g, hull = vehicle.water.gravity, vehicle.hull
    middle = depth - hull.emergence_depth + 0.5 * hull.height
    size = (drawn.runs, len(swell.periods))
    phases = np.random.default_rng([drawn.seed, 2]).uniform(0.0, 2.0 * math.pi, size)
    found: Array = np.zeros((len(time), drawn.runs))
    for n, period in enumerate(swell.periods):
        k = wavenumber(period, g)
        half = 0.5 * k * hull.height
        mean = math.exp(-k * middle) * math.sinh(half) / half
        read = amplitude(swell) * (math.exp(-k * depth) - mean)
        found += read * np.cos((2.0 * math.pi / period) * time[:, None] + phases[None, :, n])
    return found


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

    drawn: how many, in which water, and from which region where the scenario draws them. Every law
    meets the same noise, waves, drift and vehicles: those of the seed. Of a float `starts` are all
    runs of its drive.
    """
    s, h, column = placed.scenario, who.sample_time, drawn.column
    medium = medium_of(vehicle, column, reach=max(placed.start, placed.target))
    given: dict[str, Any] = {"vary": {}}
    runs, seed = drawn.runs, drawn.seed
    if s.drawn:
        assert drawn.region is not None
        given["vary"] = trial.draw(drawn.region, runs=runs, seed=seed, medium=medium)
    if vehicle.voltage_driven:
        given["vary"]["supply"] = s.supply * plant(vehicle).supply
    if s.swell is not None:
        time = h * np.arange(schedule([0.0], placed.duration, h).ticks + 1, dtype=np.float64)
        given["depth_error"] = depth_error(s.swell, vehicle, time, drawn, depth=placed.target)
    if s.drift > 0.0:
        given["neutral_change"] = trial.random_walk(s.drift, placed.duration, drawn, sample_time=h)
    pumped = vehicle.command == "volume change"
    if not pumped:  # neutral is otherwise what its stepper makes of it
        given["start_volume"] = medium.neutral_volume(placed.start)
    flown = trial.fly(
        vehicle,
        BoundLaw(who.law, who.parameters, h),
        target=placed.target,
        duration=placed.duration,
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
    found = found._replace(lost=np.maximum(found.lost, np.nanmax(depth, axis=0) > rating))
    if pumped:
        settle = trial.arrivals(time, ~(np.abs(depth - placed.target) <= BAND)) - h
        starts, turns = flown.drive_runs / float(time[-1]), np.zeros(runs)
        found = found._replace(settle=np.maximum(settle, 0.0), starts=starts, turns=turns)
    kept = time <= (placed.duration if placed.is_step else _SHOWN)
    return found, time[kept], depth[kept, 0]
