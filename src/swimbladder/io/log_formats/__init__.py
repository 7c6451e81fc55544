"""The log formats that come with swimbladder: one TOML file each, named after their vehicle."""

from __future__ import annotations

from importlib import resources

__all__ = ["format_names", "format_text"]


def format_names() -> list[str]:
    """Return the names of all log formats, sorted."""
    files = resources.files(__name__).iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def format_text(name: str) -> str:
    """Return the TOML text of the log format of that name, which has to exist."""
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
