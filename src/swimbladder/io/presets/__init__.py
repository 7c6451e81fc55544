"""The vehicles that come with swimbladder: one TOML file each, with where its numbers come from."""

from importlib import resources

from swimbladder.errors import InputError
from swimbladder.vehicle.schema import did_you_mean

__all__ = ["preset_names", "preset_text"]


def preset_names() -> list[str]:
    """Return the names of all presets, sorted."""
    files = resources.files(__name__).iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def preset_text(name: str) -> str:
    """Return the TOML text of a preset.

    Raises InputError where there is none of that name.
    """
    known = preset_names()
    if name not in known:
        what = "there is no preset of that name, and no such file"
        remedy = (
            f"{did_you_mean(name, known)}Presets: {', '.join(known)}; "
            "or give the path of a TOML file"
        )
        raise InputError(what, field="vehicle", value=name, remedy=remedy)
    return resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
