"""What a vehicle does by itself on the bottom and under ice: its phase goes on elsewhere, or ends.

It takes itself to be grounded where the depth does not change for a time after it let in a volume,
or all that it can. There may be ice where the water in a layer below the surface is as cold on the
way up, by the median of its temperatures: the ice-sensing algorithm of Klatt, Boebel and Fahrbach
(2007), J. Atmos. Oceanic Technol. 24.
"""

import math

from swimbladder.sim.engine.cache import inlined, part
from swimbladder.sim.engine.rodas.drive import FULL, note
from swimbladder.sim.engine.rodas.lookup import value
from swimbladder.sim.engine.rodas.records import Account, Ice, Note, Table
from swimbladder.sim.mission.core.records import Grounding, Kind, Phases

_WAITS, _COLD, _PASSED = (float(did) for did in Ice)  # in a note
_SPACING = 1.0  # m between two temperatures on a way, at most


@inlined
def goal_of(f: Phases) -> float:
    """Return the depth that the phase goes to [m]: its own, or what grounding made of it."""
    return float(f.stages[f.lane.at.phase].depth - f.lane.x.raised)


@inlined
def grounds(f: Phases, seen: float) -> float:
    """Find whether the vehicle lies on the bottom, at the depth seen [m], and what it does then.

    Return the volume that it let in there [m3] where it leaves the bottom now, else 0.
    """
    return float(_grounds(f, seen) if f.lane.p.ground_volume > 0.0 else 0.0)


@part
def _grounds(f: Phases, seen: float) -> float:
    p, x, at = f.lane.p, f.lane.x, f.lane.at
    if seen <= p.shallow or abs(seen - x.z_moved) >= p.ground_change:
        x.z_moved, x.v_moved = seen, x.v
    x.v_moved = max(x.v_moved, x.v)
    least = x.v <= p.v_min + FULL * (p.v_max - p.v_min)
    if x.v_moved - x.v < p.ground_volume and not (least and seen > p.shallow):
        x.t_still = math.inf
        return 0.0
    x.t_still = min(x.t_still, x.t)
    stage = f.stages[at.phase]
    if stage.kind == Kind.SURFACE or at.alarm != 0 or at.ends == 1:
        return 0.0
    if x.t - x.t_still < p.ground_time or seen >= goal_of(f) - stage.tolerance:
        return 0.0
    note(f.lane, Note.GROUNDED, float(at.phase))
    f.lane.accounts[Account.GROUNDED] += 1.0
    if stage.grounding == Grounding.NEXT:
        at.ends, x.t_end = 1, x.t
        after = f.stages[(at.phase + 1) % f.stages.shape[0]]
        leaves = after.kind == Kind.SURFACE or after.depth < seen
    else:
        goal = seen - p.ground_shift
        leaves = stage.grounding == Grounding.SHIFT and seen >= p.ground_least
        leaves = leaves and goal > p.shallow
        x.raised = stage.depth - (goal if leaves else seen)
        if leaves:
            note(f.lane, Note.SHIFTED, goal)
    return float(x.v_moved - x.v) if leaves else 0.0


@part
def seek_ice(f: Phases, depth: float, h: float) -> None:
    """Enter h [s] on the way up from a depth [m] in the search for ice; turn back under it."""
    p, x, at = f.lane.p, f.lane.x, f.lane.at
    up = f.stages[at.phase].kind == Kind.SURFACE and at.arrived == 0 and at.place != 1
    if not up or at.alarm != 0 or at.ends == 1 or min(depth, x.z) > p.ice_from:
        return
    parts = math.ceil(abs(x.z - depth) / _SPACING) + 1
    for n in range(parts):
        z = depth + (x.z - depth) * (n + 0.5) / parts
        if p.ice_to <= z <= p.ice_from:
            x.t_measured += h / parts
            if value(f.lane.table, p.step, Table.TEMPERATURE, z)[0] <= p.ice_temperature:
                x.t_cold += h / parts
    if x.z > p.ice_to:
        return
    cold = x.t_cold >= 0.5 * x.t_measured  # so it is where nothing was measured
    if not cold and x.t - x.t_ice >= p.ice_wait:
        return
    if x.t - x.t_surfaced > p.ice_longest:
        if depth > p.ice_to:
            note(f.lane, Note.ICE, _PASSED)
            f.lane.accounts[Account.UNDER_ICE] += 1.0
        return
    note(f.lane, Note.ICE, _COLD if cold else _WAITS)
    f.lane.accounts[Account.ICE_TURNS] += 1.0
    if cold:
        x.t_ice = x.t
    at.ends, x.t_end = 1, x.t
