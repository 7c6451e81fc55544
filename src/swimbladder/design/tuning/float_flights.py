"""Flights of floats under a law of volume changes, many at once: the mission's engine, law alone.

Each is one park at a depth that the law goes to and keeps, from any depth, speed and volume, with a
drive and a hull that differ from what the law's processor knows. Nothing else decides: no alarm, no
battery that ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.io.mission import Mission, Phase
from swimbladder.physics.seawater import Column, uniform_column
from swimbladder.sim.engine.rodas.names import Drive, Given, Note, Now, Table
from swimbladder.sim.engine.rodas.prepare import Accuracy
from swimbladder.sim.mission.core import kernel
from swimbladder.sim.mission.core.names import Row, Stage
from swimbladder.sim.mission.prepare import Plan, first_state, make_plan
from swimbladder.vehicle import Vehicle

__all__ = ["VARIED", "Asked", "Flights", "fly_floats"]

Array = NDArray[np.float64]

VARIED = ("drag", "psi", "pump", "valve", "V_0")
"""What may differ from flight to flight: factors, but psi [m3/m] and V_0 [m3]."""

_ROWS, _NOTES = 20_000, 4_000
_BELOW = 1.5  # times the deepest depth asked for, down to which there is water
_DRAG = (Given.D_L, Given.D_B, Given.D_0, Given.D_T)


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Where flights begin, where they are to go, and for how long; numbers or [flights]."""

    targets: ArrayLike  # m
    depths: ArrayLike  # m, at the start
    duration: float  # s
    speeds: ArrayLike = 0.0  # m/s, positive down
    volumes: ArrayLike | None = None  # m3, neutral where not given
    points: int = 1200  # of a trajectory


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Trajectories on common times [n, flights], and the actions of each flight."""

    time: Array  # s [n]
    depth: Array  # m
    speed: Array  # m/s, positive down
    volume: Array  # m3
    energy: Array  # J of the battery for pump and valve so far; nan where it is not known
    actions: tuple[Array, ...]  # [actions, 2]: time [s], change asked for [m3]; positive: pumped


def fly_floats(
    vehicle: Vehicle,
    parameters: Any,
    asked: Asked,
    *,
    vary: Mapping[str, ArrayLike] | None = None,
    column: Column | None = None,
    seed: int | None = None,
    accuracy: Accuracy | None = None,
) -> Flights:
    """Return the flights that are asked for, under the law with these parameters.

    vary: of `VARIED`. column: the water, the vehicle's own, psi z + trim_error, where not given.
    seed: of the sensors' noise; None: none. accuracy: of a step.
    """
    duration, points = asked.duration, asked.points
    volumes = np.nan if asked.volumes is None else asked.volumes
    inputs = (asked.targets, asked.depths, asked.speeds, volumes, *(vary or {}).values())
    every = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in inputs))
    goal, z0, w0, v0 = every[:4]
    drawn, count = dict(zip(vary or {}, every[4:], strict=True)), len(goal)
    deepest = float(max(goal.max(), z0.max(), 10.0))
    plan = _plan(vehicle, parameters, deepest, duration, column, accuracy)
    plan.given[Given.LONGEST_STEP] = duration / points
    depths = np.arange(len(plan.table)) * plan.given[Given.STEP]
    neutral = np.interp(z0, depths, plan.table[:, Table.NEUTRAL])
    v0 = np.where(np.isnan(v0), neutral, v0)
    time = np.linspace(0.0, duration, points)
    kept = np.full((4, points, count), np.nan)
    actions = []
    for n in range(count):
        given = plan.given.copy()
        own = {name: float(x[n]) for name, x in drawn.items()}
        for place in _DRAG:
            given[place] *= own.get("drag", 1.0)
        given[Given.GIVE] = own.get("psi", vehicle.hull.psi) - vehicle.hull.psi
        given[Given.TRIM] = own.get("V_0", vehicle.trim_error) - vehicle.trim_error
        given[Given.DELIVERY], given[Given.FLOW] = own.get("pump", 1.0), own.get("valve", 1.0)
        stages = plan.stages.copy()
        stages[0, Stage.DEPTH] = goal[n]
        lane = Plan(given, plan.table, plan.waves, stages, plan.energy_known)
        start = (float(z0[n]), float(w0[n]), float(v0[n]))
        rows, notes = _fly(lane, start, None if seed is None else seed * 1_000_003 + n)
        kept[:, :, n] = _on(time, rows)
        begins = np.isin(notes[:, Drive.WHAT], (Note.PUMP, Note.VALVE, Note.BYPASS))
        actions.append(notes[begins][:, [Drive.T, Drive.NUMBER]])
    if plan.energy_known:
        kept[3] = np.nan
    depth, speed, volume, energy = kept
    return Flights(
        time=time, depth=depth, speed=speed, volume=volume, energy=energy, actions=tuple(actions)
    )


def _plan(
    vehicle: Vehicle,
    parameters: Any,
    deepest: float,
    duration: float,
    column: Column | None,
    accuracy: Accuracy | None,
) -> Plan:
    tolerance = 0.5 * min(parameters.tolerance, deepest)
    park = Phase(kind="park", depth=deepest, tolerance=tolerance, duration=duration)
    mission = Mission(name="flight", start_depth=deepest, phases=(park,))
    water = column or uniform_column(vehicle.water, _BELOW * deepest + 50.0)
    plan = make_plan(vehicle, mission, water, accuracy=accuracy)
    table, given, stages = plan.table.copy(), plan.given.copy(), plan.stages.copy()
    if column is None:  # as the sampled loop has it
        z = water.depth
        table[:, Table.NEUTRAL] = vehicle.hull.psi * z + vehicle.trim_error
        table[:, Table.NEUTRAL + 1] = vehicle.hull.psi
    stages[0, Stage.TOLERANCE] = parameters.tolerance
    stages[0, Stage.LAW : Stage.CAPTURE] = parameters
    given[Given.DEEPEST] = given[Given.LAST_TIME] = math.inf
    given[Given.EMPTY] = given[Given.RESERVE] = -math.inf
    return Plan(given, table, plan.waves, stages, plan.energy_known)


def _fly(plan: Plan, start: tuple[float, float, float], seed: int | None) -> tuple[Array, Array]:
    park = Phase(kind="park", depth=1.0, tolerance=0.5, duration=1.0)
    mission = Mission(name="flight", start_depth=max(start[0], 1e-3), phases=(park,))
    x, at, accounts = first_state(plan, mission, seed=seed, volume=start[2])
    x[Now.Z], x[Now.W] = start[0], start[1]
    rows, notes = np.zeros((_ROWS, int(Row.COUNT))), np.zeros((_NOTES, int(Drive.COUNT)))
    counts, work = np.zeros(3, dtype=np.int64), np.zeros((6, 8))
    none = np.zeros((0, 0))
    fixed = (plan.given, plan.table, plan.waves, plan.stages)
    kernel.fly_kernel(*fixed, x, at, accounts, rows, notes, none, counts, work)
    return rows[: counts[0]], notes[: counts[1]]


def _on(time: Array, rows: Array) -> Array:
    """Return depth, speed, volume and energy at given times; nan after the end."""
    t, last = rows[:, Row.T], float(rows[-1, Row.T])
    keep = np.concatenate([t[1:] > t[:-1], [True]])
    t, rows = t[keep], rows[keep]
    energy = rows[:, Row.PUMP_ENERGY] + rows[:, Row.VALVE_ENERGY]
    found = np.stack(
        [np.interp(time, t, c) for c in (rows[:, Row.Z], rows[:, Row.W], rows[:, Row.V], energy)]
    )
    found[:, time > last + 1e-6] = np.nan
    return found
