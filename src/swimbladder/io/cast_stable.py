"""Density inversions of a profile: small ones are noise and averaged, large ones are refused."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.cast_raw import RawCast
from swimbladder.io.log_text import counted

Array = NDArray[np.float64]
Inversions = Literal["refuse", "average", "keep"]
# kg/m3 between two depths; the threshold of Argo's density inversion test (Argo Quality Control
# Manual for CTD and Trajectory Data, test 14).
INVERSION = 0.03


def stable(
    raw: RawCast, pressure: Array, SA: Array, CT: Array, inversions: Inversions
) -> tuple[Array, Array]:
    """Return SA and CT of a water column that is nowhere lighter below.

    Where it is, neighbours are mixed until it is not, which keeps salt and heat. Raises LogError
    for an inversion of more than `INVERSION` between two rows, or where mixing many would change
    the density by more than that, unless `inversions` says to average or keep them.
    """
    import gsw

    jumps = _jumps(pressure, SA, CT)
    worst = int(np.argmin(jumps))
    size = -float(jumps[worst])
    if size <= 0.0:
        return SA, CT
    count = counted(int((jumps < 0.0).sum()), "density inversion")
    where = f"the largest {size:.2g} kg/m3 at {pressure[worst + 1]:.1f} dbar"
    if size > INVERSION and inversions == "refuse":
        raise raw.refused(
            f"the water at {pressure[worst + 1]:.1f} dbar is {size:.2g} kg/m3 lighter than that at "
            f"{pressure[worst]:.1f} dbar above it, more than noise makes ({INVERSION:g})",
            field="density", k=worst + 1, value=round(size, 4), unit="kg/m3",
            remedy="Take out what is no water there (a spike, a lagging sensor, the bottom), or "
            "mix the neighbours with --inversions average",
        )  # fmt: skip
    if inversions == "keep":
        raw.report.append(f"{count} kept, {where}")
        return SA, CT
    mixed = _mixed(pressure, SA, CT)
    change = np.abs(gsw.rho(*mixed, pressure) - gsw.rho(SA, CT, pressure))
    most = int(np.argmax(change))
    if change[most] > INVERSION and inversions == "refuse":
        raise raw.refused(
            f"the water gets lighter downwards around {pressure[most]:.1f} dbar, by little from "
            f"row to row and by {change[most]:.2g} kg/m3 in all, more than noise makes "
            f"({INVERSION:g})",
            field="density", k=most, value=round(float(change[most]), 4), unit="kg/m3",
            remedy="Check salinity and temperature there (a sensor that drifts?), or mix the water "
            "with --inversions average",
        )  # fmt: skip
    raw.report.append(
        f"{count} averaged with the water beside, {where}; density changes by "
        f"{change[most]:.2g} kg/m3 at most"
    )
    return mixed


def _jumps(p: Array, SA: Array, CT: Array) -> Array:
    """Return how much denser each row is than the one above at the pressure between [kg/m3]."""
    import gsw

    between = 0.5 * (p[1:] + p[:-1])
    return np.asarray(gsw.rho(SA[1:], CT[1:], between) - gsw.rho(SA[:-1], CT[:-1], between))


def _mixed(p: Array, SA: Array, CT: Array) -> tuple[Array, Array]:
    """Mix neighbours, by the pressure they stand for, until none is lighter than the one above."""
    weight = np.gradient(p)
    blocks = [[k] for k in range(len(p))]
    while True:
        w = np.array([weight[b].sum() for b in blocks])
        s, c, q = (np.array([(weight[b] * v[b]).sum() for b in blocks]) / w for v in (SA, CT, p))
        down = _jumps(q, s, c) < -1e-9
        if not down.any():
            break
        joined: list[list[int]] = [blocks[0]]
        for k in range(1, len(blocks)):
            if down[k - 1]:
                joined[-1] = joined[-1] + blocks[k]
            else:
                joined.append(blocks[k])
        blocks = joined
    sizes = [len(b) for b in blocks]
    return np.repeat(s, sizes), np.repeat(c, sizes)
