"""What the kernels of missions and of the closed loop have in common is compiled once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from swimbladder.io.files import source_hash
from swimbladder.sim.engine.cache import compiled

__all__ = ["NAME", "kept"]

NAME = f"rodas-{source_hash(Path(__file__).parent.glob('*.py'))}"


def kept(function: Callable[..., Any]) -> Any:
    """Compile a function that several kernels call, and keep its code under this source's name."""
    return compiled(function, under=NAME, allocates=False)
