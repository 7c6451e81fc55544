"""A cast in a profile file of Argo.

The adjusted values are taken where there are any, and in the modes A and D no others; of each
sample only what its quality flags call good (Argo user's manual, reference table 2: 1 good,
2 probably good, 5 changed, 8 interpolated).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.cast_raw import RawCast, place_of
from swimbladder.io.cast_variables import by_flags, in_unit, raw_cast
from swimbladder.io.log_text import counted
from swimbladder.io.netcdf_in import Variable

Array = NDArray[np.float64]
_ARGO = {"pressure_dbar": "PRES", "temperature_degC": "TEMP", "salinity": "PSAL"}
_SEVERAL = 2
_SHOWN = 4  # profiles, where there are too many


def is_profiles(variables: Mapping[str, Variable]) -> bool:
    """Say whether these are the variables of an Argo profile file."""
    return all(name in variables for name in ("PRES", "TEMP")) and (
        variables["PRES"].values.ndim == 2
    )


def argo_cast(variables: Mapping[str, Variable], path: Path, profile: int | None) -> RawCast:
    """Return one profile of an Argo file: the primary one, or that asked for from 1.

    Raises LogError where there are several to choose from, or none that is good.
    """
    report: list[str] = []
    n = _number(variables, path, profile, report)
    mode = _letters(variables, "DATA_MODE", n)
    rows: dict[str, Array] = {}
    for name, plain in _ARGO.items():
        if plain not in variables:
            continue
        found = plain
        adjusted = variables.get(f"{plain}_ADJUSTED")
        if adjusted is not None and np.isfinite(np.asarray(adjusted.values[n], float)).any():
            found = f"{plain}_ADJUSTED"
        elif adjusted is not None and mode in ("A", "D"):
            raise LogError(
                f"in mode {mode} no value of {plain} was found fit to be adjusted: none is good",
                file=path, field=f"{plain}_ADJUSTED",
                remedy="Take another profile; if you trust its raw values, write them to a CSV",
            )  # fmt: skip
        values = in_unit(name, found, variables[found], path, report)
        if values.shape != variables["PRES"].values.shape:
            raise LogError(
                "not as many values as pressures", file=path, field=found,
                remedy="Fetch the file anew: every profile has a value per level",
            )  # fmt: skip
        by_flags(found, variables, values, path, report)
        rows[name] = values[n]
    where = {}
    for name, variable in (("latitude", "LATITUDE"), ("longitude", "LONGITUDE")):
        if variable in variables:
            at = np.ravel(np.asarray(variables[variable].values, float))[n : n + 1]
            where[name] = place_of(name, at, report)
    return raw_cast(
        rows, path, report, name=_platform(variables, n), latitude=where.get("latitude"),
        longitude=where.get("longitude"),
    )  # fmt: skip


def _number(
    variables: Mapping[str, Variable], path: Path, profile: int | None, report: list[str]
) -> int:
    """Return the profile that is asked for, from 0: else the only one, or only primary one.

    Raises LogError where there are several, or fewer than asked for.
    """
    pressures = np.asarray(variables["PRES"].values, float)
    count = len(pressures)
    if profile is not None and profile > count:
        raise LogError(
            f"the file has {counted(count, 'profile')}", file=path, field="--profile",
            value=profile, remedy=f"Choose from 1 to {count}",
        )  # fmt: skip
    if profile is not None or count < _SEVERAL:
        return (profile or 1) - 1
    held = [k for k in range(count) if np.isfinite(pressures[k]).any()]
    primary = [k for k in held if _scheme(variables, k).startswith("primary")]
    found = primary or held or [0]
    if len(found) > 1:
        some = ", ".join(
            f"{k + 1}: {f'{_platform(variables, k)} to'.strip()} {np.nanmax(pressures[k]):.0f} dbar"
            for k in found[:_SHOWN]
        )
        raise LogError(
            f"there are {len(found)} profiles in it "
            f"({some}{', ...' if len(found) > _SHOWN else ''})",
            file=path, field="profile", remedy="Choose one with --profile N",
        )  # fmt: skip
    why = "the primary sampling" if primary else "the only one with pressures"
    report.append(f"profile {found[0] + 1} of {count} taken, {why}")
    return found[0]


def _scheme(variables: Mapping[str, Variable], n: int) -> str:
    schemes = variables.get("VERTICAL_SAMPLING_SCHEME")
    texts = np.zeros(0) if schemes is None or schemes.numeric else np.ravel(schemes.values)
    return str(texts[n]).lower() if n < len(texts) else ""


def _letters(variables: Mapping[str, Variable], name: str, n: int) -> str:
    """Return the n-th letter of a variable of one for each profile; "" where there is none."""
    found = variables.get(name)
    letters = "" if found is None or found.numeric else "".join(map(str, np.ravel(found.values)))
    return letters[n : n + 1]


def _platform(variables: Mapping[str, Variable], n: int) -> str:
    number, cycle = variables.get("PLATFORM_NUMBER"), variables.get("CYCLE_NUMBER")
    parts = []
    if number is not None and not number.numeric:
        parts.append(f"float {str(np.ravel(number.values)[n]).strip(chr(0) + ' ')}")
    if cycle is not None and cycle.numeric and np.isfinite(np.ravel(cycle.values)[n]):
        parts.append(f"cycle {int(np.ravel(cycle.values)[n])}")
    return " ".join(parts)
