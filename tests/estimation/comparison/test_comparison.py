"""A log against the model: logs made by SciPy from other code, and a real float's."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.errors import InputError, LogError, NoAnswerError
from swimbladder.estimation.comparison import compare
from swimbladder.estimation.comparison.misread import doubtful
from swimbladder.estimation.comparison.record import DRIVES, record, thinned
from swimbladder.estimation.comparison.run import FITTABLE, stages
from swimbladder.estimation.estimates import DRIFT_STD
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log, read_log
from swimbladder.sim.closed_loop import drive
from tests.quoted import refused

OTHERS = ((47, 49), (47, 63), (55, 31), (55, 47), (55, 49), (55, 63))
WEIGHT = 1000.0 * 9.80665  # N/m3, of the water of both vehicles
ALL = ("neutral_volume", "mass", "drag", "drag_quadratic", "psi")


@pytest.fixture(scope="module")
def float_vehicle():
    return load_vehicle("ntnu-bv")


@pytest.fixture(scope="module")
def paper_vehicle():
    return load_vehicle("feup-em")


def made_log(time, depth, **columns):
    return Log(
        source="made.csv",
        time=np.asarray(time, float),
        depth=np.asarray(depth, float),
        line=np.arange(2, len(time) + 2),
        **columns,
    )


def acceleration(vehicle, z, w, volume):
    """The vehicle's physics written again: buoyancy, drag, and the hull that emerges."""
    motion = vehicle.motion
    mass = motion.dry_mass + motion.entrained_mass + motion.added_mass
    spare = volume - vehicle.trim_error - vehicle.hull.psi * z
    if z < vehicle.hull.emergence_depth:
        spare -= vehicle.hull.waterplane_area * (vehicle.hull.emergence_depth - z)
    drag = motion.drag.k_dl * w + motion.drag.k_dt * w * abs(w)
    return (-WEIGHT * spare - drag) / mass


def sail(vehicle, time, volume, z, w):
    """Depths at `time` under volumes that are straight between them, by SciPy."""
    depth, state = [z], [z, w]
    for k in range(len(time) - 1):

        def rate(t, y, k=k):
            share = (t - time[k]) / (time[k + 1] - time[k])
            here = volume[k] + share * (volume[k + 1] - volume[k])
            return [y[1], acceleration(vehicle, y[0], y[1], here)]

        run = solve_ivp(
            rate, (time[k], time[k + 1]), state, method="DOP853", rtol=1e-10, atol=1e-12
        )
        state = run.y[:, -1]
        depth.append(state[0])
    return np.array(depth)


@pytest.fixture(scope="module")
def voyage(float_vehicle):
    """A log of 150 s at uneven instants, submerged from 0.8 m, with all terms at work."""
    random = np.random.default_rng(5)
    time = np.cumsum(random.uniform(0.3, 0.7, 300))
    time -= time[0]
    wave = 6e-6 * np.sign(np.sin(2.0 * math.pi * time / 23.0))
    volume = float_vehicle.trim_error + wave + 1e-7 * random.normal(size=300)
    depth = sail(float_vehicle, time, volume, 0.8, 0.01)
    assert depth.min() > 0.2
    return made_log(time + 1000.0, depth, volume=volume, volume_absolute=True)


def test_open_loop_agrees_with_scipy(float_vehicle, voyage):
    names = ("start_depth", "start_speed")
    c = compare(voyage, float_vehicle, free=names)
    assert c.record.drive == "volume"
    assert c.rms < 3e-6  # of the fit's steps in turbulent drag
    assert c.n == 300
    assert c.variance_explained == pytest.approx(1.0, abs=1e-9)
    assert c.fitted["start_depth"].value == pytest.approx(0.8, abs=1e-6)
    assert c.fitted["start_speed"].value == pytest.approx(0.01, abs=1e-6)


def astray(vehicle):
    """The vehicle with every number that can be fitted put wrong."""
    drag = vehicle.motion.drag.model_copy(update={"k_dl": 0.8, "k_dt": 1.5})
    motion = vehicle.motion.model_copy(update={"added_mass": 1.0, "drag": drag})
    hull = vehicle.hull.model_copy(update={"psi": -5e-7})
    return vehicle.model_copy(update={"trim_error": 8e-6, "motion": motion, "hull": hull})


def truth(vehicle):
    return {
        "neutral_volume": vehicle.trim_error,
        "mass": vehicle.mass,
        "drag": vehicle.drag.k_dl,
        "drag_quadratic": vehicle.drag.k_dt,
        "psi": vehicle.hull.psi,
        "start_depth": 0.8,
        "start_speed": 0.01,
    }


def test_a_fit_from_far_off_recovers_what_made_the_log(float_vehicle, voyage):
    names = (*ALL, "start_depth", "start_speed")
    assert set(names) | {"neutral_drift"} == set(FITTABLE)
    c = compare(voyage, astray(float_vehicle), free=names)
    assert c.rms < 1e-5
    for name, value in truth(float_vehicle).items():
        assert c.fitted[name].value == pytest.approx(value, rel=2e-3, abs=1e-9), name
    assert c.vehicle.mass == pytest.approx(float_vehicle.mass, rel=2e-3)
    assert c.vehicle.drag.k_dt == c.fitted["drag_quadratic"].value


