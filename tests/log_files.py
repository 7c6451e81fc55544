"""Logs written for a test, and the refusals that they meet."""

from pathlib import Path

import pytest

from swimbladder.errors import LogError
from swimbladder.io.log_format import LogFormat, log_format
from swimbladder.io.logs import read_log


def write(folder: Path, text: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refused(path: Path, **options) -> LogError:
    """Return the error that reading a log ends in; it names the file, the place and a remedy."""
    with pytest.raises(LogError) as caught:
        read_log(path, **options)
    assert str(caught.value.file) == str(path)
    assert caught.value.field
    assert caught.value.remedy
    return caught.value


def table(folder: Path, lines: str) -> LogFormat:
    """Return the format of a ``[log]`` table."""
    return log_format(write(folder, f"[log]\n{lines}\n", "form.toml"))
