"""Answers as lines of text, as HTML for a notebook, as a page, as tables and as files."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from swimbladder.errors import NoAnswerError
from swimbladder.io.answers import json_text
from swimbladder.io.files import (
    check_place,
    make_folder,
    publish,
    write_atomically,
    write_csv,
)
from swimbladder.io.netcdf import cf_dataset, described, meaning
from swimbladder.io.progress import Advance, silent
from swimbladder.show.parts import REPORT, Drawn, Gone, Part, Shown, Table, sentences, written_by
from swimbladder.show.picture import Picture
from swimbladder.show.text import Output, shortened, text_lines

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from swimbladder.io.answers import Answer


def write_all(
    out: Path, contents: Mapping[str, object], *, advance: Advance = silent
) -> list[Path]:
    """Write files into the folder `out`, all of them or none, and return their paths.

    contents: by name, below the folder: a text; a figure; the columns of a name that ends with
    .csv; the answer of one that ends with .json; or what writes the file, called with its path; or
    `Gone`. advance: called with each file's share of the work. Raises InputError where the folder
    cannot be written.
    """
    made = {name: content for name, content in contents.items() if not isinstance(content, Gone)}

    def write(folder: Path) -> None:
        """Write every file into the folder, with the folders that its name has."""
        for name, content in made.items():
            make_folder((folder / name).parent)
            _write(folder / name, content)
            advance(1.0 / len(made))

    check_place(out)
    publish(out, write)
    for pattern, gone in contents.items():
        if isinstance(gone, Gone):
            stale = {*out.glob(pattern)} - {out / name for name in made}
            for path in stale:
                if not gone.head or written_by(path, gone.head):
                    path.unlink()
    return [out / name for name in made]


def _write(path: Path, content: Any) -> None:
    if isinstance(content, Picture):
        from swimbladder.show.static import save

        save(content, path)
    elif isinstance(content, str | bytes):
        write_atomically(path, content)
    elif callable(content):
        content(path)
    elif path.suffix == ".json":
        write_atomically(path, json_text(content) + "\n")
    else:
        write_csv(path, content)


_WIDTH = 98
_UNITS = frozenset(["m", "m2", "m3", "s", "V", "A", "W", "J", "Pa", "kg", "N", "rad", "degC", "h"])

# Where each class of answer is shown, by a class of its name and Shown.
ROOMS = {
    "ActuatorIdentification": "actuator",
    "Analysis": "analysis",
    "Ballasting": "ballast",
    "BoardAnswer": "firmware",
    "Campaign": "campaign",
    "Comparison": "comparison",
    "DeepIdentification": "identification",
    "Design": "design",
    "Energy": "energy",
    "FaultResult": "faults",
    "Identification": "identification",
    "LawComparison": "law_comparison",
    "Library": "firmware",
    "MissionResult": "mission",
    "Plan": "plan",
    "PoolDay": "pool",
    "PumpFit": "energy",
    "Sizing": "size",
    "Solution": "solution",
    "Stability": "stability",
    "Tuning": "tune",
    "Vehicle": "vehicle",
}


def shown(answer: object) -> Shown[Any]:
    """Return an answer as it is shown."""
    name = type(answer).__name__
    room = import_module(f"swimbladder.show.{ROOMS[name]}")
    made: Shown[Any] = getattr(room, f"{name}Shown")(answer)
    return made


def text(answer: Answer) -> str:
    """Return an answer as text of 15 lines at most."""
    paper = Output(width=_WIDTH, color_system=None, highlight=False, markup=False, emoji=False)

    def lines(part: Part) -> list[str]:
        """Return a part's lines, indented; tables are not wrapped."""
        printed = text_lines(part, paper)
        if isinstance(part, Table):
            return [f"  {line}" for line in printed]
        how = {"initial_indent": "  ", "subsequent_indent": "    "}
        return [row for line in printed for row in textwrap.wrap(line, _WIDTH, **how)]  # type: ignore[arg-type]

    said = shortened(shown(answer).parts(), lines, room=14, left="... ({} more)")
    return "\n".join([type(answer).__name__, *said])


def html(answer: Answer) -> str:
    """Return an answer as HTML for a notebook: what it says, then its tables."""
    from swimbladder.show.html import table_html

    parts = list(shown(answer).parts())
    said = Markup("").join(Markup("<li>{}</li>").format(one) for one in sentences(parts))
    drawn = Markup("").join(table_html(part) for part in parts if isinstance(part, Table))
    return Markup("<div><b>{}</b><ul>{}</ul>{}</div>").format(type(answer).__name__, said, drawn)


