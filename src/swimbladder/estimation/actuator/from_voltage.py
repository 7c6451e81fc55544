"""The estimates that a fit to voltage steps gives, by name.

A driver may start softly: the motor then gets less than the logged voltage for a while. The fit to
voltage steps is repeated with a voltage that can change only so fast. That has one number more than
the fit has; where it is by far the likelier, T1 is the ramp's as well.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.estimation.actuator.bench import Bench
from swimbladder.estimation.actuator.estimate import shown
from swimbladder.estimation.actuator.model import LOGARITHMIC, Problem, drive_of, steady_speed
from swimbladder.estimation.actuator.profile import profile_of_T1
from swimbladder.estimation.actuator.result import Step
from swimbladder.estimation.actuator.voltage import VoltageFit, named, solve
from swimbladder.estimation.estimates import (
    Estimate,
    bounded,
    estimate,
    given,
    not_identifiable,
)

Array = NDArray[np.float64]

_RAMPS = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0)  # of the fitted T1: a ramp to the largest voltage
_SEEN = 15.0  # deviance by which it has to be better, of one parameter more and six trials


class SoftStart(NamedTuple):
    """How long the voltage takes to rise to the largest [s], and T1 [s] if it does."""

    ramp: float
    T1: float


def soft_start(fit: VoltageFit) -> SoftStart | None:
    """Return the soft start that makes the fit by far the likelier, None where there is none."""
    problem = fit.problem
    if "T1" not in named(fit):
        return None
    values = fit.values
    n = int(problem.used.sum())
    least = float(np.sum(problem.white(fit.q) ** 2))
    best, found = n * math.log(max(least, 1e-300)) - _SEEN, None
    for share in _RAMPS:
        ramp = share * values["T1"]
        other = _with_voltage(problem, [slewed(b, problem.top / ramp) for b in problem.benches])
        guess = {**values, "T1": max(values["T1"] - 0.4 * ramp, 0.1 * values["T1"])}
        q = solve(other, other.turned(guess))
        left = n * math.log(max(float(np.sum(other.white(q) ** 2)), 1e-300))
        if left < best:
            best, found = left, SoftStart(ramp, other.values(q)["T1"])
    return found


def _with_voltage(problem: Problem, benches: list[Bench]) -> Problem:
    """Return the problem with other voltages; outliers and whitener stay."""
    other = Problem(benches, problem.blocks, problem.free, problem.fixed, problem.moving)
    other.used, other.early, other.whiten = problem.used, problem.early, problem.whiten
    return other


def slewed(bench: Bench, most: float) -> Bench:
    """Return the bench with a voltage that changes by at most `most` [V/s].

    What a sample has is the mean until the next, as the voltage is taken to be held.
    """
    assert bench.voltage is not None
    asked, step = bench.voltage, np.diff(bench.time)
    mean, now = asked.copy(), float(asked[0])
    for k, (goal, h) in enumerate(zip(asked[:-1].tolist(), step.tolist(), strict=True)):
        way = goal - now
        taken = min(abs(way) / most, h)
        then = now + math.copysign(most * taken, way) if abs(way) > most * h else goal
        mean[k] = (0.5 * (now + then) * taken + then * (h - taken)) / h
        now = then
    return replace(bench, voltage=mean)


def from_voltage(fit: VoltageFit, chosen: dict[str, float], unit: str) -> dict[str, Estimate]:
    """Return K1, T1, dead_zone, load_voltage, asymmetry and rate; not identifiable ones say why.

    chosen: what the user has set; unit: of the position.
    """
    units = {
        "K1": f"{unit}/s/V", "T1": "s", "dead_zone": "V", "load_voltage": "V", "asymmetry": "-",
        "rate": f"{unit}/s",
    }  # fmt: skip
    values, identified = fit.values, named(fit)
    found: dict[str, Estimate] = {}
    for name, of in units.items():
        if name in chosen:
            found[name] = given(chosen[name], of)
        elif name not in fit.problem.free:
            found[name] = (
                _rate(fit, identified, of)
                if name == "rate"
                else not_identifiable(of, _ONE_WAY[name])
            )
        elif name == "T1" and (name in identified or "K1" in identified):
            found[name] = profile_of_T1(fit)
        elif name not in identified or ("K1" in fit.problem.free and "K1" not in identified):
            found[name] = not_identifiable(of, _blind(fit))
        else:
            logarithmic = name in LOGARITHMIC
            size = values[name] if logarithmic else fit.problem.top
            found[name] = _along(
                fit, values[name], size, of, logarithmic=logarithmic, **{name: 1.0}
            )
            if name == "dead_zone" and found[name].ci95[0] < 0.0:
                found[name] = replace(found[name], ci95=(0.0, found[name].ci95[1]))
    return found


def _along(
    fit: VoltageFit, value: float, size: float, unit: str, *, logarithmic: bool, **weights: float
) -> Estimate:
    """Return the estimate of what changes by `size` times the weighted sum of what is turned."""
    std, reach = fit.spread_along(np.array([weights.get(name, 0.0) for name in fit.problem.free]))
    return estimate(value, size * std, unit, reach=size * reach, logarithmic=logarithmic)


_ONE_WAY = {
    "asymmetry": "the voltages moved it in one direction only",
    "load_voltage": "the voltages moved it in one direction only: a load counts as dead zone",
}


def _rate(fit: VoltageFit, identified: tuple[str, ...], unit: str) -> Estimate:
    if "K1" in fit.problem.free and "K1" not in identified:
        return not_identifiable(unit, _blind(fit))
    drive, top = drive_of(fit.values), fit.problem.top
    fastest = max(abs(steady_speed(top, drive)), abs(steady_speed(-top, drive)))
    why = (
        f"no limit is seen: at {top:.3g} V, the largest voltage, it reaches {shown(fastest, unit)}"
    )
    return bounded(fastest, math.inf, unit, why)


def _blind(fit: VoltageFit) -> str:
    """Return the sentence on what the logs cannot distinguish."""
    free, hit = fit.problem.free, (fit.blind**2).max(axis=1) > 0.02
    names = {name for name, one in zip(free, hit.tolist(), strict=True) if one}
    if {"K1", "T1"} <= names and "dead_zone" not in names:
        return (
            "the steps are too short: K1 and T1 trade off, because no steady speed is reached; "
            "hold a voltage for several T1"
        )
    if "dead_zone" in names and names & {"K1", "asymmetry"}:
        return (
            f"{_and(names)} trade off: at one size of voltage a smaller dead zone and a smaller "
            "gain look alike; log steps of two sizes or more, or give one with --set "
            '"dead_zone=0 V"'
        )
    return f"{_and(names)} trade off: log longer steps, of both signs and of several sizes"


def _and(names: set[str]) -> str:
    words = sorted(names)
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def by_direction(fit: VoltageFit, found: dict[str, Estimate], unit: str) -> dict[str, Estimate]:
    """Return the gains and the edges of the dead zone outward and inward, if identified."""
    values = fit.values
    result: dict[str, Estimate] = {}

    def identified(*names: str) -> bool:
        return all(found[name].known for name in names)

    if identified("K1", "asymmetry"):
        drive = drive_of(values)
        for name, value, sign in (("K1_out", drive.K_out, 0.5), ("K1_in", drive.K_in, -0.5)):
            result[name] = _along(
                fit, value, value, f"{unit}/s/V", logarithmic=True, K1=1.0, asymmetry=sign
            )
    if identified("dead_zone", "load_voltage"):
        for name, sign in (("threshold_out", 1.0), ("threshold_in", -1.0)):
            value = sign * values["load_voltage"] + values["dead_zone"]
            result[name] = _along(
                fit, value, fit.problem.top, "V", logarithmic=False,
                dead_zone=1.0, load_voltage=sign,
            )  # fmt: skip
    return result


def covariance_of(fit: VoltageFit, found: dict[str, Estimate]) -> dict[str, dict[str, float]]:
    """Return the covariance of the identified parameters, in SI, by name."""
    values = fit.values
    identified = [n for n in fit.problem.free if found[n].known]
    sizes = {n: values[n] if n in LOGARITHMIC else fit.problem.top for n in identified}
    at = {n: fit.problem.free.index(n) for n in identified}
    return {
        a: {b: float(fit.covariance[at[a], at[b]]) * sizes[a] * sizes[b] for b in identified}
        for a in identified
    }


def steps_of(fit: VoltageFit) -> tuple[Step, ...]:
    """Return what was fitted, block by block."""
    found = []
    problem = fit.problem
    for k, block in enumerate(problem.blocks):
        own = problem.block == k
        bench = problem.benches[block.log]
        assert bench.voltage is not None
        u, x = bench.voltage[block.samples], bench.position[block.samples]
        sizes = u[np.abs(u) > 0.02 * problem.top]
        low, high = (float(sizes.min()), float(sizes.max())) if len(sizes) else (0.0, 0.0)
        found.append(
            Step(
                source=bench.source,
                label=f"{low:.3g} V" if abs(high - low) < 0.02 * problem.top
                else f"{low:.3g} to {high:.3g} V",
                time=bench.time[block.samples],
                position=x,
                fitted=x - fit.residual[own],
                voltage=u,
                used=problem.used[own],
                speed=None,
                start=0,
            )
        )  # fmt: skip
    return tuple(found)
