"""Laws of volume changes: small errors from decision to decision, over region, depths and ways.

What `around` is for laws that are called at each sample this is for laws that are called when they
ask to be: the largest eigenvalue of the map from one decision to the next (`linear.decisions`), in
the middle of the region, at the ends of its axes, at drawn points, and from the worst of these on
by Nelder and Mead's simplex. At rest such a law does nothing for small errors, since its change
goes with the square of a speed: there the hull decides. With one that gives way more than the water
(psi > 0) errors grow from decision to decision; the band in which they are caught has to be
narrower than the one that the law keeps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from swimbladder.control.law import Law
from swimbladder.control.rate import RateParameters
from swimbladder.control.records import leaves
from swimbladder.design.linear.decisions import Decision, Delivery, decision_map, decision_of
from swimbladder.design.linear.margins import spectral_radius
from swimbladder.design.linear.pump_valve import DriveRates, drag_slope, drive_rates
from swimbladder.design.tuning.region import Member, member, unit_points, unknowns
from swimbladder.physics.dynamics import Plant, drag_per_mass
from swimbladder.sim.mission.holding import least_band
from swimbladder.vehicle import PumpAndValve, Vehicle

__all__ = [
    "Decided",
    "Rest",
    "WayFound",
    "WorstWay",
    "around_decisions",
    "decisions_of",
    "rest_of",
]

Array = NDArray[np.float64]

_STARTS = 3  # of the search
_CALLS = 60  # of a search, for each unknown


class WayFound(NamedTuple):
    """Small errors on one way, and what drives the decisions there."""

    decision: Decision
    nominal: float  # -, largest modulus of an eigenvalue, nominal vehicle, worst depth
    ratio: float  # -, eta c/c_true: of the change that would set the speed at once
    time_constant: float  # s, in which the speed follows the volume
    delivery: float  # s, that the change from rest takes where the drive is slowest


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


class WorstWay(NamedTuple):
    """A vehicle of the region on a way, at a depth."""

    shares: Mapping[str, float]  # -, over nominal values
    depth: float  # m
    way: str
    down: bool
    faster: bool

    @property
    def words(self) -> str:
        """What distinguishes it, for a person."""
        off = [f"{n} {100.0 * (x - 1.0):+.1f} %" for n, x in self.shares.items() if x == x]
        direction = "sinking" if self.down else "rising"
        size = "too fast" if self.faster else "too slow"
        return f"{', '.join(off) or 'nominal'}, {direction} {size} ({self.way}) at {self.depth:g} m"


@dataclass(frozen=True, kw_only=True)
class Decided:
    """What the maps from decision to decision say over the region."""

    radius: float  # -, largest modulus of an eigenvalue found
    worst: WorstWay
    on_grid: float  # -, before the search
    ways: tuple[WayFound, ...]
    rest: Rest
    maps: int  # on the grid
    searched: int  # maps beyond

    @property
    def stable(self) -> bool:
        """Whether small errors decay on every way, and what grows at rest is caught."""
        return self.radius < 1.0 and self.rest.held

    def sentences(self, depths: tuple[float, float]) -> tuple[str, ...]:
        """Return what a person wants to know, of `depths` from and to [m]."""
        sample = f"looked at: {self.maps} maps of the region, then {self.searched} in a search"
        if self.radius >= 1.0:
            return (
                f"UNSTABLE: with {self.worst.words} errors of the speed grow from decision to "
                f"decision, the largest eigenvalue has the modulus {self.radius:.4f}.",
                "A smaller coefficient, more time between two decisions (dead), or a law tuned for "
                "this region (swimbladder tune) would hold it.",
                *self._rest_words(),
            )
        last = max(self.ways, key=lambda way: way.time_constant)
        ratios = [way.ratio for way in self.ways]
        return (
            f"Errors of the speed decay from decision to decision from {depths[0]:g} to "
            f"{depths[1]:g} m over the region: the largest eigenvalue found has the modulus "
            f"{self.radius:.4f} ({self.worst.words}); {sample} for the worst. It is the worst that "
            "was found, not a proof over the region.",
            f"A change of the volume is {max(ratios):.2f} times what the drag takes (below 2 "
            "it would be stable if the speed followed at once); the slowest speed, "
            f"{100.0 * abs(last.decision.speed):.3g} cm/s, follows in "
            f"{last.time_constant:.3g} s, and it decides every {last.decision.period:.3g} s.",
            *self._slow_drive(),
            *self._rest_words(),
        )

    def _slow_drive(self) -> tuple[str, ...]:
        late = [way for way in self.ways if way.delivery > way.decision.samples[-2]]
        if not late:
            return ()
        worst = max(late, key=lambda way: way.delivery)
        what = "pump" if worst.decision.pumps else "valve"
        return (
            f"The {what} takes {worst.delivery:.3g} s for the change from rest to "
            f"{100.0 * abs(worst.decision.speed):.3g} cm/s, and the law samples again after "
            f"{worst.decision.samples[-2]:.3g} s: it decides before its last change is done.",
        )

    def _rest_words(self) -> tuple[str, ...]:
        r = self.rest
        if not math.isinf(r.growth_time):
            caught = (
                f"It is caught within {r.band:.3g} m, and the law keeps {r.tolerance:g} m."
                if r.held
                else f"UNSTABLE at rest: between two decisions it gets {r.band:.3g} m away, and "
                f"the law is to keep {r.tolerance:g} m."
            )
            return (
                f"At rest the hull gives way more than the water (psi up to {r.psi:.3g} m3/m over "
                f"the region): an error of the depth grows e-fold in {r.growth_time:.3g} s. "
                + caught,
            )
        if math.isinf(r.period):
            return ("At rest hull and water give way alike: nothing brings an error back.",)
        return (
            f"At rest the hull is stiffer than the water: it swings about its neutral depth every "
            f"{r.period:.4g} s, and {r.tolerance:g} m halve in {r.halves:.3g} s by its drag.",
        )

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        r = self.rest
        return {
            "largest_eigenvalue": self.radius,
            "worst_at": {**self.worst._asdict(), "shares": dict(self.worst.shares)},
            "on_grid": self.on_grid,
            "maps": self.maps,
            "maps_searched": self.searched,
            "ways": [
                {
                    "way": w.decision.way.name,
                    "speed_m_s": w.decision.speed,
                    "too_fast": w.decision.faster,
                    "largest_eigenvalue": w.nominal,
                    "coefficient_ratio": w.ratio,
                    "time_constant_s": w.time_constant,
                    "interval_s": w.decision.period,
                    "delivery_s": w.delivery,
                }
                for w in self.ways
            ],
            "rest": {
                "psi_m3_m": r.psi,
                "growth_time_s": _finite(r.growth_time),
                "period_s": _finite(r.period),
                "tolerance_halves_s": _finite(r.halves),
                "band_m": r.band,
                "tolerance_m": r.tolerance,
                "held": r.held,
            },
        }


def _finite(x: float) -> float | None:
    return x if math.isfinite(x) else None


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


def around_decisions(
    vehicle: Vehicle,
    law: Law,
    parameters: Any,
    *,
    depths: Sequence[float],
) -> Decided:
    """Return the worst over region, ways and depths [m] of a law of volume changes."""
    decisions = decisions_of(law, parameters)
    rates = drive_rates(vehicle, depths)
    names, _ = unknowns(vehicle)
    pieces = [(d, k) for d in decisions for k in range(len(depths))]
    points = np.concatenate([np.zeros((1, len(names))), unit_points(vehicle)])
    grid: list[tuple[float, Array, Decision, int]] = []
    for s in points:
        one = member(vehicle, s)
        grid += [(_radius(vehicle, one, d, rates, k), s, d, k) for d, k in pieces]
    ranked = sorted(grid, key=lambda g: -g[0])
    best, calls = ranked[0], 0

    def better(d: Decision, k: int, x: Array) -> float:
        return -_radius(vehicle, member(vehicle, _inside(x)), d, rates, k)

    for _, start, d, k in ranked[:_STARTS]:
        found = minimize(
            partial(better, d, k),
            0.98 * start,
            method="Nelder-Mead",
            options={"maxfev": _CALLS * len(names), "xatol": 1e-4, "fatol": 1e-9},
        )
        calls += int(found.nfev)
        if -float(found.fun) > best[0]:
            best = (-float(found.fun), _inside(found.x), d, k)
    radius, at, d, k = best
    worst = member(vehicle, at)
    return Decided(
        radius=radius,
        worst=WorstWay(worst.shares, depths[k], d.way.name, d.speed > 0.0, d.faster),
        on_grid=ranked[0][0],
        ways=tuple(_way(vehicle, one, grid[: len(pieces)], rates) for one in decisions),
        rest=rest_of(vehicle, law, parameters, rates),
        maps=len(grid),
        searched=calls,
    )


def _inside(x: Array) -> Array:
    inside: Array = x / max(1.0, float(np.linalg.norm(x)))
    return inside


def _waits(vehicle: Vehicle, one: Member, d: Decision, rates: DriveRates, k: int) -> list[Delivery]:
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


def _radius(vehicle: Vehicle, one: Member, d: Decision, rates: DriveRates, k: int) -> float:
    maps = (decision_map(one.plant, d, x) for x in _waits(vehicle, one, d, rates, k))
    return max(spectral_radius(M) for M in maps)


def _way(
    vehicle: Vehicle,
    d: Decision,
    nominal: Sequence[tuple[float, Array, Decision, int]],
    rates: DriveRates,
) -> WayFound:
    own = [g for g in nominal if g[2] is d]
    one = member(vehicle, np.zeros(len(unknowns(vehicle)[0])))
    p, w = one.plant, abs(d.speed)
    slope = drag_slope(p, w)
    c_true = drag_per_mass(w, p) / (p.a_b * w * w)
    c = sum(abs(s) * (d.samples[-1] - t) for s, t in zip(d.slopes, d.samples, strict=True))
    return WayFound(
        decision=d,
        nominal=max(g[0] for g in own),
        ratio=c / (2.0 * w) / c_true,
        time_constant=1.0 / slope if slope > 0.0 else math.inf,
        delivery=max(_waits(vehicle, one, d, rates, k)[-1].delay for *_, k in own),
    )


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
