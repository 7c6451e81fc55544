"""A log that grows: what is new in it since it was last read, and what its stretches show.

Samples come in; rest, changes of volume and experiments come out. While a piston stands the volume
is one number, or a slow drift, not the noise of its sensor. A fit takes a logged volume as what the
volume was. Noise and quantum of the piston's sensor then push the model to and fro: half a quantum
of 0.75 cm3 over a glide of the paper's smallest step is 2 % of what drives it. While the piston
stands, the mean of many samples knows the volume better than each of them.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.files import read_at_most, temporary_folder
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_text import MOST_BYTES
from swimbladder.io.logs import Log, read_log
from swimbladder.vehicle import Vehicle

Array = NDArray[np.float64]

_SURE = 4.0  # standard errors of a trend that is one
_HALF = 4  # samples to either side of one, that show whether the piston stands
_NOISE = 6.0  # standard deviations of the sensor's noise, between the largest and the least of them
_FEWEST = 8  # samples of a stretch
_SMALL = 0.1  # of the range of the volume, up to which a step may be a quantum
_DECIMALS = 12  # of m3, that are not rounding


def steadied(time: Array, volume: Array) -> Array:
    """Return the volumes [m3] of a glide at times [s], made steady where the piston stands.

    In each such stretch the volume is its mean or, where it leaks by more than the sensor's noise
    and quantum explain, the straight line or the parabola that follows the leak.
    """
    result = volume.copy()
    step = quantum(volume)
    noise = 1.4826 * float(np.median(np.abs(np.diff(volume)))) / math.sqrt(2.0)
    limit = max(1.01 * step, _NOISE * noise, 10.0**-_DECIMALS)
    for first, last in _stands(volume, limit):
        t, v = time[first:last] - time[first:last].mean(), volume[first:last]
        for order in (0, 1, 2):
            smooth = np.polynomial.polynomial.polyval(
                t, np.polynomial.polynomial.polyfit(t, v, order)
            )
            if not _trend(v - smooth, step):
                break
        result[first:last] = smooth
    return result


def quantum(volume: Array) -> float:
    """Return the smallest step [m3] by which a standing volume jumps, 0 where there is none.

    A step counts where those before and after do not go the same way, as on a ramp, and where it is
    small beside all that the volume does.
    """
    steps = np.diff(np.round(volume, _DECIMALS))
    ahead, behind = np.append(steps[1:], 0.0), np.insert(steps[:-1], 0, 0.0)
    alone = (steps != 0.0) & (steps * ahead <= 0.0) & (steps * behind <= 0.0)
    sizes = np.abs(steps[alone])
    sizes = sizes[sizes <= _SMALL * np.ptp(volume)]
    return float(sizes.min()) if len(sizes) else 0.0


def _stands(volume: Array, limit: float) -> list[tuple[int, int]]:
    """Return the stretches (first, one past the last) in which the volume stands."""
    width = 2 * _HALF + 1
    if len(volume) < width:
        return []
    near = np.lib.stride_tricks.sliding_window_view(volume, width)
    quiet = np.zeros(len(volume) + 2, dtype=np.int8)
    quiet[1 + _HALF : 1 + _HALF + len(near)] = np.ptp(near, axis=-1) <= limit
    edges = np.flatnonzero(np.diff(quiet))
    found: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if found:
            first = max(first, found[-1][1])
        if last - first < width:
            continue
        level = float(np.median(volume[first : first + width]))
        while first > (found[-1][1] if found else 0) and abs(volume[first - 1] - level) <= limit:
            first -= 1
        level = float(np.median(volume[last - width : last]))
        while last < len(volume) and abs(volume[last] - level) <= limit:
            last += 1
        if last - first >= _FEWEST:
            found.append((first, last))
    return found


def _trend(away: Array, step: float) -> bool:
    """Say whether the residuals differ between thirds by more than noise and quantum do."""
    third = len(away) // 3
    means = [float(away[i * third : (i + 1) * third].mean()) for i in range(3)]
    noise = float(np.diff(away).std()) / math.sqrt(2.0)
    return max(means) - min(means) > max(1.1 * step, _SURE * noise / math.sqrt(third))


FEWEST = 12  # samples of an experiment


class Rules(NamedTuple):
    """Numbers that distinguish the phases; the first three are those of control.protocol."""

    minute: float = 60.0  # s, over which rest is judged
    rest_speed: float = 5e-4  # m/s
    rest_distance: float = 0.02  # m
    still_speed: float = 2e-3  # m/s, up to which a release is taken, and said to be hasty
    change: float = 3e-6  # m3, least change of volume that is one
    surface: float = 0.1  # m, where a glide upward is over
    bottom: float = math.inf  # m, where one downward is over
    margin: float = 0.05  # m, within which a vehicle that something stops does not move
    travel: float = 3.0  # m, after which a glide is over
    turns: bool = False  # whether the volume may be changed again under way, as plans have it
    least_travel: float = 0.3  # m, of an informative glide
    longest: float = 1200.0  # s, of a glide
    gap: float = 5.0  # s without a sample, which ends everything
    before: float = 3.0  # s of rest that an experiment's record begins with


_BLOCK = 5.0  # s; what the vehicle does in less than this is the sensor's noise
_WILD = 8.0  # robust standard deviations, beyond which a volume is a fault of its sensor


class Rest(NamedTuple):
    """A stretch of a log, judged as protocol.at_rest judges the last minute before a release."""

    time: float  # s, its end
    depth: float  # m, of its straight line at its end
    speed: float  # m/s, slope of that line
    spread: float  # m, rms of the depth about it, noise averaged out
    neutral: float  # m3, mean volume
    jitter: float  # m3, standard deviation of the volume


def stillness(time: Array, depth: Array) -> tuple[float, float, float]:
    """Return (speed [m/s], spread [m], depth at the end [m]) of a stretch of depths [m]."""
    t = time - time[0]
    middle, mean = float(t.mean()), float(depth.mean())
    from_middle = t - middle
    speed = float(from_middle @ depth) / float(from_middle @ from_middle)
    away = depth - mean - speed * from_middle
    blocks = (t / _BLOCK).astype(np.intp)
    count = np.bincount(blocks)
    sums = np.bincount(blocks, away)
    spread = math.sqrt(float((sums**2 / np.maximum(count, 1)).sum()) / len(t))
    return speed, spread, mean + speed * (float(t[-1]) - middle)


def neutral_volume(volume: Array) -> tuple[float, float]:
    """Return mean and standard deviation [m3] of the volumes, those that no piston had left out."""
    away = np.abs(volume - np.median(volume))
    limit = _WILD * 1.4826 * float(np.median(away))
    sane = volume if limit == 0.0 else volume[away <= limit]
    return float(sane.mean()), float(sane.std())


def settled(volume: Array, change: float) -> bool:
    """Say whether a stretch of volumes [m3] stands still, by the measure of a change [m3].

    The means of its halves agree to a tenth of the change, and it scatters by less than a fifth:
    a piston that a controller moves does not do so, one with a noisy sensor does.
    """
    half = len(volume) // 2
    moved = abs(float(np.median(volume[half:]) - np.median(volume[:half])))
    away = np.abs(volume - np.median(volume))
    kept = away <= np.sort(away)[-2] if len(away) > 5 else away >= 0.0  # one may be a fault
    scatter = float(volume[kept].std())
    return moved <= 0.1 * abs(change) and scatter <= 0.2 * abs(change)


class Sample(NamedTuple):
    """A row of a log."""

    time: float  # s
    depth: float  # m
    volume: float  # m3, of any zero


class End(Enum):
    """What ended an experiment."""

    TRAVEL = "it had gone far enough"
    SURFACE = "it reached the surface"
    BOTTOM = "it reached the bottom"
    STOPPED = "it was stopped, by the bottom it seems"
    PISTON = "the piston moved"
    GAP = "the log has a gap"
    LONG = "it took too long"
    LOG = "the log ended"


class Why(Enum):
    """Why a stretch of the log is no experiment."""

    NOT_AT_REST = "the volume was changed before the vehicle was at rest"
    NOT_SETTLED = "the volume did not stand still"
    SHORT = "the vehicle hardly moved"
    FEW_SAMPLES = "there are too few samples"
    STUCK = "the volume was changed and the vehicle did not move"


class Cut(NamedTuple):
    """An experiment, cut out of a log."""

    rest: Rest  # before it
    samples: tuple[Sample, ...]  # from a little before the release on
    released: float  # s
    change: float  # m3, of the volume, from the mean of the rest
    travel: float  # m, to the furthest point, positive down
    end: End
    turns: int = 0  # changes of volume under way

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns of a log that `identify` reads.

        The volume counts from where the vehicle was neutral: the mean over the minute of rest. So
        does its first row, since a log's first row is taken as neutral; what the piston did there,
        while it held the depth, is not: it jitters about that mean. While it stands: `steadied`.
        """
        time, depth, volume = np.array(self.samples).T
        glide = time >= self.released
        volume[glide] = steadied(time[glide], volume[glide])
        volume = volume - self.rest.neutral
        volume[0] = 0.0
        return {"time_s": time, "depth_m": depth, "volume_m3": volume}


