"""A mission flown, in words: why it ended, what was not met, how it held, what to know."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from swimbladder.control.rate import RateParameters
from swimbladder.io.log_text import counted
from swimbladder.io.mission import Ice, Mission
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import oil_note
from swimbladder.physics.seawater import look_up
from swimbladder.sim.engine.rodas.records import Ice as Turn
from swimbladder.sim.engine.rodas.records import Note, Records, Stop, Table
from swimbladder.sim.mission.core.phases import Grounding, Kind
from swimbladder.sim.mission.prepare import HELD, Plan, cost_words, start_time
from swimbladder.units import say
from swimbladder.vehicle import PumpAndValve

if TYPE_CHECKING:
    from swimbladder.sim.mission.flight import Flight
    from swimbladder.sim.mission.result import MissionResult

_say = partial(say, "sim", "mission")


_LONGER_RUNS = "Allow longer runs, or take a pump that delivers more, or a smaller line"
_CUT = 0.99  # of the longest run: it would have gone on
_FEW = 0.5  # of what a pump delivers in its time: less, and starts take most of it
# Of what a band holds in volume, in a step: floats a few percent apart held it for 99 % of the time
# with a quarter, for 89 % and up with a half, for 79 % and up with all of it.
_COARSE = 0.25


def late_notes(flight: Flight, phase: int) -> Records:
    """Return the notes of a phase that ran out of time [n]."""
    notes = flight.notes
    late = (notes["what"] == Note.OUT_OF_TIME) & (notes["number"] == phase)
    return np.asarray(notes[late])


def shortage(flight: Flight, phase: int, depths: Array) -> Array:
    """Return how far from a phase's depth, less its tolerance, depths are [m]."""
    stage = flight.plan.stages[phase]
    if stage["kind"] == Kind.SURFACE:
        return np.asarray(np.maximum(depths, 0.0))
    return np.asarray(np.abs(depths - stage["depth"]) - stage["tolerance"])


def timeout_words(flight: Flight, phase: int) -> str:
    """Return how far a phase that ran out of time came, in the cycle in which most was missing."""
    late, stage = late_notes(flight, phase), flight.plan.stages[phase]
    short = shortage(flight, phase, late["z"])
    k = int(np.argmax(short))
    z = late["z"][k]
    if stage["kind"] == Kind.SURFACE:
        missing = 1e6 * float(flight.plan.given["v_max"] - late["v"][k])
        return f"it was at {z:.1f} m, {short[k]:.1f} m short, with {missing:.3g} cm3 not out"
    return _say("short", z=z, short=short[k], stage=stage)


def battery_words(flight: Flight) -> str:
    """Return where the battery ran empty, and what full buoyancy there still takes."""
    g, table, x = flight.plan.given, flight.plan.table, flight.end
    phase = flight.mission.titles[int(flight.whole["phase"])]
    z, inside = float(x["z"]), float(g["v_max"] - x["v"])
    rate, power = (
        look_up(table, float(g["step"]), column, max(z, 0.0))[0]
        for column in (Table.RATE_OUT, Table.POWER_OUT)
    )
    cycle = int(flight.whole["cycle"]) + 1
    where = f"in the phase {phase!r} of cycle {cycle}, at {z:.1f} m"
    delivery = float(rate * g["delivery"])
    if delivery <= 0.0:
        return f"{where}, where the drive stalls"
    return (
        f"{where}, {power / delivery * inside:.3g} J short of what it takes to press out the "
        f"{1e6 * inside:.4g} cm3 inside there"
    )


def starts_words(flight: Flight, phase: int) -> str:
    """Say that starts took most of the runs in a phase that were cut short, and why; "" if not."""
    plan, actuator = flight.plan, flight.vehicle.engine
    if not isinstance(actuator, PumpAndValve):
        return ""
    law = RateParameters(*map(float, plan.stages["law"][phase]))
    longest, limit = float(plan.given["longest"]), "actuator.longest_run"
    if longest > law.dead:
        longest, limit = law.dead, "the next sample (dead of the controller, or check_interval)"
    step, share = float(plan.given["step"]), float(plan.given["delivery"])
    here, begun = False, None
    out, could, depths = 0.0, 0.0, list[float]()
    for note in flight.notes:
        if note["what"] == Note.PHASE:
            here = note["number"] == phase
        elif note["what"] == Note.PUMP:
            begun = note if here else None
        elif note["what"] == Note.RUN_OVER and begun is not None:
            if note["number"] < _CUT * longest:
                continue
            depth = max(float(begun["z"]), 0.0)
            rate = look_up(plan.table, step, Table.RATE_OUT, depth)[0]
            out += float(note["v"] - begun["v"])
            could += share * rate * float(note["number"])
            depths.append(depth)
    if could == 0.0 or out > _FEW * could:
        return ""
    deepest = max(depths)
    what = "actuator.start_volume" if actuator.line is None else "actuator.line"
    if actuator.line is not None and actuator.start_volume > 0.0:
        what += " and actuator.start_volume"
    return (
        f"The pump's {len(depths)} longest runs in it pressed out {1e6 * max(out, 0.0):.3g} cm3, "
        f"{100.0 * max(out, 0.0) / could:.2g} % of what it delivers in their time: at "
        f"{deepest:.0f} m a start of the pump takes {start_time(plan, deepest):.3g} s ({what}), a "
        f"run {longest:.3g} s at most ({limit}). {_LONGER_RUNS}"
    )


