"""What the linear analysis found in the types of JSON."""

from __future__ import annotations

import math
from typing import Any

from swimbladder.design.linear.closed import ClosedLoop
from swimbladder.design.linear.margins import Margins
from swimbladder.design.linear.pump_valve import DriveRates, Motion
from swimbladder.design.linear.routh import RouthTable


def routh_json(table: RouthTable) -> dict[str, Any]:
    """Return a Routh table for JSON."""
    return {
        "powers": table.powers,
        "rows": table.rows,
        "first_column_signs": table.first_column,
        "notes": table.notes,
        "right_half_plane": table.right,
        "imaginary_axis": table.axis,
        "sentence": table.sentence,
    }


def closed_loop_json(c: ClosedLoop) -> dict[str, Any]:
    """Return a sampled loop for JSON, in SI units."""
    load = c.depth_load
    return {
        "law": c.law,
        "sample_time_s": c.sample_time,
        "stable": c.stable,
        "spectral_radius": c.spectral_radius,
        "spectral_radius_back_driven": c.spectral_radius_back_driven,
        "poles_z": [mode.z for mode in c.modes],
        "poles_s": [mode.s if math.isfinite(mode.s.real) else None for mode in c.modes],
        "damping": [mode.damping for mode in c.modes],
        "time_constant_s": [mode.time_constant for mode in c.modes],
        "margins": {"command": _margins(c.at_command), "depth": _margins(c.at_depth)},
        "computation_delay_limit_s": c.computation_delay,
        "stable_with_one_sample_of_computation": c.radius_at_whole_sample < 1.0,
        "spectral_radius_with_one_sample_of_computation": c.radius_at_whole_sample,
        "depth_delay_limit_s": c.depth_delay,
        "inner_gain_per_sample": c.inner_gain_per_sample,
        "volume_per_sample_m3": c.volume_per_sample,
        "error_at_rate_limit_m": c.error_at_rate_limit,
        "depth_load": load
        and {
            "k_pV_V_m3": load.k_pV,
            "extra_psi_m3_m": load.extra_psi,
            "share_of_psi": load.share_of_psi,
            "doubling_time_s": load.doubling_time,
            "doubling_time_rejected_s": load.doubling_time_rejected,
        },
    }


def drive_json(d: DriveRates) -> dict[str, Any]:
    """Return what pump and valves do over depth for JSON, in SI units."""
    return {
        "depth_m": d.depths,
        "pump_rate_m3_s": d.pump,
        "pump_power_W": d.pump_power,
        "valve_rate_m3_s": d.valve,
        "bypass_rate_m3_s": d.bypass,
        "leakage_m3_s": d.leakage,
        "start_volume_m3": d.start_volume,
    }


def motion_json(m: Motion) -> dict[str, Any]:
    """Return how a body goes on about a speed for JSON, in SI units."""
    return {
        "speed_m_s": m.speed,
        "time_constant_s": m.time_constant,
        "poles": m.poles,
        "growth_time_s": m.growth_time,
        "period_s": m.period,
    }


def _margins(found: Margins | None) -> dict[str, Any] | None:
    return found and {
        "gain_up": found.gain_up,
        "gain_up_frequency_rad_s": found.gain_up_frequency,
        "gain_down": found.gain_down,
        "gain_down_frequency_rad_s": found.gain_down_frequency,
        "phase_rad": found.phase,
        "phase_deg": math.degrees(found.phase),
        "phase_frequency_rad_s": found.phase_frequency,
        "delay_s": found.delay,
        "delay_frequency_rad_s": found.delay_frequency,
        "peak_sensitivity": found.peak_sensitivity,
        "peak_frequency_rad_s": found.peak_frequency,
        "disk": found.disk,
        "disk_gain": found.disk_gain,
        "disk_phase_rad": found.disk_phase,
        "disk_frequency_rad_s": found.disk_frequency,
    }


def plain(value: Any) -> Any:
    """Return lists for tuples, [re, im] for complex numbers, None for what is not finite."""
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value]
