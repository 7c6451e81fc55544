"""The page of an answer that has no page of its own: what it says, its figures, its numbers."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from swimbladder.show.report.html import page_figure, render
from swimbladder.units import rounded

_DIGITS = 6


def answer_page(
    title: str,
    sentences: Sequence[str],
    numbers: Mapping[str, Any],
    figures: Mapping[str, Figure],
    about: Mapping[str, Any],
) -> str:
    """Return a report as HTML that needs nothing but itself.

    numbers: those of `to_dict`; about: `command` that made it, `files` beside it, what was assumed,
    and whether the answer is a yes.
    """
    context = {"good": True, "files": (), "command": "", "assumptions": (), **about}
    context |= {
        "title": title,
        "sentences": sentences,
        "figures": [page_figure(name, made) for name, made in figures.items()],
        "numbers": list(_flat(numbers)),
    }
    return render("answer.html.j2", context)


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Give the single values of an answer with their names; long lists stay in the JSON."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{name}.{key}" if name else str(key))
    elif isinstance(value, bool):
        yield name, "yes" if value else "no"
    elif isinstance(value, (int, float)):
        yield name, rounded(value, _DIGITS) if isinstance(value, float) else str(value)
    elif isinstance(value, str):
        yield name, value
