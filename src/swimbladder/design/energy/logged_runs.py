"""Runs of a pump as a vehicle logged them, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, NoAnswerError

Array = NDArray[np.float64]
FEWEST = 3  # dives, or runs without dives: fewer leave no spread to be known
_DEEP = 2e5  # Pa: nearer to the surface the hydraulic work is next to none


@dataclass(frozen=True, kw_only=True)
class PumpRuns:
    """Runs of a pump, one a row [n]; NaN in what was not logged."""

    duration: Array  # s
    pressure: Array  # Pa above the atmosphere
    power: Array  # W, mean over the run or read at its end
    volume: Array | None = None  # m3 pressed out
    temperature: Array | None = None  # degC
    dive: Array | None = None  # number of the dive
    voltage: Array | None = None  # V at the battery while the pump runs
    time: Array | None = None  # s, when it begins
    report: tuple[str, ...] = ()


def usable_runs(runs: PumpRuns, shortest: float = 0.0) -> NDArray[np.bool_]:
    """Return the runs with duration, pressure and power, no shorter than `shortest` [s] [n]."""
    finite = np.isfinite(runs.duration) & np.isfinite(runs.pressure) & np.isfinite(runs.power)
    return np.asarray(finite & (runs.duration > 0.0) & (runs.duration >= shortest))


def check_runs(runs: PumpRuns, kept: NDArray[np.bool_], *, depth_limit: float | None) -> None:
    """Raise InputError where runs do more work on the sea than they take, or go too deep.

    depth_limit: of the vehicle [m]. Both mean a wrong unit: of pressure, volume, power or time.
    """
    if runs.volume is not None:
        deep = kept & np.isfinite(runs.volume) & (runs.pressure > _DEEP)
        work = float(np.sum((runs.pressure * runs.volume)[deep]))
        energy = float(np.sum((runs.power * runs.duration)[deep]))
        if deep.sum() >= FEWEST and work > energy:
            raise InputError(
                f"the runs would press out {work:.3g} J of work against the sea for {energy:.3g} J "
                f"from the battery, {work / energy:.3g} times as much", field="pressure_Pa",
                unit="Pa", value=float(np.max(runs.pressure[deep])),
                remedy="Pressure, volume, power or time is in the wrong unit: state it, as in "
                '--column "pressure_Pa=NAME@dbar", --column "volume_m3=NAME@mL"',
            )  # fmt: skip
    deepest = float(np.max(runs.pressure[kept], initial=0.0))
    if depth_limit is not None and deepest > 1.5 * 1e4 * depth_limit:
        raise InputError(
            f"the greatest pressure is that of {deepest / 1e4:.5g} m, and the vehicle is rated for "
            f"{depth_limit:g} m (hull.depth_limit)", field="pressure_Pa", unit="Pa", value=deepest,
            remedy='State the unit of the pressure: --column "pressure_Pa=NAME@dbar"',
        )  # fmt: skip


def check_groups(runs: PumpRuns, kept: NDArray[np.bool_], groups: Array) -> None:
    """Raise NoAnswerError or InputError where runs are too few, too alike or of no sea."""
    what = "runs" if runs.dive is None else "dives"
    if len(groups) < FEWEST:
        raise NoAnswerError(
            f"{len(groups)} {what} with duration, pressure and power are too few to show how sure "
            f"a power law is: log {FEWEST} or more"
        )
    span = float(np.ptp(runs.pressure[kept]))
    if span < 1e4:
        raise NoAnswerError(
            f"all runs are within {span / 1e4:.2g} dbar: nothing shows how power and delivery "
            "depend on pressure. Log runs at several depths"
        )
    if np.any(runs.pressure[kept] < -2e5) or np.any(runs.pressure[kept] > 1.2e8):
        raise InputError(
            "no pressure of a sea", field="pressure_Pa", unit="Pa",
            value=float(runs.pressure[kept][np.argmax(np.abs(runs.pressure[kept]))]),
            remedy='State its unit: --column "pressure_Pa=NAME@dbar"',
        )  # fmt: skip
