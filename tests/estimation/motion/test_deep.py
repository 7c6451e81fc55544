"""Deep dives: the replay against SciPy, parameters found again, and how sure they are."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binom

from studies.deep_calibration import outcome, summary
from swimbladder.errors import InputError
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep import contradictions, identified_vehicle, identify_deep
from swimbladder.estimation.motion.deep_fit import balance, fit_deep, start_volume
from swimbladder.estimation.motion.deep_model import (
    DEFAULT,
    body_of,
    deep_dive,
    hull_volume,
    priors_of,
    replay,
    run_volumes,
)
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle
from swimbladder.io.float_logs import read_float_log
from swimbladder.physics.hull import neutral_volume, weight_mass
from swimbladder.physics.seawater import Cast, cast_column
from swimbladder.vehicle import Oil, Valve
from tests.estimation.motion.deep import dived, made_up_column, made_up_log, made_up_vehicle
from tests.quoted import numbers

TRUTH = {
    "drag": 165.0,
    "drag_up": 0.8,
    "compressibility": 3.1e-10,
    "stiffening": 3e-18,
    "thermal_expansion": 0.8e-4,
    "trapped_air": 0.0,
    "pump_delivery": 0.7,
    "pump_slip": 0.0,
    "pump_start": 0.5e-6,
    "valve": 0.9,
    "valve_laminar": 300.0,
    "bypass": 1.0,
    "creep": 5e-11,
    "inertia": 1.0,
}
RUNS = [
    ("valve", 4000.0, 2.0),
    ("valve", 9000.0, 1.5),
    ("valve", 15000.0, 1.2),
    ("pump", 24000.0, 30.0),
    ("pump", 27000.0, 15.0),
    ("valve", 29000.0, 0.6),
    ("pump", 33000.0, 60.0),
    ("pump", 33100.0, 60.0),
    ("pump", 33200.0, 60.0),
    ("pump", 38000.0, 50.0),
    ("valve", 41000.0, 2.0),
    ("pump", 44000.0, 50.0),
]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    vehicle = made_up_vehicle(tmp_path_factory.mktemp("deep"))
    return vehicle, body_of(vehicle), made_up_column()


def begin_of(body, values, column, speed: float) -> float:
    """Return the drive's volume with which it sinks at a speed at 100 dbar [m3]."""
    p, rho = 1e6, float(np.interp(1e6, column.pressure, column.density))
    warm = float(np.interp(1e6, column.pressure, column.temperature))
    drag = values["drag"] * speed * speed / (rho * column.gravity)
    return body.mass / rho - float(hull_volume(body, values, p, warm)) - drag


def test_a_replay_is_that_of_scipy(scene) -> None:
    """m w' = rho g E - k w|w| with the same volumes, hull and water, by Radau at 1e-9."""
    vehicle, body, column = scene
    values = TRUTH | {"thermal_expansion": 0.0, "trapped_air": 2e-5}
    start = begin_of(body, values, column, 0.05)
    runs = [("pump", 6000.0, 100.0), ("pump", 12000.0, 100.0), ("pump", 20000.0, 100.0)]
    short = with_drive(vehicle, start_volume=2e-6)
    dive = deep_dive(made_up_log(runs, 8.0), column, short)
    fine = replay(body, values, start, dive, pressure=5e5, begin=0.0, step=2.0)
    g = column.gravity

    def motion(t: float, y: np.ndarray) -> list[float]:
        p, w = y
        rho = float(np.interp(p, dive.water.pressure, dive.water.density))
        volume = start - values["creep"] * t
        for begun, nominal in zip(dive.actions.time, dive.actions.volume, strict=True):
            share = min(max((t - begun) / 100.0, 0.0), 1.0)
            volume += share * (values["pump_delivery"] * nominal - 2e-6 - values["pump_start"])
        solid = 1.0 - values["compressibility"] * p + 0.5 * values["stiffening"] * p * p
        hull = body.volume * solid + values["trapped_air"] * 101325.0 / (101325.0 + p)
        heavy = body.mass / rho - hull - volume
        k = values["drag"] * (1.0 if w >= 0.0 else values["drag_up"])
        return [rho * g * w, (rho * g * heavy - k * w * abs(w)) / body.inertia]

    def shallow(_: float, y: np.ndarray) -> float:
        return float(y[0] - 3e5)

    shallow.terminal = True  # type: ignore[attr-defined]
    exact = solve_ivp(
        motion,
        (0.0, fine.time[-1]),
        [5e5, fine.speed[0]],
        method="Radau",
        rtol=1e-9,
        atol=[1e-3, 1e-9],
        max_step=200.0,
        dense_output=True,
        events=shallow,
    )
    times = np.linspace(0.0, exact.t[-1], 60)
    assert exact.y[1].min() < -0.02
    assert exact.y[1].max() > 0.04
    assert np.max(np.abs(fine.at(times) - exact.sol(times)[0])) < 2e4
    coarse = replay(body, values, start, dive, pressure=5e5, begin=0.0)
    assert np.max(np.abs(coarse.at(times) - exact.sol(times)[0])) < 2e5


