"""Numbers that stand in a message, for tests that hold the numbers and leave the wording free."""

from __future__ import annotations

import re

# A number that is not part of a name such as K1 or step_2.
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w]*_)", re.IGNORECASE)


def numbers(text: object) -> set[float]:
    """Return the numbers in a message, in the units in which they stand there."""
    return {float(number) for number in _NUMBER.findall(str(text))}