class Ready(NamedTuple):
    """The vehicle has been at rest for a minute."""

    time: float  # s
    rest: Rest


class Changed(NamedTuple):
    """The volume was changed, and stands: an experiment is under way."""

    time: float  # s, of the release
    change: float  # m3
    rest: Rest


class Turned(NamedTuple):
    """The volume was changed again under way, and stands."""

    time: float  # s
    volume: float  # m3, above the one at rest


class Ended(NamedTuple):
    """An experiment is over."""

    time: float  # s
    cut: Cut


class Refused(NamedTuple):
    """A stretch of the log looks like an experiment and is none."""

    time: float  # s
    why: Why
    number: float  # m/s, m3, m or samples: by how much
    end: End | None = None


Event = Ready | Changed | Turned | Ended | Refused


_EARLY = 20  # lines, up to which a log that cannot be read may just not be there yet
_ENDS = (b"\n", b"\r")


class Growth(NamedTuple):
    """What a read of the file found. new: the log is another one than before."""

    samples: list[Sample]
    new: bool
    state: Literal["missing", "still", "grown"]


class GrowingLog:
    """Reads what a logger has written so far, in bursts, cut or begun anew as it may be.

    The whole of the file is read each time it has grown, by the same reader as everywhere, so that
    units, pressures and times mean what they mean elsewhere; only what is new is handed on. A last
    line without its end is left for later. A file that is cut is waited for: it may be written
    again; one that goes on differently is another log.
    """

    def __init__(
        self, path: Path, vehicle: Vehicle, *, columns: Mapping[str, str], log_format: LogFormat
    ) -> None:
        self.path, self.vehicle, self.columns = path, vehicle, dict(columns)
        self.log_format = log_format
        self.report: tuple[str, ...] = ()
        self.trouble: LogError | None = None
        self.cost = 0.0  # s, of the last reading
        self._data = b""
        self._known: NDArray[np.float64] = np.empty((0, 3))

    def read_new(self) -> Growth:
        """Return what is new; raises LogError where the file is no such log."""
        try:
            data = read_at_most(self.path, MOST_BYTES)
        except FileNotFoundError:
            return Growth([], False, "missing")
        except OSError as error:
            raise LogError(
                f"cannot be read: {error.strerror or error}", file=self.path, field="--follow",
                remedy="Check the path and its permissions",
            ) from error  # fmt: skip
        data = data[: max(data.rfind(end) for end in _ENDS) + 1]
        if data == self._data or self._data.startswith(data):
            return Growth([], False, "still")
        begin = perf_counter()
        other = not data.startswith(self._data)
        rows = self._rows(data)
        self.cost = perf_counter() - begin
        if rows is None:
            return Growth([], False, "grown")
        n = len(self._known)
        new = n > 0 and (other or len(rows) < n or not np.array_equal(rows[:n], self._known))
        self._data, self._known = data, rows
        return Growth([Sample(*row) for row in rows[0 if new else n :].tolist()], new, "grown")

    def _rows(self, data: bytes) -> NDArray[np.float64] | None:
        """Return all rows of the text; None where it is too short to be a log yet."""
        folder = temporary_folder(Path(tempfile.gettempdir()))
        try:
            copy = folder / self.path.name
            copy.write_bytes(data)
            try:
                log = read_log(copy, columns=self.columns, log_format=self.log_format)
                rows = samples_of(log, self.vehicle)
            except LogError as error:
                self.trouble = error.but(file=self.path)
                if data.count(b"\n") + data.count(b"\r") > _EARLY:
                    raise self.trouble from None
                return None
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self.trouble, self.report = None, log.report
        return rows


def samples_of(log: Log, vehicle: Vehicle) -> NDArray[np.float64]:
    """Return time [s], depth [m] and volume [m3] of a log as rows.

    Raises LogError where the log has no volume.
    """
    volume, area = log.volume, vehicle.piston_area
    if volume is None and log.piston is not None and area is not None:
        volume = log.piston * area
    if volume is None:
        raise LogError(
            "the log has no volume, so a change of it cannot be seen", file=log.source,
            field="volume_m3 or piston_m",
            remedy="Say which column it is with --column volume_m3=NAME@cm3 or piston_m=NAME@mm",
        )  # fmt: skip
    rows = np.column_stack([log.time, log.depth, volume])
    return rows[np.isfinite(rows).all(axis=1)]
