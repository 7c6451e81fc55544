"""The oil line of a pump and valve as the kernel takes it: numbers and columns of its table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.physics.actuator import leakage_coefficient
from swimbladder.physics.buoyancy_engine import pressure_ratio, running_pump
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.pump_start import POLYTROPIC, LineCurves, line_curves
from swimbladder.physics.seawater import Column
from swimbladder.physics.steady_drives import REFERENCE_TEMPERATURE
from swimbladder.sim.engine.rodas.names import Given, Table
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Vehicle

Array = NDArray[np.float64]
_BEYOND = 1.2  # of the column's pressure: so far the line is tabulated


class _Line(NamedTuple):
    actuator: PumpAndValve
    curves: LineCurves
    warmth: Array  # J/K [n, 2] by which `curves.energy`, of 15 degC, grows in warmer water


def line_given(vehicle: Vehicle, column: Column) -> dict[Given, float]:
    """Return what the kernel takes of a vehicle's oil line; zeros without one."""
    line = _line(vehicle, column)
    if line is None:
        return dict.fromkeys(list(Given)[int(Given.LINE) : int(Given.COUNT)], 0.0)
    a = line.actuator
    assert a.line is not None
    air = (ATMOSPHERIC_PRESSURE / a.internal_pressure) ** (1.0 / POLYTROPIC)
    return {
        Given.LINE: a.line.volume,
        Given.LINE_GAS: a.line.volume * a.line.trapped_air * air,
        Given.LINE_MODULUS: a.line.bulk_modulus,
        Given.LINE_POWER: 1.0 / POLYTROPIC,
        Given.LINE_RATIO: pressure_ratio(a),
        Given.RESERVOIR: a.internal_pressure,
        Given.HEAD_AFLOAT: ATMOSPHERIC_PRESSURE - a.internal_pressure,
        Given.SLIP: _slip(vehicle, a),
        Given.RUN_UP: a.start_volume,
        Given.LINE_STEP: line.curves.step,
        Given.LINE_TOP: line.curves.top,
    }


def line_columns(vehicle: Vehicle, column: Column) -> dict[Table, Array]:
    """Return columns over the line's pressure with their slopes [n, 2]; none without a line."""
    line = _line(vehicle, column)
    if line is None:
        return {}
    return {
        Table.FILLING: line.curves.time,
        Table.FILL_ENERGY: line.curves.energy - REFERENCE_TEMPERATURE * line.warmth,
        Table.FILL_WARMTH: line.warmth,
        Table.EMPTYING: line.curves.falling,
    }


def _line(vehicle: Vehicle, column: Column) -> _Line | None:
    a = vehicle.actuator
    if not isinstance(a, PumpAndValve) or a.line is None:
        return None
    oil, highest = a.line, _BEYOND * float(column.pressure[-1]) + ATMOSPHERIC_PRESSURE

    def curves(temperature: float) -> LineCurves:
        return line_curves(
            oil,
            lambda dp: running_pump(vehicle, a, dp, temperature)[0],
            lambda dp: running_pump(vehicle, a, dp, temperature)[1],
            highest - a.internal_pressure,
            len(column.depth),
            slip=_slip(vehicle, a),
            reservoir=a.internal_pressure,
            ratio=pressure_ratio(a),
        )

    found, warmer = curves(REFERENCE_TEMPERATURE), curves(REFERENCE_TEMPERATURE + 1.0)
    return _Line(a, found, warmer.energy - found.energy)


def _slip(vehicle: Vehicle, a: PumpAndValve) -> float:
    """Return what flows back through a pump that stands, of the water [m3/s/Pa]."""
    if isinstance(a.pump, PowerLawPump):
        return a.pump.slip
    water, drive = vehicle.water, a.pump.drive
    leak = leakage_coefficient(
        k_pl=drive.pump_leakage, rho=water.density, g=water.gravity, n_h=drive.area_ratio
    )
    return leak / water.specific_weight
