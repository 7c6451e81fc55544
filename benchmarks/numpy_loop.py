"""NumPy: RK4 with three substeps, one array operation at a time over the whole fleet."""

from __future__ import annotations

import numpy as np

from benchmarks.mission import Array, Fleet, Mission

__all__ = ["summaries"]

SUBSTEPS = 3
State = tuple[Array, Array, Array, Array]


def summaries(mission: Mission, fleet: Fleet) -> dict[str, Array]:
    """Return the last state of each vehicle, its range of depths and its rms error [m]."""
    g, p = mission.gains, fleet.plants
    rest = np.zeros(len(fleet))
    x: State = (rest, fleet.start_volume, fleet.start_depth, rest)
    integral, error = fleet.start_volume, mission.reference[0] - fleet.start_depth
    shallowest, deepest, squares = x[2].copy(), x[2].copy(), np.zeros(len(fleet))
    for target in mission.reference[:-1].tolist():
        e = target - x[2]
        U = g.k_pz * e + g.k_dz * (e - error) / g.S_p + integral
        u = np.clip(g.k_pV * (U - x[1]), -p["supply"], p["supply"])
        integral, error = integral + g.k_iz * g.S_p * e, e
        for _ in range(SUBSTEPS):
            x = _substep(p, x, u, g.S_p / SUBSTEPS)
        np.minimum(shallowest, x[2], out=shallowest)
        np.maximum(deepest, x[2], out=deepest)
        squares += (x[2] - target) ** 2
    found = dict(zip(("q", "V", "z", "w"), x, strict=True))
    rms = np.sqrt(squares / mission.samples)
    return {**found, "shallowest": shallowest, "deepest": deepest, "rms": rms}


def _substep(p: dict[str, Array], x: State, u: Array, h: float) -> State:
    ceiling = np.where(x[2] >= p["z_bottom"], 0.0, np.inf)
    k1 = _rates(p, x, u, ceiling)
    k2 = _rates(p, _along(x, h / 2, k1), u, ceiling)
    k3 = _rates(p, _along(x, h / 2, k2), u, ceiling)
    k4 = _rates(p, _along(x, h, k3), u, ceiling)
    q, V, z, w = (
        a + h / 6 * (b + 2 * (c + d) + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)
    )
    q = np.where(p["V_max"] < V, np.minimum(q, 0.0), q)
    q = np.where(p["V_min"] > V, np.maximum(q, 0.0), q)
    w = np.where(z > p["z_bottom"], np.minimum(w, 0.0), w)
    return q, np.clip(V, p["V_min"], p["V_max"]), np.minimum(z, p["z_bottom"]), w


def _along(x: State, step: float, d: State) -> State:
    q, V, z, w = (a + step * b for a, b in zip(x, d, strict=True))
    return q, V, z, w


def _rates(p: dict[str, Array], x: State, u: Array, ceiling: Array) -> State:
    q, V, z, w = x
    felt = np.clip(V, p["V_min"], p["V_max"])
    emerged = p["a_s"] * np.maximum(p["z_surface"] - z, 0.0)
    pull = p["a_b"] * (p["psi"] * z + p["V_0"] - felt) - p["d_l"] * w + emerged
    return (p["gain"] * (u - p["load_drive"] * z) - q) / p["T1"], q, w, np.minimum(pull, ceiling)
