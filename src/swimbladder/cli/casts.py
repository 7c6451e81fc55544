"""What the commands that take a cast share: its options, and a column down to where it is asked."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from swimbladder.cli.cast_unit import refuse_doubted_unit
from swimbladder.cli.common import progress, quantity
from swimbladder.cli.logs import pair
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast, Column

__all__ = [
    "CastColumns", "CastFile", "CastFiles", "CastProfile", "CastWhere", "Columns", "Inversions",
    "Latitude", "LogFormat", "Longitude", "Profile", "Salinity", "Where", "above_rating",
    "asked_casts", "casts_beside_logs", "pairs", "read_casts", "refuse_without_cast", "share",
    "water_of_cast", "water_of_logs",
]  # fmt: skip

_FAR_ABOVE = 0.5  # of the rating: a cast that ends above it may be in another unit

# The options of every command that takes a cast, so that none of them lacks one.
CastFile = Annotated[
    Path | None,
    typer.Option("--cast", metavar="CTD", help="The water: CSV, netCDF, Argo profile."),
]
Columns = Annotated[
    list[str] | None,
    typer.Option("--column", metavar="NAME=COLUMN", help="As for logs, NAME=COLUMN@UNIT too."),
]
Where = Annotated[
    list[str] | None,
    typer.Option("--where", metavar="COLUMN=VALUE", help="Only these rows of the file."),
]
LogFormat = Annotated[
    str | None,
    typer.Option("--log-format", metavar="FORMAT", help=r"TOML file with a \[log] table."),
]
Profile = Annotated[
    int | None,
    typer.Option("--profile", metavar="N", min=1, help="Which profile of the cast's file."),
]
Latitude = Annotated[str | None, typer.Option("--latitude", metavar="DEGREES", help="Of the cast.")]
Longitude = Annotated[
    str | None, typer.Option("--longitude", metavar="DEGREES", help="Of the cast.")
]
Salinity = Annotated[
    float | None,
    typer.Option("--salinity", metavar="PSU", help="Where the cast has none; 0: fresh."),
]
Inversions = Annotated[
    str | None,
    typer.Option("--inversions", metavar="WHAT", help="Large ones: average, keep (refuse)."),
]

# Where --where and --column are about logs: the cast's own.
CastFiles = Annotated[
    list[Path] | None,
    typer.Option("--cast", metavar="CTD", help="The water of the logs: one cast, or one for each."),
]
CastWhere = Annotated[
    list[str] | None,
    typer.Option(metavar="COLUMN=VALUE", help="Rows of the cast; VALUE,VALUE: one cast each."),
]
CastColumns = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=COLUMN", help='As --column, of the cast: "pressure_dbar=Druck@bar".'
    ),
]
CastProfile = Annotated[
    int | None,
    typer.Option(metavar="N", help="Which profile of the cast, from 1."),
]
_OF_CASTS = {"--column": "--cast-column", "--where": "--cast-where", "--profile": "--cast-profile"}
_SHALLOW = 0.1  # m, rows of the water of a shallow log: a halocline has half a metre


def water_of_logs(
    casts: Sequence[Path], where: Sequence[str], column: Sequence[str], profile: int | None,
    rating: float | None,
) -> list[Column]:  # fmt: skip
    """Return the water of casts for logs of a shallow vehicle, finely; none where none is given.

    rating: how deep the vehicle goes [m]. Raises InputError where a cast cannot be read or may be
    in another unit, or something is said of none.
    """
    for option, given in (("where", where), ("column", column), ("profile", profile)):
        if given and not casts:
            raise InputError(
                "it has no use without --cast", field=f"--cast-{option}", remedy="Give --cast FILE"
            )
    if not casts:
        return []
    from swimbladder.physics.seawater import cast_column

    found = casts_beside_logs(casts, where, column, profile)
    refuse_doubted_unit(found, 0.0, rating, option="--cast-column")
    return [cast_column(cast, step=_SHALLOW) for cast in found]


def water_of_cast(
    casts: Sequence[Cast], reach: float | None, rating: float | None
) -> Column | None:
    """Return the water of the one cast of a shallow vehicle, finely; None where there is none.

    reach [m]: the deepest place that is asked for, None where that is near the rating [m]. Raises
    InputError where the cast may be in another unit.
    """
    if not casts:
        return None
    refuse_doubted_unit(casts, reach, rating)
    with progress("tabulating the water"):
        from swimbladder.physics.seawater import cast_column

        return cast_column(casts[0], step=_SHALLOW)


def casts_beside_logs(
    paths: Sequence[Path], where: Sequence[str], column: Sequence[str], profile: int | None
) -> list[Cast]:
    """Return the casts of files, of each file those that `where` chooses; inversions averaged.

    Raises InputError as `read_casts` does.
    """
    from swimbladder.cli.logs import selections

    found: list[Cast] = []
    mapped = pairs(list(column), "--cast-column")
    for rows in selections(list(where)):
        try:
            found += read_casts(
                paths, columns=mapped, where=rows, log_format=None, profile=profile, latitude=None,
                longitude=None, salinity=None, inversions="average",
            )  # fmt: skip
        except InputError as error:
            raise _of_cast(error) from None
    return found


def _of_cast(error: InputError) -> InputError:
    """Return an error about a cast with the options that are about it where logs are read too."""
    remedy, field = error.remedy or "", error.field
    for option, meant in _OF_CASTS.items():
        remedy = remedy.replace(option, meant)
        field = meant if field in (option, option[2:]) else field
    remedy = re.sub(r"state --salinity, 0|give --salinity \S+", "fill a column salinity, 0", remedy)
    return type(error)(
        error.what, file=error.file, line=error.line, field=field, value=error.value,
        unit=error.unit, remedy=remedy,
    )  # fmt: skip


def asked_casts(
    paths: Sequence[Path],
    *,
    column: list[str] | None,
    where: list[str] | None,
    log_format: str | None,
    profile: int | None,
    latitude: str | None,
    longitude: str | None,
    salinity: float | None,
    inversions: str | None,
    place: float | None = None,
) -> list[Cast]:
    """Return the casts of files as the options say.

    place: the latitude [degrees] where no option says one.
    Raises InputError for an option that is wrong, or that has no cast to be about.
    """
    refuse_without_cast(
        paths, column=column, where=where, log_format=log_format, profile=profile,
        latitude=latitude, longitude=longitude, salinity=salinity, inversions=inversions,
    )  # fmt: skip
    given = _degrees(latitude, "--latitude", 90.0)
    return read_casts(
        paths, columns=pairs(column or [], "--column"), where=pairs(where or [], "--where"),
        log_format=log_format, profile=profile, latitude=place if given is None else given,
        longitude=_degrees(longitude, "--longitude", 360.0), salinity=salinity,
        inversions=_inversion_choice(inversions or "refuse"),
    )  # fmt: skip


def read_casts(
    paths: Sequence[Path],
    *,
    columns: Mapping[str, str],
    where: Mapping[str, str],
    log_format: str | None,
    profile: int | None,
    latitude: float | None,
    longitude: float | None,
    salinity: float | None,
    inversions: Literal["refuse", "average", "keep"],
) -> list[Cast]:
    """Return the casts of files, all read alike; what was done to them is in their report.

    Raises LogError, an InputError, with file, line, column, value and remedy.
    """
    from swimbladder.io.casts import read_cast

    found = []
    for path in paths:
        with progress(f"reading {path.name}"):
            found.append(read_cast(
                path, columns=columns, where=where, form=log_format, profile=profile,
                latitude=latitude, longitude=longitude, salinity=salinity, inversions=inversions,
            ))  # fmt: skip
    return found


def above_rating(name: str, end: float, rating: float | None, option: str) -> list[str]:
    """Return what is said of a cast that ends above the rating [m] though no depth was asked for.

    Raises InputError, naming the option that asks for a depth, where it ends far above.
    """
    if rating is None:
        return []
    if end < _FAR_ABOVE * rating:
        raise InputError(
            f"it ends at {end:.0f} m, and the vehicle is rated for {rating:g} m", file=name,
            field="--cast",
            remedy="Is its pressure in bar, not dbar? Then map it with --column "
            f'"pressure_dbar=NAME@bar". If not, say how deep it is to go: {option} "{end:.0f} m"',
        )  # fmt: skip
    # the grid of a cast that was taken down to the rating ends within a metre of it
    if end >= rating - 1.0:
        return []
    return [
        f"{name} ends at {end:.0f} m, the vehicle is rated for {rating:g} m: nothing is said of "
        "the water below"
    ]


def pairs(texts: list[str], option: str) -> dict[str, str]:
    """Return the pairs NAME=VALUE of an option; raises InputError where a name stands twice."""
    found: dict[str, str] = {}
    for text in texts:
        name, value = pair(text, option)
        if name in found:
            raise InputError("given twice", field=option, value=name, remedy="Give it once")
        found[name] = value
    return found


def _degrees(text: str | None, option: str, most: float) -> float | None:
    """Return an angle on the globe [degrees]; raises InputError beyond `most`."""
    if text is None:
        return None
    number = quantity(text.removesuffix("deg").strip(), "", option)
    assert number is not None
    if abs(number) > most:
        raise InputError(
            f"not between -{most:g} and {most:g}", field=option, value=text, unit="degrees",
            remedy="Give degrees with decimals, south and west negative",
        )  # fmt: skip
    return number


def share(text: str, option: str) -> float:
    """Return a probability given as a share or in percent."""
    number = quantity(text, "", option)
    assert number is not None
    return number


def _inversion_choice(text: str) -> Literal["refuse", "average", "keep"]:
    """Return what to do with density inversions; raises InputError for another word."""
    choices: tuple[Literal["refuse", "average", "keep"], ...] = ("refuse", "average", "keep")
    for choice in choices:
        if text == choice:
            return choice
    raise InputError(
        "not one of the choices", field="--inversions", value=text,
        remedy="Choose refuse, average or keep",
    )  # fmt: skip


def refuse_without_cast(cast: object, **options: object) -> None:
    """Raise InputError where an option says how to read a cast and there is none."""
    for name, value in options.items():
        if not cast and value not in (None, []):
            raise InputError(
                "it says how to read a cast, and there is none",
                field=f"--{name.replace('_', '-')}", value=value, remedy="Give --cast too",
            )  # fmt: skip
