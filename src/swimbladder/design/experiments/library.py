"""The releases that a design chooses from: steps, and to and fro, of sizes and places on a grid."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from swimbladder.design.experiments.conditions import Ramps, Release, Setting, Turn
from swimbladder.design.experiments.fisher_information import Question
from swimbladder.design.experiments.flight import follow

_SIZES = 7
_SECOND = (1.0, 0.5, 0.0)  # of the first volume, with the other sign; 0: coasting
_PLACES = (0.35, 0.5, 0.65)  # of the way through the range at which the volume is reversed
_HALVINGS = 12
_GRIDS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)  # m, of depths that a person sets
_GRID = 50.0  # of these in the range, at least
_QUICKEST = 60  # samples of the shortest record
_SURE = 4.0  # deviations of the neutral volume, so that the vehicle leaves the way it should


def sizes(question: Question, ramps: Ramps, setting: Setting) -> list[float]:
    """Return sizes of volume changes [m3], from one that takes half the longest record to cross
    the range, to the largest that the stroke has and whose record is long enough.
    """
    most = min(ramps.most, -ramps.least)

    def duration(size: float) -> float:
        release = Release.to_and_fro(setting.deepest, [size], [])
        return follow(release, question.model, question.values, ramps, setting).duration

    large = _where(duration, _QUICKEST * setting.sample_time, 1e-4 * most, most)
    least = _where(duration, 0.5 * setting.longest, 1e-4 * most, most)
    if math.isfinite(setting.neutral_std):
        least = max(least, _SURE * setting.neutral_std)
    found: list[float] = np.geomspace(min(least, 0.5 * large), large, _SIZES).tolist()
    return found


def _where(duration: Callable[[float], float], wanted: float, low: float, high: float) -> float:
    """Return the size at which a step takes the time wanted, or an end of the range of sizes."""
    if duration(high) >= wanted:
        return high
    if duration(low) <= wanted:
        return low
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if duration(middle) > wanted else (low, middle)
    return math.sqrt(low * high)


def releases(question: Question, ramps: Ramps, setting: Setting) -> list[list[Release]]:
    """Return the candidates, from rest near the bottom and near the surface, in families.

    Each release of a family goes on where the one before it ends.
    """
    found: list[list[Release]] = []
    counts = sorted({n for n in (2, 4, 6, 8, setting.moves) if 2 <= n <= setting.moves})
    for size in sizes(question, ramps, setting):
        for start, sign in ((setting.deepest, 1.0), (setting.shallowest, -1.0)):
            first = sign * size
            found.append([Release.to_and_fro(start, [first], [])])
            for place in _PLACES if setting.moves > 1 else ():
                turn = start - sign * place * (setting.deepest - setting.shallowest)
                for second in _SECOND:
                    back, lengths = -second * first, counts if second else [2]
                    family = [
                        Release.to_and_fro(start, ([first, back] * n)[:n], [turn] * (n - 1))
                        for n in lengths
                    ]
                    found.append(family)
    return [[rounded(release, setting) for release in family] for family in found]


def rounded(release: Release, setting: Setting) -> Release:
    """Return a release with volumes and depths of moves that a person can set."""
    span = setting.deepest - setting.shallowest
    grid = next((g for g in _GRIDS if g <= span / _GRID), _GRIDS[-1])
    first = abs(release.moves[0].volume)
    step = 10.0 ** (math.floor(math.log10(first)) - 1)  # two digits of the first volume
    moves = []
    for volume, when in release.moves:
        place = when
        if when is not None:
            inside = min(max(when.depth, setting.shallowest + grid), setting.deepest - grid)
            place = when._replace(depth=round(grid * round(inside / grid), 6))
        moves.append(Turn(float(f"{step * round(volume / step):.6g}"), place))
    return release._replace(moves=tuple(moves))
