"""The kinds of pool campaign that the study draws, and how one is drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from studies.bound import Experiment
from studies.noise import Noise
from studies.truth import Array, Body, Motor, Step, follow

__all__ = ["SCENARIOS", "Campaign", "Kept", "Scenario", "draw"]

DENSITY = 1000.0  # kg/m3, fresh water
K_B = DENSITY * 9.80665  # N/m3
POOL = 4.5  # m
CLEARANCE = 0.75  # m, of the depths of rest from bottom and surface
TRAVEL = 3.0  # m, at which a record ends
LONGEST = 240.0  # s, of a record
NEUTRAL_STD = 0.5e-6  # m3, of an experiment's neutral volume
SPEED_STD = 1e-3  # m/s, that a held vehicle has left when the piston is let go
SUPPLY = 12.0  # V
PAPER_STEPS = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1: each up and down
GUESS_STD = 0.3  # of the logarithm of what the fit starts from


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A kind of campaign. psi_std: of the prior, relative; 0: psi is known, inf: nothing is."""

    name: str
    sentence: str
    random: bool = False  # vehicle, steps, sample time, noise and quantum; else the paper's
    drag: str = "linear"
    psi_std: float = 0.1
    rest: float = 5.0  # s on record before the step
    coloured: bool = False
    outliers: float = 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """What is fitted for the vehicle."""
        motion = {
            "linear": ("K2", "T2"),
            "quadratic": ("mass", "drag_quadratic"),
            "blended": ("K2", "T2", "drag_quadratic"),
        }[self.drag]
        return (*motion, "psi") if self.psi_std else motion

    def logarithmic(self, name: str) -> bool:
        """Whether the interval of a parameter is one of its logarithm: what cannot be 0."""
        return name != "psi" and (name, self.drag) != ("drag_quadratic", "blended")


