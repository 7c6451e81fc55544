"""HTML that needs nothing but itself: figures, styles and plotly stand in the file."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from html import unescape
from importlib.metadata import version
from importlib.resources import files
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from swimbladder.errors import OPTIONS, as_asked
from swimbladder.show.interactive import as_plotly
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table
from swimbladder.show.picture import Picture
from swimbladder.units import rounded

TEXTS = tomllib.loads(files("swimbladder.show").joinpath("texts.toml").read_text("utf-8"))
"""What the reports say of figures, parameters and tables, texts.toml."""

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
_CODE = re.compile(r"`([\w.]+)`")
_FIELD = re.compile(r"[a-z]\w*(\[\d+\])?(\.\w+(\[\d+\])?)+")
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
    """Return a text as HTML with its indices, powers, Greek letters and powers of ten set.

    The name of a field, ``hull.psi``, stays as it is typed.
    """
    if _FIELD.fullmatch(text):
        return Markup("<code>{}</code>").format(text)

    def set_one(match: re.Match[str]) -> str:
        """Return the HTML of a match: power, unit, symbol with index, or minus sign."""
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
    return Markup(_CODE.sub(r"<code>\1</code>", _SYMBOL.sub(set_one, greek)))


class PageFigure(NamedTuple):
    """A figure as a page has it: to hover and zoom, inside the file."""

    name: str
    title: str
    caption: str
    plot: Markup


def page_figure(
    name: str,
    figure: Picture,
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


def _plot(figure: Picture, name: str, label: str) -> Markup:
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


def answer_page(
    shown: Shown[Any],
    parts: Sequence[Part],
    figures: Mapping[str, Picture],
    files: Iterable[str] = (),
    command: str = "",
) -> str:
    """Return the page of an answer, which needs nothing but itself.

    figures: those of its parts, by name; files: what is written beside it; command: that made it.
    """
    own = {p.name: page_figure(p.name, figures[p.name], p.about, p.part) for p in _drawn(parts)}
    first = next((k for k, p in enumerate(parts) if isinstance(p, (Table, Drawn))), len(parts))
    labels = {p.label for p in parts if isinstance(p, Labelled)} - {"no", "warning", "assumed"}
    context: dict[str, Any] = {
        "shown": shown,
        "box": [p for p in parts[:first] if isinstance(p, str)],
        "refusals": _of(parts, "no"),
        "listed": _of(parts, "warning"),
        "body": [own.get(p.name) if isinstance(p, Drawn) else p for p in parts[first:]],
        "assumptions": _of(parts, "assumed"),
        "notes": [p for p in parts if isinstance(p, Labelled) and p.label in labels],
        "figures": own,
        "numbers": Table(("name", "value"), list(_flat(shown.numbers()))),
        "files": list(files),
        "command": command,
    }
    return render(shown.template, {**context, **shown.context()})


def _drawn(parts: Sequence[Part]) -> list[Drawn]:
    return [part for part in parts if isinstance(part, Drawn)]


def _of(parts: Sequence[Part], label: str) -> list[Labelled]:
    return [part for part in parts if isinstance(part, Labelled) and part.label == label]


def table_html(table: Table) -> Markup:
    """Return a table as HTML, for a notebook."""

    def row(cells: Sequence[str], tag: str) -> Markup:
        return Markup("").join(Markup("<{0}>{1}</{0}>").format(tag, cell) for cell in cells)

    rows = [row(table.headings, "th"), *(row(cells, "td") for cells in table.rows)]
    return Markup("<table>{}</table>").format(
        Markup("").join(Markup("<tr>{}</tr>").format(r) for r in rows)
    )


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


_DIGITS = 6
