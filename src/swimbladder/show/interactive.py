"""Pictures as plotly figures: to hover and zoom, each name of the legend a switch."""

import math
import re
from collections.abc import Iterator
from functools import singledispatch
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.arrays import Array
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

_POINTS = 60_000  # of all curves of a figure: a page stays below 3 MB
_FEWEST = 300  # of one curve
_PIXELS = 96.0  # of an inch
_BAR = 30  # pixels, of plotly's buttons above the figure
_LINE, _LETTER = 16.0, 6.4  # pixels of a line of text, and of a letter of a tick
_DASHES = {"--": "dash", ":": "dot", "-.": "dashdot"}
_MARKERS = {
    "o": "circle",
    ".": "circle",
    "s": "square",
    "D": "diamond",
    "^": "triangle-up",
    "v": "triangle-down",
    "x": "x-thin-open",
    "X": "x",
    "+": "cross-thin-open",
    "*": "star",
    "|": "line-ns-open",
}
_UNIT = re.compile(r"^(.*?)\s*\[(.*?)\](.*)$", re.DOTALL)
_HOVER = "hovertemplate"


def as_plotly(picture: Picture) -> dict[str, Any]:
    """Return the data and the layout of a plotly figure, in JSON's own types.

    Curves of more samples than a screen can show are thinned: of each bucket its least and its
    largest value stay.
    """
    width, height = (_PIXELS * side for side in picture.size)
    top = _LINE * _lines(picture.title) + 8.0 * bool(picture.title)
    layout: dict[str, Any] = {
        "width": round(width),
        "height": round(height) + _BAR,
        "margin": {"l": 0, "r": 0, "t": _BAR, "b": 0},
        "barmode": "overlay",
        "hovermode": "closest",
        "plot_bgcolor": "white",
        "font": {"size": 12},
        "showlegend": False,
        "shapes": [],
        "annotations": [],
    }
    boxes = _boxes(picture, width, height, top)
    data: list[dict[str, Any]] = []
    for number, panel in enumerate(picture.panels, 1):
        own = "" if number == 1 else str(number)
        layout |= _axes(picture, panel, own, boxes)
        for mark in sorted(panel.marks, key=lambda one: getattr(one, "layer", 1.5)):
            made = _drawn(mark, own)
            kind = made.pop("kind")
            if kind == "traces":
                made |= {"xaxis": f"x{own}", "yaxis": f"y{own}"}
                if "hoverinfo" not in made:
                    made[_HOVER] = _hover(panel, picture, mark)
                data.append(made)
            else:
                layout[kind].append(made if kind == "shapes" else _placed(made, panel))
        layout["annotations"] += _titles(picture, panel, own)
    if picture.title:
        layout["annotations"].append(
            _words(picture.title, 0.5, 1.0, ("paper", "paper"), "center", "top", 13.0)
        )
    _thin(data)
    _legend(picture, data, layout)
    return {"data": data, "layout": layout}


def _placed(note: dict[str, Any], panel: Panel) -> dict[str, Any]:
    """Return a text where it stands: plotly has logarithms for the places of texts alone."""
    for axis in "xy":
        if getattr(panel, f"{axis}log") and "domain" not in note[f"{axis}ref"]:
            note[axis] = math.log10(note[axis])
    return note


def _boxes(picture: Picture, width: float, height: float, top: float) -> dict[int, list[Any]]:
    """Return where the axes of each panel stand, in shares of the figure."""
    lefts, rights = [0.0] * picture.columns, [12.0] * picture.columns
    aboves, belows = [0.0] * picture.rows, [0.0] * picture.rows
    for p in picture.panels:
        names = p.yticks.values() if isinstance(p.yticks, dict) else ("−00.000",)
        numbers = 14.0 + _LETTER * max(map(len, names), default=0)
        side = 10.0 + numbers * picture.is_labelled(p, "y") + _LINE * _lines(p.y)
        below = 20.0 * picture.is_labelled(p, "x") + _LINE * (0.3 * bool(p.x) + _lines(p.x))
        above = max(_lines(p.title), _lines(p.note), _lines(picture.letter(p)))
        sides, at = (rights, p.column + p.wide - 1) if p.over else (lefts, p.column)
        sides[at] = max(sides[at], side)
        aboves[p.row] = max(aboves[p.row], 8.0 + _LINE * above)
        belows[p.row] = max(belows[p.row], 6.0 + below)
    across = _places(width, lefts, rights, picture.widths)
    down = _places(height, [top + aboves[0], *aboves[1:]], belows, picture.heights)
    return {
        id(p): [
            [across[p.column][0], across[p.column + p.wide - 1][1]],
            [1.0 - end for end in reversed(down[p.row])],
        ]
        for p in picture.panels
    }


