"""The supervisor's numbers, from a vehicle: how deep, how long, how far from the model."""

import math
from typing import Any, TypeVar

import numpy as np

from swimbladder.control import supervisor
from swimbladder.control.arming import ArmingParameters
from swimbladder.control.law import NEVER, Count, Laws, field_types, leaves
from swimbladder.control.registry import bind
from swimbladder.control.supervisor import SupervisorParameters
from swimbladder.errors import InputError
from swimbladder.physics import dynamics
from swimbladder.physics.buoyancy_engine import at_voltage, drive_map, running_pump
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.vehicle import Positioner, PumpAndValve, Vehicle

_COUNTED = NEVER - 1  # ticks
_SURE_TO_MOVE = 0.95  # of the depth at which the motor stalls
_BATTERY_SHARE = 0.8  # of the supply: 9.6 of 12 V, near the knee of lead and of lithium cells
_BATTERY_S = 10.0  # s, longer than a motor's start makes it sag
_DEPTH_SHARE = 0.9  # of the deepest
_NEUTRAL_SHARE = 0.25  # of half the stroke: trim, trapped air, a layer of 3 kg/m3 for `feup-em`
_SHORT_S = 1.0  # s, for what needs no doubt: leak, depth limit
_NO_COMMAND_S = 10.0
_TAU_S = 7.0  # s, of each low pass: above a swell's period over 2 pi
_LAG = 0.3  # of them, by which a speed that grows ever faster is still behind
_SETTLE = 4.0  # of them: what they begin with is then 9 % of itself, (1 + 4) exp(-4)
_CHANGE_SHARE = 0.2  # of neutral_range, that the neutral volume may change in a dive
_CALM_SHARE = 0.25  # of that change, by which the model may miss where it is learnt
_KNOWN_S = 10.0  # s, in which it is learnt, after the low passes have settled
_FORGET_S = 1800.0  # s, in which it may drift off
_FOLLOW_S = 2.0  # s, of the low pass on the volume's rate
_RATE_SHARE = 0.6  # of the rate asked for
_RATE_LEAST = 0.05  # of the full rate: friction and load that are not known take a twentieth
_RATE_LEAST_POSITIONER = 0.15  # a position that is read off by as much as its drift asks for that
_STOP_SHARE = 0.15  # of the full rate: what is asked for in a push that a block ends
_STOPS = 6  # of them; the chance that healthy ones end twice at one place is some percent
_AWAY = 5.0  # times what is known to have grown
_AWAY_FAST = 0.5  # of the full rate
_END_SHARE = 0.05  # of the stroke, next to an end stop
_WATER_SPEED = 1.0  # m/s, of swell
_AIR_PRESSURE = 1.0  # m, 100 hPa: more than weather changes the surface's reading
_AFLOAT = 0.5  # m, below the depth of emergence; weather and waves
_SUBMERGED = 0.5  # m, below that: neither weather nor a wave over the deck
_LEAST_UNDER = 3  # ticks
_OVERSTATED = 4.0  # by so much the noise of a depth may be
_ROUNDED = 5e-3  # m, quantum to which a driver may round without a word
_RARE = 1e-12  # chance that noise gives the same depth all along
_AT_LEAST_S = 10.0  # s, of the very same depth: a slow sensor repeats itself
_HIDDEN_S = 600.0  # s; noise that takes longer to show does not count
_MOVED_SHARE = 0.025  # of half the stroke, with which a depth cannot stay the same
# A way d has n = (d'' + gamma d')/a_b; through two low passes of tau that is at most (2.27 + 0.74
# gamma tau)/(a_b tau^2) times the largest d, the integrals of their responses. d is a quantum, two
# of which are in what is hidden, and the model is off by 30 %.
_HIDDEN = 1.5
_REACH, _AHEAD = 2.0, 2.0  # of that, by which a push shows that it can, and more for the way down
_READY, _LEAST_READY = 1.5, 0.5  # m, of a step that a law's holding makes ready for; the least
_LEFT_ALONE = 5e-3  # m, by which that may move the vehicle
_ABOVE_STOP = 1.1  # of what counts as a stop, that a push asks for at least
_SINKS = 0.6  # of that, by which the vehicle is heavy
# On the edge between two quanta noise turns the depth in a quarter of the ticks; the mean of 200 is
# within 0.16 of that. 0.42 means sigma above the quantum: a sample is then the same with a chance
# of 0.38. The number is for 0.53, that of 0.7 quanta: 44 samples, 1e-12.
_NOISY, _NOISY_WEIGHT, _SAME_NOISY = 0.42, 0.005, 44
_GROWN_SHARE = 2e-3  # of half the stroke
_STILL_S = 5.0
_UNPROVEN_S = 30.0  # s, in which what was shown of the actuator counts
_HOLDING, _EARLY = 3.2, 3.0  # times it, while a law holds a depth; when it is shown there
_BLOCKED_SHARE = 0.585  # of the speed of a way without drag, that a block at its middle meets
_LONGEST_JUMP = 20.0  # m
_REST_S, _LEAST_PUSH_S = 20.0, 10.0
_STALL_S = 300.0  # a motor may stand still for that long under its full voltage
_RELEASE_S = 60.0
_RISE = 1.0  # m
_DEEPEST = 12000.0  # m, deeper than any sea
_CALLS = 8  # of a float's law at its seldomest, in which it comes nearer
_OFTEN_S = 120.0  # s, of a law that decides more seldom: it may stay beyond its band for hours
_NEARER = 0.1  # m, by so much
_BEYOND, _BEYOND_BAND = 2.0, 2.0  # m, and of a law's band, beyond which it has to come nearer
_DRIFTS_S = 21600.0  # s, in which what the runs make may drift off: pump and valve as they are
_LIGHT_S = 60.0  # s, of a float with more volume than it can need
_SPEED, _HASTE = 0.1, 2.0  # m/s, that of Argo floats; times it, so fast it may sink at most
_AFLOAT_REST_S = 600.0  # between pushes of a pump that has pumped all out: it may run dry
_NO_USE = {"neutral_change", "model_error", "prove_after", "hold_voltage"}
_SHORTER = "Give a shorter {}, or a longer sample_time"

