"""The nonlinearities that a vehicle under its law really has, each in the loop that it stands in.

The voltage saturates, and may be rounded, where the loop is broken at the voltage. The depth is
rounded at the depth. A motor that friction holds, and a law that lets the motor rest, stand
between the volume U that the law wants and V: a gain k_pV on U - V brings V along within a few
samples, so seen from outside friction of u_f volts is a play of u_f/k_pV, and a dead zone D is a
switch. V waits until the gap is D, then closes all but r of it: it goes between -M and M with M =
(D - r)/2, and turns where U is h = (D + r)/2. That loop is broken at the volume, with the mean lag
of the inner loop, 1/(K1 A k_pV), as a delay.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from swimbladder.control.law import Law
from swimbladder.control.records import from_leaves, leaves
from swimbladder.design.linear.models import StateSpace, linearise
from swimbladder.design.linear.sampled import LinearLaw, SampledLoop, discretise
from swimbladder.design.stability.cycles import Cycle, balance
from swimbladder.design.stability.describing import Nonlinearity, play, quantiser, relay, saturation
from swimbladder.physics.dynamics import Plant

_BROUGHT = 0.25  # share of a law's dead zone at which its motor stops: observer, sea-cascade


class Predicted(NamedTuple):
    """A nonlinearity of the vehicle, and a cycle that it makes; none where it makes none."""

    source: str  # voltage limit, motor friction, dead zone of the law, ...
    size: float
    unit: str  # of the size
    place: str  # where the loop is broken
    cycle: Cycle | None
    depth_amplitude: float  # m, of the depth's first harmonic; nan without a cycle
    bound: bool = False  # amplitude and period are the most that it may have


def without_rest(law: Law, parameters: Any) -> Any:
    """Return the law's parameters without its dead zone and pauses: its linear part."""
    resting = dict.fromkeys(filter(None, (law.dead_zone, law.near)), 0.0)
    return from_leaves(type(parameters), leaves(parameters) | resting)


def broken_at_volume(p: Plant, law: LinearLaw, *, depth: float, k_pV: float) -> StateSpace:
    """Return the loop from the volume V to minus the volume U that the law wants.

    U = V + (u - c z)/k_pV: what an inner loop of that gain would bring V to.
    """
    h, k = law.sample_time, law.system
    body = discretise(
        linearise(p._replace(positioner=1.0), depth=depth), h,
        command_delay=1.0 / (p.gain * k_pV),
    )  # fmt: skip
    seen = [k.inputs.index(name) for name in body.outputs]
    z, V = body.C[[body.outputs.index("depth")]], body.C[[body.outputs.index("volume")]]
    wanted = np.hstack([V + (k.D[:, seen] @ body.C - p.load_drive * z) / k_pV, k.C / k_pV])
    n, m = len(body.states), len(k.states)
    A = np.block([[body.A, np.zeros((n, m))], [k.B[:, seen] @ body.C, k.A]])
    return StateSpace(
        A=A, B=np.vstack([body.B, np.zeros((m, 1))]), C=-wanted, D=np.zeros((1, 1)),
        states=(*body.states, *k.states), inputs=("volume",), outputs=("volume",), sample_time=h,
    )  # fmt: skip


def predict(
    p: Plant, law: Law, parameters: Any, linear: LinearLaw, *, depth: float, depth_quantum: float,
    voltage_quantum: float,
) -> tuple[Predicted, ...]:  # fmt: skip
    """Return what each nonlinearity of a voltage-driven vehicle does at `depth` [m], by itself.

    linear: the law's linear form, without its dead zone; depth_quantum [m]; voltage_quantum [V].
    """
    loop = SampledLoop(plant=linearise(p, depth=depth), law=linear)
    h = linear.sample_time
    at_voltage, at_depth = loop.broken_at_command(), loop.broken_at_depth()
    from_voltage = discretise(loop.plant, h).part(output="depth", input="command")
    found = []

    def add(
        source: str, size: float, unit: str, place: str, broken: StateSpace,
        nonlinearity: Nonlinearity, to_depth: StateSpace | None,
    ) -> None:  # fmt: skip
        cycles = balance(broken, nonlinearity)
        for cycle in cycles:
            N = abs(complex(nonlinearity.gain(np.array([cycle.amplitude]))[0]))
            depth_amplitude = cycle.amplitude
            if to_depth is not None:
                depth_amplitude *= N * abs(to_depth.at(np.exp(1j * cycle.frequency * h))[0, 0, 0])
            found.append(Predicted(source, size, unit, place, cycle, depth_amplitude))
        if not cycles:
            found.append(Predicted(source, size, unit, place, None, math.nan))

    add("voltage limit", p.supply, "V", "voltage", at_voltage, saturation(p.supply), from_voltage)
    if voltage_quantum > 0.0:
        add("quantum of the voltage", voltage_quantum, "V", "voltage", at_voltage,
            quantiser(voltage_quantum), from_voltage)  # fmt: skip
    if depth_quantum > 0.0:
        add("quantum of the depth", depth_quantum, "m", "depth", at_depth,
            quantiser(depth_quantum), None)  # fmt: skip
    known = leaves(parameters)
    k_pV = float(known.get(law.volume_gain, 0.0))
    if not k_pV > 0.0:
        return tuple(found)
    body = discretise(linearise(p._replace(positioner=1.0), depth=depth), h)
    to_depth = body.part(output="depth", input="command")
    at_volume = broken_at_volume(p, linear, depth=depth, k_pV=k_pV)
    held = p.friction + 0.5 * (p.load_drive - p.load_back) * depth
    if held > 0.0:
        add("friction of the motor", held, "V", "volume", at_volume, play(held / k_pV), to_depth)
    rest = float(known.get(law.dead_zone, 0.0))
    if rest > 0.0:
        rests = rest * _left(p, k_pV, h)
        switch = relay(0.5 * (rest - rests), 0.5 * (rest + rests))
        add("dead zone of the law", rest, "m3", "volume", at_volume, switch, to_depth)
    return tuple(found)


def _left(p: Plant, k_pV: float, h: float) -> float:
    """Return the share of a volume error that is left once the motor rests [-].

    Each sample holds u = k_pV (U - V), until less than a quarter is left; the motor then runs out.
    """
    gap, rate, decay = 1.0, 0.0, math.exp(-h / p.T1)
    for _ in range(1000):
        goal = p.gain * k_pV * gap
        gap -= goal * h + (rate - goal) * p.T1 * (1.0 - decay)
        rate = goal + (rate - goal) * decay
        if abs(gap) < _BROUGHT:
            return gap - rate * p.T1
    return 1.0  # it never comes near: the motor does not rest
