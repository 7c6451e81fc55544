"""A matplotlib figure as a plotly figure: the same panels, curves and units, to hover and zoom."""

import math
import re
from collections.abc import Iterator
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PathCollection, QuadMesh
from matplotlib.colors import to_rgba
from matplotlib.container import BarContainer
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator
from matplotlib.transforms import Transform
from numpy.typing import NDArray

_POINTS = 60_000  # of all curves of a figure: a page stays below 3 MB
_FEWEST = 300  # of one curve
_PIXELS = 96.0  # of an inch
_BAR = 30  # pixels, of plotly's buttons above the figure
_DASHES = {"--": "dash", ":": "dot", "-.": "dashdot"}
_STEPS = {"steps-post": "hv", "steps-pre": "vh", "steps": "vh", "steps-mid": "hvh"}
_MARKERS = {
    "o": "circle",
    ".": "circle",
    "s": "square",
    "D": "diamond",
    "d": "diamond-tall",
    "^": "triangle-up",
    "v": "triangle-down",
    "<": "triangle-left",
    ">": "triangle-right",
    "x": "x-thin-open",
    "+": "cross-thin-open",
    "*": "star",
    "|": "line-ns-open",
    "_": "line-ew-open",
}
_SIDES = {"left": 0.0, "center": 0.5, "right": 1.0, "bottom": 0.0, "top": 1.0}
_SIDES |= {"baseline": 0.0, "center_baseline": 0.5}
_TITLES = (("_left_title", "left", 0.0), ("title", "center", 0.5), ("_right_title", "right", 1.0))
_UNIT = re.compile(r"^(.*?)\s*\[(.*)\]$", re.DOTALL)


def as_plotly(figure: Figure) -> dict[str, Any]:
    """Return the data and the layout of a plotly figure, in JSON's own types.

    Curves of more samples than a screen can show are thinned: of each bucket its least and its
    largest value stay.
    """
    legends = [*filter(None, (axes.get_legend() for axes in figure.axes)), *figure.legends]
    for legend in legends:  # plotly's own stands below
        legend.set_in_layout(False)
    figure.draw_without_rendering()
    for legend in legends:
        legend.set_in_layout(True)
    panels = [_Panel(number, axes, figure) for number, axes in enumerate(figure.axes, start=1)]
    width, height = figure.get_size_inches()
    layout: dict[str, Any] = {
        "width": round(_PIXELS * width),
        "height": round(_PIXELS * height) + _BAR,
        "margin": {"l": 0, "r": 0, "t": _BAR, "b": 0},
        "barmode": "overlay",
        "hovermode": "closest",
        "plot_bgcolor": "white",
        "font": {"size": 12},
        "showlegend": False,
        "shapes": [shape for panel in panels for shape in panel.shapes()],
        "annotations": [text for panel in panels for text in panel.texts()],
    }
    for panel in panels:
        layout |= panel.axes_of(panels)
    top = figure.get_suptitle()
    if top:
        at = figure._suptitle  # type: ignore[attr-defined]  # matplotlib gives its text only
        x, y = at.get_position()
        layout["annotations"].append(_note(top, x, y, "paper", "paper", at))
    data = [trace for panel in panels for trace in panel.traces()]
    _thin(data)
    _legend(data, layout, legends)
    return {"data": data, "layout": layout}


