"""An Argo float's configuration as a mission: names like ``CONFIG_PT24_PressureCheckPeriod...``.

The file is JSON, as a data centre is given it: an object of names and values, or one whose
``missions`` are such objects, of which the first counts. Numbers of the names differ between types
of float (PM08, MC011), their words hardly. Or it is netCDF, the float's `WMO_meta.nc`, with Argo's
standard names, which end in their unit (reference table 18): the values at launch, and over them
those of the first mission. Pressures [dbar] become depths, by the standard ocean at 45 degrees.

A cycle takes its period. The float leaves its park depth so long before the end as both ways take
at the mean speeds of the configuration; it arrives sooner or later, and waits.
"""

import difflib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gsw
import numpy as np

from swimbladder.errors import InputError, UnitError
from swimbladder.io.columns import plain_unit
from swimbladder.io.log_text import LogFile, is_netcdf
from swimbladder.io.mission import Mission
from swimbladder.io.netcdf import NetCDF
from swimbladder.units import unit_factor

PLACE = 45.0  # degrees of latitude
AT_SURFACE = 1800.0  # s, to position itself and to send
_HOUR, _DAY = 3600.0, 86400.0
_PERIODS = {"PM": _DAY, "MC": _HOUR}  # what a cycle's period counts in

# Parameters of the law `argo`: their names, as a 4000 m float has them, and what the numbers count
# in; None: dbar, which become m.
LAW: dict[str, tuple[str, float | None]] = {
    "ascent_interval": ("PT24_PressureCheckPeriodDuringAscent", 60.0),
    "ascent_progress": ("PT25_MinPressureDiffForPumpAction", None),
    "descent_interval": ("PT26_PressureCheckPeriodDuringDescent", 60.0),
    "descent_progress": ("PT27_MinPressureDiffForEVAction", None),
    "tolerance": ("PT05_PressureTargetToleranceForStabilization", None),
    "slow_depth": ("PG06_SlowDownPressure", None),
    "slow_progress": ("PG08_MinPressureDiffForPumpAction", None),
}
GROUNDING: dict[str, tuple[str, float | None]] = {
    "volume": ("PT11_MinOilVolumeForGroundingDetection", 1e-6),
    "least_depth": ("PT12_MinPressureThresholdToSwitchPressureWhenGrounding", None),
    "shift": ("PT13_GroundingSwitchPressureAdjustment", None),
}
ICE: dict[str, tuple[str, float | None]] = {
    "wait": ("PG00_NbDaysWithoutSurfacingAfterIceDetection", 86400.0),
    "longest": ("PG01_NbDaysWithoutSurfacingBeforeDisablingIceDetection", 86400.0),
    "start_depth": ("PG03_IceDetectionStartPressure", None),
    "stop_depth": ("PG04_IceDetectionStopPressure", None),
    "temperature": ("PG05_TemperatureThreshold", 1e-3),
}
GROUNDING_MODE = "PT10_GroundingMode"  # 0: the drift depth is shifted, 1: it stays
# Argo's standard name of each, with the unit in which the number is without it; as in the data
# processing chain of Coriolis, files _config_param_name_221.json (4000 m) and _222.json (2000 m).
_STANDARD = {
    "PM01_CyclePeriod": "CycleTime_s",
    "PM08_DriftDepth": "ParkPressure_dbar",
    "PM09_ProfileDepth": "ProfilePressure_dbar",
    "PT03_PumpMaxDurationDuringAscent": "PumpActionMaxTimeAscent_cs",
    "PT05_PressureTargetToleranceForStabilization": "PressureTargetToleranceForStabilisation_dbar",
    "PT06_MaxPressureBeforeEmergencyAscent": "PressureMaxBeforeEmergencyAscent_dbar",
    "PT18_AverageDescentSpeed": "DescentSpeed_mm/s",
    "PT23_AverageAscentSpeed": "AscentSpeed_mm/s",
    "PT24_PressureCheckPeriodDuringAscent": "PressureCheckTimeAscent_min",
    "PT25_MinPressureDiffForPumpAction": "AscentVerticalThresholdForBuoyancyAction_dbar",
    "PT26_PressureCheckPeriodDuringDescent": "PressureCheckTimeDescent_min",
    "PT27_MinPressureDiffForEVAction": "DescentVerticalThresholdForBuoyancyAction_dbar",
    "PG06_SlowDownPressure": "AscentSpeedStartPressureThresholdForSlowPhase_dbar",
    "PG08_MinPressureDiffForPumpAction": (
        "IceDetectionAscentVerticalThresholdForBuoyancyAction_dbar"
    ),
    "PG09_PumpActionDuration": "IceDetectionPumpActionMaxTimeAscent_cs",
    "PT10_GroundingMode": "GroundingMode_LOGICAL",
    "PT11_MinOilVolumeForGroundingDetection": "OilVolumeMinForGroundingDetection_cm3",
    "PT12_MinPressureThresholdToSwitchPressureWhenGrounding": "GroundingModeMinPresThreshold_dbar",
    "PT13_GroundingSwitchPressureAdjustment": "GroundingModePresAdjustment_dbar",
    "PG00_NbDaysWithoutSurfacingAfterIceDetection": (
        "IceDetectionSpringInhibitionDelaySinceLastIceEvasion_d"
    ),
    "PG01_NbDaysWithoutSurfacingBeforeDisablingIceDetection": (
        "IceDetectionMaxDaysNoTransmission_d"
    ),
    "PG03_IceDetectionStartPressure": "IceDetectionMixedLayerPMax_dbar",
    "PG04_IceDetectionStopPressure": "IceDetectionMixedLayerPMin_dbar",
    "PG05_TemperatureThreshold": "IceDetection_mdegC",
}
# Beside those of units: a NUMBER counts days.
_FACTORS = {("LOGICAL", "LOGICAL"): 1.0, ("degC", "mdegC"): 1e3, ("NUMBER", "d"): 1.0}
_ICE = "PG|IC"  # kinds of names that are about ice, which have words of others
_OTHERWISE = {  # words of other types of float
    "PressureTargetToleranceForStabilization": "PressureTargetToleranceForStabili[sz]ation",
    "PumpMaxDurationDuringAscent": "Pump(MaxDurationDuringAscent|ActionMaxTimeAscent)",
    "MinOilVolumeForGroundingDetection": "(MinOilVolume|OilVolumeMin)ForGroundingDetection",
    "MinPressureThresholdToSwitchPressureWhenGrounding": (
        "(MinPressureThresholdToSwitchPressureWhenGrounding|GroundingModeMinPresThreshold)"
    ),
    "MaxPressureBeforeEmergencyAscent": "(MaxPressure|PressureMax)BeforeEmergencyAscent",
}
_COLDEST = -3000.0  # mdegC, of a threshold
_NEAR = 0.93  # likeness of a misspelt name, of 1
_RESOLUTION = 0.1  # dbar, of the pressures by which a float decides: as its CTD has them


