"""The linear analysis of a vehicle, gathered: what it is, what it says, as JSON and as text.

What the linear analysis found in the types of JSON.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swimbladder.design.linear.depths import (
    NeutralVolume,
    Stall,
    StiffHull,
    double_integrator_phase_margin,
    doubling_time,
    neutral_volume,
    stall,
    stiff_hull,
)
from swimbladder.design.linear.findings import findings
from swimbladder.design.linear.margins import Margins
from swimbladder.design.linear.models import (
    OperatingPoint,
    StateSpace,
    linearise,
    operating_point,
    polynomials,
)
from swimbladder.design.linear.pump_valve import (
    DriveRates,
    Motion,
    drive_rates,
    motions,
    moved_by_volume,
    pump_stall,
)
from swimbladder.design.linear.routh import RouthTable, routh_table
from swimbladder.design.linear.sampled import ClosedLoop, LinearLaw, close
from swimbladder.design.linear.transfer import TransferFunction, transfer_functions
from swimbladder.errors import InputError
from swimbladder.io.answers import as_json, plain
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import PumpAndValve, Vehicle

_MARGINS = (
    "gain_up gain_up_frequency_rad_s gain_down gain_down_frequency_rad_s phase_rad "
    "phase_frequency_rad_s delay_s delay_frequency_rad_s peak_sensitivity peak_frequency_rad_s "
    "disk disk_gain disk_phase_rad disk_frequency_rad_s"
)


def _margins(found: Margins | None) -> dict[str, Any] | None:
    return found and as_json(found, _MARGINS) | {"phase_deg": math.degrees(found.phase)}


def closed_loop_json(c: ClosedLoop) -> dict[str, Any]:
    """Return a sampled loop for JSON, in SI units."""
    return {
        **as_json(
            c,
            "law sample_time_s stable spectral_radius spectral_radius_back_driven "
            "computation_delay_limit_s=computation_delay depth_delay_limit_s=depth_delay "
            "spectral_radius_with_one_sample_of_computation=radius_at_whole_sample "
            "inner_gain_per_sample volume_per_sample_m3 error_at_rate_limit_m",
        ),
        "poles_z": [mode.z for mode in c.modes],
        "poles_s": [mode.s if math.isfinite(mode.s.real) else None for mode in c.modes],
        "damping": [mode.damping for mode in c.modes],
        "time_constant_s": [mode.time_constant for mode in c.modes],
        "margins": {"command": _margins(c.at_command), "depth": _margins(c.at_depth)},
        "stable_with_one_sample_of_computation": c.radius_at_whole_sample < 1.0,
        "depth_load": c.depth_load
        and as_json(
            c.depth_load,
            "k_pV_V_m3 extra_psi_m3_m share_of_psi doubling_time_s doubling_time_rejected_s",
        ),
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
class Analysis:
    """Everything that the linear models say of a vehicle at a depth."""

    vehicle: Vehicle
    depth: float  # m
    operating_point: OperatingPoint
    model: StateSpace
    transfer_functions: tuple[TransferFunction, ...]
    open_loop: OpenLoop
    stiff_hull: StiffHull | None  # voltage-driven, psi not 0
    double_integrator_phase_margin: float | None  # rad, eq. (35) under a gain of 1 V/m
    stall: Stall | None  # voltage-driven, pump and valve
    neutral: NeutralVolume
    closed_loop: ClosedLoop | None  # vehicles with a controller
    notes: tuple[str, ...] = ()  # what was left out, and why
    drive: DriveRates | None = None  # pump and valve
    motions: tuple[Motion, ...] = ()  # pump and valve: the body at rest and on its way

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

    @property
    def findings(self) -> dict[str, tuple[str, ...]]:
        """What the numbers mean, in sentences by subject."""
        return findings(self)

    def text(self) -> str:
        """Return the findings as plain text, a paragraph each."""
        title = f"Linear analysis of {self.vehicle.name} at {self.depth:g} m"
        sentences = [s for subject in self.findings.values() for s in subject]
        return "\n\n".join([title, *sentences]) + "\n"

    def to_json(self) -> dict[str, Any]:
        """Return everything in JSON's own types, SI numbers; None for what is infinite."""
        o, stall, rest = self.open_loop, self.stall, "depth_m volume_m3 motor_rate_m3_s"
        if self.vehicle.voltage_driven:
            rest += " voltage_V voltage_back_V"
        volts = dict.fromkeys(("voltage_V", "voltage_back_V"))
        answer = {
            "vehicle": self.vehicle.name,
            **as_json(self, "depth_m rests stable findings notes"),
            "command": self.vehicle.command,
            "operating_point": volts | as_json(self.operating_point, rest),
            "open_loop": {
                **as_json(o, "input numerator denominator poles doubling_time_s"),
                "output": "Z",
                "stable": o.routh.stable,
            },
            "routh": as_json(
                o.routh,
                "powers rows first_column_signs=first_column notes right_half_plane=right "
                "imaginary_axis=axis sentence",
            ),
            "transfer_functions": [
                as_json(t, "equations input output symbols numerator denominator poles")
                for t in self.transfer_functions
            ],
            "state_space": as_json(self.model, "states inputs outputs A B C D"),
            "stiff_hull": self.stiff_hull
            and as_json(
                self.stiff_hull, "psi_m3_m poles doubling_time_s poles_without_loads unstable"
            ),
            "double_integrator_phase_margin_rad": self.double_integrator_phase_margin,
            "stall": stall
            and as_json(
                stall,
                "depth_m depth_without_sag_m holding_depth_m back_drive_depth_m voltage_V "
                "extending_rate_m3_s within_limit",
            )
            | {"depth_limit_m": self.vehicle.hull.depth_limit},
            "neutral_volume": as_json(
                self.neutral, "depth_m=depths volume_m3=volumes leaves_stroke_at_m=leaves_stroke"
            ),
            "closed_loop": self.closed_loop and closed_loop_json(self.closed_loop),
        }
        if self.drive is not None:
            answer |= {
                "drive": as_json(
                    self.drive,
                    "depth_m=depths pump_rate_m3_s=pump pump_power_W valve_rate_m3_s=valve "
                    "bypass_rate_m3_s=bypass leakage_m3_s start_volume_m3",
                ),
                "motions": [
                    as_json(one, "speed_m_s time_constant_s poles growth_time_s period_s")
                    for one in self.motions
                ],
            }
        return {key: plain(value) for key, value in answer.items()}