class _Panel:
    """The axes of a figure, as plotly numbers them."""

    def __init__(self, number: int, axes: Axes, figure: Figure) -> None:
        self.axes, self.figure = axes, figure
        self.number = "" if number == 1 else str(number)
        twins = [other for other in axes._twinned_axes.get_siblings(axes) if other is not axes]  # type: ignore[attr-defined]
        order = figure.axes
        self.under = next((a for a in twins if order.index(a) < number - 1), None)
        self.where = {"xaxis": f"x{self.number}", "yaxis": f"y{self.number}"}
        bars = axes.containers
        self.bars = [c for c in bars if isinstance(c, BarContainer)]

    def axes_of(self, panels: list["_Panel"]) -> dict[str, Any]:
        """Return the layout of the two axes."""
        box = self.axes.get_position()
        found = {}
        for name, other, low, high in (("x", "y", box.x0, box.x1), ("y", "x", box.y0, box.y1)):
            axis = self._axis(name) | {"domain": [low, high], "anchor": f"{other}{self.number}"}
            shared = getattr(self.axes, f"get_shared_{name}_axes")()
            first = next(p for p in panels if p is self or shared.joined(p.axes, self.axes))
            if first is not self:
                axis["matches"] = f"{name}{first.number}"
            if self.under is not None:
                number = next(p.number for p in panels if p.axes is self.under)
                axis["overlaying"] = f"{name}{number}"
                axis["showgrid"] = False
            found[f"{name}axis{self.number}"] = axis
        return found

    def _axis(self, name: str) -> dict[str, Any]:
        """Return range, ticks and title of the axis x or y."""
        axis = getattr(self.axes, f"{name}axis")
        low, high = map(float, getattr(self.axes, f"get_{name}lim")())
        sides = ("bottom", "top") if name == "x" else ("left", "right")
        shown = axis.get_tick_params()
        far = axis.get_ticks_position() == sides[1]
        ticks = axis.get_ticklocs()
        labelled = self.axes.axison and len(ticks) and (shown.get(f"label{sides[0]}", True) or far)
        made: dict[str, Any] = {
            "range": [low, high],
            "title": {"text": _html(axis.get_label_text()), "standoff": 6},
            "showticklabels": bool(labelled),
            "showgrid": bool(shown.get("gridOn", False)),
            "gridcolor": "#D8D8D8",
            "zeroline": False,
            "showline": bool(self.axes.spines[sides[far]].get_visible()),
            "linecolor": "black",
            "ticks": "outside" if labelled else "",
            "visible": bool(self.axes.axison and axis.get_visible()),
            "side": sides[far],
        }
        if axis.get_scale() == "log":
            made |= {"exponentformat": "power"}
            made |= {"type": "log", "range": [math.log10(low), math.log10(high)], "dtick": 1}
            if abs(made["range"][1] - made["range"][0]) < 1.5:
                made["dtick"] = "D1" if abs(made["range"][1] - made["range"][0]) < 0.8 else "D2"
        elif getattr(axis.get_major_locator(), "_integer", False):  # counts: no halves
            made |= {"tick0": 0, "dtick": max(1, round(float(np.diff(ticks[:2]).sum())))}
        if isinstance(axis.get_major_locator(), FixedLocator) and len(ticks):
            made |= {"tickmode": "array", "tickvals": [float(x) for x in ticks]}
            texts = axis.get_major_formatter().format_ticks(ticks)
            made["ticktext"] = [_html(text) for text in texts]
        return made

    def traces(self) -> Iterator[dict[str, Any]]:
        """Yield the curves, points, areas and bars, the lowest first."""
        barred = {patch for bars in self.bars for patch in bars}
        drawn: list[tuple[float, list[dict[str, Any]]]] = []
        drawn += [(one.get_zorder(), list(self._collection(one))) for one in self.axes.collections]
        for patch in self.axes.patches:
            if patch not in barred and _held(patch.get_transform(), self.axes) == (True, True):
                area = patch.get_transform() - self.axes.transData
                points = area.transform_path(patch.get_path()).to_polygons(closed_only=False)
                face = patch.get_facecolor()
                if points:
                    drawn.append((patch.get_zorder(), [self._area(points, face, patch)]))
        drawn += [(1.0, [self._bars(bars)]) for bars in self.bars]
        drawn += [(line.get_zorder(), list(self._line(line))) for line in self.axes.lines]
        for _, traces in sorted(drawn, key=lambda one: one[0]):
            yield from traces

    def _line(self, line: Line2D) -> Iterator[dict[str, Any]]:
        if _held(line.get_transform(), self.axes) != (True, True) or not line.get_visible():
            return
        x = np.asarray(line.get_xdata(orig=False), dtype=float)
        y = np.asarray(line.get_ydata(orig=False), dtype=float)
        style, marker = line.get_linestyle(), line.get_marker()
        lined, marked = style not in ("None", " ", ""), marker in _MARKERS
        if not len(x) or not (lined or marked):
            return
        mode = "+".join(word for word, on in (("lines", lined), ("markers", marked)) if on)
        trace: dict[str, Any] = {"type": "scatter", "mode": mode, "x": x, "y": y}
        if lined:
            trace["line"] = _pen(line) | {"shape": _STEPS.get(line.get_drawstyle(), "linear")}
        if marked:
            small = 0.5 if marker == "." else 1.0
            trace["marker"] = {
                "symbol": _MARKERS[str(marker)],
                "size": max(2.0, 1.25 * small * line.get_markersize()),
                "color": _color(line.get_markerfacecolor(), line.get_alpha()),
                "line": {
                    "color": _color(line.get_markeredgecolor(), line.get_alpha()),
                    "width": line.get_markeredgewidth(),
                },
            }
        yield trace | self._said(line.get_label())

    def _collection(self, one: Collection) -> Iterator[dict[str, Any]]:
        faces, edges = one.get_facecolor(), one.get_edgecolor()
        if isinstance(one, PathCollection):
            x, y = np.asarray(one.get_offsets(), dtype=float).T
            sizes = np.sqrt(np.asarray(one.get_sizes(), dtype=float))
            colors = [_color(c, None) for c in faces]
            marker = {"size": 1.25 * float(sizes.mean()), "line": {"width": 0}}
            marker["color"] = colors if len(colors) == len(x) else colors[0]
            trace = {"type": "scatter", "mode": "markers", "x": x, "y": y, "marker": marker}
            yield trace | self._said(one.get_label())
        elif isinstance(one, LineCollection):
            ends = [np.asarray(segment, dtype=float) for segment in one.get_segments()]
            if _held(one.get_transform(), self.axes) == (True, True) and ends:
                x, y = _joined(ends)
                line = {
                    "color": _color(edges[0], None),
                    "width": float(np.atleast_1d(one.get_linewidth())[0]),
                }
                trace = {"type": "scatter", "mode": "lines", "x": x, "y": y, "line": line}
                yield trace | self._said(one.get_label())
        elif isinstance(one, QuadMesh):
            yield from self._mesh(one)
        else:
            area = one.get_transform() - self.axes.transData
            for number, path in enumerate(one.get_paths()):
                polygons = area.transform_path(path).to_polygons(closed_only=False)
                if polygons and len(faces):
                    yield self._area(polygons, faces[number % len(faces)], one)

    def _mesh(self, mesh: QuadMesh) -> Iterator[dict[str, Any]]:
        """Yield the cells of a mesh, those of one color together."""
        corners = np.asarray(mesh.get_coordinates(), dtype=float)
        rows, columns = corners.shape[0] - 1, corners.shape[1] - 1
        colors = np.asarray(mesh.to_rgba(np.asarray(mesh.get_array()))).reshape(rows, columns, 4)
        found: dict[tuple[float, ...], list[NDArray[np.float64]]] = {}
        for row in range(rows):
            cells = [tuple(map(float, colors[row, k])) for k in range(columns)]
            at = 0
            for color, run in groupby(cells):
                end = at + len(list(run))
                low, high = corners[row], corners[row + 1]
                found.setdefault(color, []).append(
                    np.array([low[at], low[end], high[end], high[at], low[at]])
                )
                at = end
        for color, polygons in found.items():
            yield self._area(polygons, color, mesh)

    def _area(self, polygons: Any, face: Any, artist: Patch | Collection) -> dict[str, Any]:
        x, y = _joined([np.asarray(polygon, dtype=float) for polygon in polygons])
        trace = {"type": "scatter", "mode": "lines", "x": x, "y": y, "fill": "toself"}
        trace |= {"fillcolor": _color(face, None), "line": {"width": 0}, "hoverinfo": "skip"}
        return trace | {k: v for k, v in self._said(artist.get_label()).items() if k != _HOVER}

    def _bars(self, bars: BarContainer) -> dict[str, Any]:
        boxes: list[Rectangle] = list(bars.patches)
        x, y = np.array([b.get_xy() for b in boxes]).T
        wide, high = np.array([(b.get_width(), b.get_height()) for b in boxes]).T
        colors = [_color(b.get_facecolor(), None) for b in boxes]
        trace: dict[str, Any] = {"type": "bar", "marker": {"color": colors}}
        if bars.orientation == "horizontal":
            trace |= {"orientation": "h", "y": y + high / 2, "x": wide, "base": x, "width": high}
        else:
            trace |= {"x": x + wide / 2, "y": high, "base": y, "width": wide}
        return trace | self._said(bars.get_label())

    def _said(self, label: object) -> dict[str, Any]:
        """Return the name of a trace, its panel, and what is shown where the pointer is."""
        name = "" if label is None or str(label).startswith("_") else _html(str(label))
        x, y = (getattr(self.axes, f"get_{axis}label")() for axis in "xy")
        shared = self.axes.get_shared_x_axes().get_siblings(self.axes)
        x = x or next((other.get_xlabel() for other in shared if other.get_xlabel()), "")
        lines = [_hover(x, "x"), _hover(y, "y")]
        hover = "<br>".join([f"<b>{name}</b>"] * bool(name) + lines) + "<extra></extra>"
        return {"name": name, _HOVER: hover, **self.where}

    def shapes(self) -> Iterator[dict[str, Any]]:
        """Yield lines and spans that go from one side of the panel to the other."""
        for line in self.axes.lines:
            held = _held(line.get_transform(), self.axes)
            if held != (True, True) and any(held) and np.size(line.get_xdata()):
                ends = [np.asarray(v, dtype=float)[[0, -1]] for v in line.get_data(orig=False)]
                made = self._across(held, *ends)
                yield made | {"type": "line", "line": _pen(line), "layer": "above"}
        for patch in self.axes.patches:
            held = _held(patch.get_transform(), self.axes)
            if isinstance(patch, Rectangle) and held != (True, True) and any(held):
                (x, y), wide, high = patch.get_xy(), patch.get_width(), patch.get_height()
                made = self._across(held, (x, x + wide), (y, y + high))
                made |= {"type": "rect", "layer": "below", "line": {"width": 0}}
                yield made | {"fillcolor": _color(patch.get_facecolor(), None)}

    def _across(self, held: tuple[bool, bool], x: Any, y: Any) -> dict[str, Any]:
        made: dict[str, Any] = {}
        for name, data, ends in (("x", held[0], x), ("y", held[1], y)):
            made[f"{name}ref"] = f"{name}{self.number}" + ("" if data else " domain")
            made |= {f"{name}0": float(ends[0]), f"{name}1": float(ends[1])}
        return made

    def texts(self) -> Iterator[dict[str, Any]]:
        """Yield titles and what is written inside the panel."""
        axes, number = self.axes, self.number
        for name, where, x in _TITLES:
            title: Text = getattr(axes, name)
            if title.get_text():
                note = _note(title.get_text(), x, 1.0, f"x{number} domain", "", title)
                yield note | {"yref": f"y{number} domain", "yanchor": "bottom", "xanchor": where}
        for text in axes.texts:
            if text.get_text() and text.get_visible():
                box = text.get_window_extent()
                across, up = (
                    _SIDES[text.get_horizontalalignment()],
                    _SIDES[text.get_verticalalignment()],
                )
                pixel = (box.x0 + across * box.width, box.y0 + up * box.height)
                x, y = axes.transAxes.inverted().transform(pixel)
                yield _note(text.get_text(), x, y, f"x{number} domain", f"y{number} domain", text)


