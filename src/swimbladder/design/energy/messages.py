"""The answers of `energy` in words."""

import math
from collections.abc import Iterator

import numpy as np

from swimbladder.design.energy.energy_per_volume import DriveEnergy
from swimbladder.design.energy.fit import PumpFit, voltage_factor
from swimbladder.design.energy.thruster_comparison import Hovering, Profiling, Thruster
from swimbladder.physics.buoyancy_engine import oil_note
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

_LEAST, _MOST = 0.1, 1.1  # efficiencies that no pump has are beyond
_DAY, _HOUR, _MINUTE = 86400.0, 3600.0, 60.0


def drive_sentences(found: DriveEnergy) -> Iterator[str]:
    """Yield what pressing out costs at the deepest depth, and where the drive stalls."""
    z, m, rating = found.column.deepest, found.map, found.vehicle.hull.depth_limit
    if rating is not None and z > rating * (1.0 + 1e-9):
        yield f"{z:g} m is deeper than the vehicle is rated for, {rating:g} m."
    if m.rate_out[-1] > 0.0:
        rate = f"{m.rate_out[-1] * 1e6:.3g} mL/s with {m.power_out[-1]:.3g} W"
        takes = f"Pressing out at {z:g} m takes {found.per_volume[-1] * 1e-6:.3g} J/mL"
        yield f"{takes}: {rate}, {100.0 * found.efficiency[-1]:.0f} % of which reach the water."
    else:
        yield f"Nothing is pressed out at {z:g} m: the drive has stalled."
    if math.isinf(found.stall):
        yield "It presses against the pressure of any sea."
    else:
        yield f"It stalls at {rounded(found.stall_depth)} m ({rounded(found.stall / 1e5)} bar)."
    if m.holding_power[-1] > 0.0:
        yield f"Holding the volume there takes {m.holding_power[-1]:.3g} W all the time."
    if m.start_volume[-1] > 0.0:
        yield f"Each start of the pump there falls short by {m.start_volume[-1] * 1e6:.3g} mL."


def versus_sentences(hover: Hovering, dive: Profiling, found: DriveEnergy) -> Iterator[str]:
    """Yield who takes less, and from where on."""
    z = found.column.deepest
    once, power, later = hover.engine_energy[-1], hover.thruster_power[-1], hover.break_even[-1]
    what = f"Hovering at {z:g} m with {hover.weight_error * 1e6:.3g} mL too heavy"
    if math.isnan(once):
        yield f"{what}: not by this engine, it has stalled; a thruster takes {power:.3g} W."
    elif math.isinf(later):
        yield f"{what}: the thruster takes less, {power:.3g} W, however long it lasts."
    else:
        held = f" and {hover.engine_power[-1]:.2g} W" if hover.engine_power[-1] > 0.0 else ""
        takes = f"the engine takes {rounded(once, 3)} J once{held}, a thruster {power:.3g} W"
        yield f"{what}: {takes}; after {_time(later)} the engine has taken less."
    what = f"Down to {z:g} m and back at {dive.speed:g} m/s"
    engine, thruster, drag = (rounded(x[-1]) for x in (dive.engine, dive.thruster, dive.drag))
    if math.isnan(dive.engine[-1]):
        why = "the drive stalls on the way"
        if dive.stroke_depth < z:
            why = f"the stroke suffices to {rounded(max(dive.stroke_depth, 0.0))} m only"
        yield f"{what}: not by this engine, {why}; a thruster takes {thruster} J."
        return
    takes = f"the engine takes {engine} J, a thruster {thruster} J"
    yield f"{what}: {takes}; the drag alone is {drag} J."
    if dive.break_even == 0.0:
        yield "The engine takes less on dives to any depth."
    elif math.isinf(dive.break_even):
        yield "The thruster takes less on dives to any depth down to there."
    else:
        yield f"The engine takes less on dives to {rounded(dive.break_even, 3)} m or deeper."


