"""Vehicles and missions from TOML, every error with its file and line.

Where each key of a TOML text stands is found here: `tomllib` does not give it.
"""

import math
import re
import tomllib
from bisect import bisect_right
from codecs import BOM_UTF8
from os.path import isfile
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from swimbladder.control.rate import RATE
from swimbladder.control.registry import own_law
from swimbladder.errors import InputError, check_number
from swimbladder.io.files import read_at_most, why_unreadable
from swimbladder.io.mission import Mission
from swimbladder.io.presets import preset_names, preset_text
from swimbladder.physics.actuator import refuse_pump_and_valve
from swimbladder.physics.dynamics import even_drag, plant
from swimbladder.physics.hull import check_mass
from swimbladder.vehicle import IdentifiedMotion, Parameters, Vehicle, input_error
from swimbladder.vehicle.schema import dotted

_Path = tuple[str | int, ...]


_TOKEN = re.compile(
    r"""(?P<text>"{3}(?:\\.|[^\\])*?"{3,5}|'{3}.*?'{3,5}|"(?:\\.|[^"\\])*"|'[^']*')"""
    r"""|(?P<skip>[ \t\r]+|\#[^\n]*)|(?P<mark>[\[\]{}=,.\n])|(?P<word>[^\s\[\]{}=,.\#"']+)""",
    re.DOTALL,
)


def key_lines(text: str) -> dict[str, int]:
    """Return {dotted place: line counted from 1} of every key, table and list element.

    The text has to be TOML that `tomllib` has read. Places are written as `dotted` writes them:
    ``hull.psi``, ``setpoints[0].depth``.
    """
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


class _Scanner:
    """A cursor over the tokens of a valid TOML text that notes where keys begin."""

    def __init__(self, text: str) -> None:
        tokens = _TOKEN.finditer(text + "\n")
        self.tokens = [(m[0], m.start()) for m in tokens if m.lastgroup != "skip"]
        self.at = 0
        self.starts = [0, *(i + 1 for i, c in enumerate(text) if c == "\n")]
        self.lines: dict[str, int] = {}
        self.tables: dict[_Path, int] = {}  # how many [[tables]] of this name so far

    def note(self, path: _Path, position: int) -> None:
        """Note where a place begins; the first mention wins."""
        self.lines.setdefault(dotted(path), bisect_right(self.starts, position))

    def take(self, *passed: str) -> tuple[str, int]:
        """Return the next token and its position, those `passed` over left out; "" at the end."""
        while self.at < len(self.tokens) and self.tokens[self.at][0] in passed:
            self.at += 1
        self.at += 1
        return self.tokens[self.at - 1] if self.at <= len(self.tokens) else ("", 0)

    def document(self) -> None:
        """Scan statements: headers, and keys with values."""
        prefix: _Path = ()
        while (token := self.take("\n"))[0]:
            if token[0] == "[":
                prefix = self.header(token[1])
            else:
                self.key_and_value(token, prefix)

    def header(self, start: int) -> _Path:
        """Scan ``[table]`` or ``[[table]]`` and return its path."""
        token = self.take()
        several = token[0] == "["
        *parents, last = self.key(self.take() if several else token)
        self.take("]")
        path: _Path = ()
        for part in parents:
            path = self.newest((*path, part))
        path = (*path, last)
        if several:
            self.tables[path] = self.tables.get(path, 0) + 1
            self.note(path, start)
        path = self.newest(path)
        self.note(path, start)
        return path

    def newest(self, path: _Path) -> _Path:
        """Return `path`, within the newest table where it names a list of tables."""
        return (*path, self.tables[path] - 1) if path in self.tables else path

    def key(self, token: tuple[str, int]) -> list[str]:
        """Scan a dotted key that begins with a token, up to the one after it; return its parts."""
        parts = []
        while token[0] not in ("=", "]"):
            if token[0] != ".":
                parts.append(_unquote(token[0]))
            token = self.take()
        return parts

    def key_and_value(self, token: tuple[str, int], path: _Path) -> None:
        """Scan ``a.b = value``; each part of the key is a place."""
        for part in self.key(token):
            path = (*path, part)
            self.note(path, token[1])
        self.value(self.take(), path)

    def value(self, token: tuple[str, int], path: _Path) -> None:
        """Scan a value that begins with a token, and the elements of a list or inline table."""
        index = 0
        while token[0] == "[" and (element := self.take("\n", ","))[0] != "]":
            self.note((*path, index), element[1])
            self.value(element, (*path, index))
            index += 1
        while token[0] == "{" and (element := self.take("\n", ","))[0] != "}":
            self.key_and_value(element, path)
        while token[0] not in "[{" and self.tokens[self.at][0] not in ",]}\n":
            self.at += 1