def test_arrivals(scene) -> None:
    vehicle, body, column = scene
    dive = deep_dive(made_up_log([("pump", 100.0, 1.0)], 8.0), column, vehicle)
    start = begin_of(body, TRUTH, column, 0.05)
    way = replay(body, TRUTH, start, dive, pressure=5e5, begin=0.0)
    reached = way.arrival(2e6)
    assert float(way.at(np.array([reached]))[0]) == pytest.approx(2e6, abs=1.0)
    assert math.isnan(way.arrival(1e9))
    assert math.isnan(way.arrival(2e6, after=reached + 100.0))


def test_the_truth_closes_the_book(scene) -> None:
    vehicle, body, column = scene
    start = begin_of(body, TRUTH, column, 0.05)
    rng = np.random.default_rng(1)
    _, dive = dived(vehicle, body, column, TRUTH, rng, runs=RUNS, hours=12.0, start=start, wave=0.0)
    imbalance = balance(body, TRUTH, start, dive)
    assert np.median(np.abs(imbalance)) < 0.1e-6
    assert start_volume(body, TRUTH, dive) == pytest.approx(start, abs=0.2e-6)
    assert start_volume(body, TRUTH, dive, until=5400.0) == pytest.approx(start, abs=0.5e-6)


@pytest.mark.prove
def test_intervals_hold_as_often_as_they_say() -> None:
    """Dives of the whole mission model, in waves, with a cast that errs: 95 % intervals.

    `studies.deep_calibration` is the same with 300 dives.
    """
    *rows, whole = summary([outcome(index, seed=2) for index in range(_DIVES)])
    assert {row.name for row in rows} == set(DEFAULT)
    held = np.array([row.held for row in rows])
    assert whole.held == pytest.approx(np.mean(held))
    # Binomial, of parameters that go together: fewer of all in one of a thousand such tests.
    assert np.mean(held) > 0.86
    assert held.min() >= binom.ppf(1e-3 / len(rows), _DIVES, 0.95) / _DIVES
    narrowed = {row.name: row.narrowed for row in rows}
    assert max(narrowed[name] for name in ("drag", "pump_delivery", "valve", "drag_up")) < 0.6


def test_what_is_told_and_what_is_not(scene) -> None:
    """Without a rise, the drag while rising is what it was thought to be before."""
    vehicle, body, column = scene
    rng = np.random.default_rng(3)
    down = [run for run in RUNS if run[1] < 20000.0]
    log, dive = dived(
        vehicle,
        body,
        column,
        TRUTH,
        rng,
        runs=down,
        hours=6.0,
        start=begin_of(body, TRUTH, column, 0.05),
    )
    fit = fit_deep(body, [dive], priors_of(vehicle, {}), free=DEFAULT)
    assert not fit.identified("drag_up")
    assert fit.std("drag_up") == pytest.approx(0.3, rel=0.05)
    assert fit.identified("compressibility")
    found = identify_deep([log], [column], vehicle, free=["drag_up", "compressibility"])
    assert not found.identified
    assert "drag_up" in found.sentences[0]
    assert "compressibility" not in found.sentences[0]
    assert found.result_vehicle is vehicle
    assert found.parameters["drag_up"].origin == "prior"
    assert not any("narrower" in said for said in found.sentences)
    seen = (log.time < 5000.0) | (log.time > 8600.0)
    seldom = replace(
        log,
        time=log.time[seen],
        pressure=log.pressure[seen],
        temperature=log.temperature[seen],
        stage=log.stage[seen],
    )
    gone = identify_deep([seldom], [column], vehicle, free=["drag_up", "compressibility"])
    assert 1.0 in numbers(gone.sentences[-1])  # one gap
    assert 1.0 not in numbers(found.sentences[-1])
    assert contradictions(fit) == []
    shifted = {**fit.priors, "compressibility": Prior(1.2 * TRUTH["compressibility"], 3e-12)}
    far = contradictions(replace(fit, priors=shifted))
    assert [said.split()[0] for said in far] == ["compressibility"]