@pytest.mark.prove
def test_the_stated_deviation_is_the_one_that_noise_and_drift_cause(float_vehicle, voyage):
    names = ("neutral_volume", "start_depth", "start_speed")
    random = np.random.default_rng(11)
    since = voyage.time - 1000.0

    def drawn():
        volume = voyage.volume - DRIFT_STD * random.normal() * since
        depth = sail(float_vehicle, since, volume, 0.8, 0.01) + 0.005 * random.normal(size=300)
        return compare(replace(voyage, depth=depth), float_vehicle, free=names).fitted

    found = [drawn() for _ in range(30)]
    for name in names:
        values = np.array([f[name].value for f in found])
        stated = np.mean([f[name].std for f in found])
        assert 0.6 < values.std(ddof=1) / stated < 1.5, name
        assert abs(values.mean() - truth(float_vehicle)[name]) < 4.0 * stated / math.sqrt(30)


def test_a_drift_of_the_neutral_volume_is_found(float_vehicle, voyage):
    drift = 2e-9
    depth = sail(
        float_vehicle,
        voyage.time - 1000.0,
        voyage.volume - drift * (voyage.time - 1000.0),
        0.8,
        0.01,
    )
    log = replace(voyage, depth=depth)
    blind = compare(log, float_vehicle)
    assert blind.rms > 0.01
    c = compare(log, float_vehicle, free=("neutral_volume", "neutral_drift", "start_speed"))
    assert c.rms < 1e-4
    assert c.fitted["neutral_drift"].value == pytest.approx(drift, rel=1e-3)
    with refused(InputError, field="free", value="neutral_drift"):
        compare(with_reference(log), float_vehicle, drive="setpoint", free=("neutral_drift",))


def with_reference(log):
    return replace(log, reference_depth=np.full(len(log), 1.0))


def test_the_zero_of_the_volume_does_not_matter_unless_it_is_known(float_vehicle, voyage):
    shifted = replace(voyage, volume=voyage.volume + 2e-5, volume_absolute=False)
    c = compare(shifted, float_vehicle)
    assert c.rms < 3e-6
    assert any("neutral at the first sample" in note for note in c.notes)
    known = compare(replace(shifted, volume_absolute=True), float_vehicle, free=("start_speed",))
    assert known.rms > 0.3
    assert any("beyond the vehicle's stroke" in note for note in known.notes)


def test_a_volume_of_many_strokes_is_in_another_unit(float_vehicle, voyage):
    stroke = float_vehicle.stroke
    share = (stroke.maximum - stroke.minimum) / np.ptp(voyage.volume)
    compare(replace(voyage, volume=4.9 * share * voyage.volume), float_vehicle, free=())
    with refused(LogError, field="volume_m3") as caught:
        compare(replace(voyage, volume=5.1 * share * voyage.volume), float_vehicle)
    assert caught.value.field == "volume_m3"


@pytest.mark.prove
def test_a_piston_moves_the_volume_and_its_direction_is_questioned(float_vehicle, voyage):
    area = math.pi * 0.020**2
    piston = replace(voyage, volume=None, piston=voyage.volume / area, piston_absolute=True)
    right = compare(piston, float_vehicle)
    assert right.rms < 1e-6
    assert right.possible
    assert not right.findings
    wrong = compare(replace(piston, piston=-piston.piston), float_vehicle)
    assert not wrong.possible
    assert "piston_positive" in wrong.findings[0].sentence


def test_the_statistics_are_those_of_their_names(float_vehicle, voyage):
    noisy = replace(voyage, depth=voyage.depth + 0.02 * np.sin(voyage.time))
    c = compare(noisy, float_vehicle, free=("start_depth",))
    table = c.columns()
    off = table["depth_predicted_m"] - noisy.depth
    assert table["residual_m"] == pytest.approx(off, abs=1e-15)
    assert c.rms == pytest.approx(math.sqrt((off**2).mean()), rel=1e-12)
    assert c.bias == pytest.approx(off.mean(), rel=1e-9)
    assert c.variance_explained == pytest.approx(1.0 - off.var() / noisy.depth.var(), rel=1e-12)
    assert c.largest == pytest.approx(np.abs(off).max())
    assert table["time_s"][0] == 0.0
    answer = c.to_dict()
    assert answer["rms_m"] == c.rms
    assert answer["fitted"]["start_depth"]["unit"] == "m"
    assert answer["duration_s"] == pytest.approx(voyage.time[-1] - voyage.time[0])


