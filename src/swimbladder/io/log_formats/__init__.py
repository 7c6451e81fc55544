"""Log formats by name: those that come with swimbladder, a TOML file each, and others'."""

from functools import partial
from typing import Any

from swimbladder.errors import InputError
from swimbladder.io.files import shipped
from swimbladder.vehicle.plugins import Registry

__all__ = ["FORMATS"]


def _accept(text: Any, name: str) -> str:  # noqa: ARG001
    if not isinstance(text, str):
        what = "it is no text"
        raise InputError(what, remedy="Let the entry point name a text: TOML with a [log] table")
    return text


FORMATS: Registry[str] = Registry(
    "swimbladder.log_formats",
    "log format",
    {name: partial(file.read_text, encoding="utf-8") for name, file in shipped(__name__).items()},
    _accept,
)
"""The TOML text of each; swimbladder's own are named after their vehicle."""
