"""What the commands that take a cast share: its options, and a column down to where it is asked.

With them stand the warning that a cast may be in another unit of pressure, depths and depth sensors
as commands about controllers take them, and what is said of a dry mass that the trim does not
carry.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import aside, progress, quantity, said_as_typed
from swimbladder.cli.logs import selections
from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Given, Several, pairs
from swimbladder.errors import OPTIONS, as_asked

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.vehicle import Vehicle


OF_CASTS = {name: f"--cast-{name.removesuffix('s')}" for name in ("columns", "where", "profile")}
"""The options about casts of commands whose --where and --column are about logs."""


def refuse_doubted_unit(
    casts: Sequence[Cast],
    asked: float | None,
    rating: float | None,
    options: Mapping[str, str] = OPTIONS,
) -> None:
    """Raise InputError as `check_cast_unit` does; what it warns of stands on stderr."""
    from swimbladder.physics.seawater.cast_unit import check_cast_unit

    for cast in casts:
        with said_as_typed(options, {}):
            doubt = check_cast_unit(cast, asked, rating)
        aside(*([f"warning: {as_asked(doubt, options)}"] if doubt else ()))


@dataclass(frozen=True)
class DepthSensor(Options):
    """The depth sensor that a vehicle is tried with."""

    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's sensor).")
    depth_quantum: Given = valued("DEPTH", "Quantum of the depth sensor (the vehicle's).")

    def on(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with this sensor; raises InputError for one that there is not."""
        return vehicle.with_sensors(**self.given())


def warn_of_mass(vehicle: Vehicle) -> None:
    """Say on stderr where a vehicle weighs another mass than its dry one."""
    from swimbladder.physics.hull import mass_mismatch

    doubt = mass_mismatch(vehicle)
    if doubt:
        inertia = "it sinks and rises by trim_error, and the dry mass is its inertia"
        aside(f"warning: {doubt}; {inertia}")


def _degrees(text: str, option: str) -> float | None:
    return quantity(text.removesuffix("deg").strip(), "", option)


NO_CAST = ("it says how to read a cast, and there is none", "Give --cast too")


@dataclass(frozen=True)
class Reading(Options):
    """The casts of every command that takes some, how they are read and chosen in their files."""

    cast: Path | list[Path] | None = valued(
        "CTD", "CTD cast: CSV, netCDF, Argo profile.", name="--cast"
    )
    columns: Several = valued("NAME=COLUMN", "Column, NAME=COLUMN@UNIT too.", name="--column")
    where: Several = valued("COLUMN=VALUE", "Only these rows of the file.", name="--where")
    log_format: Given = valued("FORMAT", r"TOML file with a \[log] table.")
    profile: int | None = valued("N", "Profile in the cast's file.", name="--profile", min=1)
    latitude: Given = valued("DEGREES", "Of the cast.", name="--latitude", read=_degrees)
    longitude: Given = valued("DEGREES", "Of the cast.", name="--longitude", read=_degrees)
    salinity: float | None = valued("PSU", "If the cast has none; 0: fresh.", name="--salinity")
    inversions: Given = valued("WHAT", "Inversions: average, keep (refuse).", name="--inversions")

    def casts(self, place: float | None = None) -> list[Cast]:
        """Return the casts of files, all read alike; what was done to them is in their report.

        place: the latitude [degrees] where no option says one.
        Raises InputError for an option that is wrong, or that has no cast to be about.
        """
        given = self.given()
        asked = given.pop("cast", [])
        paths = [asked] if isinstance(asked, Path) else asked
        if not paths:
            self.refuse(*NO_CAST, "cast")
            return []
        from swimbladder.io.casts import check_reading

        facts = ("latitude", "longitude", "salinity", "inversions")
        check_reading(**{name: given[name] for name in facts if name in given})
        return _read({"latitude": place, **given}, paths)


@dataclass(frozen=True)
class CastReading(Reading):
    """One cast."""

    cast: Path | None = valued("CTD", "CTD cast: CSV, netCDF, Argo profile.")


@dataclass(frozen=True)
class Casts(Reading):
    """Several casts."""

    cast: list[Path] | None = valued("CTD", "CTD casts: CSV, netCDF, Argo; repeatable.")


def _read(given: Mapping[str, Any], paths: Sequence[Path]) -> list[Cast]:
    from swimbladder.io.casts import read_cast

    found = []
    for path in paths:
        with progress(f"reading {path.name}"):
            found.append(read_cast(path, **given))
    return found


@dataclass(frozen=True)
class LogCasts(Options):
    """The casts of commands whose --where and --column are about logs."""

    cast: list[Path] | None = valued("CTD", "CTD cast of the logs, or one for each.")
    cast_where: Several = valued("COLUMN=VALUE", "Rows of the cast; VALUE,VALUE: one cast each.")
    cast_column: Several = valued("NAME=COLUMN", 'Column of the cast: "pressure_dbar=Druck@bar".')
    cast_profile: int | None = valued("N", "Profile in the cast's file, from 1.")

    @property
    def number(self) -> int:
        """How many casts there are."""
        return len(self.cast or ()) * len(selections(self.cast_where or []))

    def casts(self) -> list[Cast]:
        """Return the casts, of each file those that --cast-where chooses; inversions averaged.

        Raises LogError, an InputError, with file, line, column, value and remedy.
        """
        found: list[Cast] = []
        columns = pairs(self.cast_column or [], "--cast-column")
        reading = {"columns": columns, "profile": self.cast_profile, "inversions": "average"}
        for rows in selections(self.cast_where or []):
            with said_as_typed(OF_CASTS, {}):
                found += _read({**reading, "where": rows}, self.cast or [])
        return found

    def water(self, rating: float | None) -> list[Column]:
        """Return the water for logs of a shallow vehicle, finely; none where none is given.

        rating: how deep the vehicle goes [m]. Raises InputError where a cast cannot be read or may
        be in another unit, or something is said of none.
        """
        if not self.cast:
            self.refuse("it has no use without --cast", "Give --cast FILE")
            return []
        from swimbladder.physics.seawater import cast_column

        found = self.casts()
        refuse_doubted_unit(found, 0.0, rating, OF_CASTS)
        return [cast_column(cast, step=_SHALLOW) for cast in found]


_SHALLOW = 0.1  # m, rows of the water of a shallow log: a halocline has half a metre


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