def test_a_log_that_starts_and_ends_at_the_surface(float_vehicle):
    """It floats with volume to spare, sinks, rises and floats: only the middle is compared."""
    time = np.arange(0.0, 90.0, 0.5)
    neutral = float_vehicle.trim_error
    volume = neutral + np.interp(
        time, [0, 10, 14, 40, 50, 90], [9e-6, 9e-6, -5e-6, -5e-6, 9e-6, 9e-6]
    )
    floating = -9e-6 / float_vehicle.hull.waterplane_area
    depth = sail(float_vehicle, time, volume, floating, 0.0)
    assert depth.max() > 1.0
    log = made_log(time, depth, volume=volume, volume_absolute=True)
    c = compare(log, float_vehicle, free=())
    assert c.record.afloat
    assert c.rms < 1e-5
    assert np.abs(c.residual).max() < 1e-4  # simulated where it is not compared
    assert c.n == (depth >= 0.1).sum() < len(time)
    assert any("emerges" in note for note in c.notes)
    with refused(InputError, field="free", value="start_speed"):
        compare(log, float_vehicle, free=("start_speed",))


def test_the_bottom_is_simulated_and_not_compared(float_vehicle):
    time = np.arange(0.0, 120.0, 0.5)
    volume = float_vehicle.trim_error + np.where(time < 70.0, -4e-6, 4e-6)
    depth = np.minimum(sail(float_vehicle, time, volume, 0.5, 0.0), 1.4)
    leave = int(np.searchsorted(time, 70.0))
    depth[int(np.argmax(depth >= 1.4)) : leave] = 1.4
    neutral = float_vehicle.neutral_volume(1.4)
    off = np.interp(neutral, volume[leave - 1 : leave + 1], time[leave - 1 : leave + 1])
    depth[leave:] = sail(
        float_vehicle, np.append(off, time[leave:]), np.append(neutral, volume[leave:]), 1.4, 0.0
    )[1:]
    log = made_log(time, depth, volume=volume, volume_absolute=True)
    assert compare(log, float_vehicle).rms > 0.1
    c = compare(log, float_vehicle, free=("start_depth", "start_speed"), bottom_depth=1.4)
    assert c.n < len(time) - 50
    assert c.rms < 1e-4
    assert any("at the bottom" in note for note in c.notes)


def test_voltage_drives_the_papers_vehicle(paper_vehicle):
    """q' = (K1 A (u - k_z z) - q)/T1, V' = q, and eq. (29): written again with its numbers."""
    time = np.arange(0.0, 60.0, 0.3)
    voltage = np.where(time < 6.0, -4.0, np.where(time < 15.0, 2.7, 0.0)) + 0.2 * np.sin(time)
    m = WEIGHT * 36.3 / 7935.54

    def rate(_, y, u):
        z, w, V, q = y
        spare = V - 4.04e-6 * z
        force = -WEIGHT * spare - WEIGHT / 7935.54 * w
        load = 0.07707 * z
        return [w, force / m, q, (0.444e-3 * 75e-4 * (u - load) - q) / 0.09]

    state, depth = [2.0, 0.0, 4.04e-6 * 2.0, 0.0], [2.0]
    for k in range(len(time) - 1):
        run = solve_ivp(
            rate,
            (time[k], time[k + 1]),
            state,
            args=(voltage[k],),
            method="Radau",
            rtol=1e-10,
            atol=1e-13,
        )
        state = run.y[:, -1]
        depth.append(state[0])
    log = made_log(time, depth, voltage=voltage)
    c = compare(log, paper_vehicle, free=("start_speed",))
    assert c.record.drive == "voltage"
    assert c.rms < 2e-4
    assert set(c.columns()) >= {"voltage_V", "volume_predicted_m3"}
    astray = paper_vehicle.model_copy(
        update={"motion": paper_vehicle.motion.model_copy(update={"K2": 6000.0, "T2": 50.0})}
    )
    found = compare(log, astray, free=("mass", "drag", "start_speed"))
    assert found.rms < 1e-3
    motion = found.vehicle.motion
    found = [motion.K2, motion.T2]
    assert found == pytest.approx([7935.54, 36.3], rel=0.02)


