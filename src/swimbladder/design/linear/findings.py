"""What the numbers of an analysis mean, in sentences, each with its numbers and units."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from swimbladder.design.linear.margins import Margins
from swimbladder.design.linear.sampled import ClosedLoop

if TYPE_CHECKING:
    from swimbladder.design.linear.analyse import Analysis


def findings(a: Analysis) -> dict[str, tuple[str, ...]]:
    """Return what an analysis says: by subject, a sentence or two for each point."""
    return {
        "rest": tuple(_rest(a)),
        "open loop": (*_open_loop(a), *_motions(a), *_section_2_5(a)),
        "depth": tuple(_depths(a)),
        "closed loop": (*_closed_loop(a), *a.notes),
    }


def _rest(a: Analysis) -> Iterator[str]:
    p, v = a.operating_point, a.vehicle
    text = f"At {p.depth:g} m the vehicle rests with a volume of {_cm3(p.volume)}"
    if v.voltage_driven:
        text += f"; {p.voltage:.3g} V hold the motor against the sea"
        if p.voltage_back != p.voltage:
            text += f", and it only gives way below {p.voltage_back:.3g} V"
    yield text + "."
    if not v.stroke.minimum <= p.volume <= v.stroke.maximum:
        yield (
            f"That volume is outside the stroke of {_cm3(v.stroke.minimum)} to "
            f"{_cm3(v.stroke.maximum)}: the vehicle cannot rest there, and what follows is about a "
            "vehicle that could."
        )
    elif not a.rests:
        assert a.stall is not None
        why = "the supply cannot hold the motor"
        if a.drive is not None:
            why = "more leaks back than the pump presses out"
        yield (
            f"Below {a.stall.holding_depth:.1f} m {why}: the vehicle cannot rest there, and what "
            "follows is about a vehicle that could."
        )


def _open_loop(a: Analysis) -> Iterator[str]:
    o = a.open_loop
    said = o.routh.sentence
    text = f"Open loop, by Routh's table: {said[0].lower()}{said[1:]}"
    if math.isfinite(o.doubling_time):
        text += (
            f" The fastest growing disturbance, exp({o.poles[0].real:.4g} t), doubles in "
            f"{o.doubling_time:.3g} s."
        )
    yield text
    if a.vehicle.drag.law == "quadratic":
        yield (
            "The drag is quadratic and has no slope at rest: K2 and T2 do not exist, nor do (30), "
            "(32), (34) and (35), and the linear model leaves out what damps a real motion."
        )
    elif a.vehicle.drag.law != "linear":
        yield "The drag is the laminar one of small speeds."


def _motions(a: Analysis) -> Iterator[str]:
    """Yield what a body does whose volume is kept between two actions of pump and valve."""
    if not a.motions:
        return
    rest, moving = a.motions[0], a.motions[1:]
    if math.isfinite(rest.growth_time):
        yield (
            f"At rest the hull gives way more than the water: with its volume kept, a small error "
            f"of the depth grows e-fold in {rest.growth_time:.3g} s."
        )
    elif math.isfinite(rest.period):
        yield (
            f"At rest the hull is stiffer than the water: with its volume kept it swings about its "
            f"neutral depth every {rest.period:.4g} s."
        )
    said = ", ".join(f"{100.0 * m.speed:g} cm/s in {m.time_constant:.3g} s" for m in moving)
    yield f"On its way a speed follows the volume with the time constant of the drag: {said}."


def _section_2_5(a: Analysis) -> Iterator[str]:
    s = a.stiff_hull
    if s is not None and s.unstable:
        has = a.vehicle.hull.psi < 0.0
        yield (
            (
                "That the hull is stiffer than water does"
                if has
                else "A hull stiffer than water would"
            )
            + f" not help: with psi = {s.psi:.3g} m3/m the depth load alone still doubles a "
            f"disturbance in {s.doubling_time:.3g} s (section 2.5); without k_z and k_l nothing "
            "would grow."
        )
    elif s is not None:
        yield (
            "Nothing loads the volume here (k_z = k_l = 0): with a hull stiffer than water no "
            "disturbance would grow."
        )
    if a.double_integrator_phase_margin is not None:
        margin = math.degrees(a.double_integrator_phase_margin)
        yield (
            "Without psi, k_l and k_z (35) is a double integrator with two lags: under a gain of "
            f"1 V/m its phase margin is {margin:.1f} degrees, negative as for every gain."
        )


def _depths(a: Analysis) -> Iterator[str]:
    s, limit = a.stall, a.vehicle.hull.depth_limit
    if s is not None:
        if math.isinf(s.depth):
            yield "No depth loads the motor, so none stalls it."
        else:
            at = f" at {s.voltage:.3g} V" if math.isfinite(s.voltage) else ""
            text = f"Stall depth{at}: {s.depth:.1f} m"
            if s.depth_without_sag > s.depth:
                text += f" ({s.depth_without_sag:.1f} m if the supply did not sag)"
            if limit is not None:
                side = (
                    "above it" if s.within_limit else "NOT above it: the vehicle could not come up"
                )
                text += f"; the depth limit of {limit:g} m is {side}"
            yield text + "."
            if s.holding_depth < s.depth:
                yield f"Below {s.holding_depth:.1f} m the pump leaks more than it moves."
            if s.extending_rate > 0.0:
                rate = f"{s.extending_rate * 1e6:.3g} cm3/s"
                yield f"At {a.depth:g} m the motor still moves out {rate}."
    n = a.neutral
    if math.isfinite(n.leaves_stroke) and n.leaves_stroke > 0.0:
        text = f"The neutral volume leaves the stroke at {n.leaves_stroke:.1f} m"
        if limit is not None and n.leaves_stroke < limit:
            text += (
                f", before the depth limit of {limit:g} m: below that the vehicle, trimmed as it "
                "is, cannot come to rest"
            )
        yield text + "."


def _closed_loop(a: Analysis) -> Iterator[str]:
    c = a.closed_loop
    if c is None:
        if not a.notes:
            yield "The vehicle has no controller: nothing is said of a closed loop."
        return
    where = "voltage" if a.vehicle.voltage_driven else "volume command"
    head = f"Closed loop with {c.law!r}, sampled every {c.sample_time:g} s: "
    if not c.stable:
        radius = max(c.spectral_radius, c.spectral_radius_back_driven)
        yield (
            f"{head}UNSTABLE, the largest pole has a modulus of {radius:.4f}: disturbances grow by "
            f"{(radius - 1.0) * 100.0:.3g} % a sample."
        )
    else:
        slowest = c.modes[0]
        yield (
            f"{head}stable; the slowest pole, z = {_complex(slowest.z)}, decays with a time "
            f"constant of {slowest.time_constant:.3g} s."
        )
    if c.one_loop:
        where += " or, which is the same here, at the measured depth"
    if c.at_command is not None:
        yield _margins(c.at_command, where)
    if c.at_depth is not None and not c.one_loop:
        yield _margins(c.at_depth, "measured depth")
    if c.stable:
        yield _delays(c)
    if c.depth_load is not None:
        load = c.depth_load
        text = (
            "The inner loop does not fully reject the depth load: what is left is positive "
            f"feedback, like an extra psi of {load.extra_psi:.3g} m3/m"
        )
        if math.isfinite(load.share_of_psi):
            text += f" ({abs(load.share_of_psi) * 100.0:.2g} % of {_size_of_psi(a)})"
        yield text + "."
        yield (
            f"The gain of the inner loop times the sample time is {c.inner_gain_per_sample:.3f}: "
            + (
                "it must be judged in discrete time."
                if c.inner_gain_per_sample > 0.2
                else "a view in continuous time is close."
            )
        )
    if not a.vehicle.voltage_driven:
        yield (
            "The volume commanded is taken as reached at once. The piston moves at most "
            f"{_cm3(c.volume_per_sample)} a sample, which a sudden error of "
            f"{c.error_at_rate_limit:.2g} m already asks for: beyond that the rate limit adds lag "
            "that no linear model shows."
        )


def _size_of_psi(a: Analysis) -> str:
    return "psi" if a.vehicle.hull.psi > 0.0 else "the size of psi"


def _margins(m: Margins, place: str) -> str:
    up = f"grow {m.gain_up:.3g} times" if math.isfinite(m.gain_up) else "grow without limit"
    down = f"fall to {m.gain_down:.2g} of itself" if m.gain_down > 0.0 else "fall to nothing"
    phase = (
        f"the phase margin is {math.degrees(m.phase):.1f} degrees at {m.phase_frequency:.3g} rad/s"
        if math.isfinite(m.phase)
        else "there is no gain crossover, so no phase margin is needed"
    )
    return (
        f"Broken at the {place}, the gain may {up} or {down}; {phase}; the peak sensitivity is "
        f"{m.peak_sensitivity:.2f}, and gain and phase may at once be off by a factor of "
        f"{m.disk_gain:.2f} and {math.degrees(m.disk_phase):.0f} degrees."
    )


def _delays(c: ClosedLoop) -> str:
    whole = "stable" if c.radius_at_whole_sample < 1.0 else "NOT stable"
    if math.isinf(c.computation_delay):
        text = "No computation delay makes the loop unstable"
    else:
        text = f"The loop survives {c.computation_delay:.3f} s of computation delay"
    age = "any age" if math.isinf(c.depth_delay) else f"an age of {c.depth_delay:.3g} s"
    return (
        f"{text}; with one whole sample of it, it is {whole}. "
        f"It survives {age} of the measured depth."
    )


def _cm3(volume: float) -> str:
    return f"{volume * 1e6:.4g} cm3"


def _complex(z: complex) -> str:
    return f"{z.real:.5f}" if z.imag == 0.0 else f"{z.real:.5f} {z.imag:+.5f}i"