def assumptions(found: DriveEnergy, thruster: Thruster) -> tuple[str, ...]:
    """Return what the answers rest on."""
    usual, assumed = Thruster(), ""  # of a thruster with any number that nobody stated
    stated = ("diameter", "efficiency", "idle_power")
    if any(getattr(thruster, name) == getattr(usual, name) for name in stated):
        assumed = "; if not said, 76 mm, 35 % and no idle power, after the maker's curves of a T200"
    said = [
        f"the water: {found.column.source}, {found.column.deepest:g} m deep",
        f"{thruster.number} thruster{'s' if thruster.number > 1 else ''} of "
        f"{thruster.diameter * 1e3:.3g} mm with {100.0 * thruster.efficiency:.0f} % of an ideal "
        f"disc's efficiency and {thruster.idle_power:g} W of idle power each (`diameter=`, "
        f"`efficiency=`, `number=`, `idle_power=`{assumed})",
        "steady speeds at full voltage; processor, sensors and driver's standby not counted",
        oil_note(found.vehicle),
        *found.column.report,
    ]
    return tuple(line for line in said if line is not None)


def fit_sentences(fit: PumpFit, vehicle: Vehicle | None = None) -> Iterator[str]:
    """Yield the result of a fit, how well dives are predicted, and what a vehicle got."""
    runs = f"{int(fit.kept.sum())} runs" + (f" of {fit.clusters} dives" if fit.dives else "")
    if fit.refusal:
        yield f"Not identified: {fit.refusal}."
    volumes = f", volumes within {fit.volume_rms * 1e6:.2g} mL"
    volumes = "" if math.isnan(fit.volume_rms) else volumes
    yield f"{runs}: power within {fit.power_rms:.2g} W rms{volumes}."
    energies = [d.predicted / d.energy - 1.0 for d in fit.dives if d.energy > 0.0]
    pressed = [d.predicted_volume / d.volume - 1.0 for d in fit.dives if d.volume > 0.0]
    for what, errors in (("energy predicted from the others", energies), ("volume", pressed)):
        if errors:
            middle, worst = (_percent(f(np.abs(errors))) for f in (np.median, np.max))
            yield f"Each dive's {what}: within {middle} (median), {worst} at worst."
    if fit.by_volume:
        yield "The runs were commanded by volume, which hardly differs: it is their times that err."
    if "delivery" in fit.parameters and "slip" not in fit.parameters:
        yield "The runs deliver no less under pressure: there is no slip that they show."
    slope = fit.value("power_per_pressure")
    if "delivery" in fit.parameters and slope > 0.0:
        reaches = fit.value("delivery") / slope  # of the power that grows with the pressure
        if not _LEAST < reaches < _MOST:
            check = "Check the units of pressure and volume: of what more pressure takes"
            yield f"{check}, {_percent(reaches)} would reach the water; pumps have 30 to 90 %."
    yield from _voltage(fit, vehicle)
    left = int((~fit.kept).sum())
    if left:
        yield f"{left} runs were left out: too short, or without pressure or power."
    if "delivery" not in fit.parameters:
        yield "No volumes were measured: the delivery is not identifiable."


def _voltage(fit: PumpFit, vehicle: Vehicle | None) -> Iterator[str]:
    """Yield what the battery's voltage has to do with the powers."""
    volts = np.array([]) if fit.runs.voltage is None else fit.runs.voltage[fit.kept]
    volts = volts[volts > 0.0]
    span = f"{volts.min():.4g} to {volts.max():.4g} V" if volts.size else ""
    if fit.reference_voltage is not None:
        at = f"the numbers are those at {fit.reference_voltage:.4g} V, the median"
        yield f"Power goes with the battery's voltage under load, {span}; {at}."
        if vehicle is not None and vehicle.supply is not None:
            factor = voltage_factor(vehicle.supply, fit)
            what = "power and delivery are" if "delivery" in fit.parameters else "power is"
            given = f"{factor * fit.reference_voltage:.4g} V under that load"
            yield f"The vehicle's supply gives {given}: its {what} {factor:.3g} times that."
    elif span:
        why = "dives are predicted no better with it, or it hardly varies, or too few runs have one"
        yield f"The voltage, {span}, is not counted: {why}."


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _time(seconds: float) -> str:
    for size, name in ((_DAY, "d"), (_HOUR, "h"), (_MINUTE, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {name}"
    return f"{seconds:.3g} s"