def argo_mission(data: bytes, path: str | Path) -> Mission:
    """Return one cycle as a mission, flown by the law `argo`; its volumes are the vehicle's.

    data: JSON or netCDF. Raises InputError with file, name, value and remedy.
    """
    names = _meta_names(data, path) if is_netcdf(data) else _names(data, path)

    def number(wanted: str, otherwise: float | None = None, least: float | None = None) -> float:
        """Return a parameter by its short name; `otherwise` where the file lacks it."""
        kind, words = wanted.split("_")
        about = "(?=" if kind.startswith("PG") else "(?!"
        pattern = rf"CONFIG_{about}{_ICE})[A-Z]+\d*_{_OTHERWISE.get(words, words)}"
        for name, given in names.items():
            if re.fullmatch(pattern, name):
                return _number(name, given, path, least)
        return _standard(names, wanted, path, otherwise, least)

    drift, deepest = number("PM08_DriftDepth"), number("PM09_ProfileDepth")
    park, bottom = _depth(drift), _depth(deepest)
    metres = bottom / deepest

    def numbers(
        table: Mapping[str, tuple[str, float | None]], least: float | None = None
    ) -> dict[str, float]:
        """Return the parameters that the file has, in the law's units; pressures as depths."""
        found = {one: number(name, math.nan, least) for one, (name, _) in table.items()}
        return {
            one: value * (table[one][1] or metres)
            for one, value in found.items()
            if math.isfinite(value)
        }

    law: dict[str, Any] = {"depth_step": _RESOLUTION * metres, **numbers(LAW)}
    slow, run = (
        number(name, -1.0)
        for name in ("PG09_PumpActionDuration", "PT03_PumpMaxDurationDuringAscent")
    )
    if min(slow, run) > 0.0:
        law["slow_share"] = slow / run
    down, up = (
        number(name) / 1e3 for name in ("PT18_AverageDescentSpeed", "PT23_AverageAscentSpeed")
    )
    on = max(bottom - park, 0.0) / down
    stays = _period(names, path) - on - bottom / up - AT_SURFACE
    if stays <= park / down:
        what = "the cycle's period is over before the float is at its park depth"
        remedy = "Check period, depths and mean speeds"
        raise InputError(what, file=path, field="CONFIG_..._CyclePeriod", remedy=remedy)
    tolerance = law.get("tolerance", 50.0 * metres)
    flown: dict[str, Any] = {"law": "argo", "parameters": law}
    staying: dict[str, Any] = {"kind": "park", "tolerance": tolerance, **flown}
    grounding, ice = numbers(GROUNDING, 0.0), numbers(ICE, _COLDEST)
    mode = number(GROUNDING_MODE, 1.0, 0.0)
    if mode not in (0.0, 1.0):
        what, remedy = (
            "it is no mode of grounding",
            "Give 0, to shift the drift depth, or 1, to stay",
        )
        raise InputError(
            what, file=path, field=f"CONFIG_{GROUNDING_MODE}", value=mode, remedy=remedy
        )
    drifts = {"grounding": "shift"} if grounding.get("volume") and mode == 0.0 else {}
    phases = [{**staying, "depth": park, "duration": stays, **drifts}]
    if on > 0.0:
        phases.append({**staying, "name": "to profile", "depth": bottom, "duration": on})
    phases.append({"kind": "surface", "duration": AT_SURFACE, **flown})
    limit = number("PT06_MaxPressureBeforeEmergencyAscent", deepest + 200.0)
    known: dict[str, Any] = {
        "name": Path(path).stem,
        "description": f"park {drift:g} dbar, profile {deepest:g} dbar, by its configuration",
        "phases": phases,
        "safety": {"deepest": _depth(limit)},
        "grounding": grounding if grounding.get("volume") else None,
        "ice": ice if "temperature" in ice and ice.get("wait") != 0.0 else None,
    }
    try:
        return Mission(**known)
    except InputError as error:
        raise error.but(file=path) from None


