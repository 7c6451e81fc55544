"""Every unit against pint, the grammar, and what is refused."""

import math
from fractions import Fraction

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError, UnitError
from swimbladder.units import (
    _UNITS,
    format_quantity,
    parse_quantity,
    rounded,
    shown_unit,
    unit_factor,
)

# Names that pint spells otherwise.
PINT_NAMES = {
    "%": "percent",
    "cc": "cm**3",
    "t": "tonne",
    "rev": "turn",
    "d": "day",
    "Ω": "ohm",
    "mohm": "milliohm",
    "kohm": "kiloohm",
    "uL": "microliter",
    "um": "micrometer",
    "us": "microsecond",
    "uA": "microampere",
    "uV": "microvolt",
    "uH": "microhenry",
    "L": "liter",
    "l": "liter",
    "ml": "milliliter",
    "rpm": "revolutions_per_minute",
    "degC": "delta_degC",
}
SI_BASES = ["m", "kg", "s", "A", "rad"]


@pytest.fixture(scope="module")
def registry():
    return pint.UnitRegistry()


@pytest.mark.parametrize("name", sorted(_UNITS))
def test_every_unit_agrees_with_pint(registry, name):
    unit = _UNITS[name]
    theirs = registry.Quantity(1.0, PINT_NAMES.get(name, name)).to_base_units()
    assert float(unit.factor) == pytest.approx(theirs.magnitude, rel=1e-14)
    ours = dict(zip(SI_BASES[:4], unit.dimension, strict=False))
    expected = {
        base: int(theirs.dimensionality.get(kind, 0))
        for base, kind in zip(SI_BASES, ["[length]", "[mass]", "[time]", "[current]"], strict=False)
    }
    assert ours == expected  # pint counts angles as numbers


def test_a_temperature_is_no_difference_of_temperatures():
    assert parse_quantity("20 °C", "degC") == 20.0
    with pytest.raises(UnitError, match="of another kind"):
        parse_quantity("288 K", "degC")
    with pytest.raises(UnitError, match="of another kind"):
        parse_quantity("1e-5 1/degC", "1/K")


@pytest.mark.parametrize(
    ("given_unit", "pint_unit", "wanted", "pint_wanted"),
    [
        ("mm/s/V", "mm/s/V", "m/s/V", "m/s/V"),
        ("V/(rad/s)", "V/(rad/s)", "V s/rad", "V*s/rad"),
        ("V/rpm", "V/revolutions_per_minute", "V s/rad", "V*s/rad"),
        ("cm3/rev", "cm**3/turn", "m3/rev", "m**3/turn"),
        ("g cm2", "g*cm**2", "kg m2", "kg*m**2"),
        ("kg·m²", "kg*m**2", "kg m2", "kg*m**2"),
        ("mL/min/bar", "mL/min/bar", "m3/s/Pa", "m**3/s/Pa"),
        ("1/dm3", "1/dm**3", "1/m3", "1/m**3"),
        ("m^-2 s^-1", "m**-2/s", "1/m2/s", "1/m**2/s"),
        ("N*m/(rad*s^-1)", "N*m/(rad/s)", "N m s/rad", "N*m*s/rad"),
        ("V/dm3", "V/dm**3", "V/m3", "V/m**3"),
        ("/s", "1/s", "Hz", "1/s"),
        ("mS/cm", "mS/cm", "S/m", "S/m"),
        ("S/m", "S/m", "1/ohm/m", "1/ohm/m"),
        ("cm3/h^0.5", "cm**3/hour**0.5", "m3/s^0.5", "m**3/second**0.5"),
        ("mm s^-0.5", "mm*s**-0.5", "m/s^0.5", "m/second**0.5"),
    ],
)
def test_composite_units_agree_with_pint(registry, given_unit, pint_unit, wanted, pint_wanted):
    theirs = registry.Quantity(1.0, pint_unit).to(pint_wanted).magnitude
    assert unit_factor(given_unit, wanted) == pytest.approx(theirs, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("350 cm3", "m3", 3.5e-4),
        ("0.444 mm/s/V", "m/s/V", 4.44e-4),
        ("1285 mm", "m", 1.285),
        ("-7.486e-4 dm3/s/m", "m3/s/m", -7.486e-7),
        ("75cm2", "m2", 0.0075),
        (" +.5 m ", "m", 0.5),
        ("12", "V", 12.0),
        (12, "V", 12.0),
        ("60 %", "", 0.6),
        ("5 min", "s", 300.0),
    ],
)
def test_a_text_becomes_the_nearest_float(text, unit, value):
    assert parse_quantity(text, unit) == value


