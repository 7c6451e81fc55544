"""A log as the identification needs it: position, what drove it, and what the sea did to it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, LogError
from swimbladder.estimation.actuator.noise import changes, quantum
from swimbladder.io.logs import Log
from swimbladder.physics.actuator import reduced
from swimbladder.vehicle import Positioner, Vehicle

Array = NDArray[np.float64]
Quantity = Literal["piston", "volume"]
Driven = Literal["voltage", "reference", "nothing"]

_FEWEST = 10
_GAP = 5.0  # median steps of time that are a gap
_SHALLOW = 0.5  # m, a depth at which the load of the sea may be forgotten


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Positions and what drove them; time counts from the first sample.

    position: of the piston [m], or the volume [m3] where no piston is known. voltage is what is
    left of it for the motor, less the load of the sea. runs: stretches without a gap in time, as
    pairs (first, after). quantum: of the position; noise: 1 sigma, of white noise beside it.
    """

    source: str
    time: Array
    position: Array
    quantity: Quantity
    voltage: Array | None
    reference: Array | None
    runs: tuple[tuple[int, int], ...]
    step: float  # s, median time between samples
    quantum: float
    noise: float
    depth: float  # m, the greatest; 0 where not logged
    notes: tuple[str, ...]

    @property
    def driven(self) -> Driven:
        """What is known of what drove it."""
        if self.voltage is not None:
            return "voltage"
        return "nothing" if self.reference is None else "reference"

    def only(self, kept: NDArray[np.bool_]) -> Bench:
        """Return the bench with the samples that are `kept`."""
        before = np.concatenate(([0], np.cumsum(kept)))
        runs = [(int(before[first]), int(before[after])) for first, after in self.runs]
        return replace(
            self,
            time=self.time[kept],
            position=self.position[kept],
            voltage=None if self.voltage is None else self.voltage[kept],
            reference=None if self.reference is None else self.reference[kept],
            runs=tuple((first, after) for first, after in runs if after > first),
        )

    @property
    def unit(self) -> str:
        """The unit of the position."""
        return "m" if self.quantity == "piston" else "m3"


def bench(log: Log, vehicle: Vehicle | None = None) -> Bench:
    """Return the positions of a log and what drove them.

    vehicle: its piston's area turns a logged volume into a position; its supply limits the
    voltage; its k_z/k_u and k_l, with the logged depth, are taken off, eq. (33). Raises LogError
    where the log has neither piston nor volume, or too few samples of it.
    """
    notes = list(log.report)
    area = None if vehicle is None else vehicle.piston_area
    position, reference, quantity = _position(log, area)
    known = np.isfinite(position)
    if log.voltage is not None:
        known &= np.isfinite(log.voltage)
    if not known.all():
        notes.append(f"{int((~known).sum())} samples without position or voltage left out")
        log, position = log.only(known), position[known]
        reference = None if reference is None else reference[known]
    if len(position) < _FEWEST:
        raise LogError(
            f"{len(position)} samples with a position are too few",
            file=log.source,
            field="piston_m",
            remedy=f"Give a log of {_FEWEST} samples or more",
        )
    time = log.time - log.time[0]
    step = float(np.median(np.diff(time)))
    depth = float(np.nanmax(log.depth, initial=0.0)) if np.isfinite(log.depth).any() else 0.0
    voltage = log.voltage
    if voltage is not None:
        voltage = _for_the_motor(log, voltage, vehicle, depth, notes)
        position = _without_leakage(log, time, position, vehicle, quantity)
    edges = np.flatnonzero(np.diff(time) > _GAP * step) + 1
    if len(edges):
        notes.append(f"{len(edges)} gaps in time: what happened in them is not used")
    ends: Sequence[int] = [0, *edges.tolist(), len(time)]
    return Bench(
        source=log.source,
        time=time,
        position=position,
        quantity=quantity,
        voltage=voltage,
        reference=reference,
        runs=tuple(itertools.pairwise(ends)),
        step=step,
        quantum=quantum(position),
        noise=changes(time, position),
        depth=depth,
        notes=tuple(notes),
    )


def _position(log: Log, area: float | None) -> tuple[Array, Array | None, Quantity]:
    if log.piston is not None and np.isfinite(log.piston).any():
        return log.piston, log.reference_piston, "piston"
    if log.volume is None or not np.isfinite(log.volume).any():
        raise LogError(
            "the log has no position of a piston and no volume",
            file=log.source,
            field="piston_m or volume_m3",
            remedy="Map one with --column piston_m=NAME or --column volume_m3=NAME",
        )
    if area is None:
        return log.volume, log.reference_volume, "volume"
    reference = None if log.reference_volume is None else log.reference_volume / area
    return log.volume / area, reference, "piston"


def _for_the_motor(
    log: Log, voltage: Array, vehicle: Vehicle | None, depth: float, notes: list[str]
) -> Array:
    """Return the voltage cut to the supply's, less what holds the sea, k_z/k_u z of eq. (33)."""
    if vehicle is not None and isinstance(vehicle.actuator, Positioner):
        raise InputError(
            f"the vehicle {vehicle.name} is driven by positions, and the log has a voltage",
            field="actuator.kind",
            value=vehicle.actuator.kind,
            remedy="Give the vehicle of this log, or leave the voltage's column out",
        )
    if vehicle is not None and vehicle.supply is not None:
        limit = vehicle.supply.voltage
        beyond = np.abs(voltage) > limit * (1.0 + 1e-9)
        if beyond.any():
            notes.append(
                f"{int(beyond.sum())} voltages beyond the supply's {limit:g} V are taken as cut "
                "to it"
            )
            voltage = np.clip(voltage, -limit, limit)
    if depth < _SHALLOW:
        return voltage
    if vehicle is None:
        notes.append(
            f"the log goes to {depth:.3g} m: without --vehicle, with k_z/k_u, the "
            "load of the sea counts as part of the dead zone and the load"
        )
        return voltage
    load = reduced(vehicle.actuator, vehicle.water).load_drive
    notes.append(f"k_z/k_u = {load:.4g} V/m, as the vehicle has it, times the depth is taken off")
    return voltage - load * np.nan_to_num(log.depth)


def _without_leakage(
    log: Log, time: Array, position: Array, vehicle: Vehicle | None, quantity: Quantity
) -> Array:
    """Return the position with what leaked, k_l z of eq. (33), put back."""
    if vehicle is None or isinstance(vehicle.actuator, Positioner):
        return position
    k_l = reduced(vehicle.actuator, vehicle.water).k_l
    depth = np.nan_to_num(log.depth)
    area = vehicle.piston_area if quantity == "piston" else 1.0
    if k_l == 0.0 or area is None or not depth.any():
        return position
    between = 0.5 * (depth[1:] + depth[:-1]) * np.diff(time)
    leaked: Array = k_l / area * np.concatenate(([0.0], np.cumsum(between)))
    return position + leaked