def _unquote(text: str) -> str:
    """Return a part of a key without its quotes."""
    return text if text[0] not in "\"'" else next(iter(tomllib.loads(f"{text} = 0")))


SCHEMA_VERSION = 1
_MOST_BYTES = 1 << 24  # of a file: a mission of 300 000 set-points
_SCHEMA_REMEDY = f"Write schema_version = {SCHEMA_VERSION} on the first line"
_LEAST = {"dead": 0.05, "run": 0.05}  # s, of the law `rate`
_SPEEDS = {"slow_speed", "near_speed", "far_speed", "ascent_speed"}
_ABOVE_0 = {"coefficient", "tolerance", "window", *_SPEEDS}
_Model = TypeVar("_Model", bound=Parameters)


def load_vehicle(
    name_or_path: str | Path, *, sampled: bool = False, pumped: bool = False, weighed: bool = False
) -> Vehicle:
    """Return the vehicle of a preset's name or of a TOML file.

    A mass that an identified motion implies is held against the hull always.

    Parameters
    ----------
    name_or_path
        The preset's name, or the path of the file.
    sampled
        Whether to refuse a vehicle whose drive has no loop of voltages or positions: a pump and
        valve.
    pumped
        Whether to take that even so.
    weighed
        Whether to refuse a vehicle whose dry mass no water carries.

    Returns
    -------
    Vehicle
        The vehicle, checked.

    Raises
    ------
    InputError
        There is no such vehicle, or it cannot be; with file, line, field, value, unit and remedy.
    """
    preset = _preset(name_or_path)
    file = name_or_path if preset is None else f"preset {preset}"
    text = vehicle_text(name_or_path)
    vehicle = read_model(Vehicle, text, file)
    try:
        if sampled and not pumped:
            refuse_pump_and_valve(vehicle.engine)
        if weighed:
            check_mass(vehicle)
        check_vehicle(vehicle, sampled=sampled)
    except InputError as error:
        raise _at(error, text, file) from None
    return vehicle


def check_vehicle(vehicle: Vehicle, *, sampled: bool = False) -> None:
    """Raise InputError where a vehicle could not be loaded from its file, as of `load_vehicle`."""
    if isinstance(vehicle.motion, IdentifiedMotion):
        check_mass(vehicle)
    _check_parts_fit(vehicle if sampled else even_drag(vehicle))


def _check_parts_fit(vehicle: Vehicle) -> None:
    """Raise InputError where the actuator, the supply and the control law do not go together.

    Also where a parameter of the law `rate` is out of range: a float that looks without a pause is
    flown for ever.
    """
    if vehicle.command != "volume change":
        plant(vehicle)
    if vehicle.controller is None:
        return
    law, parameters = own_law(vehicle, sampled=False)
    for name, value in parameters._asdict().items() if law.name == RATE.name else ():
        least, above = _LEAST.get(name, 0.0), 0.0 if name in _ABOVE_0 else -math.inf
        place, unit = f"controller.parameters.{name}", RATE.units[name]
        check_number(value, place, unit, least=least, above=above, most=math.inf)


def vehicle_text(name_or_path: str | Path) -> str:
    """Return the TOML text of a preset's name or of a file, as it is.

    Raises InputError where there is neither.
    """
    preset = _preset(name_or_path)
    return file_text(Path(name_or_path)) if preset is None else preset_text(preset)


def _preset(name_or_path: str | Path) -> str | None:
    """Return the preset's name where one is meant: a word that is no path and no file here."""
    path = Path(name_or_path)
    if isinstance(name_or_path, Path) or name_or_path != path.name or path.suffix == ".toml":
        return None
    return None if name_or_path not in preset_names() and isfile(path) else name_or_path


