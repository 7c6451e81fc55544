"""A pump out of logged runs: exact without noise, and 95 % that are 95 %, by simulation."""

from dataclasses import replace

import numpy as np
import pytest

from swimbladder.design.energy import PumpRuns, fit_pump, fitted_vehicle
from swimbladder.errors import InputError, NoAnswerError
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


def with_volumes(told, volume):
    return PumpRuns(
        duration=told.duration,
        pressure=told.pressure,
        power=told.power,
        volume=volume,
        dive=told.dive,
    )


def test_what_is_not_distinguishable_from_none_is_none():
    """A pump that gives more under pressure and at its start is fitted as one that does neither."""
    told = runs(np.random.default_rng(6), 8, noise=0.0)
    t, p = told.duration, told.pressure
    volume = 1e-6 * t * (1.0 + 1e-10 * p) + 1e-7
    fit = fit_pump(with_volumes(told, volume))
    assert "slip" not in fit.parameters
    assert "start_volume" not in fit.parameters
    assert fit.value("delivery") == pytest.approx(np.sum(volume * t) / np.sum(t * t), rel=1e-12)
    pump = PowerLawPump(delivery=1e-6, idle_power=1.0, power_per_pressure=0.0)
    actuator = PumpAndValve(pump=pump, valve=Valve(flow=1e-8))
    vehicle = load_vehicle("example-float").model_copy(update={"actuator": actuator})
    found = fitted_vehicle(vehicle, fit).actuator
    assert found.pump.slip == 0.0
    assert found.start_volume == 0.0


def commanded(random, *, volume=146e-6, spread=0.003, dives=6):
    """Runs that all press out 146 mL, as gliders do: what differs is how long that takes."""
    n = 4 * dives
    dive, p = np.repeat(np.arange(dives, dtype=float), 4), np.tile([4e5, 2e6, 6e6, 9.5e6], dives)
    V = volume * (1.0 + spread * random.normal(0.0, 1.0, n))
    rate = (1.4e-6 - 4e-14 * p) * (1.0 + 0.01 * random.normal(0.0, 1.0, n))
    power = (7.0 + 1.8e-6 * p) * (1.0 + 0.01 * random.normal(0.0, 1.0, n))
    return PumpRuns(duration=V / rate, pressure=p, power=power, volume=V, dive=dive)


def test_runs_that_were_commanded_by_volume_tell_the_delivery():
    """Where all runs press out the same, their times tell the rate; the volumes on them do not."""
    random, held = np.random.default_rng(8), {"delivery": 0, "slip": 0}
    for _ in range(200):
        fit = fit_pump(commanded(random))
        assert fit.by_volume
        assert "start_volume" not in fit.parameters  # one volume tells nothing of it
        assert fit.value("delivery") == pytest.approx(1.4e-6, rel=0.03)
        for name, true in (("delivery", 1.4e-6), ("slip", 4e-14)):
            low, high = fit.parameters[name].ci95
            held[name] += low <= true <= high
    assert min(held.values()) >= 184, held  # 92 % of 200
    assert not fit_pump(runs(random, 8)).by_volume


def test_volumes_of_many_sizes_tell_what_a_start_loses():
    random = np.random.default_rng(9)
    sizes = np.tile([30e-6, 31e-6, 60e-6, 150e-6], 6)
    told = commanded(random, volume=sizes, spread=0.0)
    late = told.duration + 5e-6 / 1.4e-6  # 5 mL short at the start, at any pressure
    fit = fit_pump(with_volumes(told, told.volume))
    more = fit_pump(
        PumpRuns(
            duration=late, pressure=told.pressure, power=told.power, volume=sizes, dive=told.dive
        )
    )
    assert fit.value("start_volume") == pytest.approx(0.0, abs=1e-6)
    assert more.value("start_volume") == pytest.approx(5e-6, abs=1e-6)


def test_two_pumps_are_no_pump():
    """Dives that one power law does not describe to 10 % are refused, and no vehicle has them."""
    told = runs(np.random.default_rng(7), 8, noise=0.0)
    assert not fit_pump(told).refusal
    both = np.where(told.dive < 4, 1.0, 1.6) * told.power
    fit = fit_pump(PumpRuns(duration=told.duration, pressure=told.pressure, power=both))
    assert not fit.refusal  # without dives nobody can tell
    mixed = PumpRuns(
        duration=told.duration,
        pressure=told.pressure,
        power=both,
        volume=told.volume,
        dive=told.dive,
    )
    fit = fit_pump(mixed)
    wrong = [d for d in fit.dives if abs(d.predicted / d.energy - 1.0) > 0.1]
    assert f"{len(wrong)} of 8 dives" in fit.refusal
    with refused(NoAnswerError):
        fitted_vehicle(load_vehicle("example-float"), fit)


def test_runs_of_a_valve_among_those_of_the_pump_are_left_out():
    """A glider lets in at the surface, with hardly any power, what it pumped below."""
    told = commanded(np.random.default_rng(10))
    clean = fit_pump(told).to_dict()
    valve = {"duration": 90.0, "pressure": 0.0, "power": 0.05, "volume": -580e-6}
    columns = {name: np.append(getattr(told, name), 6 * [x]) for name, x in valve.items()}
    every = PumpRuns(**columns, dive=np.append(told.dive, np.arange(6.0)))
    mixed = fit_pump(every).to_dict()
    assert mixed.pop("excluded") == clean.pop("excluded") + 6
    assert mixed == clean
    with refused(InputError, field="volume_m3"):
        fit_pump(replace(told, volume=-told.volume))


