"""Cycles on one battery: few cycles against batteries flown to their end, and the next float."""

import json
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.jobs import Workers, run
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.result import Campaign, prediction_interval
from swimbladder.sim.campaign.run import Floats
from swimbladder.sim.campaign.store import ROW
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.vehicle.spread import Spread
from tests.sim.mission.conftest import stratified

DAY, YEAR = 86400.0, 365.25 * 86400.0
SHALLOW = [
    {"kind": "descend", "depth": 60.0, "tolerance": 5.0},
    {"kind": "park", "depth": 60.0, "tolerance": 20.0, "duration": 1.0 * DAY},
    {"kind": "surface", "duration": 900.0},
]
PROFILE = [
    {"kind": "descend", "depth": 200.0, "tolerance": 5.0},
    {"kind": "park", "depth": 200.0, "tolerance": 30.0, "duration": 10.0 * DAY},
    {"kind": "profile", "depth": 20.0, "tolerance": 5.0},
    {"kind": "surface", "duration": 900.0},
]
TO_THE_END = 1000  # cycles, which no battery here lasts


@pytest.fixture(scope="module")
def column():
    return stratified(800.0)


@pytest.fixture
def fleet(tmp_path, column):
    """Fly floats for some cycles; return their table."""

    def flown(floats, cycles, seed, *, phases=PROFILE, columns=(column,), **given):
        supply = {name: given.pop(name) for name in [*given] if name in SUPPLY}
        file = load_vehicle("example-float")
        if "start_temperature" in given:
            hull = file.hull.model_copy(update={"thermal_time_constant": 3600.0})
            file = file.model_copy(update={"hull": hull})
        supply = file.supply.model_copy(update=SUPPLY | supply)
        reserve, spread = given.pop("reserve", 0.1), given.pop("spread", Spread())
        job = Floats(
            vehicle=file.model_copy(update={"supply": supply}),
            mission=Mission(phases=phases, cycles=cycles, safety={"battery": reserve}, **given),
            columns=columns,
            floats=floats,
            store=tmp_path / f"{seed} {cycles}.zarr",
            seed=seed,
            spread=spread,
        )
        assert run(job, Workers())
        return job.layout.table()

    return flown


SUPPLY = {"capacity": 400e3, "cold_share": 0.85, "self_discharge": 0.02 / YEAR}


@pytest.mark.parametrize(
    ("given", "stop"),
    [
        ({}, Stop.RESERVE),
        pytest.param({"reserve": 0.0}, Stop.BATTERY_EMPTY, marks=pytest.mark.prove),
        *(
            pytest.param(given, Stop.RESERVE, marks=pytest.mark.prove)
            for given in (
                {"cold_share": 0.6},
                {"self_discharge": 0.3 / YEAR},
                {"start_depth": 150.0},
                {"start_temperature": 30.0},
            )
        ),
    ],
)
def test_two_cycles_say_how_many_the_battery_lasts(fleet, given, stop):
    """Within one cycle, and off in both directions: an end is a matter of some joules."""
    few, all_ = fleet(12, 2, 1, **given), fleet(12, TO_THE_END, 1, **given)
    assert np.all(all_["stop"] == stop)
    assert np.array_equal(all_["battery_cycles"], all_["cycles"])
    off = few["battery_cycles"] - all_["cycles"]
    assert np.min(all_["cycles"]) > 20.0
    assert np.max(np.abs(off)) <= 1.0
    assert abs(np.mean(off)) < 0.4  # three standard errors of 12 that are off by 0 or 1


@pytest.mark.prove
def test_batteries_that_end_below_the_reserve_within_a_cycle_too(fleet):
    """Of cycles that take more than the reserve some are broken off, and do not count."""
    few, all_ = (fleet(40, n, 1, capacity=60e3) for n in (2, TO_THE_END))
    assert {*all_["stop"]} == {Stop.RESERVE, Stop.BATTERY_EMPTY}
    assert np.array_equal(few["battery_cycles"], all_["cycles"])


def test_the_interval_of_few_values_is_that_of_students_t():
    """By hand: the lives 99.5 and 199.5, with 12.7062 of t for one degree of freedom."""
    low, high = prediction_interval(np.array([99.5, 199.5]))
    middle, sigma = np.log(100.0) + np.log(2.0) / 2.0, np.log(2.0) / 2.0**0.5
    ends = np.exp(middle + np.array([-1.0, 1.0]) * 12.7062047 * sigma * 1.5**0.5) - 0.5
    assert (low, high) == pytest.approx(tuple(ends), rel=1e-6)
    assert prediction_interval(np.full(5, 62.0)) == pytest.approx((62.0, 62.0))


def test_the_interval_of_39_values_goes_to_both_ends_and_of_79_to_the_next():
    assert prediction_interval(np.arange(39.0)) == pytest.approx((0.0, 38.0))
    assert prediction_interval(np.arange(79.0)) == pytest.approx((1.0, 77.0))


