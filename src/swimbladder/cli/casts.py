"""What the commands that take a cast share: its options, and a column down to where it is asked.

With them stand the warning that a cast may be in another unit of pressure, depths and depth sensors
as commands about controllers take them, and what is said of a dry mass that the trim does not
carry.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import aside, progress, said_as_typed
from swimbladder.cli.logs import selections
from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Given, Several
from swimbladder.errors import InputError
from swimbladder.units import quantity

if TYPE_CHECKING:
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.vehicle import Vehicle


def refuse_doubted_unit(casts: Sequence[Cast], asked: float | None, rating: float | None) -> None:
    """Raise InputError as `check_cast_unit` does; what it warns of stands on stderr."""
    from swimbladder.physics.seawater.cast_unit import check_cast_unit

    with said_as_typed(Reading.named(), {}):
        for cast in casts:
            doubt = check_cast_unit(cast, asked, rating)
            aside(*([f"warning: {doubt}"] if doubt else ()))


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


class Reading(Options):
    """The casts of every command that takes some, how they are read and chosen in their files."""

    cast: Path | list[Path] | None = valued(
        "CTD", "CTD cast: CSV, netCDF, Argo profile.", name="--cast"
    )
    columns: Several = valued(
        "NAME=COLUMN", 'Column of the cast: "pressure_dbar=Druck@bar".', name="--cast-column"
    )
    where: Several = valued(
        "COLUMN=VALUE", "Rows of the cast; VALUE,VALUE: one cast each.", name="--cast-where"
    )
    log_format: Given = valued(
        "FORMAT", r"Format of the cast: TOML file with a \[log] table.", name="--cast-format"
    )
    profile: int | None = valued("N", "Profile in the cast's file.", name="--cast-profile", min=1)
    latitude: Given = valued("DEGREES", "Latitude of the cast.", name="--latitude", read=_degrees)
    longitude: Given = valued("DEGREES", "Longitude of the cast.", read=_degrees)
    salinity: float | None = valued("PSU", "Salinity where the cast has none; 0: fresh.")
    inversions: Given = valued("WHAT", "Inversions of density: average, keep (refuse).")

    def casts(self, place: float | None = None) -> list[Cast]:
        """Return the casts of files, all read alike; what was done to them is in their report.

        place: the latitude [degrees] where no option says one.
        Raises InputError for an option that is wrong, or that has no cast to be about.
        """
        with self.said_as_typed():
            return self._casts({"latitude": place, **self.given()})

    def _casts(self, given: dict[str, Any]) -> list[Cast]:
        given.pop("where", None)
        asked = given.pop("cast", [])
        paths = [asked] if isinstance(asked, Path) else asked
        if not paths:
            self.refuse(*NO_CAST, "cast")
            return []
        from swimbladder.io.casts import check_reading, read_cast

        facts = ("latitude", "longitude", "salinity", "inversions")
        check_reading(**{name: given[name] for name in facts if name in given})
        found = []
        for path, rows in product(paths, selections(self.where or [], "--cast-where")):
            with progress(f"reading {path.name}"):
                found.append(read_cast(path, where=rows, **given))
        return found


class CastReading(Reading):
    """One cast."""

    cast: Path | None = valued("CTD", "CTD cast: CSV, netCDF, Argo profile.")

    def casts(self, place: float | None = None) -> list[Cast]:
        """Return the cast; raises InputError also where rows are chosen of several."""
        if len(selections(self.where or [], "--cast-where")) > 1:
            what, remedy = "these are several casts, and one is taken", "Give one value"
            raise InputError(what, field="--cast-where", value=self.where, remedy=remedy)
        return super().casts(place)


class Casts(Reading):
    """Several casts."""

    cast: list[Path] | None = valued("CTD", "CTD cast: CSV, netCDF, Argo profile; repeatable.")


class LogCasts(Casts):
    """The casts that logs were made in: one, or one for each."""

    cast: list[Path] | None = valued("CTD", "CTD cast of the logs, or one for each; repeatable.")
    inversions: str = valued("WHAT", "Inversions of density: refuse, average, keep.", "average")

    @property
    def number(self) -> int:
        """How many casts there are."""
        return len(self.cast or ()) * len(selections(self.where or [], "--cast-where"))

    def water(self, rating: float | None) -> list[Column]:
        """Return the water for logs of a shallow vehicle, finely; none where none is given.

        rating: how deep the vehicle goes [m]. Raises InputError where a cast cannot be read or may
        be in another unit, or something is said of none.
        """
        found = self.casts()
        if not found:
            return []
        from swimbladder.physics.seawater import cast_column

        refuse_doubted_unit(found, 0.0, rating)
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
