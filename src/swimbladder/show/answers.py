"""Answers as lines of text, as HTML for a notebook, and as a picture."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import escape

from swimbladder.errors import NoAnswerError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swimbladder.io.answers import Answer

_LINES, _WIDTH = 15, 100
_ROOM = "swimbladder"


class _Shown(NamedTuple):
    """Functions of an answer, by module and name: its picture, and its words where it has none."""

    picture: str = ""
    words: str = ""


# By the class of the answer.
_ANSWERS = {
    "ActuatorIdentification": _Shown(
        "show.plots.identify_actuator.draw_speeds", "show.report.actuator_text.headlines"
    ),
    "Analysis": _Shown("show.plots.linear.draw_open_loop"),
    "Ballasting": _Shown("show.plots.ballast.draw_ballasting"),
    "BoardAnswer": _Shown(),
    "Campaign": _Shown("show.plots.campaign.draw_campaign"),
    "Comparison": _Shown("show.plots.comparison.draw_comparison"),
    "DeepIdentification": _Shown("show.plots.deep.draw_deep"),
    "Design": _Shown("show.plots.design.draw_design", "show.report.design.headlines"),
    "Energy": _Shown("show.plots.energy.draw_energy"),
    "FaultResult": _Shown("show.plots.faults.draw_campaign"),
    "Identification": _Shown("show.plots.identify.draw_fits", "show.report.text.headlines"),
    "LawComparison": _Shown("show.plots.law_comparison.draw_pareto"),
    "Library": _Shown("show.plots.firmware.draw_golden"),
    "MissionResult": _Shown("show.plots.mission.draw_mission"),
    "Plan": _Shown("show.plots.plan.draw_plan"),
    "PumpFit": _Shown("show.plots.energy.draw_fit", "design.energy.messages.fit_sentences"),
    "Sizing": _Shown("show.plots.size.draw_candidates"),
    "Solution": _Shown("show.plots.solution.draw_solution"),
    "Stability": _Shown("show.plots.stability.draw_recovery"),
    "Tuning": _Shown("show.plots.tune.draw_tuning"),
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
        more = f"... ({len(lines) - _LINES + 2} lines more)"
        lines = [*lines[: _LINES - 2], more]
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


def _named(path: str) -> Any:
    module, _, name = path.rpartition(".")
    return getattr(import_module(f"{_ROOM}.{module}"), name)


def _wrapped(sentence: str) -> Iterator[str]:
    for line in sentence.splitlines():
        yield from textwrap.wrap(line, _WIDTH - 2, initial_indent="  ", subsequent_indent="    ")
