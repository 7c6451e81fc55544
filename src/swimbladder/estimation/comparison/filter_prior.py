"""What a causal filter of a log does not know, and how it is spread before the log begins.

Logs of one vehicle differ: by the water (a tank that is warm at the top makes psi smaller), by
what hangs on the hull (drag), by trapped air and a hull that cools (drift and scatter of the
neutral volume), by the site (noise). Each is drawn about what the vehicle's file says, evenly
spread.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.kalman.bank import Member
from swimbladder.estimation.kalman.depth_filter import Noise, Start
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.vehicle import Vehicle

UNITS = {"depth_noise": "m", "random_walk": "m3/s^0.5", "acceleration_noise": "m/s/s^0.5"}

_MEMBERS = 256
_OWN = 0.2  # of the neutral volume's deviation at the start: left to each filter itself
_FIRST = 5  # samples afloat, at least
_LEFT = 0.05  # m, from which the vehicle has left the surface
_START_DEPTH = 0.05  # m, deviation at the first sample
_AFLOAT, _UNDER_WAY = 0.02, 0.1  # m/s, of the speed there

# Where nothing is known; shares are of the displaced volume.
_NEUTRAL = 1.0 / 6.0  # of the stroke
_PSI = 1e-4  # 1/m: water that is 0.1 kg/m3 denser a metre down
_DRAG = 0.2  # of itself
_DRIFT = 1e-6  # 1/s
_DEPTH = (5e-3, 0.7)  # m beside the quantum; deviation of the logarithm
_WALK = (5e-6, 1.2)  # 1/s^0.5
_ACCELERATION = (1e-3, 0.8)  # m/s^1.5
_ABOUT = 0.7  # deviation of the logarithm of a noise that was identified


class Normal(NamedTuple):
    """A mean and a standard deviation."""

    mean: float
    std: float


class Tuning(NamedTuple):
    """Noise that is given; None: what the vehicle's [identified] says, or learnt from the log.

    depth_noise [m], the quantum's share included; random_walk [m3/s^0.5], of the neutral volume;
    acceleration_noise [m/s^1.5].
    """

    depth_noise: float | None = None
    random_walk: float | None = None
    acceleration_noise: float | None = None


class Unknowns(NamedTuple):
    """What is not known, SI; drag and noise as logarithms, drag's of its share."""

    neutral: Normal
    psi: Normal
    drag: Normal
    drift: Normal
    depth_noise: Normal
    random_walk: Normal
    acceleration_noise: Normal


def unknowns(vehicle: Vehicle, tuning: Tuning) -> tuple[Unknowns, dict[str, str]]:
    """Return what is not known of a log of this vehicle, and where the noise is from.

    Raises InputError for a noise that cannot be.
    """
    for name, value in tuning._asdict().items():
        if value is not None and not 0.0 < value < math.inf:
            raise InputError(
                "no such noise", field=f"--{name.replace('_', '-')}", value=value,
                unit=UNITS[name], remedy="Give a standard deviation above 0",
            )  # fmt: skip
    said, volume = vehicle.identified, vehicle.hull.displaced_volume
    between = None if said is None else said.between
    stroke = vehicle.stroke.maximum - vehicle.stroke.minimum
    quantum = vehicle.sensors.depth_quantum / math.sqrt(12.0)
    guesses = {
        "depth_noise": (math.hypot(_DEPTH[0], vehicle.sensors.depth_noise, quantum), _DEPTH[1]),
        "random_walk": (_WALK[0] * volume, _WALK[1]),
        "acceleration_noise": _ACCELERATION,
    }
    noises, origins = {}, {}
    for name, guess in guesses.items():
        given, field = getattr(tuning, name), "neutral_walk" if name == "random_walk" else name
        identified = 0.0 if said is None else getattr(said, field)
        if given is not None:
            noises[name], origins[name] = Normal(math.log(given), 0.0), "given"
        elif identified > 0.0:
            std = _ABOUT if between is None else getattr(between, field)
            noises[name] = Normal(math.log(identified), std)
            origins[name] = "about the vehicle's [identified], by what the log says"
        else:
            noises[name] = Normal(math.log(guess[0]), guess[1])
            origins[name] = "learnt from the log, up to each instant"
    neutral = _NEUTRAL * stroke if said is None else max(_NEUTRAL * stroke, said.neutral_std)
    return Unknowns(
        neutral=Normal(vehicle.trim_error, neutral),
        psi=Normal(vehicle.hull.psi, _PSI * volume if between is None else between.psi),
        drag=Normal(0.0, _DRAG if between is None else between.drag),
        drift=Normal(0.0, _DRIFT * volume) if between is None
        else Normal(between.neutral_drift, between.neutral_drift_std),
        **noises,
    ), origins  # fmt: skip


def places(count: int) -> NDArray[np.float64]:
    """Return points [count, 7] that fill a standard normal distribution evenly (Sobol's)."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    order = math.ceil(math.log2(count + 1))
    cube = qmc.Sobol(len(Unknowns._fields), scramble=False).random_base2(order)
    result: NDArray[np.float64] = ndtri(cube[1 : count + 1])
    return result


def draw(
    u: Unknowns, vehicle: Vehicle, rec: Record, *, count: int = _MEMBERS
) -> tuple[Member, ...]:
    """Return filters for a record whose guesses fill what is not known evenly."""
    base = plant(vehicle, bottom_depth=rec.bottom_depth)
    if rec.afloat:
        zero = _afloat_reading(rec)
        base = base._replace(z_surface=zero, z_air=base.z_air - base.z_surface + zero)
    wide = math.sqrt(1.0 - _OWN**2)
    members = []
    for place in places(count):
        x = Unknowns(
            *(Normal(n.mean + n.std * float(at), 0.0) for n, at in zip(u, place, strict=True))
        )
        neutral = u.neutral.mean + wide * (x.neutral.mean - u.neutral.mean)
        members.append(
            Member(
                plant=_with(base, psi=x.psi.mean, drag=math.exp(x.drag.mean)),
                noise=Noise(
                    depth=math.exp(x.depth_noise.mean), random_walk=math.exp(x.random_walk.mean),
                    acceleration=math.exp(x.acceleration_noise.mean),
                ),
                start=Start(
                    depth=float(rec.depth[0]), speed=0.0, neutral=neutral, depth_std=_START_DEPTH,
                    speed_std=_AFLOAT if rec.afloat else _UNDER_WAY,
                    neutral_std=_OWN * u.neutral.std,
                ),
                drift=x.drift.mean,
            )
        )  # fmt: skip
    return tuple(members)


def _afloat_reading(rec: Record) -> float:
    """Return what the sensor reads before the vehicle leaves the surface [m], its zero's error."""
    first = float(np.median(rec.depth[:_FIRST]))
    gone = np.flatnonzero(np.abs(rec.depth - first) > _LEFT)
    return float(np.median(rec.depth[: max(int(gone[0]), _FIRST) if len(gone) else None]))


def _with(p: Plant, *, psi: float, drag: float) -> Plant:
    return p._replace(
        psi=psi, d_l=p.d_l * drag, d_b=p.d_b * drag, d_0=p.d_0 * drag, d_t=p.d_t * drag
    )
