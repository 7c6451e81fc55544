"""Answers as lines of text, as HTML for a notebook, and as a picture."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import escape
from matplotlib.figure import Figure

from swimbladder.errors import NoAnswerError
from swimbladder.io.files import write_atomically
from swimbladder.show import tables
from swimbladder.show.files import write_all
from swimbladder.show.report.html import REPORT
from swimbladder.show.report.page import answer_page

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from swimbladder.io.answers import Answer

_LINES, _WIDTH = 15, 100
_ROOM = "swimbladder"


class _Shown(NamedTuple):
    """Functions of an answer, by module and name; each may be missing.

    picture; words: where it has no sentences; files: what they hold, from itself, its numbers
    and, where they take one, the command that made it; writes: that writes them itself; page: its
    report, where it has one of its own that is not among its files; table: its main table, a
    method of its own where a dot stands before the name.
    """

    picture: str = ""
    words: str = ""
    files: str = ""
    writes: str = ""
    page: str = ""
    table: str = ".columns"


# By the class of the answer.
_ANSWERS = {
    "ActuatorIdentification": _Shown(
        picture="show.plots.identify_actuator.draw_speeds",
        words="show.report.actuator_text.headlines",
        writes="show.report.actuator.save_actuator",
        page="show.report.actuator.page",
    ),
    "Analysis": _Shown(
        picture="show.plots.linear.draw_open_loop",
        files="show.report.analysis.analysis_files",
        table="show.tables.response_columns",
    ),
    "Ballasting": _Shown(
        picture="show.plots.ballast.draw_ballasting",
        files="show.report.ballast.ballast_files",
        table="show.report.ballast.columns",
    ),
    "BoardAnswer": _Shown(table=""),
    "Campaign": _Shown(
        picture="show.plots.campaign.draw_campaign",
        files="show.report.campaign.campaign_files",
        table=".by_float",
    ),
    "Comparison": _Shown(
        picture="show.plots.comparison.draw_comparison",
        files="show.report.comparison.comparison_files",
    ),
    "DeepIdentification": _Shown(
        picture="show.plots.deep.draw_deep",
        writes="show.report.deep.save_deep",
        table="show.report.deep.columns",
    ),
    "Design": _Shown(
        picture="show.plots.design.draw_design",
        words="show.report.design.headlines",
        files="show.report.design.design_files",
        table="show.tables.release_columns",
    ),
    "Energy": _Shown(
        picture="show.plots.energy.draw_energy", files="show.report.energy.energy_files"
    ),
    "FaultResult": _Shown(
        picture="show.plots.faults.draw_campaign",
        files="show.report.faults.fault_files",
        table="sim.faults.single_mission.missions_csv",
    ),
    "Identification": _Shown(
        picture="show.plots.identify.draw_fits",
        words="show.report.text.headlines",
        writes="show.report.identification.save_identification",
        page="show.report.identification.report_page",
        table="show.report.identification.residuals",
    ),
    "LawComparison": _Shown(
        picture="show.plots.law_comparison.draw_pareto",
        files="show.report.law_comparison.comparison_files",
        table="show.report.law_comparison.table_csv",
    ),
    "Library": _Shown(
        picture="show.plots.firmware.draw_golden",
        writes="codegen.library.write_library",
        table="show.tables.golden_columns",
    ),
    "MissionResult": _Shown(
        picture="show.plots.mission.draw_mission",
        files="show.report.mission.mission_files",
        table="sim.mission.tables.trajectory_columns",
    ),
    "Plan": _Shown(picture="show.plots.plan.draw_plan", files="show.report.plan.plan_files"),
    "PumpFit": _Shown(
        picture="show.plots.energy.draw_fit",
        words="design.energy.messages.fit_sentences",
        files="show.report.energy.fit_files",
        table="design.energy.fit.run_columns",
    ),
    "Sizing": _Shown(
        picture="show.plots.size.draw_candidates",
        files="show.report.size.sizing_files",
        table="design.sizing.run.columns",
    ),
    "Solution": _Shown(
        picture="show.plots.solution.draw_solution", files="show.report.solution.solution_files"
    ),
    "Stability": _Shown(
        picture="show.plots.stability.draw_recovery",
        files="show.report.stability.stability_files",
        table="show.tables.map_columns",
    ),
    "Tuning": _Shown(
        picture="show.plots.tune.draw_tuning",
        files="show.report.tune.tuning_files",
        table="show.tables.gain_columns",
    ),
}


def sentences(answer: Answer) -> Sequence[str]:
    """Return what an answer says, the answer itself first."""
    how = _ANSWERS[type(answer).__name__].words
    said: Any = _named(how)(answer) if how else getattr(answer, "sentences")  # noqa: B009
    return [str(sentence) for sentence in said if str(sentence).strip()]


def text(answer: Answer) -> str:
    """Return an answer as text of 15 lines at most."""
    lines = [line for sentence in sentences(answer) for line in _wrapped(sentence)]
    if len(lines) > _LINES - 1:
        lines = [*lines[: _LINES - 2], f"... ({len(lines) - _LINES + 2} lines more)"]
    return "\n".join([type(answer).__name__, *lines])


def html(answer: Answer) -> str:
    """Return an answer as HTML for a notebook."""
    said = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences(answer))
    return f"<div><b>{type(answer).__name__}</b><ul>{said}</ul></div>"


def figure(answer: Answer) -> Figure:
    """Return the picture of an answer; raises NoAnswerError where it has none."""
    how = _ANSWERS[type(answer).__name__].picture
    if not how:
        raise NoAnswerError(f"{type(answer).__name__} has no picture: its numbers are in to_dict()")
    drawn: Figure = _named(how)(answer)
    return drawn


def dataframe(answer: Answer) -> pd.DataFrame:
    """Return the main table of an answer; raises NoAnswerError where it has none."""
    how = _ANSWERS[type(answer).__name__].table
    if not how:
        raise NoAnswerError(f"{type(answer).__name__} has no table: its numbers are in to_dict()")
    table = getattr(answer, how[1:])() if how.startswith(".") else _named(how)(answer)
    return tables.dataframe(table)


def dataset(answer: Answer) -> xr.Dataset:
    """Return the arrays of an answer; raises NoAnswerError where it has none."""
    own = getattr(answer, "dataset", None)
    made: xr.Dataset = own() if own else tables.dataset(dataframe(answer), _title(answer))
    return made


def save(answer: Answer, folder: Path) -> list[Path]:
    """Write the files of an answer into a folder; return the paths."""
    how = _ANSWERS[type(answer).__name__]
    if how.writes:
        return list(_named(how.writes)(answer, folder))
    return write_all(folder, contents(answer, answer.to_dict()))


def contents(answer: Answer, numbers: Mapping[str, Any], command: str = "") -> Mapping[str, object]:
    """Return the contents of the files of an answer, by name.

    numbers: its own, of `to_dict`; command: how a report says that it was made.
    """
    how = _ANSWERS[type(answer).__name__]
    made: dict[str, object] = {f"{type(answer).__name__.lower()}.json": numbers}
    if how.files:
        make = _named(how.files)
        given = {"command": command} if "command" in signature(make).parameters else {}
        made = dict(make(answer, numbers, **given))
    return made if REPORT in made else with_page(answer, numbers, made, command)


def with_page(
    answer: Answer, numbers: Mapping[str, Any], files: Mapping[str, object], command: str = ""
) -> dict[str, object]:
    """Return the contents of files, by name, with the page of the answer before them."""
    return {REPORT: page(answer, numbers, files, command), **files}


def report(answer: Answer, path: Path) -> Path:
    """Write the page of an answer; return its path."""
    own = _ANSWERS[type(answer).__name__].page
    made = _named(own)(answer) if own else contents(answer, answer.to_dict())[REPORT]
    write_atomically(path, str(made))
    return path


def page(
    answer: Answer,
    numbers: Mapping[str, Any],
    files: Mapping[str, object] = MappingProxyType({}),
    command: str = "",
) -> str:
    """Return the page of an answer that has none of its own: its words, figures and numbers.

    files: what is written beside it, by name; the figures among them are shown, else its picture.
    """
    figures = {Path(name).stem: made for name, made in files.items() if isinstance(made, Figure)}
    if not figures and _ANSWERS[type(answer).__name__].picture:
        with suppress(NoAnswerError):
            figures = {_kind(answer): figure(answer)}
    about = {
        "command": command,
        "files": list(files),
        "assumptions": getattr(answer, "assumptions", ()),
        "good": all(getattr(answer, name, True) for name in _GOOD),
    }
    return answer_page(_title(answer), sentences(answer), numbers, figures, about)


def _title(answer: Answer) -> str:
    """Return what a page is called: the vehicle and what was asked."""
    flown = getattr(answer, "flight", getattr(answer, "task", answer))
    vehicle = getattr(flown, "result_vehicle", getattr(flown, "vehicle", ""))
    name = getattr(vehicle, "name", vehicle)
    return f"{name}: {_kind(answer)}" if name else _kind(answer).capitalize()


def _kind(answer: Answer) -> str:
    """Return what an answer is, in words."""
    name = type(answer).__name__
    return _KINDS.get(name, re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())


_GOOD = ("completed", "covered", "equal", "finished", "identified", "within_depth_limit")
_KINDS = {
    "BoardAnswer": "hardware in the loop",
    "DeepIdentification": "deep",
    "FaultResult": "faults",
    "Library": "firmware",
    "MissionResult": "mission",
    "Solution": "simulation",
}


def _named(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(import_module(f"{_ROOM}.{module}"), name)


def _wrapped(sentence: str) -> Iterator[str]:
    for line in sentence.splitlines():
        yield from textwrap.wrap(line, _WIDTH - 2, initial_indent="  ", subsequent_indent="    ")
