"""``swimbladder design-experiment``: pool experiments, and the errors that they give.

``swimbladder identify``: the vertical motion's parameters from logs, with intervals.

The terminal shows the answer first, then its basis. With a cast, and a vehicle with pump and valve,
drag, hull, pump and valve are identified from logs of deep dives.

``swimbladder identify-actuator``: K1, T1, dead zone, asymmetry and rate from logged steps.

``swimbladder compare``: what a log recorded drives the model, and the depths are compared.

With ``--horizons`` the depth is also predicted some seconds ahead: options, table and files of it.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swimbladder.cli.common import aside, progress, working
from swimbladder.cli.options import (
    Files,
    Given,
    LogFiles,
    Options,
    Several,
    Sought,
    VehicleName,
    deviation,
    flag,
    grouped,
    loaded,
    pair,
    valued,
)
from swimbladder.cli.pool import pool as pool
from swimbladder.cli.reading import (
    Chosen,
    LogCasts,
    LogReading,
    LogVehicle,
    refuse_doubted_unit,
    vehicle_of,
)
from swimbladder.errors import InputError, SwimbladderError
from swimbladder.units import quantity, unit_of, with_one_unit

if TYPE_CHECKING:
    from swimbladder.estimation.comparison import Comparison
    from swimbladder.estimation.comparison.ahead import Ahead as Predicted
    from swimbladder.io.logs import Log
    from swimbladder.physics.seawater import Column
    from swimbladder.vehicle import Vehicle


def _against(text: str, option: str) -> tuple[float, ...] | None:
    """Return volume changes [m3] of a list with one unit; None: the paper's, where they fit."""
    if text.strip() == "paper":
        return None
    if text.strip() == "none":
        return ()
    parts = [part.strip() for part in text.split(",")]
    if not unit_of(parts[-1]):
        remedy = 'Write it as "20,-20,30,-30 cm3", or paper, or none'
        raise InputError("the unit is missing", field=option, value=text, unit="m3", remedy=remedy)
    return tuple(quantity(part, "m3", option) for part in with_one_unit(parts))


