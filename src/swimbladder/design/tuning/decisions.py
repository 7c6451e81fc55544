"""Whether a law of volume changes holds a float: decisions over the region, and rest.

At rest such a law does nothing for small errors, since its change goes with the square of a speed:
there the hull decides. With one that gives way more than the water (psi > 0) errors grow from
decision to decision; the band in which they are caught has to be narrower than the one that the law
keeps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law
from swimbladder.control.rate import RateParameters
from swimbladder.control.records import leaves
from swimbladder.design.linear.decisions import Decision, Delivery, decision_map, decision_of
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.pump_valve import DriveRates
from swimbladder.design.tuning.region import Member, member, unit_points, unknowns
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.mission.holding import least_band
from swimbladder.vehicle import PumpAndValve, Vehicle


class Rest(NamedTuple):
    """The vehicle at rest between two decisions, worst of the region."""

    growth_time: float  # s, e-fold of a small error; inf where it does not grow
    period: float  # s, of what swings about the neutral depth; inf where nothing does
    halves: float  # s, in which a swing of the tolerance halves by its drag; inf without a swing
    band: float  # m, that is kept at least between two decisions
    tolerance: float  # m, that the law is to keep
    psi: float  # m3/m, of the hull that gives way most

    @property
    def held(self) -> bool:
        """Whether what grows is caught within the band."""
        return math.isinf(self.growth_time) or self.band <= self.tolerance


def decisions_of(law: Law, parameters: Any) -> list[Decision]:
    """Return what a law decides on each of its ways, down and up, too slow and too fast."""
    assert law.ways is not None
    found = []
    for way in law.ways(parameters):
        for down in (False,) if math.isinf(way.distance) else (True, False):
            for faster in (False, True):
                one = decision_of(law, parameters, way, down=down, faster=faster)
                found += [] if one is None else [one]
    return found


def deliveries(
    vehicle: Vehicle, one: Member, d: Decision, rates: DriveRates, k: int
) -> list[Delivery]:
    """Return how the smallest change and that from rest are delivered, by a drive that errs.

    The processor takes the drive to give what is known: its runs are as long as that says.
    """
    a = vehicle.actuator
    longest = math.inf
    if isinstance(a, PumpAndValve) and a.longest_run is not None:
        longest = a.longest_run
    rate = rates.pump[k] if d.pumps else rates.valve[k]
    start = rates.start_volume[k] if d.pumps else 0.0
    share = one.drive[0] if d.pumps else one.drive[1]
    if rate <= 0.0:
        return [Delivery(0.0, 0.0)]
    whole = (d.largest + start) / rate
    part = min(1.0, longest / whole)
    return [Delivery(share, min(start / rate, longest)), Delivery(part * share, part * whole)]


def going(vehicle: Vehicle, p: Plant, speed: float) -> Plant:
    """Return a plant with the drag of the way it goes at a speed [m/s, positive down]."""
    share = vehicle.drag.rising_ratio if speed < 0.0 else 1.0
    return p._replace(d_l=share * p.d_l, d_b=share * p.d_b, d_0=share * p.d_0, d_t=share * p.d_t)


def radius_of(vehicle: Vehicle, one: Member, d: Decision, rates: DriveRates, k: int) -> float:
    """Return the largest eigenvalue's modulus at depth k of `rates`, any change."""
    p = going(vehicle, one.plant, d.speed)
    maps = (decision_map(p, d, x) for x in deliveries(vehicle, one, d, rates, k))
    return max(spectral_radius(M) for M in maps)


def largest_radius(
    vehicle: Vehicle, law: Law, parameters: Any, members: Sequence[Member], rates: DriveRates
) -> float:
    """Return the largest eigenvalue's modulus over members of a region, ways and depths [-]."""
    depths, decisions = range(len(rates.depths)), decisions_of(law, parameters)
    every = ((one, d, k) for one in members for d in decisions for k in depths)
    return max(radius_of(vehicle, one, d, rates, k) for one, d, k in every)


def rest_of(vehicle: Vehicle, law: Law, parameters: Any, rates: DriveRates) -> Rest:
    """Return what happens at rest, with the psi of the region that gives way most."""
    a = vehicle.actuator
    shortest = a.quantum * max(*rates.pump, *rates.valve) if isinstance(a, PumpAndValve) else 0.0
    names, _ = unknowns(vehicle)
    points = np.concatenate([np.zeros((1, len(names))), unit_points(vehicle)])
    p = max((member(vehicle, s).plant for s in points), key=lambda p: p.psi)
    tolerance = float(leaves(parameters)[law.band])
    sigma = math.sqrt(p.a_b * abs(p.psi))
    hull = vehicle.hull.model_copy(update={"psi": p.psi})
    band = 0.0
    if isinstance(parameters, RateParameters):
        smallest = max(parameters.volume_step, shortest)
        softest = vehicle.model_copy(update={"hull": hull})
        band = least_band(softest, p.psi, parameters, smallest)[0]
    if p.psi > 0.0:
        return Rest(1.0 / sigma, math.inf, math.inf, band, tolerance, p.psi)
    if p.psi == 0.0:
        return Rest(math.inf, math.inf, math.inf, band, tolerance, p.psi)
    period = 2.0 * math.pi / sigma
    return Rest(math.inf, period, _halves(p, sigma, tolerance), band, tolerance, p.psi)


def _halves(p: Plant, omega: float, amplitude: float) -> float:
    """Return the time in which a swing halves by its drag [s].

    By the work of the drag over a period A' = -(b A + q A^2), b = d/2 of its linear part and q = 4
    d_t omega/(3 pi) of its quadratic one.
    """
    b = 0.5 * (p.d_l if math.isinf(p.epsilon) else p.d_b)
    q = 4.0 / (3.0 * math.pi) * p.d_t * omega
    if b <= 0.0:
        return 1.0 / (q * amplitude) if q > 0.0 else math.inf
    return math.log((2.0 * b + q * amplitude) / (b + q * amplitude)) / b
