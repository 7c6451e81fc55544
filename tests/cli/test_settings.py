"""Values, priors and deviations with units on the command line."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.cli.options import Sought, deviation, once
from swimbladder.errors import InputError
from swimbladder.estimation.estimates import Prior, read_priors, read_values
from tests.quoted import refused

UNITS = {"K2": "1/m2/s", "psi": "m3/m", "T2": "s"}


def setting(text):
    """Return name and value, in SI, of a text given to --fixed."""
    ((name, value),) = read_values(Sought(fixed=[text]).read()["fixed"], UNITS).items()
    return name, value


def known(text):
    """Return name and prior, in SI, of a text given to --prior."""
    ((name, prior),) = read_priors(Sought(priors=[text]).read()["priors"], UNITS).items()
    return name, prior


def asked(read, text):
    """Return what is said where a command reads a text that is none."""
    with pytest.raises(InputError) as refused, Sought().said_as_typed():
        read(text)
    return str(refused.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("psi=2e-6 m3/m", ("psi", 2e-6)),
        ("psi = 4.04 cm3/m", ("psi", 4.04e-6)),
        ("psi=-1e-7", ("psi", -1e-7)),
        ("T2=1 min", ("T2", 60.0)),
        ("K2=7.9e3", ("K2", 7900.0)),
    ],
)
def test_settings(text, value):
    assert setting(text) == value


@pytest.mark.parametrize(
    ("text", "mean", "std"),
    [
        ("psi=2e-6 +- 1e-6 m3/m", 2e-6, 1e-6),
        ("psi=2e-6 m3/m +- 1e-6 m3/m", 2e-6, 1e-6),
        ("psi=2 cm3/m ± 1 cm3/m", 2e-6, 1e-6),
        ("psi=2 cm3/m+-1", 2e-6, 1e-6),  # a unit counts for both
        ("psi=2 +/- 1 cm3/m", 2e-6, 1e-6),
        ("psi=2e-6+-1e-6", 2e-6, 1e-6),
        ("psi=2 cm3/m +- 1e-6 m3/m", 2e-6, 1e-6),
        ("psi=-2 cm3/m +- 50 %", -2e-6, 1e-6),
    ],
)
def test_priors(text, mean, std):
    name, prior = known(text)
    assert name == "psi"
    assert prior == pytest.approx((mean, std), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("psi", ["--prior: not a pair", "'psi'"]),
        ("psy=1 +- 1", ["--prior: there is no such parameter", "'psy'", "Did you mean psi?"]),
        ("psi=2e-6 m3/m", ["--prior psi: a prior has a mean and", "MEAN +- STD m3/m"]),
        ("psi=1 +- 2 +- 3", ["a mean and a standard deviation"]),
        ("psi=2 cm3 +- 1 cm3", ["--prior psi:", "of another kind", "'2 cm3'", "Give it in m3/m"]),
        ("psi=2 +- one cm3/m", ["--prior psi: not a number", "one cm3/m"]),
        ("psi=1e999 +- 1", ["not a finite number"]),
    ],
)
def test_no_priors(text, parts):
    said = asked(known, text)
    for part in parts:
        assert part in said


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("psi=2 cm3", "--fixed psi: the unit 'cm3' is of another kind"),
        ("psi=", "--fixed: not a pair"),
        ("T2=fast", "--fixed T2: not a number"),
        ("T3=1", "--fixed: there is no such parameter"),
    ],
)
def test_no_settings(text, part):
    assert part in asked(setting, text)


def test_python_reads_the_same_texts_and_numbers():
    texts = {"psi": "2e-6 +- 1e-6 m3/m", "T2": (40.0, 4), "K2": Prior(7e3, 1e2)}
    assert read_priors(texts, UNITS) == {"psi": (2e-6, 1e-6), "T2": (40.0, 4.0), "K2": (7e3, 1e2)}
    assert read_values({"psi": "2 cm3/m", "T2": 40}, UNITS) == {"psi": 2e-6, "T2": 40.0}
    assert read_priors(None, UNITS) == read_values(None, UNITS) == {}
    with pytest.raises(InputError, match=r'priors\[T2\]: a prior has .* `priors=\{"T2": "MEAN'):
        read_priors({"T2": 40.0}, UNITS)


def test_deviations():
    read = deviation("m3")
    assert read("0.5 cm3", "--neutral-std") == pytest.approx(5e-7)
    assert read(" None ", "--neutral-std") == math.inf
    for text in ("1 s", "much"):
        with refused(InputError, field="--neutral-std"):
            read(text, "--neutral-std")


def test_a_name_stands_once():
    assert once([("a", 1), ("b", 2)], "--fixed") == {"a": 1, "b": 2}
    with refused(InputError, field="--fixed", value="a"):
        once([("a", 1), ("a", 1)], "--fixed")


@given(st.text())
def test_any_text_is_read_or_refused(text):
    for read in (lambda: known(f"psi={text}"), lambda: setting(text)):
        with contextlib.suppress(InputError):
            read()