def _names(data: bytes, path: str | Path) -> Mapping[str, str]:
    try:
        found = json.loads(data)
    except ValueError as error:
        remedy = "Give the configuration as JSON"
        raise InputError(f"no JSON: {error}", file=path, field="file", remedy=remedy) from None
    found = found.get("missions", [found]) if isinstance(found, dict) else found
    if not (isinstance(found, list) and found and isinstance(found[0], dict) and found[0]):
        remedy = "Give an object of CONFIG_ names and their values, or of missions that are such"
        raise InputError("no names of a configuration", file=path, field="file", remedy=remedy)
    return {str(name): str(value) for name, value in found[0].items()}


def _meta_names(data: bytes, path: str | Path) -> Mapping[str, str]:
    """Return names and values of a meta-data file, those of its first mission over the others."""
    found = NetCDF(data, LogFile(path))
    found.refuse_unless("Argo meta-data", "Give the float's meta-data, WMO_meta.nc")
    held: dict[str, str] = {}
    for kind in ("LAUNCH_CONFIG_PARAMETER", "CONFIG_PARAMETER"):
        names, value = found.texts(f"{kind}_NAME"), f"{kind}_VALUE"
        held_there = found.numbers.get(value, found.words.get(value, np.zeros(0)))
        first = np.ravel(held_there)[: len(names)].tolist()
        if len(first) < len(names):
            remedy = "Fetch the file anew"
            raise found.file.refused("not a value for each name", remedy, value)
        pairs = zip(names, map(str, first), strict=True)
        held |= {name.strip("\0 "): value for name, value in pairs if value != "nan"}
    return held


def _standard(
    names: Mapping[str, str],
    wanted: str,
    path: str | Path,
    otherwise: float | None = None,
    least: float | None = None,
) -> float:
    """Return the number of a standard name, in the unit that it has where the name has none."""
    standard, _, unit = _STANDARD.get(wanted, "").rpartition("_")
    for name, given in names.items():
        words, _, said = name.removeprefix("CONFIG_").rpartition("_")
        if words == standard != "":
            try:
                own = _FACTORS.get((said, unit)) or unit_factor(plain_unit(said), unit)
                return _number(name, given, path, None if least is None else least / own) * own
            except UnitError as error:
                raise error.at(file=path, field=name) from None
    words = wanted.split("_")[1]
    _refuse_near(names, words, standard, path)
    if otherwise is None:
        what, remedy = "it is missing", "Give the whole configuration"
        field = f"CONFIG_{standard}_... or CONFIG_..._{words}"
        raise InputError(what, file=path, field=field, remedy=remedy)
    return otherwise


def _refuse_near(names: Mapping[str, str], words: str, standard: str, path: str | Path) -> None:
    """Raise InputError for a name that differs by a letter or two from one that is missing."""
    known = {one.split("_")[1] for one in _STANDARD}
    known |= {one.rpartition("_")[0] for one in _STANDARD.values()}
    for name in names:
        parts = name.removeprefix("CONFIG_").split("_")
        for meant in (words, standard) if known.isdisjoint(parts) else ():
            if difflib.get_close_matches(meant, parts, n=1, cutoff=_NEAR):
                what, remedy = "it is no known name", f"Write {meant}, or leave the line out"
                raise InputError(what, file=path, field=name, remedy=remedy)


def _period(names: Mapping[str, str], path: str | Path) -> float:
    """Return how long a cycle lasts [s]; of several periods the one without a number counts."""
    for name, given in names.items():
        if found := re.fullmatch(r"CONFIG_([A-Z]{2})\d+_CyclePeriod", name):
            return _number(name, given, path) * _PERIODS.get(found[1], _HOUR)
    return _standard(names, "PM01_CyclePeriod", path)


def _number(name: str, given: str, path: str | Path, least: float | None = None) -> float:
    """Return a number of at least `least`, above 0 where that is not given."""
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not (value > 0.0 if least is None else value >= least) or value == math.inf:
        wanted = "above 0" if least is None else f"of at least {least:g}"
        what, remedy = f"it is no number {wanted}", "Give the number of the float's configuration"
        raise InputError(what, file=path, field=name, value=given, remedy=remedy)
    return value


def _depth(pressure: float) -> float:
    """Return the depth of a pressure [dbar] in m."""
    return float(-gsw.z_from_p(pressure, PLACE))
