"""Pictures that are made and not drawn: drawing is a third of the time that a command's tests take.

What is drawn is tested where pictures are made (`tests/show`), and by the examples of the docs.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image

from swimbladder.show import static


def _blank(made: Figure, path: Path) -> None:
    """Write a white picture of a figure's size."""
    wide, high = (round(static.STYLE["savefig.dpi"] * side) for side in made.get_size_inches())
    Image.new("L", (wide, high), 255).save(path, "PNG")


@pytest.fixture(autouse=True, scope="module")
def blank_pictures() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(static, "_write_png", _blank)
        yield
