"""``swimbladder identify``: the vertical motion's parameters from logs, with intervals.

The terminal shows the answer first, then its basis. With a cast, and a vehicle with pump and valve,
drag, hull, pump and valve are identified from logs of deep dives.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swimbladder.cli.casts import LogCasts, refuse_doubted_unit
from swimbladder.cli.common import progress, working
from swimbladder.cli.logs import LogReading, LogVehicle, vehicle_of
from swimbladder.cli.options import Files, LogFiles, Options, Sought, flag, grouped, loaded, valued
from swimbladder.cli.texts import Given, deviation
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.cli.logs import Chosen
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle

_DBAR = 1e4  # Pa


def _identify_deep(
    logs: Sequence[Chosen],
    vehicle: Vehicle,
    given: str,
    reading: LogReading,
    sought: Sought,
    casts: LogCasts,
    to: Files,
) -> None:
    """Identify, write the files, print; exit code 1 where a parameter is not identifiable.

    given: how the vehicle was named.
    """
    import gsw
    import numpy as np

    from swimbladder.estimation.motion.deep_model import check_deep_request
    from swimbladder.io.float_logs import read_float_log
    from swimbladder.show.identification import check_folder

    asked = sought.read()
    del asked["drag"]
    check_folder(to.out, given)
    asked["fixed"], asked["priors"] = check_deep_request(vehicle, len(logs), casts.number, **asked)
    how: Any = {"log_format": reading.format_name, "columns": reading.mapped}
    read = []
    for log in logs:
        with progress(f"reading {log.label}"):
            read.append(read_float_log(log.path, **how, where=log.where))
    found_casts = casts.casts()
    deepest = max(float(np.nanmax(log.pressure)) for log in read) / _DBAR
    reach = -float(gsw.z_from_p(deepest, found_casts[0].latitude))
    refuse_doubted_unit(found_casts, reach, vehicle.hull.depth_limit)

    from swimbladder.estimation.motion.deep import identify_deep as identify
    from swimbladder.physics.seawater import cast_column
    from swimbladder.show.deep import DeepIdentificationShown

    columns = [cast_column(cast) for cast in found_casts]
    with progress("identifying from deep dives", 1.0) as advance:
        found = identify(read, columns, vehicle, **asked, advance=advance)
    to.answer(DeepIdentificationShown(found, notes=[note for log in read for note in log.report]))


class Fit(Options):
    """How logs are fitted, as `estimation.motion.identify` has it."""

    neutral_std: Given = valued(
        "VOLUME",
        "Prior of each log's neutral volume, 1 sigma; or none. (0.5 cm3, if the logs agree.)",
        read=deviation("m3"),
    )
    speed_std: str = valued(
        "SPEED", "Prior of each log's start speed, 1 sigma; or none.", "none", read=deviation("m/s")
    )
    drift_std: str = valued("RATE", "Drift of each log's neutral volume, 1 sigma.", "0.1 cm3/min")
    delay_std: str = valued("TIME", "Delay of the volumes' time stamps, 1 sigma.", "0.2 s")
    drive: Given = valued("INPUT", "Input: volume or voltage (first logged).")
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")
    surface_margin: str = valued("DEPTH", "Smallest depth used.", "0.1 m")
    profiles: bool = flag("--profiles/--no-profiles", "Profile likelihoods.", True)
    process_noise: str = valued("MODE", "Process noise: auto, always, never.", "auto")
    posterior: bool = flag("--posterior", "Sample the posterior (needs emcee).")
    seed: int = valued("N", "Seed of the posterior samples.", 1, min=0)
    paper: bool = flag("--paper", "Add the paper's fits: eqs (26), (27), averaged.")


@grouped("where column free fixed prior drag", out=Path("swimbladder-identify"))
def identify(
    logs: LogFiles,
    vehicle: LogVehicle = None,
    *,
    reading: LogReading,
    sought: Sought,
    fit: Fit,
    casts: LogCasts,
    to: Files,
) -> None:
    """Identify a vehicle's vertical motion from logs, with intervals and a report.

    All logs are fitted jointly as experiments with one vehicle; each has its own neutral volume
    and start. With --cast the neutral volume follows the density of the water. For a vehicle with
    a pump and a valve, deep dives in that water identify drag, hull, pump and valve from their
    run times. Exit code 1: a parameter is not identifiable from the logs; no vehicle is written.
    """
    vehicle = vehicle_of(reading.chosen(logs), vehicle)
    v = loaded(vehicle)
    if v.command == "volume change":
        useless = "it has no use with --cast and a pump and valve"
        remedy = "Leave it out: deep dives of a pump and valve have no use for it"
        sought.refuse(useless, remedy, "free", "fixed", "priors")
        fit.refuse(useless, remedy, "profiles")
        if not casts.cast:
            why = "deep dives need the water that they were made in"
            remedy = "Give a CTD cast as deep as the dives with --cast FILE"
            raise InputError(why, field="--cast", remedy=remedy)
        return _identify_deep(reading.chosen(logs), v, vehicle, reading, sought, casts, to)
    if casts.cast and fit.paper:
        why, remedy = "the paper's fits do not model layered water", "Leave --paper out, or --cast"
        raise InputError(why, field="--paper", remedy=remedy)
    options = {**sought.given(), **fit.given()}
    paper, seed = options.pop("paper"), options.pop("seed")
    options["posterior"] = seed if fit.posterior else None
    options["casts"] = casts.water(v.hull.depth_limit)
    given: list[Log] = []
    seen: set[Path] = set()
    for log in reading.chosen(logs):
        quiet = log.path in seen
        if casts.cast and not quiet:
            _refuse_runs(log.path, v, reading.mapped)
        given.append(reading.log(log, v, quiet=quiet))
        seen.add(log.path)
    with progress("loading the simulator"):
        from swimbladder.estimation.motion import identify as identify_logs
        from swimbladder.estimation.motion.paper_method import paper_fits
        from swimbladder.show.identification import IdentificationShown, check_folder

    check_folder(to.out, vehicle)
    begun = time.perf_counter()
    logs_given = "one log" if len(given) == 1 else f"{len(given)} logs"
    with working(f"identifying from {logs_given}") as advance:
        found = identify_logs(given, v, **options, advance=advance)
    seconds = time.perf_counter() - begun
    beside = paper_fits(found) if paper and found.identified else None
    to.answer(IdentificationShown(found, paper=beside, seconds=seconds))


def _refuse_runs(path: Path, vehicle: Vehicle, mapped: Mapping[str, str]) -> None:
    """Raise InputError where a log has runs of a pump or valve that the vehicle lacks."""
    from swimbladder.io.logs import header_names

    runs = {"pump_s", "valve_s", "bypass_s"} & {*header_names(path), *mapped}
    if runs:
        has = f"{path} has runs of a pump or valve ({', '.join(sorted(runs))})"
        why = f"{has}, and the vehicle {vehicle.name!r} has no pump and valve"
        remedy = "Give a vehicle whose actuator is of kind pump-valve, like example-float"
        raise InputError(why, field="--vehicle", value=vehicle.name, remedy=remedy)
