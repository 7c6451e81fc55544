"""The comparison itself: fit, predict, and say how far apart model and log are."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swimbladder.errors import NoAnswerError
from swimbladder.estimation.comparison.fit import Fitted, adjust, default_names, run
from swimbladder.estimation.comparison.record import Drive, Record, record
from swimbladder.estimation.series import Array, rms
from swimbladder.io.answers import as_json
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column
from swimbladder.sim.closed_loop import Solution
from swimbladder.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Measured against predicted depth; statistics over the samples that are compared.

    residual is predicted less measured. rms and bias in m; variance_explained is
    1 - var(residual)/var(depth). volume_rms [m3] is known where the model chose the volume and the
    log has it. vehicle carries the fitted numbers. solution: none in the water of a cast.
    """

    source: str
    vehicle: Vehicle
    record: Record
    fitted: dict[str, Fitted]
    predicted: Array  # m
    volume: Array  # m3, as driven or predicted
    rms: float
    bias: float
    variance_explained: float
    largest: float  # m
    volume_rms: float | None
    solution: Solution | None
    notes: tuple[str, ...]

    @property
    def residual(self) -> Array:
        """Predicted less measured depth at every sample [m]."""
        return self.predicted - self.record.depth

    @property
    def n(self) -> int:
        """How many samples are compared."""
        return int(self.record.compared.sum())

    def columns(self) -> dict[str, Array]:
        """Return the columns of compare.csv by name."""
        rec = self.record
        found: dict[str, Array | None] = {
            "time_s": rec.time,
            "depth_m": rec.depth,
            "depth_predicted_m": self.predicted,
            "residual_m": self.residual,
            "compared": rec.compared.astype(float),
            "reference_depth_m": rec.reference,
            "volume_m3": rec.volume,
            "volume_predicted_m3": None if rec.drive == "volume" else self.volume,
            "voltage_V": rec.voltage,
        }
        return {name: values for name, values in found.items() if values is not None}

    def to_json(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        area, off = self.vehicle.piston_area, self.volume_rms
        return {
            "log": self.source,
            "vehicle": self.vehicle.name,
            "drive": self.record.drive,
            **as_json(self, "rms_m bias_m variance_explained largest_m fitted n"),
            "n_not_compared": len(self.record.time) - self.n,
            "duration_s": self.record.duration,
            "volume_rms_m3": off,
            "piston_rms_m": None if off is None or area is None else off / area,
            "notes": list(self.notes),
        }


def compare(
    log: Log,
    vehicle: Vehicle,
    *,
    drive: Drive | None = None,
    fit: Sequence[str] | None = None,
    bottom_depth: float = np.inf,
    surface_margin: float = 0.1,
    submerged: bool = False,
    column: Column | None = None,
    advance: Callable[[float], None] | None = None,
) -> Comparison:
    """Drive the vehicle with what the log recorded, and compare depths.

    drive: volume (or piston), voltage, or setpoint: the vehicle's own controller, with ideal
    sensors, follows the logged set-point; the first that the log has where not given.
    fit: what is fitted to this log (see FITTABLE); the neutral volume where not given, with
    the state at the start where the vehicle is under way. bottom_depth [m]. surface_margin: depths
    less than this below the depth of emergence are not compared [m]. submerged: begin where the
    vehicle is first deeper than that. column: the water of a cast, for a logged volume.

    Raises LogError or InputError where the log and the vehicle do not go together, NoAnswerError
    where the model cannot follow the log to its end.
    """
    rec = record(
        log,
        vehicle,
        drive=drive,
        bottom_depth=bottom_depth,
        surface_margin=surface_margin,
        submerged=submerged,
        column=column,
    )
    names = default_names(rec) if fit is None else tuple(fit)
    outcome = adjust(vehicle, rec, names, advance=advance)
    predicted, volume, solution = run(outcome.vehicle, rec, outcome.start)
    if solution is None and not np.isfinite(predicted).all():
        raise NoAnswerError(
            f"{log.source}: the model left the water "
            f"{float(rec.time[np.isfinite(predicted)][-1]):.4g} s after the first sample, of "
            f"{rec.duration:.4g} s; fit the neutral volume, or begin with --submerged"
        )
    if solution is not None and not solution.finished:
        raise NoAnswerError(
            f"{log.source}: the model stopped {float(solution.time[-1]):.4g} s after the first "
            f"sample, of {rec.duration:.4g} s. {solution.stop.value}"
        )
    measured, used = rec.depth[rec.compared], rec.compared
    off = predicted[used] - measured
    compared_volume = rec.volume if rec.drive != "volume" else None
    notes = list(rec.notes)
    notes += _fitted_before(vehicle)
    explained = float(1.0 - off.var() / measured.var()) if measured.var() else np.nan
    if explained < 0.5:
        notes.append(
            "the model explains less than half of how the depth varies: check the units and signs "
            "of the log's columns, and whether this is the vehicle"
        )
    if _upside_down(rec, outcome.vehicle, names, float(off.std())):
        notes.append(
            "the depth follows the volume the wrong way round: if a larger piston_m means less "
            'volume, set piston_positive = "in" in the [log] table'
        )
    return Comparison(
        source=log.source,
        vehicle=outcome.vehicle,
        record=rec,
        fitted=outcome.fitted,
        predicted=predicted,
        volume=volume,
        rms=rms(off),
        bias=float(off.mean()),
        variance_explained=explained,
        largest=float(np.abs(off).max()),
        volume_rms=None if compared_volume is None else rms((volume - compared_volume)[used]),
        solution=solution,
        notes=tuple(notes),
    )


def _fitted_before(vehicle: Vehicle) -> list[str]:
    """Return what the vehicle's provenance says was fitted, and to what."""
    found: dict[str, list[str]] = {}
    for field, origin in vehicle.provenance.items():
        if origin.startswith("fitted"):
            found.setdefault(re.split(r"[,;:.]", origin)[0], []).append(field)
    return [f"{origin}, says the vehicle: {', '.join(f)}" for origin, f in found.items()]


def _upside_down(rec: Record, vehicle: Vehicle, names: Sequence[str], spread: float) -> bool:
    """Return whether the volume, taken the other way round, would explain far more.

    Either way with the neutral volume fitted, so that they are compared on equal terms.
    """
    if rec.drive != "volume" or rec.volume is None or spread < 0.1:
        return False
    if "neutral_volume" not in names:
        spread = min(spread, _spread_of(rec, vehicle))
    middle = float(np.median(rec.volume[rec.compared]))
    other = replace(rec, volume=2.0 * middle - rec.volume, afloat=False)
    return _spread_of(other, vehicle) < 0.3 * spread


def _spread_of(rec: Record, vehicle: Vehicle) -> float:
    """Return how far off [m] the best neutral volume leaves the depth, as a standard deviation."""
    outcome = adjust(vehicle, rec, ("neutral_volume",))
    predicted, _, solution = run(outcome.vehicle, rec, outcome.start)
    off = (predicted - rec.depth)[rec.compared]
    finished = np.isfinite(off).all() if solution is None else solution.finished
    return float(off.std()) if finished else np.inf
