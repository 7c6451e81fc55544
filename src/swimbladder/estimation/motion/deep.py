"""From logs of deep dives to a vehicle's parameters, and how sure they are.

Goodness of fit is whether one set of parameters describes all dives. A fit to dives that do not
belong together has narrow intervals as any other. Where a dive's volume balance, or its pressures
from sample to sample, are off by many times what sensors, moving water, the cast's error and
drifting volumes explain, the parameters do not describe it and are not identified.

The parameters go into the vehicle's file (`identified_vehicle`); `out_of_place` says which have no
place there.
Volumes of a law whose actions are seconds follow pump and valve when these become known.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel
from scipy.optimize import minimize_scalar
from scipy.special import ndtri

from swimbladder.control.argo import ARGO, let_in
from swimbladder.control.registry import bind
from swimbladder.errors import InputError
from swimbladder.estimation.estimates import (
    Estimate,
    Origin,
    Prior,
    check_distinct,
    sentence,
    undetermined,
)
from swimbladder.estimation.motion import deep_model
from swimbladder.estimation.motion.deep_filter import Noise, displaced_variance
from swimbladder.estimation.motion.deep_fit import FACTOR, NOISES, DeepFit, balance, fit_deep, least
from swimbladder.estimation.series import rms
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.float_log import FloatLog
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import weighing
from swimbladder.physics.oil import ATMOSPHERIC_PRESSURE
from swimbladder.physics.seawater import Column, check_rows
from swimbladder.physics.steady_drives import valve_flow
from swimbladder.vehicle import (
    Controller,
    HullPart,
    PhysicalMotion,
    PowerLawPump,
    PumpAndValve,
    Vehicle,
    field_unit,
)


def as_long(vehicle: Vehicle, filled: Vehicle) -> Controller | None:
    """Return the controller of a filled vehicle: an action of the law `argo` lasts as it did."""
    own, before, after = vehicle.controller, vehicle.engine, filled.engine
    if own is None or own.law != ARGO.name:
        return own
    assert isinstance(before, PumpAndValve)
    assert isinstance(after, PumpAndValve)
    law, rho_g = bind(own)[1], vehicle.water.specific_weight
    numbers = {**own.parameters}
    if isinstance(before.pump, PowerLawPump) and isinstance(after.pump, PowerLawPump):
        seconds = (law.pump_volume + before.start_volume) / before.pump.delivery
        numbers["pump_volume"] = after.pump.delivery * seconds - after.start_volume
        numbers["pump_loss"] = after.pump.slip * seconds * rho_g
    depth = np.linspace(0.05, 1.0, 50) * (vehicle.hull.depth_limit or law.valve_depth or 1000.0)
    head = depth * rho_g + ATMOSPHERIC_PRESSURE - before.internal_pressure
    now = np.array([let_in(law, law.valve_volume, z) for z in depth.tolist()])
    now *= valve_flow(after.valve, head) / valve_flow(before.valve, head)  # in the same seconds

    def shape(half: float) -> Array:
        return depth / np.hypot(depth, half)

    def off(half: float) -> float:
        return float(np.linalg.norm(now - shape(half) * _scaled(shape(half), now)))

    half = float(minimize_scalar(off, bounds=(0.0, depth[-1]), method="bounded").x)
    numbers["valve_depth"], numbers["valve_volume"] = half, _scaled(shape(half), now)
    numbers["gain"] = law.gain * numbers["valve_volume"] / law.valve_volume
    return own.model_copy(update={"parameters": numbers})


def _scaled(shape: Array, values: Array) -> float:
    """Return by what a shape [n] is multiplied to be nearest to values [n]."""
    return float(shape @ values / (shape @ shape))


_STIFFENS = 1e-20  # 1/Pa2, the least that a vehicle's file has

_HULL = "the cast, and the mass and hull in the vehicle's file"
_WARM = "temperature_degC of the log, its unit, and whether it is of the hull"
_SECONDS = "the {0}'s seconds in the log, and its {1} in the vehicle's file"

# Where a vehicle's file holds each, and what to check when it comes out strange.
_PLACES: dict[str, tuple[str, str]] = {
    "drag": ("motion.drag.k_dt", "the pressures and the mass in the vehicle's file"),
    "drag_up": ("motion.drag.rising_ratio", "whether the water was that of the cast while it rose"),
    "compressibility": ("hull.parts.0.compressibility", _HULL),
    "stiffening": ("hull.parts.0.stiffening", _HULL),
    "thermal_expansion": ("hull.parts.0.thermal_expansion", _WARM),
    "trapped_air": ("hull.trapped_air", "the cast near the surface"),
    "pump_delivery": ("actuator.pump.delivery", _SECONDS.format("pump", "delivery")),
    "pump_slip": ("actuator.pump.slip", _SECONDS.format("pump", "slip")),
    "pump_start": ("actuator.start_volume", "the pump's seconds in the log"),
    "valve": ("actuator.valve.flow", _SECONDS.format("valve", "flow")),
    "valve_laminar": ("actuator.valve.laminar_pressure", _SECONDS.format("valve", "flow")),
    "bypass": ("actuator.bypass.flow", _SECONDS.format("bypass", "flow")),
    "creep": ("actuator.creep", "the cast, and whether the log leaves out runs"),
}
_DEVICES = ("pump_delivery", "valve", "bypass")  # what moves volume, for sure more than 0
_WATERS = 5e-10  # 1/Pa, a compressibility that no sea water has, and no hull that comes back
_BOUNDS = {
    "gt": (operator.gt, "more than {:g}"),
    "ge": (operator.ge, "{:g} or more"),
    "lt": (operator.lt, "less than {:g}"),
    "le": (operator.le, "{:g} or less"),
}


def identified_vehicle(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle of these values, but for what its file has no place for.

    That is the delivery of a pump that is described by its motor. Mass and hull without trapped air
    are those of `body_of`, so trim_error moves with trapped air, and with the hull's warmth where
    [water] is not as warm as reference_temperature. Volumes of a law whose actions are seconds of
    pump and valve are those of as many seconds.
    """
    return weighing(_filled(vehicle, values), deep_model.body_of(vehicle).mass)