_HOVER = "hovertemplate"


def _held(transform: Transform, axes: Axes) -> tuple[bool, bool]:
    """Whether x and y of a transform are data, not shares of the panel."""
    x, y = transform.contains_branch_seperately(axes.transData)
    return bool(x), bool(y)


def _pen(line: Line2D) -> dict[str, Any]:
    """Return color, width and dashes of a line."""
    dash = _DASHES.get(str(line.get_linestyle()), "solid")
    color = _color(line.get_color(), line.get_alpha())
    return {"color": color, "width": 1.2 * line.get_linewidth(), "dash": dash}


def _note(text: str, x: float, y: float, xref: str, yref: str, as_in: Text) -> dict[str, Any]:
    """Return an annotation without an arrow, set as a matplotlib text is."""
    middle = {"center": "middle", "center_baseline": "middle", "baseline": "bottom"}
    upright = as_in.get_verticalalignment()
    bold = as_in.get_fontweight() in ("bold", 700)
    return {
        "text": f"<b>{_html(text)}</b>" if bold else _html(text),
        "x": float(x),
        "y": float(y),
        "xref": xref,
        "yref": yref,
        "xanchor": as_in.get_horizontalalignment(),
        "yanchor": middle.get(upright, upright),
        "textangle": -as_in.get_rotation(),
        "align": "left",
        "showarrow": False,
        "borderpad": 0,
        "font": {
            "color": _color(as_in.get_color(), None),
            "size": 1.2 * float(as_in.get_fontsize()),
        },
    }