class Setting(Options):
    """The pool and the sensor."""

    bottom_depth: str = valued("DEPTH", "Depth of the bottom.", ...)
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma (the vehicle's).")
    depth_quantum: Given = valued("DEPTH", "Quantum of the depth sensor (the vehicle's).")
    sample_time: Given = valued("TIME", "Sample time (the controller's).")
    neutral_std: Given = valued(
        "VOLUME", "Prior of each log's neutral volume, 1 sigma (0.5 cm3).", read=deviation("m3")
    )
    drift_std: Given = valued("RATE", "Drift of each log's neutral volume, 1 sigma (0.1 cm3/min).")
    delay_std: str = valued("TIME", "Delay of the volumes' time stamps, 1 sigma.", "0.2 s")


class Experiments(Options):
    """The experiments, and what they are compared with."""

    pool_time: Given = valued("TIME", "Pool time, settling included (--against's; 60 min).")
    max_experiments: int | None = valued("N", "Largest number of experiments.", min=1)
    clearance: str = valued("LENGTH", "Distance from bottom and surface.", "0.75 m")
    settling: Given = valued("TIME", "Settling time before a release (simulated).")
    max_record_time: str = valued("TIME", "Longest record.", "240 s")
    max_moves: int = valued("N", "Largest number of volume changes in a record.", 4, min=1)
    max_volume_change: Given = valued("VOLUME", "Largest change of volume (the stroke's).")
    criterion: str = valued(
        "WHICH", "Criterion: largest error, D, A, or the largest of NAME,...", "largest"
    )
    uncertainty: Given = valued(
        "SHARE", "Uncertainty of the vehicle's file, 1 sigma (as identified; 30%)."
    )
    against: str = valued(
        "SET",
        'Compare with single steps, "20,-20,30,-30 cm3"; paper; none.',
        "paper",
        read=_against,
    )


@grouped(
    "bottom_depth pool_time max_experiments depth_noise free prior",
    out=Path("swimbladder-design-experiment"),
)
def design_experiment(
    vehicle: VehicleName, *, setting: Setting, sought: Sought, experiments: Experiments, to: Files
) -> None:
    """Design the most informative pool experiments, and predict the errors of their estimates.

    A plan to follow, a page to print and the errors to expect: of every parameter, after every
    experiment, and against single steps in the same time. Exit code 1: not all parameters are
    identifiable in this time.
    """
    v = loaded(vehicle, sampled=True)
    options = {**setting.given(), **sought.given(), **experiments.given()}
    with working("looking for the best experiments") as advance:
        from swimbladder.design.experiments import design_experiment as find

        found = find(v, **options, advance=advance)
    to.answer(found)


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
    from swimbladder.show.identification import DeepIdentificationShown

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


class OfActuator(Options):
    """What is known of the actuator, and what is to be identified."""

    fixed: Several = valued("NAME=VALUE", 'Parameter fixed at a value: "dead_zone=0.5 V".')
    required: Given = valued(
        "NAME,...",
        "Exit with 1 unless identified: K1, T1, dead_zone, load_voltage, asymmetry, "
        "rate (K1 and T1; without a voltage T1 and rate; of a positioner the rate).",
    )


@grouped("where column fixed required", out=Path("swimbladder-identify-actuator"))
def identify_actuator(
    logs: LogFiles,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE",
            help="Preset or TOML file: piston area, load of the sea, supply; written anew.",
        ),
    ] = None,
    *,
    reading: LogReading,
    sought: OfActuator,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw steps.png.")] = False,
    to: Files,
) -> None:
    """Identify K1, T1, dead zone, asymmetry and rate of an actuator.

    From logs of voltage steps, or of moves at full speed where no voltage was logged. Several logs
    are of one actuator. Exit code 1: what was asked for is not identifiable from the logs.
    """
    from swimbladder.estimation.actuator import PARAMETERS

    v = None if vehicle is None else loaded(vehicle, sampled=True)
    set_to = (pair(text, "--fixed") for text in sought.fixed or [])
    fixed = {n: quantity(text, PARAMETERS.get(n, ""), f"--fixed {n}") for n, text in set_to}
    required = sought.read()["required"]
    needs, chosen = ("time_s",), enumerate(reading.chosen(logs))
    given = [reading.log(one, v, quiet=k > 0, required=needs) for k, one in chosen]
    with progress("loading the fit"):
        from swimbladder.estimation.actuator import identify_actuator as identify

    begun = time.perf_counter()
    with progress("identifying the actuator", 1.0) as advance:
        found = identify(given, v, fixed=fixed, required=required, advance=advance)
    seconds = time.perf_counter() - begun
    from swimbladder.show.actuator import ActuatorIdentificationShown

    to.answer(ActuatorIdentificationShown(found, seconds=seconds, steps=plot))


def _noise(unit: str) -> Callable[[str, str], float | None]:
    return lambda text, option: quantity(text, unit, option)


def _times(text: str, option: str) -> list[float]:
    return [quantity(part.strip(), "s", option) for part in text.split(",") if part.strip()]


class Ahead(Options):
    """Predictions over some times, and the noise that they assume."""

    horizons: Given = valued("TIME,...", 'Horizons of predictions: "10 s,60 s".', read=_times)
    random_walk: Given = valued(
        "INTENSITY", "Random walk of the neutral volume, for --horizons.", read=_noise("m3/s^0.5")
    )
    depth_noise: Given = valued("DEPTH", "Depth noise, 1 sigma, for --horizons.")
    acceleration_noise: Given = valued(
        "INTENSITY", "Acceleration noise density, for --horizons.", read=_noise("m/s/s^0.5")
    )

    def asked(self) -> dict[str, Any] | None:
        """Return what predict_ahead is called with; None where it is not asked for.

        Raises InputError naming the option.
        """
        given = self.read()
        horizons = given.pop("horizons")
        if horizons is None:
            remedy = 'Add --horizons "10 s,60 s", or leave it out'
            self.refuse("this belongs to --horizons", remedy)
            return None
        from swimbladder.estimation.comparison.ahead import Tuning

        return {"horizons": horizons, "tuning": Tuning(**given)}


