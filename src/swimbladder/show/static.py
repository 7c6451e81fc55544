"""Pictures drawn by matplotlib: for files, and for `plot()`; always in the same style."""

from collections.abc import Mapping
from functools import singledispatch
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import MaxNLocator

from swimbladder.io.files import write_through
from swimbladder.show.picture import (
    Area,
    Axis,
    Bars,
    Curve,
    Mark,
    Note,
    Panel,
    Picture,
    Rule,
    Span,
    labelled,
    log_ticks,
)

STYLE: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.labelsize": 10.0,
    "axes.titlesize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#D8D8D8",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "figure.facecolor": "white",
    "figure.titlesize": 10.5,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150.0,
    # The same picture is the same file: no random identifiers, no fonts of this machine.
    "svg.hashsalt": "swimbladder",
    "svg.fonttype": "path",
}
_MANY = 4  # names in a legend above a panel, beyond which they are small
_PLACES = {  # of legends
    "above": {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98)},
    "beside": {"loc": "center left", "bbox_to_anchor": (1.02, 0.5)},
}


def figure(picture: Picture) -> Figure:
    """Return a picture as a matplotlib Figure, in our style whatever the caller's own is."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        made = Figure(figsize=picture.size)
        ratios = {"height_ratios": picture.heights or None, "width_ratios": picture.widths or None}
        grid = made.add_gridspec(picture.rows, picture.columns, **ratios)
        drawn: dict[int, Axes] = {}
        for panel in picture.panels:
            if panel.over:
                axes = drawn[id(panel.x_of)].twinx()
                axes.spines["right"].set_visible(True)
            else:
                others = {f"share{a}": drawn.get(id(picture.leader(panel, a))) for a in "xy"}  # type: ignore[arg-type]
                cell = grid[panel.row, panel.column : panel.column + panel.wide]
                axes = made.add_subplot(cell, **others)
            drawn[id(panel)] = axes
            for mark in panel.marks:
                _draw(mark, axes)
            _set_axes(picture, panel, axes)
        _legends(picture, made, drawn)
        if picture.title:
            made.suptitle(picture.title)
        made.align_ylabels()
    return made


@singledispatch
def _draw(mark: Mark, _: Axes) -> None:
    """Draw a mark."""
    raise TypeError(type(mark).__name__)


@_draw.register
def _(mark: Curve, axes: Axes) -> None:
    strokes = mark.hollow or mark.marker in ("x", "+", "|")
    edge = 1.4 if strokes else 0.0 if mark.marker == "." or mark.size < 3.0 else 1.0
    style: dict[str, Any] = {"color": mark.color, "lw": mark.width, "ls": mark.dash or "none"}
    style |= {"marker": mark.marker, "ms": mark.size, "mew": edge, "alpha": mark.alpha}
    style |= {"mfc": "none"} if mark.hollow else {}
    shape = "steps-post" if mark.step else "default"
    label = mark.label or "_"
    axes.plot(mark.x, mark.y, **style, drawstyle=shape, label=label, zorder=mark.layer)


@_draw.register
def _(mark: Area, axes: Axes) -> None:
    corners = np.stack([mark.x, mark.y], axis=1)
    breaks = np.flatnonzero(np.isnan(corners).any(axis=1))
    parts = [part[np.isfinite(part).all(axis=1)] for part in np.split(corners, breaks)]
    outline = Outline.make_compound_path(
        *(Outline(part, closed=False) for part in parts if len(part))
    )
    style: dict[str, Any] = {"fc": mark.color, "alpha": mark.alpha, "lw": 0.0}
    style |= {"antialiased": mark.alpha < 1.0, "zorder": mark.layer, "label": mark.label or "_"}
    axes.add_patch(PathPatch(outline, **style))
    axes.update_datalim(corners[np.isfinite(corners).all(axis=1)])
    axes.autoscale_view()


@_draw.register
def _(mark: Rule, axes: Axes) -> None:
    draw = axes.axvline if mark.axis == "x" else axes.axhline
    draw(mark.at, color=mark.color, ls=mark.dash, lw=mark.width, label=mark.label or "_")


@_draw.register
def _(mark: Span, axes: Axes) -> None:
    draw = axes.axvspan if mark.axis == "x" else axes.axhspan
    style: dict[str, Any] = {"color": mark.color, "alpha": mark.alpha, "lw": 0.0, "zorder": 0}
    draw(mark.low, mark.high, **style, label=mark.label or "_")


@_draw.register
def _(mark: Bars, axes: Axes) -> None:
    style: dict[str, Any] = {"color": mark.color, "alpha": mark.alpha, "label": mark.label or "_"}
    if mark.flat:
        axes.barh(mark.at, mark.length, height=mark.thick, left=mark.base, **style)
    else:
        axes.bar(mark.at, mark.length, width=mark.thick, bottom=mark.base, **style)


@_draw.register
def _(mark: Note, axes: Axes) -> None:
    across, up = ("axes fraction" if axis in mark.share else "data" for axis in "xy")
    style: dict[str, Any] = {"ha": mark.across, "va": mark.up, "fontsize": mark.size}
    style |= {"color": mark.color, "rotation": 90.0 * mark.turned, "annotation_clip": False}
    style |= {"bbox": {"fc": "white", "ec": "none", "pad": 1.0}} if mark.boxed else {}
    where: Any = {"xycoords": (across, up), "textcoords": "offset points"}
    axes.annotate(mark.text, (mark.x, mark.y), mark.shift, **where, **style)


def _set_axes(picture: Picture, panel: Panel, axes: Axes) -> None:
    """Set scales, limits, ticks and labels of a panel."""
    axes.set(xlabel=panel.x, ylabel=panel.y, title=panel.title)
    axes.set_title(picture.letter(panel), loc="left", fontweight="bold", fontsize=10.0)
    axes.set_title(panel.note, loc="right", fontsize=8.5)
    if panel.equal:
        axes.set_aspect("equal", adjustable="box")
    for name in ("x", "y"):
        _set_axis(picture, panel, axes, name)
    if picture.leader(panel, "y").down and not axes.yaxis_inverted():
        axes.invert_yaxis()


def _set_axis(picture: Picture, panel: Panel, axes: Axes, name: Axis) -> None:
    axis, first = getattr(axes, f"{name}axis"), picture.leader(panel, name)
    log, ticks = (getattr(panel, f"{name}{what}") for what in ("log", "ticks"))
    if log:
        axis._set_axes_scale("log")
    if isinstance(ticks, Mapping):  # before the limits: ticks beyond widen them
        axis.set_ticks([*ticks], [*ticks.values()])
        axis.set_ticks([], minor=True)
    ends = getattr(panel, f"{name}lim")
    if ends != (None, None):
        back = name == "y" and first.down
        getattr(axes, f"set_{name}lim")(*(ends[::-1] if back else ends))
    if isinstance(ticks, int):
        axis.set_major_locator(MaxNLocator(ticks))
    elif name in panel.counts:
        axis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    elif log and ticks is None and first is panel:
        found = log_ticks(*sorted(axis.get_view_interval()))
        axis.set_ticks([*found], [*found.values()])
        axis.set_ticks([], minor=True)
    if name not in panel.grid:
        axes.grid(visible=False, axis=name)
    if not picture.is_labelled(panel, name):
        axis.set_tick_params(**{"labelbottom" if name == "x" else "labelleft": False})


def _legends(picture: Picture, made: Figure, drawn: dict[int, Axes]) -> None:
    """Put one legend for all panels below or above them, or each panel's where it says."""
    if picture.legend:
        marks = [*labelled(picture.panels)]
        place = {"below": "outside lower center", "above": "outside upper center"}[picture.legend]
        how: dict[str, Any] = {"loc": place, "ncols": min(picture.across, len(marks))}
        if marks:
            made.legend(handles=[_key(mark) for mark in marks], **how)
        return
    for panel in picture.panels:
        marks = [*labelled([panel])]
        if marks and panel.legend:
            where: dict[str, Any] = {**_PLACES.get(panel.legend, {"loc": panel.legend})}
            where |= {"ncols": len(marks)} if panel.legend == "above" else {}
            size = 9.0 if len(marks) <= _MANY or panel.legend != "above" else 7.5
            drawn[id(panel)].legend(handles=[_key(mark) for mark in marks], fontsize=size, **where)


