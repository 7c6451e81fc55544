"""Where the depths of `swimbladder pool` come from: simulated water, or a log that grows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swimbladder.cli.common import console, quantity
from swimbladder.cli.logs import pair
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.design.pool_day import GrowingLog, Operator
    from swimbladder.vehicle import Vehicle

__all__ = ["operator_of", "tail_of"]

_NOISE = 2e-3  # m


def operator_of(
    vehicle: Vehicle, truth: str | None, bottom: float, speed: float | None,
    sensor_std: str | None, seed: int,
) -> Operator:  # fmt: skip
    """Return who rehearses: the vehicle in simulated water `bottom` [m] deep."""
    from swimbladder.design.pool_day import Operator
    from swimbladder.io.config import load_vehicle

    if speed is not None and not speed > 0.0:
        raise InputError(
            "it must be above 0", field="--speed", value=speed,
            remedy="Give simulated seconds a second, or leave it out",
        )  # fmt: skip
    water = _with_noise(vehicle if truth is None else load_vehicle(truth, sampled=True), sensor_std)
    return Operator(vehicle, water, pool_depth=bottom, seed=seed)


def _with_noise(vehicle: Vehicle, sensor_std: str | None) -> Vehicle:
    """Return the vehicle with the noise of its depth that was asked for, or some."""
    sensors = vehicle.sensors
    std = quantity(sensor_std, "m", "--sensor-std")
    if std is None:
        if sensors.depth_noise > 0.0 or sensors.depth_quantum > 0.0:
            return vehicle
        std = _NOISE
        console.print(
            f"{vehicle.name} states no noise of its depth: {1e3 * std:g} mm (1 sigma) is taken; "
            "--sensor-std says another",
            soft_wrap=True,
        )
    if std < 0.0:
        raise InputError(
            "it must not be negative", field="--sensor-std", value=std, unit="m",
            remedy="Give a standard deviation, 0 for none",
        )  # fmt: skip
    return vehicle.model_copy(update={"sensors": sensors.model_copy(update={"depth_noise": std})})


def tail_of(
    vehicle: Vehicle, log: Path, column: list[str], log_format: str | None, timeout: str, *,
    wait: bool,
) -> tuple[GrowingLog, float]:  # fmt: skip
    """Return what reads the log, and how long it waits for more [s]."""
    from swimbladder.design.pool_day import GrowingLog
    from swimbladder.io.log_format import LogFormat
    from swimbladder.io.log_format import log_format as named

    limit = quantity(timeout, "s", "--timeout")
    assert limit is not None
    if not limit > 0.0:
        raise InputError(
            "it must be above 0", field="--timeout", value=timeout, unit="s",
            remedy="Give a time, or --no-wait for a log that is finished",
        )  # fmt: skip
    form = LogFormat() if log_format is None else named(log_format)
    if wait:  # one bad row must not end the day
        form = form.model_copy(update={"bad_rows": "drop"})
    columns = dict(pair(text, "--column") for text in column)
    return GrowingLog(log, vehicle, columns=columns, log_format=form), limit
