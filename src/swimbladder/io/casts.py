"""Casts from files: CSV and Parquet like logs, netCDF (CF, OG1), Argo, Sea-Bird; also gzipped.

Nothing is guessed in silence and nothing bad goes through: the physics detects a wrong unit, a
density inversion that is more than noise is refused, and what was averaged, sorted or left out
stands in `Cast.report`.

Formats that are no table of text are swimbladder's own, and those of other packages.

From rows in the order of a file to a profile: one leg, no spikes, averaged, stable.

Small density inversions are noise and averaged, large ones are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import (
    InputError,
    LogError,
    Parameter,
    SwimbladderError,
    check_number,
    column_as,
)
from swimbladder.io.cast_columns import RawCast, cnv_cast, is_cnv, netcdf_cast, sheet_cast
from swimbladder.io.cast_units import COLDEST, DEEPEST, MOST_SALT, WARMEST, by_depth, check_units
from swimbladder.io.log_format import LogFormat, format_of
from swimbladder.io.log_text import LogFile, counted, is_frame, is_netcdf, read_bytes
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.seawater import Cast
from swimbladder.physics.seawater.cast import pressure_of_depth
from swimbladder.vehicle.plugins import Registry
from swimbladder.vehicle.schema import check_choice

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Inversions = Literal["refuse", "average", "keep"]
# kg/m3 between two depths; the threshold of Argo's density inversion test (Argo Quality Control
# Manual for CTD and Trajectory Data, test 14).
INVERSION = 0.03


def stable(
    raw: RawCast, pressure: Array, SA: Array, CT: Array, inversions: Inversions
) -> tuple[Array, Array]:
    """Return SA and CT of a water column that is nowhere lighter below.

    Where it is, neighbours are mixed until it is not, which keeps salt and heat. Raises LogError
    for an inversion of more than `INVERSION` between two rows, or where mixing many would change
    the density by more than that, unless `inversions` says to average or keep them.
    """
    import gsw

    jumps = _jumps(pressure, SA, CT)
    worst = int(np.argmin(jumps))
    size = -float(jumps[worst])
    if size <= 0.0:
        return SA, CT
    count = counted(int((jumps < 0.0).sum()), "density inversion")
    where = f"the largest {size:.2g} kg/m3 at {pressure[worst + 1]:.1f} dbar"
    noise, option = f"more than noise makes ({INVERSION:g})", "with `inversions='average'`"
    if size > INVERSION and inversions == "refuse":
        lighter = f"{size:.2g} kg/m3 lighter than that at {pressure[worst]:.1f} dbar above it"
        what = f"the water at {pressure[worst + 1]:.1f} dbar is {lighter}, {noise}"
        culprits = "a spike, a lagging sensor, the bottom"
        remedy = f"Take out what is no water there ({culprits}), or mix the neighbours {option}"
        raise raw.refused(what, remedy, "density", k=worst + 1, value=round(size, 4), unit="kg/m3")
    if inversions == "keep":
        raw.report.append(f"{count} kept, {where}")
        return SA, CT
    mixed = _mixed(pressure, SA, CT)
    change = np.abs(gsw.rho(*mixed, pressure) - gsw.rho(SA, CT, pressure))
    most = int(np.argmax(change))
    if change[most] > INVERSION and inversions == "refuse":
        where = f"downwards around {pressure[most]:.1f} dbar, by little from row to row"
        by = f"by {change[most]:.2g} kg/m3 in all"
        what = f"the water gets lighter {where} and {by}, {noise}"
        check = "Check salinity and temperature there (a sensor that drifts?)"
        remedy, value = f"{check}, or mix the water {option}", round(float(change[most]), 4)
        raise raw.refused(what, remedy, "density", k=most, value=value, unit="kg/m3")
    density = f"density changes by {change[most]:.2g} kg/m3 at most"
    raw.report.append(f"{count} averaged with the water beside, {where}; {density}")
    return mixed


def _jumps(p: Array, SA: Array, CT: Array) -> Array:
    """Return how much denser each row is than the one above at the pressure between [kg/m3]."""
    import gsw

    between = 0.5 * (p[1:] + p[:-1])
    return np.asarray(gsw.rho(SA[1:], CT[1:], between) - gsw.rho(SA[:-1], CT[:-1], between))


def _mixed(p: Array, SA: Array, CT: Array) -> tuple[Array, Array]:
    """Mix neighbours, by the pressure they stand for, until none is lighter than the one above."""
    weight = np.gradient(p)
    blocks = [[k] for k in range(len(p))]
    while True:
        w = np.array([weight[b].sum() for b in blocks])
        s, c, q = (np.array([(weight[b] * v[b]).sum() for b in blocks]) / w for v in (SA, CT, p))
        down = _jumps(q, s, c) < -1e-9
        if not down.any():
            break
        joined: list[list[int]] = [blocks[0]]
        for k in range(1, len(blocks)):
            if down[k - 1]:
                joined[-1] = joined[-1] + blocks[k]
            else:
                joined.append(blocks[k])
        blocks = joined
    sizes = [len(b) for b in blocks]
    return np.repeat(s, sizes), np.repeat(c, sizes)


_TURN = 0.05  # share of the range, 1 dbar at least, that pressure goes back at a turn
_LONG = 0.5  # share of the longest leg that makes another one a profile
_SHUFFLED = 0.2  # mean step over the range: rows in no order have 1/3
_AROUND = 10  # rows on either side that a spike is held against
_FAR = 8.0  # standard deviations of the noise
_SCALE = 1.4826  # standard deviation over median absolute deviation, of a normal distribution
_FLOOR = {"temperature": 0.5, "salinity": 0.3}  # degC, -: less is no spike
_BIN = 1.0  # dbar
_BINS = 100  # at least, over a shallow cast


def legs(pressure: Array) -> list[tuple[int, int]]:
    """Return first and last row of each way down or up that is long: half the longest or more."""
    back = max(_TURN * float(np.ptp(pressure)), 1.0)
    turns = [0]
    high = low = 0
    way = 0
    for k, p in enumerate(pressure):
        high = k if p > pressure[high] else high
        low = k if p < pressure[low] else low
        if way >= 0 and pressure[high] - p > back:
            turns.append(high)
            way, low = -1, k
            high = k
        elif way <= 0 and p - pressure[low] > back:
            turns.append(low)
            way, high = 1, k
            low = k
        elif way > 0:
            low = k
        elif way < 0:
            high = k
    turns.append(high if way >= 0 else low)
    pairs = [(a, b) for a, b in pairwise(turns) if b > a] or [(0, len(pressure) - 1)]
    spans = [abs(float(pressure[b] - pressure[a])) for a, b in pairs]
    longest = max(spans)
    return [pair for pair, span in zip(pairs, spans, strict=True) if span >= _LONG * longest]


def one_leg(raw: RawCast, pressure: Array, profile: int | None) -> NDArray[np.int64]:
    """Return the rows of one way down or up, in the order of pressure.

    profile: which, counted from 1; not given: the only one, or of a cast down and up the way
    down. Raises LogError where there are several.
    """
    rows = np.arange(len(pressure))
    steps = np.abs(np.diff(pressure))
    if not steps.any():
        what = "all rows are of one pressure"
        remedy = "Give a cast that goes down"
        raise raw.refused(what, remedy, "pressure_dbar", value=float(pressure[0]))
    if steps.mean() > _SHUFFLED * float(np.ptp(pressure)) and len(pressure) > 5:
        raw.report.append("the rows are in no order and were sorted by pressure")
        return rows[np.argsort(pressure, kind="stable")]
    found = legs(pressure)
    if profile is not None and profile > len(found):
        what = f"the file has {counted(len(found), 'profile')}"
        raise raw.refused(
            what, f"Choose from 1 to {len(found)}", Parameter("profile"), value=profile
        )
    if profile is None and len(found) > 2:
        ends = ", ".join(
            f"{n}: {pressure[a]:.0f} to {pressure[b]:.0f} dbar"
            for n, (a, b) in enumerate(found[:6], start=1)
        )
        what = f"there are {len(found)} profiles in it ({ends}{', ...' if len(found) > 6 else ''})"
        remedy = "Choose one with `profile=1`, or rows with `where={'COLUMN': 'VALUE'}`"
        raise raw.refused(what, remedy, "profile")
    number = (profile or 1) - 1
    if profile is None and len(found) == 2:
        down = [pressure[b] > pressure[a] for a, b in found]
        number = down.index(True) if True in down else 0
        way, (a, b) = f"the way {'down' if down[number] else 'up'}", found[number]
        taken = f"{way} is taken, {raw.at(a)} to {raw.at(b)}"
        raw.report.append(f"it goes down and up again: {taken}")
    a, b = found[number]
    chosen = rows[a : b + 1]
    return chosen[np.argsort(pressure[chosen], kind="stable")]


def without_spikes(raw: RawCast, pressure: Array) -> Flags:
    """Return which rows, in the order of pressure, are no spikes; those left out are reported."""
    assert raw.salinity is not None
    good = (pressure >= 0.0) & (pressure <= DEEPEST)
    _say(raw, ~good, "above the surface")
    sane = (raw.temperature >= COLDEST) & (raw.temperature <= WARMEST)
    sane &= (raw.salinity >= 0.0) & (raw.salinity <= MOST_SALT)
    middle = float(np.median(raw.salinity))
    sane &= (raw.salinity >= 0.1 * middle) | (pressure > 5.0)  # the sensor still in air
    _say(raw, good & ~sane, "with salinity or temperature of no sea (sensor in air?)")
    good &= sane
    if good.sum() * 2 < len(good):
        k = int(np.flatnonzero(~good)[0])
        what = f"{int((~good).sum())} of {len(good)} rows cannot be sea water"
        remedy = "Check which columns are temperature, salinity and pressure, and their units"
        raise raw.refused(what, remedy, "salinity", k=k, value=float(raw.salinity[k]))
    for name, floor in _FLOOR.items():
        values = np.asarray(getattr(raw, name))
        spiky = np.zeros(len(good), dtype=bool)
        spiky[good] = _spikes(values[good], floor)
        if spiky.any():
            k = int(np.flatnonzero(spiky)[np.argmax(np.abs(values[spiky]))])
            where = f"{values[k]:.4g} at {pressure[k]:.1f} dbar"
            _say(raw, spiky, f"with {name} far off those around ({where})")
        good &= ~spiky
    return good


def _say(raw: RawCast, out: Flags, why: str) -> None:
    if out.any():
        first = raw.at(int(np.flatnonzero(out)[0]))
        raw.report.append(f"{counted(int(out.sum()), 'row')} {why} left out, the first on {first}")


def _spikes(values: Array, floor: float) -> Flags:
    """Return which values are far off the running median; ends have narrower windows."""
    off = np.abs(values - _running_median(values))
    noise = _SCALE * _running_median(off)
    return np.asarray(off > np.maximum(_FAR * noise, floor))


def _running_median(values: Array) -> Array:
    """Return the median of `_AROUND` values on either side, of as many as there are at the ends."""
    n, half = len(values), _AROUND
    if n <= 2 * half:
        half = max((n - 1) // 2, 0)
    middle = np.empty(n)
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)
    middle[half : n - half] = np.median(windows, axis=1)
    for k in range(half):
        middle[k] = np.median(values[: 2 * k + 1])
        middle[n - 1 - k] = np.median(values[n - 1 - 2 * k :])
    return middle


def averaged(raw: RawCast, pressure: Array) -> tuple[RawCast, Array]:
    """Return the means over bins of 1 dbar, finer in a shallow cast; rows are each bin's first."""
    width = min(_BIN, float(np.ptp(pressure)) / _BINS) or _BIN
    place = np.floor(pressure / width).astype(np.int64)
    _, first, back, count = np.unique(
        place, return_index=True, return_inverse=True, return_counts=True
    )
    if (count > 1).any():
        bins = f"bins of {width:.2g} dbar, {len(count)} in all"
        raw.report.append(f"{len(pressure)} rows averaged over {bins}")

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(back, weights=values) / count)

    assert raw.salinity is not None
    found: dict[str, Any] = dict.fromkeys(("depth", "conductivity", "density"))
    found |= {"temperature": mean(raw.temperature), "salinity": mean(raw.salinity)}
    found["pressure"] = mean(pressure)
    return replace(raw.only(first), **found), found["pressure"]


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
    how = "Give degrees with decimals, south and west negative"
    check_number(latitude, "latitude", "degrees", least=-90.0, most=90.0, remedy=how)
    check_number(longitude, "longitude", "degrees", least=-360.0, most=360.0, remedy=how)
    how = "Give it in PSS-78: 0 in fresh water, 35 in the ocean"
    check_number(salinity, "salinity", least=0.0, most=MOST_SALT, remedy=how)
    check_choice(inversions, get_args(Inversions), "not a choice", field="inversions")


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
