"""Which of several answers no other beats."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def front(costs: ArrayLike) -> NDArray[np.bool_]:
    """Return which rows of costs [rows, kinds], all to be small, no other row beats.

    A row beats another where it is nowhere worse and somewhere better. nan: worse than any number;
    rows without any number are not on the front.
    """
    c = np.asarray(costs, float)
    c = np.where(np.isnan(c), np.inf, c)
    no_worse = (c[:, None, :] <= c[None, :, :]).all(axis=-1)
    better = (c[:, None, :] < c[None, :, :]).any(axis=-1)
    found: NDArray[np.bool_] = ~(no_worse & better).any(axis=0) & np.isfinite(c).any(axis=1)
    return found