def test_the_set_point_drives_the_vehicles_own_controller(float_vehicle):
    """The firmware's arithmetic and a piston of constant speed, written again around SciPy."""
    tick, area, zero = 0.48828125, math.pi * 0.020**2, 0.02575
    count = 320
    z, w, x, integral, smooth = 0.8, 0.0, zero - float_vehicle.trim_error / area, None, None
    times, depths, pistons = [], [], []
    for k in range(count):
        target = 1.3 if k * tick < 80.0 else 0.6
        error = target - z
        if integral is None:
            integral, smooth = x, z
        before, smooth = smooth, 0.4 * z + 0.6 * smooth
        if abs(error) < 1.0:
            integral = min(max(integral + 0.001 * tick * error, 0.0), 0.055)
        goal = 0.026 * error + integral - 0.1 * (smooth - before) / tick
        goal = min(max(goal, 0.0), 0.0515)
        begin, speed = x, math.copysign(2.44e-3, goal - x)
        arrive = min(abs(goal - x) / 2.44e-3, tick)

        def rate(t, y, begin=begin, speed=speed, arrive=arrive):
            volume = area * (zero - begin - speed * min(t, arrive))
            return [y[1], acceleration(float_vehicle, y[0], y[1], volume)]

        at = 0.31 if k % 2 else 0.1  # logged between the samples
        states = [z, w]
        for a, b in ((0.0, at), (at, tick)):
            parts = sorted({a, min(max(arrive, a), b), b})
            for one, two in pairwise(parts):
                run = solve_ivp(rate, (one, two), states, method="DOP853", rtol=1e-10, atol=1e-12)
                states = run.y[:, -1]
            if b == at:
                times.append(k * tick + at)
                depths.append(states[0])
                pistons.append(zero - begin - speed * min(at, arrive))
        z, w = states
        x = goal if arrive < tick else begin + speed * tick
    times = [0.0, *times]
    reference = np.where(np.array(times) < 80.0, 1.3, 0.6)
    change = int(np.argmax(reference == 0.6))
    times[change] = tick * math.ceil(80.0 / tick) - 0.02  # the sample that sees it is the same
    log = made_log(
        times,
        [0.8, *depths],
        piston=np.array([zero - (zero - float_vehicle.trim_error / area), *pistons]),
        piston_absolute=True,
        reference_depth=reference,
    )
    off = compare(log, float_vehicle, drive="setpoint", free=("start_depth", "start_speed"))
    keep = np.delete(np.arange(len(times)), change)
    assert np.abs(off.residual[keep]).max() < 1e-4
    assert off.volume_rms < 2e-7  # it is straight between samples, and the piston is not
    assert off.to_dict()["piston_rms_m"] == pytest.approx(off.volume_rms / area)
    assert compare(log, float_vehicle).record.drive == "volume"


def test_growing_windows_end_with_the_whole_record(float_vehicle, voyage):
    rec = record(voyage, float_vehicle)
    for windows in stages(rec):
        assert windows[0].first == 0
        assert windows[-1].last == len(rec.time) - 1
        for one, two in pairwise(windows):
            assert two.first == one.last
    assert len(stages(rec)[-1]) == 1
    assert len(stages(rec)[0]) == 15


def test_samples_without_input_are_left_out_but_for_short_holes(float_vehicle, voyage):
    volume = voyage.volume.copy()
    volume[[7, 100]] = np.nan
    volume[200:206] = np.nan
    c = compare(replace(voyage, volume=volume), float_vehicle)
    assert len(c.predicted) == 294
    assert any("2 samples without volume: taken from those beside" in note for note in c.notes)
    assert any("6 samples without volume left out" in note for note in c.notes)


@pytest.mark.parametrize(
    ("change", "options", "match"),
    [
        ({"volume": None}, {}, "nothing that drives"),
        ({}, {"drive": "voltage"}, "not driven by a voltage"),
        ({}, {"drive": "setpoint"}, "no setpoint"),
        ({"volume": None, "voltage": "ones"}, {"drive": "volume"}, "no volume"),
        ({}, {"drive": "thrust"}, "no such input"),
        ({}, {"free": ("weight",)}, "cannot be fitted"),
        ({}, {"free": ("mass", "mass")}, "twice"),
        ({}, {"surface_margin": 50.0}, "too few"),
        ({}, {"bottom_depth": 0.1}, "deeper than the bottom"),
    ],
)
def test_what_does_not_go_together_is_refused(float_vehicle, voyage, change, options, match):
    change = {k: np.ones(300) if v == "ones" else v for k, v in change.items()}
    with pytest.raises(InputError, match=match) as caught:
        compare(replace(voyage, **change), float_vehicle, **options)
    assert caught.value.remedy


def test_a_start_under_water_leaves_out_how_the_vehicle_got_there(float_vehicle):
    """The depths at the surface are no motion of the model's, those under water are SciPy's."""
    time = np.arange(0.0, 120.0, 0.5)
    volume = 8e-6 * np.sin(time / 9.0) - 1e-6
    z = sail(float_vehicle, time, volume, 0.9, 0.01)
    top = np.arange(0.0, 30.0, 0.5)
    surfaced = made_log(
        np.concatenate([top, 30.0 + time]),
        np.concatenate([0.03 * np.sin(top), z]),
        volume=np.concatenate([np.full(len(top), 20e-6), volume]),
        volume_absolute=True,
    )
    surfaced.depth[20] = 0.6  # a spike is no submergence
    whole = compare(surfaced, float_vehicle)
    assert whole.rms > 0.05
    found = compare(surfaced, float_vehicle, submerged=True)
    assert found.rms < 1e-4
    assert found.n == len(time)
    assert found.fitted["start_depth"].value == pytest.approx(0.9, abs=1e-3)
    assert any("begun 30 s after" in note for note in found.notes)
    never = replace(surfaced, depth=np.full(len(surfaced), 0.02))
    with refused(LogError, field="depth_m", value=0.02):
        compare(never, float_vehicle, submerged=True)


