"""The linear analysis of a vehicle, with its law: gathered, as JSON, and what it says in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swimbladder.control.law import Law
from swimbladder.control.registry import check_command, own_law
from swimbladder.design.linear import depths, models, pump_valve
from swimbladder.design.linear.margins import Margins
from swimbladder.design.linear.sampled import ClosedLoop, LinearLaw, close
from swimbladder.design.linear.transfer import (
    RouthTable,
    TransferFunction,
    routh_table,
    transfer_functions,
)
from swimbladder.errors import check_number
from swimbladder.io.answers import Answer, as_json, plain
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.checks import law_at_rest
from swimbladder.units import say
from swimbladder.vehicle import Vehicle

DOWN = "Give a depth below the surface, positive down"


_say = partial(say, "design", "analysis")


def _rest(a: Analysis) -> Iterator[str]:
    p, v = a.operating_point, a.vehicle
    text = _say("rest", p=p)
    if v.voltage_driven:
        text += _say("held by", p=p)
        if p.voltage_back != p.voltage:
            text += _say("gives way", p=p)
    yield text + "."
    if not v.stroke.minimum <= p.volume <= v.stroke.maximum:
        yield _say("outside the stroke", stroke=v.stroke)
    elif not a.rests:
        why = "the supply cannot hold the motor"
        if a.drive is not None:
            why = "more leaks back than the pump delivers"
        yield _say("does not rest", stall=a.stall, why=why)


def _open_loop_words(a: Analysis) -> Iterator[str]:
    o = a.open_loop
    found = o.routh.sentence
    text = f"Open loop, by Routh's table: {found[0].lower()}{found[1:]}"
    if math.isfinite(o.doubling_time):
        text += _say("grows", o=o)
    yield text
    if a.vehicle.drag.law == "quadratic":
        yield _say("quadratic")
    elif a.vehicle.drag.law != "linear":
        yield "The drag is the laminar one of small speeds."


def _motions(a: Analysis) -> Iterator[str]:
    """Yield what a body does whose volume is kept between two actions of pump and valve."""
    if not a.motions:
        return
    rest, moving = a.motions[0], a.motions[1:]
    if math.isfinite(rest.growth_time):
        yield _say("gives way more", rest=rest)
    elif math.isfinite(rest.period):
        yield _say("swings", rest=rest)
    yield _say("on its way", times=", ".join(_say("settles", m=m) for m in moving))


def _section_2_5(a: Analysis) -> Iterator[str]:
    s = a.stiff_hull
    if s is not None and s.unstable:
        which = "A hull stiffer than water would"
        if a.vehicle.hull.psi < 0.0:
            which = "That the hull is stiffer than water does"
        yield _say("stiff hull", which=which, s=s)
    elif s is not None:
        yield _say("no load")
    if a.double_integrator_phase_margin is not None:
        yield _say("integrator", margin=math.degrees(a.double_integrator_phase_margin))


def _depths(a: Analysis) -> Iterator[str]:
    s, limit, n = a.stall, a.vehicle.hull.depth_limit, a.neutral
    if s is not None and math.isinf(s.depth):
        yield "No depth loads the motor, so none stalls it."
    elif s is not None:
        text = _say("stall", at=f" at {s.voltage:.3g} V" if math.isfinite(s.voltage) else "", s=s)
        if s.depth_without_sag > s.depth:
            text += _say("without sag", s=s)
        if limit is not None:
            text += _say("limit above" if s.within_limit else "limit below", limit=limit)
        yield text + "."
        if s.holding_depth < s.depth:
            yield f"Below {s.holding_depth:.1f} m the pump leaks more than it moves."
        if s.extending_rate > 0.0:
            yield _say("extends", depth=a.depth, s=s)
    if math.isfinite(n.leaves_stroke) and n.leaves_stroke > 0.0:
        text = f"The neutral volume leaves the stroke at {n.leaves_stroke:.1f} m"
        if limit is not None and n.leaves_stroke < limit:
            text += _say("before the limit", limit=limit)
        yield text + "."


def _closed_loop_words(a: Analysis) -> Iterator[str]:
    c = a.closed_loop
    if c is None:
        if not a.notes:
            yield "The vehicle has no controller: nothing is said of a closed loop."
        return
    where = "voltage" if a.vehicle.voltage_driven else "volume command"
    if not c.stable:
        radius = max(c.spectral_radius, c.spectral_radius_back_driven)
        yield _say("unstable", c=c, radius=radius, growth=radius - 1.0)
    else:
        yield _say("stable", c=c, z=_complex(c.modes[0].z), slowest=c.modes[0])
    if c.one_loop:
        where += " or, which is the same here, at the measured depth"
    if c.at_command is not None:
        yield _margin_words(c.at_command, where)
    if c.at_depth is not None and not c.one_loop:
        yield _margin_words(c.at_depth, "measured depth")
    if c.stable:
        yield _delays(c)
    if c.depth_load is not None:
        text = _say("depth load", load=c.depth_load)
        if math.isfinite(c.depth_load.share_of_psi):
            of = "psi" if a.vehicle.hull.psi > 0.0 else "the size of psi"
            text += _say("share of psi", share=abs(c.depth_load.share_of_psi), of=of)
        yield text + "."
        continuous = "continuous time is a close approximation"
        if c.inner_gain_per_sample > 0.2:
            continuous = "analyse it in discrete time"
        yield _say("inner loop", c=c, continuous=continuous)
    if not a.vehicle.voltage_driven:
        yield _say("at once", c=c)


def _margin_words(m: Margins, place: str) -> str:
    up = f"{20.0 * math.log10(m.gain_up):+.1f} dB" if math.isfinite(m.gain_up) else "any increase"
    down = f"{20.0 * math.log10(m.gain_down):+.1f} dB" if m.gain_down > 0.0 else "any decrease"
    phase = "no gain crossover"
    if math.isfinite(m.phase):
        phase = _say("phase", degrees=math.degrees(m.phase), m=m)
    disk = math.degrees(m.disk_phase)
    return _say("margins", place=place, up=up, down=down, phase=phase, m=m, disk=disk)


def _delays(c: ClosedLoop) -> str:
    whole = "stable" if c.radius_at_whole_sample < 1.0 else "NOT stable"
    delay = "No computation delay makes the loop unstable"
    if math.isfinite(c.computation_delay):
        delay = _say("delay", c=c)
    age = "any age" if math.isinf(c.depth_delay) else f"an age of {c.depth_delay:.3g} s"
    return _say("delays", delay=delay, whole=whole, age=age)


def _complex(z: complex) -> str:
    return f"{z.real:.5f}" if z.imag == 0.0 else f"{z.real:.5f} {z.imag:+.5f}i"


_MARGINS = (
    "gain_up gain_up_frequency_rad_s gain_down gain_down_frequency_rad_s phase_rad "
    "phase_frequency_rad_s delay_s delay_frequency_rad_s peak_sensitivity peak_frequency_rad_s "
    "disk disk_gain disk_phase_rad disk_frequency_rad_s"
)


_LOOP = (
    "law sample_time_s stable spectral_radius spectral_radius_back_driven "
    "computation_delay_limit_s=computation_delay depth_delay_limit_s=depth_delay "
    "spectral_radius_with_one_sample_of_computation=radius_at_whole_sample "
    "inner_gain_per_sample volume_per_sample_m3 error_at_rate_limit_m"
)
_DEPTH_LOAD = "k_pV_V_m3 extra_psi_m3_m share_of_psi doubling_time_s doubling_time_rejected_s"
_STIFF_HULL = "psi_m3_m poles doubling_time_s poles_without_loads unstable"
_STALL = (
    "depth_m depth_without_sag_m holding_depth_m back_drive_depth_m voltage_V extending_rate_m3_s "
    "within_limit"
)
_ROUTH = (
    "powers rows first_column_signs=first_column notes right_half_plane=right imaginary_axis=axis "
    "sentence"
)
_TRANSFER = "equations input output symbols numerator denominator poles"
_DRIVE = (
    "depth_m=depths pump_rate_m3_s=pump pump_power_W valve_rate_m3_s=valve bypass_rate_m3_s=bypass "
    "leakage_m3_s start_volume_m3"
)
_MOTION = "speed_m_s time_constant_s poles growth_time_s period_s"


def _margins(found: Margins | None) -> dict[str, Any] | None:
    return found and as_json(found, _MARGINS) | {"phase_deg": math.degrees(found.phase)}


def closed_loop_json(c: ClosedLoop) -> dict[str, Any]:
    """Return a sampled loop for JSON, in SI units."""
    return {
        **as_json(c, _LOOP),
        "poles_z": [mode.z for mode in c.modes],
        "poles_s": [mode.s if math.isfinite(mode.s.real) else None for mode in c.modes],
        "damping": [mode.damping for mode in c.modes],
        "time_constant_s": [mode.time_constant for mode in c.modes],
        "margins": {"command": _margins(c.at_command), "depth": _margins(c.at_depth)},
        "stable_with_one_sample_of_computation": c.radius_at_whole_sample < 1.0,
        "depth_load": c.depth_load and as_json(c.depth_load, _DEPTH_LOAD),
    }


@dataclass(frozen=True, kw_only=True)
class OpenLoop:
    """The transfer function from the command to the depth, from the numerical linearisation."""

    input: str  # "U", or "V" for a positioner
    numerator: tuple[float, ...]  # descending powers of s
    denominator: tuple[float, ...]  # normalised as (34), or (32), where they exist
    poles: tuple[complex, ...]  # 1/s, eigenvalues, the largest real part first
    doubling_time: float  # s, of the fastest growing disturbance; inf if none grows
    routh: RouthTable


@dataclass(frozen=True, kw_only=True, eq=False)
class Analysis(Answer):
    """Everything that the linear models say of a vehicle at a depth."""

    vehicle: Vehicle
    depth: float  # m
    operating_point: models.OperatingPoint
    model: models.StateSpace
    transfer_functions: tuple[TransferFunction, ...]
    open_loop: OpenLoop
    stiff_hull: depths.StiffHull | None  # voltage-driven, psi not 0
    double_integrator_phase_margin: float | None  # rad, eq. (35) under a gain of 1 V/m
    stall: depths.Stall | None  # voltage-driven, pump and valve
    neutral: depths.NeutralVolume
    closed_loop: ClosedLoop | None  # vehicles with a controller
    notes: tuple[str, ...] = ()  # what was left out, and why
    drive: pump_valve.DriveRates | None = None  # pump and valve
    motions: tuple[pump_valve.Motion, ...] = ()  # pump and valve: the body at rest and on its way

    @property
    def stable(self) -> bool | None:
        """Whether the closed loop is stable; None without one."""
        return None if self.closed_loop is None else self.closed_loop.stable

    @property
    def rests(self) -> bool:
        """Whether stroke and supply hold the vehicle at the depth."""
        stroke, p = self.vehicle.stroke, self.operating_point
        held = self.stall is None or p.depth <= self.stall.holding_depth
        return bool(held and stroke.minimum <= p.volume <= stroke.maximum)

    def to_control(self) -> Any:
        """Return the linear model, command to depth and volume, as a python-control StateSpace."""
        return self.model.to_control()

    def response(self, count: int = 600) -> tuple[Any, Any]:
        """Return frequencies [rad/s] about the poles, and the response of depth to the command."""
        rates = np.abs([p for p in self.open_loop.poles if abs(p) > 1e-9])
        w = np.geomspace(rates.min() / 30.0, rates.max() * 30.0, count)
        model = self.model
        return w, model.part(output="z", input=model.inputs[0]).at(1j * w)[:, 0, 0]

    @property
    def findings(self) -> dict[str, tuple[str, ...]]:
        """What the numbers mean: by subject, the most important first."""
        return {
            "closed loop": (*_closed_loop_words(self), *self.notes),
            "depth": tuple(_depths(self)),
            "rest": tuple(_rest(self)),
            "open loop": (*_open_loop_words(self), *_motions(self), *_section_2_5(self)),
        }

    @property
    def sentences(self) -> list[str]:
        """All findings, a sentence each."""
        return [s for subject in self.findings.values() for s in subject]

    def to_dict(self) -> dict[str, Any]:
        """Return everything in JSON's own types, SI numbers; None for what is infinite."""
        o, stall, limit = self.open_loop, self.stall, self.vehicle.hull.depth_limit
        rest = "depth_m volume_m3 motor_rate_m3_s"
        if self.vehicle.voltage_driven:
            rest += " voltage_V voltage_back_V"
        volts = dict.fromkeys(("voltage_V", "voltage_back_V"))
        answer = {
            **as_json(self, "vehicle=vehicle.name depth_m rests stable findings notes"),
            "command": self.vehicle.command,
            "operating_point": volts | as_json(self.operating_point, rest),
            "open_loop": {
                **as_json(o, "input numerator denominator poles doubling_time_s"),
                "output": "Z",
                "stable": o.routh.stable,
            },
            "routh": as_json(o.routh, _ROUTH),
            "transfer_functions": [as_json(t, _TRANSFER) for t in self.transfer_functions],
            "state_space": as_json(self.model, "states inputs outputs A B C D"),
            "stiff_hull": self.stiff_hull and as_json(self.stiff_hull, _STIFF_HULL),
            "double_integrator_phase_margin_rad": self.double_integrator_phase_margin,
            "stall": stall and as_json(stall, _STALL) | {"depth_limit_m": limit},
            "neutral_volume": as_json(
                self.neutral, "depth_m=depths volume_m3=volumes leaves_stroke_at_m=leaves_stroke"
            ),
            "closed_loop": self.closed_loop and closed_loop_json(self.closed_loop),
        }
        if self.drive is not None:
            motions = [as_json(one, _MOTION) for one in self.motions]
            answer |= {"drive": as_json(self.drive, _DRIVE), "motions": motions}
        return {key: plain(value) for key, value in answer.items()}