def test_an_identified_vehicle(scene) -> None:
    vehicle, body, column = scene
    rng = np.random.default_rng(5)
    log, _ = dived(
        vehicle,
        body,
        column,
        TRUTH,
        rng,
        runs=RUNS,
        hours=12.0,
        start=begin_of(body, TRUTH, column, 0.05),
    )
    found = identify_deep([log], [column], vehicle, fixed={"drag": 165.0, "pump_start": 5e-7})
    assert found.identified
    told = {name: e.value for name, e in found.parameters.items()}
    for name in ("pump_delivery", "valve", "compressibility"):
        assert abs(told[name] - TRUTH[name]) < 3.0 * found.parameters[name].std
        assert found.parameters[name].std < 0.25 * told[name]
    assert found.parameters["drag"].origin == "set"
    after = found.result_vehicle
    assert after.drag.k_dt == 165.0
    assert after.actuator.pump.delivery == pytest.approx(0.8e-6 * told["pump_delivery"])
    assert after.actuator.valve.flow == pytest.approx(vehicle.actuator.valve.flow * told["valve"])
    assert after.actuator.start_volume == 5e-7
    assert after.hull.parts[0].compressibility == told["compressibility"]


def with_drive(vehicle, **changes):
    return vehicle.model_copy(update={"actuator": vehicle.actuator.model_copy(update=changes)})


def two_dives(vehicle, column, values, runs=RUNS):
    """Return logs and dives of two descents, hardly moved by waves."""
    body, rng = body_of(vehicle), np.random.default_rng(3)
    found = [
        dived(
            vehicle,
            body,
            column,
            values,
            rng,
            runs=runs,
            hours=12.0,
            wave=0.2,
            start=begin_of(body, values, column, speed),
        )
        for speed in (0.045, 0.055)
    ]
    return [log for log, _ in found], [dive for _, dive in found]


@pytest.mark.prove
def test_dives_that_contradict_each_other_widen_the_intervals(scene) -> None:
    """Two dives with a valve that lets in 0.9, and two with 1.0 of its file's."""
    vehicle, _, column = scene
    logs, _ = two_dives(vehicle, column, TRUTH)
    others, _ = two_dives(vehicle, column, TRUTH | {"valve": 1.0})
    held = ("drag", "stiffening", "inertia", "pump_start", "pump_slip", "valve_laminar")
    held = {name: TRUTH[name] for name in held}
    alike = [replace(log, pressure=log.pressure + 1.0) for log in logs]  # Pa
    agreed = identify_deep([*logs, *alike], [column], vehicle, fixed=held)
    assert agreed.fit.tempering > 0.5
    told = identify_deep([*logs, *others], [column], vehicle, fixed=held)
    assert told.fit.tempering < 0.4
    apart = float(f"{told.fit.tempering**-0.5:.2g}")  # how far, over what each says by itself
    assert any(apart in numbers(said) for said in told.sentences)
    assert told.to_dict()["tempering"] == told.fit.tempering
    valve, before = told.parameters["valve"], agreed.parameters["valve"]
    assert valve.std > 1.1 * before.std
    assert abs(valve.value - 0.95) < 0.03


