"""What is asked of a buoyancy engine: volume, rate, pressure, energy, from the dive it is for."""

from dataclasses import dataclass, field, fields
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, check_number
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import Column
from swimbladder.vehicle import Vehicle

# Bounds of a dive's numbers, as `check_number` takes them.
_ABOVE, _LEAST, _WATER = {"above": 0.0}, {"least": 0.0}, {"least": -5.0, "most": 60.0}
_SHARE: dict[str, Any] = {"most": 1.0, "remedy": 'Write a share like "10 %", which is 0.1'}


@dataclass(frozen=True, kw_only=True)
class Dive:
    """The dive that is asked for, and how well the vehicle is known.

    Depth [m], speed down and up [m/s], turn_time: from sinking to rising at depth [s], trim: 1
    sigma of the neutral volume [m3], probability that the stroke covers it [-], freeboard: volume
    that lifts the antenna [m3], reserve of the stroke [-], cycles, park_time per cycle [s], hotel
    load [W], surface_energy per cycle [J]. battery_low: share of the voltage at which it still has
    to work [-]; stall_reserve: how much deeper than `depth` the motor has to hold, as a share [-].
    corrections: share by which a flown dive takes longer and more energy than the straight one [-];
    surface_time per cycle [s]; battery_reserve: share of the battery that is not flown with [-].
    coldest: of the water on the way [degC]; None: as the column of water has it.
    Raises InputError where a number cannot be.
    """

    depth: float = field(metadata={"unit": "m", **_ABOVE})
    speed: float = field(default=0.1, metadata={"unit": "m/s", **_ABOVE})
    turn_time: float = field(default=600.0, metadata={"unit": "s", **_ABOVE})
    trim: float = field(default=20e-6, metadata={"unit": "m3", **_LEAST})
    probability: float = field(default=0.95, metadata=_ABOVE | _SHARE)
    freeboard: float = field(default=0.0, metadata={"unit": "m3", **_LEAST})
    reserve: float = field(default=0.1, metadata=_LEAST | _SHARE)
    cycles: int = field(default=200, metadata=_ABOVE)
    park_time: float = field(default=0.0, metadata={"unit": "s", **_LEAST})
    hotel: float = field(default=0.02, metadata={"unit": "W", **_LEAST})
    surface_energy: float = field(default=0.0, metadata={"unit": "J", **_LEAST})
    corrections: float = field(default=0.2, metadata=_LEAST | _SHARE)
    surface_time: float = field(default=900.0, metadata={"unit": "s", **_LEAST})
    battery_reserve: float = field(default=0.1, metadata=_LEAST | _SHARE)
    coldest: float | None = field(default=None, metadata={"unit": "degC", **_WATER})
    battery_low: float = field(default=0.8, metadata=_ABOVE | _SHARE)
    stall_reserve: float = field(default=0.25, metadata=_LEAST)

    def __post_init__(self) -> None:
        for bounded in fields(self):
            name, value = bounded.name, getattr(self, bounded.name)
            if value is not None:
                check_number(value, name, **bounded.metadata)
        for name in ("battery_reserve", "probability"):
            if getattr(self, name) == 1.0:
                what, remedy = "a share below the whole is needed", 'Write a share like "10 %"'
                raise InputError(what, field=name, value=1.0, remedy=remedy)

    @property
    def cycle_time(self) -> float:
        """Time of a cycle: down, parked, up and at the surface [s]."""
        way = 2.0 * self.depth / self.speed * (1.0 + self.corrections)
        return way + self.park_time + self.surface_time


