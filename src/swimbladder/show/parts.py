"""What an answer says, in one place for terminal, notebook, page and files."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar, dataclass_transform

from swimbladder.errors import NoAnswerError

if TYPE_CHECKING:
    from swimbladder.show.picture import Picture


REPORT = "report.html"
"""The name of the page of every answer."""


class Labelled(NamedTuple):
    """A sentence with what it is: no (the answer is), warning, note, assumed, cast."""

    label: str
    sentence: str

    def __str__(self) -> str:
        """Return it as it is printed."""
        return self.sentence if self.label == "no" else f"{self.label}: {self.sentence}"


def labelled(label: str, sentences: Iterable[str]) -> list[Labelled]:
    """Return sentences with what they are."""
    return [Labelled(label, sentence) for sentence in sentences]


def severity(findings: Iterable[Any], kind: str) -> list[Labelled]:
    """Return the findings that are of one kind: no, warning or note."""
    return labelled(kind, (f.sentence for f in findings if f.severity == kind))


@dataclass(frozen=True)
class Table:
    """Rows of texts under headings.

    left: headings of columns of words, else the first; its names are not broken then. about: what
    each row is, for which a page has room. later: it is not among the first lines that are printed.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: Collection[str] | None = None
    title: str = ""
    about: Sequence[str] = ()
    later: bool = False

    def is_left(self, column: int) -> bool:
        """Whether a column holds words."""
        return column == 0 if self.left is None else self.headings[column] in self.left


class Drawn(NamedTuple):
    """A figure: its name, how it is drawn, what texts.toml says of it, of which part it is."""

    name: str
    draw: Callable[[], Picture]
    about: str = ""
    part: str = ""


class Gone(NamedTuple):
    """No file: those that match are taken away, if they begin with a head, as a comment."""

    head: str = ""


def written_by(path: Path, head: str) -> bool:
    """Whether a file begins with this head, as a comment: it is not somebody else's."""
    from swimbladder.io.config import file_text

    return path.is_file() and file_text(path).startswith(f"# {head}")


Part = str | Labelled | Table | Drawn
A = TypeVar("A")


@dataclass_transform(kw_only_default=True, field_specifiers=(field,))
class _Record:
    """What makes its kinds dataclasses, their fields keywords."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclass(eq=False, repr=False, kw_only=True)(cls)


class Shown(_Record, Generic[A]):
    """An answer as it is shown: its parts, the most important first, and its files.

    name: of its JSON file; kind: what it is, in words, where not that; pictures: whether the
    figures are files too, in `folder`; template: of its page; more: contents
    of more files, by name.
    """

    found: A = field(kw_only=False)
    pictures: bool = True
    more: Mapping[str, object] = field(default_factory=dict)

    name = ""
    kind = ""
    folder = ""
    template = "answer.html.j2"

    def parts(self) -> Iterable[Part]:
        """Return what is printed and drawn, the most important first."""
        raise NotImplementedError

    def files(self) -> Mapping[str, object]:
        """Return the contents of the files beside numbers, figures and page, by name."""
        return {}

    def table(self) -> Any:
        """Return the columns of the main table, or that as CSV."""
        own = getattr(self.found, "columns", None)
        if own is None:
            what = f"{type(self.found).__name__} has no table: its numbers are in to_dict()"
            raise NoAnswerError(what)
        return own()

    def numbers(self) -> Mapping[str, Any]:
        """Return the numbers, SI."""
        own: Any = self.found
        found: Mapping[str, Any] = own.to_dict()
        return found

    def printed(self) -> Mapping[str, Any]:
        """Return the numbers as they are printed, with what differs from run to run."""
        return self.numbers()

    def context(self) -> Mapping[str, Any]:
        """Return what a template of its own takes beside what every page has."""
        return {}

    def before(self, out: Path) -> list[Path]:  # noqa: ARG002
        """Check the folder that its files go to; write what it writes itself, return the paths."""
        return []

    @property
    def good(self) -> bool:
        """Whether the answer is a yes."""
        return all(getattr(self.found, name, True) in (True, None) for name in _GOOD)

    @property
    def exit_code(self) -> int:
        """The exit code of a command with this answer."""
        return 0 if self.good else 1

    @property
    def error(self) -> str:
        """What an answer that is a no ends with, as an error; empty: its parts say it."""
        return ""

    @property
    def why(self) -> list[str]:
        """Why it is none."""
        return [p.sentence for p in self.parts() if isinstance(p, Labelled) and p.label == "no"]

    @property
    def title(self) -> str:
        """What its page is called: the vehicle and what was asked."""
        flown: Any = self.found
        for name in ("flight", "task", "course"):
            flown = getattr(flown, name, flown)
        vehicle = getattr(flown, "result_vehicle", getattr(flown, "vehicle", ""))
        name, kind = getattr(vehicle, "name", vehicle), self.kind or self.name
        return f"{name}: {kind}" if name else kind.capitalize()

    def drawn(self) -> Iterator[Drawn]:
        """Give the figures."""
        return (part for part in self.parts() if isinstance(part, Drawn))


_GOOD = (
    *("completed", "covered", "equal", "finished", "identifiable", "identified", "passed"),
    *("possible", "proven", "stable", "within_depth_limit"),
)


def sentences(parts: Iterable[Part]) -> list[str]:
    """Return the sentences among parts, as they are printed."""
    return [str(part) for part in parts if isinstance(part, (str, Labelled)) and str(part).strip()]
