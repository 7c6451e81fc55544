"""Casts from files: CSV and Parquet like logs, netCDF (CF, OG1), Argo, Sea-Bird; also gzipped.

Nothing is guessed in silence and nothing bad goes through: the physics detects a wrong unit, a
density inversion that is more than noise is refused, and what was averaged, sorted or left out
stands in `Cast.report`.

Formats that are no table of text are swimbladder's own, and those of other packages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from swimbladder.errors import InputError, LogError, Parameter, SwimbladderError, column_as
from swimbladder.io.cast_columns import RawCast, sheet_cast
from swimbladder.io.cast_formats import cnv_cast, is_cnv, netcdf_cast
from swimbladder.io.cast_rows import Inversions, averaged, one_leg, stable, without_spikes
from swimbladder.io.cast_units import MOST_SALT, by_depth, check_units
from swimbladder.io.log_format import LogFormat, format_of
from swimbladder.io.log_text import LogFile, is_frame, is_netcdf, read_bytes
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Cast
from swimbladder.physics.seawater.cast import pressure_of_depth
from swimbladder.plugins import Registry

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True, kw_only=True)
class CastFormat:
    """A format of casts.

    recognises: whether bytes are those of such a file. read: (bytes, path, columns of the user's
    as for texts, profile asked for) -> (the cast as it stands there, the profile that is still
    asked for, None where the file's are known); raises LogError. What it gives is checked as
    every cast is: units, order, density.
    """

    recognises: Callable[[bytes], bool]
    read: Callable[[bytes, Path, Mapping[str, str], int | None], tuple[RawCast, int | None]]


def _accept(form: Any, name: str) -> CastFormat:
    if not isinstance(form, CastFormat):
        what = "it is no CastFormat"
        raise InputError(what, remedy="Let the entry point name a swimbladder.io.casts.CastFormat")
    return CastFormat(recognises=_guarded(form.recognises, name), read=_guarded(form.read, name))


def _guarded(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a function of another package whose failures are said to be that package's."""

    def call(*given: Any) -> Any:
        try:
            return function(*given)
        except SwimbladderError:
            raise
        except Exception as error:  # whatever another package does
            package = CAST_FORMATS.package(name)
            why = f"{type(error).__name__}: {' '.join(str(error).split())}"
            what = f"the cast format {name!r} of the package {package} fails: {why}"
            remedy = f"Update {package}, or uninstall it"
            raise InputError(what, field="cast", remedy=remedy) from error

    return call


_OWN: dict[str, Callable[[], CastFormat]] = {
    "netcdf": partial(CastFormat, recognises=is_netcdf, read=netcdf_cast),
    "cnv": partial(CastFormat, recognises=is_cnv, read=cnv_cast),
}
CAST_FORMATS = Registry("swimbladder.cast_formats", "cast format", _OWN, _accept)


def recognised(data: bytes, path: Path) -> tuple[CastFormat | None, list[str]]:
    """Return the format of a file's bytes, None for text, and what is to be said of formats.

    Raises InputError where several know them as their own. swimbladder's own are asked first.
    """
    for name in CAST_FORMATS.own:
        if CAST_FORMATS[name].recognises(data):
            return CAST_FORMATS[name], []
    said, known = [], {}
    for name in CAST_FORMATS.names()[len(CAST_FORMATS.own) :]:
        try:
            if CAST_FORMATS[name].recognises(data):
                known[name] = CAST_FORMATS[name]
        except InputError as error:
            said.append(str(error))
    if len(known) > 1:
        what = f"several cast formats know it as theirs: {' and '.join(known)}"
        packages = ", ".join(str(CAST_FORMATS.package(name)) for name in known)
        remedy = f"Uninstall the packages of all but one: {packages}"
        raise InputError(what, file=path, field=Parameter("cast"), remedy=remedy)
    return next(iter(known.values()), None), said


_LATITUDE = 45.0  # where gravity is the mean of pole and equator, to 1 part in 10 000


def read_cast(
    path: str | Path | pd.DataFrame | xr.Dataset,
    *,
    columns: Mapping[str, str] | None = None,
    where: Mapping[str, str | float] | None = None,
    log_format: LogFormat | Mapping[str, Any] | str | Path | None = None,
    profile: int | None = None,
    latitude: float | None = None,
    longitude: float | None = None,
    salinity: float | None = None,
    inversions: Inversions = "refuse",
) -> Cast:
    """Return the cast in a file.

    Parameters
    ----------
    path
        Of the file: CSV, Parquet, netCDF, Argo or Sea-Bird, also gzipped; or a DataFrame or a
        Dataset of one profile, with units in `attrs["units"]`, in names or in `columns`.
    columns
        {"pressure_dbar": "Pressure@bar"}, names of `CAST_COLUMNS`; none: as the file names them.
    where
        {"dive": 7} keeps the rows that hold it; none: all rows. Of CSV and Parquet only.
    log_format
        How a text is to be read, as for logs; none: as the usual format has it.
    profile
        Which way down or up, or which profile of an Argo file, from 1; none: the only one, or of a
        cast down and up the way down.
    latitude, longitude
        Over those of the file [degrees]; none: those of the file.
    salinity
        Practical [-], for a cast that measured none; none: as measured.
    inversions
        What to do with density inversions above 0.03 kg/m3: refuse, average or keep.

    Returns
    -------
    Cast
        Absolute Salinity and Conservative Temperature over pressure, and what was assumed.

    Raises
    ------
    LogError
        An InputError: the file is no cast; with file, line, column, value and remedy.
    InputError
        What is said of the cast beside its file cannot be.
    """
    check_reading(latitude=latitude, longitude=longitude, salinity=salinity, inversions=inversions)
    columns, where = columns or {}, where or {}
    file: Any = path if is_frame(path) else Path(str(path))
    data = b"" if is_frame(path) else read_bytes(file)
    binary, said = (None, []) if is_frame(path) else recognised(data, file)
    if binary is not None:
        if where or log_format is not None:
            what = "rows and log formats are chosen in CSV and Parquet only"
            remedy = "Choose a profile with `profile=1`, variables with `columns=`"
            raise LogError(what, file=file, field="where" if where else "log_format", remedy=remedy)
        raw, profile = binary.read(data, file, columns, profile)
    else:
        text, salted = LogFile.of(file, format_of(log_format)), salinity is not None
        chosen = ", ".join(f"{name}={value}" for name, value in where.items())
        raw = sheet_cast(text, columns, where=where, salted=salted, name=chosen)
    raw.report.extend(said)
    stated: dict[str, Any] = {"latitude": latitude, "longitude": longitude}
    if "@" in columns.get("pressure_dbar", ""):
        stated["unit_stated"] = True
    raw = replace(raw, **{name: value for name, value in stated.items() if value is not None})
    with np.errstate(all="ignore"):  # of rows that are no water, until they are left out
        return _cast(_whole(_salted(raw, salinity)), profile, inversions)


def check_reading(
    *,
    latitude: float | None = None,
    longitude: float | None = None,
    salinity: float | None = None,
    inversions: str = "refuse",
) -> None:
    """Raise InputError where what is said of a cast beside its file cannot be."""
    for name, degrees, most in (("latitude", latitude, 90.0), ("longitude", longitude, 360.0)):
        if degrees is not None and not abs(degrees) <= most:
            what = f"not between -{most:g} and {most:g}"
            remedy = "Give degrees with decimals, south and west negative"
            raise InputError(what, field=name, value=degrees, unit="degrees", remedy=remedy)
    if salinity is not None and not 0.0 <= salinity <= MOST_SALT:
        what = "no practical salinity of a sea"
        remedy = "Give it in PSS-78: 0 in fresh water, 35 in the ocean"
        raise InputError(what, field="salinity", value=salinity, remedy=remedy)
    if inversions not in get_args(Inversions):
        what = "not one of the choices"
        remedy = "Choose refuse, average or keep"
        raise InputError(what, field="inversions", value=inversions, remedy=remedy)


def _salted(raw: RawCast, salinity: float | None) -> RawCast:
    """Return the cast with the salinity that was stated for it."""
    if salinity is not None:
        raw.report.append(f"a salinity of {salinity:g} is taken all the way down, as stated")
        return replace(raw, salinity=np.full(len(raw), salinity), conductivity=None)
    if raw.salinity is None and raw.conductivity is None:
        lake = "for a lake give `salinity=0`, that of fresh water"
        remedy = f"Say which column it is with {column_as('salinity', 'NAME')}; {lake}"
        raise raw.refused("the cast has neither salinity nor conductivity", remedy, "salinity")
    return raw


def _whole(raw: RawCast) -> RawCast:
    """Return the rows that hold all that is needed; raises LogError where they are too few."""
    needed = {
        "pressure_dbar": raw.down,
        "temperature_degC": raw.temperature,
        "salinity": raw.salinity if raw.salinity is not None else raw.conductivity,
    }
    known = {name: np.isfinite(v) for name, v in needed.items() if v is not None}
    kept = np.logical_and.reduce(list(known.values()))
    if len(kept) < 2:
        what = f"{'one row is' if len(kept) else 'no row is'} no cast"
        each = "at different depths, each with pressure, temperature and salinity"
        remedy = f"Give two rows at least, {each}; `where=` may have chosen too few"
        raise raw.refused(what, remedy, "pressure_dbar" if raw.pressure is not None else "depth_m")
    if kept.sum() < 2:
        worst = min(known, key=lambda name: int(known[name].sum()))
        flagged = "".join(f"; {line}" for line in raw.report if "flagged" in line)
        whole = f"of {len(kept)} rows {int(kept.sum())} hold pressure, temperature and salinity"
        some = f"{int(known[worst].sum())} a {worst.split('_')[0]}"
        remedy = "Check that the right columns are mapped and that the sensor ran"
        raise raw.refused(f"{whole}, {some}, and 2 are the least{flagged}", remedy, worst)
    if not kept.all():
        raw.report.append(f"{int((~kept).sum())} of {len(kept)} rows with gaps left out")
    return raw.only(kept)


def _cast(raw: RawCast, profile: int | None, inversions: Inversions) -> Cast:
    """Return the profile: units checked, one leg, salinity, spikes, averages, inversions."""
    import gsw

    raw = check_units(raw)
    other = raw.unit_named not in (None, "dbar")  # who writes that has looked
    unit_known = raw.unit_stated or other or raw.pressure is None or by_depth(raw)
    raw = raw.only(one_leg(raw, raw.down, profile))
    latitude = _LATITUDE if raw.latitude is None else raw.latitude
    if raw.latitude is None:
        taken = f"the latitude is not known and taken as {_LATITUDE:g} degrees"
        raw.report.append(f"{taken}: pressure at a depth may be off by 0.3 %")
    pressure = _pressure(raw, latitude)
    if raw.salinity is None:
        assert raw.conductivity is not None
        mS_cm, down = 10.0 * raw.conductivity, np.maximum(pressure, 0.0)
        raw = replace(raw, salinity=gsw.SP_from_C(mS_cm, raw.temperature, down))
    kept = without_spikes(raw, pressure)
    raw, pressure = averaged(raw.only(kept), pressure[kept])
    assert raw.salinity is not None
    SA = _absolute(raw, raw.salinity, pressure)
    CT = np.asarray(gsw.CT_from_t(SA, raw.temperature, pressure))
    if len(pressure) < 2:
        what = "there is one pressure only"
        raise raw.refused(what, "Give a cast that goes down", "pressure_dbar")
    SA, CT = stable(raw, pressure, SA, CT, inversions)
    column = None if unit_known else raw.names.get("pressure_dbar", "NAME")
    return Cast(
        pressure=pressure,
        SA=SA,
        CT=CT,
        latitude=latitude,
        longitude=raw.longitude,
        name=f"{raw.path.name} {raw.name}".strip(),
        report=tuple(raw.report),
        pressure_column=column,
        unit_named=raw.unit_named is not None,
    )


def _pressure(raw: RawCast, latitude: float) -> Array:
    """Return the pressures, or those that the depths have in water as it was measured."""
    import gsw

    if raw.pressure is not None:
        return raw.pressure
    assert raw.depth is not None
    salt = raw.salinity
    if salt is None:
        assert raw.conductivity is not None
        near = np.asarray(gsw.p_from_z(-raw.depth, latitude))
        salt = np.asarray(gsw.SP_from_C(10.0 * raw.conductivity, raw.temperature, near))
    raw.report.append("pressure follows from depth, by the density of the cast")
    return pressure_of_depth(raw.depth, salt, raw.temperature, latitude)


def _absolute(raw: RawCast, SP: Array, pressure: Array) -> Array:
    """Return Absolute Salinity [g/kg], with the anomaly of the place where that is known."""
    import gsw

    if raw.longitude is None or raw.latitude is None:
        light = "by up to 0.02 kg/m3 too light in the open ocean and 0.07 in the Baltic"
        taken = "Absolute Salinity is the Reference Salinity"
        raw.report.append(f"the place is not known: {taken}, {light}")
        return np.asarray(gsw.SR_from_SP(SP))
    SA = np.asarray(gsw.SA_from_SP(SP, pressure, raw.longitude, raw.latitude))
    return np.where(np.isfinite(SA), SA, gsw.SR_from_SP(SP))
