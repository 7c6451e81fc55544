"""Measured logs: texts with a header, into arrays in SI units, with a report of what was done.

A log has the columns ``time_s`` and ``depth_m`` and any of ``volume_m3, piston_m, voltage_V,
current_A, temperature_degC, speed_m_s, reference_depth_m, reference_volume_m3,
reference_piston_m``; a caller may ask for others than the depth (a motor on a bench has none).
Other names and units are mapped, by `columns` or by a ``[log]`` table
(`swimbladder.io.log_format`); nothing is guessed in silence.
Depth may also come from pressure, or from a logger with another water, another zero or sign.

What is odd about a log: disorder and repeats, gaps, samples that stand far off.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.io.columns import (
    Mapped,
    check_columns,
    likely,
    meant_columns,
    named_columns,
    no_column,
    wanted_names,
)
from swimbladder.io.log_format import COLUMNS, LogColumn, LogFormat, format_of
from swimbladder.io.log_formats import FORMATS
from swimbladder.io.log_rows import Sheet, open_sheet
from swimbladder.io.log_table import Table, TimeColumn, read_table
from swimbladder.io.log_text import LogFile, counted
from swimbladder.physics.arrays import Array, Flags
from swimbladder.units import parse_quantity

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_GAP = 5.0  # median steps
_FAR = 8.0  # standard deviations of the noise
_FASTER = 3.0  # times the largest steps that the signal is seen to keep up
_QUANTA = 4.0
_NEAR = 10  # samples on either side that define what is noise
_BESIDE = 4  # and how fast the signal moves
_SCALE = 1.4826  # standard deviation over median absolute deviation, of a normal distribution
_FEWEST = 9  # samples that can define what is normal
_SHOWN = 3  # places that a report names
_PIECE = 1 << 16  # samples that are judged at once
# Steps of a coarse sensor, for a signal that otherwise hardly changes: a flicker is no spike.
_COARSE = {"depth_m": 0.025, "piston_m": 2e-4, "volume_m3": 5e-7}


def in_order(table: Table, file: LogFile, several: str) -> Table:
    """Return the rows with time increasing; those that repeat a time are dropped.

    several: what to do where the file holds several logs. Raises LogError where time goes back.
    """
    time, report = table.values["time_s"], file.report
    back = np.flatnonzero(np.diff(time) < 0.0)
    if len(back) and file.form.rows == "sort":
        report.append(f"rows sorted by time: it went back {counted(len(back), 'time')}")
        table = table.only(np.argsort(time, kind="stable"))
    elif len(back):
        at = int(back[0]) + 1
        what = f"time goes back, {counted(len(back), 'time')} in the log"
        remedy = f'If the file is in disorder, {several}or set rows = "sort" in its [log] table'
        line, value = table.line[at], float(time[at])
        raise file.refused(what, remedy, "time_s", line=line, value=value, unit="s")
    again = np.append(False, np.diff(table.values["time_s"]) <= 0.0)
    if not again.any():
        return table
    kept = np.flatnonzero(~again)
    first = kept[np.searchsorted(kept, np.flatnonzero(again)) - 1]
    others = np.zeros(len(first), dtype=bool)
    for values in table.values.values():
        a, b = values[again], values[first]
        others |= (a != b) & (np.isfinite(a) | np.isfinite(b))
    unlike = f", {int(others.sum())} of them with other values" if others.any() else ""
    repeats = counted(int(again.sum()), "row")
    report.append(f"{repeats} with the time of the row before dropped{unlike}")
    return table.only(~again)


def find_gaps(table: Table, file: LogFile) -> tuple[tuple[float, float], ...]:
    """Return (time before, time after) [s] of every gap: a longer step than the format says.

    Where it says none, than five times the median step.
    """
    time, line, longest = table.values["time_s"], table.line, file.form.gap
    steps = np.diff(time)
    limit = _GAP * float(np.median(steps)) if longest is None else longest
    at = np.flatnonzero(steps > limit * (1.0 + 1e-9))
    if len(at):
        shown = [f"{steps[k]:.4g} s after {time[k]:.6g} s (line {line[k]})" for k in at[:_SHOWN]]
        more = ", ..." if len(at) > _SHOWN else ""
        gaps = f"{counted(len(at), 'gap')} of more than {limit:.3g} s"
        whole = f"{steps[at].sum():.4g} s in all"
        file.report.append(f"{gaps}, {whole}: {', '.join(shown)}{more}")
    return tuple((float(time[k]), float(time[k + 1])) for k in at)


def suspects(table: Table, gaps: Sequence[tuple[float, float]], file: LogFile) -> Flags:
    """Return which samples have a spike in depth, volume, piston or voltage."""
    data, found = table.values, np.zeros(len(table.line), dtype=bool)
    done = "dropped" if file.form.spikes == "drop" else 'kept; spikes = "drop" would leave them out'
    for name in ("depth_m", "volume_m3", "piston_m", "voltage_V"):
        if name not in data:
            continue
        spiky = spikes(name, data[name], data["time_s"], gaps)
        if not spiky.any():
            continue
        found |= spiky
        lines = [str(number) for number in table.line[spiky][:_SHOWN]]
        more = ", ..." if spiky.sum() > _SHOWN else ""
        odd = f"{counted(int(spiky.sum()), 'single sample')} of {name} far off the others"
        file.report.append(f"{odd}, on line {', '.join(lines)}{more}: {done}")
    return found


def spikes(name: str, values: Array, time: Array, gaps: Sequence[tuple[float, float]]) -> Flags:
    """Return which single samples of a column stand far off both their neighbours.

    A Hampel test over three samples: how far a sample is from their median, against the noise, as
    the median absolute deviation around it gives, and against what may be true: the quantum of the
    sensor, and the fastest motion that the signal is seen to keep up, nearby or anywhere. A voltage
    may jump, so only one far beyond all others counts. The first and the last sample, and those
    beside a gap or a missing value, are not judged.
    """
    mask = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < _FEWEST:
        return mask
    x, t = values[known], time[known]
    into, out = np.diff(x)[:-1], -np.diff(x)[1:]
    whole = np.diff(known) == 1
    for before, after in gaps:
        whole[np.searchsorted(t, before, side="right") - 1 : np.searchsorted(t, after)] = False
    judged = (into * out > 0.0) & whole[:-1] & whole[1:]
    height = np.pad(np.where(judged, np.minimum(np.abs(into), np.abs(out)), 0.0), 1)
    if not height.any():
        return mask
    jumps = name == "voltage_V"
    limit = _jumping(x, height) if jumps else _moving(x, t, height, _COARSE.get(name, 0.0))
    mask[known] = height > limit
    return mask


def _moving(x: Array, t: Array, height: Array, coarse: float) -> Array:
    """Return how far a sample of a signal that cannot jump may stand off."""
    steps = np.diff(x)
    ahead, behind = np.diff(t)[1:], np.diff(t)[:-1]
    bend = np.abs(x[1:-1] - (x[:-2] * ahead + x[2:] * behind) / (ahead + behind))
    noise = _SCALE / np.sqrt(1.5) * np.maximum(_around(bend, _NEAR, np.median), np.median(bend))
    twice = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])) * (steps[:-1] * steps[1:] > 0.0)
    thrice = np.minimum(twice[:-1], twice[1:])  # two spikes side by side do not look like that
    fastest = np.maximum(_around(twice, _BESIDE, np.max), np.quantile(thrice, 0.99))
    limit = np.maximum(_FAR * noise, _FASTER * fastest)
    quanta = _QUANTA * _quantum(steps, height, coarse)
    return np.asarray(np.maximum(np.pad(limit, 1), quanta), dtype=np.float64)


def _around(values: Array, reach: int, of: Callable[..., Any]) -> Array:
    """Return what `of` makes of the values near each, itself and the two beside it left out."""
    padded = np.pad(values, reach, mode="reflect" if len(values) > reach else "edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    near = [k for k in range(2 * reach + 1) if abs(k - reach) > 1]
    pieces = (windows[k : k + _PIECE, near] for k in range(0, len(windows), _PIECE))
    return np.concatenate([of(piece, axis=1) for piece in pieces], dtype=np.float64)


def _quantum(steps: Array, height: Array, coarse: float) -> float:
    """Return the smallest step of a signal, all but those into and out of its farthest samples."""
    far = height >= max(height.max() / 2.0, np.finfo(float).tiny)
    others = np.abs(steps[~(far[:-1] | far[1:])])
    others = others[others > 0.0]
    if not len(others):
        return coarse
    smallest = float(np.quantile(others, 0.05))
    return smallest if len(others) >= _FEWEST else min(smallest, coarse)


def _jumping(x: Array, height: Array) -> Array:
    """Return how far a sample of a signal that may jump may stand off: three times its range."""
    others = x[height < max(height.max() / 2.0, np.finfo(float).tiny)]
    widest = float(np.abs(others - np.median(others)).max())
    return np.full(len(x), _FASTER * widest if widest > 0.0 else np.inf)


_ABOVE = 0.5  # m above the surface, that a sensor may be off


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
        names = ["atmospheric_pressure", "gravity"]
        names += [] if form.logger_density is not None else ["water_density"]
        remedy = "Map pressure_Pa, or leave {} out"
        file.refuse_unused(names, "depth_m is read as a depth", remedy)
        if form.logger_density is not None and form.water_density is not None:
            ratio = form.logger_density / form.water_density
            depth = depth * ratio
            took = f"the logger took the water for one of {form.logger_density:g} kg/m3"
            is_one = f"it is one of {form.water_density:g} kg/m3"
            report.append(f"depth_m times {ratio:.6g}: {took}, {is_one}")
        if form.depth_positive == "up":
            depth = -depth
            report.append("depth_m counts upward in the file; turned to count downward")
    if form.depth_offset:
        depth = depth + form.depth_offset
        report.append(f"{form.depth_offset:g} m added to depth_m")
    known = depth[np.isfinite(depth)]
    if len(known) and np.median(known) < -_ABOVE:
        half = f"half of it above {np.median(known):.3g} m"
        check = 'check depth_positive = "up", atmospheric_pressure and depth_offset'
        report.append(f"most of the log is above the surface, {half}: {check}")
    return depth


def _from_pressure(data: dict[str, Array], file: LogFile) -> Array:
    form, pressure = file.form, data["pressure_Pa"]
    known = pressure[np.isfinite(pressure)]
    first = float(known[0]) if len(known) else 0.0
    if form.water_density is None:
        what = "the density that turns pressure_Pa into depth is missing"
        line = 'water_density = "998 kg/m3" (or sea water, "1025 kg/m3")'
        remedy = f"Add a line {line} to the [log] table"
        raise file.refused(what, remedy, "water_density")
    if form.atmospheric_pressure is None:
        looks = f"{first:.6g} Pa, looks {'absolute' if first > 7e4 else 'gauge'}"
        what = f"what pressure_Pa reads at the surface is not said; its first reading, {looks}"
        remedy = (
            "Say it with `log_format={'atmospheric_pressure': 'gauge'}`, 1013 mbar (what it reads "
            "there) or first (its first reading is at the surface), or in the [log] table"
        )
        raise file.refused(what, remedy, "atmospheric_pressure")
    why = "the depth comes from pressure_Pa"
    file.refuse_unused(("logger_density", "depth_positive"), why, idle="down")
    surface, how = _surface_pressure(form.atmospheric_pressure, pressure, data["time_s"])
    less, weight = f"less {surface:.6g} Pa at the surface ({how})", f"{form.water_density:g} kg/m3"
    said = f"depth_m from pressure_Pa, {less}, over {weight} times {form.gravity:g} m/s2"
    file.report.append(said)
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


REQUIRED = ("time_s", "depth_m")
# Column and field of what a log may have.
_FIELDS = {
    name: name.removesuffix(f"_{unit.replace('/', '_')}")
    for name, unit in COLUMNS.items()
    if name not in ("time_s", "depth_m", "pressure_Pa")
}


@dataclass(frozen=True, kw_only=True)
class Log:
    """What was measured, in SI units, as arrays of one length.

    source: file and selection. report: what was converted, dropped or ignored. volume counts
    from mid-stroke where volume_absolute, otherwise its zero is arbitrary; piston likewise, and it
    counts outward: positive displaces more. What the actuator was asked for, reference_volume and
    reference_piston, counts from the same zero. depth is NaN where it was not measured: in places
    or throughout, and only where the caller did not require it. line: where each sample stands in
    the file. suspect: the samples that stand far off, alone. gaps: (time before, time after).
    times: which column of the file they are, and what a number in it was taken for.
    """

    source: str
    time: Array  # s, as logged; ISO 8601 times from the first sample
    depth: Array  # m
    volume: Array | None = None  # m3
    piston: Array | None = None  # m
    voltage: Array | None = None  # V
    current: Array | None = None  # A
    temperature: Array | None = None  # degC, of the hull
    speed: Array | None = None  # m/s
    reference_depth: Array | None = None  # m
    reference_volume: Array | None = None  # m3
    reference_piston: Array | None = None  # m
    volume_absolute: bool = False
    piston_absolute: bool = False
    line: NDArray[np.int64]
    suspect: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    gaps: tuple[tuple[float, float], ...] = ()  # s
    report: tuple[str, ...] = ()
    times: TimeColumn = field(default_factory=TimeColumn)

    def __post_init__(self) -> None:
        """Make a log of which nothing is said to be suspect say so for every sample."""
        if not len(self.suspect):
            object.__setattr__(self, "suspect", np.zeros(len(self.time), dtype=bool))

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        span = float(self.time[-1] - self.time[0]) if len(self) else 0.0
        names = ("depth", *_FIELDS.values())
        held = [name for name in names if getattr(self, name) is not None]
        return f"Log({self.source!r}: {len(self)} samples in {span:g} s, {', '.join(held)})"

    def only(self, kept: Flags) -> Log:
        """Return the log with the samples that are `kept` (an array of its length)."""
        arrays = ((n, values) for n, values in vars(self).items() if isinstance(values, np.ndarray))
        chosen: dict[str, Any] = {name: values[kept] for name, values in arrays}
        return replace(self, **chosen)


def read_log(
    path: str | Path | pd.DataFrame | xr.Dataset,
    *,
    columns: Mapping[str, str | LogColumn] | None = None,
    where: Mapping[str, str | float] | None = None,
    log_format: LogFormat | Mapping[str, Any] | str | Path | None = None,
    required: Collection[str] = REQUIRED,
) -> Log:
    """Return the log in a file or a DataFrame.

    Parameters
    ----------
    path
        Of the file: a text, which may be compressed by gzip, Parquet or netCDF; or a pandas
        DataFrame or an xarray Dataset, with units in `attrs["units"]`, in names or in `columns`.
    columns
        {"depth_m": "Depth [cm]"}, over those of the log format; a unit in brackets counts, and
        "Depth@cm" states it where the header does not. None: those of the log format.
    where
        {"log": 47} keeps the rows that hold it; none: those that the log format keeps.
    log_format
        A `LogFormat`, its fields, a shipped one's name or a TOML file with a ``[log]`` table; none:
        the usual, or the shipped one whose columns the file has.
    required
        The columns without which a log is refused, beside ``time_s``; rows without them, and
        repeated ones, are dropped and reported.

    Returns
    -------
    Log
        What was measured, in SI units, and what was converted, dropped or ignored.

    Raises
    ------
    LogError
        An InputError: the file is no such log; with file, line, column, value and remedy.
    """
    known = None
    if log_format is None and isinstance(path, str | Path):
        with suppress(InputError):  # said when it is read
            known = shipped_format(path, {*required} - {*(columns or {})})
    file = LogFile.of(path, format_of(log_format if known is None else known))
    if known is not None:
        file.report.append(f"its columns are those of the log format {known}, and read so")
    chosen = {**file.form.where, **(where or {})}
    mapped = {**file.form.columns.mapped(), **(columns or {})}
    check_columns(file, (*mapped, *required), COLUMNS, "a log")
    needed = tuple(name for name in COLUMNS if name == "time_s" or name in required)
    choices = [("depth_m", "pressure_Pa") if name == "depth_m" else (name,) for name in needed]
    sources = partial(_sources, file, mapped, needed)
    table = read_table(file, chosen, sources, wanted_names(mapped, choices))
    return _log(table, file, chosen, needed)


def header_names(path: str | Path) -> list[str]:
    """Return the names in the header of a log.

    Raises LogError where there is none.
    """
    return open_sheet(LogFile.of(path, LogFormat()), head=True).header


def shipped_format(path: str | Path, required: Collection[str]) -> str | None:
    """Return the name of the one shipped log format whose columns a log has; None: not needed."""
    header = set(header_names(path))
    if set(required) <= header:
        return None
    fitting = []
    for name in FORMATS.own:
        mapped = format_of(name).columns.mapped().values()
        if mapped and {column.name for column in mapped} <= header:
            fitting.append(name)
    return fitting[0] if len(fitting) == 1 else None


def _depth_source(names: set[str], mapped: set[str], file: LogFile) -> str | None:
    """Return which of the columns at hand is to become the depth, None where there is none.

    depth_m, unless pressure_Pa is mapped and depth_m only happens to be there. Raises LogError
    where both are mapped.
    """
    both = {"depth_m", "pressure_Pa"}
    if both <= mapped:
        what = "depth cannot come both from depth_m and from pressure_Pa"
        raise file.refused(what, "Map one of the two", "pressure_Pa")
    if both <= names:
        return "pressure_Pa" if "pressure_Pa" in mapped else "depth_m"
    return next(iter(both & names), None)


def _sources(
    file: LogFile, mapped: Mapped, needed: Sequence[str], sheet: Sheet
) -> dict[str, LogColumn]:
    """Return which column of the file each column of the log is read from."""
    header = sheet.header
    sources = named_columns(file, mapped, header, COLUMNS)
    source = _depth_source(set(sources), set(mapped), file)
    for other in {"depth_m", "pressure_Pa"} - {source} if source else ():
        sources.pop(other, None)
    if not file.form.columns.mapped():
        read = dict.fromkeys(("depth_m", "pressure_Pa"), sources[source]) if source else {}
        sources |= meant_columns(file, header, sources | read)
        source = _depth_source(set(sources), set(mapped), file)
    for name in needed:
        if name not in sources and not (name == "depth_m" and source):
            more = " or in a [log] table"
            more += ", or a pressure with pressure_Pa=NAME@UNIT" if name == "depth_m" else ""
            what, hint = f"the log has no column {name}", likely(header, sources)
            raise no_column(file, what, name, header, more, hint)
    return sources


def _log(table: Table, file: LogFile, where: Mapping[str, object], needed: Sequence[str]) -> Log:
    """Return the log of a table: rows without numbers dropped, ordered, turned, checked."""
    form, report, read = file.form, file.report, len(table.line)
    source = next((name for name in ("depth_m", "pressure_Pa") if name in table.values), None)
    several = (
        "" if where else "choose one of several logs in the file with `where={'COLUMN': 'VALUE'}`, "
    )
    if table.parts > 1 and form.part is None:
        several += "choose a part of it with part = 1 in its [log] table, "
    table = in_order(_complete(table, source, needed, file), file, several)
    data, line = table.values, table.line
    if len(line) < 2:
        dropped = "".join(f"; {note}" for note in report if "dropped" in note)
        what = f"{counted(len(line), 'usable sample')} of {read} are too few{dropped}"
        raise file.refused(what, "Give a log with a row per sample, each with its time", "rows")
    for name in list(data):
        if not np.isfinite(data[name]).any():
            report.append(f"{name} holds no number and is ignored")
            del data[name]
    if source in data:
        data["depth_m"] = to_depth(data, source, file)
    _turn(data, form, report)
    gaps = find_gaps(table, file)
    suspect = suspects(table, gaps, file)
    texts = [f"{value:g}" if isinstance(value, float) else value for value in where.values()]
    chosen = ", ".join(f"{name}={text}" for name, text in zip(where, texts, strict=True))
    others: dict[str, Any] = {field: data[n] for n, field in _FIELDS.items() if n in data}
    log = Log(
        source=f"{file.path} ({chosen})" if chosen else str(file.path),
        time=data["time_s"],
        depth=data.get("depth_m", np.full(len(line), np.nan)),
        **others,
        volume_absolute=form.volume_zero is not None,
        piston_absolute=form.piston_zero is not None,
        line=line,
        suspect=suspect,
        gaps=gaps,
        report=tuple(report),
        times=table.times,
    )
    return log.only(~suspect) if form.spikes == "drop" else log


def _complete(table: Table, source: str | None, needed: Sequence[str], file: LogFile) -> Table:
    """Return the rows with numbers where they are needed; raises LogError where half have none."""
    depth = source or "depth_m"
    found = {name: table.values[depth if name == "depth_m" else name] for name in needed}
    keep = np.logical_and.reduce([np.isfinite(values) for values in found.values()])
    if keep.all():
        return table
    gone = int((~keep).sum())
    words = [name.split("_")[0] if name.count("_") == 1 else name for name in needed]
    file.report.append(f"{gone} of {len(keep)} rows without {' or '.join(words)} dropped")
    if gone > len(keep) / 2:
        holes = {name: int((~np.isfinite(values)).sum()) for name, values in found.items()}
        what = f"{gone} of {len(keep)} rows have no {' or no '.join(words)}"
        remedy = "Check that the right columns are mapped"
        emptiest = max(holes, key=lambda name: holes[name])
        raise file.refused(what, remedy, emptiest, line=table.line[~keep][0])
    return table.only(keep)


def _turn(data: dict[str, Array], form: LogFormat, report: list[str]) -> None:
    """Count pistons outward, speeds and set-points downward, from the zeros that are said."""
    for name in {"piston_m", "reference_piston_m"} & data.keys():
        sign = -1.0 if form.piston_positive == "in" else 1.0
        data[name] = sign * (data[name] - (form.piston_zero or 0.0))
    if form.piston_positive == "in" and "piston_m" in data:
        report.append("piston_m counts inward in the file; turned to count outward")
    for name in {"volume_m3", "reference_volume_m3"} & data.keys():
        data[name] = data[name] - (form.volume_zero or 0.0)
    for name in {"speed_m_s", "reference_depth_m"} & data.keys():
        if form.depth_positive == "up":
            data[name] = -data[name]
