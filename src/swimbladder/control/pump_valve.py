"""From a change of volume to seconds of pump and valve: what the board of a float does all day.

A law such as `rate` asks for a change of volume once and sleeps. `timed` makes a law of it that is
called at every tick and commands seconds: how long, until the next tick, the pump is to run
(positive) or a valve to be open (negative). Around the law it does what the processor of
`swimbladder mission` does: all volume out at the surface, volume taken in run by run until the
float sinks, one run for a change of volume, over before the law is called next.

A run is as long as the drive takes at the measured depth: the pump's delivery and what each start
falls short of are polynomials of the depth, the flow through a valve is that of its file. A battery
that is measured shows how much slower than with a full one the pump is; what it sags by under the
pump is known. The volume is what the runs since the surface make it, or what a sensor measures.
Times are counted in whole ticks, so that float32 adds nothing up.

A law of volume changes needs water above and below the vehicle. At the surface, above a depth
`shallow`, the processor acts itself, see `at_surface`: to surface it moves the volume to its upper
limit, and to dive it lets in as much as makes the vehicle sink, run by run until it does.
Everywhere else the law decides.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from swimbladder.control.law import Law, Measurement, State, around, law_initial, law_step
from swimbladder.control.rate import whole

LAW, OUT, IN, WAIT = 0.0, 1.0, 2.0, 3.0
"""Who acts: the law; the pump, until all volume is out; the valve, by a change; nobody."""

_SINKS = 0.05  # m; deeper by less since the last sample, it still floats


class SurfacingParameters(NamedTuple):
    """Depth and volumes of a vehicle at the surface."""

    shallow: Annotated[float, "m"]  # above which it has come up, or is about to dive
    neutral: Annotated[float, "m3"]  # neutral volume at the surface
    full: Annotated[float, "m3"]  # all volume out
    negligible: Annotated[float, "m3"]  # of it, where it floats: not worth a run
    slack: Annotated[float, "m3"]  # below the neutral volume: it sinks at the speed of the law
    measured: Annotated[float, ""]  # 1: the volume is measured; 0: only changes of it are known


class SurfacingState(NamedTuple):
    """What it remembers from sample to sample."""

    depth: float  # m, of the last sample while about to dive
    dives: float  # 1: it has let in volume since it floated with all volume out


def at_surface(
    parameters: SurfacingParameters,
    state: SurfacingState,
    depth: float,
    volume: float,
    reference: float,
    floats: float,
) -> tuple[float, float, SurfacingState]:
    """Return who acts, what is wanted [m3], and the state.

    That is the change of volume, or, for `IN` where it is measured, the volume to go down to.
    depth [m] and volume [m3] as measured; a reference [m] of 0 or less is the surface. floats: 1
    where the vehicle is known to float there with all volume out.
    """
    p = parameters
    if depth <= p.shallow and reference <= 0.0:
        short = p.full - volume
        if floats > 0.0 and short <= p.negligible:
            return WAIT, 0.0, SurfacingState(depth, 0.0)
        return OUT, short, state
    if depth <= p.shallow and reference > p.shallow:
        sinks = depth - state.depth >= _SINKS
        wanted = 0.0
        if p.measured > 0.0:
            wanted = p.neutral - p.slack
            if volume <= wanted and not sinks:
                wanted = volume - p.slack
        elif not sinks:
            wanted = -p.slack
            if state.dives == 0.0:
                wanted = wanted - (p.full - p.neutral)
        return IN, wanted, SurfacingState(depth, 1.0)
    return LAW, 0.0, state


_DUE = 1e-3  # of a tick, by which a time may be short of its end
_CLOCK = 1048576.0  # ticks, 2^20, after which the law begins anew: float32 keeps its times apart


class DriveParameters(NamedTuple):
    """Pump, valves, stroke and water as the board's processor knows them."""

    tick: Annotated[float, "s"]
    per_depth: Annotated[float, "1/m"]  # 1 / the depth to which the polynomials were fitted
    pump_0: Annotated[float, "m3/s"]  # delivery at the surface
    pump_1: Annotated[float, "m3/s"]  # times depth over that depth, and so on
    pump_2: Annotated[float, "m3/s"]
    pump_3: Annotated[float, "m3/s"]
    pump_4: Annotated[float, "m3/s"]
    battery_full: Annotated[float, "V"]  # with which it delivers so
    per_volt: Annotated[float, "m3/s/V"]  # that it delivers less per volt below
    sag_0: Annotated[float, "V"]  # of the battery while the pump runs at the surface
    sag_1: Annotated[float, "V"]  # times depth over that depth
    short_0: Annotated[float, "m3"]  # that a start of the pump falls short at the surface
    short_1: Annotated[float, "m3"]  # times depth over that depth, and so on
    short_2: Annotated[float, "m3"]
    head_0: Annotated[float, "Pa"]  # of the sea over the reservoir at the surface
    head_1: Annotated[float, "Pa/m"]
    valve_flow: Annotated[float, "m3/s/Pa^0.5"]
    valve_laminar: Annotated[float, "Pa^0.5"]  # root of its laminar pressure
    bypass_flow: Annotated[float, "m3/s/Pa^0.5"]  # 0 without one
    bypass_laminar: Annotated[float, "Pa^0.5"]
    quantum: Annotated[float, "s"]  # step of a run
    longest: Annotated[float, "s"]  # of a run
    longest_for_law: Annotated[float, "s"]  # of a run of the law: over at its next call
    pause: Annotated[float, "s"]  # between two samples while it comes up or begins to dive
    longest_wait: Annotated[float, "s"]  # for which a law may wait that is not broken
    volume_least: Annotated[float, "m3"]
    volume_most: Annotated[float, "m3"]
    beyond: Annotated[float, "m3"]  # pumped beyond that at the surface, to be sure


