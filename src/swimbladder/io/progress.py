"""How work that takes long says how far it is."""

from collections.abc import Callable

Advance = Callable[[float], None]
"""Takes the share of the work that was done since it was called last."""


def silent(_: float) -> None:
    """Take no notice of the work done."""


def so_far(advance: Advance) -> Advance:
    """Return what is called with all that is done so far, and lets a bar advance by what is new."""
    done = 0.0

    def report(amount: float) -> None:
        nonlocal done
        advance(amount - done)
        done = amount

    return report