def test_a_vehicle_and_a_log_that_do_not_fit(float_vehicle, paper_vehicle, voyage):
    with refused(InputError, field="free", value="drag_quadratic"):
        compare(voyage, paper_vehicle, free=("drag_quadratic",))
    bare = float_vehicle.model_copy(update={"controller": None})
    with refused(InputError, field="controller"):
        compare(with_reference(voyage), bare, drive="setpoint")
    pump = load_vehicle("example-eh")
    piston = replace(voyage, volume=None, piston=voyage.volume)
    with refused(LogError, field="volume_m3, piston_m, voltage_V or reference_depth_m"):
        compare(piston, pump)
    with refused(InputError, field="actuator.kind", value="electrohydraulic"):
        compare(piston, pump, drive="volume")
    short = {k: v[:9] for k, v in vars(voyage).items() if isinstance(v, np.ndarray)}
    with refused(LogError, field="volume"):
        compare(replace(voyage, **short), float_vehicle)


def test_a_model_that_leaves_the_water_says_so(float_vehicle, voyage):
    light = replace(voyage, volume=voyage.volume + 3e-3)
    with pytest.raises(NoAnswerError, match="left the water"):
        compare(light, float_vehicle, free=())


def test_names_of_drives():
    assert DRIVES == ("volume", "voltage", "setpoint")


def mission(data_dir, number):
    path = data_dir / "ntnu_bv" / "missions.csv.gz"
    return read_log(path, log_format="ntnu-bv", where={"log": number})


@pytest.mark.data
def test_mission_47_open_loop_with_one_neutral_volume(data_dir, float_vehicle):
    c = compare(mission(data_dir, 47), float_vehicle)
    assert list(c.fitted) == ["neutral_volume"]
    assert c.record.drive == "volume"
    assert c.rms < 0.022
    assert abs(c.bias) < 0.003
    assert c.variance_explained > 0.997
    assert c.record.duration > 358.0
    assert c.n == 676
    assert any("mission 47" in note for note in c.notes)


@pytest.mark.data
def test_mission_47_closed_loop_with_nothing_fitted(data_dir, float_vehicle):
    c = compare(mission(data_dir, 47), float_vehicle, drive="setpoint", free=())
    assert c.rms < 0.021
    assert c.to_dict()["piston_rms_m"] < 0.0011
    assert c.predicted.max() == pytest.approx(1.39, abs=0.05)


@pytest.mark.slow
@pytest.mark.data
def test_the_preset_is_what_mission_47_says(data_dir, float_vehicle):
    """The numbers said to be fitted come out of the fit, from a start that is far off."""
    c = compare(mission(data_dir, 47), astray(float_vehicle), free=ALL)
    assert c.rms < 0.0205
    for name in ALL:
        stated = truth(float_vehicle)[name]
        assert c.fitted[name].value == pytest.approx(stated, rel=0.01), name
        assert c.fitted[name].std > 0.0
        assert name == "psi" or c.fitted[name].std < abs(stated)  # beside a drift psi is not known


@pytest.mark.data
@pytest.mark.parametrize(
    ("number", "closed", "drifting"), [(43, 0.035, 0.022), (51, 0.045, 0.04), (65, 0.02, 0.018)]
)
def test_other_missions_with_the_numbers_of_47(data_dir, float_vehicle, number, closed, drifting):
    """Same gains, other days: only the neutral volume is this log's own, and its drift."""
    log = mission(data_dir, number)
    assert compare(log, float_vehicle, drive="setpoint").rms < closed
    names = ("neutral_volume", "neutral_drift")
    assert compare(log, float_vehicle, free=names).rms < drifting


@pytest.fixture(scope="module")
def as_it_is(float_vehicle, voyage):
    return compare(voyage, float_vehicle)


@pytest.mark.parametrize(
    ("of_depth", "of_volume", "said"),
    [
        (3.28084, 1.0, "a depth in feet was read as metres"),
        pytest.param(0.3048, 1.0, "a depth in metres was read as feet", marks=pytest.mark.prove),
        (1.0, -1.0, "the volume counts the wrong way round"),
        pytest.param(6.894757, 1.0, "a pressure in kPa was read as psi", marks=pytest.mark.prove),
        (1.0, 0.2, "a unit is wrong, or it is another vehicle"),
        (1.0, 0.1, "depth or volume is off by 10"),
    ],
)
def test_what_was_read_wrong_is_named(float_vehicle, voyage, of_depth, of_volume, said):
    """As it was meant it is the vehicle's; depths in feet explained half of it, as a warning."""
    middle = float_vehicle.trim_error
    volume = middle + of_volume * (voyage.volume - middle)
    wrong = replace(voyage, depth=of_depth * voyage.depth, volume=volume)
    answer = compare(wrong, float_vehicle)
    assert said in answer.findings[0].sentence
    assert not answer.possible or "or it is another" in said


