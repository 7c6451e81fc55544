"""From logs of deep dives to a vehicle's parameters, and how sure they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.hull import weighing
from swimbladder.identify.deep_dive import DeepDive, deep_dive
from swimbladder.identify.deep_fit import DeepFit, balance, fit_deep
from swimbladder.identify.deep_model import (
    CAST,
    DEEP,
    DEFAULT,
    Body,
    body_of,
    check_deep_request,
    priors_of,
)
from swimbladder.identify.deep_replay import Replay, replay
from swimbladder.identify.estimates import Estimate, Prior, estimate
from swimbladder.io.float_log import FloatLog
from swimbladder.parameters import HullPart, PhysicalMotion, PowerLawPump, PumpAndValve, Vehicle
from swimbladder.seawater import Column

__all__ = [
    "DeepIdentification",
    "Told",
    "contradictions",
    "identified_vehicle",
    "identify_deep",
]

Array = NDArray[np.float64]

_STIFFENS = 1e-20  # 1/Pa2, the least that a vehicle's file has
_SELDOM = 1800.0  # s, between two looks
_CONTRADICT = 0.5  # of what dives say that counts: chance leaves more, with some 50 squares
_FAR = 2.5  # deviations of a prior, one in eighty by chance


@dataclass(frozen=True, kw_only=True)
class Told:
    """What one dive says: how far its book of volumes and its replay are off."""

    dive: DeepDive
    start: Estimate  # m3, the drive's volume when the dive began
    book: Array  # m3 [n], at each look
    speed: Array  # m/s [n], measured less modelled
    replay: Replay


@dataclass(frozen=True, kw_only=True)
class DeepIdentification:
    """Parameters from deep dives.

    identified: whether all that was asked for is told by the data. sentences: what a user has to
    know, the answer first.
    """

    vehicle: Vehicle
    result_vehicle: Vehicle
    fit: DeepFit
    parameters: Mapping[str, Estimate]
    dives: tuple[Told, ...]
    identified: bool
    sentences: tuple[str, ...]
    assumptions: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "vehicle": self.vehicle.name,
            "identified": self.identified,
            "parameters": {name: e.to_json() for name, e in self.parameters.items()},
            "noise": {
                "pressure_Pa": self.fit.noise.pressure,
                "water_m_s": self.fit.noise.water,
                "water_lasts_s": self.fit.noise.lasts,
                "drift_m3_s0.5": self.fit.noise.drift,
                "runs": self.fit.noise.runs,
            },
            "worth": self.fit.worth,
            "dives": [
                {
                    "source": told.dive.name,
                    "looks": len(told.book),
                    "deepest_Pa": float(told.dive.pressure.max()),
                    "start_volume": told.start.to_json(),
                    "book_rms_m3": _rms(told.book),
                    "speed_rms_m_s": _rms(told.speed),
                    "replay_rms_Pa": _rms(told.replay.at(told.dive.time) - told.dive.pressure),
                }
                for told in self.dives
            ],
            "book_rms_m3": _rms(np.concatenate([told.book for told in self.dives])),
            "priors": {
                name: {"mean": prior.mean, "std": prior.std}
                for name, prior in self.fit.priors.items()
                if name in self.fit.names or name in CAST
            },
            "sentences": list(self.sentences),
            "assumptions": list(self.assumptions),
        }


def identify_deep(
    logs: Sequence[FloatLog], columns: Sequence[Column], vehicle: Vehicle, *,
    free: Sequence[str] | None = None, fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None, advance: Callable[[float], None] = lambda _: None,
) -> DeepIdentification:  # fmt: skip
    """Return drag, hull, pump and valve as deep dives tell them.

    columns: the water, one for all dives or one each. free: names of `DEEP`, most of them unless
    given. Raises InputError for a vehicle without pump and valve, for logs without dives and for
    what cannot be identified.
    """
    check_deep_request(
        vehicle, len(logs), len(columns), free=free, fixed=list(fixed or {}),
        priors=priors or {},
    )  # fmt: skip
    each = list(columns) * (len(logs) if len(columns) == 1 else 1)
    dives = [
        deep_dive(log, column, vehicle, name=Path(log.source).name)
        for log, column in zip(logs, each, strict=True)
    ]
    body, known = body_of(vehicle), priors_of(vehicle, priors or {})
    run = ("bypass",) if any(dive.action_bypass.any() for dive in dives) else ()
    names = tuple(free or [n for n in (*DEFAULT, *run) if n not in (fixed or {})])
    advance(0.1)
    fit = fit_deep(
        body, dives, known, free=names, fixed=fixed, advance=lambda share: advance(0.8 * share)
    )
    parameters = {name: _estimate(fit, name, fixed or {}) for name in (*fit.names, *(fixed or {}))}
    told = tuple(_told(body, fit, k, dive) for k, dive in enumerate(dives))
    advance(0.1)
    untold = [name for name in fit.names if not fit.told(name)]
    asked = [name for name in untold if name in (free or ())]
    good = not asked and len(untold) < len(fit.names)
    return DeepIdentification(
        vehicle=vehicle, fit=fit, parameters=parameters,
        result_vehicle=identified_vehicle(vehicle, fit.values) if good else vehicle,
        dives=told, identified=good,
        sentences=_sentences(fit, told, untold, good), assumptions=_assumptions(vehicle, fit),
    )  # fmt: skip


def _estimate(fit: DeepFit, name: str, fixed: Mapping[str, float]) -> Estimate:
    origin = "set" if name in fixed else "data" if fit.told(name) else "prior"
    return estimate(fit.values[name], fit.std(name), DEEP[name].unit, origin=origin)  # type: ignore[arg-type]


def _told(body: Body, fit: DeepFit, k: int, dive: DeepDive) -> Told:
    i = len(fit.names) + k
    start = float(fit.starts[k])
    return Told(
        dive=dive, start=estimate(start, float(np.sqrt(fit.covariance[i, i])), "m3"),
        book=balance(body, fit.values, start, dive), speed=fit.residuals[k],
        replay=replay(body, fit.values, start, dive),
    )  # fmt: skip


def _sentences(
    fit: DeepFit, told: Sequence[Told], untold: Sequence[str], good: bool
) -> tuple[str, ...]:
    book = _rms(np.concatenate([one.book for one in told]))
    count = len(told)
    found = [
        f"With one set of parameters the book of volumes of {count} dive{'s' if count > 1 else ''} "
        f"closes to {1e6 * book:.2g} mL rms, speeds from look to look to "
        f"{1e3 * _rms(np.concatenate([one.speed for one in told])):.2g} mm/s rms."
    ]
    if not good:
        found.insert(0, "The data do not tell what was asked: " + ", ".join(untold) + ".")
    elif untold:
        found.append(f"Hardly told by these dives, and near what was known: {', '.join(untold)}.")
    found += contradictions(fit)
    anchors = [n for n in ("drag", "pump_delivery", "valve") if n in fit.names]
    if len(anchors) == 3 and not any(fit.told(name) for name in anchors):
        found.append(
            "The absolute size of drag, pump and valve together rests on their priors; how they "
            "compare is told by the dives."
        )
    seldom = sum(int(np.sum(np.diff(one.dive.time) > _SELDOM)) for one in told)
    if fit.worth < _CONTRADICT:
        found.append(
            f"The dives are {fit.worth**-0.5:.2g} times farther apart than each says by itself: "
            "something differs between them that has no parameter. The intervals are widened by "
            "that."
        )
    if seldom:
        found.append(
            f"{seldom} look{'s come' if seldom > 1 else ' comes'} more than half an hour after the "
            "one before. What happened between counts as the model has it, so the intervals are "
            "narrower than they should be: see how parameters differ without one dive or the other."
        )
    return tuple(found)


def contradictions(fit: DeepFit) -> list[str]:
    """Say what came out farther from what was known before than that was known to be."""
    found = []
    for name in fit.names:
        prior, unit = fit.priors[name], DEEP[name].unit
        off = abs(fit.values[name] - prior.mean) / prior.std
        if off > _FAR:
            before = f"{prior.mean:.4g} +- {prior.std:.2g} {unit}".rstrip()
            found.append(
                f"{name} comes out {off:.1f} deviations from what was known before ({before}): one "
                "of the two is wrong. A cast that is farther off than was reckoned with (--prior "
                "cast_density, cast_heave), or a mass or hull that is not as in the file, moves "
                "the size of drag, pump and valve together. Believe how they compare; hold the "
                "size by what you measured, with --set."
            )
    return found


def _assumptions(vehicle: Vehicle, fit: DeepFit) -> tuple[str, ...]:
    said = [
        f"{name} {prior.mean:.4g} +- {prior.std:.2g} {DEEP[name].unit}".rstrip()
        for name, prior in fit.priors.items()
        if name in fit.names
    ]
    body, actuator = body_of(vehicle), vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    bypass: tuple[str, ...] = ()
    if actuator.bypass is not None and "bypass" not in fit.names:
        share = fit.values["bypass"]
        said_of = "as in the vehicle's file" if share == 1.0 else f"{share:.4g} of its file's"
        bypass = (f"the flow of the bypass is {said_of}: it is not identified",)
    lost = [
        *([] if isinstance(actuator.pump, PowerLawPump) else ["pump_delivery"]),
        *(["a creep below 0"] if fit.values["creep"] < 0.0 else []),
    ]
    place = (f"{' and '.join(lost)} has no place in vehicle.toml",) if lost else ()
    cast = ", ".join(f"{name} 0 +- {fit.priors[name].std:.2g} {x.unit}" for name, x in CAST.items())
    return (
        f"known before: {'; '.join(said)}",
        f"the vehicle weighs {body.mass:.6g} kg and displaces {body.volume * 1e3:.6g} L without "
        "trapped air, as in its file; trim_error is what makes vehicle.toml weigh that",
        *bypass, *place,
        f"the cast errs by {cast}, 1 sigma; the water moves by {1e3 * fit.noise.water:.1f} mm/s "
        f"that last {fit.noise.lasts / 60.0:.0f} min, as the dives tell",
    )  # fmt: skip


def identified_vehicle(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle of these values, but for what its file has no place for.

    That is the delivery of a pump that is described by its motor. Mass and hull without trapped air
    are those of `body_of`, so trim_error moves with trapped air, and with the hull's warmth where
    [water] is not as warm as reference_temperature.
    """
    body, hull, actuator = body_of(vehicle), vehicle.hull, vehicle.actuator
    assert isinstance(actuator, PumpAndValve)
    pump = actuator.pump
    if isinstance(pump, PowerLawPump):
        pump = pump.model_copy(update={
            "delivery": pump.delivery * values["pump_delivery"],
            "slip": pump.slip * values["pump_delivery"] + pump.delivery * values["pump_slip"],
        })  # fmt: skip
    stiffening = values["stiffening"]
    part = HullPart(
        name="hull", volume=body.volume, compressibility=max(values["compressibility"], 0.0),
        thermal_expansion=values["thermal_expansion"],
        stiffening=stiffening if abs(stiffening) >= _STIFFENS else 0.0,
    )  # fmt: skip
    bypass = actuator.bypass
    if bypass is not None:
        bypass = bypass.model_copy(update={"flow": bypass.flow * values["bypass"]})
    changed = actuator.model_copy(update={
        "pump": pump,
        "valve": actuator.valve.model_copy(
            update={"flow": actuator.valve.flow * values["valve"]}
        ),
        "bypass": bypass,
        "start_volume": max(actuator.start_volume + values["pump_start"], 0.0),
        "creep": max(values["creep"], 0.0),
    })  # fmt: skip
    motion: dict[str, Any] = {"drag": vehicle.drag.model_copy(
        update={"k_dt": values["drag"], "rising_ratio": values["drag_up"]}
    )}  # fmt: skip
    if isinstance(vehicle.motion, PhysicalMotion):
        more = (values["inertia"] - 1.0) * vehicle.mass
        motion["added_mass"] = max(vehicle.motion.added_mass + more, 0.0)
    air = values["trapped_air"]
    found = vehicle.model_copy(update={
        "actuator": changed,
        "hull": hull.model_copy(update={
            "displaced_volume": body.volume + air, "parts": (part,), "trapped_air": air,
        }),
        "motion": vehicle.motion.model_copy(update=motion),
    })  # fmt: skip
    return weighing(found, body.mass)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
