"""Do water and hull tell a glider's speed over depth? A Slocum in the Baltic's summer pycnocline.

``python -m studies.gliders FOLDER`` prints the tables (FOLDER holds slocum_comet). The glider keeps
its pitch and its ballast volume from turn to turn, while the density changes by 2.5 kg/m3 over
40 m: of some 70 L that is two thirds of the ballast, and its speed changes by a quarter. So the
speeds weigh the water's and the hull's part of the neutral volume (`hull.displaced_volume`) against
a volume that was measured.

A float drifts with the water and has drag alone; a glider has lift. Its balance is that of L.
Merckelbach, D. Smeed and G. Griffiths, J. Atmos. Oceanic Technol. 27 (2010), with the coefficients
of their program (github.com/smerckel/gliderflight): steady, with angle of attack a, glide angle
th + a, speed U and force B = g (rho (V_b + V(p, T)) - m)::

    a = (C_D0 + C_D1 a^2)/(C_L tan(th + a)),  U^2 = 2 |B| sin(th + a)/(rho S (C_D0 + C_D1 a^2))

Unknown are C_D0, the trim and the hull's volume; they are found on every second yo and tell the
speeds of the others.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import least_squares

from swimbladder.physics.hull import displaced_volume, weight_mass
from swimbladder.vehicle import (
    Hull,
    HullPart,
    IdentifiedActuator,
    IdentifiedMotion,
    Stroke,
    Supply,
    Vehicle,
    Water,
)

__all__ = ["HULLS", "Glides", "Told", "glider", "read_glides", "told", "vertical_speed"]

Array = NDArray[np.float64]
G = 9.815  # m/s2, at 54 to 56 degrees north
_AREA = 0.1  # m2, of the wings; all that follows refers to it
_ASPECT, _SWEEP, _OSWALD = 7.0, math.radians(43.0), 0.8
_WING = (
    2.0 * math.pi * _ASPECT / (2.0 + math.sqrt(_ASPECT**2 * (1.0 + math.tan(_SWEEP) ** 2) + 4.0))
)
_LIFT = _WING + 3.8  # 1/rad, of wings and hull
_INDUCED = _WING**2 / (math.pi * _OSWALD * _ASPECT) + 9.7  # 1/rad2, of wings and hull
_COMPRESSIBILITY = 5e-10  # 1/Pa, as there
_ALUMINIUM = 69e-6  # 1/K, of volume
_SURFACE = Water(density=1005.0, temperature=15.0)  # that the trim is counted from

_EVERY, _HALF = 20.0, 10.0  # s: means and slopes over 20 s, one after the other
_FROM = 5e4  # Pa: above it the glider turns
_MOVED = 3e-6  # m3: less is a ballast that stands
_PITCH = math.radians(10.0)

HULLS = {"without heat": 0.0, "aluminium": _ALUMINIUM}
"""Thermal expansion of volume [1/K] that the hull is taken to have."""


class Glides(NamedTuple):
    """Steady stretches of a dive, arrays of one length [n]."""

    yo: Array  # which of the dives down and up, 0, 1, 2...
    pressure: Array  # Pa above the atmosphere
    density: Array  # kg/m3 in situ
    temperature: Array  # degC
    volume: Array  # m3 of ballast
    pitch: Array  # rad, up positive
    speed: Array  # m/s, up positive

    def only(self, kept: NDArray[np.bool_]) -> Glides:
        """Return some of them."""
        return Glides(*(values[kept] for values in self))


class Told(NamedTuple):
    """What was found on some yos, and how well it tells the others; errors are rms [m/s]."""

    volume: tuple[float, float]  # m3 of the hull, 1 sigma
    trim: tuple[float, float]  # m3
    drag: tuple[float, float]  # -, C_D0
    error: float
    uniform: float  # with water of one density
    constant: float  # with one speed down and one up


def read_glides(folder: Path) -> Glides:
    """Return the steady stretches of the file in `folder`/slocum_comet."""
    flight = pd.read_csv(folder / "slocum_comet" / "flight.csv.gz").sort_values("m_present_time")
    ctd = pd.read_csv(folder / "slocum_comet" / "ctd.csv.gz").sort_values("time")
    now, then = ctd["time"].to_numpy(), flight["m_present_time"].to_numpy()
    p, rho = ctd["sci_water_pressure_bar"].to_numpy() * 1e5, ctd["rho_kg_m3"].to_numpy()
    T = ctd["sci_water_temp_degC"].to_numpy()
    ballast, pitch = flight["m_ballast_pumped"].to_numpy() * 1e-6, flight["m_pitch"].to_numpy()
    rows = []
    yo, before = 0, 0.0
    for t in np.arange(now[0] + _EVERY, now[-1] - _EVERY, _EVERY):
        volume = float(np.interp(t, then, ballast))
        yo += before > 0.0 > volume
        before = volume or before
        near = np.abs(now - t) <= _HALF
        moved, angles = ballast[np.abs(then - t) <= _EVERY], pitch[np.abs(then - t) <= _HALF]
        if near.sum() < 6 or len(angles) == 0 or float(np.ptp(moved)) > _MOVED:
            continue
        angle = float(np.mean(angles))
        if abs(angle) < _PITCH or angle * volume < 0.0:
            continue
        slope = float(np.polyfit(now[near] - t, p[near], 1)[0])
        mean = [float(np.mean(values[near])) for values in (p, rho, T)]
        if mean[0] > _FROM:
            rows.append((yo, *mean, volume, angle, -slope / (mean[1] * G)))
    table = np.array(rows)
    glides = Glides(*table.T)
    return glides.only(glides.yo > 0)  # the file begins in the middle of the first


def glider(volume: float, trim: float, expansion: float) -> Vehicle:
    """Return a vehicle whose hull [m3] has that trim [m3] and thermal expansion [1/K]."""
    part = HullPart(
        name="hull", volume=volume, compressibility=_COMPRESSIBILITY, thermal_expansion=expansion
    )
    return Vehicle(
        name="glider",
        water=_SURFACE,
        trim_error=trim,
        stroke=Stroke(minimum=-1e-3, maximum=1e-3),
        hull=Hull(
            displaced_volume=volume,
            psi=0.0,
            waterplane_area=0.04,
            height=1.5,
            reference_temperature=_SURFACE.temperature,
            parts=(part,),
        ),
        actuator=IdentifiedActuator(K1=1e-3, T1=0.1, piston_area=2e-3),
        supply=Supply(voltage=12.0),
        motion=IdentifiedMotion(K2=8000.0, T2=30.0),
    )


def vertical_speed(vehicle: Vehicle, glides: Glides, drag: float) -> Array:
    """Return the speeds [m/s] [n], up positive, of a glider with the drag coefficient C_D0."""
    displaced = displaced_volume(vehicle, glides.pressure, glides.temperature)
    net = G * (glides.density * (glides.volume + displaced) - weight_mass(vehicle))
    pitch, attack = np.abs(glides.pitch), np.zeros_like(glides.pitch)
    for _ in range(50):  # a contraction by 1/10 or less at these angles
        attack = (drag + _INDUCED * attack**2) / (_LIFT * np.tan(pitch + attack))
    glide = np.sin(pitch + attack)
    along = 2.0 * np.abs(net) * glide / (glides.density * _AREA * (drag + _INDUCED * attack**2))
    return np.asarray(np.sign(net) * np.sqrt(along) * glide)


def _fitted(glides: Glides, expansion: float, volume: float | None) -> tuple[Array, Array]:
    """Return trim [cm3], C_D0, volume [L] and their 1 sigma; the volume may be given."""

    def off(x: Array) -> Array:
        size = x[2] if volume is None else volume
        vehicle = glider(1e-3 * size, 1e-6 * x[0], expansion)
        return vertical_speed(vehicle, glides, x[1]) - glides.speed

    first = [20.0, 0.2] if volume is not None else [20.0, 0.2, 60.0]
    found = least_squares(off, first, x_scale=np.array([10.0, 0.1, 10.0])[: len(first)])
    slope = np.asarray(found.jac, dtype=np.float64)
    spread = np.linalg.inv(slope.T @ slope) * float(np.mean(found.fun**2))
    rest = [] if volume is None else [volume]
    return np.array([*found.x, *rest]), np.array([*np.sqrt(np.diag(spread)), *(0.0 for _ in rest)])


def told(glides: Glides, expansion: float, *, odd: bool) -> Told:
    """Return what the odd or the even yos say, and how well it tells the other ones."""
    here = glides.yo % 2 == int(odd)
    known, rest = glides.only(here), glides.only(~here)

    def error(x: Array, glides: Glides) -> float:
        vehicle = glider(1e-3 * x[2], 1e-6 * x[0], expansion)
        return _rms(vertical_speed(vehicle, glides, x[1]) - glides.speed)

    x, std = _fitted(known, expansion, None)
    flat = [
        part._replace(
            density=np.full_like(part.density, float(np.mean(known.density))),
            temperature=np.full_like(part.temperature, float(np.mean(known.temperature))),
        )
        for part in (known, rest)
    ]
    even, _ = _fitted(flat[0], expansion, float(x[2]))
    up = rest.volume > 0.0
    means = [float(np.mean(known.speed[(known.volume > 0.0) == way])) for way in (True, False)]
    return Told(
        volume=(1e-3 * x[2], 1e-3 * std[2]),
        trim=(1e-6 * x[0], 1e-6 * std[0]),
        drag=(x[1], std[1]),
        error=error(x, rest),
        uniform=error(even, flat[1]),
        constant=_rms(np.where(up, *means) - rest.speed),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main(arguments: Iterable[str] | None = None) -> None:
    """Print the tables for the data in a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="that holds slocum_comet")
    glides = read_glides(parser.parse_args(None if arguments is None else list(arguments)).folder)
    print(f"{len(glides.yo)} stretches of 20 s in {len(np.unique(glides.yo))} yos")
    print(
        "hull           found on  hull [L]      trim [cm3]    C_D0           "
        "rms on the others [mm/s]: told, one density, one speed"
    )
    for name, expansion in HULLS.items():
        for odd in (True, False):
            t = told(glides, expansion, odd=odd)
            print(
                f"{name:14} {'odd' if odd else 'even':9} "
                f"{1e3 * t.volume[0]:.1f} +- {1e3 * t.volume[1]:.1f}   "
                f"{1e6 * t.trim[0]:.0f} +- {1e6 * t.trim[1]:.0f}       "
                f"{t.drag[0]:.3f} +- {t.drag[1]:.3f}  "
                f"{1e3 * t.error:.1f}, {1e3 * t.uniform:.1f}, {1e3 * t.constant:.1f}"
            )


if __name__ == "__main__":
    main()
