"""A pump out of logged runs: exact without noise, and 95 % that are 95 %, by simulation."""

import numpy as np
import pytest

from swimbladder.design.energy import PumpRuns, fit_pump, fitted_vehicle
from swimbladder.errors import NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import PowerLawPump, PumpAndValve, Valve
from tests.quoted import refused

TRUTH = {
    "idle_power": 7.0,
    "power_per_pressure": 7.5e-7,
    "power_per_temperature": -0.12,
    "lost_energy": 15.0,
    "delivery": 1.2e-6,
    "slip": 1.5e-14,
    "start_volume": 4e-6,
}


def runs(random, dives, *, noise=1.0, each=12):
    """Runs as floats log them: more shallow than deep ones, errors that dives share."""
    n = dives * each
    dive = np.repeat(np.arange(dives, dtype=float), each)
    deepest = random.choice([2e6, 5e6, 1e7, 2e7], dives)
    p = deepest[dive.astype(int)] * random.beta(0.6, 1.0, n)
    t = random.uniform(4.0, 120.0, n)
    T = 13.0 + 9.0 * np.exp(-p / 1e6) * random.uniform(0.2, 1.0, dives)[dive.astype(int)]
    own = random.normal(0.0, noise, (2, dives))[:, dive.astype(int)]
    power = (
        TRUTH["idle_power"]
        + TRUTH["power_per_pressure"] * p
        + TRUTH["power_per_temperature"] * (T - 15.0)
        - TRUTH["lost_energy"] / t
        + 0.15 * own[0]
        + noise * random.normal(0.0, 0.2 + 0.05 * p / 1e6, n)
    )
    volume = (
        (TRUTH["delivery"] * (1.0 + 0.01 * own[1]) - TRUTH["slip"] * p) * t
        - TRUTH["start_volume"]
        + noise * random.normal(0.0, 1e-6, n)
    )
    return PumpRuns(duration=t, pressure=p, power=power, volume=volume, temperature=T, dive=dive)


def test_without_noise_the_numbers_are_found():
    fit = fit_pump(runs(np.random.default_rng(1), 8, noise=0.0))
    assert set(fit.parameters) == set(TRUTH)
    for name, true in TRUTH.items():
        assert fit.value(name) == pytest.approx(true, rel=1e-9)
    assert fit.power_rms < 1e-9
    for d in fit.dives:
        assert d.predicted == pytest.approx(d.energy, rel=1e-9)
        assert d.predicted_volume == pytest.approx(d.volume, rel=1e-9)


@pytest.mark.parametrize("dives", [4, 8, 25])
def test_95_per_cent_hold_the_truth_in_95_per_cent(dives):
    """200 campaigns each: dives share errors, deep runs are noisier, few dives go deep.

    Where few dives are deep the degrees of freedom are few, and the intervals on the safe side.
    """
    random = np.random.default_rng(dives)
    held = dict.fromkeys(TRUTH, 0)
    made = 0
    while made < 200:
        fit = fit_pump(runs(random, dives))
        if set(fit.parameters) != set(TRUTH):
            continue
        made += 1
        for name, true in TRUTH.items():
            low, high = fit.parameters[name].ci95
            held[name] += low <= true <= high
    share = {name: count / made for name, count in held.items()}
    assert min(share.values()) > 0.92, share
    assert np.mean(list(share.values())) < 0.985, share


def test_powers_read_at_the_end_of_runs_have_no_start_in_them():
    told = runs(np.random.default_rng(2), 10, noise=0.0)
    steady = told.power + TRUTH["lost_energy"] / told.duration
    end = PumpRuns(
        duration=told.duration, pressure=told.pressure, power=steady, temperature=told.temperature
    )
    fit = fit_pump(end, power_at="end")
    assert "lost_energy" not in fit.parameters
    assert fit.value("idle_power") == pytest.approx(TRUTH["idle_power"], rel=1e-9)
    assert "delivery" not in fit.parameters
    assert fit.dives == ()


def test_what_the_runs_cannot_tell_is_not_asked_of_them():
    """Runs of one length tell no start, one temperature no warmth."""
    told = runs(np.random.default_rng(3), 10, noise=0.0)
    same = PumpRuns(
        duration=np.full(told.power.size, 60.0),
        pressure=told.pressure,
        power=told.power,
        temperature=np.full(told.power.size, 14.0),
    )
    assert set(fit_pump(same).parameters) == {"idle_power", "power_per_pressure"}


def test_runs_that_tell_nothing_are_refused():
    told = runs(np.random.default_rng(4), 6)
    few = told.dive < 2
    two = PumpRuns(
        duration=told.duration[few],
        pressure=told.pressure[few],
        power=told.power[few],
        dive=told.dive[few],
    )
    with refused(NoAnswerError, holds={2.0}):
        fit_pump(two)
    with pytest.raises(NoAnswerError, match="at several depths"):
        fit_pump(
            PumpRuns(
                duration=told.duration, pressure=np.full(told.power.size, 5e5), power=told.power
            )
        )
    one_deep = np.where(told.dive == 0, told.pressure, 0.0)
    with refused(NoAnswerError, holds={0.0}):
        fit_pump(
            PumpRuns(duration=told.duration, pressure=one_deep, power=told.power, dive=told.dive)
        )


def test_the_vehicle_has_the_pump_that_the_runs_tell():
    """Power and delivery of the map at the logged pressures, the reservoir's gas reckoned with."""
    from swimbladder.physics.buoyancy_engine import drive_map

    fit = fit_pump(runs(np.random.default_rng(5), 8, noise=0.0))
    float_ = load_vehicle("example-float")
    supply = float_.supply.model_copy(update={"internal_resistance": 0.0})
    vehicle = fitted_vehicle(float_.model_copy(update={"supply": supply}), fit)
    p = np.array([1e5, 1e7])
    found = drive_map(vehicle, p, temperature=20.0)
    expected = 7.0 + 7.5e-7 * p - 0.12 * 5.0
    assert found.power_out == pytest.approx(expected, rel=1e-9)
    assert found.rate_out == pytest.approx(1.2e-6 - 1.5e-14 * p, rel=1e-9)
    assert found.start_volume == pytest.approx(4e-6, rel=1e-9)


def test_what_is_not_distinguishable_from_none_is_none():
    told = runs(np.random.default_rng(6), 8, noise=0.0)
    leaky = PumpRuns(
        duration=told.duration,
        pressure=told.pressure,
        power=told.power,
        volume=1e-6 * told.duration * (1.0 + 1e-10 * told.pressure) + 1e-7,
        dive=told.dive,
    )
    fit = fit_pump(leaky)
    assert fit.value("slip") < 0.0
    pump = PowerLawPump(delivery=1e-6, idle_power=1.0, power_per_pressure=0.0)
    actuator = PumpAndValve(pump=pump, valve=Valve(flow=1e-8))
    vehicle = load_vehicle("example-float").model_copy(update={"actuator": actuator})
    found = fitted_vehicle(vehicle, fit).actuator
    assert found.pump.slip == 0.0
    assert found.start_volume == 0.0
