"""HTML that needs nothing but itself: pictures and styles stand in the file, nothing is fetched."""

import base64
import re
import struct
import tomllib
from collections.abc import Callable, Mapping
from importlib.metadata import version
from importlib.resources import files
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from swimbladder.show.plots.style import svg_text
from swimbladder.units import rounded

TEXTS = tomllib.loads(files("swimbladder.show.report").joinpath("texts.toml").read_text("utf-8"))
"""What the reports say of figures, parameters and tables, texts.toml."""

_FULL = 1440  # pixels of a picture as wide as the page

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
_GREEK_WORD = re.compile(r"\b(" + "|".join(_GREEK) + r")(?=\b|_)")
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
    return environment.get_template(template).render(context)


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
    """A picture as a page has it: inside the file, its letters as large as those of the others."""

    name: str
    title: str
    caption: str
    data: str
    width: str


def page_figure(name: str, image: bytes, about: str = "", part: str = "") -> PageFigure:
    """Return a PNG as a picture of a page, with the title and caption of texts.toml.

    about: what they are called there, where not as the picture; part: what of it the title adds.
    """
    said = TEXTS["figures"][about or name]
    title = f"{said['title']}{part}"
    (pixels,) = struct.unpack(">I", image[16:20])
    width = f"{min(100.0 * pixels / _FULL, 100.0):.0f}%"
    stop = "" if title.endswith("?") else "."
    return PageFigure(name, f"{title}{stop}", said["caption"], data_url(image), width)


def data_url(image: bytes) -> str:
    """Return a PNG as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(image).decode("ascii")


def drawn_inline(figure: Figure, *, name: str, label: str) -> Markup:
    """Return a figure to stand inside HTML, as `inline_svg` does."""
    return inline_svg(svg_text(figure), name=name, label=label)


def inline_svg(svg: str, *, name: str, label: str) -> Markup:
    """Return an SVG file's text to stand inside HTML, described by `label` to those who cannot see.

    Identifiers get `name` in front, so that several pictures can share a page.
    """
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', body)
    body = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", body)
    body = re.sub(r"<svg\b([^>]*)>", lambda m: _opening(m.group(1), label), body, count=1)
    return Markup(body)


def _opening(attributes: str, label: str) -> str:
    kept = re.sub(r'\s(?:width|height|version|xmlns:xlink)="[^"]*"', "", attributes)
    linked = 'xmlns:xlink="http://www.w3.org/1999/xlink"'
    return f'<svg{kept} {linked} role="img" aria-label="{escape(label)}">'