_DIVES = 12
SHORT = 4.5e-6  # m3
AS_FILED = {
    "pump_delivery": 1.0,
    "valve": 1.0,
    "valve_laminar": 0.0,
    "bypass": 1.0,
    "pump_start": 0.0,
    "pump_slip": 0.0,
}


@pytest.mark.prove
def test_what_starts_fall_short_by_counts_once(scene) -> None:
    """A vehicle just as its file: each start 4.5 mL short, and the file that comes out says so."""
    plain, _, column = scene
    vehicle = with_drive(plain, start_volume=SHORT)
    truth = TRUTH | AS_FILED
    logs, dives = two_dives(vehicle, column, truth)
    for dive in dives:
        pumps = dive.actions.pumps
        assert dive.actions.volume[pumps] == pytest.approx(0.8e-6 * dive.actions.seconds[pumps])
        assert dive.actions.short == pytest.approx(np.where(pumps, SHORT, 0.0))
    # The same dive of a file that does not know, told that it is what starts fall short by beyond.
    twin = deep_dive(logs[0], column, plain)
    body, start = body_of(vehicle), 1e-5
    assert balance(body, truth, start, dives[0]) == pytest.approx(
        balance(body, truth | {"pump_start": SHORT}, start, twin), abs=1e-12
    )
    _, still = dived(
        vehicle,
        body,
        column,
        truth,
        np.random.default_rng(1),
        runs=RUNS,
        hours=12.0,
        start=begin_of(body, truth, column, 0.05),
        wave=0.0,
    )
    imbalance = balance(body, truth, begin_of(body, truth, column, 0.05), still)
    assert np.median(np.abs(imbalance)) < 0.1e-6
    found = identify_deep(logs, [column], vehicle)
    correction = found.parameters["pump_start"]
    assert correction.origin == "data"
    assert correction.std < 0.8e-6
    assert abs(found.result_vehicle.actuator.start_volume - SHORT) < 3.0 * correction.std
    fixed = identify_deep(logs, [column], vehicle, fixed={"pump_start": 0.0})
    assert fixed.result_vehicle.actuator.start_volume == SHORT
    # With the pump as its file has it, counting it twice does not fit.
    free = ("compressibility", "drag_up")
    held = {name: value for name, value in truth.items() if name not in free}
    imbalances = []
    for start in (0.0, SHORT):
        fit = fit_deep(
            body, dives, priors_of(vehicle, {}), free=free, fixed=held | {"pump_start": start}
        )
        imbalances.append(
            [
                np.std(balance(body, fit.values, float(begun), dive))
                for begun, dive in zip(fit.starts, dives, strict=True)
            ]
        )
    assert min(imbalances[1]) > 2.0 * max(imbalances[0])


def test_a_short_run_gives_nothing_and_the_line_counts(scene) -> None:
    plain, _, column = scene
    runs = [("pump", 100.0, 2.0), ("pump", 900.0, 60.0)]
    dive = deep_dive(made_up_log(runs, 2.0), column, with_drive(plain, start_volume=SHORT))
    values = TRUTH | AS_FILED
    given = run_volumes(values, dive)
    assert given == pytest.approx([0.0, 0.8e-6 * 60.0 - SHORT])  # 2 s are 1.6 mL
    # and a start that falls short by less than the file says lets it give some
    assert run_volumes(values | {"pump_start": -SHORT}, dive)[0] == pytest.approx(1.6e-6)
    oil = Oil(volume=2e-5)
    lined = deep_dive(made_up_log(runs, 2.0), column, with_drive(plain, line=oil))
    assert lined.actions.short[1] > 0.0