class DriveState(NamedTuple):
    """What the board remembers of its drive; whole numbers of ticks are floats too."""

    asked: float  # m, depth asked for last
    last: float  # m, depth measured last
    clock: float  # ticks, since the law began
    since: float  # ticks, since the last sample of the law
    wait: float  # s, from that to the next
    run: float  # s, of the run: positive pump, negative valve
    ran: float  # ticks of it
    wide: float  # -, 1: it is the bypass that is open
    primes: float  # m3, that its start still falls short
    volume: float  # m3, what the runs since the surface make it
    floats: float  # -, 1: all volume is out, pumped a little beyond
    anew: float  # -, 1: the law begins anew when it is called
    weak: float  # V, by which the battery is below the full one


def delivery(p: DriveParameters, depth: float, weak: float) -> float:
    """Return the volume that the pump delivers per time at a depth [m3/s].

    weak [V]: by which the battery is below the full one.
    """
    x = min(max(depth * p.per_depth, 0.0), 1.0)
    full = p.pump_0 + x * (p.pump_1 + x * (p.pump_2 + x * (p.pump_3 + x * p.pump_4)))
    return full - p.per_volt * weak


def weakness(p: DriveParameters, s: DriveState, battery: float) -> float:
    """Return by how much a measured battery [V] is below the full one.

    Where the pump has run for all of the last tick, that is what it does to a full one as well.
    """
    full = p.battery_full
    if s.ran > 0.0 and s.ran == s.since and s.ran * p.tick <= s.run:
        full = full - p.sag_0 - p.sag_1 * min(max(s.last * p.per_depth, 0.0), 1.0)
    return max(full - battery, 0.0)


def shortfall(p: DriveParameters, depth: float) -> float:
    """Return the volume that a start of the pump falls short at a depth [m3]."""
    x = min(max(depth * p.per_depth, 0.0), 1.0)
    return max(p.short_0 + x * (p.short_1 + x * p.short_2), 0.0)


def valve_rate(p: DriveParameters, wide: float, depth: float) -> float:
    """Return the volume let in per time at a depth through the valve (wide 0) or the bypass (1)."""
    flow, laminar = p.valve_flow, p.valve_laminar
    if wide > 0.0:
        flow, laminar = p.bypass_flow, p.bypass_laminar
    head = max(p.head_0 + p.head_1 * depth, 0.0)
    return flow * (math.sqrt(laminar * laminar + head) - laminar)


def in_steps(length: float, quantum: float) -> float:
    """Return the length of a run [s] as the processor's clock gives it."""
    if quantum > 0.0:
        return quantum * whole(length / quantum)
    return length


def run_length(wanted: float, lost: float, rate: float, longest: float) -> float:
    """Return how long a change of volume takes [s], `longest` at most.

    wanted, lost [m3]: the change and what the start falls short; rate [m3/s], 0: none.
    """
    if rate > 0.0:
        return min((abs(wanted) + lost) / rate, longest)
    return longest


def begun(p: DriveParameters, s: DriveState, length: float, wide: float) -> DriveState:
    """Return the state as a run begins, of a length [s]: positive pump, negative valve."""
    primes = shortfall(p, s.last) if length > 0.0 else 0.0
    return s._replace(run=length, ran=0.0, wide=wide, primes=primes)


def change(p: DriveParameters, s: DriveState, wanted: float, longest: float) -> DriveState:
    """Begin the run that a change of volume [m3] takes, `longest` [s] at most."""
    pumps = wanted > 0.0
    lost = shortfall(p, s.last) if pumps else 0.0
    rate = delivery(p, s.last, s.weak) if pumps else valve_rate(p, 0.0, s.last)
    length = in_steps(run_length(wanted, lost, rate, longest), p.quantum)
    return begun(p, s, math.copysign(length, wanted), 0.0)


def pump_out(p: DriveParameters, s: DriveState, short: float) -> DriveState:
    """Begin a run for the volume that is not out [m3] and a little beyond, `longest` at most."""
    wanted = short + p.beyond
    length = run_length(wanted, shortfall(p, s.last), delivery(p, s.last, s.weak), p.longest)
    s = s._replace(floats=1.0 if length < p.longest else 0.0)
    return change(p, s, wanted, p.longest)