SCENARIOS = (
    Scenario(name="paper", sentence="the paper's eight experiments, psi known to 10 %"),
    Scenario(name="paper-psi-known", sentence="the same, psi known exactly", psi_std=0.0),
    Scenario(
        name="paper-short-rest",
        sentence="the same as the first, with 0.6 s of rest before the step on record, not 5 s",
        rest=0.6,
    ),
    Scenario(name="paper-psi-free", sentence="the same, nothing known of psi", psi_std=math.inf),
    Scenario(
        name="random",
        sentence="random vehicles, steps, sample times, noise and quanta, psi known to 10 %",
        random=True,
    ),
    Scenario(
        name="random-psi-free",
        sentence="the same, nothing known of psi",
        random=True,
        psi_std=math.inf,
    ),
    Scenario(
        name="quadratic", sentence="random, with quadratic drag", random=True, drag="quadratic"
    ),
    Scenario(
        name="blended",
        sentence="random, with linear and quadratic drag",
        random=True,
        drag="blended",
    ),
    Scenario(
        name="coloured",
        sentence="the paper's, noise with a memory of 0.3 to 0.9 a sample",
        coloured=True,
    ),
    Scenario(
        name="outliers",
        sentence="the paper's, one depth in ten off by 0.3 m (1 sigma)",
        outliers=0.1,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Kept:
    """What the experimenter has of an experiment."""

    time: Array  # s
    depth: Array  # m, as the sensor said
    volume: Array  # m3, as the piston's sensor said, counted from the rest


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A vehicle, its experiments, what was measured, and what is known and guessed before."""

    body: Body
    motor: Motor
    noise: Noise
    experiments: tuple[Experiment, ...]
    kept: tuple[Kept, ...]
    truth: dict[str, float]  # of the vehicle, SI units
    guess: dict[str, float]  # that the fit starts from; of psi the mean of the prior


def draw(scenario: Scenario, *, seed: int, index: int) -> Campaign:
    """Return the campaign of this number; the same for the same three."""
    rng = np.random.default_rng([seed, crc32(scenario.name.encode()), index])
    body, motor, truth = _vehicle(scenario, rng)
    noise, sample_time = _sensor(scenario, rng)
    experiments, kept = [], []
    for dV in _volumes(scenario, body, rng):
        step = _step(dV, motor, rng, sample_time, scenario.rest)
        experiment, record = _performed(body, motor, step, noise, rng)
        experiments.append(experiment)
        kept.append(record)
    off = np.exp(GUESS_STD * rng.normal(size=len(truth)))
    guess = {name: value * f for (name, value), f in zip(truth.items(), off, strict=True)}
    if math.isfinite(scenario.psi_std):
        guess["psi"] = truth["psi"] + scenario.psi_std * abs(truth["psi"]) * float(rng.normal())
    return Campaign(
        body=body,
        motor=motor,
        noise=noise,
        experiments=tuple(experiments),
        kept=tuple(kept),
        truth=truth,
        guess=guess,
    )


def _vehicle(scenario: Scenario, rng: np.random.Generator) -> tuple[Body, Motor, dict[str, float]]:
    K2, T2, psi = 7935.54, 36.3, 4.04e-6
    motor = Motor(K1=0.444e-3, T1=0.09, area=75e-4, load=7.707e-2)
    mass = K_B * T2 / K2
    if scenario.random:
        mass, T2 = _between(rng, 5.0, 60.0), _between(rng, 8.0, 60.0)
        # Trapped air and soft hulls; one in ten is stiffer than water.
        stiff = rng.random() < 0.1
        psi = mass * (-_between(rng, 1e-9, 4e-9) if stiff else _between(rng, 1e-8, 1.5e-7))
        motor = replace(
            motor, T1=_between(rng, 0.02, 0.15), area=75e-4 * mass / 45.0 * _between(rng, 0.5, 2.0)
        )
    K2 = K_B * T2 / mass
    # Where drag is quadratic: the steady speed of one cm3 too heavy for each kg.
    k_dt = K_B * 1e-6 * mass / _between(rng, 0.05, 0.3) ** 2
    if scenario.drag == "quadratic":
        body = Body(k_b=K_B, mass=mass, k_dt=k_dt, psi=psi)
        return body, motor, {"mass": mass, "drag_quadratic": k_dt, "psi": psi}
    blended = scenario.drag == "blended"
    body = Body.identified(k_b=K_B, K2=K2, T2=T2, psi=psi, k_dt=k_dt if blended else 0.0)
    truth = {"K2": K2, "T2": T2} | ({"drag_quadratic": k_dt} if blended else {})
    return body, motor, truth | {"psi": psi}


def _sensor(scenario: Scenario, rng: np.random.Generator) -> tuple[Noise, float]:
    if scenario.coloured:
        return Noise(sigma=2e-3, memory=rng.uniform(0.3, 0.9)), 0.3
    if scenario.random:
        quantum = 0.0 if rng.random() < 0.25 else rng.uniform(0.0, 5e-3)
        return Noise(sigma=_between(rng, 5e-4, 5e-3), quantum=quantum), rng.uniform(0.1, 0.5)
    wild = {"outliers": scenario.outliers, "outlier_sigma": 0.3} if scenario.outliers else {}
    return Noise(sigma=2e-3, quantum=5e-3, **wild), 0.3


def _volumes(scenario: Scenario, body: Body, rng: np.random.Generator) -> list[float]:
    """Return the changes of volume [m3], up and down in turns."""
    if not scenario.random:
        return [sign * dV for dV in PAPER_STEPS for sign in (1.0, -1.0)]
    count = 2 * int(rng.integers(2, 5))
    sizes = [1e-6 * body.mass * _between(rng, 0.4, 2.5) for _ in range(count)]
    return [size if k % 2 == 0 else -size for k, size in enumerate(sizes)]


def _step(
    dV: float, motor: Motor, rng: np.random.Generator, sample_time: float, rest: float
) -> Step:
    """Return the paper's step: the voltage that asks for dV in whole samples."""
    dx = dV / motor.area
    pulse = max(1, math.ceil(abs(dx) / (motor.K1 * SUPPLY * sample_time) - 1e-9))
    nominal = POOL - CLEARANCE if dV > 0.0 else CLEARANCE
    depth = nominal + 0.01 * float(rng.normal())
    return Step(
        sample_time=sample_time,
        rest=max(1, math.ceil(rest / sample_time - 1e-9)),
        pulse=pulse,
        voltage=dx / (motor.K1 * pulse * sample_time),
        start_depth=depth,
        reference_depth=depth,
        start_speed=SPEED_STD * float(rng.normal()),
        neutral_error=NEUTRAL_STD * float(rng.normal()),
    )


def _performed(
    body: Body, motor: Motor, step: Step, noise: Noise, rng: np.random.Generator
) -> tuple[Experiment, Kept]:
    """Return an experiment up to the end of the travel, or clear of surface and bottom."""
    depth, volume = _to_the_end(body, motor, step)
    seen = noise.draw(rng, depth)
    time = step.sample_time * np.arange(len(depth))
    return (
        Experiment(step=step, depth=depth, volume=volume),
        Kept(time=time, depth=seen, volume=volume),
    )


def _to_the_end(body: Body, motor: Motor, step: Step) -> tuple[Array, Array]:
    samples = round(40.0 / step.sample_time)
    most = round(LONGEST / step.sample_time)
    while True:
        path, moved = follow(body, motor, step, samples)
        depth, volume = path[0], moved[0]
        over = (np.abs(depth - step.start_depth) > TRAVEL) | (np.abs(depth - POOL / 2) > 1.95)
        if over.any() or samples == most:
            end = int(np.argmax(np.append(over, True)))
            return depth[:end], volume[:end]
        samples = min(2 * samples, most)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))