@given(
    st.floats(allow_nan=False, allow_infinity=False, min_value=-1e250, max_value=1e250),
    st.sampled_from([("m", "m"), ("cm3", "m3"), ("mm/s/V", "m/s/V"), ("dbar", "Pa"), ("h", "s")]),
)
def test_a_number_written_with_a_unit_is_read_back_to_the_bit(number, units):
    shown, unit = units
    exact = Fraction(repr(number)) * Fraction(str(unit_factor(shown, unit)))
    assert parse_quantity(f"{number!r} {shown}", unit) == float(exact)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("5 Nm", "N m", 'Write a product with a space: "N m"'),
        ("5 mNm", "N m", '"mN m"'),
        ("5 PA", "Pa", "Did you mean Pa?"),
        ("5 kg", "m", "of another kind"),
        ("5 V s", "V/rpm", "of another kind"),
        ("5 fathom", "m", "unknown unit 'fathom'"),
        ("1,5 m", "m", "decimal point"),
        ("5 m//s", "m/s", "operator"),
        ("5 m*", "m", "missing"),
        ("5 *m", "m", "operator"),
        ("5 m/(s", "m/s", "bracket"),
        ("5 m)", "m", "bracket"),
        ("5 ()", "m", "missing"),
        ("5 m99", "m", "Write a number in m"),
        ("m", "m", "not a number followed by a unit"),
        ("", "m", "not a number followed by a unit"),
        ("nan m", "m", "not a number followed by a unit"),
        ("1e400 m", "m", "not a finite number"),
        ("9" * 200, "m", "not a number followed by a unit"),
        (float("nan"), "m", "not a finite number"),
        (float("-inf"), "m", "not a finite number"),
        (10**400, "m", "not a finite number"),
        (True, "m", "not a quantity"),
        (None, "m", "not a quantity"),
        ([1.0], "m", "not a quantity"),
        ("5 m", "", "without a unit"),
    ],
)
def test_what_is_no_quantity_is_refused_with_a_remedy(text, unit, words):
    with pytest.raises(UnitError) as caught:
        parse_quantity(text, unit)
    assert words in str(caught.value)
    assert caught.value.remedy


def outcome(text, unit):
    """The number, or the error."""
    try:
        return parse_quantity(text, unit), None
    except InputError as error:
        return None, error


@given(st.text(max_size=40), st.sampled_from(["m", "", "V/m3", "N m s/rad"]))
def test_any_text_is_a_finite_number_or_an_input_error(text, unit):
    number, error = outcome(text, unit)
    assert error.remedy if error is not None else math.isfinite(number)


@given(
    st.text(alphabet="0123456789.eE+-msVNkgrad/*()^ 1", max_size=60),
    st.sampled_from(["m", "m/s/V", "kg m2"]),
)
def test_any_near_miss_is_a_finite_number_or_an_input_error(text, unit):
    number, error = outcome(f"1 {text}", unit)
    assert error.remedy if error is not None else math.isfinite(number)


def test_long_units_are_refused_rather_than_parsed():
    with pytest.raises(UnitError):
        unit_factor("(" * 10_000, "m")


def test_a_quantity_is_shown_in_another_unit():
    assert format_quantity(3.5e-4, "m3", "cm3") == "350 cm3"
    assert format_quantity(0.25, "") == "0.25"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (339.6, 2, "340"),
        (101.2, 2, "100"),
        (7935.54, 4, "7936"),
        (2.4e4, 2, "24000"),
        (0.0512, 2, "0.051"),
        (1.5e-7, 2, "1.5e-07"),
        (3.3e9, 2, "3.3e+09"),
        (0.0, 3, "0"),
        (-12.34, 3, "-12.3"),
    ],
)
def test_rounded_numbers_are_written_in_full(value, digits, text):
    assert rounded(value, digits) == text


def test_people_read_small_volumes():
    assert [shown_unit(unit) for unit in ("m3", "m3/m", "m3/s", "kg")] == [
        "cm3",
        "cm3/m",
        "cm3/h",
        "kg",
    ]