def coarse_words(mission: Mission, plan: Plan, phase: int) -> str:
    """Say where the steps of `rate` are too coarse for the band of a phase; "" where they are not.

    A stable vehicle comes to rest where its volume is neutral. Volumes that lie farther apart than
    a quarter of what the band holds leave it to chance whether one of them rests well inside
    before it moves on.
    """
    stage = plan.stages[phase]
    if mission.phases[phase].depth is None or stage["capture"] > 0.0:
        return ""
    psi = look_up(plan.table, float(plan.given["step"]), Table.NEUTRAL, stage["depth"])[1]
    law = RateParameters(*map(float, stage["law"]))
    if psi >= 0.0 or law.volume_step <= _COARSE * -psi * 2.0 * law.tolerance:
        return ""
    return (
        f". Lessen volume_step: its {law.volume_step * 1e6:.3g} cm3 move the depth of rest by "
        f"{law.volume_step / -psi:.2g} m, and the band is {2.0 * law.tolerance:.3g} m"
    )


REASONS = {
    Stop.FINISHED: "the mission came to its end",
    Stop.RESERVE: "the battery came to its reserve (safety.battery)",
    Stop.DID_NOT_SURFACE: "it did not come to the surface in the time that the phase has",
    Stop.PASSED_DEPTH: "it sank below its depth limit, went to full buoyancy and came up",
    Stop.LOST: "it sank and did not come up again: it is lost",
    Stop.BATTERY_EMPTY: "the battery ran empty: it is lost",
    Stop.LEFT_WATER: "the hull left the water: check mass, waterplane area and height",
    Stop.ALARM: "the supervisor took over and brought it up",
    Stop.STUCK: "it changed its mode 200 times in no time: a fault of the model, please report it",
}
_MORE_TIME = "Give it a longer timeout (a park a longer duration), more speed, or a wider tolerance"


def holding_words(result: MissionResult) -> list[str]:
    """Return how each park and hold went."""
    phases = {title: n for n, title in enumerate(result.flight.mission.titles)}
    return [
        f"{name}: within {result.flight.plan.stages['tolerance'][phases[name]]:g} m for "
        f"{_percent(one['share'])} % of the time since it arrived, {one['rms']:.3g} m rms, "
        f"{one['farthest']:.3g} m at most"
        for name, one in result.held.items()
    ]


def note_words(result: MissionResult) -> list[str]:
    """Return what of the files changes nothing here, or makes the answer say nothing."""
    oil = oil_note(result.flight.vehicle)
    found = [*_unwatched(result), *([] if oil is None else [oil])]
    found += cost_words(result.flight.mission, result.flight.plan.laws)
    sensors = result.flight.vehicle.sensors
    by_time = result.flight.plan.given["by_volume"] == 0.0
    if by_time and (sensors.volume_noise or sensors.volume_quantum):
        found.append(_say("no volume measured"))
    for phase, stage in zip(result.flight.mission.phases, result.flight.plan.stages, strict=True):
        tolerance = float(stage["tolerance"])
        # the file's own is refused: it is the law's, or 10 m
        if phase.depth is not None and tolerance >= phase.depth:
            found.append(_say("no tolerance", phase=phase, tolerance=tolerance))
    return found


def reason_words(result: MissionResult) -> list[str]:
    """Return why the mission ended, and what was not met on the way."""
    asked = float(result.flight.plan.given["last_cycle"])
    flown = f"{result.cycles} of {asked:.0f} cycles, " if np.isfinite(asked) else ""
    flown = "" if result.flight.stop is Stop.FINISHED else flown
    found = [f"{REASONS[result.flight.stop]}, after {flown}{span_words(result.flight.duration)}"]
    if (alarm := result.alarm) is not None:
        after = span_words(alarm.time)
        found.append(f"the supervisor took over after {after}: {alarm.reason.words}")
    if result.flight.stop is Stop.BATTERY_EMPTY:
        found.append(battery_words(result.flight))
    numbers = {title: n for n, title in enumerate(result.flight.mission.titles)}
    found += [
        f"the phase {name!r} ran out of time in {count} of {len(result.flight.cycles)} "
        f"cycle{'s' if len(result.flight.cycles) > 1 else ''}: "
        + _missed_words(result, name, numbers[name])
        for name, count in result.missed.items()
    ]
    if result.flight.stop in (Stop.PASSED_DEPTH, Stop.LOST):
        found += filter(None, [_starts_words(result, int(result.flight.whole["phase"]))])
    found += [
        f"the phase {name!r} was in its tolerance for less than {100.0 * HELD:.0f} % of its "
        f"time in {count} of {len(result.flight.cycles)} cycles: that is no holding. "
        f"{_hold_words(result, numbers[name])}"
        for name, count in result.not_held.items()
    ]
    found += _avoided_words(result)
    landed = int(np.sum(result.flight.notes["what"] == Note.BOTTOM))
    if landed:
        often = f"{result.flight.mission.bottom:g} m {counted(landed, 'time')}"
        found.append(f"it came down on the bottom at {often}")
    deepest = float(np.max(result.flight.cycles["deepest"]))
    if result.flight.column.cast is not None and deepest > result.flight.column.deepest:
        found.append(_say("beyond the water", deepest=deepest, result=result))
    if not result.energy_known:
        found.append(result.flight.plan.energy_known)
    return found