def analyse_linear(
    vehicle: Vehicle, *, depth: float = 0.0, law: LinearLaw | None = None, law_name: str = "",
    notes: tuple[str, ...] = (),
) -> Analysis:  # fmt: skip
    """Return the linear analysis of a vehicle at rest at `depth` [m], with its law already linear.

    Raises InputError where the depth is negative or not finite.
    """
    check_depth(depth)
    pumped = isinstance(vehicle.actuator, PumpAndValve)
    p = plant(moved_by_volume(vehicle))
    m, k_b = vehicle.mass, vehicle.water.specific_weight
    model = linearise(p, depth=depth)
    limit = vehicle.hull.depth_limit
    phase = None
    if not p.positioner and p.d_l > 0.0:
        phase = double_integrator_phase_margin(
            K1=p.gain, K2=p.a_b / p.d_l, A=1.0, T1=p.T1, T2=1.0 / p.d_l
        )
    rest, load, drive = operating_point(p, depth=depth), None, None
    neutral = neutral_volume(p, down_to=max(limit or 100.0, depth))
    if pumped:
        load = pump_stall(vehicle, depth=depth)
        drive = drive_rates(vehicle, neutral.depths)
        rest = rest._replace(motor_rate=drive_rates(vehicle, (depth,)).leakage[0])
    elif not p.positioner:
        load = stall(p, depth=depth, depth_limit=limit)
    return Analysis(
        vehicle=vehicle,
        depth=depth,
        operating_point=rest,
        model=model,
        transfer_functions=transfer_functions(p, m=m, k_b=k_b),
        open_loop=_open_loop(model, p.T1, p.d_l),
        stiff_hull=stiff_hull(p),
        double_integrator_phase_margin=phase,
        stall=load,
        neutral=neutral,
        closed_loop=None if law is None else close(p, law, name=law_name, depth=depth),
        notes=notes,
        drive=drive,
        motions=motions(vehicle, p) if pumped else (),
    )


def check_depth(depth: float, *, field: str = "depth") -> None:
    """Raise InputError, about `field`, where a depth [m] is negative or not finite."""
    if not (math.isfinite(depth) and depth >= 0.0):
        raise InputError(
            "the depth must be finite and not negative", field=field, value=depth, unit="m",
            remedy="Give a depth below the surface, positive down",
        )  # fmt: skip


def _open_loop(model: StateSpace, T1: float, d_l: float) -> OpenLoop:
    """The numerical model's Z over its command, times T1 T2 as far as they exist."""
    positioner = model.inputs == ("V",)
    factor = (1.0 if positioner else T1) * (1.0 / d_l if d_l > 0.0 else 1.0)
    numerator, denominator = polynomials(model.part(output="z", input=model.inputs[0]))
    scaled = tuple(factor * c for c in denominator)
    return OpenLoop(
        input="V" if positioner else "U",
        numerator=tuple(factor * c for c in numerator),
        denominator=scaled,
        poles=tuple(complex(x) for x in model.poles),
        doubling_time=doubling_time(model),
        routh=routh_table(scaled),
    )
