"""What a fit to voltage steps turns: parameters, predictions, and the residuals of each block."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from swimbladder.identify_actuator.bench import Bench
from swimbladder.identify_actuator.blocks import Block
from swimbladder.identify_actuator.noise import Autoregression
from swimbladder.identify_actuator.response import Drive, respond, steady_speed

__all__ = ["FIRST", "LOGARITHMIC", "Problem", "Whitener", "drive_of"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LOGARITHMIC = ("K1", "T1", "asymmetry", "rate")
FIRST = {"K1": 1e-3, "T1": 0.1, "dead_zone": 0.0, "load_voltage": 0.0, "asymmetry": 1.0}
_WHITE = Autoregression((), ((),), (1.0,))


def drive_of(values: Mapping[str, float]) -> Drive:
    """Return the actuator with the values of K1, T1, dead_zone, load_voltage, asymmetry, rate.

    K1 is the geometric mean of the gains outward and inward, asymmetry their ratio.
    """
    ratio = math.sqrt(values["asymmetry"])
    return Drive(
        K_out=values["K1"] * ratio,
        K_in=values["K1"] / ratio,
        T1=values["T1"],
        dead_zone=max(values["dead_zone"], 0.0),
        load=values["load_voltage"],
        rate=values.get("rate", math.inf),
    )


@dataclass(frozen=True)
class Whitener:
    """Makes the residual of a block white, without its start, and less sure of its gain.

    one: the whitened column of the unknown start, of length 1; gain: that of a gain of the block's
    own, orthogonal to it and of length 1; keep: what is left of the residual along it.
    """

    autoregression: Autoregression
    one: Array
    gain: Array
    keep: float

    def __call__(self, residual: Array) -> Array:
        """Return the whitened residual [n]."""
        white = self.autoregression.whiten(residual[:, None])[:, 0]
        white = white - (self.one @ white) * self.one
        return white - (1.0 - self.keep) * (self.gain @ white) * self.gain


@dataclass
class Problem:
    """Benches cut into blocks, and the parameters that are free.

    Parameters are turned as numbers near 1: logarithms for what is positive, voltages in units of
    the largest. used: for each block which of its samples are no outliers.
    """

    benches: Sequence[Bench]
    blocks: Sequence[Block]
    free: tuple[str, ...]
    fixed: Mapping[str, float]
    moving: Mapping[tuple[int, int], bool]  # (log, run): whether it begins in motion
    used: list[Mask] = field(default_factory=list)
    whiteners: list[Whitener] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Use every sample until told otherwise."""
        self.top = max(
            float(np.abs(b.voltage).max()) for b in self.benches if b.voltage is not None
        )
        self.used = self.used or [np.ones(len(block.samples), bool) for block in self.blocks]

    def values(self, q: Array) -> dict[str, float]:
        """Return all parameters in SI."""
        found = dict(self.fixed)
        for name, number in zip(self.free, q.tolist(), strict=True):
            found[name] = math.exp(number) if name in LOGARITHMIC else number * self.top
        return found

    def turned(self, values: Mapping[str, float]) -> Array:
        """Return the free parameters as they are turned."""
        return np.array(
            [
                math.log(values[name]) if name in LOGARITHMIC else values[name] / self.top
                for name in self.free
            ]
        )

    def bounds(self) -> tuple[Array, Array]:
        """Return the least and the greatest of what is turned."""
        least = [-1.0 if name == "load_voltage" else 0.0 for name in self.free]
        least = [
            -46.0 if n in LOGARITHMIC else low for n, low in zip(self.free, least, strict=True)
        ]
        most = [46.0 if name in LOGARITHMIC else 1.0 for name in self.free]
        return np.array(least), np.array(most)

    def travels(self, q: Array) -> list[Array]:
        """Return the predicted travel of every bench [m], from an unknown start in each run."""
        drive = drive_of(self.values(q))
        found = []
        for log, bench in enumerate(self.benches):
            assert bench.voltage is not None
            travel = np.zeros(len(bench.time))
            for run, (first, after) in enumerate(bench.runs):
                u = bench.voltage[first:after]
                begun = steady_speed(float(u[0]), drive) if self.moving[(log, run)] else 0.0
                part, _ = respond(bench.time[first:after], u, drive, first_speed=begun)
                travel[first:after] = part
            found.append(travel)
        return found

    def residuals(self, q: Array) -> list[Array]:
        """Return measured less predicted travel for each block [m], its start not taken off."""
        travels = self.travels(q)
        return [
            (self.benches[b.log].position[b.samples] - travels[b.log][b.samples])
            for b in self.blocks
        ]

    def white(self, q: Array) -> Array:
        """Return the whitened residuals of all blocks, which a fit makes small."""
        return np.concatenate(
            [
                whiten(residual[used])
                for whiten, residual, used in zip(
                    self.whiteners, self.residuals(q), self.used, strict=True
                )
                if used.sum() >= 2
            ]
        )

    def whitened_with(self, q: Array, noise: Autoregression, spread: float, sigma: float) -> None:
        """Choose the whiteners: `noise`, and gains that differ by `spread` (a share) by block."""
        travels = self.travels(q)
        self.whiteners = []
        for block, used in zip(self.blocks, self.used, strict=True):
            travel = travels[block.log][block.samples][used]
            columns = np.stack([np.ones(len(travel)), travel - travel[:1].sum()], axis=1)
            one, gain = noise.whiten(columns).T if len(travel) else (np.zeros(0), np.zeros(0))
            one = _unit(one)
            gain = gain - (one @ gain) * one
            size = float(np.linalg.norm(gain))
            keep = 1.0 / math.sqrt(1.0 + (spread * size / sigma) ** 2) if sigma > 0.0 else 1.0
            self.whiteners.append(Whitener(noise, one, _unit(gain), keep))

    def plainly(self, q: Array) -> None:
        """Choose whiteners for white noise and one gain."""
        self.whitened_with(q, _WHITE, 0.0, 1.0)


def _unit(column: Array) -> Array:
    size = float(np.linalg.norm(column))
    return column / size if size > 0.0 else column