def _legend(data: list[dict[str, Any]], layout: dict[str, Any], legends: list[Legend]) -> None:
    """Show in one legend what the figure's legends name; a name switches all its curves."""
    named: dict[str, Any] = {}
    for legend in legends:
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True):
            named.setdefault(_html(text.get_text()), handle)
    seen: set[str] = set()
    for trace in data:
        name = trace["name"]
        trace["showlegend"] = name in named and name not in seen
        trace["legendgroup"] = name or "unnamed"
        seen.add(name)
    data += [_key(name, handle) for name, handle in named.items() if name not in seen]
    if named:
        room = 30 + 20 * (len(named) // 4)
        layout |= {"showlegend": True, "legend": {"orientation": "h", "x": 0.0, "y": 0.0}}
        layout["legend"] |= {"yref": "container", "yanchor": "bottom", "itemwidth": 30}
        layout["margin"]["b"] = room
        layout["height"] += room


def _key(name: str, handle: Any) -> dict[str, Any]:
    """Return an entry of the legend that stands for no single curve."""
    key: dict[str, Any] = {"type": "scatter", "x": [None], "y": [None], "name": name}
    if isinstance(handle, Line2D):
        return key | {"mode": "lines", "line": _pen(handle)}
    paints = (
        np.reshape(paint, (-1, 4)) for paint in (handle.get_facecolor(), handle.get_edgecolor())
    )
    color = next(paint[0] for paint in paints if len(paint))
    return key | {"mode": "markers", "marker": {"color": _color(color, None), "size": 10}}


def _thin(data: list[dict[str, Any]]) -> None:
    """Leave of each long curve what can be seen, and round all numbers to six digits."""
    share = max(_FEWEST, _POINTS // max(1, len(data)))
    for trace in data:
        x, y = trace["x"], trace["y"]
        if len(x) > share and trace["type"] == "scatter" and not _parted(trace):
            kept = _extremes(y, share // 2)
            trace["x"], trace["y"] = x[kept], y[kept]
        for name in ("x", "y", "base", "width"):
            if name in trace:
                trace[name] = [_number(value) for value in trace[name]]


def _parted(trace: dict[str, Any]) -> bool:
    """Whether a trace is several areas, or points that have each a color."""
    several = "fill" in trace and not np.isfinite(trace["x"]).all()
    return several or isinstance(trace.get("marker", {}).get("color"), list)


def _extremes(y: NDArray[np.float64], buckets: int) -> NDArray[np.intp]:
    """Return where each of so many buckets has its least and its largest value, in order."""
    edges = np.linspace(0, len(y), buckets + 1).astype(int)
    kept = {0, len(y) - 1}
    for first, after in pairwise(edges.tolist()):
        part = y[first:after]
        if np.isfinite(part).any():
            kept |= {int(first + np.nanargmin(part)), int(first + np.nanargmax(part))}
        else:
            kept.add(int(first))
    return np.array(sorted(kept))


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _joined(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return x and y of curves one after another, a gap between them."""
    gap = np.full((1, 2), np.nan)
    return np.concatenate([piece for part in parts for piece in (part, gap)][:-1]).T


def _color(color: Any, alpha: float | None) -> str:
    if isinstance(color, str) and color == "none":
        return "rgba(0,0,0,0)"
    red, green, blue, opaque = to_rgba(color, alpha)
    return f"rgba({255 * red:.0f},{255 * green:.0f},{255 * blue:.0f},{opaque:.3g})"


def _hover(label: str, axis: str) -> str:
    """Return how a number is shown under the pointer, with the axis's name and unit."""
    match = _UNIT.match(label)
    name, unit = match.groups() if match else (label, "")
    shown = "" if unit == "-" else f" {unit}"
    return f"{_html(name or axis)}: %{{{axis}:.5~g}}{_html(shown)}"


def _html(text: str) -> str:
    """Return a label as plotly sets it: entities, line breaks, an index."""
    for sign, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\n", "<br>")):
        text = text.replace(sign, entity)
    return re.sub(r"\$_\\mathrm\{(\w+)\}\$", r"<sub>\1</sub>", text)