def _missed_words(result: MissionResult, name: str, number: int) -> str:
    """Say what kept a phase from its depth, and what to do."""
    if name in result.grounded:
        return _say("grounded")
    came = timeout_words(result.flight, number)
    return f"{came}. " + (_starts_words(result, number) or _MORE_TIME)


def _avoided_words(result: MissionResult) -> list[str]:
    """Say where the vehicle took itself to be grounded, and how often ice turned it back."""
    flight, found = result.flight, list[str]()
    for title, depths in result.grounded.items():
        often = counted(len(depths), "time")
        least, most = (f"{depth:.4g}" for depth in (min(depths), max(depths)))
        where = f"{most} m" if least == most else f"{least} to {most} m"
        stage, given = flight.plan.stages[flight.mission.titles.index(title)], flight.plan.given
        does = "went on with the next phase"
        if stage["grounding"] != Grounding.NEXT:
            goals = result.shifted.get(title, [])
            does = f"went on at {min(goals):.4g} m" if goals else "stayed there"
            if goals and max(goals) - min(goals) > 0.5:
                does += f" to {max(goals):.4g} m"
            if stage["grounding"] == Grounding.SHIFT and (rest := len(depths) - len(goals)):
                shallow = min(depths) < given["ground_least"]
                does += f", stayed there {counted(rest, 'time')}, as " if goals else ", as "
                does += (
                    f"it is no deeper than {given['ground_least']:.4g} m (grounding.least_depth)"
                    if shallow
                    else f"{given['ground_shift']:.4g} m above it is at the surface"
                )
        found.append(f"the phase {title!r} was grounded {often}, at {where}, and {does}")
    return found + ([] if flight.mission.ice is None else _ice_words(result, flight.mission.ice))


def _ice_words(result: MissionResult, ice: Ice) -> list[str]:
    """Say how often ice turned it back, and how often it came up all the same."""
    did, found = result.ice, list[str]()
    cold, passed = did.count(Turn.COLD), did.count(Turn.PASSED)
    if turns := len(did) - passed:
        rose = result.ice_least
        found.append(
            f"for ice it turned back {counted(turns, 'time')} in "
            f"{counted(len(result.flight.cycles), 'cycle')} from {ice.stop_depth:g} m, {cold} of "
            f"them by the temperature, and came to {rose:.3g} m"
        )
        if rose <= result.flight.vehicle.hull.emergence_depth:
            found.append("it turned back too late and came up under the ice: rise slower there")
    if passed:
        found.append(
            f"it came up {counted(passed, 'time')} although there may have been ice, after "
            f"{span_words(ice.longest)} without surfacing (ice.longest)"
        )
    return found


def _starts_words(result: MissionResult, number: int) -> str:
    """Say what of the way of driving kept a phase from its depth; "" where nothing did."""
    flight = result.flight
    if not flight.plan.by_laws:
        return starts_words(flight, number)
    phase, law = flight.mission.phases[number], flight.plan.laws[number].law.name
    slower = "slower (speed)" if phase.speed is not None else "at a speed (speed), and not at once"
    return _say("law flew", law=law, slower=slower)


def _hold_words(result: MissionResult, number: int) -> str:
    flight = result.flight
    if flight.plan.by_laws:
        law = flight.plan.laws[number].law.name
        return f"Check the gains of the law {law!r} (`tune`, `analyse`), or allow more"
    coarse = coarse_words(flight.mission, flight.plan, number)
    return f"Look more often (check_interval), go slower, or allow more{coarse}"


def _percent(share: float) -> str:
    """Return a share in percent, cut off rather than rounded: 100 is all of it."""
    return f"{math.floor(1000.0 * share + 1e-9) / 10.0:g}"


def span_words(seconds: float | None) -> str:
    """Return a time in the two largest units that it takes: "3 h 10 min"."""
    if seconds is None:
        return "never"
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    days, rest = divmod(minutes, 1440)
    hours, minutes = divmod(rest, 60)
    if days >= 10:
        return f"{days} d"
    if days:
        return f"{days} d {hours} h"
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


def _unwatched(result: MissionResult) -> list[str]:
    """Return what has to be said of a float that has a supervisor, and no board that it is of."""
    vehicle, flown = result.flight.vehicle, result.flight.plan
    if "supervisor" not in vehicle.model_fields_set or vehicle.controller or flown.laws:
        return []
    return [_say("no board")]
