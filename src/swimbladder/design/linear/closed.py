"""The sampled closed loop of a vehicle and its law: poles, margins, delays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swimbladder.design.linear.depths import DepthLoad, depth_load
from swimbladder.design.linear.margins import (
    Margins,
    equivalent_poles,
    largest_delay,
    loop_margins,
    spectral_radius,
)
from swimbladder.design.linear.models import Array, StateSpace, linearise
from swimbladder.design.linear.sampled import LinearLaw, SampledLoop, command_slope
from swimbladder.physics.dynamics import Plant

_LONGEST = 100  # samples: the longest delay that eigenvalues are computed for


class Mode(NamedTuple):
    """A pole of the closed sampled loop, and the pole in continuous time that samples to it."""

    z: complex  # -
    s: complex  # 1/s, -inf where z is 0
    damping: float  # -, of a pair; 1 for a decay without oscillation
    time_constant: float  # s, of the decay; inf where it does not decay


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoop:
    """What the linear analysis says of a vehicle under its law, at the law's sample time."""

    law: str
    loop: SampledLoop
    sample_time: float  # s
    modes: tuple[Mode, ...]  # slowest first
    spectral_radius: float  # -
    spectral_radius_back_driven: float  # -, with the load of a motor that the sea drives back
    at_command: Margins | None  # loop broken at the voltage, or at a positioner's volume
    at_depth: Margins | None  # loop broken at the measured depth
    computation_delay: float  # s, longest that the loop survives
    radius_at_whole_sample: float  # -, spectral radius with one whole sample of computation
    depth_delay: float  # s, longest age of the measured depth that the loop survives
    depth_load: DepthLoad | None  # where the law feeds the volume back to a voltage
    inner_gain_per_sample: float  # -, K1 A k_pV times the sample time; nan without an inner loop
    volume_per_sample: float  # m3, farthest that a positioner goes in a sample; nan for a motor
    error_at_rate_limit: float  # m, sudden error whose first command is farther; nan for a motor

    @property
    def one_loop(self) -> bool:
        """Whether the law looks at the depth only, so that it is one loop wherever it is broken."""
        law = self.loop.law.system
        volume = law.inputs.index("volume")
        return not (law.B[:, volume].any() or law.D[:, volume].any())

    @property
    def stable(self) -> bool:
        """Whether small disturbances decay, the motor driving or driven back."""
        return max(self.spectral_radius, self.spectral_radius_back_driven) < 1.0


def close(p: Plant, law: LinearLaw, *, name: str, depth: float) -> ClosedLoop:
    """Return the analysis of a plant at `depth` [m] under a law that was linearised at rest.

    The command is a voltage, or for a positioner a volume that counts as reached at once.
    """
    h = law.sample_time
    loop = SampledLoop(plant=linearise(p, depth=depth), law=law)
    matrix = loop.closed()
    radius = spectral_radius(matrix)
    at_command, at_depth = (
        loop_margins(loop.broken_at_command()),
        loop_margins(loop.broken_at_depth()),
    )
    back = SampledLoop(plant=linearise(p, depth=depth, back_driving=True), law=law)
    k_pV = -command_slope(law, "volume")
    inner = k_pV > 0.0 and not p.positioner
    first = abs(float(law.system.D[0, law.system.inputs.index("depth")]))
    per_sample = p.rate * h if p.positioner else math.nan
    return ClosedLoop(
        law=name,
        loop=loop,
        sample_time=h,
        modes=_modes(loop.broken_at_command(), h),
        spectral_radius=radius,
        spectral_radius_back_driven=radius if p.positioner else spectral_radius(back.closed()),
        at_command=at_command,
        at_depth=at_depth,
        computation_delay=_delay(lambda d: loop.closed(command_delay=d), h, at_command),
        radius_at_whole_sample=spectral_radius(loop.closed(command_delay=h)),
        depth_delay=_delay(lambda d: loop.closed(depth_delay=d), h, at_depth),
        depth_load=depth_load(p, k_pV=k_pV) if inner else None,
        inner_gain_per_sample=p.gain * k_pV * h if inner else math.nan,
        volume_per_sample=per_sample,
        error_at_rate_limit=per_sample / first if first else math.inf,
    )


def _delay(closed: Callable[[float], Array], h: float, found: Margins | None) -> float:
    """Longest delay by eigenvalues; by the frequency response where that is beyond their reach.

    A delay of so many samples belongs to a crossing so slow that sampling no longer matters.
    """
    if found is None:
        return 0.0
    if found.delay > 0.5 * _LONGEST * h:
        return found.delay
    horizon = min(3.0 * found.delay + 3.0 * h, _LONGEST * h)
    return largest_delay(closed, step=max(h / 16.0, horizon / 200.0), horizon=horizon)


def _modes(loop: StateSpace, h: float) -> tuple[Mode, ...]:
    z = np.linalg.eigvals(loop.A - loop.B @ loop.C)
    z = z[np.lexsort((-z.imag, -np.abs(z)))]
    found = []
    for pole, s in zip(z, equivalent_poles(z, h), strict=True):
        decay = -float(s.real)
        damping = 1.0 if math.isinf(decay) else decay / abs(complex(s)) if s else 0.0
        time_constant = 1.0 / decay if decay > 0.0 else math.inf
        found.append(Mode(complex(pole), complex(s), damping, time_constant))
    return tuple(found)