def analyse(
    vehicle: Vehicle,
    *,
    depth: float = 0.0,
    law: Law | None = None,
    parameters: Any = None,
    sample_time: float | None = None,
) -> Analysis:
    """Return the linear analysis of a vehicle at rest at a depth.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    depth
        At which it rests [m].
    law
        Its control law; none: that of the vehicle's controller. Without either, nothing is said of
        a closed loop.
    parameters
        Of the law; none, without a law: those of the vehicle's controller.
    sample_time
        Of the law [s]; none: that of the vehicle's controller.

    Returns
    -------
    Analysis
        What the linear models say of the vehicle and, where the law is linear around rest, of its
        closed loop; else a note on why there is none.

    Raises
    ------
    InputError
        The law commands what the actuator does not take, it has no sample time, or the depth is
        negative.
    """
    check_number(depth, "depth", "m", least=0.0, remedy=DOWN)
    if law is None and vehicle.controller is not None:
        law, bound = own_law(vehicle, sampled=False)
        parameters = bound if parameters is None else parameters
    if law is None:
        return _analysed(vehicle, depth)
    sample_time = vehicle.sampled_every(sample_time)
    check_command(law, vehicle)
    if law.command == "volume change":
        return _analysed(vehicle, depth, notes=(_say("decides", law=law),))
    at_rest = law_at_rest(law, parameters, vehicle, depth=depth, sample_time=sample_time)
    if at_rest.smooth:
        return _analysed(vehicle, depth, law=at_rest, law_name=law.name)
    return _analysed(vehicle, depth, notes=(_say("not linear", law=law),))


