"""Values of the table at any place: cubic Hermite, one read, no search."""

from __future__ import annotations

from swimbladder.engine.cache import part

__all__ = ["value"]


@part
def value(table, step, what, z):  # type: ignore[no-untyped-def]
    """Return value, slope and curvature of a column of the table at depth z [m]; straight beyond.

    Columns over the line's pressure: z is its logarithm, as in `line`, and step that of its grid.

    The cubic of `swimbladder.seawater.look_up`, with the curvature that a Jacobian takes.
    """
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