def _lines(text: str) -> int:
    return text.count("\n") + bool(text)


def _places(
    length: float, before: list[float], after: list[float], ratios: Any
) -> list[list[float]]:
    """Return where columns, or rows, begin and end, in shares, with gaps of pixels around them."""
    shares = np.array(ratios or [1.0] * len(before), float)
    room = max(length - sum(before) - sum(after), 0.3 * length) * shares / shares.sum()
    ends = np.cumsum(np.transpose([before, room, after]).ravel()).reshape(-1, 3)
    return [[low, high] for low, high, _ in (ends / ends[-1, -1]).tolist()]


def _axes(picture: Picture, panel: Panel, own: str, boxes: Any) -> dict[str, Any]:
    """Return the layout of the two axes of a panel."""
    found: dict[str, Any] = {}
    numbers = {id(p): "" if k == 1 else str(k) for k, p in enumerate(picture.panels, 1)}
    for name, other, domain in zip("xy", "yx", boxes[id(panel)], strict=True):
        axis = _axis(picture, panel, name) | {"domain": domain, "anchor": f"{other}{own}"}  # type: ignore[arg-type]
        first = picture.leader(panel, name)  # type: ignore[arg-type]
        if first is not panel:
            axis["matches"] = f"{name}{numbers[id(first)]}"
        if panel.over:
            axis |= {"overlaying": f"{name}{numbers[id(panel.x_of)]}", "showgrid": False}
            axis |= {"visible": name == "y", "tickmode": "auto"}
        found[f"{name}axis{own}"] = axis
    if panel.equal:
        found[f"yaxis{own}"] |= {"scaleanchor": f"x{own}", "constrain": "domain"}
        found[f"xaxis{own}"]["constrain"] = "domain"
    return found


def _axis(picture: Picture, panel: Panel, name: Axis) -> dict[str, Any]:
    """Return range, ticks and title of the axis x or y."""
    low, high = picture.limits(panel, name)
    far, shown = name == "y" and panel.over, picture.is_labelled(panel, name)
    back = name == "y" and picture.leader(panel, name).down
    made: dict[str, Any] = {
        "range": [high, low] if back else [low, high],
        "title": {"text": _html(getattr(panel, name)), "standoff": 6},
        "showticklabels": shown,
        "showgrid": name in panel.grid,
        "gridcolor": "#D8D8D8",
        "zeroline": False,
        "showline": True,
        "linecolor": "black",
        "ticks": "outside" if shown else "",
        "side": "right" if far else "left" if name == "y" else "bottom",
    }
    ticks = getattr(panel, f"{name}ticks")
    if getattr(panel, f"{name}log"):
        made |= {"type": "log", "range": [math.log10(end) for end in made["range"]]}
        ticks = log_ticks(low, high) if ticks is None else ticks
    elif name in panel.counts:
        made |= {"tick0": 0, "dtick": max(1, math.ceil((high - low) / 10.0))}
    if isinstance(ticks, int):
        made["nticks"] = ticks + 1
    elif ticks is not None:
        names = [_html(one) for one in ticks.values()]
        made |= {"tickmode": "array", "tickvals": [float(x) for x in ticks], "ticktext": names}
    return made


@singledispatch
def _drawn(mark: Mark, _: str) -> dict[str, Any]:
    """Return a mark as a trace, a shape or an annotation, as its kind says."""
    raise TypeError(type(mark).__name__)


