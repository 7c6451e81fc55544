"""A column as one array, and its values at any depth: cubic Hermite, one read, no search.

`look_up_bent` is plain Python on scalars; kernels compile it (`engine.cache.part`). Slopes are
those of Fritsch and Butland (1984, SIAM J. Sci. Stat. Comput. 5, 300), so that what rises between
two depths of the column rises all the way between them: the lookup makes no density inversion of
its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.seawater.column import Column

Array = NDArray[np.float64]
PRESSURE, DENSITY, TEMPERATURE = 0, 2, 4  # columns of a table; the slope stands one further


def slopes(values: Array, step: float) -> Array:
    """Return the slopes [n] of values [n] on a grid of that step, without overshoot between."""
    if len(values) == 2:
        return np.full(2, (values[1] - values[0]) / step)
    from scipy.interpolate import PchipInterpolator

    at = step * np.arange(float(len(values)))
    return np.asarray(PchipInterpolator(at, values).derivative()(at))


def water_table(column: Column) -> Array:
    """Return a column as an array [n, 6]: pressure, density, temperature, each with its slope.

    SI and degC, slopes per metre; rows a `Column.step` apart. `look_up` reads it.
    """
    values = (column.pressure, column.density, column.temperature)
    parts = [part for v in values for part in (v, slopes(v, column.step))]
    return np.ascontiguousarray(np.stack(parts, axis=1))


def look_up(table: Array, step: float, what: int, z: float) -> tuple[float, float]:
    """Return a value of a table [n, k] and its slope at depth z [m], both continuous.

    what: the column of the value, its slope being the next. Beyond the ends the end's value goes
    on along the end's slope.
    """
    return look_up_bent(table, step, what, z)[:2]


def look_up_bent(table: Array, step: float, what: int, z: float) -> tuple[float, float, float]:
    """Return what `look_up` does and the curvature, which a Jacobian takes; kernels compile it."""
    last = table.shape[0] - 2
    s = z / step
    k = min(max(int(s), 0), last)
    s = s - k
    a, b = table[k, what], table[k + 1, what]
    da, db = table[k, what + 1] * step, table[k + 1, what + 1] * step
    if s < 0.0:
        return a + da * s, da / step, 0.0
    if s > 1.0:
        return b + db * (s - 1.0), db / step, 0.0
    c2 = 3.0 * (b - a) - 2.0 * da - db
    c3 = 2.0 * (a - b) + da + db
    return (
        a + s * (da + s * (c2 + s * c3)),
        (da + s * (2.0 * c2 + 3.0 * s * c3)) / step,
        (2.0 * c2 + 6.0 * s * c3) / (step * step),
    )