class Comparing(Options):
    """How a log is compared, as `estimation.comparison.compare` has it."""

    drive: Given = valued("INPUT", "Input: volume, voltage or setpoint (first logged).")
    free: Given = valued(
        "NAME,...",
        "Parameters to identify: neutral_volume (default), neutral_drift, mass, drag, "
        "drag_quadratic, psi, start_depth, start_speed; or none.",
    )
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).")
    surface_margin: str = valued("DEPTH", "Smallest depth used.", "0.1 m")
    submerged: bool = flag("--submerged", "Begin at the first depth beyond that.")


@grouped("where column free horizons", out=Path("swimbladder-compare"))
def compare(
    logs: LogFiles,
    vehicle: LogVehicle = None,
    *,
    reading: LogReading,
    fit: Comparing,
    ahead: Ahead,
    casts: LogCasts,
    plot: Annotated[bool, typer.Option("--plot", help="Also draw compare.png.")] = False,
    to: Files,
) -> None:
    """Drive the model with a measured log and compare depths.

    The model's input is the logged volume or piston, else the voltage, else the set-point, which
    the vehicle's own controller follows. With --cast, and a logged volume, the neutral volume
    follows the density of the water. Each log is compared separately; exit code 1 or 2: at least
    one could not be.
    """
    v = loaded(vehicle_of(reading.chosen(logs), vehicle), sampled=True)
    ahead.asked()
    chosen = reading.chosen(logs)
    from swimbladder.estimation.comparison.record import water_of_each
    from swimbladder.show.comparison import Compared, ComparedShown

    done = []
    waters = water_of_each(len(chosen), casts.water(v.hull.depth_limit))
    for log, name, water in zip(chosen, _file_names(chosen), waters, strict=True):
        try:
            found = _compare(log, v, reading, fit, ahead, water)
        except SwimbladderError as error:
            if len(chosen) == 1:
                raise
            aside(f"error: {error}")
            done.append(Compared(log.label, name, error=error))
        else:
            done.append(Compared(log.label, name, *found))
    to.answer(ComparedShown(done, pictures=plot))


def _file_names(logs: Sequence[Chosen]) -> list[str]:
    """Return a name for the files of each log, ``compare`` where there is only one."""
    if len(logs) == 1:
        return ["compare"]
    found: list[str] = []
    for log in logs:
        parts = [f"{name}-{value}" for name, value in log.where.items()]
        if len({other.path for other in logs}) > 1:
            parts.insert(0, log.path.name.split(".")[0])
        name = "compare-" + re.sub(r"[^\w.-]+", "_", "-".join(parts))
        taken = sum(other == name or other.startswith(f"{name}~") for other in found)
        found.append(f"{name}~{taken + 1}" if taken else name)
    return found


def _compare(
    log: Chosen,
    vehicle: Vehicle,
    reading: LogReading,
    fit: Comparing,
    ahead: Ahead,
    water: Column | None,
) -> tuple[Comparison, Predicted | None]:
    """Compare a log with the model, and predict over the spans that are asked for."""
    read, options, spans = reading.log(log, vehicle), fit.given(), ahead.asked()
    with working(f"comparing {log.label}") as advance:
        from swimbladder.estimation.comparison import compare as compare_log

        result = compare_log(read, vehicle, **options, cast=water, advance=advance)
    if spans is None:
        return result, None
    edges = {n: options[n] for n in ("bottom_depth", "surface_margin") if n in options}
    with working(f"predicting {log.label}") as advance:
        from swimbladder.estimation.comparison.ahead import predict_ahead

        more: Any = {**spans, **edges, "column": water}
        return result, predict_ahead(read, vehicle, **more, advance=advance)
