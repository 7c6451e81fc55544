"""Logs of a hull that cools: SciPy's motion, met with its logged temperature and missed without."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.errors import InputError
from swimbladder.estimation.comparison import compare, record
from swimbladder.estimation.motion import identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log, read_log
from swimbladder.physics.hull import heat_expansion, hull_parts, neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.vehicle import Hull, HullPart
from tests.estimation.motion.pool import FEUP, G

GAIN, COOLS = 4e-6, 300.0  # m3/K; s, in which it comes within 1/e of the water


def vehicle(gain=GAIN):
    own = load_vehicle("feup-em")
    more = {"thermal_expansion": gain / own.hull.displaced_volume}
    return own.model_copy(update={"hull": own.hull.model_copy(update=more)})


def warmth(time):
    """Return the hull's temperature [degC]."""
    return 14.0 + 6.0 * np.exp(-time / COOLS)


def cooled(dV, *, rng, name="cooling"):
    """Return a log by SciPy's DOP853 whose hull loses 4 cm3 in a kelvin as it cools."""
    z0, m, k, psi = (3.75 if dV > 0 else 0.75), *FEUP.values()
    time = np.arange(0.0, 150.0, 0.3)

    def volume(t):
        return np.clip((t - 3.0) * 40e-6 * np.sign(dV), min(dV, 0.0), max(dV, 0.0))

    def rates(t, x):
        neutral = psi * (x[0] - z0) - GAIN * (warmth(t) - warmth(0.0))
        return x[1], G / m * (neutral - volume(t)) - k * x[1] / m

    how = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "max_step": 0.5}
    z = solve_ivp(rates, (0.0, time[-1]), (z0, 0.0), t_eval=time, **how).y[0]
    n = int(np.argmax(np.append(np.abs(z - z0) > 3.0, True)))
    time, z = time[:n], z[:n] + 2e-3 * rng.normal(size=n)
    read = np.where(np.arange(n) % 7 == 3, 0.0, warmth(time))  # 0: no reading
    read[5] = np.nan
    some = {"volume": volume(time), "temperature": read, "line": np.arange(n)}
    return Log(source=f"{name} {1e6 * dV:+.0f}", time=time, depth=z, **some)


@pytest.fixture(scope="module")
def logs():
    rng = np.random.default_rng(5)
    return [cooled(dV, rng=rng) for dV in (20e-6, -30e-6, 45e-6, -75e-6)]


def test_what_a_hull_gains_is_in_the_volume_of_a_record(logs):
    log = logs[0]
    cold, plain = record(log, vehicle()), record(log, vehicle(0.0))
    expected = GAIN * (warmth(log.time) - warmth(0.0))
    np.testing.assert_allclose(cold.volume - plain.volume, expected, atol=2e-9)
    assert "by its thermal expansion, 4 cm3/K, that is 3.4 cm3 of volume" in cold.notes[-1]
    assert not any("thermal" in note for note in plain.notes)
    silent = replace(log, temperature=None)
    np.testing.assert_array_equal(record(silent, vehicle()).volume, plain.volume)
    lost = replace(log, temperature=np.full(len(log), np.nan))
    np.testing.assert_array_equal(record(lost, vehicle()).volume, plain.volume)


@pytest.mark.parametrize("lag", [0.0, 3.0, 100.0, 1e6])
def test_a_hull_follows_the_temperature_by_a_first_order_lag(logs, lag):
    """SciPy's solution, of a temperature that is straight between its samples."""
    log, own = logs[1], vehicle()
    hull = own.hull.model_copy(update={"thermal_time_constant": lag})
    plain = record(log, vehicle(0.0))
    found = record(log, own.model_copy(update={"hull": hull})).volume - plain.volume
    if lag == 0.0:
        expected = GAIN * plain.warmth
    else:
        how = {"t_eval": plain.time, "rtol": 1e-10, "atol": 1e-12, "max_step": 0.3}

        def rate(t, x):
            return (np.interp(t, plain.time, plain.warmth) - x) / lag

        expected = GAIN * solve_ivp(rate, (0.0, plain.time[-1]), [0.0], **how).y[0]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_cooling_hull_is_followed_by_its_temperature(logs):
    fit = ("neutral_volume", "start_depth", "start_speed")
    met, missed = (
        np.array([compare(log, v, drive="volume", free=fit).rms for log in logs])
        for v in (vehicle(), vehicle(0.0))
    )
    assert met.max() < 2.6e-3, "the noise is 2 mm"
    assert np.all(missed > 1.05 * met)
    assert missed.max() > 5e-3


