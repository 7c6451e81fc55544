"""A log that grows: what is new in it since it was last read."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.pool_day.segments import Sample
from swimbladder.errors import LogError
from swimbladder.io.files import read_at_most, temporary_folder
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_text import MOST_BYTES
from swimbladder.io.logs import Log, read_log
from swimbladder.vehicle import Vehicle

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
            what = f"cannot be read: {error.strerror or error}"
            remedy = "Check the path and its permissions"
            raise LogError(what, file=self.path, field="--follow", remedy=remedy) from error
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
        what = "the log has no volume, so a change of it cannot be seen"
        field = "volume_m3 or piston_m"
        remedy = "Say which column it is with --column volume_m3=NAME@cm3 or piston_m=NAME@mm"
        raise LogError(what, file=log.source, field=field, remedy=remedy)
    rows = np.column_stack([log.time, log.depth, volume])
    return rows[np.isfinite(rows).all(axis=1)]