@pytest.mark.parametrize("count", [10, 20, 40, 200])
def test_an_interval_holds_the_next_of_normal_values(count):
    random = np.random.default_rng(count)
    fleets = 200.0 + 10.0 * random.standard_normal((4000, count + 1))
    held = [low <= row[-1] <= high for row in fleets for low, high in [ends(row)]]
    assert 0.94 < np.mean(held) < 0.96  # three standard errors


@pytest.mark.parametrize("count", [40, 200])
def test_of_40_values_an_interval_holds_the_next_of_any_kind(count):
    """Two waters, in one of which batteries last twice as long: t would hold all."""
    random = np.random.default_rng(count)
    shape = (4000, count + 1)
    fleets = 100.0 * random.integers(1, 3, shape) + 2.0 * random.standard_normal(shape)
    held = [low <= row[-1] <= high for row in fleets for low, high in [ends(row)]]
    assert 0.94 < np.mean(held) < 0.96


def ends(fleet):
    return prediction_interval(fleet[:-1])


def coverage(lives, flown, count, draws=300):
    """Return how many of floats flown to the end lie in intervals of fleets of so many floats."""
    random = np.random.default_rng(count)
    found = []
    for _ in range(draws):
        low, high = np.round(prediction_interval(random.choice(lives, count, replace=False)), 6)
        found.append(np.mean((flown >= np.ceil(low)) & (flown <= np.floor(high))))
    return float(np.mean(found))


@pytest.mark.prove
@pytest.mark.slow
def test_floats_flown_to_the_end_lie_in_the_interval_of_others(fleet):
    """A sample of what `make prove` does with batteries that last longer."""
    given = {"phases": SHALLOW, "spread": Spread(drag=0.2, pump=0.15), "capacity": 200e3}
    lives = fleet(200, 2, 1, **given)["battery_cycles"]
    table = fleet(120, TO_THE_END, 2, **given)
    assert np.all(table["stop"] == Stop.RESERVE)
    for count in (10, 20, 40):
        assert 0.91 < coverage(lives, table["cycles"], count) < 0.99, count


@pytest.mark.prove
def test_the_next_float_lies_in_the_interval_as_often_as_is_said(fleet):
    given = {"capacity": 3e6}
    lives = fleet(600, 2, 1, **given)["battery_cycles"]
    flown = fleet(600, TO_THE_END, 2, **given)["cycles"]
    for count in (10, 20, 40, 200):
        assert 0.93 < coverage(lives, flown, count) < 0.97, count


@pytest.mark.prove
def test_of_two_waters_the_interval_is_too_wide_for_fewer_than_39_floats(fleet, column):
    other = uniform_column(load_vehicle("example-float").water, 800.0)
    given = {"capacity": 1.7e6, "columns": (column, other)}
    lives = fleet(600, 2, 1, **given)["battery_cycles"]
    flown = fleet(600, TO_THE_END, 2, **given)["cycles"]
    for count in (10, 20):
        assert coverage(lives, flown, count) > 0.95
    for count in (40, 200):
        assert 0.93 < coverage(lives, flown, count) < 0.97, count


def test_the_command_says_how_long_batteries_last(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(
        "schema_version = 1\ncycles = 1\n[[phases]]\nkind = 'descend'\ndepth = 50\n"
        "[[phases]]\nkind = 'surface'\nduration = 60\n"
    )
    command = ["campaign", "example-float", "m.toml", "--floats", "6"]
    assert main([*command, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)["battery_cycles"]
    low, high = answer["prediction95"]
    assert low < answer["median"] < high
    assert (answer["floats"], answer["flown_to_reserve"], answer["unit"]) == (6, 0, "1")
    with open("swimbladder-campaign/floats.csv") as file:
        rows = np.genfromtxt(file, delimiter=",", names=True)
    assert np.median(rows["battery_cycles"]) == answer["median"]
    assert main(command) == 0
    said = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [
        *["cycles", "on", "one", "battery"],
        f"{answer['median']:g}",
        str(low),
        "to",
        str(high),
    ] in said


def test_without_energy_or_battery_there_is_no_life(column):
    """A float that did no whole cycle counts for none, and two that did are needed."""
    table = np.zeros(3, ROW)
    table["battery_cycles"] = 120.0, np.nan, 100.0
    table["stop"] = Stop.FINISHED, Stop.LOST, Stop.RESERVE
    given = {"spread": Spread(), "seed": 1, "energy_unknown": "", "columns": [column]}
    mission = Mission(phases=SHALLOW)
    found = Campaign(vehicle=load_vehicle("feup-em"), mission=mission, table=table, **given)
    assert found.battery_life[:3] == (2, 1, 110.0)
    assert replace(found, table=table[:2]).battery_life is None
    assert replace(found, table=table[:2]).to_dict()["battery_cycles"] is None
