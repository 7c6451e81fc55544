"""The margins of a sampled law over a region of plants: the worst of each.

Of a law of volume changes they are of its decisions over the region, and of rest. At rest such a
law does nothing for small errors, since its change goes with the square of a speed: there the hull
decides. With one that gives way more than the water (psi > 0) errors grow from decision to
decision; the band in which they are caught has to be narrower than the one that the law keeps.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Measurement, leaves, smooth
from swimbladder.control.rate import RateParameters
from swimbladder.design.linear.margins import Margins, loop_margins, response, spectral_radius
from swimbladder.design.linear.models import StateSpace
from swimbladder.design.linear.pump_valve import (
    Decision,
    Delivery,
    DriveRates,
    decision_maps,
    decision_of,
    with_drag,
)
from swimbladder.design.linear.sampled import (
    BoundLaw,
    LinearLaw,
    SampledLoop,
    linearise_law,
    loop_of,
)
from swimbladder.design.tuning.region import Member, member, with_middle
from swimbladder.physics.dynamics import Plant, drag_force
from swimbladder.sim.closed_loop.water import Medium
from swimbladder.sim.mission.orders import growth_rate
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


def decisions_of(bound: BoundLaw) -> list[Decision]:
    """Return what a law decides on each of its ways, down and up, too slow and too fast."""
    law, parameters, _ = bound
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
    a = vehicle.engine
    longest = (isinstance(a, PumpAndValve) and a.longest_run) or math.inf
    rate, share, start = rates.valve[k], one.drive[1], 0.0
    if d.pumps:
        rate, share, start = rates.pump[k], one.drive[0], rates.start_volume[k]
    if rate <= 0.0:
        return [Delivery(0.0, 0.0)]
    whole = (d.largest + start) / rate
    part = min(1.0, longest / whole)
    return [Delivery(share, min(start / rate, longest)), Delivery(part * share, part * whole)]


def going(vehicle: Vehicle, p: Plant, speed: float) -> Plant:
    """Return a plant with the drag of the way it goes at a speed [m/s, positive down]."""
    return with_drag(p, vehicle.drag.rising_ratio if speed < 0.0 else 1.0)


def radius_of(
    vehicle: Vehicle, members: Sequence[Member], d: Decision, rates: DriveRates, k: int
) -> float:
    """Return the largest eigenvalue's modulus of members at depth k of `rates`, any change."""
    each = [
        (going(vehicle, one.plant, d.speed), x)
        for one in members
        for x in deliveries(vehicle, one, d, rates, k)
    ]
    maps = decision_maps([p for p, _ in each], d, [x for _, x in each])
    return float(np.abs(np.linalg.eigvals(maps)).max())


def in_water(medium: Medium, one: Member, depth: float) -> Member:
    """Return a member of a region at a depth [m] of some water: psi with what its layers add."""
    high, low = max(depth - _NEAR, 0.0), depth + _NEAR
    slope = (medium.layers.at(low) - medium.layers.at(high)) / (low - high)
    p = medium.of(one.plant)
    return one._replace(plant=p._replace(psi=p.psi + slope))


def largest_radius(
    vehicle: Vehicle, bound: BoundLaw, members: Sequence[Member], rates: DriveRates, medium: Medium
) -> float:
    """Return the largest eigenvalue's modulus over members of a region, ways and depths [-]."""
    decisions, radii = decisions_of(bound), []
    for k, depth in enumerate(rates.depths):
        there = [in_water(medium, one, depth) for one in members]
        radii += [radius_of(vehicle, there, d, rates, k) for d in decisions]
    return max(radii)


def rest_of(vehicle: Vehicle, bound: BoundLaw, rates: DriveRates, medium: Medium) -> Rest:
    """Return what happens at rest, with the psi of region and depths that gives way most."""
    a, parameters = vehicle.engine, bound.parameters
    shortest = a.quantum * max(*rates.pump, *rates.valve) if isinstance(a, PumpAndValve) else 0.0
    every = [member(vehicle, s) for s in with_middle(vehicle)]
    plants = (in_water(medium, one, z).plant for one in every for z in rates.depths)
    p = max(plants, key=lambda p: p.psi)
    tolerance = float(leaves(parameters)[bound.law.band])
    sigma = math.sqrt(p.a_b * abs(p.psi))
    band = 0.0
    if isinstance(parameters, RateParameters):
        smallest = max(parameters.volume_step, shortest)
        band = least_band(vehicle.but("hull", psi=p.psi), p.psi, parameters, smallest)
    growth_time = period = halves = math.inf
    if p.psi > 0.0:
        growth_time = 1.0 / sigma
    elif p.psi < 0.0:
        period, halves = 2.0 * math.pi / sigma, _halves(p, sigma, tolerance)
    return Rest(growth_time, period, halves, band, tolerance, p.psi)