def take_in(p: DriveParameters, s: DriveState, wanted: float) -> DriveState:
    """Begin a run that lets in volume [m3] by valve or bypass, whichever is quicker up there."""
    by_valve, by_bypass = valve_rate(p, 0.0, 0.0), valve_rate(p, 1.0, 0.0)
    if max(by_valve, by_bypass) <= 0.0:  # no head at depth 0: there is some where it floats
        by_valve = valve_rate(p, 0.0, s.last)
        by_bypass = valve_rate(p, 1.0, s.last)
    flow = max(by_valve, by_bypass)
    length = p.longest_for_law
    if flow > 0.0:
        length = in_steps(run_length(wanted, 0.0, flow, p.longest_for_law), p.quantum)
        length = max(length, p.quantum)
    return begun(p, s, -length, 1.0 if by_bypass > by_valve else 0.0)


def seconds(p: DriveParameters, s: DriveState) -> float:
    """Return what this tick has of the run [s]: positive pump, negative valve."""
    left = min(max(abs(s.run) - s.ran * p.tick, 0.0), p.tick)
    return math.copysign(left, s.run) if left > 0.0 else 0.0


def advanced(p: DriveParameters, s: DriveState, command: float) -> DriveState:
    """Return the state after a tick with a command [s]: the clock, and the volume moved."""
    volume, primes = s.volume, s.primes
    if command > 0.0:
        pumped = max(delivery(p, s.last, s.weak), 0.0) * command
        primed = min(primes, pumped)
        primes = primes - primed
        volume = min(volume + pumped - primed, p.volume_most)
    if command < 0.0:
        volume = max(volume + valve_rate(p, s.wide, s.last) * command, p.volume_least)
    ran = s.ran + 1.0 if command != 0.0 else s.ran
    return s._replace(
        clock=s.clock + 1.0, since=s.since + 1.0, ran=ran, primes=primes, volume=volume
    )


def seen(p: DriveParameters, s: DriveState, measurement: Measurement, asked: float) -> DriveState:
    """Return the state with what is measured; where another depth is asked for, a sample is due."""
    if math.isfinite(measurement.battery):
        s = s._replace(weak=weakness(p, s, measurement.battery))
    if math.isfinite(measurement.depth):
        s = s._replace(last=measurement.depth)
    if math.isfinite(measurement.volume):
        s = s._replace(volume=measurement.volume)
    if asked != s.asked or s.clock >= _CLOCK:
        s = s._replace(asked=asked, clock=0.0, wait=0.0, anew=1.0)
    return s


def due(p: DriveParameters, s: DriveState) -> bool:
    """Return whether the run is over and the law, or what is in its place, is to be called."""
    return s.ran * p.tick >= abs(s.run) and s.since * p.tick >= s.wait - _DUE * p.tick


def timed(law: Law) -> Law:
    """Return the law of a board whose `law` commands changes of volume: it commands seconds.

    Its parameters and its state are those of the law, of the surface and of the drive.
    """
    return around(
        law,
        "Timed",
        _step,
        _initial,
        parameters={"surface": SurfacingParameters, "drive": DriveParameters},
        state={"surface": SurfacingState, "drive": DriveState},
        summary=f"{law.summary}; in seconds of pump and valve",
        longest_wait=None,
        ways=None,
    )


def _initial(parameters: Any, measurement: Measurement, reference: float) -> Any:
    p, depth, volume = parameters.surface, measurement.depth, measurement.volume
    if not math.isfinite(volume):
        volume = p.full if depth <= p.shallow else p.neutral
    drive = DriveState(reference, depth, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, volume, 0.0, 1.0, 0.0)
    inner = law_initial(parameters.law, measurement, reference)
    return State(inner, SurfacingState(depth, 0.0), drive)


def _step(
    parameters: Any, state: Any, measurement: Measurement, reference: float
) -> tuple[float, Any, float]:
    """Return the seconds of this tick [s], the state, and a tick [s]."""
    p, inner, top, depth = parameters.drive, state.law, state.surface, measurement.depth
    if reference != state.drive.asked:
        top = SurfacingState(state.drive.last, top.dives)
    s = seen(p, state.drive, measurement, reference)
    if due(p, s):
        s = s._replace(since=0.0, run=0.0, ran=0.0, wait=p.pause)
        who, wanted, top = at_surface(parameters.surface, top, depth, s.volume, reference, s.floats)
        if who == OUT:
            s = pump_out(p, s, wanted)
            top = SurfacingState(depth, 0.0)
        elif who == IN and wanted != 0.0:
            s = take_in(p, s, wanted)
        elif who == LAW:
            now = Measurement(s.clock * p.tick, depth, s.volume, measurement.battery)
            if s.anew > 0.0 and math.isfinite(depth):
                inner = law_initial(parameters.law, now, reference)
                s = s._replace(anew=0.0)
            wanted, inner, pause = law_step(parameters.law, inner, now, reference)
            s = s._replace(wait=pause if pause <= p.longest_wait else math.nan)
            if wanted != 0.0:
                s = change(p, s, wanted, p.longest_for_law)
        if who != OUT and who != WAIT:
            s = s._replace(floats=0.0)
        if who != LAW:
            s = s._replace(anew=1.0)
    command = seconds(p, s)
    return command, State(inner, top, advanced(p, s, command)), p.tick
