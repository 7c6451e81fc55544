"""How logs of one vehicle differ: the spread of psi, drag, drift and noise between them.

A fit of several logs together says how well a common value is known, not how far the next log's
own may be from it. Here every log has values of its own, drawn from a normal distribution whose
means and deviations are those under which the logs are most probable. Their likelihood, by the
same filters that later predict, is sampled once over a wide distribution; the narrow one is then
found by expectation and maximisation with importance weights (Dempster, Laird and Rubin, J. R.
Stat. Soc. B 39, 1977).
"""

import math
from collections.abc import Sequence

import numpy as np

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.ahead import Normal, Tuning, Unknowns, draw, places, unknowns
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.kalman.depth_filter import log_likelihood
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.vehicle import Between, Identified, IdentifiedMotion, Motion, Vehicle

FEWEST = 4  # logs
_COUNT = 1023  # of filters for each log
_ROUNDS = 200
# How the values identified follow the drag: what a share more of it makes of them.
_OF_DRAG = {"K2": -1.0, "T2": -1.0, "drag_quadratic": 1.0}
_LEAST = 0.2  # of the wide deviation: so narrow one is as good as none to these filters
# Wide: beside what the vehicle's file says where it says little.
_WIDE_PSI = 4e-4  # 1/m, of the displaced volume
_WIDE_DRAG = 0.4
_WIDE_DRIFT = 2e-6  # 1/s, of the displaced volume
_WIDE_NOISE = {"depth_noise": 0.3, "random_walk": 1.5, "acceleration_noise": 1.0}


def between_logs(
    records: Sequence[Record], vehicle: Vehicle, *, advance: Advance = silent
) -> Vehicle:
    """Return the vehicle with the means over the logs, and how these differ, in its [identified].

    vehicle: identified from these logs. Its psi, drag, trim and noise become the means of what the
    logs have each, and the covariance allows for the few logs that they are from. advance:
    called with the share of the work done since last called.
    Raises InputError where there are too few logs, or the vehicle was not identified.
    """
    known = vehicle.identified
    if len(records) < FEWEST:
        what = f"the between-log variance is not identifiable from {len(records)} logs"
        raise InputError(what, field="LOG", remedy=f"Give {FEWEST} or more")
    if known is None:
        what, remedy = "the vehicle was not identified", "Identify it first"
        raise InputError(what, field="identified", remedy=remedy)
    wide = _wide(vehicle)
    place = places(_COUNT)
    likelihood = np.empty((len(records), _COUNT))
    for i, record in enumerate(records):
        likelihood[i] = _likelihoods(record, vehicle, wide)
        advance(1.0 / len(records))
    mean, std = _spread(place, likelihood)
    return _with(vehicle, wide, mean, std, len(records))


def _wide(vehicle: Vehicle) -> Unknowns:
    u, _ = unknowns(vehicle, Tuning())
    volume = vehicle.hull.displaced_volume
    return u._replace(
        psi=Normal(u.psi.mean, _WIDE_PSI * volume),
        drag=Normal(0.0, _WIDE_DRAG),
        drift=Normal(0.0, _WIDE_DRIFT * volume),
        **{name: Normal(getattr(u, name).mean, std) for name, std in _WIDE_NOISE.items()},
    )


def _likelihoods(record: Record, vehicle: Vehicle, wide: Unknowns) -> Array:
    """Return the log likelihood of the whole record for every draw [_COUNT]."""
    if record.volume is None:
        raise InputError("a log without volume says nothing of it", field="volume_m3")
    members = draw(wide, vehicle, record, count=_COUNT)
    return np.array([log_likelihood(record.samples, member)[-1] for member in members])


def _spread(place: Array, likelihood: Array) -> tuple[Array, Array]:
    """Return mean and deviation of each unknown over the logs, in deviations of the wide one.

    place [draws, unknowns]: standard normal; likelihood [logs, draws].
    """
    p = place.shape[1]
    mean, std = np.zeros(p), np.ones(p)
    for _ in range(_ROUNDS):
        # the narrow density over the wide one, which drew them
        ratio = -0.5 * ((place - mean) / std) ** 2 - np.log(std) + 0.5 * place**2
        score = likelihood + ratio.sum(axis=1)
        weight = np.exp(score - score.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        own = weight @ place  # [logs, unknowns]
        square = weight @ place**2
        new = own.mean(axis=0)
        wide = np.sqrt(np.maximum((square - 2.0 * own * new + new**2).mean(axis=0), _LEAST**2))
        moved = max(np.abs(new - mean).max(), np.abs(wide - std).max())
        mean, std = new, wide
        if moved < 1e-3:
            break
    return mean, std


def _with(vehicle: Vehicle, wide: Unknowns, mean: Array, std: Array, logs: int) -> Vehicle:
    """Return the vehicle with what was found."""
    each = zip(wide, mean.tolist(), std.tolist(), strict=True)
    found = Unknowns(*(Normal(w.mean + w.std * m, w.std * s) for w, m, s in each))
    known = vehicle.identified
    assert known is not None  # between_logs checks it
    fields = ("depth_noise", "random_walk", "acceleration_noise")
    noises = dict(zip(fields, found[4:], strict=True))
    spread = {name: noise.std for name, noise in noises.items()}
    spread |= {"psi": found.psi.std, "drag": found.drag.std}
    between = Between(neutral_drift=found.drift.mean, neutral_drift_std=found.drift.std, **spread)
    share = math.exp(found.drag.mean)
    values, covariance = _values(known, found, share, logs)
    changes = {"between": between, "values": values, "covariance": covariance}
    changes |= {name: math.exp(noise.mean) for name, noise in noises.items()}
    changes["neutral_std"] = found.neutral.std
    update = {
        "trim_error": found.neutral.mean,
        "hull": vehicle.hull.model_copy(update={"psi": found.psi.mean}),
        "motion": _dragged(vehicle.motion, share),
        "identified": known.model_copy(update=changes),
    }
    return vehicle.model_copy(update=update)


def _values(
    known: Identified, found: Unknowns, share: float, logs: int
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Return the values at the means, and their covariance: that of means of so many logs too."""
    old = np.array(known.values)
    is_psi = np.array([name == "psi" for name in known.names])
    of_drag = np.array([_OF_DRAG.get(name, 0.0) for name in known.names])
    new = np.where(is_psi, found.psi.mean, old * share**of_drag)
    scale = np.where(is_psi, 1.0, new / np.where(old == 0.0, 1.0, old))
    by_drag = found.drag.std * new * of_drag
    by_psi = found.psi.std * is_psi
    C = np.array(known.covariance) * np.outer(scale, scale)
    C += (np.outer(by_drag, by_drag) + np.outer(by_psi, by_psi)) / logs
    return tuple(new.tolist()), tuple(tuple(row) for row in C.tolist())


def _dragged(motion: Motion, share: float) -> Motion:
    """Return the motion with its drag times a share."""
    if isinstance(motion, IdentifiedMotion):
        return IdentifiedMotion(K2=motion.K2 / share, T2=motion.T2 / share)
    drag = motion.drag
    update = {"k_dl": drag.k_dl * share, "k_dt": drag.k_dt * share}
    return motion.model_copy(update={"drag": drag.model_copy(update=update)})