_Limits = TypeVar("_Limits")


def supervisor_parameters(
    vehicle: Vehicle, sample_time: float, *, in_pool: bool = False, laws: Laws | None = None
) -> SupervisorParameters:
    """Return the supervisor's numbers for a vehicle at a sample time [s].

    laws: that it watches, each with its parameters; None: the vehicle's own.
    Raises InputError where full buoyancy would not bring the vehicle up from its depth limit.
    """
    pumps = vehicle.command == "volume change"
    if laws is None:
        laws = () if vehicle.controller is None else (bind(vehicle.controller)[:2],)
    if pumps:
        vehicle = _with_pump(vehicle)
    given, sensors = vehicle.supervisor, vehicle.sensors
    p = dynamics.plant(_as_positioner(vehicle) if pumps else vehicle)
    tick = sample_time
    half = 0.5 * (p.V_max - p.V_min)
    voltage = p.positioner == 0.0
    known = min(_NEUTRAL_SHARE * half, 0.5 * (p.V_max - p.V_0))
    neutral_range = _either(given.neutral_range, known)
    change = _either(given.neutral_change, _CHANGE_SHARE * neutral_range)
    psi_range = given.model_error * abs(p.psi)
    battery_low = _either(given.battery_low, _BATTERY_SHARE * p.supply if voltage else 0.0)
    depth_limit, deepest = _depths(vehicle, p, battery_low, neutral_range, psi_range)
    bounded = min(depth_limit, _DEEPEST)
    turn_rate = _rate(p, bounded, battery_low)
    stroke_s = 2.0 * half / turn_rate
    held = min(p.supply, _held(p, min(deepest, _DEEPEST))) if voltage else 0.0
    hold = _either(given.hold_voltage, held)
    full_rate = p.rate if not voltage else p.gain * (p.supply - p.friction)
    tau, follow = max(_TAU_S, 10.0 * tick), max(_FOLLOW_S, 5.0 * p.T1 if voltage else 0.0, 5 * tick)
    noise, quantum = sensors.depth_noise, sensors.depth_quantum
    frozen = given.frozen
    same = _same_ticks(noise, quantum, tick) if frozen is None else ticks(frozen, tick)
    patience = max(3, ticks(given.patience, tick))
    fastest = (dynamics.terminal_speed(p, p.a_b * (half + neutral_range)) + _WATER_SPEED) * tick
    moving = 6.0 * noise + 2.0 * quantum
    still = ticks(max(_STILL_S, math.sqrt(6.0 * (moving + 0.02) / (p.a_b * change))), tick)
    whole = None if given.time_limit is None else math.ceil(given.time_limit / tick - 1e-6)
    floor = _either(given.bottom_depth, math.inf)
    grown = max(_GROWN_SHARE * half, 6.0 * sensors.volume_noise + 2.0 * sensors.volume_quantum)
    moved = _MOVED_SHARE * half
    proof = tried = holding = early = NEVER
    reach, sinks = _REACH * moved, _SINKS * moved
    per_jump = _per_jump(p, reach, full_rate)
    # out and back at its rate, a volume moves the vehicle by 2 a_b V^3/rate^2 or so
    leaves = (0.5 * _LEFT_ALONE * full_rate * full_rate / p.a_b) ** (1.0 / 3.0) - sinks - grown
    ready = min(_READY, max(leaves, 0.0) / (max(p.psi, 0.0) + per_jump * (reach - sinks)))
    # a hull that loses so much less than the water comes to rest before it is too deep, heavier by
    # what the model does not see; in a pool a push would end the very sinking that is measured
    if given.prove_after is not None or (-p.psi * bounded < change and not in_pool):
        after = given.prove_after or _UNPROVEN_S
        proof = holding = ticks(after, tick)
        tried = max(proof, ticks(2.0 * math.sqrt(2.0 * moving / (p.a_b * grown)), tick))
        moves = not any(law.rests(numbers) for law, numbers in laws)
        if moves and ready >= _LEAST_READY:
            holding, early = ticks(_HOLDING * after, tick), ticks(_EARLY * after, tick)
    stop_rate = stopped = max(_STOP_SHARE * full_rate, 3.0 * grown / tick)
    if voltage and tick <= p.T1:  # the motor's own lag would look like a stop
        stop_rate = math.inf
    found = SupervisorParameters(
        S_p=tick,
        per_tick=1.0 / tick,
        push=supervisor.PushLimits(
            surface_command=p.supply if voltage else p.V_max,
            hold_command=hold if voltage else p.V_max,
            quarter=0.25 * p.supply if voltage else 0.25 * (p.V_max - p.V_min),
            away_command=-p.supply if voltage else p.V_min,
            away_hold=0.0 if voltage else p.V_min,
            push=ticks(2.0 * stroke_s, tick),
            again=ticks(max(_LEAST_PUSH_S, 0.5 * stroke_s), tick),
            rest=ticks(_REST_S, tick),
            stall=ticks(max(_STALL_S, 2.0 * stroke_s), tick),
            grown=grown,
            away=_AWAY * grown + (p.T1 * full_rate if voltage else 0.0),
            away_fast=_AWAY_FAST * full_rate * tick,
            astray=ticks(follow, tick),
            release=ticks(given.release_time or 2.0 * stroke_s + _RELEASE_S, tick),
            rise=_RISE,
        ),
        depth=supervisor.DepthLimits(
            depth_least=p.z_air - _AIR_PRESSURE,
            depth_most=min(1.5 * deepest + 10.0, _DEEPEST) if deepest < math.inf else _DEEPEST,
            fastest=fastest,
            jump=moving + 0.05,
            step=fastest + moving + 0.05,
            late_age=given.late or max(2.0 * tick, 1.0),
            blind_quarters=_quarters(patience),
            gap=patience,
        ),
        volume=supervisor.VolumeLimits(
            blind=patience,
            volume_least=p.V_min - 2.0 * _END_SHARE * half,
            volume_most=p.V_max + 2.0 * _END_SHARE * half,
            volume_low=p.V_min + 2.0 * _END_SHARE * half,
            volume_high=p.V_max - 2.0 * _END_SHARE * half,
        ),
        rate=supervisor.RateLimits(
            positioner=p.positioner,
            rate=p.gain if voltage else p.rate,
            load_drive=p.load_drive,
            load_back=p.load_back,
            friction=p.friction,
            leakage=p.k_l,
            rate_smoothing=tick / (follow + tick),
            rate_share=_RATE_SHARE,
            rate_least=(_RATE_LEAST if voltage else _RATE_LEAST_POSITIONER) * full_rate,
            stop_rate=stop_rate,
            stop_least=grown / tick,
            stops=_STOPS,
            following=patience,
        ),
        same=supervisor.SameLimits(
            same=same,
            same_begun=ticks(2.0 * tau, tick),
            same_moved=ticks(3.0 * tau, tick),
            moved=max(moved, moving * _HIDDEN * (1.0 / (p.a_b * tau) + p.d_l / p.a_b) / tau),
            same_noisy=max(ticks(_AT_LEAST_S, tick), _SAME_NOISY),
            noisy=_NOISY,
            noisy_weight=_NOISY_WEIGHT,
        ),
        proof=supervisor.ProofLimits(
            same_tried=tried,
            unproven=proof,
            holding=holding,
            early=early,
            sinks=sinks,
            reach=reach,
            per_speed=math.sqrt(max(p.psi, 0.0) / p.a_b),
            lead=p.a_b * tau,
            per_jump=per_jump,
            ready=ready,
            least_way=_ABOVE_STOP * stopped * tick,
            ahead=_AHEAD * moved,
        ),
        neutral=supervisor.NeutralLimits(
            psi=p.psi, psi_range=psi_range, neutral=p.V_0, neutral_range=neutral_range
        ),
        motion=supervisor.MotionLimits(
            neutral_change=change,
            known=ticks(_KNOWN_S, tick),
            forgetting=tick / (_FORGET_S + tick),
            calm=_CALM_SHARE * change,
            model_error=given.model_error,
            inertia=1.0 / (p.a_b * tau * tau),
            drag_linear=p.d_l / p.a_b,
            epsilon=p.epsilon,
            drag_blunt=p.d_b / p.a_b,
            drag_0=p.d_0 / p.a_b,
            drag_square=p.d_t / p.a_b,
            per_tau=1.0 / tau,
            smoothing=tick / (tau + tick),
            settle=ticks(_SETTLE * tau, tick),
            # one that is driven off twice the band counts threefold until it has left its place
            wrong=max(patience + still, math.ceil(1.25 * still)),
        ),
        rest=supervisor.RestLimits(
            surface=p.z_surface + _AFLOAT,
            aground=floor - max(0.1, 0.02 * floor) - moving if floor < math.inf else math.inf,
            still_distance=moving + 0.02,
            still=still,
        ),
        progress=supervisor.ProgressLimits(
            math.inf, max(_NEARER, moving), NEVER, p.V_0, p.psi, math.inf, 0.0, NEVER
        ),
        deep=supervisor.DeepLimits(
            depth_limit=depth_limit,
            deepest=deepest,
            heavier=change,
            turn_rate=turn_rate,
            per_turn_rate=1.0 / turn_rate,
            force=p.a_b,
            largest=p.V_max,
            lag=_LAG * tau + max(_SHORT_S, 2.0 * tick),
            deep=max(2, ticks(_SHORT_S, tick)),
        ),
        board=supervisor.BoardLimits(
            battery_low=battery_low,
            battery=ticks(_BATTERY_S, tick),
            leak=max(2, ticks(_SHORT_S, tick)),
            missed=max(3, ticks(_NO_COMMAND_S, tick)),
        ),
        time=supervisor.TimeLimits(
            lost_quarters=_quarters(patience),
            time_blocks=NEVER if whole is None else whole // supervisor.BLOCK,
            time_ticks=0 if whole is None else whole % supervisor.BLOCK,
        ),
    )
    return _for_pump(vehicle, found, laws) if pumps else found