def test_parameters_are_those_of_the_truth_with_it(logs):
    """Without it the cooling is a drift of 4.8 cm3 a minute, which shifts them by far."""
    truth = {"K2": G / FEUP["k_dl"], "T2": FEUP["m"] / FEUP["k_dl"], "psi": FEUP["psi"]}
    how = {"profiles": False, "drift_std": 0.0, "delay_std": 0.0}
    met = identify(logs, vehicle(), **how)
    for name, value in truth.items():
        found = met.parameters[name]
        assert abs(found.value - value) < 4.0 * found.std + 1e-3 * abs(value), name


def test_a_hull_without_parts_expands_as_one_part_does():
    own = vehicle()
    assert heat_expansion(own) == pytest.approx(GAIN, rel=1e-12)
    (part,) = hull_parts(own)
    alone = own.model_copy(
        update={"hull": own.hull.model_copy(update={"thermal_expansion": 0.0, "parts": (part,)})}
    )
    water = uniform_column(own.water, 50.0)
    warm = replace(water, temperature=water.temperature + 5.0)
    for column in (water, warm):
        expected = neutral_volume(alone, column)
        np.testing.assert_allclose(neutral_volume(own, column), expected, atol=1e-15)
    shift = neutral_volume(own, warm) - neutral_volume(own, water)
    np.testing.assert_allclose(shift, -5.0 * GAIN, rtol=1e-9)


def test_parts_have_their_own_expansion():
    part = HullPart(name="tube", volume=0.01, compressibility=1e-10)
    given = {"displaced_volume": 0.01, "psi": 0.0, "waterplane_area": 0.01, "height": 0.5}
    with pytest.raises(InputError, match="the parts have their own"):
        Hull(**given, parts=(part,), thermal_expansion=1e-4)


def test_a_log_has_its_temperature_from_its_file(tmp_path):
    rows = "\n".join(f"{t},{1 + 0.01 * t},0,{20 - t}" for t in range(12))
    (tmp_path / "log.csv").write_text("time_s,depth_m,volume_m3,hull [degC]\n" + rows + "\n")
    log = read_log(tmp_path / "log.csv", columns={"temperature_degC": "hull [degC]"})
    np.testing.assert_array_equal(log.temperature, 20.0 - np.arange(12.0))


@pytest.mark.prove
def test_what_a_hull_gains_is_identified_from_its_temperatures(logs):
    found = identify(logs, vehicle(0.0), process_noise="always", profiles=False)
    left = found.process_noise.heat.gain
    assert abs(heat_expansion(found.result_vehicle) - GAIN) < 3.0 * left.std
    assert left.std < 0.2 * GAIN
    (said,) = (f for f in found.findings if f.kind == "hull expands")
    assert "the hull gains" in said.sentence
    assert abs(left.value) < left.std, "beyond what the vehicle has by then"
    assert found.process_noise.p_value > 0.01, "it is no random walk"

    known = identify(logs, vehicle(), process_noise="always", profiles=False)
    assert abs(known.process_noise.heat.gain.value) < 3.0 * left.std
    silent = [replace(log, temperature=None) for log in logs]
    plain = identify(silent, vehicle(0.0), process_noise="always", profiles=False)
    assert plain.process_noise.heat is None
    assert heat_expansion(plain.result_vehicle) == 0.0
    said = [f.sentence for f in plain.findings if f.kind == "process_noise"]
    assert len(said) == 1
    moves = "moves" if plain.process_noise.p_any > 1e-3 else "does not quite move"
    assert said[0].startswith(f"The vehicle {moves} as the model has it")
    origin = found.result_vehicle.provenance["hull.thermal_time_constant"]
    assert origin.startswith("identified: from the temperatures")


def test_where_the_gain_is_not_determined_the_intervals_allow_for_it(logs):
    """One log: a hull that cools and a drag that is another look alike."""
    alone = {"profiles": False, "choices": False, "fixed": {"psi": FEUP["psi"]}}
    one = identify(logs[1:2], vehicle(0.0), **alone)
    sure = identify(logs[1:2], vehicle(), **alone)
    assert any(f.kind in ("hull may expand", "hull expands") for f in one.findings)
    K2, truth = one.parameters["K2"], G / FEUP["k_dl"]
    assert K2.std > 3.0 * abs(sure.parameters["K2"].value - truth)
    assert abs(K2.value - truth) < 3.0 * K2.std


def test_where_the_hull_explains_it_all_no_process_noise_is_needed(logs):
    found = identify(logs, vehicle(0.0), profiles=False)
    assert found.process_noise is None
    assert heat_expansion(found.result_vehicle) == pytest.approx(GAIN, rel=0.2)
    for name, value in (("K2", G / FEUP["k_dl"]), ("psi", FEUP["psi"])):
        assert abs(found.parameters[name].value - value) < 4.0 * found.parameters[name].std
