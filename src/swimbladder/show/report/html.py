"""HTML that needs nothing but itself: figures, styles and plotly stand in the file."""

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from html import unescape
from importlib.metadata import version
from importlib.resources import files
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from swimbladder.errors import OPTIONS, as_asked
from swimbladder.show.plots.interactive import as_plotly
from swimbladder.units import rounded

TEXTS = tomllib.loads(files("swimbladder.show.report").joinpath("texts.toml").read_text("utf-8"))
"""What the reports say of figures, parameters and tables, texts.toml."""

REPORT = "report.html"
"""The name of the page of every answer."""

_PLOTLY = files("swimbladder.show").joinpath("plotly/plotly-basic.min.js")

_GREEK = {
    "psi": "ψ",
    "rho": "ρ",
    "eta": "η",
    "lambda": "λ",
    "alpha": "α",
    "omega": "ω",
    "epsilon": "ε",
    "beta": "β",
    "Delta": "Δ",
    "pi": "π",
}
_GREEK_WORD = re.compile(r"(?<!--)\b(" + "|".join(_GREEK) + r")(?=\b|_)")
_ASKED = re.compile(r"`\w+=[^`<]*`")
_SYMBOL = re.compile(
    r"\b([kTQVUFBCDJnSβηΔ])_([A-Za-z0-9]{1,4})\b"  # k_z, T_z, V_p
    r"|\b([KTA])([12])\b"  # K1, T2
    r"|\b(m|s|dm|cm|r)\^?([0-4])\b"  # m3, cm3, s^2
    r"|\b(\d+(?:\.\d+)?)e([+-]?)0*(\d+)\b"  # 4.04e-6
    r"|(?<![\w)])-(?=\d)"  # a minus, not a hyphen
)


def render(template: str, context: Mapping[str, Any], **filters: Callable[..., str]) -> str:
    """Return a template of this package filled in; texts are escaped, no name may be missing."""
    environment = Environment(
        loader=PackageLoader("swimbladder.show", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"symbols": symbols, "rounded": rounded, "made_by": _made_by, **filters}
    environment.globals["version"] = version("swimbladder")
    environment.globals["plotly"] = Markup(_PLOTLY.read_text("utf-8"))
    page = environment.get_template(template).render(context)
    return _ASKED.sub(lambda said: escape(as_asked(unescape(said[0]))), page) if OPTIONS else page


def _made_by(command: str) -> str:
    """Return how a page was made: by a command, or from Python where there is none."""
    return Markup("by <code>{}</code>").format(command) if command else "from Python"


def symbols(text: str) -> Markup:
    """Return a text as HTML with its indices, powers, Greek letters and powers of ten set."""

    def set_one(match: re.Match[str]) -> str:
        symbol, below, capital, number, unit, power, digits, sign, exponent = match.groups()
        if exponent:
            ten = f"10<sup>{'−' if sign == '-' else ''}{exponent}</sup>"
            return ten if digits == "1" else f"{digits} × {ten}"
        if unit:
            return f"{unit}<sup>{power}</sup>"
        if symbol or capital:
            return f"{symbol or capital}<sub>{below or number}</sub>"
        return "−"

    plain = str(escape(text)).replace("+-", "±")
    greek = _GREEK_WORD.sub(lambda match: _GREEK[match.group(1)], plain)
    return Markup(_SYMBOL.sub(set_one, greek))


class Picture(NamedTuple):
    """A figure of a page: its name, how it is drawn, and what texts.toml says of it."""

    name: str
    draw: Callable[[], Figure]
    about: str
    part: str = ""  # of the logs, that it shows


class PageFigure(NamedTuple):
    """A figure as a page has it: to hover and zoom, inside the file."""

    name: str
    title: str
    caption: str
    plot: Markup


def page_figure(
    name: str,
    figure: Figure,
    about: str = "",
    part: str = "",
    said: Mapping[str, Mapping[str, str]] = TEXTS["figures"],
) -> PageFigure:
    """Return a figure for a page, with its title and caption.

    about: what they are called in `said`, where not as the figure; part: what of it the title adds.
    """
    found = said.get(about or name, {"title": "", "caption": ""})
    title, caption = found["title"] + part, found["caption"]
    stop = "" if not title or title.endswith("?") else "."
    return PageFigure(name, title + stop, caption, _plot(figure, name, f"{title}{stop} {caption}"))


def _plot(figure: Figure, name: str, label: str) -> Markup:
    """Return a figure as the element and the data that page.html.j2 makes a plotly figure of."""
    data = json.dumps(as_plotly(figure), separators=(",", ":"), allow_nan=False)
    div = Markup('<div class="plot" role="img" data-name="{}" aria-label="{}"></div>')
    kept = Markup(data.replace("<", "\\u003c"))
    return (
        div.format(name, label.strip() or name)
        + Markup('\n<script type="application/json">')
        + kept
        + Markup("</script>\n<noscript>This figure needs JavaScript.</noscript>")
    )