def arming_parameters(vehicle: Vehicle, p: SupervisorParameters) -> ArmingParameters:
    """Return when a vehicle under a supervisor of these numbers counts as under water.

    Raises InputError where a vehicle that sinks would be armed too deep to come up.
    """
    given, tick, deepest = vehicle.supervisor, p.S_p, p.deep.deepest
    usual = min(p.rest.surface + _SUBMERGED, 0.5 * (given.bottom_depth or math.inf))
    submerged = _either(given.arm_depth, usual)
    under = max(_LEAST_UNDER, ticks(given.arm_after, tick))
    if (armed := submerged + under * p.depth.fastest) > deepest:
        what = f"a vehicle that sinks may be armed at {armed:.3g} m only, below its {deepest:.4g} m"
        remedy = "Give a smaller arm_depth or arm_after"
        raise _refused(what, "arm_depth", submerged, "m", remedy)
    voltage = vehicle.command != "volume"
    return ArmingParameters(
        S_p=tick,
        positioner=0.0 if voltage else 1.0,
        volume_least=vehicle.stroke.minimum,
        volume_most=vehicle.stroke.maximum,
        depth_least=p.depth.depth_least,
        depth_most=p.depth.depth_most,
        submerged=submerged,
        under=under,
        blind=p.depth.gap,
    )


