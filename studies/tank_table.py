"""What the study of the tank prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swimbladder.estimation.motion.process_noise import ProcessNoiseFit
from swimbladder.vehicle import Vehicle

__all__ = ["Row", "parameters", "pooled", "table"]


@dataclass(frozen=True)
class Row:
    """One log, predicted."""

    log: int
    skill10: float
    integrator10: float
    coverage10: float
    rms10: float
    n10: int
    skill60: float
    integrator60: float
    coverage60: float
    rms60: float
    n60: int
    persistence10: float
    persistence60: float
    constant: float  # m, rms of the whole log open loop
    drifting: float  # m, with a steady drift too
    travelled: float  # m3, by the smoothed neutral volume
    touches: bool  # bottom, or the surface once under way
    reason: str


def pooled(rows: Sequence[Row]) -> dict[str, float]:
    """Return the skill over all predictions of all logs, and medians over logs."""

    def together(rms: str, count: str) -> float:
        squares = sum(getattr(r, count) * getattr(r, rms) ** 2 for r in rows)
        return float(np.sqrt(squares / sum(getattr(r, count) for r in rows)))

    clear = [r.drifting for r in rows if not r.touches]
    found = {}
    for t in ("10", "60"):
        found[f"pooled{t}"] = 1.0 - together(f"rms{t}", f"n{t}") / together(
            f"persistence{t}", f"n{t}"
        )
        found[f"median{t}"] = float(np.median([getattr(r, f"skill{t}") for r in rows]))
        found[f"integrator{t}"] = float(np.median([getattr(r, f"integrator{t}") for r in rows]))
        weights = [getattr(r, f"n{t}") for r in rows]
        found[f"coverage{t}"] = float(
            np.average([getattr(r, f"coverage{t}") for r in rows], weights=weights)
        )
    found["constant"] = float(np.median([r.constant for r in rows if not r.touches] or [np.nan]))
    found["drifting"] = float(np.median(clear or [np.nan]))
    return found


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text."""
    opened = bool(np.isfinite([r.constant for r in rows]).any())
    head = (
        f"{'log':>4} | {'10 s: rms':>9} {'skill':>6} {'integ':>6} {'in 95%':>6} | "
        f"{'60 s: rms':>9} {'skill':>6} {'integ':>6} {'in 95%':>6} | "
        + (f"{'open loop':>9} {'+ drift':>7} | " if opened else "")
        + f"{'travel':>8} | reason"
    )
    lines = [head, "-" * len(head)]
    lines += [
        f"{r.log:>4} | {1e3 * r.rms10:>6.0f} mm {r.skill10:>6.2f} {r.integrator10:>6.2f} "
        f"{100 * r.coverage10:>5.0f}% | {1e3 * r.rms60:>6.0f} mm {r.skill60:>6.2f} "
        f"{r.integrator60:>6.2f} {100 * r.coverage60:>5.0f}% | "
        + (f"{1e3 * r.constant:>6.0f} mm {1e3 * r.drifting:>4.0f} mm | " if opened else "")
        + f"{1e6 * r.travelled:>4.1f} cm3 | {r.reason}".rstrip()
        for r in rows
    ]
    p = pooled(rows)
    lines += [
        "",
        *(
            f"{t} s ahead: skill {p[f'pooled{t}']:.2f} over all predictions, median of logs "
            f"{p[f'median{t}']:.2f} ({p[f'integrator{t}']:.2f} against a double integrator); "
            f"{100 * p[f'coverage{t}']:.0f} % inside the 95 % band"
            for t in ("10", "60")
        ),
    ]
    if opened:
        lines.append(
            "open loop, logs that touch neither bottom nor surface: median "
            f"{1e3 * p['constant']:.0f} mm, with a drift {1e3 * p['drifting']:.0f} mm"
        )
    return "\n".join(lines)


def parameters(vehicle: Vehicle, found: ProcessNoiseFit) -> str:
    """Return what was identified, as text."""
    known = vehicle.identified
    assert known is not None  # train sees to it
    assert known.between is not None
    std = np.sqrt(np.diag(np.array(known.covariance)))
    lines = [f"identified from {', '.join(known.logs)}:"]
    lines += [
        f"  {name} = {value:.4g} +- {s:.2g} {found.estimates[name].unit}"
        for name, value, s in zip(known.names, known.values, std.tolist(), strict=True)
    ]
    low, high = found.noises["random_walk"].ci95
    b = known.between
    lines += [
        f"  mass = {vehicle.mass:.2f} kg; depth noise {1e3 * known.depth_noise:.1f} mm",
        f"  walk = {1e6 * found.noises['random_walk'].value:.2g} cm3/s^0.5 "
        f"({1e6 * low:.2g} to {1e6 * high:.2g}; "
        f"chance without a walk {found.p_value:.1g})",
        f"  between logs: psi +- {1e6 * b.psi:.2g} cm3/m, drag +- {100 * b.drag:.0f} %, drift "
        f"{3.6e9 * b.neutral_drift:.0f} +- {3.6e9 * b.neutral_drift_std:.0f} cm3/h",
    ]
    return "\n".join(lines)
