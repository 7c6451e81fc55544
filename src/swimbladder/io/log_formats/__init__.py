"""Log formats by name: those that come with swimbladder, a TOML file each, and others'."""

from functools import partial
from importlib import resources
from typing import Any

from swimbladder.errors import InputError
from swimbladder.plugins import Registry

__all__ = ["FORMATS"]


def _text(name: str) -> str:
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")


def _accept(text: Any, name: str) -> str:  # noqa: ARG001
    if not isinstance(text, str):
        what = "it is no text"
        raise InputError(what, remedy="Let the entry point name a text: TOML with a [log] table")
    return text


FORMATS: Registry[str] = Registry(
    "swimbladder.log_formats", "log format",
    own={
        name: partial(_text, name)
        for name in sorted(
            file.name.removesuffix(".toml")
            for file in resources.files(__name__).iterdir()
            if file.name.endswith(".toml")
        )
    },
    accept=_accept,
)  # fmt: skip
"""The TOML text of each; swimbladder's own are named after their vehicle."""