def board_reach(p: SupervisorParameters) -> float:
    """Return the depth [m] down to which a board knows what its pump delivers."""
    return min(p.deep.deepest, p.depth.depth_most)


def command_limits(vehicle: Vehicle, tick_s: float = math.inf) -> tuple[float, float]:
    """Return the least and the largest command: of the supply [V], of the stroke [m3].

    Of a pump and valve a tick_s [s] each.
    """
    if vehicle.command == "volume change":
        return -tick_s, tick_s
    if vehicle.voltage_driven:
        assert vehicle.supply is not None
        return -vehicle.supply.voltage, vehicle.supply.voltage
    return vehicle.stroke.minimum, vehicle.stroke.maximum


def _refused(what: str, name: str, value: float, unit: str | None, remedy: str) -> InputError:
    """Return the error about a number of the supervisor."""
    return InputError(what, field=f"supervisor.{name}", value=value, unit=unit, remedy=remedy)


def _either(given: float | None, usual: float) -> float:
    return usual if given is None else given


def _with_pump(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle with a pump whose battery has a lowest voltage, where it has a battery.

    Raises InputError for what the supervisor of a pump cannot use.
    """
    given = vehicle.supervisor
    for name in sorted(_NO_USE & given.model_fields_set):
        if (value := getattr(given, name)) is not None:
            what = (
                "it is about a volume that is measured or a motor that is driven by a voltage, and "
                "the volume of a pump and valve is known from the times of its runs only"
            )
            raise _refused(what, name, value, None, "Leave it out")
    if vehicle.supply is None or given.battery_low is not None:
        return vehicle
    known = given.model_copy(update={"battery_low": _BATTERY_SHARE * vehicle.supply.voltage})
    return vehicle.model_copy(update={"supervisor": known})


def _pump_rates(vehicle: Vehicle, volts: float) -> tuple[float, float]:
    """Return the depth to which a pump delivers at a voltage [m], and its least rate [m3/s].

    The rate is that down to the depth limit. A pump as measured knows of no voltage, and one that
    delivers everywhere does so to an infinite depth. Raises InputError where it delivers nowhere.
    """
    low, a = vehicle, vehicle.engine
    assert isinstance(a, PumpAndValve)
    if vehicle.supply is not None and volts > 0.0:
        low = at_voltage(vehicle, min(volts, vehicle.supply.voltage))
    bounds = (vehicle.supervisor.depth_limit, vehicle.hull.depth_limit, _DEEPEST)
    depth = np.linspace(0.0, _DEEPEST, 2401)
    head = depth * vehicle.water.specific_weight + ATMOSPHERIC_PRESSURE - a.internal_pressure
    rate = running_pump(low, a, head, REFERENCE_TEMPERATURE)[0]
    stalls = rate <= 0.0
    deepest = float(depth[np.argmax(stalls)]) if stalls.any() else math.inf
    sure = _DEPTH_SHARE * _SURE_TO_MOVE * deepest
    used = depth <= min(sure, *(b for b in bounds if b is not None))
    if not rate[0] > 0.0:
        what = f"at {volts:g} V the pump delivers nothing"
        raise _refused(what, "battery_low", volts, "V", "Give a higher voltage")
    return deepest, float(np.min(rate[used]))


def _as_positioner(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a piston as slow as its pump at its slowest, for its motion."""
    rate = _pump_rates(vehicle, vehicle.supervisor.battery_low or 0.0)[1]
    piston = Positioner(speed=rate, piston_area=1.0)
    return dynamics.even_drag(vehicle).model_copy(update={"actuator": piston})


def _for_pump(vehicle: Vehicle, p: SupervisorParameters, laws: Laws) -> SupervisorParameters:
    """Return the limits of a vehicle that is commanded seconds of pump and valve.

    Its volume is not watched, nor what follows from it: model, actuator, test pushes. The
    supervisor sees a volume of 0, and commands a pump that runs all of a tick.
    """
    tick, deep = p.S_p, p.deep
    start = float(drive_map(vehicle, 0.0, power=False).start_volume[0])
    fast = _HASTE * cruising_speed(vehicle)
    lacks = dynamics.drag_force(vehicle.drag, fast) / vehicle.water.specific_weight + start
    fastest = p.depth.fastest / math.sqrt(min(vehicle.drag.rising_ratio, 1.0))
    again = ticks(_LEAST_PUSH_S + start * deep.per_turn_rate, tick)
    push = _off(p.push, "grown away away_fast astray", zero="hold_command away_command away_hold")
    rest = ticks(_AFLOAT_REST_S, tick)
    return p._replace(
        push=push._replace(surface_command=tick, again=again, rest=rest, stall=again),
        depth=p.depth._replace(fastest=fastest, step=p.depth.step + fastest - p.depth.fastest),
        volume=supervisor.VolumeLimits(NEVER, -1.0, 1.0, -1.0, 1.0),
        rate=_off(p.rate, "rate_least stop_rate following", zero="rate"),
        same=_off(p.same, "same_moved moved"),
        proof=_off(p.proof, " ".join(p.proof._fields)),
        neutral=supervisor.NeutralLimits(0.0, 0.0, 0.0, neutral_range=math.inf),
        motion=_off(p.motion, "neutral_change known wrong", zero="calm model_error inertia"),
        progress=_progress(vehicle, p, laws),
        deep=deep._replace(heavier=lacks, largest=math.inf),
    )


def _progress(vehicle: Vehicle, p: SupervisorParameters, laws: Laws) -> supervisor.ProgressLimits:
    """Return how a float comes nearer to the depth asked for, and how much volume it can need.

    That is the file's neutral volume and `neutral_range`, or half of what is left of the stroke.
    As patient as the law that takes longest: one that says neither how near it rests nor how long
    it waits, or that waits for longer than `_OFTEN_S`, may take any time.
    """
    bands = (leaves(n)[law.band] if law.band else math.inf for law, n in laws)
    pauses = (law.longest_wait(n) if law.longest_wait else math.inf for law, n in laws)
    band, pause = max(bands, default=math.inf), max(pauses, default=math.inf)
    arrived, waits = math.inf, NEVER
    if band < math.inf and pause <= _OFTEN_S:
        arrived = band + max(_BEYOND, _BEYOND_BAND * band)
        waits = ticks(min(_CALLS * pause, _COUNTED * p.S_p), p.S_p)
    spare = 0.5 * (p.deep.largest - p.neutral.neutral)
    return p.progress._replace(
        arrived=arrived,
        waits=waits,
        light_range=_either(vehicle.supervisor.neutral_range, spare),
        light_smoothing=p.S_p / (_DRIFTS_S + p.S_p),
        light=ticks(_LIGHT_S, p.S_p),
    )


def _off(limits: _Limits, names: str, *, zero: str = "") -> _Limits:
    """Return limits with some of them off: infinite, or in ticks NEVER; and others 0."""
    known: Any = limits
    kinds = field_types(type(known))
    changed = {name: NEVER if kinds[name] == Count else math.inf for name in names.split()}
    off: _Limits = known._replace(**changed, **dict.fromkeys(zero.split(), 0.0))
    return off


def cruising_speed(vehicle: Vehicle) -> float:
    """Return the largest speed that a float's law asks for [m/s]; 0.1 where it does not say."""
    given = {} if vehicle.controller is None else leaves(bind(vehicle.controller)[1])
    return float(given.get("far_speed", _SPEED))


def _per_jump(p: Plant, reach: float, rate: float) -> float:
    """Return 1/the jump [1/m] for which a volume has to reach so far [m3] at a rate [m3/s].

    A vehicle whose volume rate is bounded goes a way d from rest to rest in (32 d/(a_b rate))^(1/3)
    without drag, at twice d over that in its middle, where it has turned from less to more volume
    than neutral. A volume that is blocked from there on stops it while it is above the neutral one
    by sqrt(psi/a_b) times its speed.
    """
    slope = _BLOCKED_SHARE * math.sqrt(max(p.psi, 0.0) / p.a_b) * 2.0
    if slope * rate <= 0.0:
        return 1.0 / _LONGEST_JUMP
    jump: float = (reach / slope) ** 1.5 / math.sqrt(p.a_b * rate / 32.0)
    return 1.0 / min(jump, _LONGEST_JUMP)


def ticks(seconds: float, tick: float) -> int:
    """Return a time in whole ticks, rounded up, one at least.

    Raises InputError where 16 bits do not count them.
    """
    if (whole := max(1, math.ceil(seconds / tick - 1e-6))) > _COUNTED:
        counted = f"{seconds:g} s are {whole:.3g} ticks of {tick:g} s"
        what = f"{counted}, and the supervisor counts to {_COUNTED}"
        raise InputError(what, field="supervisor", remedy=_SHORTER.format("time"))
    return whole


def _quarters(whole: int) -> int:
    """Return ticks in quarters of ticks, with room for what is added at the limit.

    Raises InputError where 16 bits do not count them.
    """
    if 4 * whole > _COUNTED - 2:
        what = f"that many quarters of ticks are more than the supervisor counts to, {_COUNTED}"
        raise _refused(what, "patience", whole, "ticks", _SHORTER.format("patience"))
    return 4 * whole


def _depths(
    vehicle: Vehicle, p: Plant, volts: float, neutral_range: float, psi_range: float
) -> tuple[float, float]:
    """Return (depth limit, deepest from which the vehicle can come up) [m]; infinite: none known.

    The hull bears it, full buoyancy is above the neutral volume, the motor moves at `volts`.
    """
    given, spare = vehicle.supervisor.depth_limit, min(p.V_max, p.switch_out) - p.V_0
    rated = vehicle.hull.depth_limit or math.inf
    lifted = spare / p.psi if p.psi > 0.0 else math.inf
    load = p.gain * p.load_drive + p.k_l
    free = p.gain * (volts - p.friction)
    moved = free / load if load > 0.0 else math.inf
    if vehicle.command == "volume change":
        moved = _pump_rates(vehicle, volts)[0]
    if p.positioner == 0.0 and free <= 0.0:
        what = f"at {volts:g} V the motor does not beat its friction, {p.friction:g} V"
        raise _refused(what, "battery_low", volts, "V", "Give a higher voltage")
    if neutral_range >= spare:
        what = "the neutral volume may then be beyond the stroke, and full buoyancy not lift"
        remedy = f"Trim the vehicle lighter, or give less than {spare * 1e6:.3g} cm3"
        raise _refused(what, "neutral_range", neutral_range, "m3", remedy)
    deepest, why = min(
        (rated, "the hull is rated for (hull.depth_limit)"),
        (lifted, "full buoyancy lifts the vehicle (stroke, psi)"),
        (_SURE_TO_MOVE * moved, f"the motor moves at {volts:g} V (supervisor.battery_low)"),
    )
    if given is not None:
        if given > deepest:
            what = f"deeper than the {deepest:.4g} m to which {why}"
            remedy = f"Give at most {deepest:.4g} m, less a margin to turn round in"
            raise _refused(what, "depth_limit", given, "m", remedy)
        return given, deepest
    slope = p.psi + psi_range
    sure = (spare - neutral_range) / slope if slope > 0.0 else math.inf
    return min(_DEPTH_SHARE * deepest, sure), deepest


def _rate(p: Plant, depth: float, volts: float) -> float:
    """Return the rate [m3/s] at which the volume grows at a depth [m] and a voltage."""
    if p.positioner > 0.0:
        return p.rate
    return p.gain * (volts - p.load_drive * depth - p.friction) - p.k_l * depth


def _held(p: Plant, depth: float) -> float:
    """Return the voltage that holds the volume against the sea and the leakage at a depth [m]."""
    return p.load_drive * depth + p.k_l * depth / p.gain


def _same_ticks(noise: float, quantum: float, tick: float) -> int:
    """Return how many samples of the very same depth noise makes as good as impossible.

    White noise leaves a sample in its quantum with a chance of erf(q/(2 sqrt(2) sigma)) at most.
    What is stated may be too much noise, and a driver may round. A sensor that has shown noise is
    held against that (`same_noisy`); this is for one that never did.
    """
    if noise == 0.0:
        return NEVER
    noise, quantum = noise / _OVERSTATED, max(quantum, _ROUNDED)
    chance = math.erf(quantum / (2.0 * math.sqrt(2.0) * noise))
    if chance >= 1.0:
        return NEVER
    samples = math.log(_RARE) / math.log(chance) if chance > 0.0 else 1.0
    if samples * tick > _HIDDEN_S or samples > _COUNTED:
        return NEVER
    return max(ticks(_AT_LEAST_S, tick), math.ceil(samples))


def check_time_limit(vehicle: Vehicle, remedy: str = "") -> None:
    """Raise InputError where the supervisor has no time limit: a slow drift has no other remedy."""
    if vehicle.supervisor.time_limit is None:
        drifts = "a vehicle whose depth drifts slowly"
        what = f"no time limit is stated, and nothing else brings up {drifts}"
        say = 'Give the longest that a mission takes from arming on, like `time_limit="2 h"`'
        say = f"{say}, or as time_limit in [supervisor]{remedy}"
        raise InputError(what, field="supervisor.time_limit", remedy=say)


def summary(p: SupervisorParameters) -> str:
    """Return what the command line says of the supervisor, one line."""
    battery = f"below {p.board.battery_low:.3g} V" if p.board.battery_low > 0.0 else "not watched"
    depth = f"{p.deep.depth_limit:.4g} m" if math.isfinite(p.deep.depth_limit) else "none"
    frozen = f"after {p.same.same * p.S_p:.3g} s"
    if p.same.same == NEVER:
        frozen = "by the model only (no depth noise is stated, or a quantum hides it)"
    time = time_limit(p) or "none"
    limits = f"depth limit {depth}, time limit {time}, battery {battery}"
    return f"supervisor: {limits}, frozen depth {frozen}"


def time_limit(p: SupervisorParameters) -> str:
    """Return the time limit as text, empty where there is none."""
    time = (p.time.time_blocks * supervisor.BLOCK + p.time.time_ticks) * p.S_p
    return f"{time:.6g} s" if p.time.time_blocks < NEVER else ""
