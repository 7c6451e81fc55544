"""What TAB offers for a value: names that are known, and files of the kinds that are read.

Where nothing is offered, the shell offers its files.
"""

import os
import tomllib
from collections.abc import Iterable, Iterator
from functools import partial
from glob import escape, glob
from importlib.resources import files
from typing import Any, NamedTuple

OFFERS = tomllib.loads(files(__package__).joinpath("completion.toml").read_text(encoding="utf-8"))


class Offer(NamedTuple):
    """A value, as a shell's completion takes it."""

    value: str
    help: str = ""
    type: str = "plain"


def with_offers(group: Any) -> Any:
    """Return the same command line, whose parameters offer values."""
    for name, command in _commands(group):
        for parameter in command.params:
            word = parameter.metavar or ""
            keys = (f"{name} {parameter.opts[0]}", parameter.opts[0], word)
            words, endings = (
                next((OFFERS[table][key] for key in keys if key in OFFERS[table]), ())
                for table in ("words", "files")
            )
            if words or endings or word.startswith(("KIND", "LAW")):
                parameter.shell_complete = partial(_offers, word, words, tuple(endings))
    return group


def _commands(group: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    for own, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, own)
        else:
            yield f"{name} {own}".strip(), command


def _offers(
    word: str, words: Iterable[str], endings: tuple[str, ...], _: object, incomplete: str
) -> list[Offer]:
    """Return what begins as a value does that is not complete."""
    before, comma, last = incomplete.rpartition(",") if "," in word else ("", "", incomplete)
    names = [name for name in words or _names(word) if name.startswith(last)]
    found = [f"{before}{comma}{name}" for name in names]
    return [Offer(value) for value in [*found, *_paths(incomplete, endings)]]


def _names(word: str) -> Iterable[str]:
    """Return the names that a value may be, by the word for it."""
    if word in ("VEHICLE", "BODY"):
        from swimbladder.io.presets import preset_names

        return preset_names()
    if word == "FORMAT":
        from swimbladder.io.log_formats import FORMATS

        return FORMATS.names()
    if word == "KIND":
        from swimbladder.io.vehicle_file import KINDS

        return KINDS
    if word.startswith("LAW"):
        from swimbladder.control.registry import LAWS

        return LAWS.names()
    return ()


def _paths(start: str, endings: tuple[str, ...]) -> list[str]:
    """Return the folders that begin so, and files with one of these endings.

    A folder that is alone is entered.
    """
    found = []
    for path in sorted(glob(f"{escape(start)}*")) if endings else ():
        if os.path.isdir(path):
            found.append(f"{path}/")
        elif path.endswith(endings):
            found.append(path)
    alone = len(found) == 1 and found[0].endswith("/")
    return (_paths(found[0], endings) if alone else found) or found
