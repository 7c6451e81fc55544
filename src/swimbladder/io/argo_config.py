"""An Argo float's configuration as a mission: names like ``CONFIG_PT24_PressureCheckPeriod...``.

The file is JSON, as in a float's metadata: an object of names and values, or one whose ``missions``
are such objects, of which the first counts. Numbers of the names differ between types of float
(PM08, MC011), their words hardly. Pressures [dbar] become depths, by the standard ocean at 45
degrees.

A cycle takes its period. The float leaves its park depth so long before the end as both ways take
at the mean speeds of the configuration; it arrives sooner or later, and waits.
"""

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gsw

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission

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
_RESOLUTION = 0.1  # dbar, of the pressures by which a float decides: as its CTD has them


def argo_mission(text: str, path: str | Path) -> Mission:
    """Return one cycle as a mission, flown by the law `argo`; its volumes are the vehicle's.

    Raises InputError with file, name, value and remedy.
    """
    names = _names(text, path)

    def number(wanted: str, otherwise: float | None = None, least: float | None = None) -> float:
        kind, words = wanted.split("_")
        about = "(?=" if kind.startswith("PG") else "(?!"
        pattern = rf"CONFIG_{about}{_ICE})[A-Z]+\d*_{_OTHERWISE.get(words, words)}"
        for name, given in names.items():
            if re.fullmatch(pattern, name):
                return _number(name, given, path, least)
        if otherwise is None:
            raise _missing(words, path)
        return otherwise

    drift, deepest = number("PM08_DriftDepth"), number("PM09_ProfileDepth")
    park, bottom = _depth(drift), _depth(deepest)
    metres = bottom / deepest

    def numbers(
        table: Mapping[str, tuple[str, float | None]], least: float | None = None
    ) -> dict[str, float]:
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
    shifts = grounding.get("volume") and number(GROUNDING_MODE, 1.0, 0.0) == 0.0
    drifts = {"grounding": "shift"} if shifts else {}
    phases = [{**staying, "depth": park, "duration": stays, **drifts}]
    if on > 0.0:
        phases.append({**staying, "name": "to profile", "depth": bottom, "duration": on})
    phases.append({"kind": "surface", "duration": AT_SURFACE, **flown})
    limit = number("PT06_MaxPressureBeforeEmergencyAscent", deepest + 200.0)
    return Mission.model_validate(
        {
            "name": Path(path).stem,
            "description": f"park {drift:g} dbar, profile {deepest:g} dbar, by its configuration",
            "phases": phases,
            "safety": {"deepest": _depth(limit)},
            "grounding": grounding if grounding.get("volume") else None,
            "ice": ice if "temperature" in ice else None,
        }
    )


def _names(text: str, path: str | Path) -> Mapping[str, str]:
    try:
        found = json.loads(text)
    except ValueError as error:
        remedy = "Give the configuration as JSON"
        raise InputError(f"no JSON: {error}", file=path, field="file", remedy=remedy) from None
    found = found.get("missions", [found])[0] if isinstance(found, dict) else {}
    return {str(name): str(value) for name, value in found.items()}


def _period(names: Mapping[str, str], path: str | Path) -> float:
    """Return how long a cycle lasts [s]; of several periods the one without a number counts."""
    for name, given in names.items():
        if found := re.fullmatch(r"CONFIG_([A-Z]{2})\d+_CyclePeriod", name):
            return _number(name, given, path) * _PERIODS.get(found[1], _HOUR)
    raise _missing("CyclePeriod", path)


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


def _missing(words: str, path: str | Path) -> InputError:
    field, remedy = f"CONFIG_..._{words}", "Give the whole configuration"
    return InputError("it is missing", file=path, field=field, remedy=remedy)


def _depth(pressure: float) -> float:
    """Return the depth of a pressure [dbar] in m."""
    return float(-gsw.z_from_p(pressure, PLACE))
