"""Where a mission that was not met ended, and what it lacked there."""

from __future__ import annotations

import numpy as np

from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.names import At, Drive, Given, Note, Now, Table
from swimbladder.sim.mission.core.names import Stage
from swimbladder.sim.mission.flight import Flight


def timeout_words(flight: Flight, phase: int) -> str:
    """Return how far a phase that ran out of time came, in the cycle in which most was missing."""
    notes = flight.notes
    late = (notes[:, Drive.WHAT] == Note.OUT_OF_TIME) & (notes[:, Drive.NUMBER] == phase)
    stage = flight.plan.stages[phase]
    depth, tolerance = float(stage[Stage.DEPTH]), float(stage[Stage.TOLERANCE])
    reached = notes[late, Drive.Z]
    if flight.mission.phases[phase].depth is None:
        z = float(np.max(reached))
        volume = float(notes[late, Drive.V][np.argmax(reached)])
        lacking = 1e6 * (float(flight.plan.given[Given.V_MAX]) - volume)
        return f"it was at {z:.1f} m, {max(z, 0.0):.1f} m short, with {lacking:.3g} cm3 not out"
    short = np.abs(reached - depth) - tolerance
    k = int(np.argmax(short))
    return (
        f"it was at {reached[k]:.1f} m, {short[k]:.1f} m short of the {tolerance:g} m around "
        f"{depth:g} m"
    )


def battery_words(flight: Flight) -> str:
    """Return where the battery ran empty, and what pressing all volume out there still takes."""
    g, table, x = flight.plan.given, flight.plan.table, flight.end
    phase = flight.mission.titles[int(flight.whole[At.PHASE])]
    z, inside = float(x[Now.Z]), float(g[Given.V_MAX] - x[Now.V])
    rate, power = (
        look_up(table, float(g[Given.STEP]), column, max(z, 0.0))[0]
        for column in (Table.RATE_OUT, Table.POWER_OUT)
    )
    cycle = int(flight.whole[At.CYCLE]) + 1
    where = f"in the phase {phase!r} of cycle {cycle}, at {z:.1f} m"
    delivery = float(rate * g[Given.DELIVERY])
    if delivery <= 0.0:
        return f"{where}, where the drive stalls"
    return (
        f"{where}, {power / delivery * inside:.3g} J short of what it takes to press out the "
        f"{1e6 * inside:.4g} cm3 inside there"
    )
