"""First values for a fit, from a regression that needs none.

The equation of motion is multiplied by a smooth function that vanishes with its slope at both ends
of a window and integrated by parts (Shinbrot's modulating functions), so that no measured depth is
differentiated twice and the equation is linear in what is sought. Noise biases the outcome; the
fit that starts there does not inherit that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import lsq_linear

from swimbladder.estimation.motion.model import Model
from swimbladder.estimation.motion.problem import Experiment, Segment
from swimbladder.estimation.series import Array

_CLEARLY = 8.0  # standard deviations
_WINDOW = 12.0  # s
_SMOOTH = 1.5  # s, over which speeds are taken


def backwards(experiments: Sequence[Experiment]) -> bool:
    """Return whether the vehicles clearly sink as their volume grows, by the same regression."""
    A, b = _rows(experiments, psi=None, law="linear", free_neutral=True)
    if len(b) < 12:
        return False
    size = np.maximum(np.abs(A).max(axis=0), 1e-300)
    X = (A / size)[:, np.abs(A).max(axis=0) > 0.0]
    found, _, rank, _ = np.linalg.lstsq(X, b, rcond=1e-9)
    if rank < X.shape[1]:
        return False
    left = b - X @ found
    spread = float(left @ left) / max(len(b) - X.shape[1], 1)
    std = math.sqrt(max(spread * float(np.linalg.pinv(X.T @ X)[0, 0]), 1e-300))
    return float(found[0]) < -_CLEARLY * std


def regression(
    experiments: Sequence[Experiment], model: Model, *, psi: float | None, free_neutral: bool
) -> tuple[dict[str, float], Array] | None:
    """Return first values by name and each experiment's neutral-volume error [m3], or None.

    psi [m3/m]: None where it is sought too. free_neutral: whether the neutral volumes are unknown
    by more than the fit's first steps can mend. None where the data give no sensible values.
    """
    A, b = _rows(experiments, psi=psi, law=model.law, free_neutral=free_neutral)
    if len(b) < 6:
        return None
    size = np.maximum(np.abs(A).max(axis=0), 1e-300)
    least = np.full(A.shape[1], -np.inf)
    least[[0, 2, 3]] = 0.0
    found = lsq_linear(A / size, b, bounds=(least, np.full(A.shape[1], np.inf))).x / size
    return _sensible(found, model, psi)


def _rows(
    experiments: Sequence[Experiment], *, psi: float | None, law: str, free_neutral: bool
) -> tuple[Array, Array]:
    """Return the regression's matrix [windows, 4 + experiments] and left side [windows].

    None at all where a volume is not known.
    """
    rows: list[Array] = []
    left: list[float] = []
    if not all(e.ramps for e in experiments):
        return np.zeros((0, 4 + len(experiments))), np.zeros(0)
    for j, e in enumerate(experiments):
        for s in e.segments:
            for values, integral in _windows(e, s):
                drive, depth, one, laminar, turbulent = values
                row = np.zeros(4 + len(experiments))
                if psi is None:
                    row[0], row[1] = -drive, depth
                else:
                    row[0] = psi * depth - drive
                if law != "quadratic":
                    row[2] = laminar
                if law != "linear":
                    row[3] = -turbulent
                if free_neutral:
                    row[4 + j] = one
                rows.append(row)
                left.append(integral)
    return np.array(rows).reshape(-1, 4 + len(experiments)), np.array(left)


def _sensible(
    found: Array, model: Model, psi: float | None
) -> tuple[dict[str, float], Array] | None:
    a_b, stiff, d_l, d_t = found[:4].tolist()
    if a_b <= 0.0:
        return None
    m = model.specific_weight / a_b
    d_l = max(d_l, 1e-3)
    values = {"psi": stiff / a_b if psi is None else psi}
    values["psi"] = float(np.clip(values["psi"], -10.0 * model.psi_scale, 10.0 * model.psi_scale))
    if model.law == "quadratic":
        values |= {"mass": m, "drag_quadratic": max(d_t, 1e-2) * m}
    else:
        values |= {"K2": a_b / d_l, "T2": 1.0 / d_l}
        if model.law == "blended":
            values["drag_quadratic"] = d_t * m
    return values, found[4:] / a_b


def _windows(e: Experiment, s: Segment) -> list[tuple[tuple[float, ...], float]]:
    """Return, for overlapping windows, the integrals of the equation's terms and of its left side.

    The terms: volume against neutral, depth against the reference, 1, speed (by parts), speed
    squared with its sign.
    """
    part = slice(s.first, s.last + 1)
    time, measured = e.record.time[part], e.record.depth[part]
    depth = median_filter(measured, size=3, mode="nearest")
    volume = e.inputs[part] - e.neutral + e.added - e.record.layers.along(depth)
    depth = depth - e.reference
    span = float(time[-1] - time[0])
    half = 0.5 * min(_WINDOW, span)
    speed = _speed(time, depth)
    found = []
    for centre in np.arange(time[0] + half, time[-1] - half + 1e-9, half / 2.0):
        inside = np.abs(time - centre) <= half
        if inside.sum() < 6:
            continue
        t = time[inside]
        x = (t - centre) / half
        f = (1.0 - x**2) ** 3
        df = -6.0 * x * (1.0 - x**2) ** 2 / half
        ddf = (-6.0 * (1.0 - x**2) ** 2 + 24.0 * x**2 * (1.0 - x**2)) / half**2
        z, w = depth[inside], speed[inside]
        middle = float(z.mean())  # of no effect but on rounding and the trapezoidal rule
        terms = (f * volume[inside], f * z, f, df * (z - middle), f * w * np.abs(w))
        found.append(
            (
                tuple(float(np.trapezoid(term, t)) for term in terms),
                float(np.trapezoid(ddf * (z - middle), t)),
            )
        )
    return found


def _speed(time: Array, depth: Array) -> Array:
    """Return speeds [m/s], smoothed over a second or so."""
    step = float(np.median(np.diff(time)))
    width = max(1, round(_SMOOTH / step))
    padded = np.pad(depth, width, mode="reflect", reflect_type="odd")
    smooth = np.convolve(padded, np.ones(2 * width + 1) / (2 * width + 1), mode="valid")
    result: Array = np.gradient(smooth, time)
    return result
