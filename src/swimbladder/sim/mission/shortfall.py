"""What a phase that was not met lacked, as its flight shows: time, volume, charge, runs, steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.rate import RateParameters
from swimbladder.io.mission import Mission
from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.records import Note, Records, Table
from swimbladder.sim.mission.core.records import Kind
from swimbladder.sim.mission.rescue import start_time
from swimbladder.vehicle import PumpAndValve

if TYPE_CHECKING:
    from swimbladder.sim.mission.flight import Flight
    from swimbladder.sim.mission.prepare import Plan

Array = NDArray[np.float64]
_LONGER_RUNS = "Allow longer runs, or take a pump that delivers more, or a smaller line"
_CUT = 0.99  # of the longest run: it would have gone on
_FEW = 0.5  # of what a pump delivers in its time: less, and starts take most of it
# Of what a band holds in volume, in a step: floats a few percent apart held it for 99 % of the time
# with a quarter, for 89 % and up with a half, for 79 % and up with all of it.
_COARSE = 0.25


def late_notes(flight: Flight, phase: int) -> Records:
    """Return the notes of a phase that ran out of time [n]."""
    notes = flight.notes
    late = (notes["what"] == Note.OUT_OF_TIME) & (notes["number"] == phase)
    return np.asarray(notes[late])


def shortage(flight: Flight, phase: int, depths: Array) -> Array:
    """Return how far from a phase's depth, less its tolerance, depths are [m]."""
    stage = flight.plan.stages[phase]
    if stage["kind"] == Kind.SURFACE:
        return np.asarray(np.maximum(depths, 0.0))
    return np.asarray(np.abs(depths - stage["depth"]) - stage["tolerance"])


def timeout_words(flight: Flight, phase: int) -> str:
    """Return how far a phase that ran out of time came, in the cycle in which most was missing."""
    late, stage = late_notes(flight, phase), flight.plan.stages[phase]
    short = shortage(flight, phase, late["z"])
    k = int(np.argmax(short))
    z = late["z"][k]
    if stage["kind"] == Kind.SURFACE:
        lacking = 1e6 * float(flight.plan.given["v_max"] - late["v"][k])
        return f"it was at {z:.1f} m, {short[k]:.1f} m short, with {lacking:.3g} cm3 not out"
    return (
        f"it was at {z:.1f} m, {short[k]:.1f} m short of the {stage['tolerance']:g} m around "
        f"{stage['depth']:g} m"
    )


def battery_words(flight: Flight) -> str:
    """Return where the battery ran empty, and what pressing all volume out there still takes."""
    g, table, x = flight.plan.given, flight.plan.table, flight.end
    phase = flight.mission.titles[int(flight.whole["phase"])]
    z, inside = float(x["z"]), float(g["v_max"] - x["v"])
    rate, power = (
        look_up(table, float(g["step"]), column, max(z, 0.0))[0]
        for column in (Table.RATE_OUT, Table.POWER_OUT)
    )
    cycle = int(flight.whole["cycle"]) + 1
    where = f"in the phase {phase!r} of cycle {cycle}, at {z:.1f} m"
    delivery = float(rate * g["delivery"])
    if delivery <= 0.0:
        return f"{where}, where the drive stalls"
    return (
        f"{where}, {power / delivery * inside:.3g} J short of what it takes to press out the "
        f"{1e6 * inside:.4g} cm3 inside there"
    )


def starts_words(flight: Flight, phase: int) -> str:
    """Say that starts took most of the runs in a phase that were cut short, and why; "" if not."""
    plan, actuator = flight.plan, flight.vehicle.engine
    if not isinstance(actuator, PumpAndValve):
        return ""
    law = RateParameters(*map(float, plan.stages["law"][phase]))
    longest, limit = float(plan.given["longest"]), "actuator.longest_run"
    if longest > law.dead:
        longest, limit = law.dead, "the next sample (dead of the controller, or check_interval)"
    step, share = float(plan.given["step"]), float(plan.given["delivery"])
    here, begun = False, None
    out, could, depths = 0.0, 0.0, list[float]()
    for note in flight.notes:
        if note["what"] == Note.PHASE:
            here = note["number"] == phase
        elif note["what"] == Note.PUMP:
            begun = note if here else None
        elif note["what"] == Note.RUN_OVER and begun is not None:
            if note["number"] < _CUT * longest:
                continue
            depth = max(float(begun["z"]), 0.0)
            rate = look_up(plan.table, step, Table.RATE_OUT, depth)[0]
            out += float(note["v"] - begun["v"])
            could += share * rate * float(note["number"])
            depths.append(depth)
    if could == 0.0 or out > _FEW * could:
        return ""
    deepest = max(depths)
    what = "actuator.start_volume" if actuator.line is None else "actuator.line"
    if actuator.line is not None and actuator.start_volume > 0.0:
        what += " and actuator.start_volume"
    return (
        f"The pump's {len(depths)} longest runs in it pressed out {1e6 * max(out, 0.0):.3g} cm3, "
        f"{100.0 * max(out, 0.0) / could:.2g} % of what it delivers in their time: at "
        f"{deepest:.0f} m a start of the pump takes {start_time(plan, deepest):.3g} s ({what}), a "
        f"run {longest:.3g} s at most ({limit}). {_LONGER_RUNS}"
    )


def coarse_words(mission: Mission, plan: Plan, phase: int) -> str:
    """Say where the steps of `rate` are too coarse for the band of a phase; "" where they are not.

    A stable vehicle comes to rest where its volume is neutral. Volumes that lie farther apart than
    a quarter of what the band holds leave it to chance whether one of them rests well inside
    before it moves on.
    """
    stage = plan.stages[phase]
    if mission.phases[phase].depth is None or stage["capture"] > 0.0:
        return ""
    psi = look_up(plan.table, float(plan.given["step"]), Table.NEUTRAL, stage["depth"])[1]
    law = RateParameters(*map(float, stage["law"]))
    if psi >= 0.0 or law.volume_step <= _COARSE * -psi * 2.0 * law.tolerance:
        return ""
    return (
        f". Lessen volume_step: its {law.volume_step * 1e6:.3g} cm3 move the depth of rest by "
        f"{law.volume_step / -psi:.2g} m, and the band is {2.0 * law.tolerance:.3g} m"
    )
