"""Whether a cast may be in another unit of pressure: the warning, and the option that tells it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from swimbladder.cli.common import console
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast


def refuse_doubted_unit(
    casts: Sequence[Cast], asked: float | None, rating: float | None, *, option: str = "--column"
) -> None:
    """Raise InputError as `check_cast_unit` does; what it warns of stands on stderr.

    option: the one that maps columns.
    """
    from swimbladder.physics.seawater.cast_unit import check_cast_unit

    for cast in casts:
        try:
            doubt = check_cast_unit(cast, asked, rating)
        except InputError as error:
            raise InputError(
                error.what, file=error.file, field=error.field,
                remedy=(error.remedy or "").replace("--column", option),
            ) from None  # fmt: skip
        if doubt:
            console.print(
                f"warning: {doubt.replace('--column', option)}", soft_wrap=True, markup=False
            )
