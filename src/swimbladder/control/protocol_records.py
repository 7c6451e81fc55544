"""What the pool procedure goes by, remembers and is called: named tuples of floats, and names."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from swimbladder.control.cascade import CASCADE, CascadeParameters, CascadeState

MARGIN = 0.05  # m, from surface or bottom, that counts as arrived


class Does(Enum):
    """What the machine does in a phase, and when the phase is over."""

    WAIT = "Hold the piston until it is told to begin."
    HOLD = "Close the loop on a depth until the vehicle has been at rest there for a minute."
    HALT = "Hold the piston until the motor stands still."
    PULSE = "Apply a voltage for a time, to change the volume."
    GLIDE = "Hold the piston and wait for the surface or the bottom."
    DONE = "Hold the piston, or come up: the procedure is over."
    GAVE_UP = (
        "Hold the piston, or come up: the vehicle did not come to rest, or did not arrive, in time,"
        " or could not be measured."
    )


class Phase(NamedTuple):
    """A phase: the step of section 3.1 that it belongs to, what it does, and with what number."""

    step: str  # "a" to "d"; "" before the first and at the end
    does: Does
    target: float = 0.0  # HOLD: depth [m]; PULSE: volume of the first round [m3]; GLIDE: depth [m]

    @property
    def words(self) -> str:
        """What the board's log calls it."""
        what = self.does.name.lower().replace("_", " ")
        return f"({self.step}) {what}" if self.step else what


class PoolParameters(NamedTuple):
    """The procedure, the loop that holds a depth in it, and what it knows of the actuator."""

    loop: CascadeParameters  # which may be tuned coarsely
    deep: float  # m, where the vehicle rests in step (a)
    shallow: float  # m, and in step (c)
    surface: float  # m, where step (b) is over
    bottom: float  # m, and step (d)
    change: float  # m3, of the volume in the first round, positive
    more: float  # m3, by which each round's is larger than that of the one before
    rounds: float  # -, how often steps (a) to (d) are done
    rate_per_volt: float  # m3/s/V, K1 A
    limit: float  # V, the largest there is
    load_voltage: float  # V/m, that holds the piston against a metre of water; 0: none is applied
    minute: float  # s, over which rest is judged and the volume averaged
    rest_speed: float  # m/s, mean speed over the minute that counts as none
    rest_distance: float  # m, of the mean depth from its target that counts as there
    halt: float  # s, for the motor to stop
    patience: float  # s, longest that a phase may take
    blind: float  # s, longest without a measurement that can be
    depth_least: float  # m, that can be
    depth_most: float  # m
    volume_least: float  # m3
    volume_most: float  # m3
    end_volume: float  # m3, to go to when it is over; infinite: the piston is held where it is

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The phases by their number, with the change of volume of the first round."""
        return (
            Phase("a", Does.HOLD, self.deep),
            Phase("b", Does.HALT),
            Phase("b", Does.PULSE, self.change),
            Phase("b", Does.GLIDE, self.surface),
            Phase("c", Does.HOLD, self.shallow),
            Phase("d", Does.HALT),
            Phase("d", Does.PULSE, -self.change),
            Phase("d", Does.GLIDE, self.bottom),
            Phase("", Does.DONE),
            Phase("", Does.GAVE_UP),
        )


POOL_UNITS = {
    **CASCADE.units,
    **dict.fromkeys(
        ("deep", "shallow", "surface", "bottom", "rest_distance", "depth_least", "depth_most"), "m"
    ),
    **dict.fromkeys(("change", "more", "volume_least", "volume_most", "end_volume"), "m3"),
    **dict.fromkeys(("minute", "halt", "patience", "blind"), "s"),
    "rounds": "", "rate_per_volt": "m3/s/V", "limit": "V", "load_voltage": "V/m",
    "rest_speed": "m/s",
}  # fmt: skip


def procedure_for(
    loop: CascadeParameters, *, rate_per_volt: float, limit: float, load_voltage: float,
    pool_depth: float, clearance: float, change: float,
) -> PoolParameters:  # fmt: skip
    """Return one round for a change of volume [m3], positive, with the times of section 3.1.

    pool_depth: where the vehicle stands on the bottom [m]; clearance: Delta_z [m], from bottom and
    surface to the depths of rest; rate_per_volt: K1 A [m3/s/V]; limit [V]; load_voltage [V/m].
    Every measurement that is a number counts as possible, and at the end the piston is held.
    """
    return PoolParameters(
        loop=loop, deep=pool_depth - clearance, shallow=clearance, surface=MARGIN,
        bottom=pool_depth - MARGIN, change=change, more=0.0, rounds=1.0,
        rate_per_volt=rate_per_volt, limit=limit, load_voltage=load_voltage,
        minute=60.0, rest_speed=5e-4, rest_distance=0.02, halt=0.6, patience=1200.0, blind=10.0,
        depth_least=-math.inf, depth_most=math.inf, volume_least=-math.inf, volume_most=math.inf,
        end_volume=math.inf,
    )  # fmt: skip


class Window(NamedTuple):
    """Sums over consecutive samples, from which come means and a slope.

    Depths and volumes count from some depth and volume near them, and time in samples: so float32
    is enough.
    """

    samples: float  # -
    z: float  # m
    kz: float  # m, each times the number of samples before it
    V: float  # m3


class PoolState(NamedTuple):
    """What the procedure remembers between samples."""

    phase: float  # -, index into PoolParameters.phases; -1: it waits to be told to begin
    completed: float  # -, rounds that are behind it
    ticks: float  # since the phase began
    blind: float  # ticks since the last measurement that can be
    depth: float  # m, of that one
    loop: CascadeState
    window: Window  # depths count from the target, volumes from `neutral`
    neutral: float  # m3, mean volume of the last minute at rest
    pulse: float  # V
    pulses: float  # ticks of it that are left
    gave_up_in: float  # -, the phase in which it did; -1: it did not