_PLACES = 41  # depths at which the energy of a cycle is summed up


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """What a dive asks of the drive.

    depth [m], pressure [Pa] and moved [m3]: where in a cycle how much volume has to be pressed
    out, all [n]. neutral: the change of the neutral volume from the surface down [m3] [n]. drive:
    volume that keeps the speed, mean of down and up [m3], trim: half-width that is covered [m3],
    stroke: from stop to stop [m3], lowest: where the inner stop is, counted from neutral at the
    surface [m3], rate: while pressing out at `depth` [m3/s], coldest: water on the way [degC].
    """

    dive: Dive
    depth: NDArray[np.float64]
    pressure: NDArray[np.float64]
    moved: NDArray[np.float64]
    neutral: NDArray[np.float64]
    drive: float
    trim: float
    stroke: float
    lowest: float
    rate: float
    coldest: float

    @property
    def bottom_pressure(self) -> float:
        """Pressure at the depth asked for [Pa above the atmosphere]."""
        return float(self.pressure[-1])

    @property
    def shares(self) -> dict[str, float]:
        """What the stroke is made of [m3]."""
        spread = float(np.ptp(self.neutral))
        total = spread + 2.0 * self.drive + 2.0 * self.trim
        freeboard = self.stroke / (1.0 + self.dive.reserve) - total
        return {
            "water and hull": spread,
            "speed down and up": 2.0 * self.drive,
            "trim not known": 2.0 * self.trim,
            "freeboard": max(freeboard, 0.0),
            "reserve": self.stroke * (1.0 - 1.0 / (1.0 + self.dive.reserve)),
        }


def requirements(body: Vehicle, column: Column, dive: Dive) -> Requirements:
    """Return what a dive of a body through a column of water asks of its drive.

    The stroke covers: the neutral volume from the surface to the depth; the volume that drives the
    body down and up at the wanted speed, F_d(w)/(rho g), eq. (16); the trim that is not known, with
    the wanted probability (it is normal and known by its deviation); the freeboard. In a cycle, 2
    drive volumes are pressed out at the depth (one to stop, one to rise), what the neutral volume
    grows by on the way down and on the way up, where it does, and the freeboard at the surface. The
    rate is that of the turn, or that of a neutral volume that grows on the way down: a vehicle that
    does not keep up with it sinks ever faster. Raises InputError where the
    column ends above the depth.
    """
    if column.depth[-1] < dive.depth * (1.0 - 1e-9):
        what = f"the water is known down to {column.depth[-1]:.6g} m only"
        remedy = "Give a cast that reaches the depth, or a smaller depth"
        raise InputError(what, field="depth", value=dive.depth, unit="m", remedy=remedy)
    grid = np.linspace(0.0, dive.depth, _PLACES)
    at = np.interp(grid, column.depth, neutral_volume(body, column))
    neutral = at - at[0]
    pressure = np.interp(grid, column.depth, column.pressure)
    density = np.interp(grid, column.depth, column.density)
    light = float(density.min()) * column.gravity
    down, up = (abs(drag_force(body.drag, w)) / light for w in (dive.speed, -dive.speed))
    drive = 0.5 * (down + up)
    trim = NormalDist().inv_cdf(0.5 + 0.5 * dive.probability) * dive.trim
    lowest = float(neutral.min()) - down - trim
    highest = max(float(neutral.max()) + up, dive.freeboard) + trim
    stroke = (highest - lowest) * (1.0 + dive.reserve)
    moved = np.zeros_like(grid)
    moved[-1] = 2.0 * drive
    change = np.diff(neutral)
    moved[1:] += np.maximum(change, 0.0)  # on the way down: a hull that gives way, trapped air
    moved[:-1] += np.maximum(-change, 0.0)  # on the way up
    moved[0] += max(dive.freeboard - up, 0.0)
    way = column.temperature[column.depth <= dive.depth]
    return Requirements(
        dive=dive,
        coldest=float(way.min()) if dive.coldest is None else dive.coldest,
        depth=grid,
        pressure=pressure,
        moved=moved,
        neutral=neutral,
        drive=drive,
        trim=trim,
        stroke=stroke,
        lowest=lowest - (highest - lowest) * dive.reserve / 2.0,
        rate=max(2.0 * drive / dive.turn_time, float(np.max(change / np.diff(grid))) * dive.speed),
    )
