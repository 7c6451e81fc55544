"""The filter as others call it: a plant, arrays of one log, the noise; what it estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.kalman.kernels import (
    filter_kernel,
    follow_kernel,
    predict_kernel,
    smooth_kernel,
)
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.engine.layers import NO_LAYERS, Layers

Array = NDArray[np.float64]
GATE = 3.0  # standard deviations of an innovation beyond which it is not believed in full


class Noise(NamedTuple):
    """How uncertain measurement and motion are."""

    depth: float  # m, 1 sigma of a measured depth, its quantum's share included
    random_walk: float  # m3/s^0.5, intensity of the neutral volume's random walk
    acceleration: float = 0.0  # m/s^1.5, intensity of white acceleration
    held_depth: float = 0.05  # m, 1 sigma of depths in contact with surface or bottom
    held_speed: float = 0.02  # m/s, the same of the speed

    def variances(self) -> Array:
        """Return the squares for the kernels: depths, random walk, acceleration, held speed."""
        intensities = self.random_walk, self.acceleration
        return np.square([self.depth, self.held_depth, *intensities, self.held_speed])


class Start(NamedTuple):
    """State before the first sample, with standard deviations; the three are independent."""

    depth: float  # m
    speed: float  # m/s
    neutral: float  # m3, neutral volume at depth 0, without what layers of the water add there
    depth_std: float
    speed_std: float
    neutral_std: float


class Samples(NamedTuple):
    """A log's arrays of one length n, and the layers of the water that it was made in."""

    time: Array  # s, growing
    volume: Array  # m3, linear between samples
    depth: Array  # m; nan: not measured
    use: NDArray[np.int8]  # 1: counts; 0: in contact, with the contact's noise; -1: not looked at
    layers: Layers = NO_LAYERS


@dataclass(frozen=True)
class Filtered:
    """What the filter made of n samples; states are (depth m, speed m/s, neutral volume m3)."""

    plant: Plant
    samples: Samples
    noise: Noise
    log_likelihood: float  # of the samples that count
    predicted: Array  # [n, 3], before each sample
    predicted_covariance: Array  # [n, 3, 3]
    mean: Array  # [n, 3], after each sample
    covariance: Array  # [n, 3, 3]
    innovation: Array  # m [n], measured less predicted; nan where not looked at
    variance: Array  # m2 [n], of the innovation
    contribution: Array  # [n], to the log likelihood
    fate: NDArray[np.int8]  # [n], UNSEEN ... RESTARTED of kernels
    slopes: Array  # [n, 3, 3], of each predicted state by the one before

    def ahead(self, first: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return depth [m] and its standard deviation [m] at samples `last`.

        Each from the state after the sample `first`, with the volume on the way known; the
        deviation is of the depth itself, without the measurement's noise.
        """
        depth, variance = np.empty(len(first)), np.empty(len(first))
        predict_kernel(
            np.array(self.plant), self.samples.layers, self.samples.time, self.samples.volume,
            self.mean[first], self.covariance[first], first, last, self.noise.variances(), depth,
            variance,
        )  # fmt: skip
        return depth, np.sqrt(variance)

    def smoothed(self) -> tuple[Array, Array]:
        """Return states [n, 3] and covariances [n, 3, 3] given all samples, earlier and later."""
        mean, covariance = self.mean.copy(), self.covariance.copy()
        smooth_kernel(self.predicted, self.predicted_covariance, self.slopes, mean, covariance)
        return mean, covariance


def filter_depth(
    plant: Plant, samples: Samples, *, noise: Noise, start: Start, gate: float = GATE
) -> Filtered:
    """Return what the extended Kalman filter makes of a log's depths.

    gate: innovations beyond so many standard deviations lose weight, the faster the farther they
    are: with a gate of 3, one of 6 counts as 0.5 and one of 30 as 0.04. Four in a row to one
    side show that the state is wrong, and the filter starts anew from
    the depth measured, with the speed's and the neutral volume's first deviations.
    """
    n = len(samples.time)
    before, spread, slopes = np.empty((n, 3)), np.empty((n, 3, 3)), np.zeros((n, 3, 3))
    mean, covariance = np.empty((n, 3)), np.empty((n, 3, 3))
    error, variance, contribution = np.empty(n), np.empty(n), np.empty(n)
    fate = np.empty(n, np.int8)
    total = filter_kernel(
        np.array(plant), samples.layers, samples.time, samples.volume, samples.depth, samples.use,
        np.array(start[:3]), np.diag(np.square(start[3:])), noise.variances(), gate, before, spread,
        slopes, mean, covariance, error, variance, contribution, fate,
    )  # fmt: skip
    return Filtered(
        plant=plant, samples=samples, noise=noise, log_likelihood=total, predicted=before,
        predicted_covariance=spread, mean=mean, covariance=covariance, innovation=error,
        variance=variance, contribution=contribution, fate=fate, slopes=slopes,
    )  # fmt: skip


def follow(
    plants: Sequence[Plant], layers: Layers, time: Array, volume: Array, starts: Array
) -> Array:
    """Return the depths [lanes, n] in m of several vehicles under one known volume.

    By the filter's own step, without noise, in layered water. volume [n] in m3, straight between
    the instants time [n] in s; starts [lanes, 2]: depth [m] and speed [m/s]. nan from where a
    vehicle left the water.
    """
    depth = np.empty((len(plants), len(time)))
    follow_kernel(
        np.array(plants), layers, np.ascontiguousarray(time, float),
        np.ascontiguousarray(volume, float), np.ascontiguousarray(starts, float), depth,
    )  # fmt: skip
    return depth
