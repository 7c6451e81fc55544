"""A picture as data: panels with axes, curves, bands and marks, drawn by two back ends.

`static` draws it with matplotlib, for files and `plot()`; `interactive` with plotly, for pages. An
axis whose label begins with a depth grows downwards; units stand in brackets at a label's end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import pairwise
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.physics.arrays import Array, Flags

Axis = Literal["x", "y"]
Some: TypeAlias = ArrayLike
Limits = tuple[float | None, float | None]
_ROOM = 0.05  # of what is drawn, beside it


class Ink:
    """The colors: Okabe and Ito, "Color Universal Design", 2008."""

    BLACK, GREY, PALE, WHITE = "#000000", "#767676", "#E8E8E8", "#FFFFFF"
    BLUE, SKY = "#0072B2", "#56B4E9"
    ORANGE, VERMILION = "#E69F00", "#D55E00"
    GREEN, PURPLE = "#009E73", "#CC79A7"


class Curve(NamedTuple):
    """A line, points, or both; dash and marker as matplotlib names them, empty for none."""

    x: Array
    y: Array
    color: str = Ink.BLUE
    label: str = ""
    dash: str = "-"
    width: float = 1.5
    marker: str = ""
    size: float = 6.0
    hollow: bool = False
    alpha: float = 1.0
    step: bool = False  # each value holds until the next
    layer: float = 2.0  # the highest is drawn last
    says: Sequence[str] = ()  # of each point, where the axes are not in its units


class Area(NamedTuple):
    """Polygons, nan between them."""

    x: Array
    y: Array
    color: str = Ink.BLUE
    label: str = ""
    alpha: float = 0.25
    layer: float = 1.0


class Rule(NamedTuple):
    """A line from one side of the panel to the other, at a value of one axis."""

    axis: Axis
    at: float
    color: str = Ink.GREY
    label: str = ""
    dash: str = "-"
    width: float = 0.8


class Span(NamedTuple):
    """A band from one side of the panel to the other, between two values of one axis."""

    axis: Axis
    low: float
    high: float
    color: str = Ink.BLUE
    label: str = ""
    alpha: float = 0.25


class Bars(NamedTuple):
    """Bars on a base; flat: they lie."""

    at: Array
    length: Array
    color: str | Sequence[str] = Ink.BLUE
    label: str = ""
    base: Some = 0.0
    thick: float = 0.8
    flat: bool = False
    alpha: float = 1.0


class Note(NamedTuple):
    """A text at a place of the panel, in data, or in shares of the panel where `share` says so."""

    x: float
    y: float
    text: str
    color: str = Ink.BLACK
    size: float = 9.0
    across: Literal["left", "center", "right"] = "left"
    up: Literal["bottom", "center", "top"] = "bottom"
    turned: bool = False
    share: str = ""  # of x, y
    shift: tuple[float, float] = (0.0, 0.0)  # points
    boxed: bool = False  # on white
    label: str = ""


Mark: TypeAlias = Curve | Area | Rule | Span | Bars | Note


@dataclass(eq=False)
class Panel:
    """Two axes and what is drawn on them.

    title, note: above it, in the middle and right. legend: where it stands, as matplotlib names it,
    above or beside it, or nowhere. ticks: at values with their names, or at most so many. counts:
    axes that have no halves. deep: y grows downwards whatever its label. x_of: the panel whose x it
    has too; over: it stands over that, its y at the right.
    """

    x: str = ""
    y: str = ""
    _: KW_ONLY
    title: str = ""
    note: str = ""
    xlim: Limits = (None, None)
    ylim: Limits = (None, None)
    xlog: bool = False
    ylog: bool = False
    xticks: Mapping[float, str] | int | None = None
    yticks: Mapping[float, str] | int | None = None
    counts: str = ""
    grid: str = "xy"
    equal: bool = False
    deep: bool = False
    legend: str = "above"
    x_of: Panel | None = None
    over: bool = False
    row: int = 0
    column: int = 0
    wide: int = 1
    marks: list[Mark] = field(default_factory=list)

    @property
    def down(self) -> bool:
        """Whether y grows downwards."""
        return self.deep or self.y.startswith(("depth", "pressure"))

    def line(self, x: Some, y: Some, *style: Any, **how: Any) -> None:
        """Draw a line; style: color and label, as of all that follow; how: fields of `Curve`."""
        self.marks.append(Curve(_flat(x), _flat(y), *style, **how))

    def dots(self, x: Some, y: Some, marker: str = "o", *style: Any, **how: Any) -> None:
        """Draw points."""
        self.line(x, y, *style, **{"dash": "", "marker": marker, **how})

    def steps(self, x: Some, y: Some, *style: Any, **how: Any) -> None:
        """Draw values that hold until the next."""
        self.line(x, y, *style, step=True, **how)

    def setpoint(self, time: Some, reference: Some) -> None:
        """Draw what is asked for."""
        self.steps(time, reference, Ink.GREY, "set-point", dash="--", width=1.1)

    def band(self, x: Some, low: Some, high: Some, *style: Any, **how: Any) -> None:
        """Shade between two curves; how: fields of `Area`, and flat, where they are of y."""
        along, low, high = (np.broadcast_to(_flat(v), np.shape(_flat(x))) for v in (x, low, high))
        ends = np.concatenate([low, high[::-1]]), np.concatenate([along, along[::-1]])
        ends = ends if how.pop("flat", False) else ends[::-1]
        self.marks.append(Area(*ends, *style, **how))

    def area(self, x: Some, y: Some, *style: Any, **how: Any) -> None:
        """Fill polygons."""
        self.marks.append(Area(_flat(x), _flat(y), *style, **how))

    def between(self, at: Some, low: Some, high: Some, *style: Any, **how: Any) -> None:
        """Draw a stroke from low to high at each value; how: fields of `Curve`, and flat."""
        at, low, high = np.broadcast_arrays(*map(_flat, (at, low, high)))
        gap = np.full(len(at), np.nan)
        along, across = (np.transpose(v).ravel() for v in ((at, at, gap), (low, high, gap)))
        ends = (across, along) if how.pop("flat", False) else (along, across)
        self.marks.append(Curve(*ends, *style, **how))

    def rule(self, axis: Axis, at: float, *style: Any, **how: Any) -> None:
        """Draw a line across the panel at a value of an axis."""
        self.marks.append(Rule(axis, float(at), *style, **how))

    def span(self, axis: Axis, low: float, high: float, *style: Any, **how: Any) -> None:
        """Shade across the panel between two values of an axis."""
        self.marks.append(Span(axis, float(low), float(high), *style, **how))

    def bars(self, at: Some, length: Some, *style: Any, **how: Any) -> None:
        """Draw bars; a color for all, or one for each."""
        self.marks.append(Bars(_flat(at), _flat(length), *style, **how))

    def histogram(self, values: Some, bins: Any, *style: Any, scale: float = 1.0) -> None:
        """Draw how values are distributed; scale: of the counts."""
        counts, edges = np.histogram(values, bins)
        middle, thick = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
        self.bars(middle, scale * counts, *style, thick=thick)

    def text(self, x: float, y: float, text: str, **how: Any) -> None:
        """Write a text; how: fields of `Note`."""
        self.marks.append(Note(float(x), float(y), text, **how))

    def shade(self, time: Array, out: Flags, label: str) -> None:
        """Shade the spans of time in which samples are left out."""
        edges = np.flatnonzero(np.diff(np.concatenate(([False], out, [False])).astype(int)))
        for first, after in zip(edges[::2], edges[1::2], strict=True):
            last = time[min(after, len(time) - 1)]
            self.span("x", time[first], last, Ink.PALE, label, alpha=1.0)

    def cells(self, x: Some, y: Some, kinds: NDArray[np.int_], colors: Sequence[str]) -> None:
        """Fill a cell around each x and y [rows, columns] with the color of its kind."""
        (left, right), (low, high) = _edges(_flat(x)), _edges(_flat(y))
        boxes: list[list[list[float]]] = [[] for _ in colors]
        for row, line in enumerate(kinds):
            turns = [0, *(np.flatnonzero(np.diff(line)) + 1).tolist(), len(line)]
            for first, end in pairwise(turns):  # neighbors of one kind are one
                if 0 <= line[first] < len(colors):
                    a, b, c, d = left[first], right[end - 1], low[row], high[row]
                    boxes[line[first]] += [[a, c], [b, c], [b, d], [a, d], [np.nan, np.nan]]
        for corners, color in zip(boxes, colors, strict=True):
            if corners:
                x, y = np.transpose(corners)
                self.area(x, y, color, alpha=1.0)

    def limits(self, axis: Axis) -> tuple[float, float]:
        """Return the ends of an axis: as given, else around what is drawn."""
        given, log = getattr(self, f"{axis}lim"), getattr(self, f"{axis}log")
        found = [_extent(mark, axis) for mark in self.marks]
        ends = np.concatenate([np.zeros(0), *(values for values, _ in found)])
        ends = ends[np.isfinite(ends) & ((ends > 0.0) if log else True)]
        low, high = (ends.min(), ends.max()) if len(ends) else (1.0, 10.0) if log else (0.0, 1.0)
        at_zero = any(fixed for _, fixed in found)
        if log:
            room = (high / low) ** _ROOM if high > low else 10.0
            low, high = low / room, high * room
        else:
            room = _ROOM * (high - low) or 0.05 * abs(high) or 0.05
            low, high = (
                end if at_zero and end == 0.0 else end + side * room
                for end, side in ((low, -1.0), (high, 1.0))
            )
        low, high = (
            end if own is None else own for own, end in zip(given, (low, high), strict=True)
        )
        return float(low), float(high)


@dataclass(eq=False)
class Picture:
    """Panels in rows and columns.

    size: [inches]. legend: where one of all panels stands, below or above; columns: of it; else
    each panel has its own. letters: (a), (b), ... above the panels. sharex, sharey: "all" panels
    have the same axis, or those of a "column" or "row".
    """

    size: tuple[float, float]
    rows: int = 1
    columns: int = 1
    _: KW_ONLY
    title: str = ""
    legend: str = ""
    across: int = 4
    letters: bool = False
    sharex: str = ""
    sharey: str = ""
    heights: Sequence[float] = ()
    widths: Sequence[float] = ()
    panels: list[Panel] = field(default_factory=list)

    def add(self, row: int = 0, column: int = 0, wide: int = 1, **given: Any) -> Panel:
        """Add a panel; given: fields of it."""
        self.panels.append(Panel(row=row, column=column, wide=wide, **given))
        return self.panels[-1]

    def leader(self, panel: Panel, axis: Axis) -> Panel:
        """Return the first panel that has the same axis."""
        how = self.sharex if axis == "x" else self.sharey
        if axis == "x" and panel.x_of is not None:
            return self.leader(panel.x_of, axis)
        own = (one for one in self.panels if not one.over)
        for one in own if how and not panel.over else ():
            if how == "all" or getattr(one, how) == getattr(panel, how):
                return one
        return panel

    def is_labelled(self, panel: Panel, axis: Axis) -> bool:
        """Whether an axis has its numbers: of those that are the same only the outermost has."""
        if panel.over:
            return axis == "y"
        same = [p for p in self.panels if self.leader(p, axis) is self.leader(panel, axis)]
        if axis == "x":
            return not any(p.column == panel.column and p.row > panel.row for p in same)
        return not any(p.row == panel.row and p.column < panel.column for p in same)

    def limits(self, panel: Panel, axis: Axis) -> tuple[float, float]:
        """Return the limits of an axis, of all panels that have the same."""
        first = self.leader(panel, axis)
        same = [p for p in self.panels if self.leader(p, axis) is first]
        found, given = [p.limits(axis) for p in same], [getattr(p, f"{axis}lim") for p in same]
        ends = [min(low for low, _ in found), max(high for _, high in found)]
        for side in (0, 1):
            own = [one[side] for one in given if one[side] is not None]
            ends[side] = own[-1] if own else ends[side]
        return ends[0], ends[1]

    def letter(self, panel: Panel) -> str:
        """Return the letter above a panel."""
        own = [one for one in self.panels if not one.over]
        return f"({chr(ord('a') + own.index(panel))})" if self.letters and panel in own else ""


def grid_of(
    size: tuple[float, float], count: int, columns: int, **given: Any
) -> tuple[Picture, list[Panel]]:
    """Return a picture of so many panels, row by row; the last row may have fewer."""
    made = Picture(size, -(-count // columns), columns, **given)
    return made, [made.add(*divmod(number, columns)) for number in range(count)]


def one_panel(size: tuple[float, float], **given: Any) -> tuple[Picture, Panel]:
    """Return a picture of one panel; given: fields of that."""
    made = Picture(size)
    return made, made.add(**given)


def stacked(
    size: tuple[float, float], *heights: float, **given: Any
) -> tuple[Picture, list[Panel]]:
    """Return a picture of panels above one another, as high as that, one x."""
    return grid_of(size, len(heights), 1, heights=heights, sharex="all", **given)


_SUBS = (  # of a span in decades
    (0.5, (1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)),
    (1.5, (1.0, 2.0, 3.0, 5.0, 7.0)),
    (2.5, (1.0, 2.0, 5.0)),
    (math.inf, (1.0,)),
)


def log_ticks(low: float, high: float) -> dict[float, str]:
    """Return the ticks of a logarithmic axis, several on any span, with plain numbers."""
    decades = math.log10(high / low)
    subs = next(subs for most, subs in _SUBS if decades < most)
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    values = [sub * 10.0**power for power in powers[:: 1 + int(decades) // 8] for sub in subs]
    return {value: f"{value:g}" for value in values if low <= value <= high}


def labelled(panels: Iterable[Panel]) -> Iterator[Mark]:
    """Give the marks that a legend of panels names, each name once."""
    seen = {""}
    for mark in (mark for panel in panels for mark in panel.marks):
        if mark.label not in seen:
            seen.add(mark.label)
            yield mark


def _flat(values: Some) -> Array:
    return np.atleast_1d(np.asarray(values, dtype=np.float64))


def _edges(middles: Array) -> tuple[Array, Array]:
    """Return where the cells around values begin and end."""
    half = 0.5 * np.diff(middles)
    ends = np.concatenate([[middles[0] - half[0]], middles[:-1] + half, [middles[-1] + half[-1]]])
    return ends[:-1], ends[1:]


def _extent(mark: Mark, axis: Axis) -> tuple[Array, bool]:
    """Return the values that a mark takes on an axis, and whether it stands on 0."""
    if isinstance(mark, (Curve, Area)):
        return getattr(mark, axis), False
    if isinstance(mark, Rule):
        return _flat([mark.at] if mark.axis == axis else []), False
    if isinstance(mark, Span):
        return _flat([mark.low, mark.high] if mark.axis == axis else []), False
    if isinstance(mark, Bars) and (axis == "x") == mark.flat:
        base = _flat(mark.base)
        return np.concatenate([base + 0.0 * mark.length, base + mark.length]), True
    if isinstance(mark, Bars):
        return np.concatenate([mark.at - 0.5 * mark.thick, mark.at + 0.5 * mark.thick]), False
    return np.zeros(0), False
