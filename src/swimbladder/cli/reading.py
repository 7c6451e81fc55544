"""What the commands that read logs and casts share.

Which rows of which file make a log, and its columns; the options of a cast, and a column of water
down to where it is asked. With them stand the warning that a cast may be in another unit of
pressure, depths and depth sensors as commands about controllers take them, and what is said of a
dry mass that the trim does not carry.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from swimbladder.cli.common import aside, progress, said_as_typed
from swimbladder.cli.options import Given, Options, Several, once, pair, pairs, valued
from swimbladder.errors import InputError, LogError
from swimbladder.units import quantity

if TYPE_CHECKING:
    from swimbladder.io.log_format import LogFormat
    from swimbladder.io.logs import Log
    from swimbladder.physics.seawater import Cast, Column
    from swimbladder.vehicle import Vehicle


def refuse_doubted_unit(casts: Sequence[Cast], asked: float | None, rating: float | None) -> None:
    """Raise InputError as `check_cast_unit` does; what it warns of stands on stderr."""
    from swimbladder.physics.seawater.cast import check_cast_unit

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


LogVehicle = Annotated[
    str | None,
    typer.Option("--vehicle", metavar="VEHICLE", help="Preset or TOML file (that of the format)."),
]


class Chosen(NamedTuple):
    """A log: a file, and the rows of it that hold these values."""

    path: Path
    where: dict[str, str]

    @property
    def label(self) -> str:
        """The file's name and the selection."""
        rows = ", ".join(f"{name}={value}" for name, value in self.where.items())
        return f"{self.path.name} {rows}".rstrip()


def selections(texts: Sequence[str], option: str = "--where") -> list[dict[str, str]]:
    """Return one selection of rows for each log or cast: all combinations of the values given."""
    given = [pair(text, option) for text in texts]
    names = [name for name, _ in given]
    values = [[v.strip() for v in value.split(",") if v.strip()] for _, value in given]
    return [dict(zip(names, one, strict=True)) for one in product(*values)]


def _states(text: str) -> bool:
    """Whether a text given as a log format is a field of one, not its name."""
    return "=" in text and not Path(text).exists()


class LogReading(Options):
    """Which rows of files make logs, and how they are read."""

    where: Several = valued("COLUMN=VALUE", "Rows of the log; VALUE,VALUE: one log each.")
    columns: Several = valued("NAME=COLUMN", r'Column of the log: "depth_m=Depth \[cm]" or @cm.')
    log_format: Several = valued(
        "FORMAT",
        r"Format of the log: TOML file with a \[log] table; also FIELD=VALUE: "
        "atmospheric_pressure=gauge.",
    )

    def chosen(self, paths: Sequence[Path]) -> list[Chosen]:
        """Return every selection of every file, in order; raises InputError naming the option."""
        return [Chosen(path, one) for path in paths for one in selections(self.where or [])]

    @property
    def mapped(self) -> dict[str, str]:
        """The columns by name; raises InputError naming the option."""
        return pairs(self.columns or [], "--column")

    @property
    def format_name(self) -> str | None:
        """The log format that is named."""
        named = [text for text in self.log_format or () if not _states(text)]
        return once([("", name) for name in named], "--log-format").get("")

    def _form(self, known: str | None) -> LogFormat | None:
        """Return the log format asked for, or a known one, with fields; None: the usual.

        Raises InputError naming the option.
        """
        from swimbladder.io.log_format import LogFormat, log_format

        name = self.format_name or known
        stated = pairs([text for text in self.log_format or () if _states(text)], "--log-format")
        form = None if name is None else log_format(name)
        if not stated:
            return form
        given = {} if form is None else form.model_dump(exclude_unset=True)
        try:
            return LogFormat(**{**given, **stated})
        except InputError as error:
            raise error.but(field=f"--log-format {error.field}") from None

    def log(
        self,
        log: Chosen,
        vehicle: Vehicle | None,
        *,
        quiet: bool = False,
        required: Collection[str] = ("time_s", "depth_m"),
    ) -> Log:
        """Return the log of a vehicle, read by the format asked for or the one shipped for it.

        quiet: what was taken has been said. required: columns it must have. A pressure becomes a
        depth by the density of the vehicle's water, where none is stated. Raises LogError, an
        InputError, with file, line, column, value and remedy.
        """
        from swimbladder.io.columns import NOT_READ, TAKEN
        from swimbladder.io.log_format import LogFormat
        from swimbladder.io.logs import read_log, shipped_format

        columns, said, known = self.mapped, list[str](), None
        if self.format_name is None:
            known = shipped_format(log.path, {*required} - {*columns})
        form = self._form(known)
        if known:
            said.append(f"its columns are those of the log format {known}, and read so")
        with progress(f"reading {log.label}"):
            how: dict[str, Any] = {"columns": columns, "where": log.where, "required": required}
            try:
                found = read_log(log.path, **how, log_format=form)
            except LogError as error:
                if error.field == "water_density" and vehicle is not None:
                    density = vehicle.water.density
                    said.append(f"water of {density:g} kg/m3, the vehicle's, makes depths of it")
                    form = (form or LogFormat()).model_copy(update={"water_density": density})
                    found = read_log(log.path, **how, log_format=form)
                elif form is None and not columns and error.field in required:
                    raise _of_its_kind(error, log.path, vehicle) from None
                else:
                    raise
        said += [note for note in found.report if note.startswith((TAKEN, NOT_READ))]
        aside(*(f"{log.path}: {note}" for note in said if not quiet))
        return found


def vehicle_of(logs: Sequence[Chosen], given: str | None) -> str:
    """Return the vehicle given, else the preset that the logs' known format is named after.

    Raises InputError where there is none.
    """
    from swimbladder.io.logs import shipped_format
    from swimbladder.io.presets import preset_names

    if given is not None:
        return given
    found = {shipped_format(log.path, ("time_s", "depth_m")) for log in logs}
    name = found.pop() if len(found) == 1 else None
    if name not in preset_names():
        why = "which vehicle made the log is not said"
        remedy = f"Give --vehicle: one of {', '.join(preset_names())}, or a file that "
        remedy += "`swimbladder vehicle new` begins"
        raise InputError(why, field="--vehicle", remedy=remedy)
    aside(f"the logs are in the format of {name}: --vehicle {name}")
    return str(name)


def _of_its_kind(error: LogError, path: Path, vehicle: Vehicle | None) -> LogError:
    """Return the error about a missing column with what is known of such files."""
    from swimbladder.io.log_formats import FORMATS
    from swimbladder.io.log_formats.mermaid import is_mermaid
    from swimbladder.io.log_text import read_bytes

    if is_mermaid(read_bytes(path)):
        has = "pressures and runs of a pump, and no volume"
        why = f"the log of a float of the MERMAID kind has {has}"
        remedy = "Identify it with --cast and a --vehicle that has a pump and a valve"
        return LogError(why, file=path, field=error.field, remedy=remedy)
    known = [name for name in FORMATS.own if vehicle and name.startswith(vehicle.name)]
    if not known:
        return error
    formats = f"formats of this vehicle's logs, for --log-format: {', '.join(known)}"
    return error.but(remedy=f"{error.remedy}; {formats}")