@pytest.mark.parametrize("spoil", ["half of the volumes in L", "volumes at random"])
def test_volumes_that_are_not_the_runs_own_are_no_delivery(spoil):
    told, random = runs(np.random.default_rng(11), 8, noise=0.2), np.random.default_rng(12)
    half = np.where(told.dive < 4, 1e-3, 1.0) * told.volume
    wrong = replace(told, volume=half if "half" in spoil else random.permutation(told.volume))
    assert not fit_pump(told).refusal
    said = fit_pump(wrong).refusal
    assert "volume" in said
    assert "two pumps" in said


@pytest.mark.parametrize("spoil", ["pressure", "power", "one deep run", "idle", "volume"])
def test_columns_that_contradict_each_other_are_no_pump(spoil):
    """Without dives, too, which show it elsewhere: all of these came with a vehicle once."""
    random = np.random.default_rng(13)
    told = replace(commanded(random, dives=20), dive=None)
    n = told.power.size
    wrong = {
        "pressure": {"pressure": random.permutation(told.pressure)},
        "power": {"power": np.full(n, 12.0) + random.normal(0.0, 0.1, n)},
        "one deep run": {"pressure": np.append(1e5 + 1e3 * np.arange(n - 1), 8e6)},
        "idle": {"power": 2.4e-6 * told.pressure - 0.9},
        "volume": {"duration": random.uniform(20.0, 200.0, n)},
    }[spoil]
    assert not fit_pump(told).refusal
    said = fit_pump(replace(told, **wrong)).refusal
    assert {"idle": "idle power", "volume": "volumes"}.get(spoil, "power rises") in said


@pytest.mark.parametrize(
    ("name", "times"), [("pressure", 0.1), ("power", 10.0), ("duration", 10.0)]
)
def test_a_pump_that_wastes_nearly_all_is_in_another_unit(name, times):
    """Of what more pressure takes 17 % would reach the water: that came with a vehicle file."""
    told = runs(np.random.default_rng(16), 20)
    assert not fit_pump(told).refusal
    said = fit_pump(replace(told, **{name: times * getattr(told, name)})).refusal
    assert "17 % at most would reach the water" in said
    assert "up to 5.8 times" in said


def test_a_power_that_is_always_the_same_is_no_measurement():
    """Its slope came out as 0 to 22 digits, known as well."""
    told = replace(runs(np.random.default_rng(17), 20), volume=None)
    assert not fit_pump(told).refusal
    assert "power rises" in fit_pump(replace(told, power=np.full(told.power.size, 7.2))).refusal


def test_pressures_too_alike_to_separate_the_idle_power_are_said_to_be():
    random = np.random.default_rng(15)
    pressure, duration = random.uniform(7e6, 8e6, 40), random.uniform(20.0, 120.0, 40)
    given = {"duration": duration, "volume": 1e-6 * duration}
    power = 2.0 + 3e-6 * pressure + random.normal(0.0, 0.5, 40)
    said = fit_pump(PumpRuns(pressure=pressure, power=power, **given)).refusal
    assert "idle power" in said
    assert "MPa do not separate it from what grows with the pressure. Log runs at other" in said
    deeper = random.uniform(1e6, 8e6, 40)
    spread = 2.0 + 3e-6 * deeper + random.normal(0.0, 0.5, 40)
    assert not fit_pump(PumpRuns(pressure=deeper, power=spread, **given)).refusal


def test_runs_that_are_there_twice_count_once():
    """Copies under other dives made an interval narrower, and eight of one dive one of nothing."""
    told = commanded(np.random.default_rng(14))
    names = ("duration", "pressure", "power", "volume")
    twice = {name: np.tile(getattr(told, name), 2) for name in names}
    copies = PumpRuns(**twice, dive=np.append(told.dive, told.dive + 50.0))
    assert fit_pump(copies).parameters == fit_pump(told).parameters
    one = {name: np.tile(getattr(told, name)[:4], 6) for name in names}
    with refused(NoAnswerError, holds={1.0}):
        fit_pump(PumpRuns(**one, dive=told.dive))


def test_a_zero_among_powers_or_volumes_was_not_measured():
    """One in ten made 5.0 +- 0.1 W of an idle power of 7 W."""
    made = commanded(np.random.default_rng(3))
    whole = fit_pump(made)
    for name in ("power", "volume"):
        values = getattr(made, name).copy()
        values[::10] = 0.0
        spoilt = fit_pump(replace(made, **{name: values}))
        for number, e in whole.parameters.items():
            assert abs(spoilt.value(number) - e.value) < e.ci95[1] - e.value, number


def test_runs_that_do_next_to_no_work_are_in_another_unit():
    made = commanded(np.random.default_rng(3))
    for changed in ({"power": 1e3 * made.power}, {"volume": 1e-3 * made.volume}):
        with refused(InputError, field="pressure_Pa"):
            fit_pump(replace(made, **changed))
