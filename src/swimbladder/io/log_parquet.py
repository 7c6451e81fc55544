"""A log in a Parquet file: its columns by name, as numbers or as texts."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_rows import Column
from swimbladder.io.log_text import LogFile

if TYPE_CHECKING:
    import pandas as pd

_TEXT_OPTIONS = (
    "encoding", "delimiter", "header_starts", "names", "skip_lines", "units_row", "skip_rows",
    "fields", "part",
)  # fmt: skip


def is_parquet(data: bytes, file: LogFile) -> bool:
    """Say whether the bytes of a file are Parquet.

    Raises LogError where its name says so and its bytes do not.
    """
    if data.startswith(b"PAR1") and data.endswith(b"PAR1"):
        return True
    if Path(file.path).suffix == ".parquet":
        raise file.refused(
            "this is not Parquet, or not all of it",
            field="file",
            remedy="Write the file anew; a CSV has another suffix",
        )
    return False


class ParquetRows:
    """The rows of a Parquet file: a `Sheet`, whose lines are rows counted from 1."""

    def __init__(self, data: bytes, file: LogFile) -> None:
        """Read the names of the columns.

        Raises LogError where pyarrow is not installed, the file is damaged, or the format has
        options that are for texts.
        """
        if importlib.util.find_spec("pyarrow") is None:
            raise file.refused(
                "reading Parquet needs the library pyarrow",
                field="file",
                remedy='Type pip install "swimbladder[parquet]", or write the log as CSV',
            )
        for name in _TEXT_OPTIONS:
            value = getattr(file.form, name)
            if name in file.form.model_fields_set and value:
                raise file.refused(
                    "this option is for texts, and the log is Parquet",
                    field=name,
                    value=value,
                    remedy="Leave it out of the [log] table",
                )
        import pyarrow.parquet

        self.file, self._data = file, data
        self.units: dict[str, str] = {}
        self.parts = 1
        try:
            self.header = [str(n) for n in pyarrow.parquet.read_schema(io.BytesIO(data)).names]
        except Exception as error:
            raise self._damaged(error) from None

    def take(self, names: Collection[str]) -> tuple[NDArray[np.int64], dict[str, Column]]:
        """Return the number of each row, and the columns of these names.

        Raises LogError where the file is damaged.
        """
        import pyarrow.parquet

        try:
            table = pyarrow.parquet.read_table(io.BytesIO(self._data), columns=list(names))
            columns = {name: _column(table.column(name).to_pandas()) for name in names}
        except Exception as error:
            raise self._damaged(error) from None
        return np.arange(1, table.num_rows + 1), columns

    def _damaged(self, error: Exception) -> LogError:
        # whatever a decoder makes of damaged bytes, it is the bytes that are wrong
        return self.file.refused(
            f"this Parquet file cannot be read: {' '.join(str(error).split())[:200]}",
            field="file",
            remedy="Write the file anew, or as CSV",
        )


def _column(series: pd.Series[Any]) -> Column:
    """Return numbers as floats, durations in seconds, instants as ISO 8601, all else as texts."""
    kind = getattr(series.dtype, "kind", "O")
    if kind in "biufm":
        numbers = series.dt.total_seconds() if kind == "m" else series
        floats: NDArray[np.float64] = numbers.to_numpy(dtype=np.float64, na_value=np.nan)
        return floats
    if kind == "M":
        return [
            instant.isoformat() if known else ""
            for instant, known in zip(series, series.notna(), strict=True)
        ]
    return ["" if value is None else str(value) for value in series]
