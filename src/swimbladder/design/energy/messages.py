"""The answers of `energy` in words."""

import math

import numpy as np

from swimbladder.design.energy.energy_per_volume import DriveEnergy
from swimbladder.design.energy.fit import PumpFit, voltage_factor
from swimbladder.design.energy.thruster_comparison import Hovering, Profiling, Thruster
from swimbladder.physics.buoyancy_engine import oil_note
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

_LEAST, _MOST = 0.1, 1.1  # efficiencies that no pump has are beyond
_DAY, _HOUR, _MINUTE = 86400.0, 3600.0, 60.0


def drive_sentences(found: DriveEnergy) -> tuple[str, ...]:
    """Return what pressing out costs at the deepest depth, and where the drive stalls."""
    z, m, rating = found.column.deepest, found.map, found.vehicle.hull.depth_limit
    said = []
    if rating is not None and z > rating * (1.0 + 1e-9):
        said.append(f"{z:g} m is deeper than the vehicle is rated for, {rating:g} m.")
    if m.rate_out[-1] > 0.0:
        said.append(
            f"Pressing out at {z:g} m takes {found.per_volume[-1] * 1e-6:.3g} J/mL: "
            f"{m.rate_out[-1] * 1e6:.3g} mL/s with {m.power_out[-1]:.3g} W, "
            f"{100.0 * found.efficiency[-1]:.0f} % of which reach the water."
        )
    else:
        said.append(f"Nothing is pressed out at {z:g} m: the drive has stalled.")
    if math.isinf(found.stall):
        said.append("It presses against the pressure of any sea.")
    else:
        said.append(
            f"It stalls at {rounded(found.stall_depth)} m ({rounded(found.stall / 1e5)} bar)."
        )
    if m.holding_power[-1] > 0.0:
        said.append(f"Holding the volume there takes {m.holding_power[-1]:.3g} W all the time.")
    if m.start_volume[-1] > 0.0:
        said.append(
            f"Each start of the pump there falls short by {m.start_volume[-1] * 1e6:.3g} mL."
        )
    return tuple(said)


def versus_sentences(hover: Hovering, dive: Profiling, found: DriveEnergy) -> tuple[str, ...]:
    """Return who takes less, and from where on."""
    z = found.column.deepest
    said = []
    once, power = hover.engine_energy[-1], hover.thruster_power[-1]
    what = f"Hovering at {z:g} m with {hover.weight_error * 1e6:.3g} mL too heavy"
    if math.isnan(once):
        said.append(f"{what}: not by this engine, it has stalled; a thruster takes {power:.3g} W.")
    elif math.isinf(hover.break_even[-1]):
        said.append(f"{what}: the thruster takes less, {power:.3g} W, however long it lasts.")
    else:
        said.append(
            f"{what}: the engine takes {rounded(once, 3)} J once"
            + (f" and {hover.engine_power[-1]:.2g} W" if hover.engine_power[-1] > 0.0 else "")
            + f", a thruster {power:.3g} W; after {_time(hover.break_even[-1])} the engine "
            "has taken less."
        )
    what = f"Down to {z:g} m and back at {dive.speed:g} m/s"
    if math.isnan(dive.engine[-1]):
        why = (
            f"the stroke suffices to {rounded(max(dive.stroke_depth, 0.0))} m only"
            if dive.stroke_depth < z
            else "the drive stalls on the way"
        )
        said.append(
            f"{what}: not by this engine, {why}; a thruster takes {rounded(dive.thruster[-1])} J."
        )
        return tuple(said)
    said.append(
        f"{what}: the engine takes {rounded(dive.engine[-1])} J, a thruster "
        f"{rounded(dive.thruster[-1])} J; the drag alone is {rounded(dive.drag[-1])} J."
    )
    if dive.break_even == 0.0:
        said.append("The engine takes less on dives to any depth.")
    elif math.isinf(dive.break_even):
        said.append("The thruster takes less on dives to any depth down to there.")
    else:
        said.append(f"The engine takes less on dives to {rounded(dive.break_even, 3)} m or deeper.")
    return tuple(said)


