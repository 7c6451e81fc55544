"""What a message says: the place, the sentence, the value, the unit, the remedy."""

import pytest

from swimbladder.errors import (
    InputError,
    LogError,
    NoAnswerError,
    SwimbladderError,
    UnitError,
)


def test_a_full_message_is_one_paragraph():
    error = InputError(
        "the mass is negative.",
        file="mine.toml",
        line=12,
        field="motion.dry_mass",
        value="-3 kg",
        unit="kg",
        remedy="Weigh it again.",
    )
    assert str(error) == (
        "mine.toml, line 12, motion.dry_mass: the mass is negative "
        "(got '-3 kg', expected unit kg). Weigh it again."
    )


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({}, "no."),
        ({"field": "a"}, "a: no."),
        ({"value": 0.0}, "no (got 0.0)."),
        ({"unit": "m"}, "no (expected unit m)."),
        ({"remedy": "Did you mean b?"}, "no. Did you mean b?"),
        ({"value": "x" * 200}, "no (got '" + "x" * 76 + "...)."),
    ],
)
def test_what_is_not_known_leaves_no_trace(fields, text):
    assert str(InputError("no", **fields)) == text


def test_a_place_is_filled_in_only_where_it_was_not_known():
    error = UnitError("no", field="a", value=1, unit="m", remedy="Yes")
    placed = error.at(file="f.toml", field="b", line=3)
    assert isinstance(placed, UnitError)
    assert (placed.file, placed.field, placed.line) == ("f.toml", "a", 3)
    assert (placed.value, placed.unit, placed.remedy) == (1, "m", "Yes")


@pytest.mark.parametrize(
    ("kind", "code"),
    [(InputError, 2), (UnitError, 2), (LogError, 2), (NoAnswerError, 1), (SwimbladderError, 1)],
)
def test_each_kind_has_its_exit_code(kind, code):
    assert kind("no").exit_code == code
    assert issubclass(kind, SwimbladderError)
