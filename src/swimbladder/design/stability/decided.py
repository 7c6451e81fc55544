"""Laws of volume changes: small errors from decision to decision, over region, depths and ways.

What `around` is for laws that are called at each sample this is for laws that are called when they
ask to be: the largest eigenvalue of the map from one decision to the next (`linear.decisions`), in
the middle of the region, at the ends of its axes, at drawn points, and from the worst of these on
by Nelder and Mead's simplex. At rest the hull decides (`tuning.decisions`).
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
from swimbladder.design.linear.pump_valve import Decision, DriveRates, drag_slope, drive_rates
from swimbladder.design.tuning.margins import (
    Rest,
    decisions_of,
    deliveries,
    going,
    radius_of,
    rest_of,
)
from swimbladder.design.tuning.region import member, unit_points, unknowns
from swimbladder.io.answers import as_json
from swimbladder.physics.dynamics import drag_per_mass
from swimbladder.vehicle import Vehicle

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
        ways = [
            {
                "way": w.decision.way.name,
                **as_json(w.decision, "speed_m_s too_fast=faster interval_s=period"),
                **as_json(
                    w,
                    "largest_eigenvalue=nominal coefficient_ratio=ratio time_constant_s delivery_s",
                ),
            }
            for w in self.ways
        ]
        of_rest = (
            "psi_m3_m growth_time_s period_s tolerance_halves_s=halves band_m tolerance_m held"
        )
        return {
            **as_json(
                self, "largest_eigenvalue=radius worst_at=worst on_grid maps maps_searched=searched"
            ),
            "ways": ways,
            "rest": as_json(self.rest, of_rest),
        }


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
        grid += [(radius_of(vehicle, one, d, rates, k), s, d, k) for d, k in pieces]
    ranked = sorted(grid, key=lambda g: -g[0])
    best, calls = ranked[0], 0

    def better(d: Decision, k: int, x: Array) -> float:
        return -radius_of(vehicle, member(vehicle, _inside(x)), d, rates, k)

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


def _way(
    vehicle: Vehicle,
    d: Decision,
    nominal: Sequence[tuple[float, Array, Decision, int]],
    rates: DriveRates,
) -> WayFound:
    own = [g for g in nominal if g[2] is d]
    one = member(vehicle, np.zeros(len(unknowns(vehicle)[0])))
    p, w = going(vehicle, one.plant, d.speed), abs(d.speed)
    slope = drag_slope(p, w)
    c_true = drag_per_mass(w, p) / (p.a_b * w * w)
    c = sum(abs(s) * (d.samples[-1] - t) for s, t in zip(d.slopes, d.samples, strict=True))
    return WayFound(
        decision=d,
        nominal=max(g[0] for g in own),
        ratio=c / (2.0 * w) / c_true,
        time_constant=1.0 / slope if slope > 0.0 else math.inf,
        delivery=max(deliveries(vehicle, one, d, rates, k)[-1].delay for *_, k in own),
    )