def _analysed(
    vehicle: Vehicle,
    depth: float,
    law: LinearLaw | None = None,
    law_name: str = "",
    notes: tuple[str, ...] = (),
) -> Analysis:
    """Return the analysis of a vehicle at rest at `depth` [m], with its law already linear."""
    pumped = vehicle.command == "volume change"
    p = plant(pump_valve.moved_by_volume(vehicle))
    m, k_b = vehicle.mass, vehicle.water.specific_weight
    model = models.linearise(p, depth=depth)
    limit = vehicle.hull.depth_limit
    phase = None
    if not p.positioner and p.d_l > 0.0:
        phase = depths.double_integrator_phase_margin(
            K1=p.gain, K2=p.a_b / p.d_l, A=1.0, T1=p.T1, T2=1.0 / p.d_l
        )
    rest, load, drive = models.operating_point(p, depth=depth), None, None
    neutral = depths.neutral_volume(p, down_to=max(limit or 100.0, depth))
    if pumped:
        load = pump_valve.pump_stall(vehicle, depth=depth)
        drive = pump_valve.drive_rates(vehicle, neutral.depths)
        rest = rest._replace(motor_rate=pump_valve.drive_rates(vehicle, (depth,)).leakage[0])
    elif not p.positioner:
        load = depths.stall(p, depth=depth, depth_limit=limit)
    return Analysis(
        vehicle=vehicle,
        depth=depth,
        operating_point=rest,
        model=model,
        transfer_functions=transfer_functions(p, m=m, k_b=k_b),
        open_loop=_open_loop(model, p.T1, p.d_l),
        stiff_hull=depths.stiff_hull(p),
        double_integrator_phase_margin=phase,
        stall=load,
        neutral=neutral,
        closed_loop=None if law is None else close(p, law, name=law_name, depth=depth),
        notes=notes,
        drive=drive,
        motions=pump_valve.motions(vehicle, p) if pumped else (),
    )


def _open_loop(model: models.StateSpace, T1: float, d_l: float) -> OpenLoop:
    """The numerical model's Z over its command, times T1 T2 as far as they exist."""
    positioner = model.inputs == ("V",)
    factor = (1.0 if positioner else T1) * (1.0 / d_l if d_l > 0.0 else 1.0)
    numerator, denominator = models.polynomials(model.part(output="z", input=model.inputs[0]))
    scaled = tuple(factor * c for c in denominator)
    return OpenLoop(
        input="V" if positioner else "U",
        numerator=tuple(factor * c for c in numerator),
        denominator=scaled,
        poles=tuple(complex(x) for x in model.poles),
        doubling_time=depths.doubling_time(model),
        routh=routh_table(scaled),
    )