@pytest.mark.prove
def test_the_bypass_has_a_share_of_its_own(scene) -> None:
    """Every other run is the bypass's, with 0.7 of its flow, while the valve has 1.2."""
    plain, _, column = scene
    vehicle = with_drive(plain, bypass=Valve(flow=1.5 * plain.actuator.valve.flow, power=6.0))
    swapped = iter(("valve", "bypass") * len(RUNS))
    runs = [
        (next(swapped), begun, seconds) if device == "valve" else (device, begun, seconds)
        for device, begun, seconds in RUNS
    ]
    truth = TRUTH | {"valve": 1.2, "bypass": 0.7, "drag": 160.0}
    logs, dives = two_dives(vehicle, column, truth, runs)
    assert sum(dive.actions.bypass.sum() for dive in dives) == 4
    found = identify_deep(logs, [column], vehicle, fixed={"drag": 160.0})
    for name in ("valve", "bypass"):
        told = found.parameters[name]
        assert told.origin == "data"
        assert abs(told.value - truth[name]) < 3.0 * told.std
        assert told.std < 0.1
        before, after = (getattr(v.actuator, name) for v in (vehicle, found.result_vehicle))
        assert after.flow == pytest.approx(before.flow * told.value, rel=1e-12)
    assert not any("the flow of the bypass" in said for said in found.assumptions)
    with pytest.raises(InputError, match="the vehicle has none"):
        identify_deep(logs, [column], plain)


@pytest.mark.prove
def test_a_bypass_that_never_runs_stays_as_it_is(scene) -> None:
    plain, _, column = scene
    vehicle = with_drive(plain, bypass=Valve(flow=1e-7, power=6.0))
    logs, _ = two_dives(vehicle, column, TRUTH)
    found = identify_deep(logs, [column], vehicle)
    assert "bypass" not in found.parameters
    assert found.result_vehicle.actuator.bypass == vehicle.actuator.bypass
    assert any("flow of the bypass is as in the vehicle's file" in x for x in found.assumptions)


@pytest.mark.prove
def test_the_written_vehicle_rests_where_the_fit_does(scene) -> None:
    """Neutral volumes of `hull`, for all commands, and of the fit, with air and warmth changed."""
    plain, _, column = scene
    hull = plain.hull.model_copy(update={"reference_temperature": 5.0})
    vehicle = plain.model_copy(update={"hull": hull, "trim_error": 2e-5})
    body = body_of(vehicle)
    _, dives = two_dives(vehicle, column, TRUTH)
    held = {"trapped_air": 3e-5, "thermal_expansion": 0.2e-4, "stiffening": 0.0, "drag": 165.0}
    fit = fit_deep(body, dives, priors_of(vehicle, {}), free=DEFAULT, fixed=held)
    after = identified_vehicle(vehicle, fit.values)
    assert weight_mass(after) == pytest.approx(body.mass, rel=1e-12)
    # Trapped air grows with its warmth in the hull, and not in the fit: the hull as it was filled.
    p, T = column.pressure, np.full(len(column.pressure), 5.0)
    told = body.mass / column.density - hull_volume(body, fit.values, p, T)
    written = neutral_volume(after, replace(column, temperature=T))
    assert written == pytest.approx(told, abs=1e-9)
    # 30 mL of air warmed by 10 K, and 33 L by 10 K less than the file before took them to grow.
    moved = 3e-5 * 10.0 / 278.15 + 0.033 * (0.2e-4 - 1e-4) * 10.0 + 3e-5
    assert after.trim_error == pytest.approx(2e-5 - moved, abs=1e-9)


def test_what_cannot_be_identified(scene) -> None:
    vehicle, _, column = scene
    log = made_up_log([("pump", 100.0, 1.0)], 8.0)
    with pytest.raises(InputError, match="for a pump and a valve"):
        identify_deep([log], [column], load_vehicle("feup-em"))
    with pytest.raises(InputError, match="2 casts for 1 dives"):
        identify_deep([log], [column, column], vehicle)
    with pytest.raises(InputError, match="no such parameter of deep dives"):
        identify_deep([log], [column], vehicle, free=["drug"])
    with pytest.raises(InputError, match="nothing is left"):
        identify_deep([log], [column], vehicle, free=["drag"], fixed={"drag": 1.0})
    with pytest.raises(InputError, match="no runs of pump or valve"):
        identify_deep([made_up_log([], 8.0)], [column], vehicle)
    with pytest.raises(InputError, match="would count twice"):
        identify_deep([log, log], [column], vehicle)
    shallow = replace(log, pressure=np.full(len(log), 1e4))
    with pytest.raises(InputError, match="no dive"):
        identify_deep([shallow], [column], vehicle)
    rows = Cast(
        pressure=np.array([0.0, 2100.0]), SA=np.array([33.0, 35.0]), CT=np.array([15.0, 3.0])
    )
    with pytest.raises(InputError, match="has two rows"):
        identify_deep([log], [cast_column(rows)], vehicle)
    deep = replace(log, pressure=np.full(len(log), 5e7))
    with pytest.raises(InputError, match="the cast ends at"):
        identify_deep([deep], [column], vehicle)