@pytest.fixture(scope="module")
def by_voltage(paper_vehicle):
    """Two steps of the paper's vehicle, by a sensor of 5 mm; its file is right."""
    import swimbladder

    points = [(0.0, 3.0), (60.0, 1.8)]
    run = swimbladder.simulate(paper_vehicle, setpoints=points, duration=150.0, start_depth=1.5)
    return made_log(run.time, 5e-3 * np.rint(run.depth / 5e-3), voltage=run.voltage)


SIGN = "the voltage has the wrong sign"
NOTHING = "The logged voltage says nothing of the depth"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda log: replace(log, voltage=-log.voltage), SIGN),
        (lambda log: replace(log, depth=5.0 - log.depth), SIGN),
        (lambda log: replace(log, voltage=0.0 * log.voltage), "The voltage never changes"),
        (lambda log: replace(log, depth=3.28084 * log.depth), "a depth in feet was read as metres"),
        (lambda log: replace(log, voltage=np.sort(log.voltage)), NOTHING),
    ],
)
def test_a_voltage_that_cannot_have_moved_it_is_no_answer(paper_vehicle, by_voltage, spoil, said):
    """Most of these explain over half of how the depth varies, by the start alone."""
    answer = compare(spoil(by_voltage), paper_vehicle)
    assert not answer.possible
    assert said in answer.findings[0].sentence


def test_a_voltage_as_it_was_is_an_answer(paper_vehicle, by_voltage):
    answer = compare(by_voltage, paper_vehicle)
    assert answer.possible
    assert not answer.findings


def test_a_voltage_that_no_supply_gives_is_refused(paper_vehicle, by_voltage):
    with refused(LogError, field="voltage_V"):
        compare(replace(by_voltage, voltage=10.0 * by_voltage.voltage), paper_vehicle)


def test_depths_in_the_air_are_refused(float_vehicle, voyage):
    turned = replace(voyage, depth=5.0 * (np.sort(voyage.depth)[40] - voyage.depth))
    assert (turned.depth > 0.1).sum() > 10
    with refused(LogError, field="depth_m") as caught:
        compare(turned, float_vehicle)
    assert caught.value.what == "most depths are above the water"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda log: replace(log, depth=3.0 - log.depth), "the volume counts the wrong way round"),
        (lambda log: replace(log, volume=np.roll(log.volume, 100)), "says nothing of the depth"),
    ],
)
def test_a_volume_that_cannot_have_moved_it_is_no_answer(float_vehicle, voyage, spoil, said):
    answer = compare(spoil(voyage), float_vehicle)
    assert not answer.possible
    assert said in answer.findings[0].sentence


def shifted(log, by):
    """The log whose volumes and voltages are stamped later by so much [s]."""
    known = {"piston": log.piston, "volume": log.volume, "voltage": log.voltage}
    late = {k: np.interp(log.time - by, log.time, v) for k, v in known.items() if v is not None}
    return replace(log, **late)


def said_late(answer):
    """By how much the drive is said to be late, or early, in seconds."""
    words = re.search(r"are ([0-9.]+) s (late|early)", answer.findings[0].sentence)
    return float(words[1]) * (1.0 if words[2] == "late" else -1.0)


@pytest.mark.parametrize("by", [-9.0, -4.0, 4.0, 9.0])
def test_a_drive_whose_times_are_off_is_named_with_how_much(float_vehicle, voyage, by):
    answer = compare(shifted(voyage, by), float_vehicle)
    assert not answer.possible
    assert said_late(answer) == pytest.approx(by, abs=0.3)


def test_a_voltage_whose_times_are_off_is_named_with_how_much(paper_vehicle, by_voltage):
    answer = compare(shifted(by_voltage, 12.0), paper_vehicle)
    assert not answer.possible
    assert said_late(answer) == pytest.approx(12.0, abs=1.0)


@pytest.mark.data
@pytest.mark.parametrize("number", [47, pytest.param(63, marks=pytest.mark.prove)])
@pytest.mark.parametrize("by", [-20.0, 10.0, pytest.param(20.0, marks=pytest.mark.prove)])
def test_a_tank_log_whose_volumes_are_late_is_named(data_dir, float_vehicle, number, by):
    """They explained up to half of the depths, with a warning."""
    answer = compare(shifted(mission(data_dir, number), by), float_vehicle)
    assert not answer.possible
    assert said_late(answer) == pytest.approx(by, abs=1.0)


@pytest.mark.data
@pytest.mark.parametrize(
    ("number", "other"),
    [(47, 65), (55, 13), *(pytest.param(*pair, marks=pytest.mark.prove) for pair in OTHERS)],
)
def test_a_tank_log_with_the_volumes_of_another_is_no_answer(
    data_dir, float_vehicle, number, other
):
    """All begin with a dive: these explained 57 to 88 % of the depths, and nothing was said."""
    log, piston = mission(data_dir, number), mission(data_dir, other).piston
    answer = compare(replace(log, piston=np.resize(piston, len(log))), float_vehicle)
    assert answer.variance_explained > 0.5
    assert "says nothing of the depth" in answer.findings[0].sentence
    assert not answer.possible


