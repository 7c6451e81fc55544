"""What tests hold of messages: numbers, fields and values; the wording is free."""

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager

import pytest

# A number that is not part of a name such as K1 or step_2.
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w]*_)", re.IGNORECASE)


def numbers(text: object) -> set[float]:
    """Return the numbers in a message, in the units in which they stand there."""
    return {float(number) for number in _NUMBER.findall(str(text))}


@contextmanager
def refused(
    kind: type[Exception],
    *,
    field: str | None = None,
    value: object = None,
    holds: Collection[float] = (),
) -> Iterator[pytest.ExceptionInfo[Exception]]:
    """Expect an error of a kind, of a field and a value, whose message holds these numbers."""
    with pytest.raises(kind) as caught:
        yield caught
    if field is not None:
        assert caught.value.field == field
    if value is not None:
        assert caught.value.value == value
    assert set(holds) <= numbers(caught.value), str(caught.value)
