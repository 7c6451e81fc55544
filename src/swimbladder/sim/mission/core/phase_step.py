"""The phases of a mission that a sampled law flies: what follows from each span of its motion."""

from __future__ import annotations

from swimbladder.sim.engine.rodas.drive import note
from swimbladder.sim.engine.rodas.entries import enter_energy
from swimbladder.sim.engine.rodas.names import Account, At, Given, Note, Now, Stop
from swimbladder.sim.mission.core.fly import RESCUE, row
from swimbladder.sim.mission.core.names import Kind, Stage
from swimbladder.sim.mission.core.phases import (
    afloat,
    arrive,
    begin_phase,
    close_cycle,
    enter_hold,
    next_phase,
)

T, Z, W, T_END, CHARGE = int(Now.T), int(Now.Z), int(Now.W), int(Now.T_END), int(Now.CHARGE)
PHASE, ARRIVED, ALARM, STOP = int(At.PHASE), int(At.ARRIVED), int(At.ALARM), int(At.STOP)
NEW_PHASE, DEEPEST, EMPTY = int(At.NEW_PHASE), int(Given.DEEPEST), int(Given.EMPTY)
KIND, DEPTH, TOLERANCE = int(Stage.KIND), int(Stage.DEPTH), int(Stage.TOLERANCE)
LOADS, TO_SURFACE, T_KIND = int(Stage.LOADS), int(Kind.SURFACE), int(Account.T_KIND)
NOTE_DEEP, LOST, STOP_EMPTY = int(Note.TOO_DEEP), int(Stop.LOST), int(Stop.BATTERY_EMPTY)


def phase_step(p, table, stages, x, at, accounts, rows, notes, cycles, counts, z, h, energy):  # type: ignore[no-untyped-def]
    """Enter h [s] of motion that led from depth z [m] to the state x, and see what it means.

    energy [J]: what the drive drew in it, entered in the accounts of the drive already. The other
    arguments are those of `fly`. With h = 0 a phase begins, where one is to.
    """
    over = False
    if h > 0.0:
        stage = stages[at[PHASE]]
        enter_energy(p, x, accounts, energy, stage[LOADS], h)
        accounts[T_KIND + int(stage[KIND])] += h
        if at[ARRIVED] == 1 and at[ALARM] == 0:
            enter_hold(stages, x, at, accounts, z, h)
        row(rows, counts, x, at, accounts)
        if at[STOP] == 0:
            afloat(p, table, stages, x, at, accounts, notes, counts)
        if at[STOP] == 0 and at[ALARM] == 0:
            there = abs(x[Z] - stage[DEPTH]) <= stage[TOLERANCE]
            if at[ARRIVED] == 0 and stage[KIND] != TO_SURFACE and there:
                arrive(stages, x, at, notes, counts)
            if x[Z] > p[DEEPEST]:
                note(notes, counts, x, NOTE_DEEP, x[W])
                at[ALARM] = 1
                x[T_END] = x[T] + RESCUE
        if at[STOP] == 0 and x[T] >= x[T_END]:
            if at[ALARM] == 1:
                at[STOP] = LOST
            else:
                over = next_phase(p, stages, x, at, accounts, cycles, notes, counts)
        if at[STOP] == 0 and x[CHARGE] <= p[EMPTY]:
            at[STOP] = STOP_EMPTY
    if at[STOP] != 0:
        row(rows, counts, x, at, accounts)
        if not over:
            close_cycle(x, at, accounts, cycles, counts)
    elif at[NEW_PHASE] == 1:
        begin_phase(stages, x, at, notes, counts)
        row(rows, counts, x, at, accounts)
