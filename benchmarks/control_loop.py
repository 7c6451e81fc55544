"""python-control: the whole sampled loop as one discrete-time nonlinear system.

Plant: `sample_system` (zero-order hold, exact) over a third of a sample, for each place (in the
water, emerging, on the bottom), free or at an end stop; law, voltage limit and contacts as selects
in the update function; one call of `input_output_response`. Of the ways tried this is the fastest:
a plant and a law joined by `interconnect` take about four times as long, `forced_response` of the
linear plant from sample to sample six times, a continuous nonlinear plant from sample to sample
forty times.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from benchmarks.mission import Array, Fleet, Mission
from swimbladder.physics.dynamics import Plant

__all__ = ["VERSION", "depths"]

VERSION = control.__version__
SUBSTEPS = 3


def depths(mission: Mission, fleet: Fleet, lane: int) -> Array:
    """Return the depth of one vehicle at the samples."""
    loop = _loop(mission, fleet.plant(lane))
    depth, volume = fleet.start_depth[lane], fleet.start_volume[lane]
    start = [0.0, volume, depth, 0.0, volume, mission.reference[0] - depth]
    time = np.arange(mission.samples + 1) * mission.sample_time
    found = control.input_output_response(loop, time, mission.reference, start)
    return np.asarray(found.outputs)


def _loop(mission: Mission, p: Plant) -> control.NonlinearIOSystem:
    """Return the loop: reference in, depth out; states q, V, z, w, integral, last error."""
    g, h = mission.gains, mission.sample_time / SUBSTEPS
    water, surface, bottom = (
        (_sampled(p, where, h, False), _sampled(p, where, h, True))
        for where in ("water", "surface", "bottom")
    )

    def update(_t: float, x: Any, reference: Any, _params: Any) -> Array:
        q, V, z, w, integral, error = x.tolist()
        e = reference.item() - z
        U = g.k_pz * e + g.k_dz * (e - error) / g.S_p + integral
        u = max(-p.supply, min(p.supply, g.k_pV * (U - V)))
        for _ in range(SUBSTEPS):
            drives = u > p.load_drive * z
            held = (p.V_max <= V and drives) or (p.V_min >= V and not drives)
            where = surface if z < p.z_surface else water
            if z >= p.z_bottom and p.psi * z + p.V_0 >= V:
                where = bottom
            q, V, z, w = (where[held] @ (q, V, z, w, u, 1.0)).tolist()
            if p.V_max < V:
                q, V = min(q, 0.0), p.V_max
            elif p.V_min > V:
                q, V = max(q, 0.0), p.V_min
            if z > p.z_bottom:
                z, w = p.z_bottom, min(w, 0.0)
        return np.array((q, V, z, w, integral + g.k_iz * g.S_p * e, e))

    def depth(_t: float, x: Any, _reference: Any, _params: Any) -> Any:
        return x[2]

    return control.nlsys(update, depth, inputs=1, outputs=1, states=6, dt=mission.sample_time)


def _sampled(p: Plant, where: str, h: float, held: bool) -> Array:
    """Return [A | B] over h for the state (q, V, z, w) and the inputs (u, 1)."""
    A, B = np.zeros((4, 4)), np.zeros((4, 2))
    if not held:
        A[0, 0], A[0, 2], B[0, 0] = -1.0 / p.T1, -p.gain * p.load_drive / p.T1, p.gain / p.T1
        A[1, 0] = 1.0
    if where != "bottom":
        A[2, 3] = 1.0
        A[3] = 0.0, -p.a_b, p.a_b * p.psi, -p.d_l
        B[3, 1] = p.a_b * p.V_0
    if where == "surface":
        A[3, 2] -= p.a_s
        B[3, 1] += p.a_s * p.z_surface
    sampled = control.sample_system(control.ss(A, B, np.eye(4), np.zeros((4, 2))), h, "zoh")
    return np.hstack((sampled.A, sampled.B))
