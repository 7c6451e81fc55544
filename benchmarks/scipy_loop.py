"""SciPy: one call of a solver from sample to sample, as its users write it.

End stops and bottom are selects in the right-hand side; after the call a volume beyond its stop and
a vehicle beyond the bottom are put back, as in the C loop. Tolerances: the loosest decade at which
a vehicle that touches nothing stays within about 2e-6 m.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import odeint, solve_ivp

from benchmarks.mission import Array, Fleet, Mission
from swimbladder.physics.dynamics import Plant

__all__ = ["METHODS", "depths"]

# The absolute tolerances are the relative one times these.
SCALE = np.array([1e-5, 1e-4, 1.0, 0.1])  # m3/s, m3, m, m/s

Rates = Callable[..., list[float]]
Advance = Callable[[Any, list[float], float, float], Any]


def _ivp(method: Any, tolerance: float, f: Any, x: list[float], span: float, u: float) -> Any:
    found = solve_ivp(
        f,
        (0.0, span),
        x,
        method=method,
        rtol=tolerance,
        atol=tolerance * SCALE,
        args=(u,),
        t_eval=(span,),
    )
    return found.y[:, -1].tolist()


def _odeint(tolerance: float, f: Any, x: list[float], span: float, u: float) -> Any:
    solve: Any = odeint  # its types know no tolerance for each component
    found = solve(f, x, (0.0, span), args=(u,), tfirst=True, rtol=tolerance, atol=tolerance * SCALE)
    return found[-1].tolist()


METHODS: dict[str, Advance] = {
    "solve_ivp LSODA": partial(_ivp, "LSODA", 1e-8),
    "solve_ivp RK45": partial(_ivp, "RK45", 1e-3),
    "odeint": partial(_odeint, 1e-8),
}


def depths(mission: Mission, fleet: Fleet, lane: int, method: str) -> Array:
    """Return the depth of one vehicle at the samples."""
    p, g, advance = fleet.plant(lane), mission.gains, METHODS[method]
    x = [0.0, float(fleet.start_volume[lane]), float(fleet.start_depth[lane]), 0.0]
    f = _rates(p)
    integral, error = x[1], float(mission.reference[0]) - x[2]
    found = np.empty(mission.samples + 1)
    for k, target in enumerate(mission.reference.tolist()):
        found[k] = x[2]
        if k == mission.samples:
            break
        e = target - x[2]
        U = g.k_pz * e + g.k_dz * (e - error) / g.S_p + integral
        u = max(-p.supply, min(p.supply, g.k_pV * (U - x[1])))
        integral, error = integral + g.k_iz * g.S_p * e, e
        x = _put_back(p, *advance(f, x, mission.sample_time, u))
    return found


def _rates(p: Plant) -> Rates:
    gain, load, T1, low, high = p.gain, p.load_drive, p.T1, p.V_min, p.V_max
    a_b, psi, V_0, d_l, a_s = p.a_b, p.psi, p.V_0, p.d_l, p.a_s
    z_surface, z_bottom = p.z_surface, p.z_bottom

    def rates(_: float, x: Any, u: float) -> list[float]:
        q, V, z, w = x.tolist()
        felt = low if low > V else high if high < V else V
        pull = a_b * (psi * z + V_0 - felt) - d_l * w
        if z < z_surface:
            pull += a_s * (z_surface - z)
        if z >= z_bottom and pull > 0.0:
            pull, w = 0.0, min(w, 0.0)
        return [(gain * (u - load * z) - q) / T1, q, w, pull]

    return rates


def _put_back(p: Plant, q: float, V: float, z: float, w: float) -> list[float]:
    if p.V_max < V:
        q, V = min(q, 0.0), p.V_max
    elif p.V_min > V:
        q, V = max(q, 0.0), p.V_min
    if z > p.z_bottom:
        z, w = p.z_bottom, min(w, 0.0)
    return [q, V, z, w]
