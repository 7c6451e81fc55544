"""HTML that needs nothing but itself: templates, symbols, pictures."""

import re

import jinja2
import pytest
from matplotlib.figure import Figure

from swimbladder.show.plots.style import svg_text
from swimbladder.show.report import inline_svg, render, symbols


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("K1 and T2", "K<sub>1</sub> and T<sub>2</sub>"),
        ("k_z/k_u z", "k<sub>z</sub>/k<sub>u</sub> z"),
        ("75 cm2, 4 m3/m, s^3", "75 cm<sup>2</sup>, 4 m<sup>3</sup>/m, s<sup>3</sup>"),
        ("rho g psi", "ρ g ψ"),
        ("4.04e-6 m", "4.04 × 10<sup>−6</sup> m"),
        ("1e-12 of 2e+04", "10<sup>−12</sup> of 2 × 10<sup>4</sup>"),
        ("-3.5 %, +-350, a-b, 1-2", "−3.5 %, ±350, a-b, 1-2"),
        ("beta_e, Delta_z", "β<sub>e</sub>, Δ<sub>z</sub>"),
        ("a < b & c", "a &lt; b &amp; c"),
        ("alphabet, rhombus, pixel, 10 m, T of 2 s", "alphabet, rhombus, pixel, 10 m, T of 2 s"),
    ],
)
def test_symbols(text, html):
    assert str(symbols(text)) == html


def figure():
    drawn = Figure(figsize=(2.0, 1.0))
    axes = drawn.subplots()
    axes.plot([0.0, 1.0], [0.0, 1.0], "o-")
    return drawn


def test_two_pictures_share_a_page():
    svg = svg_text(figure())
    one, two = (inline_svg(svg, name=name, label="a & b") for name in ("one", "two"))
    ids = re.findall(r'\bid="([^"]+)"', one + two)
    assert len(ids) == len(set(ids))
    for picture in (one, two):
        own = set(re.findall(r'\bid="([^"]+)"', picture))
        used = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', picture)
        assert used
        assert {a or b for a, b in used} <= own
        assert picture.startswith("<svg")
        assert 'role="img" aria-label="a &amp; b"' in picture
        assert "<metadata" not in picture
        assert "viewBox" in picture
        assert not re.search(r"<svg[^>]*\swidth=", picture)


def test_a_name_that_is_missing_is_an_error():
    with pytest.raises(jinja2.UndefinedError):
        render("paper.html.j2", {})
