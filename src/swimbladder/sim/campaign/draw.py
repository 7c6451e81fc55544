"""What differs from float to float: trim, hull, drag, pump, mass, and the water it is in."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.engine.rodas.names import Given
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle.spread import Spread

Array = NDArray[np.float64]
_CUT = 3.0  # sigma; a share of -1 or a drag of 0 is no float


class Drawn(IntEnum):
    """What is drawn for a float."""

    TRIM = 0  # m3, more neutral volume
    PSI = 1  # m3/m, more of it per metre
    DRAG = 2  # -, factor
    PUMP = 3  # -, factor
    MASS = 4  # -, factor
    CAST = 5  # which water
    COUNT = 6


def draw(spread: Spread, *, seed: int, number: int, casts: int) -> Array:
    """Return what float `number` of a seed is like: of `Drawn`; the same in every campaign."""
    random = np.random.default_rng([seed, number])
    z = random.standard_normal(4)
    cast = float(random.integers(casts))
    return drawn_of(spread, np.append(z, random.standard_normal()), cast)


def drawn_of(spread: Spread, z: Array, cast: float) -> Array:
    """Return a float of standard normal numbers z [inputs] and its water: of `Drawn`."""
    if spread.correlation:
        values, vectors = np.linalg.eigh(spread.matrix)
        z = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T @ z
    trim, psi, drag, pump, mass = np.clip(z, -_CUT, _CUT)
    return np.array(
        [
            spread.trim * trim, spread.psi * psi, 1.0 + spread.drag * drag,
            1.0 + spread.pump * pump, 1.0 + spread.mass * mass, cast,
        ]
    )  # fmt: skip


def varied(plan: Plan, drawn: Array) -> Plan:
    """Return a plan for a float that differs so; the table is shared, not copied."""
    given = plan.given.copy()
    given[Given.TRIM] += drawn[Drawn.TRIM]
    given[Given.GIVE] += drawn[Drawn.PSI]
    given[Given.DELIVERY] *= drawn[Drawn.PUMP]
    given[Given.MASS] *= drawn[Drawn.MASS]
    given[Given.A_S] /= drawn[Drawn.MASS]
    for place in (Given.D_L, Given.D_B, Given.D_0, Given.D_T):
        given[place] *= drawn[Drawn.DRAG] / drawn[Drawn.MASS]
    return replace(plan, given=given)