def _filled(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with these values, before its trim_error follows them."""
    body, actuator = deep_model.body_of(vehicle), vehicle.engine
    assert isinstance(actuator, PumpAndValve)

    changed: dict[str, Any] = {}
    for name in ("valve", "bypass"):
        device = getattr(actuator, name)
        if device is not None:
            changed[name] = device.model_copy(update={"flow": device.flow * values[name]})
    laminar = {"laminar_pressure": max(values["valve_laminar"], 0.0) ** 2}
    changed["valve"] = changed["valve"].model_copy(update=laminar)
    pump = actuator.pump
    if isinstance(pump, PowerLawPump):
        delivery = pump.delivery * values["pump_delivery"]
        slip = max(_slip(pump, values), 0.0)
        changed["pump"] = pump.model_copy(update={"delivery": delivery, "slip": slip})
    changed["start_volume"] = max(actuator.start_volume + values["pump_start"], 0.0)
    changed["creep"] = max(values["creep"], 0.0)
    stiffening = values["stiffening"] if abs(values["stiffening"]) >= _STIFFENS else 0.0
    soft = {"compressibility": max(values["compressibility"], 0.0), "stiffening": stiffening}
    soft["thermal_expansion"] = values["thermal_expansion"]
    part = HullPart(name="hull", volume=body.volume, compressibility=0.0).model_copy(update=soft)
    drag = {"k_dt": values["drag"], "rising_ratio": values["drag_up"]}
    motion: dict[str, Any] = {"drag": vehicle.drag.model_copy(update=drag)}
    if isinstance(vehicle.motion, PhysicalMotion):
        more = (values["inertia"] - 1.0) * vehicle.mass
        motion["added_mass"] = max(vehicle.motion.added_mass + more, 0.0)
    air = values["trapped_air"]
    hull = {"displaced_volume": body.volume + air, "parts": (part,), "trapped_air": air}
    changes = {
        "actuator": actuator.model_copy(update=changed),
        "hull": vehicle.hull.model_copy(update=hull),
        "motion": vehicle.motion.model_copy(update=motion),
    }
    filled = vehicle.model_copy(update=changes)
    return filled.model_copy(update={"controller": as_long(vehicle, filled)})


def _slip(pump: PowerLawPump, values: Mapping[str, float]) -> float:
    """Return what the pump loses per pressure [m3/s/Pa], the file's and what is found beyond it."""
    return pump.slip * values["pump_delivery"] + pump.delivery * values["pump_slip"]


def out_of_place(vehicle: Vehicle, values: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """Say of each of `names` whose value no vehicle's file may hold: the number and the bound.

    What `identified_vehicle` holds at 0 has a place, but a compressibility.
    """
    file, found = _filled(vehicle, values), []
    for name in names:
        path, check = _PLACES.get(name, ("", ""))
        *way, field = path.split(".")
        holder: Any = file
        for key in way:
            holder = holder[int(key)] if key.isdigit() else getattr(holder, key)
        model = type(holder)
        if field not in getattr(model, "model_fields", {}):
            continue
        written = values[name] if name == "compressibility" else getattr(holder, field)
        bounds = _broken(model, field, written)
        if bounds:
            unit, stands = field_unit(model, field), ""
            if name in ("pump_delivery", "pump_slip", "valve", "bypass"):
                stands = f"{field} would be {written:.4g} {unit}, and "
            texts = {"name": name, "field": field, "check": check, "stands": stands}
            value = f"{values[name]:.4g} {deep_model.DEEP[name].unit}".rstrip()
            limits = f"{' and '.join(bounds)} {unit}".rstrip()
            found.append(sentence("deep", "out of place", **texts, value=value, bounds=limits))
    return found


def _broken(model: type[BaseModel], field: str, value: float) -> list[str]:
    """Return the bounds of a field that a value breaks, in words."""
    found = []
    for bound in model.model_fields[field].metadata:
        for key, (keeps, words) in _BOUNDS.items():
            limit = getattr(bound, key, None)
            if limit is not None and not keeps(value, limit):
                found.append(words.format(limit))
    return found


# Of `Misfit`, and of how far dives are apart over what they say. Simulated dives of
# `studies.deep_calibration` have 1.1 at most, and six real dives of `studies.deep_dives` together
# 2.1; two made-up dives whose valve let in a tenth more than that of two others 2.8, which widens
# the intervals. Real dives of several seasons with a cast of one, simulated dives of several
# vehicles, and made-up ones with valves of 0.9 and 1.5 have 4.8 to 30.
MANY, BEYOND = 2.5, 4.0
_MEDIAN = float(ndtri(0.75))  # of the size of a normal number, in its deviations


class Misfit(NamedTuple):
    """By how many times the noise a dive is off, 1 where all is as it should be; by the median.

    apart: how far it is by itself from what fits all, in its deviations.
    """

    imbalance: float
    speeds: float
    distance: float

    @property
    def most(self) -> float:
        """The larger of imbalance and speeds."""
        return max(self.imbalance, self.speeds)


def misfit_of(body: deep_model.Body, fit: DeepFit, k: int, dive: deep_model.DeepDive) -> Misfit:
    """Return how far volume balance and speeds of dive `k` of a fit are off."""
    off = balance(body, fit.values, float(fit.starts[k]), dive)
    imbalance = _times(off / _noise(body, fit, dive)) if len(off) else 0.0
    return Misfit(imbalance, speeds=_times(fit.innovations[k]), distance=fit.distance[k])


def _times(ratio: Array) -> float:
    return float(np.median(np.abs(ratio))) / _MEDIAN


def _noise(body: deep_model.Body, fit: DeepFit, dive: deep_model.DeepDive) -> Array:
    """Return the expected imbalance of a dive's volumes at each piece [m3] [n], 1 sigma.

    Noise counts at most for its prior value times its factor: a fit that cannot describe a dive
    takes all for noise.
    """
    noise = Noise(*np.minimum(fit.noise, NOISES * np.exp(FACTOR)).tolist())
    p = dive.pieces
    carried = np.abs(deep_model.drag_volume(fit.values, p.speed, p.density, dive.gravity))
    per_speed = 2.0 * carried / np.maximum(np.abs(p.speed), np.finfo(float).tiny)
    measured = np.sqrt(2.0 * noise.pressure**2 + p.rounding)
    measured = measured / (p.density * dive.gravity * p.duration)
    layers = dive.water.at(p.pressure).layers
    moved = displaced_variance(noise.water**2, noise.lasts)
    variance = per_speed**2 * (noise.water**2 + measured**2)
    variance += noise.drift**2 * p.elapsed
    variance += noise.runs**2 * (p.before @ deep_model.run_volumes(fit.values, dive) ** 2)
    variance += layers**2 * moved + deep_model.cast_volume(body, fit.priors, layers) ** 2
    return np.asarray(np.sqrt(variance))


def inconsistent(found: Sequence[Misfit], tempering: float) -> bool:
    """Whether dives are off, or apart, by over `BEYOND`: no set of parameters describes them.

    tempering: power of their likelihood, by how far they are apart.
    """
    return any(one.most > BEYOND for one in found) or tempering < BEYOND**-2


def messages(
    names: Sequence[str], found: Sequence[Misfit], imbalances: Sequence[float], tempering: float
) -> list[str]:
    """Say which dives are off by many times the noise; imbalances: rms of each [m3]."""
    bad = inconsistent(found, tempering)
    wrong = [one.most > MANY for one in found]
    if bad and not any(wrong):  # their own estimates show which
        farthest = max(one.distance for one in found)
        wrong = [one.distance > min(BEYOND, 0.999 * farthest) for one in found]
    if not any(wrong):
        return []
    which = [
        sentence("deep", "misfit", name=names[k], rms=imbalances[k], off=found[k])
        for k in np.flatnonzero(wrong).tolist()
    ]
    return [sentence("deep", "inconsistent" if bad else "lacks", which="; ".join(which))]


def water_messages(noise: Noise) -> list[str]:
    """Say where the water would have to move more than is known of it before."""
    if noise.water <= NOISES.water * np.exp(FACTOR.water):
        return []
    return [sentence("deep", "rough", found=noise.water, usual=NOISES.water)]


_SELDOM = 1800.0  # s, between two samples
_CONTRADICT = 0.5  # tempering: chance leaves more, with some 50 squares
_OFF, _MOST = 1.96, 3  # deviations beyond which a parameter is named, and how many are


def effects_json(fit: DeepFit) -> dict[str, Any] | None:
    """Return the random effects of the dives, by name in SI; None for one dive."""
    found = fit.random_effects
    if found is None:
        return None
    parts = np.stack([found.value, np.sqrt(np.diag(found.covariance)), found.spread], axis=1)
    effects = {}
    for name, (value, std, between) in zip(fit.names, parts.tolist(), strict=True):
        mean, unit = fit.priors[name]
        numbers = {"value": mean + unit * value, "std": unit * std, "between_std": unit * between}
        effects[name] = numbers
    return effects


def weakly_determined(fit: DeepFit, weak: Sequence[str]) -> list[str]:
    """Name weakly determined parameters: near the prior, away from it, per dive."""
    found: dict[str, list[str]] = {"near": [], "off": [], "apart": []}
    for name in weak:
        prior = fit.priors[name]
        near = abs(fit.values[name] - prior.mean) <= prior.std
        found["apart" if fit.identified_singly(name) else "near" if near else "off"].append(name)
    return [sentence("deep", how, names=", ".join(n)) for how, n in found.items() if n]


def _within(name: str, mean: float, std: float) -> str:
    return f"{mean:.4g} +- {std:.2g} {deep_model.DEEP[name].unit}".rstrip()


def differences(fit: DeepFit, dives: Sequence[deep_model.DeepDive]) -> list[str]:
    """Say how far dives differ, and what of that the intervals have."""
    kept = effects_json(fit)
    if kept is None:
        seldom = sum(int(np.sum(np.diff(dive.time) > _SELDOM)) for dive in dives)
        come = f"{seldom} sample{'s come' if seldom > 1 else ' comes'}"
        late = sentence("deep", "alone", "late", seldom=come) if seldom else ""
        return [sentence("deep", "alone", late=late)]
    found = []
    if fit.tempering < _CONTRADICT:
        found.append(sentence("deep", "overdispersed", times=fit.tempering**-0.5))
    assert fit.random_effects is not None
    deviation = np.sqrt(np.diag(fit.random_effects.covariance))
    at = np.array([(fit.values[n] - fit.priors[n].mean) / fit.priors[n].std for n in fit.names])
    off = np.abs(at - fit.random_effects.value) / deviation
    far = [i for i in np.argsort(-off)[:_MOST].tolist() if off[i] > _OFF]
    if far:
        texts = []
        for name in np.array(fit.names)[far].tolist():
            own = _within(name, kept[name]["value"], kept[name]["std"])
            texts.append(f"{name} {fit.values[name]:.4g} against {own}")
        found.append(sentence("deep", "differs", named="; ".join(texts)))
    if len(dives) == 2:
        found.append(sentence("deep", "two"))
    return found


_FAR = 2.5  # deviations of a prior, one in eighty by chance


@dataclass(frozen=True, kw_only=True)
class DiveFit:
    """The residuals of one dive: of its volume balance and of its replay."""

    dive: deep_model.DeepDive
    start: Estimate  # m3, the drive's volume when the dive began
    imbalance: Array  # m3 [n], at each sample
    speed: Array  # m/s [n], measured less modelled
    replay: deep_model.Replay
    misfit: Misfit  # how far off that is, in times the noise


@dataclass(frozen=True, kw_only=True)
class DeepIdentification(Answer):
    """Parameters from deep dives.

    identified: whether the data determine all that was asked for. sentences: what a user has to
    know, the answer first. inconsistent: whether the model cannot describe the dives: no intervals.
    """

    vehicle: Vehicle
    result_vehicle: Vehicle
    fit: DeepFit
    parameters: Mapping[str, Estimate]
    dives: tuple[DiveFit, ...]
    identified: bool
    inconsistent: bool
    sentences: tuple[str, ...]
    assumptions: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        fit, unknown = self.fit, {"std": None, "ci95": None} if self.inconsistent else {}
        noise = "pressure_Pa water_m_s water_lasts_s=lasts drift_m3_s0.5 runs"
        over_noise = "imbalance_over_noise speed_over_noise=speeds distance"
        return {
            "vehicle": self.vehicle.name,
            "identified": self.identified,
            "parameters": {name: e.to_dict() | unknown for name, e in self.parameters.items()},
            "noise": as_json(fit.noise, noise),
            "tempering": fit.tempering,
            "random_effects": effects_json(fit),
            "dives": [
                {
                    "source": one.dive.name,
                    "samples": len(one.imbalance),
                    "deepest_Pa": float(one.dive.pressure.max()),
                    "start_volume": one.start.to_dict() | unknown,
                    "imbalance_rms_m3": rms(one.imbalance),
                    "speed_rms_m_s": rms(one.speed),
                    **as_json(one.misfit, over_noise),
                    "replay_rms_Pa": rms(one.replay.at(one.dive.time) - one.dive.pressure),
                }
                for one in self.dives
            ],
            "imbalance_rms_m3": rms(np.concatenate([one.imbalance for one in self.dives])),
            "priors": {
                n: p._asdict() for n, p in fit.priors.items() if n in (*fit.names, *deep_model.CAST)
            },
            **as_json(self, "sentences assumptions"),
        }


def identify_deep(
    logs: Sequence[FloatLog],
    casts: Sequence[Column],
    vehicle: Vehicle,
    *,
    free: Sequence[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None,
    advance: Advance = silent,
) -> DeepIdentification:
    """Identify drag, hull, pump and valve from deep dives.

    Parameters
    ----------
    logs
        As `read_float_log` returns them, one for each dive.
    casts
        The water, one for all dives or one each, as `read_cast` or `cast_column` returns it.
    vehicle
        As `load_vehicle` returns it, with pump and valve.
    free
        Names of `DEEP` that are identified; none: most of them.
    fixed
        By name of `DEEP`, values in SI that are not identified.
    priors
        By name of `DEEP` and `CAST`, what is known before the dives; none: the usual.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    DeepIdentification
        The parameters with their intervals, and how far the model is off each dive.

    Raises
    ------
    InputError
        The vehicle has no pump and valve, a log has no dive, or what is asked cannot be identified.
    """
    held, before = deep_model.check_deep_request(
        vehicle, len(logs), len(casts), free=free, fixed=fixed, priors=priors
    )
    check_distinct(logs)
    each = list(casts) * (len(logs) if len(casts) == 1 else 1)
    for column in casts:
        check_rows(column)
    pairs = zip(logs, each, strict=True)
    dives = [
        deep_model.deep_dive(log, column, vehicle, name=Path(log.source).name)
        for log, column in pairs
    ]
    body = deep_model.body_of(vehicle)
    known = deep_model.priors_of(vehicle, before)
    values = {name: known[name].mean for name in deep_model.DEEP} | dict(held)
    _check_place(vehicle, values, {"fixed": held, "priors": before})
    run = ("bypass",) if any(dive.actions.bypass.any() for dive in dives) else ()
    names = tuple(free or [n for n in (*deep_model.DEFAULT, *run) if n not in held])
    advance(0.1)
    fit = fit_deep(
        body, dives, known, free=names, fixed=held, advance=lambda share: advance(0.8 * share)
    )
    parameters = {name: _estimate(fit, name, held) for name in (*fit.names, *held)}
    fits = tuple(_dive_fit(body, fit, k, dive) for k, dive in enumerate(dives))
    advance(0.1)
    weak = [name for name in fit.names if not fit.identified(name)]
    ends = {n: 0.0 if n in _DEVICES else least(known, n) for n in fit.names}
    open_ = [n for n in fit.names if undetermined(parameters[n], (ends[n], math.inf))]
    missed = [name for name in weak if not fit.identified_singly(name)]
    asked = [n for n in missed if n in (free or ()) or len(missed) == len(fit.names)]
    asked += [n for n in open_ if n not in asked]
    bad = inconsistent([one.misfit for one in fits], fit.tempering)
    # A compressibility that dives hardly determine is held at 0, as `identified_vehicle` does.
    placed = [n for n in fit.names if n not in asked and (n not in weak or n != "compressibility")]
    strange = out_of_place(vehicle, fit.values, placed)
    e = parameters.get("compressibility")
    if e is not None and e.ci95[0] > _WATERS:
        strange.append(sentence("deep", "softer than water", value=e.value, low=e.ci95[0]))
    good = not (asked or bad or strange)
    return DeepIdentification(
        vehicle=vehicle,
        fit=fit,
        parameters=parameters,
        result_vehicle=identified_vehicle(vehicle, fit.values) if good else vehicle,
        dives=fits,
        identified=good,
        inconsistent=bad,
        sentences=_sentences(fit, fits, weak, asked, strange),
        assumptions=_assumptions(vehicle, fit, dives),
    )


def _check_place(
    vehicle: Vehicle, values: Mapping[str, float], given: Mapping[str, Iterable[str]]
) -> None:
    """Raise InputError for a value that has no place in a vehicle's file; given: by option."""
    for option, names in given.items():
        for name in names:
            if name in deep_model.DEEP and out_of_place(vehicle, values, [name]):
                what, remedy = "no vehicle's file may hold it", "Check the number and its unit"
                value, unit = f"{name}={values[name]:g}", deep_model.DEEP[name].unit
                raise InputError(what, field=option, value=value, unit=unit, remedy=remedy)


def _estimate(fit: DeepFit, name: str, fixed: Mapping[str, float]) -> Estimate:
    origin: Origin = "set" if name in fixed else "data" if fit.identified(name) else "prior"
    return Estimate.of(fit.values[name], fit.std(name), deep_model.DEEP[name].unit, origin=origin)


def _dive_fit(body: deep_model.Body, fit: DeepFit, k: int, dive: deep_model.DeepDive) -> DiveFit:
    start, std = float(fit.starts[k]), np.sqrt(np.diag(fit.covariance))[len(fit.names) + k]
    return DiveFit(
        dive=dive,
        start=Estimate.of(start, float(std), "m3"),
        imbalance=balance(body, fit.values, start, dive),
        speed=fit.residuals[k],
        replay=deep_model.replay(body, fit.values, start, dive),
        misfit=misfit_of(body, fit, k, dive),
    )


def _sentences(
    fit: DeepFit,
    fits: Sequence[DiveFit],
    weak: Sequence[str],
    missed: Sequence[str],
    strange: Sequence[str],
) -> tuple[str, ...]:
    closes = rms(np.concatenate([one.imbalance for one in fits]))
    speed = rms(np.concatenate([one.speed for one in fits]))
    dives = f"{len(fits)} dive{'s' if len(fits) > 1 else ''}"
    found = [sentence("deep", "balance", dives=dives, imbalance=closes, speed=speed)]
    off = [one.misfit for one in fits]
    names, imbalances = zip(*((one.dive.name, rms(one.imbalance)) for one in fits), strict=True)
    bad = messages(names, off, imbalances, fit.tempering)
    if inconsistent(off, fit.tempering):
        return (*bad, *found, *water_messages(fit.noise))
    if missed:
        found.insert(0, sentence("deep", "not identifiable", names=", ".join(missed)))
    else:
        found += weakly_determined(fit, weak)
    found = [*strange, *found, *bad, *water_messages(fit.noise), *contradictions(fit)]
    anchors = [n for n in ("drag", "pump_delivery", "valve") if n in fit.names]
    if len(anchors) == 3 and not any(fit.identified(name) for name in anchors):
        found.append(sentence("deep", "anchors"))
    found += differences(fit, [one.dive for one in fits])
    return tuple(found)


def contradictions(fit: DeepFit) -> list[str]:
    """Say what came out farther from what was known before than that was known to be."""
    found = []
    for name in fit.names:
        prior = fit.priors[name]
        off = abs(fit.values[name] - prior.mean) / prior.std
        if off > _FAR:
            texts = {"name": name, "before": _within(name, *prior)}
            found.append(sentence("deep", "contradicts", off=off, **texts))
    return found


def _assumptions(
    vehicle: Vehicle, fit: DeepFit, dives: Sequence[deep_model.DeepDive]
) -> tuple[str, ...]:
    said = [f"{name} {_within(name, *p)}" for name, p in fit.priors.items() if name in fit.names]
    body, actuator = deep_model.body_of(vehicle), vehicle.engine
    assert isinstance(actuator, PumpAndValve)
    hull = sentence("deep", "hull", mass=body.mass, volume=body.volume)
    found = [f"known before: {'; '.join(said)}", hull]
    if actuator.bypass is not None and "bypass" not in fit.names:
        share = fit.values["bypass"]
        said_of = "as in the vehicle's file" if share == 1.0 else f"{share:.4g} of its file's"
        found.append(sentence("deep", "bypass", share=said_of))
    lost = [] if isinstance(actuator.pump, PowerLawPump) else ["pump_delivery"]
    slip = fit.values["pump_slip"]
    if isinstance(actuator.pump, PowerLawPump):
        slip = _slip(actuator.pump, fit.values)
    whole = {**fit.values, "pump_slip": slip}
    places = ("creep", "pump_slip", "valve_laminar")
    below = [name for name in places if name in fit.names and whole[name] < 0.0]
    lost += [f"a {name} below 0" for name in below]
    if lost:
        found.append(f"{' and '.join(lost)} has no place in vehicle.toml")
    cast = deep_model.CAST
    off = ", ".join(f"{name} 0 +- {fit.priors[name].std:.2g} {x.unit}" for name, x in cast.items())
    return (*found, *_warmths(dives), sentence("deep", "cast", cast=off, noise=fit.noise))


def _warmths(dives: Sequence[deep_model.DeepDive]) -> list[str]:
    """Say of hull temperatures that were not logged."""
    found = []
    for dive in dives:
        missing, samples = dive.unwarmed, len(dive.time)
        if missing == samples:
            found.append(sentence("deep", "not warmed", name=dive.name))
        elif missing:
            counts = {"missing": missing, "samples": samples}
            found.append(sentence("deep", "half warmed", name=dive.name, **counts))
    return found