@_drawn.register
def _(mark: Curve, _own: str) -> dict[str, Any]:
    mode = "+".join(word for word, on in (("lines", mark.dash), ("markers", mark.marker)) if on)
    trace: dict[str, Any] = {"kind": "traces", "type": "scatter", "mode": mode or "lines"}
    trace |= {"x": mark.x, "y": mark.y, "name": _html(mark.label)}
    trace |= {"text": [*mark.says]} if mark.says else {}
    color = _color(mark.color, mark.alpha)
    if mark.dash:
        trace["line"] = _pen(mark, color) | {"shape": "hv" if mark.step else "linear"}
    if mark.marker:
        size = max(2.0, 1.25 * mark.size * (0.5 if mark.marker == "." else 1.0))
        symbol = _MARKERS[mark.marker] + "-open" * mark.hollow
        trace["marker"] = {
            "symbol": symbol,
            "size": size,
            "color": color,
            "line": {"width": 1.4 if symbol.endswith("open") else 0},
        }
    return trace


@_drawn.register
def _(mark: Area, _own: str) -> dict[str, Any]:
    trace = {"kind": "traces", "type": "scatter", "mode": "lines", "x": mark.x, "y": mark.y}
    color, seam = _color(mark.color, mark.alpha), 0.8 * (mark.alpha == 1.0)  # cells touch
    trace |= {"fill": "toself", "fillcolor": color, "line": {"width": seam, "color": color}}
    return trace | {"hoverinfo": "skip", "name": _html(mark.label)}


@_drawn.register
def _(mark: Bars, _own: str) -> dict[str, Any]:
    colors = [mark.color] * len(mark.at) if isinstance(mark.color, str) else mark.color
    base = np.broadcast_to(np.asarray(mark.base, float), mark.at.shape)
    trace: dict[str, Any] = {
        "kind": "traces",
        "type": "bar",
        "name": _html(mark.label),
        "base": base,
    }
    trace |= {"marker": {"color": [_color(c, mark.alpha) for c in colors]}}
    trace["width"] = np.full(len(mark.at), mark.thick)
    if mark.flat:
        return trace | {"orientation": "h", "y": mark.at, "x": mark.length}
    return trace | {"x": mark.at, "y": mark.length}


@_drawn.register
def _(mark: Rule, own: str) -> dict[str, Any]:
    made = _across(mark.axis, mark.at, mark.at, own) | {"type": "line", "layer": "above"}
    return made | {"line": _pen(mark, _color(mark.color, 1.0))}


@_drawn.register
def _(mark: Span, own: str) -> dict[str, Any]:
    made = _across(mark.axis, mark.low, mark.high, own) | {"type": "rect", "layer": "below"}
    return made | {"line": {"width": 0}, "fillcolor": _color(mark.color, mark.alpha)}


@_drawn.register
def _(mark: Note, own: str) -> dict[str, Any]:
    x, y = (f"{axis}{own}{' domain' if axis in mark.share else ''}" for axis in "xy")
    made = _words(mark.text, mark.x, mark.y, (x, y), mark.across, mark.up, mark.size)
    made["font"]["color"] = mark.color
    right, up = mark.shift
    turned = -90 if mark.turned else 0
    made |= {"bgcolor": "white"} if mark.boxed else {}
    return made | {"xshift": right, "yshift": up, "textangle": turned, "kind": "annotations"}


def _across(axis: Axis, low: float, high: float, own: str) -> dict[str, Any]:
    ends = {axis: (low, high, ""), "y" if axis == "x" else "x": (0.0, 1.0, " domain")}
    made: dict[str, Any] = {"kind": "shapes"}
    for name, (first, last, of) in ends.items():
        made |= {f"{name}ref": f"{name}{own}{of}", f"{name}0": first, f"{name}1": last}
    return made


def _titles(picture: Picture, panel: Panel, own: str) -> Iterator[dict[str, Any]]:
    """Yield what stands above a panel."""
    letter = picture.letter(panel)
    for text, x, across, size in (
        (f"<b>{letter}</b>" if letter else "", 0.0, "left", 10.0),
        (_html(panel.title), 0.5, "center", 9.5),
        (_html(panel.note), 1.0, "right", 8.5),
    ):
        if text:
            refs = (f"x{own} domain", f"y{own} domain")
            yield _words("", x, 1.0, refs, across, "bottom", size) | {"text": text}


