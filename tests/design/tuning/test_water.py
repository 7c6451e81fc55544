"""The water of a cast in tuning and in the comparison of laws: as `simulate` has it."""

import json

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.cli import main
from swimbladder.control.registry import bind
from swimbladder.design.law_comparison.contenders import SCENARIOS, Placed, own
from swimbladder.design.law_comparison.run import fly_scenario
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning import tune
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.trial import Drawn, Step, draw, traces, trial
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.casts import read_cast
from swimbladder.physics.seawater import cast_column
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.vehicle import Supervisor

FEUP = sb.load_vehicle("feup-em")
LAW, NUMBERS = bind(FEUP.controller)
BOUND = BoundLaw(LAW, NUMBERS, FEUP.controller.sample_time)
RUN = {"setpoints": [(0.0, 6.0)], "duration": 120.0, "start_depth": 1.5}


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """A lake with a thermocline at 4 m, 15 m deep."""
    path = tmp_path_factory.mktemp("lake") / "lake.csv"
    depth = np.arange(0.0, 15.05, 0.1)
    warmth = 8.0 + 14.0 / (1.0 + np.exp((depth - 4.0) / 0.4))
    np.savetxt(
        path,
        np.column_stack([0.98 * depth, warmth]),
        delimiter=",",
        fmt="%.4f",
        header="Pressure [dbar],Temperature (deg C)",
        comments="",
    )
    return path


@pytest.fixture(scope="module")
def column(lake):
    return cast_column(read_cast(lake, salinity=0.0), step=0.1)


@pytest.fixture(scope="module")
def simulated(column):
    return sb.simulate(FEUP, cast=column, **RUN), sb.simulate(FEUP, **RUN)


def test_a_trial_is_flown_in_it_as_simulate_does(column, simulated):
    step = Step(1.5, 6.0, 120.0)
    for water, run in zip((column, None), simulated, strict=True):
        seen = traces(FEUP, BOUND, step, Drawn(1, column=water))
        assert seen.depth[:, 0] == pytest.approx(run.depth, abs=1e-9)
        assert seen.volume[:, 0] == pytest.approx(run.volume, abs=1e-12)
    assert np.abs(simulated[0].depth - simulated[1].depth).max() > 0.2
    drawn = Drawn(20, region(FEUP))
    wet, even = (trial(FEUP, BOUND, step, drawn._replace(column=w)) for w in (column, None))
    assert wet.rms != even.rms


def test_a_contender_is_flown_in_it_as_simulate_does(column, simulated):
    placed = Placed(SCENARIOS[0], 1.5, 6.0, 120.0)
    for water, run in zip((column, None), simulated, strict=True):
        drawn = Drawn(2, region(FEUP), column=water)
        _, time, depth = fly_scenario(FEUP, own(FEUP)[0], placed, drawn)
        assert depth == pytest.approx(run.depth[: len(time)], abs=1e-9)


def test_vehicles_that_are_drawn_have_its_density(column):
    around = region(FEUP)
    medium = medium_of(FEUP, column, reach=6.0)
    share = medium.specific_weight / FEUP.water.specific_weight
    assert share != 1.0
    own_, wet = (draw(around, runs=50, seed=3, medium=m) for m in (None, medium))
    for name in ("a_b", "a_s"):
        assert wet[name] == pytest.approx(share * own_[name], rel=1e-12)
    for name in ("psi", "T1", "gain", "d_l", "V_0"):
        assert np.array_equal(wet[name], own_[name])


@pytest.mark.prove
def test_tuning_says_and_feels_it(column):
    given = {"law": "planned", "depth_range": (0.0, 6.0), "step": (1.5, 5.0), "runs": 20}
    given["supervised"] = False
    wet, even = tune(FEUP, cast=column, **given), tune(FEUP, **given)
    assert any("in the water of lake.csv" in words for words in wet.assumptions)
    assert not any("lake.csv" in words for words in even.assumptions)
    # How far its layers move the neutral volume is what the law may have to learn.
    medium = medium_of(FEUP, column, reach=6.0)
    z = np.linspace(0.0, 6.0, 201)
    moved = np.abs(medium.layers.along(z)).max()
    extra = wet.setting.neutral_range - even.setting.neutral_range
    assert extra == pytest.approx(moved, rel=1e-9)
    assert wet.region != even.region


@pytest.mark.prove
def test_a_supervisor_is_written_for_the_layers_unless_it_says_less(column):
    """They move the neutral volume by more than is usual, by which a healthy vehicle came up."""
    given = {"law": "planned", "depth_range": (0.0, 6.0), "step": (1.5, 5.0), "runs": 20}
    narrow = FEUP.model_copy(update={"supervisor": Supervisor(neutral_change=17.5e-6)})
    said = "the supervisor takes a healthy vehicle for a faulty one and brings it up"
    with pytest.raises(NoAnswerError, match=said):
        tune(narrow, cast=column, **given)
    found = tune(FEUP, cast=column, **given)
    assert found.region.alarms == 0.0
    assert "What limits it is the water of the cast" in found.verdict
    wide = found.result_vehicle
    # by density: the mass displaces less of heavier water, hull and mean over its height aside
    rho = np.interp([1.0, 6.0], column.depth, column.density)
    mass = FEUP.water.density * FEUP.hull.displaced_volume
    assert wide.supervisor.neutral_change == pytest.approx(1.2 * mass * np.ptp(1 / rho), rel=0.1)
    assert any("[supervisor] is written so" in words for words in found.assumptions)
    way = {"setpoints": [(0.0, 1.0), (200.0, 6.0), (600.0, 2.0)], "duration": 900.0}
    for vehicle, alarmed in ((wide, False), (wide.but("supervisor", neutral_change=None), True)):
        ran = sb.simulate(vehicle, cast=column, start_depth=1.0, **way)
        assert (ran.alarm is not None) == alarmed


def test_a_cast_that_ends_above_is_refused(column):
    with pytest.raises(InputError, match=r"lake\.csv ends at 15 m"):
        tune(FEUP, depth_range=(0.0, 20.0), cast=column)


@pytest.mark.parametrize(
    "command", [["tune", "feup-em", "--law", "planned"], ["compare-laws", "feup-em"]]
)
def test_the_commands_have_the_options_of_a_cast(command, lake, tmp_path, capsys):
    place = ["--out", str(tmp_path / "out"), "--json"]
    assert main([*command, "--salinity", "0", *place]) == 2
    assert "--cast" in capsys.readouterr().err
    cast = ["--cast", str(lake), "--salinity", "0"]
    assert main([*command, *cast, "--depth-range", "0:20 m", *place]) == 2
    assert "lake.csv ends at 15 m" in " ".join(capsys.readouterr().err.split())


@pytest.mark.prove
def test_compare_laws_says_whose_water_it_is(lake, tmp_path, capsys):
    command = [
        "compare-laws",
        "feup-em",
        "--laws",
        "position-pid",
        "--runs",
        "2",
        "--depth-range",
        "0:6 m",
        "--json",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*command, "--cast", str(lake), "--salinity", "0"]) == 0
    wet = json.loads(capsys.readouterr().out)
    assert main(command) == 0  # into the same folder: what is kept of the other water is not taken
    even = json.loads(capsys.readouterr().out)
    assert any("in the water of lake.csv" in words for words in wet["assumptions"])
    results = [answer["laws"][0]["results"]["step-down"] for answer in (wet, even)]
    assert results[0]["rms_m"] != results[1]["rms_m"]
