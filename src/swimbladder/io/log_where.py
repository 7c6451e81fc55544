"""Which rows of a log hold what is asked for, and what a text says as a number."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import LogError
from swimbladder.io.log_format import LogFormat
from swimbladder.io.log_rows import Column


def number(text: str, *, comma: bool) -> float:
    """Return a text as a number; raises ValueError where it is none."""
    if "_" in text or (comma and "." in text):
        raise ValueError(text)
    return float((text.replace(",", ".") if comma else text).replace("−", "-"))


def column_texts(column: Column) -> list[str]:
    """Return a column as texts, numbers as Python writes them."""
    return column if isinstance(column, list) else [repr(value) for value in column.tolist()]


class RowTest:
    """Whether rows hold a value in a column, as a number where both are numbers."""

    def __init__(
        self, path: str | Path, header: list[str], name: str, value: str | float, form: LogFormat
    ) -> None:
        if header.count(name) != 1:
            raise LogError(
                "no such column to choose rows by" if name not in header else "two such columns",
                file=path,
                field="where",
                value=name,
                remedy=f"Columns of the file: {', '.join(header[:30])}",
            )
        self.name, self._text = name, str(value).strip()
        self._comma = form.decimal == ","
        try:
            self._number: float | None = float(value)
        except ValueError:
            self._number = None

    def of(self, column: Column) -> NDArray[np.bool_]:
        """Return for each row whether it holds the value."""
        if not isinstance(column, list):
            return np.isin(column, [] if self._number is None else [self._number])
        return np.array([self._same(text.strip()) for text in column], dtype=bool)

    def _same(self, text: str) -> bool:
        if text == self._text or self._number is None:
            return text == self._text
        try:
            return number(text, comma=self._comma) == self._number
        except ValueError:
            return False


def none_chosen(
    path: str | Path, total: int, where: Mapping[str, str | float], columns: Mapping[str, Column]
) -> LogError:
    """Return the error for a log of which no row is left, with what the column holds."""
    found = list(dict.fromkeys(text.strip() for text in column_texts(columns[next(iter(where))])))
    choices = ", ".join(text[:40] for text in found[:40]) + (", ..." if len(found) > 40 else "")
    return LogError(
        f"none of {total} rows is chosen",
        file=path,
        field="where",
        value=", ".join(f"{name}={value}" for name, value in where.items()),
        remedy=f"Choose one of: {choices}",
    )
