"""The vehicles that come with swimbladder: one TOML file each, with where its numbers come from."""

from swimbladder.errors import InputError
from swimbladder.io.files import shipped
from swimbladder.vehicle.schema import did_you_mean

__all__ = ["preset_names", "preset_text"]


def preset_names() -> list[str]:
    """Return the names of all presets, sorted.

    Returns
    -------
    list of str
        Names that `load_vehicle` takes.
    """
    return list(shipped(__name__))


def preset_text(name: str) -> str:
    """Return the TOML text of a preset.

    Raises InputError where there is none of that name.
    """
    known = shipped(__name__)
    if name not in known:
        what = "there is no preset of that name, and no such file"
        presets = f"{did_you_mean(name, known)}Presets: {', '.join(known)}"
        remedy = f"{presets}; or give the path of a TOML file"
        raise InputError(what, field="vehicle", value=name, remedy=remedy)
    return known[name].read_text(encoding="utf-8")