@pytest.mark.prove
@pytest.mark.data
def test_the_book_of_real_dives_closes(data_dir) -> None:
    """Six dives to 500, 1000, 1500 and 2000 dbar, one set of parameters: 2 % of what is pumped."""
    from studies.deep_data import dives_of
    from studies.deep_dives import float_vehicle

    vehicle = float_vehicle()
    body = body_of(vehicle)
    dives = dives_of(data_dir / "mermaid_p0051", vehicle)
    assert len(dives) == 6
    fit = fit_deep(body, dives, priors_of(vehicle, {}), free=DEFAULT)
    imbalances = np.concatenate(
        [balance(body, fit.values, float(s), d) for s, d in zip(fit.starts, dives, strict=True)]
    )
    deepest = max(dives, key=lambda dive: float(dive.pressure.max()))
    moved = run_volumes(fit.values, deepest)
    assert np.sqrt(np.mean(imbalances**2)) < 0.022 * np.sum(moved[moved > 0.0])
    assert np.sqrt(np.mean(np.concatenate(fit.residuals) ** 2)) < 4e-3
    assert fit.identified("pump_delivery")


@pytest.mark.prove
@pytest.mark.data
def test_a_real_dive_predicted_from_the_others(data_dir) -> None:
    """46 hours to 1500 dbar and back in one go: arrivals twice as good as at constant speed."""
    from studies.deep_data import dives_of
    from studies.deep_dives import constant_speeds, float_vehicle, predict

    vehicle = float_vehicle()
    body, dives = body_of(vehicle), dives_of(data_dir / "mermaid_p0051", vehicle)
    others = [*dives[:4], dives[5]]
    fit = fit_deep(body, others, priors_of(vehicle, {}), free=DEFAULT)
    p = predict(body, fit, dives[4], constant_speeds(others))
    late, constant = p.arrival_told - p.arrival, p.arrival_constant - p.arrival
    assert len(late) >= 10
    assert np.sqrt(np.mean(late**2)) < 0.3 * np.sqrt(np.mean(constant**2))
    # 0.84 to 0.96 of it: processors round otherwise, and the search ends in one of several optima
    # of the same likelihood
    off = np.sqrt(np.mean((p.action_told - p.action) ** 2))
    assert off < np.sqrt(np.mean((p.action_constant - p.action) ** 2))


@pytest.mark.prove
def test_an_argo_float_is_the_same_from_a_start_far_off(data_dir) -> None:
    """Five days to 4000 dbar and back, with a file whose valve lets in as much as it does or twice.

    The fit by which the search began once ended in a pump that delivers nothing.
    """
    vehicle = load_vehicle("deep-arvor")
    table = data_dir / "argo_arvor" / "deep_4000_actions.csv.gz"
    log = read_float_log(table, where={"cycle": "7"})
    cast = read_cast(
        table.with_name("deep_4000_ctd.csv.gz"),
        where={"phase": "ascent", "cycle": "7"},
        inversions="average",
    )
    found = []
    for times in (1.0, 2.0):
        valve = vehicle.engine.valve.model_copy(update={"flow": times * vehicle.engine.valve.flow})
        one = with_drive(vehicle, valve=valve)
        fit = identify_deep([log], [cast_column(cast)], one, priors={"valve": Prior(1.0, 1.0)})
        assert fit.identified
        assert fit.dives[0].misfit.most < 1.5
        replayed = fit.dives[0].replay.at(fit.dives[0].dive.time)
        assert np.sqrt(np.mean((replayed - fit.dives[0].dive.pressure) ** 2)) < 40e4
        found.append(fit.fit.values | {"valve": times * fit.fit.values["valve"]})
    for name in ("valve", "compressibility", "drag"):
        assert found[1][name] == pytest.approx(found[0][name], rel=0.15), name
