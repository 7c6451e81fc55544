"""What a design says, in words and numbers, and the plan that it makes."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.design.experiments.conditions import (
    Conditions,
    Curve,
    EvaluatedSet,
    Flight,
    OmittedVariable,
    Setting,
)
from swimbladder.design.plan import Expected, Plan, PlannedExperiment, Trace
from swimbladder.estimation.estimates import Finding
from swimbladder.estimation.motion.diagnose import LIMIT, describe
from swimbladder.io.answers import Answer, as_json
from swimbladder.units import format_quantity
from swimbladder.vehicle import Vehicle

_SEEN = 1.5  # of the noise: a residual that is larger shows that something is left out
_FAST = 0.2  # m/s
_COARSE = 0.3  # of the quantum: less noise than that and rounding is no white noise


def judge(
    chosen: EvaluatedSet, curve: Curve, stretched: Mapping[str, float], c: Conditions
) -> tuple[Finding, ...]:
    """Return what is to be said of a set; stretched: its shares in a pool half as deep again."""
    setting = c.setting
    return (
        *chosen.prediction.open,
        *_remedies(chosen, stretched),
        *_ends(chosen),
        *_arrivals(chosen, setting),
        *_biases(chosen, setting),
        *(_limits(name, chosen, stretched) for name in c.question.names),
        _sizes(curve),
        *_coarse(setting),
    )


def percent(share: float | None) -> str:
    """Return a share as text, with two digits."""
    if share is None or not math.isfinite(share):
        return "not known"
    return f"{100.0 * share:.2g} %" if share < 1.0 else f"{100.0 * share:.0f} %"


def _coarse(setting: Setting) -> Iterator[Finding]:
    if setting.quantum > 0.0 and setting.noise < _COARSE * setting.quantum:
        yield _warning(
            "quantum",
            f"The noise of {1e3 * setting.noise:g} mm is small against the quantum of "
            f"{1e3 * setting.quantum:g} mm: a record that rounds so coarsely is no signal with "
            "white noise, and the errors may be larger than said.",
        )


def _remedies(chosen: EvaluatedSet, stretched: Mapping[str, float]) -> Iterator[Finding]:
    if not chosen.prediction.open:
        return
    share = chosen.prediction.share
    worst = max(share, key=lambda name: share[name])
    longer = (share[worst] / LIMIT) ** 2
    known = percent(stretched[worst])
    parts = [f"With half as much travel again {worst} would be known to {known}"]
    if 1.0 < longer < 50.0:
        parts.append(f"about {longer:.1f} times the pool time would do")
    parts.append("or give what is known of it (`priors=`, `fixed=`)")
    yield Finding("remedy", "note", f"{'; '.join(parts)}.")


_WHERE = {
    "shallowest": "the shallow end",
    "deepest": "the deep end",
    "longest": "the longest time of a record",
}


def _ends(chosen: EvaluatedSet) -> Iterator[Finding]:
    for k, (flight, missed) in enumerate(zip(chosen.flights, chosen.partial, strict=True), 1):
        if not flight.complete:
            done, asked = len(flight.moved), len(flight.release.moves)
            when = f"{_WHERE[flight.ended]} {flight.duration:.0f} s after the release"
            move = f"before move {done + 1} of {asked}: that move will not happen"
            yield _warning("range", f"Experiment {k} reaches {when}, {move}.")
        elif missed:
            some = f"{missed} of the {len(chosen.others)} vehicles of the parameter region"
            ends = "reach an end of the range before the last move; the prediction includes this"
            yield _warning("range", f"Experiment {k}: {some} {ends}.")


def _arrivals(chosen: EvaluatedSet, setting: Setting) -> Iterator[Finding]:
    """Say which releases go fast where their records end, as seen in all vehicles."""
    fast = []
    for k in range(len(chosen.releases)):
        ends = [f[k] for f in (chosen.flights, *chosen.others) if f[k].ended != "longest"]
        speeds = [abs(f.depth[-1] - f.depth[-2]) / setting.sample_time for f in ends]
        if speeds and max(speeds) > _FAST:
            fast.append((k + 1, max(speeds)))
    if fast:
        listed = ", ".join(f"{k} ({speed:.2f} m/s)" for k, speed in fast)
        seconds = setting.clearance / max(speed for _, speed in fast)
        where = "Fast where the record ends, in some vehicle of the parameter region"
        then = f"Surface or bottom follow in {seconds:.0f} s or more"
        yield _warning("arrival", f"{where}: {listed}. {then}: have the loop, or a hand, catch it.")


def _biases(chosen: EvaluatedSet, setting: Setting) -> Iterator[Finding]:
    if chosen.psi is not None:
        left = chosen.psi
        seen = left.rms > _SEEN * setting.depth_noise
        small = not _matters(left.refit, chosen)
        then = "the fit would show it" if seen else "nobody would notice"
        then = "no more than the intervals hold" if small else then
        rms = f"{1e3 * left.rms:.1f} mm rms instead of {1e3 * setting.depth_noise:.1f} mm"
        how = f"refit of a simulated campaign; linearised {describe(left.linear)}"
        sentence = f"If psi were left out: {describe(left.refit)} ({how}), at {rms}: {then}."
        yield Finding("psi", "note" if seen or small else "warning", sentence)
    for kind, omitted, how, size, each in (
        ("trim", chosen.trim, "were off", setting.neutral_std, ""),
        ("drift", chosen.drift, "drifted", 60.0 * setting.drift_std, " a minute"),
    ):
        if omitted is not None and _matters(omitted.linear, chosen):
            by = f"{how} by {format_quantity(size, 'm3', 'cm3', 2)}{each} the same way"
            bias = f"{describe(omitted.linear)}; the fit's intervals do not contain that"
            yield _warning(kind, f"If all neutral volumes {by}: {bias}.")


def _warning(kind: str, sentence: str) -> Finding:
    return Finding(kind, "warning", sentence)


def _matters(bias: Mapping[str, float], chosen: EvaluatedSet) -> bool:
    """Say whether a bias is more than a standard deviation."""
    return any(abs(off) > chosen.prediction.share[name] for name, off in bias.items())


_SOURCES = {
    "noise": "the noise of the depths",
    "neutral volume": "the error of the neutral volumes",
    "drift": "a drift of the neutral volumes",
    "delay": "how late the volumes are stamped",
    "between samples": "how the volumes go between their samples",
    "prior": "what was known before",
}


def _limits(name: str, chosen: EvaluatedSet, stretched: Mapping[str, float]) -> Finding:
    prediction = chosen.prediction
    sources = {_SOURCES[s]: x for s, x in prediction.sources[name].items()}
    listed = sorted(sources.items(), key=lambda item: -item[1])[:2]
    words = [f"{what} ({100.0 * x:.0f} % of the variance)" for what, x in listed if x > 0.1]
    ratio = stretched[name] / prediction.share[name]
    travel = ", and the travel" if ratio < 0.75 else ""
    more = f"{percent(stretched[name])} instead of {percent(prediction.share[name])}"
    then = f": with half as much travel again {more}" if ratio < 1.0 else ""
    return Finding("limit", "note", f"{name} is limited by {' and '.join(words)}{travel}{then}.")


def _sizes(curve: Curve) -> Finding:
    best, fro = int(np.argmin(curve.steps)), int(np.argmin(curve.to_and_fro))
    double = int(np.argmin(np.abs(curve.sizes - 2.0 * curve.sizes[best])))
    size, larger, both = (f"{1e6 * curve.sizes[k]:.2g} cm3" for k in (best, double, fro))
    sentence = f"Of single steps the largest are most informative, {size}."
    if best < len(curve.sizes) - 1:
        share, more = percent(curve.steps[best]), f"{percent(curve.steps[double])} with {larger}"
        sentence = f"Of single steps those of {size} are most informative, {share} in this time: "
        sentence += f"a larger one buys nothing ({more})."
    then = f"To and fro it is {both}, with {percent(curve.to_and_fro[fro])}."
    return Finding("size", "note", f"{sentence} {then}")


_TRACE = 1.0  # s between the points of an expected trace, at the least
_POINTS = 60


@dataclass(frozen=True, kw_only=True)
class Design(Answer):
    """Which experiments to run, their predicted errors, and how these compare.

    chosen: the set to run, in order; against: another one, named `rival`. curve: what sizes of
    volume changes buy. assumptions: all that the prediction rests on, as sentences.
    """

    vehicle: Vehicle
    conditions: Conditions
    criterion: str
    budget: float  # s
    chosen: EvaluatedSet
    against: EvaluatedSet | None
    rival: str
    curve: Curve
    findings: tuple[Finding, ...]
    assumptions: tuple[str, ...]

    @property
    def identifiable(self) -> bool:
        """Whether the set identifies all that is asked."""
        return all(f.severity != "no" for f in self.findings)

    @property
    def gains(self) -> dict[str, float]:
        """How many times larger the errors of the rival set are, by name."""
        if self.against is None:
            return {}
        ours, theirs = self.chosen.prediction.share, self.against.prediction.share
        return {name: theirs[name] / ours[name] for name in ours}

    def plan(self, evaluated: EvaluatedSet | None = None) -> Plan:
        """Return the plan to follow at the pool: of the chosen set, or of another one."""
        w, s = evaluated or self.chosen, self.conditions.setting
        expected = [
            Expected(name=name, **as_json(e, "value std unit"))
            for name, e in w.prediction.parameters.items()
        ]
        return Plan(
            name=f"experiments for {self.vehicle.name}",
            vehicle=self.vehicle.name,
            **as_json(s, "bottom_depth shallowest deepest sample_time rest"),
            depth_noise=s.noise,
            depth_quantum=s.quantum,
            neutral_std=s.neutral_std if math.isfinite(s.neutral_std) else None,
            expected=tuple(expected),
            experiments=tuple(_planned(flight, s) for flight in w.flights),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        rival = self.against
        return {
            "vehicle": self.vehicle.name,
            **as_json(self, "criterion identifiable time_budget_s=budget findings assumptions"),
            "drag": self.conditions.question.model.law,
            **_set(self.chosen),
            "against": rival and {"name": self.rival, **_set(rival), "error_ratio": self.gains},
            "curve": as_json(self.curve, "size_m3=sizes steps to_and_fro best_step_m3"),
            "setting": as_json(self.conditions.setting, _SETTING),
        }


_SETTING = (
    "bottom_depth_m shallowest_m deepest_m sample_time_s depth_noise_m neutral_std_m3 "
    "drift_std_m3_s delay_std_s settling_s"
)


def _set(w: EvaluatedSet) -> dict[str, Any]:
    prediction = w.prediction

    return {
        "time_s": w.time,
        "experiments": [
            {
                "start_depth_m": r.start,
                "moves": [as_json(m, "volume_m3 depth_m going") for m in r.moves],
                **as_json(f, "duration_s ended"),
                "share_after": after,
            }
            for r, f, after in zip(w.releases, w.flights, w.after, strict=True)
        ],
        "parameters": {
            name: {
                **e.to_dict(),
                "share": prediction.share[name],
                "share_range": list(w.spread[name]),
                "sources": prediction.sources[name],
            }
            for name, e in prediction.parameters.items()
        },
        **as_json(prediction, "names covariance correlation"),
        "bias": {"psi": _bias(w.psi), "trim": _bias(w.trim), "drift": _bias(w.drift)},
    }


def _bias(left: OmittedVariable | None) -> dict[str, Any] | None:
    keys = "linear refit refit_rms_m=rms" if left and left.refit else "linear"
    return left and as_json(left, keys)


def _planned(flight: Flight, s: Setting) -> PlannedExperiment:
    first, last = flight.moved[0], len(flight.time) - 1
    step = max(1, math.ceil(max(_TRACE, flight.duration / _POINTS) / s.sample_time))
    kept = np.unique(np.append(np.arange(first, last, step), last))
    columns = (flight.time - flight.time[first], flight.depth, flight.volume)
    time, depth, volume = (
        np.round(column[kept], digits).tolist()
        for column, digits in zip(columns, (3, 4, 8), strict=True)
    )
    return PlannedExperiment(
        start_depth=flight.release.start,
        longest=s.longest,
        settling=round(s.settling, 1),
        duration=round(flight.duration, 1),
        moves=flight.release.moves,
        trace=Trace(time=time, depth=depth, volume=volume),
    )
