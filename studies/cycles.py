"""Limit cycles of the vehicle of the paper: foretold by harmonic balance, and simulated.

``python -m studies.cycles`` prints the rows of docs/explanation/stability.md: the voltage's limit,
friction and the depth's quantum under the paper's cascade, and the dead zones of two quiet laws.
Each is simulated from a small disturbance and from a large one. Takes a minute, and another for
compiling.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from studies.reversals import KNOBS
from swimbladder.cli.common import progress
from swimbladder.control.law import Law
from swimbladder.control.registry import bind
from swimbladder.control.sea_cascade import SEA_CASCADE, SeaCascadeParameters, sea_cascade_gains
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.cycles import Held, Predicted, Seen, edge, hold, predict
from swimbladder.design.tuning.gains import gains, setting_of, tunable
from swimbladder.design.tuning.margins import at_rest
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import IdentifiedActuator, Vehicle

__all__ = ["CASES", "Case", "foretold", "main", "row", "simulated"]

_DEPTH, _TICK, _SUPPLY = 2.0, 0.3, 12.0  # m, s, V
_FRICTION, _QUANTUM = 0.5, 5e-3  # V, m
# A stroke and a sea without ends, for a cycle of the voltage's limit alone.
_ENDLESS = {"V_min": -1.0, "V_max": 1.0, "z_surface": -1e4, "z_air": -2e4}
_WITHIN = (1.0, 200.0)  # m, in which an edge is looked for
_ALIKE = 0.02  # of amplitude and period: the same cycle
_STARTS = (0.3, 3.0)  # of the amplitude foretold: where a simulation begins


class Case(NamedTuple):
    """One nonlinearity of one loop."""

    words: str
    source: str  # as `stability.predict` names it
    vehicle: Vehicle
    law: Law
    parameters: Any
    depth_quantum: float = 0.0  # m

    @property
    def bound(self) -> BoundLaw:
        """The law with its parameters."""
        return BoundLaw(self.law, self.parameters, _TICK)


def _cases() -> Iterator[Case]:
    vehicle = load_vehicle("feup-em")
    actuator = vehicle.actuator
    assert vehicle.controller is not None
    assert isinstance(actuator, IdentifiedActuator)
    p = plant(vehicle)
    cascade, numbers = bind(vehicle.controller)
    yield Case("12 V, the paper's cascade: edge", "voltage limit", vehicle, cascade, numbers)
    # a tuned cascade at a lower frequency, so that it moves little
    quiet = SeaCascadeParameters(
        gains=sea_cascade_gains(p.a_b, p.d_l, p.gain, 0.125, _TICK),
        target_weight=1.0,
        smoothing=0.07,
        leash=0.0,
        fastest=0.25,
        jerk=0.007,
        shortest=3.0,
        volume_per_speed=p.d_l / p.a_b,
        volume_per_acceleration=1.0 / p.a_b,
        psi=p.psi,
        depth_voltage=p.load_drive,
        rate_per_volt=p.gain,
        voltage_limit=_SUPPLY,
        volume_min=p.V_min,
        volume_max=p.V_max,
        dead_zone=1.5e-6,
        S_p=_TICK,
    )
    zone = "dead zone of the law"
    yield Case("dead zone of 1.5 cm³, quiet `sea-cascade`", zone, vehicle, SEA_CASCADE, quiet)
    sensors = vehicle.sensors.model_copy(update={"depth_noise": 2e-3, "depth_quantum": _QUANTUM})
    noisy = vehicle.model_copy(update={"sensors": sensors})
    setting = setting_of(noisy, sample_time=_TICK, supply=_SUPPLY, neutral_range=20e-6)
    tuning = KNOBS["observer"]._replace(dead=0.5e-6, pause=0.0, band=0.0)
    observer = gains("observer", setting, tuning)
    yield Case(
        "dead zone of 0.5 cm³, quiet `observer`", zone, vehicle, tunable("observer"), observer
    )
    sticky = actuator.model_copy(update={"dead_zone": _FRICTION})
    yield Case(
        f"friction of {_FRICTION:g} V, the paper's cascade",
        "friction of the motor",
        vehicle.model_copy(update={"actuator": sticky}),
        cascade,
        numbers,
    )
    yield Case(
        f"depth in {1e3 * _QUANTUM:g} mm, the paper's cascade",
        "quantum of the depth",
        vehicle,
        cascade,
        numbers,
        _QUANTUM,
    )


CASES = tuple(_cases())


def foretold(case: Case) -> Predicted:
    """Return the cycle of a case: the stable one where there is one, else the edge."""
    smooth = load_vehicle("feup-em")  # linear: without what sticks
    linear = at_rest(case.bound.without_rest, plant(smooth), depth=_DEPTH)
    p, quantum = plant(case.vehicle), case.depth_quantum
    found = predict(p, case.bound, linear, depth=_DEPTH, depth_quantum=quantum)
    own = [one for one in found if one.source == case.source and one.cycle is not None]
    return max(own, key=lambda one: one.cycle is not None and one.cycle.stable)


def simulated(case: Case, one: Predicted) -> tuple[Seen | None, ...]:
    """Return what the simulator shows, from each start; of an edge the cycle between its sides."""
    assert one.cycle is not None
    if not one.cycle.stable:
        held = Held(case.vehicle, case.bound, _DEPTH, _ENDLESS)
        seen = edge(held, _WITHIN, one.cycle.period)
        return (None if seen is None else seen[0],)
    vehicle = case.vehicle
    if case.depth_quantum > 0.0:
        sensors = vehicle.sensors.model_copy(update={"depth_quantum": case.depth_quantum})
        vehicle = vehicle.model_copy(update={"sensors": sensors})
    held, quantised = Held(vehicle, case.bound, _DEPTH), case.depth_quantum > 0.0
    return tuple(
        hold(held, share * one.depth_amplitude, one.cycle.period, quantised=quantised)
        for share in _STARTS
    )


def row(case: Case, one: Predicted, seen: Sequence[Seen | None]) -> str:
    """Return the row of the table."""
    c = one.cycle
    assert c is not None
    said = [_seen(s) for n, s in enumerate(seen) if not any(_alike(s, o) for o in seen[:n])]
    return (
        f"| {case.words} | {_length(one.depth_amplitude)} every {c.period:.3g} s "
        f"| {100.0 * c.amplitude_error:.0f} %, {100.0 * c.period_error:.0f} % "
        f"| {' or '.join(said)} |"
    )


def _alike(one: Seen | None, other: Seen | None) -> bool:
    """Whether two runs came to the same cycle."""
    if one is None or other is None or not (one.cycles and other.cycles):
        return False
    return math.isclose(one.amplitude, other.amplitude, rel_tol=_ALIKE) and math.isclose(
        one.period, other.period, rel_tol=_ALIKE
    )


def _seen(s: Seen | None) -> str:
    if s is None:
        return "no edge"
    if not s.cycles:
        often = "" if math.isnan(s.period) else f", every {s.period:.3g} s"
        return f"within {_length(s.farthest)}{often}"
    return f"{_length(s.amplitude)} every {s.period:.3g} s"


def _length(x: float) -> str:
    return f"{x:.3g} m" if x >= 1.0 else f"{1e3 * x:.1f} mm"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.cycles", description=__doc__)
    parser.parse_args(arguments)
    print("| `feup-em`, 2 m | predicted | expected error | simulated |\n|---|---|---|---|")
    with progress("simulating", float(len(CASES))) as advance:
        for case in CASES:
            one = foretold(case)
            print(row(case, one, simulated(case, one)), flush=True)
            advance(1.0)


if __name__ == "__main__":
    main()
