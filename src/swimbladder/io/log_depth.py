"""Depth from pressure, and depth that a logger made with another water, another zero or sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.log_text import LogFile
from swimbladder.units import parse_quantity

Array = NDArray[np.float64]

_ABOVE = 0.5  # m above the surface, that a sensor may be off


def depth_source(names: set[str], mapped: set[str], file: LogFile) -> str | None:
    """Return which of the columns at hand is to become the depth, None where there is none.

    depth_m, unless pressure_Pa is mapped and depth_m only happens to be there. Raises LogError
    where both are mapped.
    """
    both = {"depth_m", "pressure_Pa"}
    if both <= mapped:
        raise file.refused(
            "depth cannot come both from depth_m and from pressure_Pa",
            field="pressure_Pa",
            remedy="Map one of the two",
        )
    if both <= names:
        return "pressure_Pa" if "pressure_Pa" in mapped else "depth_m"
    return next(iter(both & names), None)


def to_depth(data: dict[str, Array], source: str, file: LogFile) -> Array:
    """Return the depth [m] from depth_m [m] or pressure_Pa [Pa], whose rows are in order of time.

    z = (p - p_0)/(rho g), with one density all the way down. Raises LogError where it needs what
    the format does not say, or that says what has no use.
    """
    form, report = file.form, file.report
    if source == "pressure_Pa":
        depth = _from_pressure(data, file)
    else:
        depth = data["depth_m"]
        _refuse_unused(file)
        if form.logger_density is not None and form.water_density is not None:
            depth = depth * (form.logger_density / form.water_density)
            report.append(
                f"depth_m times {form.logger_density / form.water_density:.6g}: the logger took "
                f"the water for one of {form.logger_density:g} kg/m3, it is one of "
                f"{form.water_density:g} kg/m3"
            )
        if form.depth_positive == "up":
            depth = -depth
            report.append("depth_m counts upward in the file; turned to count downward")
    if form.depth_offset:
        depth = depth + form.depth_offset
        report.append(f"{form.depth_offset:g} m added to depth_m")
    known = depth[np.isfinite(depth)]
    if len(known) and np.median(known) < -_ABOVE:
        report.append(
            f"most of the log is above the surface, half of it above {np.median(known):.3g} m: "
            'check depth_positive = "up", atmospheric_pressure and depth_offset'
        )
    return depth


def _from_pressure(data: dict[str, Array], file: LogFile) -> Array:
    form, pressure = file.form, data["pressure_Pa"]
    known = pressure[np.isfinite(pressure)]
    first = float(known[0]) if len(known) else 0.0
    if form.water_density is None:
        raise file.refused(
            "the density that turns pressure_Pa into depth is missing",
            field="water_density",
            remedy='Add a line water_density = "998 kg/m3" (or sea water, "1025 kg/m3") to the '
            "[log] table",
        )
    if form.atmospheric_pressure is None:
        looks = "absolute" if first > 7e4 else "gauge"
        raise file.refused(
            f"what pressure_Pa reads at the surface is not said; its first reading, {first:.6g} "
            f"Pa, looks {looks}",
            field="atmospheric_pressure",
            remedy='Add atmospheric_pressure = "gauge", "1013 mbar" (what the sensor reads there) '
            'or "first" (its first reading is at the surface) to the [log] table',
        )
    for name in ("logger_density", "depth_positive"):
        if name in form.model_fields_set and getattr(form, name) not in (None, "down"):
            raise file.refused(
                f"{name} has no use: the depth comes from pressure_Pa",
                field=name,
                value=getattr(form, name),
                remedy=f"Leave {name} out",
            )
    surface, how = _surface_pressure(form.atmospheric_pressure, pressure, data["time_s"])
    file.report.append(
        f"depth_m from pressure_Pa, less {surface:.6g} Pa at the surface ({how}), over "
        f"{form.water_density:g} kg/m3 times {form.gravity:g} m/s2"
    )
    return (pressure - surface) / (form.water_density * form.gravity)


def _surface_pressure(said: float | str, pressure: Array, time: Array) -> tuple[float, str]:
    """Return what the sensor reads at the surface [Pa], and where that is from."""
    if said == "gauge":
        return 0.0, "gauge"
    if not isinstance(said, str):
        return said, "given"
    seconds = parse_quantity(said.removeprefix("first "), "s") if said != "first" else 0.0
    at = np.flatnonzero(np.isfinite(pressure))
    if not len(at):
        return np.nan, "there is no reading"
    at = at[time[at] <= time[at[0]] + seconds]
    how = "the first reading" if seconds == 0.0 else f"median of the first {seconds:g} s"
    return float(np.median(pressure[at])), how


def _refuse_unused(file: LogFile) -> None:
    """Raise LogError where the format has what only pressure needs."""
    form = file.form
    names = ["atmospheric_pressure", "gravity"]
    if form.logger_density is None:
        names.append("water_density")
    unused = [n for n in names if n in form.model_fields_set and getattr(form, n) is not None]
    if unused:
        raise file.refused(
            f"{unused[0]} has no use: depth_m is read as a depth",
            field=unused[0],
            value=getattr(form, unused[0]),
            remedy=f"Map pressure_Pa, or leave {unused[0]} out",
        )