def least_band(vehicle: Vehicle, psi: float, law: RateParameters, volume_step: float) -> float:
    """Return the least tolerance [m] that the law `rate` keeps.

    volume_step: the smallest change of volume [m3]; it makes a speed w by c w^2, or as slow a one
    as is not seen, and between two samples, h apart, the vehicle goes w h. Where it diverges it
    does so until one sees it and the next corrects it, e^(2 sigma h); where it is stable it rests
    within volume_step/|psi|.
    """
    interval = law.dead + law.run
    speed = max(0.5 * law.speed_step, math.sqrt(volume_step / law.coefficient))
    if speed <= 0.0:
        return 0.0
    least = speed * interval * math.exp(2.0 * growth_rate(vehicle, psi, speed) * interval)
    if psi < 0.0:
        least = min(least, max(volume_step / -psi, _drift(vehicle, psi, 0.5 * law.speed_step)))
    return least


def _drift(vehicle: Vehicle, psi: float, speed: float) -> float:
    """Return how far from rest a stable vehicle is that still moves at a speed [m/s], in metres."""
    if speed <= 0.0:
        return 0.0
    return abs(drag_force(vehicle.drag, speed)) / (vehicle.water.specific_weight * abs(psi))


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


_POINTS = 160  # frequencies of a rough look
_NEAR = 10.0  # m to either side of a depth, over which the water's own psi is taken
_DECADES = 4.0  # below the Nyquist frequency


# 6 dB either way, 45 degrees, a peak sensitivity of 1.6 and a balanced disk margin of 0.5.
WANTED = Margins(2.0, 0.5, math.radians(45.0), 0.0, 1.6, 0.5)
MARGINS = "gain_up gain_down phase_rad delay_s peak_sensitivity disk"
"""The margins themselves, as `io.answers.as_json` takes them."""
_LOST = Margins(1.0, 1.0, 0.0, 0.0, math.inf, 0.0)


def at_rest(bound: BoundLaw, p: Plant, *, depth: float) -> LinearLaw:
    """Return the linear form of a law that holds a plant at `depth` [m]."""
    law = bound.law
    seen = Measurement(0.0, depth, p.psi * depth + p.V_0)

    def step(numbers: Any, state: Any, seen: Measurement, reference: float) -> Any:
        # A positioner's volume is no output of the linear plant: it is where it was sent.
        return law.step(numbers, state, seen._replace(volume=math.nan), reference)

    if law.command != "voltage":
        bound = bound._replace(law=replace(law, step=step))
    return linearise_law(bound._replace(parameters=smooth(law, bound.parameters)), seen)


def loops(
    bound: BoundLaw, plants: Sequence[Plant], *, depths: Sequence[float], delay: float = 0.0
) -> Iterator[SampledLoop]:
    """Yield the loops of a law with every plant at every depth [m], depth by depth.

    The law is linearised at rest with the first plant, the nominal one that it was made for.
    delay [s]: from a sample to its command.
    """
    for depth in depths:
        linear = at_rest(bound, plants[0], depth=depth)
        yield from (loop_of(p, linear, depth=depth, delay=delay) for p in plants)


Judge = Callable[[StateSpace], Margins]


def exactly(loop: StateSpace) -> Margins:
    """Return the margins of a loop, crossings found to rounding."""
    return loop_margins(loop) or _LOST


