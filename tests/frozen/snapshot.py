"""Runs one case and makes of its answer and files what can be kept and compared.

Only the command line is called. What may differ from day to day, from machine to machine or
between two wordings is left out: prose, absolute paths, dates, versions, durations, pictures.
"""

import contextlib
import csv
import hashlib
import io
import json
import os
import re
import shutil
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from tests.frozen.cases import Case
from tests.frozen.renamed import COMMANDS, OPTIONS

INPUTS = Path(__file__).parent / "inputs"
PROSE = "<prose>"
MOST = 40  # values of a column, or of a list, that are kept
KEPT = "parts"  # folder of what is done already, for a run that goes on
WORDS = 4  # a text of more words is prose
# What differs between two runs of the same code.
VOLATILE = {
    "seconds",
    "created",
    "date_created",
    "date_modified",
    "version",
    "history",
    "id",
}
_DATE = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d\S*)?")
_COMMENT = re.compile(r'("(?:\\.|[^"\\])*")|//[^\n]*|/\*.*?\*/', re.DOTALL)


def run(case: Case) -> dict[str, Any]:
    """Return the snapshot of a case: {exit, answer, files}, in plain JSON."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        shutil.copytree(INPUTS, folder, dirs_exist_ok=True)
        inputs = {path.name for path in Path().iterdir()}
        for arguments in case.before:
            _call(arguments)
        code, out, err = _call((*case.arguments, "--json", *_out(case)))
        try:
            answer = json.loads(out)
        except ValueError:
            raise AssertionError(f"{case.name}: exit {code}, no JSON\n{out}\n{err}") from None
        assert code != 2, f"{case.name}: refused\n{err}"  # a refusal is not worth freezing
        files = {
            path.relative_to("out").as_posix(): _file(path, answer)
            for path in sorted(Path("out").rglob("*"))
            if path.is_file()
            and not {KEPT, "campaign.zarr"} & set(path.parts)  # named by a hash of all source
        }
        assert {p.name for p in Path().iterdir()} <= inputs | {"out", "before"}, case.name
    return {"exit": code, "answer": cleaned(answer), "files": files}


def _out(case: Case) -> tuple[str, ...]:
    return ("--out", "out") if case.files else ()


def _call(arguments: tuple[str, ...]) -> tuple[int, str, str]:
    from swimbladder.cli import main

    given = [OPTIONS.get(word, word) for word in arguments]
    given[0] = COMMANDS.get(given[0], given[0])
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), _pictures_small():
        code = main(given)
    return code, out.getvalue(), err.getvalue()


@contextlib.contextmanager
def _pictures_small():
    """Draw pictures coarsely: that they are written counts here, and drawing takes long."""
    import matplotlib as mpl

    with mpl.rc_context({"savefig.dpi": 20, "figure.dpi": 20}):
        yield


def cleaned(value: Any) -> Any:
    """Return JSON without prose, dates, versions and durations, long lists thinned."""
    if isinstance(value, dict):
        return {k: cleaned(v) for k, v in value.items() if k not in VOLATILE}
    if isinstance(value, list):
        return _list([cleaned(v) for v in value])
    if isinstance(value, str):
        return _text(value)
    return value


def _text(text: str) -> str:
    if len(text.split()) > WORDS or text.endswith("."):
        return PROSE
    if os.path.isabs(text):
        return Path(text).name
    return _DATE.sub("<date>", text)


def _list(values: list[Any]) -> Any:
    if values and all(value == PROSE for value in values):
        return PROSE
    if len(values) <= MOST:
        return values
    kept = {"count": len(values), "every": _every(len(values)), "kept": _thinned(values)}
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        kept["sum"], kept["largest"] = sum(values), max(map(abs, values))
    return kept


def _every(count: int) -> int:
    return max(1, -(-count // MOST))


def _thinned(values: list[Any]) -> list[Any]:
    """Return every so many-th value, and the last."""
    every = _every(len(values))
    return values[::every] + ([values[-1]] if (len(values) - 1) % every else [])


def _file(path: Path, answer: Any) -> Any:
    if path.name == "golden.csv":  # to the byte
        return path.read_text(encoding="ascii").splitlines()
    if path.suffix == ".csv":
        return _table(path.read_text(encoding="utf-8"))
    if path.suffix == ".toml":
        return cleaned(tomllib.loads(path.read_text(encoding="utf-8")))
    if path.suffix == ".json":
        held = json.loads(path.read_text(encoding="utf-8"))
        same = held == {k: v for k, v in answer.items() if k in held}
        return "as the answer" if same else cleaned(held)
    if path.suffix == ".nc":
        return _netcdf(path)
    if path.suffix in (".c", ".h", ".ino"):
        code = code_of(path.read_text(encoding="utf-8"))
        return {"sha256": hashlib.sha256(code.encode()).hexdigest(), "code": code.split("\n")}
    return None


def code_of(text: str) -> str:
    """Return C without its comments and empty lines."""
    bare = _COMMENT.sub(lambda found: found[1] or " ", text)
    return "\n".join(" ".join(line.split()) for line in bare.splitlines() if line.strip())


def _table(text: str) -> Any:
    """Return a CSV file column by column, numbers as numbers, thinned."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    columns = zip(*rows, strict=True) if rows else [()] * len(head)
    return {
        "rows": len(rows),
        "columns": {
            name: _list([_cell(cell) for cell in column])
            for name, column in zip(head, columns, strict=True)
            if name not in VOLATILE
        },
    }


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return _text(text)


def _netcdf(path: Path) -> Any:
    import xarray

    with xarray.open_dataset(path, decode_times=False) as data:
        return {
            "sizes": {str(name): size for name, size in data.sizes.items()},
            "attributes": cleaned({str(k): _plain(v) for k, v in data.attrs.items()}),
            "variables": {
                str(name): {
                    "dims": [*map(str, variable.dims)],
                    "units": str(variable.attrs.get("units", "")),
                    "standard_name": str(variable.attrs.get("standard_name", "")),
                    "values": _list([cleaned(_plain(v)) for v in variable.values.ravel()]),
                }
                for name, variable in data.variables.items()
            },
        }


def _plain(value: Any) -> Any:
    item = value.item() if getattr(value, "ndim", 1) == 0 else value
    if isinstance(item, bytes):
        return item.decode()
    return item if isinstance(item, str | int | float) else str(item)