@pytest.mark.data
def test_a_fjord_log_in_feet_is_no_answer_and_in_metres_one(data_dir, float_vehicle):
    """It explained 72 % of the depths: a regression over all of them did not see it."""
    log = mission(data_dir, 55)
    answer = compare(replace(log, depth=3.28084 * log.depth), float_vehicle)
    assert answer.variance_explained > 0.5
    assert re.search(r"The depths go [456]\.?\d* times as far", answer.findings[0].sentence)
    assert not answer.possible
    assert compare(log, float_vehicle).possible


@pytest.mark.data
@pytest.mark.prove
def test_the_drive_of_each_tank_log_is_its_own(data_dir, float_vehicle):
    for number in (13, 35, 45, 47, 49, 51, 53, 55, 57, 59, 61, 63, 65):
        rec = record(mission(data_dir, number), float_vehicle)
        assert not [f for f in doubtful(rec, float_vehicle, "volume")], number


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_voltage_of_which_much_is_missing_is_refused(paper_vehicle, by_voltage, share):
    """What it was meanwhile decides where the vehicle is: the model was off by 0.28 m."""
    known = np.random.default_rng(1).random(len(by_voltage)) > share
    with refused(LogError, field="voltage_V"):
        compare(
            replace(by_voltage, voltage=np.where(known, by_voltage.voltage, np.nan)), paper_vehicle
        )
    steady = np.where(known, np.where(by_voltage.time < 75.0, 1.0, -1.0), np.nan)
    assert len(record(replace(by_voltage, voltage=steady), paper_vehicle).time) < len(by_voltage)


@pytest.mark.data
@pytest.mark.prove
@pytest.mark.parametrize("number", [13, 51])
def test_a_tank_log_whose_depths_are_heights_is_no_answer(data_dir, float_vehicle, number):
    """A volume that lifts where it has to sink explains 78 and 94 % of the depths."""
    log = mission(data_dir, number)
    turned = replace(log, depth=log.depth.max() + log.depth.min() - log.depth)
    answer = compare(turned, float_vehicle)
    assert answer.variance_explained > 0.7
    assert not answer.possible


@pytest.mark.data
@pytest.mark.parametrize("number", [51, pytest.param(35, marks=pytest.mark.prove)])
def test_a_tank_log_in_reverse_order_is_named(data_dir, float_vehicle, number):
    """Its volumes explain most of the depths both ways: with little drag time has no direction."""
    log = mission(data_dir, number)
    turned = replace(log, depth=log.depth[::-1], piston=log.piston[::-1])
    answer = compare(turned, float_vehicle)
    assert "the rows are in reverse order" in answer.findings[0].sentence
    assert not answer.possible


def test_a_log_in_reverse_order_is_named(float_vehicle, voyage, as_it_is):
    wrong = replace(voyage, depth=voyage.depth[::-1], volume=voyage.volume[::-1])
    answer = compare(wrong, float_vehicle)
    assert "the rows are in reverse order" in answer.findings[0].sentence
    assert not answer.possible
    assert as_it_is.possible


def test_a_volume_that_never_changes_is_no_wrong_unit(float_vehicle):
    time = np.arange(0.0, 100.0, 0.5)
    depth = 3.0 + 0.3 * np.sin(time / 10.0)
    still = made_log(time, depth, volume=np.full(len(time), 1e-6))
    answer = compare(still, float_vehicle)
    assert [f.kind for f in answer.findings] == ["still"]
    assert not answer.possible


def test_a_voltage_that_is_always_zero_says_so_and_no_more(paper_vehicle):
    """Backwards the depths come together, which a fall that drives itself would explain."""
    import swimbladder

    run = swimbladder.simulate(
        paper_vehicle, setpoints=[(0.0, 3.0)], duration=120.0, start_depth=1.5
    )
    log = made_log(run.time, run.depth, voltage=np.zeros(len(run.time)))
    answer = compare(log, paper_vehicle)
    assert [f.kind for f in answer.findings] == ["still"]
    assert not answer.possible


def test_a_residual_that_is_no_noise_gives_no_deviation_of_parts_per_million(paper_vehicle):
    """Five minutes of an unstable vehicle whose file has a tenth too little drag."""
    import swimbladder

    run = swimbladder.simulate(
        paper_vehicle, setpoints=[(0.0, 3.0)], duration=300.0, start_depth=1.5
    )
    log = made_log(run.time, run.depth, volume=run.volume, volume_absolute=True)
    motion = paper_vehicle.motion.model_copy(update={"K2": 1.1 * paper_vehicle.motion.K2})
    other = paper_vehicle.model_copy(update={"motion": motion})
    fitted = compare(log, other)
    assert fitted.rms > 2e-3  # and no noise at all in what neighbours differ by
    assert fitted.fitted["neutral_volume"].std is None
    assert compare(log, paper_vehicle).fitted["neutral_volume"].std is not None


