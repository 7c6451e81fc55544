"""Ours beside numbers computed independently from the printed ones, by other code.

The references were made with SciPy (LSODA at a relative tolerance of 1e-9, linear programs, least
squares) before this package existed: linear drag, 12 V limit, no computation delay, rest at the
neutral volume psi z at first with the integral starting there and e(-1) = e(0).
"""

from __future__ import annotations

import math

import numpy as np

from swimbladder.paper.evidence import Evidence
from swimbladder.paper.verdict import Finding, number

DENOMINATOR = (3.26700, 36.3900, 0.997115, -0.0320596, -0.00203660)
POLES = (0.03704, -0.03230, 0.02172, -11.111)  # 1/s: growing, real and imaginary part, fast


def independent(e: Evidence) -> list[Finding]:
    """Return the comparison with every independent number."""
    return [*_open_loop(e), *_closed_loop(e), *_pool(e)]


def _open_loop(e: Evidence) -> list[Finding]:
    o = e.analysis.open_loop
    growing, pair, _, fast = o.poles
    poles = (growing.real, pair.real, abs(pair.imag), fast.real)
    where = "open loop (34)"
    names = ("growing pole", "real part of the pair", "imaginary part of the pair", "fast pole")
    return [
        *(
            number(where, f"coefficient of s^{4 - i}", paper=reference, ours=ours, unit="",
                   within=1e-5, digits=6)
            for i, (reference, ours) in enumerate(zip(DENOMINATOR, o.denominator, strict=True))
        ),
        *(
            number(where, name, paper=reference, ours=ours, unit="1/s", within=3e-4, digits=5)
            for name, reference, ours in zip(names, POLES, poles, strict=True)
        ),
    ]  # fmt: skip


def _closed_loop(e: Evidence) -> list[Finding]:
    m, V = e.check_metrics, e.check_step.volume
    c, stall = e.analysis.closed_loop, e.analysis.stall
    assert c is not None
    assert c.at_command is not None
    assert c.depth_load is not None
    assert stall is not None
    where = "closed loop, 1.5 to 3.0 m"
    never = math.nan

    def row(what: str, reference: float, ours: float | None, unit: str, half: float) -> Finding:
        return number(
            where, what, paper=reference, ours=never if ours is None else ours, unit=unit,
            within=half / abs(reference),
        )  # fmt: skip

    return [
        row("overshoot", 14.7, m.overshoot_pct, "%", 0.05),
        row("90 % rise", 37.8, m.rise90_s, "s", 0.05),
        row("2 % settling", 338.0, m.settle2_s, "s", 0.5),
        row("smallest volume", -99.0, float(V.min()) * 1e6, "cm3", 0.5),
        row("largest volume", 13.0, float(V.max()) * 1e6, "cm3", 0.5),
        number("sampled loop", "phase margin, broken at the voltage", paper=41.0,
               ours=math.degrees(c.at_command.phase), unit="degrees", within=0.5 / 41.0),
        number("sampled loop", "longest computation delay", paper=0.24, ours=c.computation_delay,
               unit="s", within=0.005 / 0.24),
        number("sampled loop", "extra psi of the depth load", paper=7.7e-8,
               ours=c.depth_load.extra_psi, unit="m3/m", within=0.05 / 7.7),
        number("depth", "where 12 V no longer extend the piston", paper=155.7, ours=stall.depth,
               unit="m", within=0.05 / 155.7),
    ]  # fmt: skip


def _pool(e: Evidence) -> list[Finding]:
    mean = np.mean([fit for _, fit in e.still], axis=0)
    smallest, largest = e.still[0][1], e.still[-1][1]
    where = "psi left out, still starts, 3 m"
    return [
        number(where, "K2, joint fit of (27)", paper=14350.0, ours=e.still_joint.K2,
               unit="1/(m2 s)", within=1e-3, digits=5),
        number(where, "T2, joint fit of (27)", paper=69.0, ours=e.still_joint.T2, unit="s",
               within=5e-3),
        number(where, "rms of the joint fit", paper=7.0, ours=e.still_joint.rms * 1e3, unit="mm",
               within=0.07),
        number(where, "K2, average of eight fits", paper=13076.0, ours=float(mean[0]),
               unit="1/(m2 s)", within=1e-3, digits=5),
        number(where, "T2, average of eight fits", paper=62.5, ours=float(mean[1]), unit="s",
               within=1e-3),
        number(where, "K2 of the smallest step", paper=16300.0, ours=smallest.K2,
               unit="1/(m2 s)", within=3e-3,
               digits=5),
        number(where, "K2 of the largest step", paper=10600.0, ours=largest.K2, unit="1/(m2 s)",
               within=3e-3, digits=5),
    ]  # fmt: skip