def load_mission(path: str | Path) -> Mission:
    """Return the mission of a TOML file, or of an Argo float's configuration.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Mission
        Set-points (for `simulate`), or phases in cycles (for `mission`).

    Raises
    ------
    InputError
        The file cannot be read as a mission; with file, line, field, value, unit and remedy.
    """
    data = _file_bytes(Path(path))
    if _is_argo(data):
        from swimbladder.io.argo_config import argo_mission

        return argo_mission(data, path)
    return read_model(Mission, _text(data, path), path)


def _is_argo(data: bytes) -> bool:
    """Return whether a mission's file is JSON or netCDF; no TOML begins so."""
    from swimbladder.io.log_text import is_netcdf

    text = data.removeprefix(BOM_UTF8).lstrip(b"[ \t\r\n")
    return text.startswith(b"{") or is_netcdf(data)


def locate(error: InputError, path: str | Path) -> InputError:
    """Return an error about a field of the file at `path` with the file and the line filled in."""
    data = _file_bytes(Path(path))
    if not _is_argo(data):
        return _at(error, _text(data, path), path)
    if ".parameters." not in (error.field or ""):
        return error.at(file=path)
    remedy = "Volumes are the vehicle's: give it a [controller] of this law, as deep-arvor has"
    return error.but(remedy=remedy).at(file=path)


def file_text(path: Path) -> str:
    """Return the text of a file.

    Raises InputError where it cannot be read, is larger than 16 MiB or is not UTF-8.
    """
    return _text(_file_bytes(path), path)


def _text(data: bytes, path: str | Path) -> str:
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        what, remedy = f"not UTF-8 text, at byte {error.start}", "Save the file as UTF-8"
    raise InputError(what, file=path, field="file", remedy=remedy)


def _file_bytes(path: Path) -> bytes:
    try:
        data = read_at_most(path, _MOST_BYTES)
        if len(data) <= _MOST_BYTES:
            return data
        what, remedy = "larger than 16 MiB", "Check that it is the TOML file that is meant"
    except (OSError, ValueError) as error:
        what, remedy = why_unreadable(error, "TOML file")
    raise InputError(what, file=path, field="file", remedy=remedy)


def read_model(
    model: type[_Model], text: str, file: str | Path, *, versioned: bool = True
) -> _Model:
    """Return TOML text as a parameter class; `file` is what messages call the text.

    Raises InputError with file, line, field, value, unit and remedy; where the file is
    `versioned`, also where it does not state the schema version that this swimbladder reads.
    """
    data = _parse(text, file)
    if versioned:
        _check_version(data, text, file)
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _at(input_error(error, model), text, file) from None


def _parse(text: str, file: str | Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        words = str(error)
        what, _, place = words.rpartition(" (at ")
        number = place.removeprefix("line ").split(",")[0]
        line = int(number) if number.isdecimal() else text.count("\n") + 1
        what = f"this is not TOML: {(what or words)[:1].lower()}{(what or words)[1:]}"
        remedy = 'Write a line as name = number, or as name = "number unit" in quotes'
    except (RecursionError, ValueError) as error:
        why = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        what, line = f"this TOML cannot be read: {why}", None
        remedy = "See `swimbladder vehicle new --full` for a file with every field explained"
    raise InputError(what, file=file, line=line, field="syntax", remedy=remedy)


def _check_version(data: dict[str, Any], text: str, file: str | Path) -> None:
    given = data.get("schema_version")
    if given == SCHEMA_VERSION and type(given) is int:
        return
    if given is None:
        what, remedy = "the file does not say its schema version", _SCHEMA_REMEDY
    elif type(given) is int and given > SCHEMA_VERSION:
        what = f"the file is newer than this swimbladder, which reads version {SCHEMA_VERSION}"
        remedy = "Update swimbladder"
    else:
        what, remedy = "there is no such schema version", _SCHEMA_REMEDY
    raise _at(InputError(what, field="schema_version", value=given, remedy=remedy), text, file)


def _at(error: InputError, text: str, file: str | Path) -> InputError:
    """Return the error with its file and the line of its field, or of the nearest table above."""
    lines = key_lines(text)
    place = error.field or ""
    while place and place not in lines:
        place = place[: max(place.rfind("."), place.rfind("["), 0)]
    return error.at(file=file, line=lines.get(place))
