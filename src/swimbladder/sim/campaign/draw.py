"""What differs from float to float: trim, hull, drag, pump, and the water it is in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.sim.mission.core.names import Given
from swimbladder.sim.mission.prepare import Plan

__all__ = ["Drawn", "Spread", "draw", "varied"]

Array = NDArray[np.float64]
_CUT = 3.0  # sigma; a share of -1 or a drag of 0 is no float


@dataclass(frozen=True, kw_only=True)
class Spread:
    """1 sigma of what is not the same in all floats, normal and cut at 3 sigma.

    trim: of the neutral volume [m3]; psi: of the hull's compression [m3/m]; drag: as a share;
    pump: of the delivery, as a share, which the processor does not know of.
    """

    trim: float = 5e-6
    psi: float = 2e-9
    drag: float = 0.1
    pump: float = 0.05

    def __post_init__(self) -> None:
        """Refuse what is no spread."""
        for name, most, unit in (
            ("trim", 1.0, "m3"), ("psi", 1.0, "m3/m"), ("drag", 0.3, ""), ("pump", 0.3, ""),
        ):  # fmt: skip
            value = getattr(self, name)
            if not 0.0 <= value <= most:
                raise InputError(
                    f"not between 0 and {most:g}", field=f"--{name}-std", value=value, unit=unit,
                    remedy="Give 1 sigma" + ('; "10 %" is 0.1' if not unit else ""),
                )  # fmt: skip


class Drawn(IntEnum):
    """What is drawn for a float."""

    TRIM = 0  # m3, more neutral volume
    PSI = 1  # m3/m, more of it per metre
    DRAG = 2  # -, factor
    PUMP = 3  # -, factor
    CAST = 4  # which water
    COUNT = 5


def draw(spread: Spread, *, seed: int, number: int, casts: int) -> Array:
    """Return what float `number` of a seed is like: of `Drawn`; the same in every campaign."""
    random = np.random.default_rng([seed, number])
    z = np.clip(random.standard_normal(4), -_CUT, _CUT)
    return np.array(
        [
            spread.trim * z[0], spread.psi * z[1], 1.0 + spread.drag * z[2],
            1.0 + spread.pump * z[3], float(random.integers(casts)),
        ]
    )  # fmt: skip


def varied(plan: Plan, drawn: Array) -> Plan:
    """Return a plan for a float that differs so; the table is shared, not copied."""
    given = plan.given.copy()
    given[Given.TRIM] += drawn[Drawn.TRIM]
    given[Given.GIVE] += drawn[Drawn.PSI]
    given[Given.DELIVERY] *= drawn[Drawn.PUMP]
    for place in (Given.D_L, Given.D_B, Given.D_0, Given.D_T):
        given[place] *= drawn[Drawn.DRAG]
    return replace(plan, given=given)
