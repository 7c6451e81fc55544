"""How many examples a property is given: few in every run, 17 times as many by `make prove`."""

from typing import Any

from hypothesis import settings

__all__ = ["examples"]

_DEFAULT = 100  # of hypothesis


def examples(number: int) -> Any:
    """Return the decorator of a property that takes so many examples where the default is 100."""
    return settings(max_examples=number * settings().max_examples // _DEFAULT)
