"""Formats of casts that are no table of text: swimbladder's own, and those of other packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from swimbladder.errors import InputError, SwimbladderError
from swimbladder.io.cast_cnv import cnv_cast, is_cnv
from swimbladder.io.cast_netcdf import netcdf_cast
from swimbladder.io.cast_raw import RawCast
from swimbladder.io.netcdf_in import is_netcdf
from swimbladder.plugins import Registry


@dataclass(frozen=True, kw_only=True)
class CastFormat:
    """A format of casts.

    recognises: whether bytes are those of such a file. read: (bytes, path, columns of the user's
    as for texts, profile asked for) -> (the cast as it stands there, the profile that is still
    asked for, None where the file's are known); raises LogError. What it gives is checked as
    every cast is: units, order, density.
    """

    recognises: Callable[[bytes], bool]
    read: Callable[[bytes, Path, Mapping[str, str], int | None], tuple[RawCast, int | None]]


def _read_cnv(
    data: bytes, path: Path, columns: Mapping[str, str], profile: int | None
) -> tuple[RawCast, int | None]:
    return replace(cnv_cast(data, path, columns), unit_stated=True), profile


def _accept(form: Any, name: str) -> CastFormat:
    if not isinstance(form, CastFormat):
        raise InputError(
            "it is no CastFormat",
            remedy="Let the entry point name a swimbladder.io.cast_formats.CastFormat",
        )
    return CastFormat(recognises=_guarded(form.recognises, name), read=_guarded(form.read, name))


def _guarded(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a function of another package whose failures are said to be that package's."""

    def call(*given: Any) -> Any:
        try:
            return function(*given)
        except SwimbladderError:
            raise
        except Exception as error:  # whatever another package does
            package = CAST_FORMATS.package(name)
            raise InputError(
                f"the cast format {name!r} of the package {package} fails: "
                f"{type(error).__name__}: {' '.join(str(error).split())}",
                field="--cast", remedy=f"Update {package}, or uninstall it",
            ) from error  # fmt: skip

    return call


CAST_FORMATS: Registry[CastFormat] = Registry(
    "swimbladder.cast_formats", "cast format",
    own={
        "netcdf": lambda: CastFormat(recognises=is_netcdf, read=netcdf_cast),
        "cnv": lambda: CastFormat(recognises=is_cnv, read=_read_cnv),
    },
    accept=_accept,
)  # fmt: skip


def format_of(data: bytes, path: Path) -> tuple[CastFormat | None, list[str]]:
    """Return the format of a file's bytes, None for text, and what is to be said of formats.

    Raises InputError where several know them as their own. swimbladder's own are asked first.
    """
    for name in CAST_FORMATS.own:
        if CAST_FORMATS[name].recognises(data):
            return CAST_FORMATS[name], []
    said, known = [], {}
    for name in CAST_FORMATS.names()[len(CAST_FORMATS.own) :]:
        try:
            if CAST_FORMATS[name].recognises(data):
                known[name] = CAST_FORMATS[name]
        except InputError as error:
            said.append(str(error))
    if len(known) > 1:
        raise InputError(
            f"several cast formats know it as theirs: {' and '.join(known)}", file=path,
            field="--cast", remedy="Uninstall the packages of all but one: "
            f"{', '.join(str(CAST_FORMATS.package(name)) for name in known)}",
        )  # fmt: skip
    return next(iter(known.values()), None), said
