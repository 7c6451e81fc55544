"""``swimbladder identify --cast``: drag, hull, pump and valve from logs of deep dives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from swimbladder.cli.casts import refuse_doubted_unit
from swimbladder.cli.common import labelled, progress, table
from swimbladder.cli.logs import once
from swimbladder.cli.options import names
from swimbladder.cli.settings import known, setting
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from swimbladder.cli.casts import LogCasts
    from swimbladder.cli.logs import Chosen, LogReading
    from swimbladder.cli.options import Files
    from swimbladder.cli.settings import Sought
    from swimbladder.estimation.motion.deep import DeepIdentification
    from swimbladder.vehicle import Vehicle

_DBAR = 1e4  # Pa


def refuse_others(given: Mapping[str, object]) -> None:
    """Raise InputError for an option that has no use with --cast; given: values by option."""
    for option, value in given.items():
        if value:
            raise InputError(
                "it has no use with --cast and a pump and valve", field=option, value=value,
                remedy="Leave it out: deep dives of a pump and valve have no use for it",
            )  # fmt: skip


def identify_deep(
    logs: Sequence[Chosen], vehicle: Vehicle, given: str, reading: LogReading, sought: Sought,
    casts: LogCasts, to: Files,
) -> None:  # fmt: skip
    """Identify, write the files, print; exit code 1 where a parameter is not identifiable.

    given: how the vehicle was named.
    """
    import gsw
    import numpy as np

    from swimbladder.estimation.motion.deep_model import CAST, DEEP, check_deep_request
    from swimbladder.io.float_logs import read_float_log
    from swimbladder.show.report.identification import check_folder

    units = {name: about.unit for name, about in DEEP.items()}
    held = once([setting(text, units) for text in sought.fixed or ()], "--set")
    errors = {name: about.unit for name, about in CAST.items()}
    before = once([known(text, units | errors) for text in sought.priors or ()], "--prior")
    free = None if sought.free is None else names(sought.free)
    to.check()
    check_folder(to.out, given)
    check_deep_request(vehicle, len(logs), casts.number, free=free, fixed=list(held), priors=before)
    mapped = reading.columns()
    read = []
    for log in logs:
        with progress(f"reading {log.label}"):
            read.append(read_float_log(
                log.path, log_format_name=reading.log_format, columns=mapped, where=log.where
            ))  # fmt: skip
    found_casts = casts.casts()
    deepest = max(float(np.nanmax(log.pressure)) for log in read) / _DBAR
    reach = -float(gsw.z_from_p(deepest, found_casts[0].latitude))
    refuse_doubted_unit(found_casts, reach, vehicle.hull.depth_limit, option="--cast-column")

    from swimbladder.estimation.motion.deep import identify_deep as identify
    from swimbladder.physics.seawater import cast_column
    from swimbladder.show.report.deep import write_deep

    columns = [cast_column(cast) for cast in found_casts]
    with progress("identifying from deep dives", 1.0) as advance:
        found = identify(
            read, columns, vehicle, free=free, fixed=held, priors=before, advance=advance
        )
    answer = found.to_json()
    with progress("drawing the picture"):
        files = write_deep(found, to.out, answer=answer)
    notes = [note for log in read for note in log.report]
    shown = _shown(found, notes)
    to.answer(answer, files, shown, good=found.identified, why=found.sentences[:1])


def _shown(found: DeepIdentification, notes: Sequence[str]) -> Iterator[object]:
    """Give what is printed, the answer first."""
    first, *others = found.sentences
    yield from (Text(first, style="bold"), *others)
    yield from ("", _parameters(found), "", _dives(found), "")
    yield from (*labelled("assumed", found.assumptions), *labelled("note", notes))


def _parameters(found: DeepIdentification) -> Table:
    from swimbladder.units import shown_unit, unit_factor

    words = {"data": "the dives", "prior": "its prior", "set": "set"}
    if found.inconsistent:
        words |= dict.fromkeys(("data", "prior"), "not identifiable")
    rows = []
    for name, e in found.parameters.items():
        shown = shown_unit(e.unit) if e.unit else ""
        factor = unit_factor(e.unit, shown) if e.unit else 1.0
        low, high = (factor * x for x in e.ci95)
        sure = (f"{factor * e.std:.2g}", f"{low:.4g} to {high:.4g}")
        sure = ("-", "-") if found.inconsistent else sure
        rows.append((name, f"{factor * e.value:.4g}", *sure, shown or "-", words[e.origin]))
    return table(("", "value", "1 sigma", "95 % interval", "unit", "from"), rows)


def _dives(found: DeepIdentification) -> Table:
    headings = ("dive", "samples", "deepest", "imbalance", "speed off by", "replay off by")
    rows = (
        (
            told.dive.name,
            str(numbers["samples"]),
            f"{numbers['deepest_Pa'] / 1e4:.0f} dbar",
            f"{1e6 * numbers['imbalance_rms_m3']:.1f} mL",
            f"{1e3 * numbers['speed_rms_m_s']:.1f} mm/s",
            f"{numbers['replay_rms_Pa'] / 1e4:.0f} dbar",
        )
        for told, numbers in zip(found.dives, found.to_json()["dives"], strict=True)
    )
    return table(headings, rows)
