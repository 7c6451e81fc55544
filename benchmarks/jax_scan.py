"""JAX: a scan of RK4 with three substeps over the samples, vmap over the fleet, jit, float64."""

from __future__ import annotations

import os
from functools import cache, partial
from typing import Any

import numpy as np

# One thread, as every other peer; read when JAX is first imported.
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)

import jax  # type: ignore[import-not-found, unused-ignore]
import jax.numpy as jnp  # type: ignore[import-not-found, unused-ignore]
from jax import lax  # type: ignore[import-not-found, unused-ignore]

from benchmarks.mission import Array, Fleet, Mission
from swimbladder.control.cascade import CascadeParameters

__all__ = ["VERSION", "depths", "summaries"]

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_platforms", "cpu")

VERSION = jax.__version__
SUBSTEPS = 3
CHUNK = 1024  # vehicles at once: their state fits the second cache, a third faster than all at once
UNROLL = 4  # samples a turn of the scan


def depths(mission: Mission, fleet: Fleet) -> Array:
    """Return the depths [lane, sample] of a fleet."""
    return np.asarray(_run(mission, fleet, True)[1])


def summaries(mission: Mission, fleet: Fleet) -> dict[str, Array]:
    """Return the last state of each vehicle, its range of depths and its rms error [m]."""
    count = len(fleet)
    chunks = [list(range(i, min(i + CHUNK, count))) for i in range(0, count, CHUNK)]
    last = [_run(mission, fleet.take(chunk), False)[0] for chunk in chunks]
    names = ("q", "V", "z", "w", "integral", "error", "shallowest", "deepest", "squares")
    parts = zip(names, zip(*last, strict=True), strict=True)
    found = {name: np.concatenate(values) for name, values in parts}
    found["rms"] = np.sqrt(found.pop("squares") / mission.samples)
    return found


def _run(mission: Mission, fleet: Fleet, keep: bool) -> Any:
    run = _compiled(mission.gains, keep)
    start = (fleet.start_volume, fleet.start_depth)
    return jax.block_until_ready(run(mission.reference, fleet.plants, *start))


@cache
def _compiled(gains: CascadeParameters, keep: bool) -> Any:
    return jax.jit(jax.vmap(partial(_one, gains, keep), in_axes=(None, 0, 0, 0)))


def _one(
    gains: CascadeParameters,
    keep: bool,
    reference: Any,
    p: dict[str, Any],
    volume: Any,
    depth: Any,
) -> Any:
    """One vehicle from the first sample to the last; vmap makes it a fleet."""
    k_pV, k_pz, k_iz, k_dz, S_p = gains
    h = S_p / SUBSTEPS

    def rates(x: Any, u: Any, ceiling: Any) -> Any:
        q, V, z, w = x
        felt = jnp.clip(V, p["V_min"], p["V_max"])
        emerged = p["a_s"] * jnp.maximum(p["z_surface"] - z, 0.0)
        pull = p["a_b"] * (p["psi"] * z + p["V_0"] - felt) - p["d_l"] * w + emerged
        dq = (p["gain"] * (u - p["load_drive"] * z) - q) / p["T1"]
        return dq, q, w, jnp.minimum(pull, ceiling)

    def along(x: Any, step: float, d: Any) -> Any:
        return tuple(a + step * b for a, b in zip(x, d, strict=True))

    def substep(x: Any, u: Any) -> Any:
        ceiling = jnp.where(x[2] >= p["z_bottom"], 0.0, 1e30)
        k1 = rates(x, u, ceiling)
        k2 = rates(along(x, h / 2, k1), u, ceiling)
        k3 = rates(along(x, h / 2, k2), u, ceiling)
        k4 = rates(along(x, h, k3), u, ceiling)
        q, V, z, w = (
            a + h / 6 * (b + 2 * (c + d) + e)
            for a, b, c, d, e in zip(x, k1, k2, k3, k4, strict=True)
        )
        q = jnp.where(p["V_max"] < V, jnp.minimum(q, 0.0), q)
        q = jnp.where(p["V_min"] > V, jnp.maximum(q, 0.0), q)
        w = jnp.where(z > p["z_bottom"], jnp.minimum(w, 0.0), w)
        return q, jnp.clip(V, p["V_min"], p["V_max"]), jnp.minimum(z, p["z_bottom"]), w

    def sample(carry: Any, target: Any) -> Any:
        q, V, z, w, integral, error, shallowest, deepest, squares = carry
        e = target - z
        U = k_pz * e + k_dz * (e - error) / S_p + integral
        u = jnp.clip(k_pV * (U - V), -p["supply"], p["supply"])
        x = (q, V, z, w)
        for _ in range(SUBSTEPS):
            x = substep(x, u)
        shallowest, deepest = jnp.minimum(shallowest, x[2]), jnp.maximum(deepest, x[2])
        squares = squares + (x[2] - target) ** 2
        after = (*x, integral + k_iz * S_p * e, e, shallowest, deepest, squares)
        return after, x[2] if keep else None

    zero = jnp.zeros_like(depth)
    start = (zero, volume, depth, zero, volume, reference[0] - depth, depth, depth, zero)
    last, kept = lax.scan(sample, start, reference[:-1], unroll=UNROLL)
    return last, jnp.concatenate([depth[None], kept]) if keep else None
