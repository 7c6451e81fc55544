"""HTML that needs nothing but itself: templates, symbols, pictures."""

import jinja2
import pytest

from swimbladder.show.html import render, symbols


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("K1 and T2", "K<sub>1</sub> and T<sub>2</sub>"),
        ("k_z/k_u z", "k<sub>z</sub>/k<sub>u</sub> z"),
        ("75 cm2, 4 m3/m, s^3", "75 cm<sup>2</sup>, 4 m<sup>3</sup>/m, s<sup>3</sup>"),
        ("rho g psi", "ρ g ψ"),
        ("psi (--psi-std)", "ψ (--psi-std)"),
        ("4.04e-6 m", "4.04 × 10<sup>−6</sup> m"),
        ("1e-12 of 2e+04", "10<sup>−12</sup> of 2 × 10<sup>4</sup>"),
        ("-3.5 %, +-350, a-b, 1-2", "−3.5 %, ±350, a-b, 1-2"),
        ("beta_e, Delta_z", "β<sub>e</sub>, Δ<sub>z</sub>"),
        ("hull.psi", "<code>hull.psi</code>"),
        ("loads[0].power_W", "<code>loads[0].power_W</code>"),
        ("in `water_inside`, `a=1`", "in <code>water_inside</code>, `a=1`"),
        ("a < b & c", "a &lt; b &amp; c"),
        ("alphabet, rhombus, pixel, 10 m, T of 2 s", "alphabet, rhombus, pixel, 10 m, T of 2 s"),
    ],
)
def test_symbols(text, html):
    assert str(symbols(text)) == html


def test_a_name_that_is_missing_is_an_error():
    with pytest.raises(jinja2.UndefinedError):
        render("paper.html.j2", {})