def _words(
    text: str, x: float, y: float, refs: tuple[str, str], across: str, up: str, size: float
) -> dict[str, Any]:
    """Return an annotation without an arrow."""
    made: dict[str, Any] = {"text": _html(text), "x": x, "y": y, "xref": refs[0], "yref": refs[1]}
    made |= {"xanchor": across, "yanchor": {"center": "middle"}.get(up, up), "showarrow": False}
    return made | {"align": "left", "borderpad": 0, "font": {"size": 1.2 * size}}


def _legend(picture: Picture, data: list[dict[str, Any]], layout: dict[str, Any]) -> None:
    """Show all names in one legend; a name switches all that has it."""
    named = {
        _html(mark.label): mark
        for mark in labelled(p for p in picture.panels if p.legend or picture.legend)
    }
    seen: set[str] = set()
    for trace in data:
        name = trace["name"]
        trace["showlegend"] = name in named and name not in seen
        trace["legendgroup"] = name or "unnamed"
        seen.add(name)
    data += [_key(name, mark) for name, mark in named.items() if name not in seen]
    if named:
        room = 30 + 20 * (len(named) // 4)
        layout |= {"showlegend": True, "legend": {"orientation": "h", "x": 0.0, "y": 0.0}}
        layout["legend"] |= {"yref": "container", "yanchor": "bottom", "itemwidth": 30}
        layout["margin"]["b"] = room
        layout["height"] += room


def _key(name: str, mark: Any) -> dict[str, Any]:
    """Return an entry of the legend for what goes across a panel."""
    key: dict[str, Any] = {"type": "scatter", "x": [None], "y": [None], "name": name}
    if isinstance(mark, Rule):
        return key | {"mode": "lines", "line": _pen(mark, _color(mark.color, 1.0))}
    return key | {
        "mode": "markers",
        "marker": {"color": _color(mark.color, mark.alpha), "size": 10},
    }


def _pen(mark: Curve | Rule, color: str) -> dict[str, Any]:
    return {"color": color, "width": 1.2 * mark.width, "dash": _DASHES.get(mark.dash, "solid")}


def _thin(data: list[dict[str, Any]]) -> None:
    """Leave of each long curve what can be seen, and round all numbers to six digits."""
    share = max(_FEWEST, _POINTS // max(1, len(data)))
    for trace in data:
        x, y = trace["x"], trace["y"]
        if len(x) > share and trace["type"] == "scatter" and "fill" not in trace:
            kept = _extremes(y, share // 2)
            trace["x"], trace["y"] = x[kept], y[kept]
        for name in ("x", "y", "base", "width"):
            if name in trace:
                trace[name] = [_number(value) for value in trace[name].tolist()]


def _extremes(y: Array, buckets: int) -> NDArray[np.intp]:
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


def _color(color: str, alpha: float) -> str:
    red, green, blue = (int(color[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha:.3g})"


def _hover(panel: Panel, picture: Picture, mark: Mark) -> str:
    """Return what is shown under the pointer: names and units of both axes."""
    shared = [p.x for p in picture.panels if picture.leader(p, "x") is picture.leader(panel, "x")]
    x = panel.x or next((own for own in shared if own), "")
    label = _html(mark.label)
    name = f"<b>{label}</b><br>" if label else ""
    if isinstance(mark, Curve) and mark.says:
        return f"{name}%{{text}}<extra></extra>"
    return f"{name}{_value(x, 'x')}<br>{_value(panel.y, 'y')}<extra></extra>"


def _value(label: str, axis: str) -> str:
    match = _UNIT.match(label)
    name, unit = match.groups()[:2] if match else (label, "")
    shown = "" if unit == "-" else f" {unit}"
    return f"{_html(name or axis)}: %{{{axis}:.5~g}}{_html(shown)}"


def _html(text: str) -> str:
    """Return a label as plotly sets it: entities, line breaks, an index."""
    for sign, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\n", "<br>")):
        text = text.replace(sign, entity)
    return re.sub(r"\$_\\mathrm\{(\w+)\}\$", r"<sub>\1</sub>", text)
