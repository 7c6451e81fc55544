"""Deep dives of a real float: pump and valve runs replayed through the model, with its own CTD.

::

    python -m studies.deep_dives DATA

DATA is the folder of measured data; its `mermaid_p0051` is read. One set of parameters for all
deep dives closes the volume balance; then each dive is predicted with the parameters of the
others: its pressure at each run of pump or valve and its times of arrival, from 50 dbar down to the
surface, in one go. Of the dive itself only the first two hours are used, for the volume it began
with. Beside it a float of constant speeds, likewise from the other dives. And what the sets without
one dive, and each dive by itself, have. What came out: `docs/explanation/deep-dives.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.deep_data import dives_of
from swimbladder.estimation.estimates import Z95
from swimbladder.estimation.motion.deep import effects_json
from swimbladder.estimation.motion.deep_fit import DeepFit, balance, fit_deep, start_volume
from swimbladder.estimation.motion.deep_model import (
    DEEP,
    DEFAULT,
    Body,
    DeepDive,
    Replay,
    body_of,
    priors_of,
    replay,
    run_volumes,
)
from swimbladder.io.config import load_vehicle
from swimbladder.units import shown_unit, unit_factor
from swimbladder.vehicle import Vehicle

__all__ = ["Prediction", "Study", "constant_speeds", "predict", "study"]

Array = NDArray[np.float64]
BEGIN = 5e5  # Pa: above it the sea is not what it was when the cast was taken
FIRST = 7200.0  # s, in which the volume that a dive began with shows
ARRIVED = 0.97  # of the greatest pressure
FOLLOWS = 600.0  # s, between two runs of the pump that belong together
LOOKS = 12  # that tell the volume before an action
STEPS = 2.5e6  # Pa, between two pressures whose times of arrival are told


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """A dive as measured and as told from its beginning: at each action, and times of arrival."""

    dive: DeepDive
    identified: Replay
    action: Array  # Pa [m], measured at each action
    action_told: Array  # Pa [m]
    action_constant: Array  # Pa [m], of constant speeds
    next_action: Array  # Pa [j], measured at an action 10 min or more after the one before
    next_told: Array  # Pa [j], from the action before
    next_constant: Array  # Pa [j]
    arrival: Array  # s [k], measured, since the beginning
    arrival_told: Array  # s [k]
    arrival_constant: Array  # s [k]


def float_vehicle() -> Vehicle:
    """Return the float as its log speaks of it."""
    return load_vehicle(Path(__file__).with_name("deep_float.toml"))


def constant_speeds(dives: Sequence[DeepDive]) -> tuple[float, float]:
    """Return the mean speeds of sinking and rising, as changes of pressure [Pa/s]."""
    found: list[list[float]] = [[], []]
    for dive in dives:
        begin, bottom, leave = _marks(dive)
        left = float(np.interp(leave, dive.time, dive.pressure))
        found[0].append(
            (dive.pressure[bottom] - dive.pressure[begin]) / (dive.time[bottom] - dive.time[begin])
        )
        found[1].append((left - dive.pressure[-1]) / (dive.time[-1] - leave))
    return float(np.mean(found[0])), float(np.mean(found[1]))


def _marks(dive: DeepDive) -> tuple[int, int, float]:
    """Return the samples where it is below `BEGIN` and has arrived, and when it leaves [s].

    It leaves with the last runs of the pump at its target that follow each other.
    """
    p = dive.pressure
    begin = int(np.argmax(p > BEGIN))
    arrived = int(np.argmax(p > ARRIVED * p.max()))
    pumps = dive.actions.time[
        dive.actions.pumps
        & (dive.actions.pressure > 0.9 * p.max())
        & (dive.actions.time > dive.time[arrived])
    ]
    leave = float(pumps[-1])
    for time in pumps[::-1]:
        if leave - time < FOLLOWS:
            leave = float(time)
    return begin, arrived, leave


def predict(body: Body, fit: DeepFit, dive: DeepDive, speeds: tuple[float, float]) -> Prediction:
    """Return a dive as told with parameters and speeds that others gave."""
    begin, _, t_leave = _marks(dive)
    t0 = float(dive.time[begin])
    start = start_volume(body, fit.values, dive, until=t0 - float(dive.time[0]) + FIRST)
    told = replay(body, fit.values, start, dive, begin=t0)
    # The target is part of the mission, and so is the time at which it leaves.
    target = float(np.median(dive.pressure[dive.pressure > ARRIVED * dive.pressure.max()]))

    def constant(t: Array) -> Array:
        down = np.minimum(dive.pressure[begin] + speeds[0] * (t - t0), target)
        hold = min(float(dive.pressure[begin] + speeds[0] * (t_leave - t0)), target)
        return np.where(t < t_leave, down, np.maximum(hold - speeds[1] * (t - t_leave), 0.0))

    runs = dive.actions.time[(dive.actions.time > t0) & (dive.actions.time < dive.time[-1])]
    measured = Replay(time=dive.time, pressure=dive.pressure, speed=np.zeros(len(dive.time)))
    fine = np.arange(t0, dive.time[-1], 10.0)
    simple = Replay(time=fine, pressure=constant(fine), speed=np.zeros(len(fine)))
    marks = np.arange(STEPS, ARRIVED * float(dive.pressure.max()), STEPS)
    ways = [(p, t0) for p in marks] + [(p, t_leave) for p in marks[::-1]]
    arrivals = [
        np.array([way.arrival(p, after=after) - after for p, after in ways])
        for way in (measured, told, simple)
    ]
    ahead = np.array(_ahead(body, fit, dive, speeds, t_leave, target)).reshape(-1, 3).T
    return Prediction(
        next_action=ahead[0],
        next_told=ahead[1],
        next_constant=ahead[2],
        dive=dive,
        identified=told,
        action=measured.at(runs),
        action_told=told.at(runs),
        action_constant=constant(runs),
        arrival=arrivals[0],
        arrival_told=arrivals[1],
        arrival_constant=arrivals[2],
    )


def _ahead(
    body: Body,
    fit: DeepFit,
    dive: DeepDive,
    speeds: tuple[float, float],
    leave: float,
    target: float,
) -> list[tuple[float, float, float]]:
    """Return the pressure at each action: measured, told from the one before, at constant speed.

    The volume is what closed the balance over the last looks before that.
    """
    found = []
    measured = Replay(time=dive.time, pressure=dive.pressure, speed=np.zeros(len(dive.time)))
    imbalance = balance(body, fit.values, 0.0, dive)
    for t0, t1 in pairwise(dive.actions.time):
        known = np.flatnonzero(dive.pieces.time < t0)[-LOOKS:]
        if t1 - t0 < FOLLOWS or len(known) < LOOKS:
            continue
        p0, p1 = measured.at(np.array([t0, t1]))
        told = replay(
            body, fit.values, float(np.median(imbalance[known])), dive, begin=t0, end=t1
        ).pressure[-1]
        way = speeds[0] if t0 < leave else -speeds[1]
        constant = max(p0 + way * (t1 - t0), 0.0)
        if way > 0.0:
            constant = min(constant, max(target, p0))
        found.append((float(p1), float(told), float(constant)))
    return found


@dataclass(frozen=True, kw_only=True)
class Study:
    """The fit to all deep dives, and of each dive those without it and of it alone."""

    body: Body
    dives: list[DeepDive]
    fit: DeepFit
    others: list[DeepFit]
    alone: list[DeepFit]
    predictions: list[Prediction]  # from the others' set
    means: list[Prediction]  # from what each of the others tells by itself


def study(folder: Path) -> Study:
    """Return all fits, and each dive predicted from the others."""
    vehicle = float_vehicle()
    body, priors = body_of(vehicle), priors_of(vehicle, {})
    dives = dives_of(folder, vehicle)
    others, alone, predictions, means = [], [], [], []
    for k, dive in enumerate(dives):
        rest = [*dives[:k], *dives[k + 1 :]]
        found, speeds = fit_deep(body, rest, priors, free=DEFAULT), constant_speeds(rest)
        between = effects_json(found) or {}
        values = {**found.values, **{name: one["value"] for name, one in between.items()}}
        others.append(found)
        alone.append(fit_deep(body, [dive], priors, free=DEFAULT))
        predictions.append(predict(body, found, dive, speeds))
        means.append(predict(body, replace(found, values=values), dive, speeds))
    return Study(
        body=body,
        dives=dives,
        fit=fit_deep(body, dives, priors, free=DEFAULT),
        others=others,
        alone=alone,
        predictions=predictions,
        means=means,
    )


def _rms(x: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(x))))


def _skill(error: Array, base: Array) -> float:
    return 1.0 - _rms(error) / _rms(base)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    told = study(parser.parse_args().data / "mermaid_p0051")
    fit, dives, body = told.fit, told.dives, told.body
    print("| parameter | value | 1 sigma | unit | from | each dive by itself | differ, 1 sigma |")
    print("|---|---:|---:|---|---|---:|---:|")
    between = effects_json(fit) or {}
    for name in fit.names:
        unit = DEEP[name].unit
        shown = shown_unit(unit) if unit else ""
        factor = unit_factor(unit, shown) if unit else 1.0
        origin = "the dives" if fit.identified(name) else "its prior"
        print(
            f"| {name} | {factor * fit.values[name]:.4g} | {factor * fit.std(name):.2g} "
            f"| {shown} | {origin} | {factor * between[name]['value']:.3g} "
            f"+- {factor * between[name]['std']:.2g} | {factor * between[name]['between_std']:.2g}|"
        )
    imbalances = [
        1e6 * balance(body, fit.values, float(start), dive)
        for start, dive in zip(fit.starts, dives, strict=True)
    ]
    print("\n| dive | deepest, dbar | hours | samples | imbalance, mL rms | pumped, mL |")
    print("|---|---:|---:|---:|---:|---:|")
    for imbalance, dive in zip(imbalances, dives, strict=True):
        pumped = 1e6 * float(np.sum(np.maximum(run_volumes(fit.values, dive), 0.0)))
        print(
            f"| {dive.name} | {dive.pressure.max() / 1e4:.0f} "
            f"| {(dive.time[-1] - dive.time[0]) / 3600:.1f} | {len(imbalance)} "
            f"| {_rms(imbalance):.2f} | {pumped:.0f} |"
        )
    print(f"| all | | | {sum(map(len, imbalances))} | {_rms(np.concatenate(imbalances)):.2f} | |")
    print(f"\nspeeds from look to look {1e3 * _rms(np.concatenate(fit.residuals)):.1f} mm/s rms")
    _print_sets(told)
    _print_predictions(told.predictions)


def _print_sets(told: Study) -> None:
    fit = told.fit
    print(
        f"\nof what the dives say {fit.tempering:.2f} counts\n\n| dive | drag by itself "
        "| drag without it | drag_up without it "
        "| parameters without it that lie in the intervals of all "
        "| drag of the others by themselves | pressure at an action off by, dbar rms, told with "
        "what these say in the mean |\n|---|---:|---:|---:|---:|---:|---:|"
    )
    for one, rest, mean in zip(told.alone, told.others, told.means, strict=True):
        held = [abs(rest.values[n] - fit.values[n]) <= Z95 * fit.std(n) for n in fit.names]
        drag = (effects_json(rest) or {})["drag"]
        print(
            f"| {mean.dive.name} | {one.values['drag']:.1f} +- {one.std('drag'):.1f} "
            f"| {rest.values['drag']:.1f} | {rest.values['drag_up']:.3f} "
            f"| {sum(held)} of {len(held)} | {drag['value']:.1f} +- {drag['std']:.1f} "
            f"| {_rms(mean.action_told - mean.action) / 1e4:.1f} |"
        )


def _print_predictions(predictions: list[Prediction]) -> None:
    print(
        "\n| dive, predicted from the others | actions | pressure at an action off by, dbar rms "
        "| at constant speed | skill | arrivals off by, min rms | at constant speed | skill |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    sums: list[list[Array]] = [[], [], [], []]
    for p in predictions:
        errors = [
            (p.action_told - p.action) / 1e4,
            (p.action_constant - p.action) / 1e4,
            (p.arrival_told - p.arrival) / 60.0,
            (p.arrival_constant - p.arrival) / 60.0,
        ]
        for total, error in zip(sums, errors, strict=True):
            total.append(error)
        print(_row(p.dive.name, errors))
    print(_row("all", [np.concatenate(total) for total in sums]))
    print(
        "\n| dive, from action to action | actions | pressure at the next off by, dbar rms "
        "| at constant speed | skill |\n|---|---:|---:|---:|---:|"
    )
    steps: list[list[Array]] = [[], []]
    for p in predictions:
        errors = [(p.next_told - p.next_action) / 1e4, (p.next_constant - p.next_action) / 1e4]
        for total, error in zip(steps, errors, strict=True):
            total.append(error)
        print(_row(p.dive.name, errors))
    print(_row("all", [np.concatenate(total) for total in steps]))


def _row(name: str, errors: list[Array]) -> str:
    cells = []
    for told, constant in zip(errors[::2], errors[1::2], strict=True):
        cells += [f"{_rms(told):.1f}", f"{_rms(constant):.1f}", f"{_skill(told, constant):.2f}"]
    return f"| {name} | {len(errors[0])} | {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
