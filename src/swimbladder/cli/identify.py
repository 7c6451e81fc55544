"""``swimbladder identify``: the vertical motion's parameters from logs, with intervals.

The terminal shows the answer first, then its basis. With a cast, and a vehicle with pump and valve,
drag, hull, pump and valve are identified from logs of deep dives.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.text import Text

from swimbladder.cli import common
from swimbladder.cli.casts import OF_CASTS, LogCasts, refuse_doubted_unit
from swimbladder.cli.common import (
    compile_notice,
    labelled,
    progress,
    severity,
    table,
    typed_command,
)
from swimbladder.cli.logs import LogReading, LogVehicle, vehicle_of
from swimbladder.cli.options import Files, LogFiles, Options, flag, grouped, valued
from swimbladder.cli.settings import Sought, deviation, known, setting
from swimbladder.cli.texts import Given, names, once
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from swimbladder.cli.logs import Chosen
    from swimbladder.estimation.motion import Identification
    from swimbladder.estimation.motion.deep import DeepIdentification
    from swimbladder.estimation.motion.paper_method import PaperFits
    from swimbladder.estimation.motion.posterior import Posterior
    from swimbladder.io.logs import Log
    from swimbladder.vehicle import Vehicle

_DBAR = 1e4  # Pa
_WHITE = 0.7  # of the noise: the sensor's part is said where it is less


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
    how: Any = {"log_format": reading.format_name, "columns": reading.mapped}
    read = []
    for log in logs:
        with progress(f"reading {log.label}"):
            read.append(read_float_log(log.path, **how, where=log.where))
    found_casts = casts.casts()
    deepest = max(float(np.nanmax(log.pressure)) for log in read) / _DBAR
    reach = -float(gsw.z_from_p(deepest, found_casts[0].latitude))
    refuse_doubted_unit(found_casts, reach, vehicle.hull.depth_limit, OF_CASTS)

    from swimbladder.estimation.motion.deep import identify_deep as identify
    from swimbladder.physics.seawater import cast_column
    from swimbladder.show.report.deep import write_deep

    columns = [cast_column(cast) for cast in found_casts]
    known_before: Any = {"free": free, "fixed": held, "priors": before}
    with progress("identifying from deep dives", 1.0) as advance:
        found = identify(read, columns, vehicle, **known_before, advance=advance)
    answer = found.to_dict()
    with progress("drawing the picture"):
        files = write_deep(found, to.out, answer=answer, command=typed_command())
    shown = _deep_shown(found, [note for log in read for note in log.report])
    to.answer(answer, shown, files, good=found.identified, why=found.sentences[:1])


def _deep_shown(found: DeepIdentification, notes: Sequence[str]) -> Iterator[object]:
    """Give what is printed, the answer first."""
    first, *others = found.sentences
    yield from (Text(first, style="bold"), *others)
    yield from (_deep_parameters(found), _dives(found))
    yield from (*labelled("assumed", found.assumptions), *labelled("note", notes))


def _deep_parameters(found: DeepIdentification) -> Table:
    from swimbladder.units import shown_unit, unit_factor

    words = {"data": "the dives", "prior": "its prior", "set": "set"}
    if found.inconsistent:
        words |= dict.fromkeys(("data", "prior"), "not identifiable")
    rows = []
    for name, e in found.parameters.items():
        shown = shown_unit(e.unit) if e.unit else ""
        factor = unit_factor(e.unit, shown) if e.unit else 1.0
        value, std, low, high = (factor * x for x in (e.value, e.std, *e.ci95))
        sure = (f"{std:.2g}", f"{low:.4g} to {high:.4g}")
        sure = ("-", "-") if found.inconsistent else sure
        rows.append((name, f"{value:.4g}", *sure, shown or "-", words[e.origin]))
    return table(("", "value", "1 sigma", "95 % interval", "unit", "from"), rows)


def _dives(found: DeepIdentification) -> Table:
    headings = ("dive", "samples", "deepest", "imbalance", "speed off by", "replay off by")
    rows = []
    for flown, numbers in zip(found.dives, found.to_dict()["dives"], strict=True):
        pressures = (numbers[name] / _DBAR for name in ("deepest_Pa", "replay_rms_Pa"))
        deepest, replay = (f"{pressure:.0f} dbar" for pressure in pressures)
        imbalance = f"{1e6 * numbers['imbalance_rms_m3']:.1f} mL"
        speed = f"{1e3 * numbers['speed_rms_m_s']:.1f} mm/s"
        samples = str(numbers["samples"])
        rows.append((flown.dive.name, samples, deepest, imbalance, speed, replay))
    return table(headings, rows)


def _shown(found: Identification, paper: PaperFits | None, seconds: float) -> Iterator[object]:
    """Give what is printed: the answer first, then its basis."""
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import correlations, findings, headlines, reading

    samples = sum(int((e.weight > 0.0).sum()) for e in found.experiments)
    count = len(found.experiments)
    logs = f"{count} log{'s' if count > 1 else ''}, {samples} samples"
    noise = f"{1e3 * found.depth_noise:.2g} mm of noise"
    if found.sensor_noise < _WHITE * found.depth_noise:
        noise += f" ({1e3 * found.sensor_noise:.2g} mm of them the sensor's)"
    yield f"{found.result_vehicle.name}, {logs}, {found.law} drag, {noise}, {seconds:.2g} s"
    if not found.identified:
        yield Text("Not identifiable from these logs:", style="bold red")
    style = "" if found.identified else "bold"
    yield from (Text(sentence, style=style) for sentence in headlines(found))
    yield from severity(findings(found), "warning")
    yield _parameters(found)
    yield from severity(findings(found), "note")
    if found.posterior is not None:
        yield _posterior(found.posterior)
    yield from (f"correlation of {a} and {b}: {r:+.2f}" for a, b, r in correlations(found))
    if found.choices:
        yield _choices(found)
    yield _logs(found)
    if paper is not None:
        yield paper.sentence
    yield from labelled("assumed", found.assumptions)
    yield from labelled("note", reading(found, labels(found)))


def _posterior(drawn: Posterior) -> Table:
    """Return median and interval of the draws as a table."""
    from swimbladder.estimation.motion.problem import NAMES
    from swimbladder.units import shown_unit, unit_factor

    rows = []
    for name in drawn.names:
        unit = NAMES[name].unit
        shown = shown_unit(unit)
        low, median, high = (x * unit_factor(unit, shown) for x in drawn.interval(name))
        rows.append((name, f"{median:.4g}", f"{low:.4g} to {high:.4g}", shown))
    return table(("posterior", "median", "95 % of the draws", "unit"), rows)


def _parameters(found: Identification) -> Table:
    from swimbladder.show.report.text import rows

    words = {"data": "the logs", "prior": "its prior", "set": "set"}
    shown = ((*r[:-1], words[r.origin]) for r in rows(found))
    return table(("", "value", "1 sigma", "95 % interval", "unit", "from"), shown)


def _choices(found: Identification) -> Table:
    from swimbladder.show.report.identification import PSI

    best, rows = min(c.bic for c in found.choices), []
    for c in found.choices:
        drag = f"{c.drag}{' (reported)' if c.reported else ''}"
        worse, share = f"{c.bic - best:.1f}", f"{100.0 * c.weight:.1f} %"
        rows.append((drag, PSI[c.psi], f"{1e3 * c.rms:.2f} mm", worse, share))
    return table(("drag", "psi", "rms", "behind the best", "probability"), rows)


def _logs(found: Identification) -> Table:
    from swimbladder.show.plots.identify import labels
    from swimbladder.show.report.text import row

    rows = []
    for label, e in zip(labels(found), found.experiments, strict=True):
        r = row("", e.estimates["neutral_error"])
        rms, samples = f"{1e3 * e.rms:.1f} mm", str(int((e.weight > 0.0).sum()))
        error = f"{r.value} +- {r.std} {r.unit}" if r.std else "-"
        rows.append((label, rms, samples, str(e.outliers), error))
    return table(("log", "rms", "samples", "outliers", "neutral-volume error"), rows)


@dataclass(frozen=True)
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
    bottom_depth: Given = valued("DEPTH", "Depth of the bottom (none).", name="--bottom")
    surface_margin: str = valued("DEPTH", "Smallest depth used.", "0.1 m")
    profiles: bool = flag("--profiles/--no-profiles", "Profile likelihoods.", True)
    process_noise: str = valued(
        "MODE",
        "Process noise: auto, always, never.",
        "auto",
    )
    posterior: bool = flag("--posterior", "Sample the posterior (needs emcee).")
    seed: int = valued(None, "Seed of the posterior samples.", 1, min=0)
    paper: bool = flag("--paper", "Add the paper's fits: eqs (26), (27), averaged.")


@grouped("where column free set prior drag", out=Path("swimbladder-identify"))
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
    from swimbladder.io.config import load_vehicle

    vehicle = vehicle_of(reading.chosen(logs), vehicle)
    v = load_vehicle(vehicle)
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
    options["columns"] = casts.water(v.hull.depth_limit)
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
        from swimbladder.show.report.identification import Run, check_folder, write_identification

    to.check()
    check_folder(to.out, vehicle)
    begun = time.perf_counter()
    logs_given = "one log" if len(given) == 1 else f"{len(given)} logs"
    doing = progress(f"identifying from {logs_given}", 1.0)
    with compile_notice(), doing as advance:
        found = identify_logs(given, v, **options, advance=advance)
    seconds = time.perf_counter() - begun
    beside = paper_fits(found) if paper and found.identified else None
    answer = {**found.to_dict(), "paper": None if beside is None else beside.to_dict()}
    with progress("writing the report", 1.0) as advance:
        run = Run(common.typed_command(), seconds, beside)
        files = write_identification(found, to.out, run, answer=answer, advance=advance)
    named = [path for path in files if to.json or path.suffix != ".png"]
    refused = [f.sentence for f in found.findings if f.severity == "no"]
    shown = _shown(found, beside, seconds)
    to.answer({**answer, "seconds": seconds}, shown, named, good=found.identified, why=refused)


def _refuse_runs(path: Path, vehicle: Vehicle, mapped: Mapping[str, str]) -> None:
    """Raise InputError where a log has runs of a pump or valve that the vehicle lacks."""
    from swimbladder.io.logs import header_names

    runs = {"pump_s", "valve_s", "bypass_s"} & {*header_names(path), *mapped}
    if runs:
        has = f"{path} has runs of a pump or valve ({', '.join(sorted(runs))})"
        why = f"{has}, and the vehicle {vehicle.name!r} has no pump and valve"
        remedy = "Give a vehicle whose actuator is of kind pump-valve, like example-float"
        raise InputError(why, field="--vehicle", value=vehicle.name, remedy=remedy)