def figure(answer: Answer) -> Figure:
    """Return the first picture of an answer; raises NoAnswerError where it has none."""
    first = next(shown(answer).drawn(), None)
    if first is None:
        raise NoAnswerError(f"{type(answer).__name__} has no picture: its numbers are in to_dict()")
    from swimbladder.show.static import figure as drawn_figure

    return drawn_figure(first.draw())


def dataframe(answer: Answer) -> pd.DataFrame:
    """Return the main table of an answer; raises NoAnswerError where it has none."""
    return frame_of(shown(answer).table())


def dataset(answer: Answer) -> xr.Dataset:
    """Return the arrays of an answer; raises NoAnswerError where it has none."""
    own = getattr(answer, "dataset", None)
    made: xr.Dataset = own() if own else dataset_of(dataframe(answer), shown(answer).title)
    return made


def frame_of(table: Mapping[str, Any] | str) -> pd.DataFrame:
    """Return columns, or a table as CSV, as a DataFrame.

    The units of the columns, as UDUNITS writes them, stand in its `attrs["units"]`.
    """
    import pandas

    if isinstance(table, str):
        found = pandas.read_csv(io.StringIO(table))
    else:
        found = pandas.DataFrame({name: np.asarray(column) for name, column in table.items()})
    found.attrs["units"] = {name: unit for name, (_, unit) in split(found.columns) if unit}
    return found


def dataset_of(frame: pd.DataFrame, title: str) -> xr.Dataset:
    """Return a table as a Dataset: arrays without the unit in their names, which is an attribute.

    They lie along the first column where its numbers only rise, else along the rows.
    """
    names = dict(split(frame.columns))
    first = frame[frame.columns[0]]
    rises = first.dtype.kind in "if" and bool(np.all(np.diff(first) > 0.0))
    along = names[frame.columns[0]][0] if rises else "row"
    arrays = {
        name: (along, frame[column].to_numpy(), _meaning(name, unit, axis=name == along))
        for column, (name, unit) in names.items()
    }
    return cf_dataset(arrays, described(title), coordinates=[along] if rises else [])


def _meaning(name: str, unit: str, *, axis: bool) -> dict[str, Any]:
    if axis and (name, unit) == ("time", "s"):
        from swimbladder.sim.closed_loop.solution import time_of_run

        return time_of_run()
    down = {"standard_name": "depth", "positive": "down"} if name == "depth" else {}
    return meaning(unit, name.replace("_", " "), **down)


def split(columns: Any) -> Iterator[tuple[str, tuple[str, str]]]:
    """Give each column's name with its name and its unit apart: rate_m3_s is a rate in m3 s-1."""
    for column in map(str, columns):
        words = column.split("_")
        end = len(words)
        while end > 1 and words[end - 1] in _UNITS:
            end -= 1
        unit = " ".join([*words[end : end + 1], *(f"{word}-1" for word in words[end + 1 :])])
        yield column, ("_".join(words[:end]), unit.replace("m3-1", "m-3").replace("m2-1", "m-2"))


def save(answer: Answer, folder: Path) -> list[Path]:
    """Write the files of an answer into a folder; return the paths."""
    return write(shown(answer), folder)


def write(
    shown: Shown[Any],
    folder: Path,
    command: str = "",
    advance: Advance = silent,
    also: Sequence[Path] = (),
) -> list[Path]:
    """Write the files of an answer and its page into a folder; return the paths.

    command: how the page says that it was made; advance: called with each share of the work; also:
    what is there already.
    """
    own = [*also, *shown.before(folder)]
    names = [path.relative_to(folder).as_posix() for path in own]
    return write_all(folder, contents(shown, command, advance, names)) + own


def contents(
    shown: Shown[Any], command: str = "", advance: Advance = silent, also: Sequence[str] = ()
) -> Mapping[str, object]:
    """Return the contents of the files of an answer, by name, its page first; see `write`."""
    from swimbladder.show.html import answer_page

    parts = list(shown.parts())
    listed = [part for part in parts if isinstance(part, Drawn)]
    figures = {}
    for part in listed:
        figures[part.name] = part.draw()
        advance(1.0 / len(listed))
    files: dict[str, object] = {f"{shown.name}.json": shown.numbers(), **shown.files()}
    if shown.pictures:
        files |= {f"{shown.folder}{name}.png": made for name, made in figures.items()}
    files |= shown.more
    names = [*also, *(name for name, made in files.items() if not isinstance(made, Gone))]
    return {REPORT: answer_page(shown, parts, figures, names, command), **files}


def report(answer: Answer, path: Path) -> Path:
    """Write the page of an answer; return its path."""
    write_atomically(path, str(contents(shown(answer))[REPORT]))
    return path
