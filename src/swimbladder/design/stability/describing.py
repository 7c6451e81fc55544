"""Describing functions: what a nonlinearity makes of the first harmonic of a sine.

After Gelb and Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design,
McGraw-Hill 1968, chapter 2 and appendix B. All here are odd. Those without memory are real, with a
slope of 1 where they are linear; those with memory turn the phase as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_TURN = 4096  # points of a period


@dataclass(frozen=True, kw_only=True)
class Nonlinearity:
    """One nonlinearity: what it does to a sine, and to its first harmonic.

    size: its limit, half of its dead zone, or its quantum, in the unit of what goes in. onset:
    amplitude up to which N is 1 or 0; reach: times the onset, up to which cycles are looked for.
    """

    name: str
    size: float
    onset: float
    reach: float
    gain: Callable[[Array], Complex]  # amplitudes -> N(A) [-]
    output: Callable[[Array], Array]  # two periods of a signal -> what comes out

    def amplitudes(self, count: int) -> Array:
        """Return amplitudes beyond the onset, closest where N changes most."""
        return self.onset * (1.0 + np.geomspace(1e-8, self.reach, count))

    def third(self, amplitude: float) -> float:
        """Return the third harmonic of the output over the first [-]; inf where there is none."""
        first = abs(harmonic(self.output, amplitude, 1))
        return abs(harmonic(self.output, amplitude, 3)) / first if first > 0.0 else math.inf


def harmonic(output: Callable[[Array], Array], amplitude: float, order: int) -> complex:
    """Return a harmonic of output(amplitude sin t) against the sine, in the second period."""
    t = (np.arange(2 * _TURN) + 0.5) * 2.0 * math.pi / _TURN
    y = output(amplitude * np.sin(t))[_TURN:]
    found = 2j * np.mean(y * np.exp(-1j * order * t[_TURN:]))
    return complex(found)


def _cap(x: Array) -> Array:
    """Return (2/pi) (asin x + x sqrt(1 - x^2)), the share of a sine below x of its amplitude."""
    x = np.clip(x, -1.0, 1.0)
    result: Array = 2.0 / math.pi * (np.arcsin(x) + x * np.sqrt(1.0 - x * x))
    return result


def saturation(limit: float) -> Nonlinearity:
    """Return a limit to either side: N = 1 up to it, then (2/pi)(asin r + r sqrt(1-r^2)), r = d/A.

    Gelb and Vander Velde 1968, appendix B.
    """
    return Nonlinearity(
        name="saturation", size=limit, onset=limit, reach=1e5,
        gain=lambda A: _cap(limit / A).astype(np.complex128),
        output=lambda x: np.clip(x, -limit, limit),
    )  # fmt: skip


def dead_zone(half: float) -> Nonlinearity:
    """Return a dead zone of `half` to either side: N is 1 less that of the limit at its edge."""
    return Nonlinearity(
        name="dead zone", size=half, onset=half, reach=1e5,
        gain=lambda A: (1.0 - _cap(half / A)).astype(np.complex128),
        output=lambda x: x - np.clip(x, -half, half),
    )  # fmt: skip


def quantiser(quantum: float) -> Nonlinearity:
    """Return rounding to a quantum q: N = (4 q/pi A) sum sqrt(1 - ((2 i - 1) q/2 A)^2).

    The sum is over the steps that the sine reaches; its greatest value is 4/pi, at A = q/sqrt 2.
    """
    edges = (np.arange(1, 41) - 0.5) * quantum

    def gain(A: Array) -> Complex:
        reached = np.sqrt(np.maximum(1.0 - (edges / A[..., None]) ** 2, 0.0)).sum(axis=-1)
        return np.asarray(4.0 * quantum / (math.pi * A) * reached, dtype=np.complex128)

    return Nonlinearity(
        name="quantiser", size=quantum, onset=0.5 * quantum, reach=78.0, gain=gain,
        output=lambda x: quantum * np.floor(x / quantum + 0.5),
    )  # fmt: skip


def relay(level: float, hysteresis: float = 0.0) -> Nonlinearity:
    """Return a switch between -level and level that turns `hysteresis` beyond 0.

    N = (4 level/(pi A)) (sqrt(1 - (h/A)^2) - j h/A).
    """
    h = hysteresis

    def gain(A: Array) -> Complex:
        sine = h / A
        found: Complex = 4.0 * level / (math.pi * A) * (np.sqrt(1.0 - sine**2) - 1j * sine)
        return found

    def output(x: Array) -> Array:
        turned = np.where(x > h, 1.0, np.where(x < -h, -1.0, 0.0))
        last = np.maximum.accumulate(np.where(turned != 0.0, np.arange(len(x)), 0))
        held: Array = level * turned[last]
        return held

    onset = h if h > 0.0 else 1e-4 * level
    return Nonlinearity(
        name="relay", size=max(h, level), onset=onset, reach=1e5 * level / onset, gain=gain,
        output=output,
    )  # fmt: skip


def play(half: float) -> Nonlinearity:
    """Return play: what follows is dragged along once the gap is `half` (backlash of 2 half).

    N = (1 + cap(x))/2 - j (4 b/(pi A)) (1 - b/A), x = 1 - 2 b/A, b = half.
    """

    def gain(A: Array) -> Complex:
        ratio = half / A
        found: Complex = 0.5 * (1.0 + _cap(1.0 - 2.0 * ratio)) - 1j * (
            4.0 / math.pi * ratio * (1.0 - ratio)
        )
        return found

    def output(x: Array) -> Array:
        followed, y = np.empty_like(x), 0.0
        for i, value in enumerate(x):
            y = min(max(y, value - half), value + half)
            followed[i] = y
        return followed

    return Nonlinearity(
        name="play", size=half, onset=half, reach=1e5, gain=gain, output=output
    )  # fmt: skip
