"""How well the model predicts the depth some seconds ahead, from what was measured up to then.

A whole log open loop asks more than any use of a model does: a neutral volume wrong by a tenth of a
cubic centimetre moves a small float by decimetres in minutes. Here a causal filter follows the log;
at each instant it knows the depths up to it and, the volume being a known input, what the actuator
does afterwards. Its prediction is judged by skill, 1 - rms/rms of a baseline, against a depth that
stays (persistence) and against the same filter without drag and psi (a double integrator).

What a causal filter of a log does not know is spread before the log begins. Logs of one vehicle
differ: by the water (a tank that is warm at the top makes psi smaller), by what hangs on the hull
(drag), by trapped air and a hull that cools (drift and scatter of the neutral volume), by the site
(noise). Each is drawn about what the vehicle's file says, evenly spread.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import Record, record
from swimbladder.estimation.estimates import Z95
from swimbladder.estimation.kalman import Bank, Member, Noise, Start, filter_bank
from swimbladder.estimation.series import Index, rms
from swimbladder.io.answers import as_json
from swimbladder.io.logs import Log
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.physics.seawater import Column
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
_RANDOM_WALK = (5e-6, 1.2)  # 1/s^0.5
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
            what, remedy = "no such noise", "Give a standard deviation above 0"
            raise InputError(what, field=name, value=value, unit=UNITS[name], remedy=remedy)
    said, volume = vehicle.identified, vehicle.hull.displaced_volume
    between = None if said is None else said.between
    stroke = vehicle.stroke.maximum - vehicle.stroke.minimum
    quantum = vehicle.sensors.depth_quantum / math.sqrt(12.0)
    guesses = {
        "depth_noise": (math.hypot(_DEPTH[0], vehicle.sensors.depth_noise, quantum), _DEPTH[1]),
        "random_walk": (_RANDOM_WALK[0] * volume, _RANDOM_WALK[1]),
        "acceleration_noise": _ACCELERATION,
    }
    noises, origins = {}, {}
    for name, guess in guesses.items():
        given = getattr(tuning, name)
        identified = 0.0 if said is None else getattr(said, name)
        if given is not None:
            noises[name], origins[name] = Normal(math.log(given), 0.0), "given"
        elif identified > 0.0:
            std = _ABOUT if between is None else getattr(between, name)
            noises[name] = Normal(math.log(identified), std)
            origins[name] = "about the vehicle's [identified], by what the log says"
        else:
            noises[name] = Normal(math.log(guess[0]), guess[1])
            origins[name] = "learnt from the log, up to each instant"
    neutral_std = max(_NEUTRAL * stroke, 0.0 if said is None else said.neutral_std)
    neutral = Normal(vehicle.trim_error, neutral_std)
    psi, drag, drift = _PSI * volume, _DRAG, Normal(0.0, _DRIFT * volume)
    if between is not None:
        psi, drag = between.psi, between.drag
        drift = Normal(between.neutral_drift, between.neutral_drift_std)
    hull = Normal(vehicle.hull.psi, psi)
    return Unknowns(neutral, hull, Normal(0.0, drag), drift, **noises), origins


def places(count: int) -> Array:
    """Return points [count, 7] that fill a standard normal distribution evenly (Sobol's)."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    order = math.ceil(math.log2(count + 1))
    cube = qmc.Sobol(len(Unknowns._fields), scramble=False).random_base2(order)
    return np.asarray(ndtri(cube[1 : count + 1]))


def draw(
    u: Unknowns, vehicle: Vehicle, rec: Record, *, count: int = _MEMBERS
) -> tuple[Member, ...]:
    """Return filters for a record whose guesses fill what is not known evenly."""
    base = plant(vehicle, bottom_depth=rec.bottom_depth)
    if rec.afloat:
        zero = _afloat_reading(rec)
        base = base._replace(z_surface=zero, z_air=base.z_air - base.z_surface + zero)
    wide, members = math.sqrt(1.0 - _OWN**2), []
    speed_std = _AFLOAT if rec.afloat else _UNDER_WAY
    for place in places(count).tolist():
        drawn = [n.mean + n.std * at for n, at in zip(u, place, strict=True)]
        neutral, psi, drag, drift, *noise = drawn
        neutral = u.neutral.mean + wide * (neutral - u.neutral.mean)
        stds = _START_DEPTH, speed_std, _OWN * u.neutral.std
        start = Start(float(rec.depth[0]), 0.0, neutral, *stds)
        noises = Noise(*map(math.exp, noise))
        members.append(Member(_with(base, psi=psi, drag=math.exp(drag)), noises, start, drift))
    return tuple(members)


def _afloat_reading(rec: Record) -> float:
    """Return what the sensor reads before the vehicle leaves the surface [m], its zero's error."""
    first = float(np.median(rec.depth[:_FIRST]))
    gone = np.flatnonzero(np.abs(rec.depth - first) > _LEFT)
    return float(np.median(rec.depth[: max(int(gone[0]), _FIRST) if len(gone) else None]))


def _with(p: Plant, *, psi: float, drag: float) -> Plant:
    dragged = {name: getattr(p, name) * drag for name in ("d_l", "d_b", "d_0", "d_t")}
    return p._replace(psi=psi, **dragged)


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """Predictions over one span of time; the arrays stand at the samples that are predicted.

    Only where both the sample from which and the one for which is predicted are clear of surface
    and bottom. rms, bias (predicted less measured) and spread, the predicted standard deviation of
    a measured depth as root mean square, in m. skill: 1 - rms/rms of the baseline, None where that
    is 0. coverage: share of the measured depths inside the predicted 95 % band.
    """

    seconds: float
    origin: Index  # [n] sample from which is predicted
    target: Index  # [n] sample for which
    predicted: Array  # m
    std: Array  # m, of the measured depth
    rms: float
    bias: float
    spread: float
    coverage: float
    persistence_rms: float
    integrator_rms: float

    @property
    def n(self) -> int:
        """How many predictions are judged."""
        return len(self.origin)

    @property
    def skill(self) -> dict[str, float | None]:
        """Skill against persistence and against the double integrator."""
        baselines = {"persistence": self.persistence_rms, "integrator": self.integrator_rms}
        return {name: 1.0 - self.rms / b if b > 0.0 else None for name, b in baselines.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        keys = "rms_m bias_m predicted_std_m=spread coverage95=coverage persistence_rms_m"
        found = as_json(self, f"seconds n {keys} integrator_rms_m")
        return found | {f"skill_{name}": value for name, value in self.skill.items()}


@dataclass(frozen=True, kw_only=True)
class Ahead:
    """Predictions of one log over several spans, and the noise that the filter assumed."""

    source: str
    record: Record
    horizons: tuple[Horizon, ...]
    noise: dict[str, float]  # SI, at the end of the log
    origins: dict[str, str]

    def columns(self) -> dict[str, Array]:
        """Return the columns of the file by name; nan where nothing is predicted."""
        rec = self.record
        found = {"time_s": rec.time, "depth_m": rec.depth, "compared": rec.compared.astype(float)}
        for h in self.horizons:
            for what, values in (("predicted", h.predicted), ("std", h.std)):
                column = np.full(len(rec.time), np.nan)
                column[h.target] = values
                found[f"depth_{what}_{h.seconds:g}s_m"] = column
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return the outcome in SI units, ready for JSON."""
        noise = {
            name: {"value": value, "unit": UNITS[name], "origin": self.origins[name]}
            for name, value in self.noise.items()
        }
        return as_json(self, "horizons") | {"noise": noise}


def predict_ahead(
    log: Log,
    vehicle: Vehicle,
    *,
    horizons: Sequence[float] = (10.0, 60.0),
    tuning: Tuning | None = None,
    bottom_depth: float = np.inf,
    surface_margin: float = 0.1,
    column: Column | None = None,
    advance: Advance = silent,
) -> Ahead:
    """Return how well the vehicle's model predicts the log's depths over each horizon [s].

    tuning: the noise, where the vehicle's [identified] is not to say it; what neither says is
    learnt from the log, at each instant from what came before. bottom_depth [m]; surface_margin:
    depths less than this below the depth of emergence do not count [m]. column: the water of a
    cast. advance: called with the share of the work done since it was last called.
    Raises LogError or InputError where log, vehicle and horizons do not go together.
    """
    if not horizons or not min(horizons) > 0.0 or len(set(horizons)) < len(horizons):
        what = "these are no times ahead"
        remedy = 'Give one or several, above 0 and different, as "10 s,60 s"'
        value = ",".join(f"{seconds:g}" for seconds in horizons)
        raise InputError(what, field="horizons", unit="s", value=value, remedy=remedy)
    rec = record(
        log,
        vehicle,
        drive="volume",
        bottom_depth=bottom_depth,
        surface_margin=surface_margin,
        column=column,
    )
    pairs = [_pairs(rec, seconds) for seconds in horizons]
    spread, origins = unknowns(vehicle, tuning or Tuning())
    samples, members = rec.samples, draw(spread, vehicle, rec)
    bank = filter_bank(samples, members)
    advance(0.1)
    free = filter_bank(samples, [_integrator(member) for member in members])
    advance(0.1)
    found = []
    for seconds, (origin, target) in zip(horizons, pairs, strict=True):
        found.append(_horizon(rec, bank, free, seconds, origin, target))
        advance(0.8 / len(horizons))
    last = [float(values[-1]) for values in _noise(bank)]
    return Ahead(
        source=log.source,
        record=rec,
        horizons=tuple(found),
        noise=dict(zip(UNITS, last, strict=True)),
        origins=origins,
    )


def _horizon(
    rec: Record, bank: Bank, free: Bank, seconds: float, origin: Index, target: Index
) -> Horizon:
    measured = rec.depth[target]
    predicted, std = bank.ahead(origin, target)
    std = np.hypot(std, _noise(bank)[0][origin])
    off = predicted - measured
    return Horizon(
        seconds=seconds,
        origin=origin,
        target=target,
        predicted=predicted,
        std=std,
        rms=rms(off),
        bias=float(off.mean()),
        spread=rms(std),
        coverage=float(np.mean(np.abs(off) <= Z95 * std)),
        persistence_rms=rms(rec.depth[origin] - measured),
        integrator_rms=rms(free.ahead(origin, target)[0] - measured),
    )


def _pairs(rec: Record, seconds: float) -> tuple[Index, Index]:
    """Return the samples from which and for which is predicted: `seconds` apart, to half a sample.

    Raises InputError where there are none.
    """
    time, apart = rec.time, float(np.median(np.diff(rec.time)))
    wanted = time + seconds
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearest = np.where(wanted - time[after - 1] < time[after] - wanted, after - 1, after)
    close = np.abs(time[nearest] - wanted) <= 0.5 * apart + 1e-9
    ahead = nearest > np.arange(len(time))
    (origin,) = np.nonzero(close & ahead & rec.compared & rec.compared[nearest])
    if not len(origin):
        of = f"of a log of {rec.duration:.4g} s with one every {apart:.3g} s"
        what = f"no two samples that count are so far apart: {of}, clear of surface and bottom"
        remedy = "Give a time between these"
        raise InputError(what, field="horizons", value=seconds, unit="s", remedy=remedy)
    return origin, nearest[origin]


def _noise(bank: Bank) -> tuple[Array, Array, Array]:
    """Return depth noise, random walk and acceleration noise after each sample: weighted."""
    noise = [(m.noise.depth, m.noise.random_walk, m.noise.acceleration) for m in bank.members]
    depth, walk, acceleration = (np.sqrt(bank.weighted(x)) for x in np.square(noise).T)
    return depth, walk, acceleration


def _integrator(member: Member) -> Member:
    """Return the filter of a vehicle of the same mass without drag and psi."""
    free = member.plant._replace(psi=0.0, d_l=0.0, d_b=0.0, d_0=0.0, d_t=0.0, epsilon=math.inf)
    return member._replace(plant=free)