def roughly(loop: StateSpace) -> Margins:
    """Return the margins as a grid of frequencies shows them: for a search, not for an answer.

    Crossings are interpolated between neighbours; the delay is not looked for.
    """
    if spectral_radius(loop.A - loop.B @ loop.C) >= 1.0:
        return _LOST
    assert loop.sample_time is not None  # a loop that was sampled
    L = response(loop)(math.pi / loop.sample_time * np.logspace(-_DECADES, 0.0, _POINTS))
    size = np.log(np.abs(L))
    phase = np.abs(np.angle(-L))
    crossing = np.flatnonzero(size[:-1] * size[1:] <= 0.0)
    order = [k + np.argsort(size[k : k + 2]) for k in crossing]
    least = [float(np.interp(0.0, size[pair], phase[pair])) for pair in order]
    turned = np.flatnonzero((L.imag[:-1] * L.imag[1:] <= 0.0) & (L.real[:-1] < 0.0))
    gains = []
    for k in turned:
        part = L.imag[k] / (L.imag[k] - L.imag[k + 1]) if L.imag[k] != L.imag[k + 1] else 0.5
        gains.append(-1.0 / float(L.real[k] + part * (L.real[k + 1] - L.real[k])))
    if L[-1].real < 0.0:
        gains.append(-1.0 / float(L[-1].real))
    up = min((g for g in gains if g > 1.0), default=math.inf)
    down = max((g for g in gains if g < 1.0), default=0.0)
    peak = float(np.max(1.0 / np.abs(1.0 + L)))
    disk = min(2.0, 1.0 / float(np.max(np.abs(0.5 * (1.0 - L) / (1.0 + L)))))
    return Margins(up, down, min(least, default=math.inf), math.inf, peak, disk)


def worst(
    every: Iterable[SampledLoop], *, judge: Judge = exactly, wanted: Margins | None = None
) -> Margins:
    """Return the worst margins over all loops; wanted: what ends the search once it is missed."""
    found: Margins | None = None
    for loop in every:
        for broken in (loop.broken_at_command(), loop.broken_at_depth()):
            here = judge(broken)
            found = here if found is None else least(found, here)
            if not found.stable or (wanted is not None and violated_margins(found, wanted)):
                return found
    assert found is not None  # there is a plant and a depth
    return found


# Of each margin the worse of two, and for a person its name, factor, digits and unit.
_KINDS: dict[str, tuple[Callable[[float, float], float], str, float, str, str]] = {
    "gain_up": (min, "gain up", 1.0, ".2f", ""),
    "gain_down": (max, "gain down", 1.0, ".2f", ""),
    "phase": (min, "phase", math.degrees(1.0), ".0f", " degrees"),
    "peak_sensitivity": (max, "peak sensitivity", 1.0, ".2f", ""),
    "disk": (min, "disk margin", 1.0, ".2f", ""),
}


def least(a: Margins, b: Margins) -> Margins:
    """Return the worse of each margin."""
    worse = {name: kind[0](getattr(a, name), getattr(b, name)) for name, kind in _KINDS.items()}
    return Margins(delay=min(a.delay, b.delay), **worse)


def violated_margins(m: Margins, wanted: Margins = WANTED) -> tuple[str, ...]:
    """Return in words which margins are less than wanted, worst named with both numbers."""
    if not m.stable:
        return ("the loop is not stable over the whole region",)
    found = []
    for name, (worse, words, factor, digits, unit) in _KINDS.items():
        has, asked = getattr(m, name), getattr(wanted, name)
        if has != asked and worse(has, asked) == has:
            shown = [f"{factor * x:{digits}}" for x in (has, asked)]
            if shown[0] == shown[1]:  # nearer than that shows
                shown = [f"{factor * x:.4g}" for x in (has, asked)]
            found.append(f"{words} {shown[0]} of {shown[1]}{unit}")
    return tuple(found)


def worst_margin_ratio(m: Margins, wanted: Margins = WANTED) -> float:
    """Return by how much the margin that is farthest from what is wanted misses it, as a ratio."""
    over = (m.peak_sensitivity - 1.0) / (wanted.peak_sensitivity - 1.0)
    ratios = wanted.gain_up / m.gain_up, m.gain_down / wanted.gain_down, over
    angles = ((wanted.phase, m.phase), (wanted.disk, m.disk))
    return max(*ratios, *(w / had if had > 0.0 else math.inf for w, had in angles))


def margin_words(m: Margins) -> str:
    """Return margins in words, as a list."""
    return (
        f"gain {decibels(m.gain_up)} up and {decibels(m.gain_down)} down, phase "
        f"{math.degrees(m.phase):.0f} degrees, {m.delay:.2g} s more delay, peak sensitivity "
        f"{m.peak_sensitivity:.2f}, balanced disk margin {m.disk:.2f}"
    )


def decibels(gain: float) -> str:
    """Return how far a gain [-] is from 1 in decibels, for a person; "any" where nothing limits."""
    if gain == 0.0 or math.isinf(gain):
        return "any"
    return f"{abs(20.0 * math.log10(gain)):.1f} dB"