def test_intervals_allow_for_a_drift_that_is_not_fitted(float_vehicle):
    """A tenth of a cm3 a minute, as `identify` assumes: the neutral volume at the start is held."""
    time = np.arange(0.0, 150.0, 0.5)
    for drift in (-1.7e-9, 0.0, 1.7e-9):
        steps = np.where(time // 25 % 2 == 0, -1.5e-6, 1.5e-6) * np.where(time < 25.0, 0.5, 1.0)
        volume = float_vehicle.neutral_volume(3.0) + steps
        moved = drive(float_vehicle, time=time, volume=volume - drift * time, start_depth=3.0)
        log = made_log(time, moved.depth, volume=volume, volume_absolute=True)
        fitted = compare(log, float_vehicle).fitted
        for name, true in (("neutral_volume", float_vehicle.trim_error), ("start_speed", 0.0)):
            assert abs(fitted[name].value - true) < 2.0 * fitted[name].std


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda log: replace(log, depth=np.roll(log.depth, 60)), "at the end of what a vehicle"),
        (lambda log: replace(log, depth=1.0 + 0.02 * (log.depth - 1.0)), "The mass"),
    ],
)
def test_what_no_hull_can_have_is_no_answer(float_vehicle, voyage, spoil, said):
    names = ("neutral_volume", "mass", "drag")
    found = compare(spoil(voyage), float_vehicle, free=names)
    assert not found.possible
    assert any(said in f.sentence for f in found.findings)
    assert compare(voyage, float_vehicle, free=names).possible


def test_a_fit_that_is_worse_than_a_depth_that_stays_is_no_answer(float_vehicle):
    """Depths that are not the volume's; and a vehicle that hangs still, but for its sensor."""
    time, rng = np.arange(0.0, 150.0, 0.5), np.random.default_rng(1)
    neutral = float_vehicle.neutral_volume(3.0)
    steps = np.where(time // 25 % 2 == 0, -1.5e-6, 1.5e-6)
    for depth, volume, possible in (
        (3.0 + 0.03 * np.sin(time / 5.0), neutral + steps, False),
        (3.0 + 0.3 * rng.normal(size=len(time)), neutral + 2.0 * steps, False),  # shuffled
        (3.0 + 5e-3 * rng.normal(size=len(time)), np.full(len(time), neutral), True),
    ):
        found = compare(made_log(time, depth, volume=volume, volume_absolute=True), float_vehicle)
        assert found.variance_explained < 0.5
        assert any(f.kind == "unexplained" for f in found.findings)
        assert found.possible == possible


def test_an_interval_that_holds_everything_is_none(paper_vehicle):
    """A coarse log made of the mass 200 +- 910 kg, with exit code 0."""
    time = np.arange(0.0, 240.0, 10.0)
    volume = 20e-6 * np.sign(np.sin(2.0 * np.pi * time / 60.0 + 0.01))
    depth = 2.0 + 0.1 * np.rint(0.4 * np.sin(time / 20.0) / 0.1)
    log = made_log(time, depth, volume=volume)
    c = compare(log, paper_vehicle, free=["mass"])
    assert not c.possible
    assert c.fitted["mass"].std is None
    assert "mass is not identifiable" in c.findings[0].sentence


def test_an_impossible_psi_is_no_answer(paper_vehicle):
    hull = paper_vehicle.hull.model_copy(update={"psi": -1e-4})
    vehicle = paper_vehicle.model_copy(update={"hull": hull})
    time = np.arange(0.0, 120.0, 0.5)
    volume = 1e-4 * np.sin(time / 10.0) - 2e-4
    run = drive(vehicle, time=time, volume=volume, start_depth=2.0)
    c = compare(made_log(time, run.depth, volume=volume), paper_vehicle, free=["psi"])
    assert not c.possible
    assert any(f.kind == "stratified" for f in c.findings)


def test_a_depth_that_stays_though_the_volume_moves_is_not_explained(paper_vehicle):
    time = np.arange(0.0, 100.0, 0.5)
    volume = 5e-5 * np.sin(time / 10.0)
    c = compare(made_log(time, np.full(len(time), 3.0), volume=volume), paper_vehicle)
    assert not c.possible
    assert [f.kind for f in c.findings] == ["unexplained"]


def test_a_long_log_is_thinned_with_a_word(paper_vehicle):
    time = np.append(np.arange(0.0, 100.0, 0.1), np.arange(150.0, 200.0, 0.1))
    volume = 1e-5 * np.sin(time / 10.0)
    whole = record(made_log(time, 3.0 + 0.1 * np.cos(time), volume=volume), paper_vehicle)
    thin = thinned(whole, 200)
    assert 140 < len(thin.time) <= 200
    assert thin.notes[-1].startswith("1500 samples taken as the means of ")
    assert (np.diff(thin.time) > 0.0).all()
    assert np.diff(thin.time).max() == pytest.approx(50.0, abs=2.0)
    assert np.interp(thin.time, whole.time, whole.volume) == pytest.approx(thin.volume, abs=2e-6)
    assert thinned(whole, 1500) is whole
