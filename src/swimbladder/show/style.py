"""How every picture looks: colours that all can distinguish, units on axes, depth downwards.

Matplotlib is imported where something is drawn, so that an answer that only prints is quick.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from swimbladder.io.files import write_through

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Ink:
    """The colours: Okabe and Ito, "Color Universal Design", 2008."""

    BLACK, GREY = "#000000", "#767676"
    BLUE, SKY = "#0072B2", "#56B4E9"
    ORANGE, VERMILION = "#E69F00", "#D55E00"
    GREEN, PURPLE = "#009E73", "#CC79A7"


STYLE: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.labelsize": 10.0,
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
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150.0,
    # The same picture is the same file: no random identifiers, no fonts of this machine.
    "svg.hashsalt": "swimbladder",
    "svg.fonttype": "path",
}

_P = ParamSpec("_P")


def styled(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Make a function that draws a Figure draw it in this style, whatever the caller's own."""

    def drawing(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(STYLE)
            return draw(*args, **kwargs)

    drawing.__doc__, drawing.__name__ = draw.__doc__, draw.__name__
    return drawing


def new_figure(
    size: tuple[float, float], rows: int = 1, columns: int = 1, **given: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure of a size [inches] and its panels, row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size)
    made: list[Axes] = figure.subplots(rows, columns, squeeze=False, **given).ravel().tolist()
    return figure, made


def stacked(size: tuple[float, float], *heights: float) -> tuple[Figure, list[Axes]]:
    """Return a figure of a size [inches] and panels above one another, as high as that, one x."""
    return new_figure(size, len(heights), sharex=True, height_ratios=heights)


def setpoint(axes: Axes, time: NDArray[np.float64], reference: NDArray[np.float64]) -> None:
    """Draw what is asked for."""
    axes.step(time, reference, where="post", color=Ink.GREY, ls="--", lw=1.1, label="set-point")


def band(axes: Axes, middle: float, half: float, **given: Any) -> None:
    """Shade a band around what is asked for."""
    how = {"color": Ink.GREY, "alpha": 0.25, "lw": 0.0, **given}
    axes.axhspan(middle - half, middle + half, **how)


def depth_axis(axes: Axes, label: str = "depth [m]") -> None:
    """Let a depth axis grow downwards, and label it."""
    if not axes.yaxis_inverted():
        axes.invert_yaxis()
    axes.set_ylabel(label)


def label_panels(panels: list[Axes]) -> None:
    """Write (a), (b), ... above the upper left corner of the panels."""
    for letter, axes in zip("abcdefgh", panels, strict=False):
        axes.set_title(f"({letter})", loc="left", fontweight="bold", fontsize=10.0)


def legend_above(axes: Axes, **given: Any) -> None:
    """Put the legend above the right corner, where no curve is; each label once."""
    _legend(axes, [axes], **{"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), **given})


def legend_beside(figure: Figure, panels: Iterable[Axes], loc: str, **given: Any) -> None:
    """Put one legend for all panels where `loc` says, as "outside lower center"."""
    _legend(figure, panels, loc=loc, **given)


def _legend(place: Figure | Axes, panels: Iterable[Axes], **given: Any) -> None:
    named: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    place.legend(list(named.values()), list(named), **{"ncols": len(named), **given})


def shade(axes: Axes, time: NDArray[np.float64], out: NDArray[np.bool_], label: str) -> None:
    """Shade the spans of time in which samples are left out."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], out, [False])).astype(int)))
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        last = time[min(after, len(time) - 1)]
        axes.axvspan(time[first], last, color="#E8E8E8", lw=0.0, zorder=0, label=label)


def grid_of(figure: Figure, count: int, columns: int, **given: Any) -> list[Axes]:
    """Return so many panels of a figure, row by row; the last row may have fewer."""
    made = figure.subplots(-(-count // columns), columns, squeeze=False, **given).ravel().tolist()
    for axes in made[count:]:
        axes.remove()
    panels: list[Axes] = made[:count]
    return panels


def plain_log_ticks(axes: Axes, *which: str) -> None:
    """Label the logarithmic axes `which`, "x" and "y", by plain numbers, several on any span."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    for name in which:
        axis = getattr(axes, f"{name}axis")
        low, high = axis.get_view_interval()
        decades = abs(math.log10(high / low))
        subs = next(subs for most, subs in _TICKS if decades < most)
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter("")


_TICKS = (  # of a span in decades
    (0.5, (1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)),
    (1.5, (1.0, 2.0, 3.0, 5.0, 7.0)),
    (2.5, (1.0, 2.0, 5.0)),
    (math.inf, (1.0,)),
)


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure to a file of the format that its suffix names; return the path.

    Raises InputError where the file cannot be written.
    """
    import matplotlib as mpl

    kind = Path(path).suffix.lower()[1:]
    with mpl.rc_context(STYLE):
        if kind == "png":
            return write_through(path, lambda temporary: _write_png(figure, temporary))
        quiet = _QUIET.get(kind, {})
        return write_through(path, lambda temporary: figure.savefig(temporary, metadata=quiet))


def _write_png(figure: Figure, path: Path) -> None:
    """Write a figure that is drawn once: `savefig` draws it twice, the first time to lay it out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    shown, dpi = figure.canvas, figure.dpi
    canvas = FigureCanvasAgg(figure)
    try:
        figure.dpi = STYLE["savefig.dpi"]
        canvas.print_png(path, metadata=_QUIET["png"])  # type: ignore[no-untyped-call]
    finally:
        figure.dpi = dpi
        figure.set_canvas(shown)


# no date and no program in a file, so that it is the same tomorrow
_QUIET = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}