def _key(mark: Any) -> Any:
    """Return what stands for a mark in a legend."""
    if isinstance(mark, (Curve, Rule)):
        style: dict[str, Any] = {"color": mark.color, "lw": mark.width, "ls": mark.dash or "none"}
        style |= {"marker": mark.marker, "ms": mark.size} if isinstance(mark, Curve) else {}
        style |= {"mfc": "none"} if getattr(mark, "hollow", False) else {}
        return Line2D([], [], label=mark.label, **style)
    color = mark.color if isinstance(mark.color, str) else mark.color[0]
    return Patch(fc=color, alpha=mark.alpha, label=mark.label, lw=0.0)


def save(picture: Picture, path: str | Path) -> Path:
    """Write a picture to a file of the format that its suffix names; return the path.

    Raises InputError where the file cannot be written.
    """
    made, kind = figure(picture), Path(path).suffix.lower()[1:]
    with mpl.rc_context(STYLE):
        if kind == "png":
            return write_through(path, lambda temporary: _write_png(made, temporary))
        quiet = _QUIET.get(kind, {})
        return write_through(path, lambda temporary: made.savefig(temporary, metadata=quiet))


def _write_png(made: Figure, path: Path) -> None:
    """Write a figure that is drawn once: `savefig` draws it twice, the first time to lay it out."""
    shown, dpi = made.canvas, made.dpi
    canvas = FigureCanvasAgg(made)
    try:
        made.dpi = STYLE["savefig.dpi"]
        canvas.print_png(path, metadata=_QUIET["png"])  # type: ignore[no-untyped-call]
    finally:
        made.dpi = dpi
        made.set_canvas(shown)


# no date and no program in a file, so that it is the same tomorrow
_QUIET = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}