def assumptions(found: DriveEnergy, thruster: Thruster) -> tuple[str, ...]:
    """Return what the answers rest on."""
    said = [
        f"the water: {found.column.source}, {found.column.deepest:g} m deep",
        f"{thruster.number} thruster{'s' if thruster.number > 1 else ''} of "
        f"{thruster.diameter * 1e3:.3g} mm with {100.0 * thruster.efficiency:.0f} % of an ideal "
        f"disc's efficiency and {thruster.idle_power:g} W of idle power each (--thruster-diameter, "
        "--thruster-efficiency, --thruster-number, --thruster-idle"
        + (
            "; if not said, 76 mm, 35 % and no idle power, after the maker's curves of a T200"
            if _assumed(thruster)
            else ""
        )
        + ")",
        "steady speeds at full voltage; processor, sensors and driver's standby not counted",
    ]
    oil = oil_note(found.vehicle)
    return (*said, *(() if oil is None else (oil,)), *found.column.report)


def _assumed(thruster: Thruster) -> bool:
    """Return whether any number of the thruster is that which nobody stated."""
    usual = Thruster()
    return any(
        getattr(thruster, name) == getattr(usual, name)
        for name in ("diameter", "efficiency", "idle_power")
    )


def fit_sentences(fit: PumpFit, vehicle: Vehicle | None = None) -> tuple[str, ...]:
    """Return the result of a fit, how well dives are predicted, and what a vehicle got."""
    said = [
        f"{int(fit.kept.sum())} runs"
        + (f" of {fit.clusters} dives" if fit.dives else "")
        + f": power within {fit.power_rms:.2g} W rms"
        + ("" if math.isnan(fit.volume_rms) else f", volumes within {fit.volume_rms * 1e6:.2g} mL")
        + "."
    ]
    if fit.dives:
        error = np.array([d.predicted / d.energy - 1.0 for d in fit.dives if d.energy > 0.0])
        said.append(
            "Each dive's energy predicted from the others: within "
            f"{_percent(np.median(np.abs(error)))} "
            f"(median), {_percent(np.max(np.abs(error)))} at worst."
        )
        volume = np.array(
            [d.predicted_volume / d.volume - 1.0 for d in fit.dives if d.volume > 0.0]
        )
        if volume.size:
            said.append(
                f"Each dive's volume: within {_percent(np.median(np.abs(volume)))} (median), "
                f"{_percent(np.max(np.abs(volume)))} at worst."
            )
    reaches = _reaches(fit)
    if reaches is not None and not _LEAST < reaches < _MOST:
        said.append(
            "Check the units of pressure and volume: of what more pressure takes, "
            f"{_percent(reaches)} would reach the water; pumps have 30 to 90 %."
        )
    said += _voltage(fit, vehicle)
    left = int((~fit.kept).sum())
    if left:
        said.append(f"{left} runs were left out: too short, or without pressure or power.")
    if "delivery" not in fit.parameters:
        said.append("No volumes were measured: the delivery is not identifiable.")
    return tuple(said)


def _reaches(fit: PumpFit) -> float | None:
    """Return the delivery over the power per pressure [-]; None where it is not identifiable.

    That is the efficiency of the part of the power that grows with the pressure.
    """
    slope = fit.value("power_per_pressure")
    return fit.value("delivery") / slope if "delivery" in fit.parameters and slope > 0.0 else None


def _voltage(fit: PumpFit, vehicle: Vehicle | None) -> list[str]:
    """Return what the battery's voltage has to do with the powers."""
    volts = np.array([]) if fit.runs.voltage is None else fit.runs.voltage[fit.kept]
    volts = volts[volts > 0.0]
    if fit.reference_voltage is None:
        return [] if not volts.size else [
            f"The voltage, {volts.min():.4g} to {volts.max():.4g} V, is not counted: dives are "
            "predicted no better with it, or it hardly varies, or too few runs have one."
        ]  # fmt: skip
    said = [
        f"Power goes with the battery's voltage under load, {volts.min():.4g} to "
        f"{volts.max():.4g} V; the numbers are those at {fit.reference_voltage:.4g} V, the median."
    ]
    if vehicle is not None and vehicle.supply is not None:
        factor = voltage_factor(vehicle.supply, fit)
        what = "power and delivery" if "delivery" in fit.parameters else "power"
        said.append(
            f"The vehicle's supply gives {factor * fit.reference_voltage:.4g} V under that load: "
            f"its {what} {'are' if 'and' in what else 'is'} {factor:.3g} times that."
        )
    return said


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _time(seconds: float) -> str:
    for size, name in ((_DAY, "d"), (_HOUR, "h"), (_MINUTE, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {name}"
    return f"{seconds:.3g} s"
