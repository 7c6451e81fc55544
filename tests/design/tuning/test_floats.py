"""Floats tuned over depths and region: better than what they had, and no where nothing does it."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder import load_vehicle
from swimbladder.cli import main
from swimbladder.control.rate import candidates, gains
from swimbladder.control.registry import bind
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning import tune
from swimbladder.design.tuning.gains import float_score, limiting, promise_of, setting_of
from swimbladder.design.tuning.margins import in_water
from swimbladder.design.tuning.region import FLOATS, member, region
from swimbladder.design.tuning.trial import (
    ALONE,
    BOARD,
    Drawn,
    Step,
    Trial,
    draw,
    energy_of,
    fly,
    traces,
    trial,
)
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle as load_file
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.buoyancy_engine import at_voltage
from swimbladder.physics.dynamics import terminal_speed
from swimbladder.physics.hull import along_hull, neutral_volume
from swimbladder.physics.seawater import cast_column
from swimbladder.show.picture import Curve
from swimbladder.show.tune import draw_tuning
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.units import rounded
from swimbladder.vehicle.actuators import PowerLawPump
from swimbladder.vehicle.spread import Spread
from tests.pictures import marks
from tests.quoted import refused

FLOAT = load_vehicle("example-float")
LAW, OWN = bind(FLOAT.controller)
BOUND = BoundLaw(LAW, OWN)
DEPTHS = (100.0, 300.0)
AROUND = region(FLOAT)


def changed(where: str, **values):
    part = getattr(FLOAT, where)
    return FLOAT.model_copy(update={where: part.model_copy(update=values)})


@pytest.fixture(scope="module")
def fast():
    return tune(FLOAT, depth_range=DEPTHS, runs=20)


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    """A sea with a warm top, down to 700 dbar."""
    path = tmp_path_factory.mktemp("sea") / "sea.csv"
    p = np.arange(0.0, 700.0, 2.0)
    rows = np.column_stack([p, 4.0 + 16.0 * np.exp(-p / 150.0), np.full_like(p, 35.0)])
    head = "Pressure [dbar],Temperature (deg C),Salinity [PSU]"
    np.savetxt(path, rows, delimiter=",", fmt="%.4f", header=head, comments="")
    return path


def test_its_figures_are_of_law_seconds_and_supervisor_as_flashed(fast):
    bound = BoundLaw(fast.law, fast.parameters)
    flashed, alone = (
        trial(FLOAT, bound, fast.step, Drawn(20, AROUND, fast.supply, supervised=s, tick=1.0))
        for s in (True, False)
    )
    assert fast.region == flashed
    assert fast.region != alone
    assert fast.region.settle_95 == pytest.approx(alone.settle_95, rel=0.5)
    assert fast.region.settle_95 != alone.settle_95
    assert fast.region.alarms == 0.0
    assert BOARD in fast.assumptions
    assert "supervisor" in fast.vehicle.model_fields_set
    assert (
        fast.vehicle.supervisor.time_limit is None
    )  # a float's mission takes days: `firmware` asks
    told = tune(FLOAT, depth_range=DEPTHS, runs=20, supervised=False)
    own = BoundLaw(told.law, told.parameters)
    assert told.region == trial(FLOAT, own, told.step, Drawn(20, AROUND, told.supply))
    assert ALONE in told.assumptions
    assert "supervisor" not in told.vehicle.model_fields_set
    drawn = [draw_tuning(found).panels[-1] for found in (fast, told)]
    assert [panel.y.partition("\n")[0] for panel in drawn] == [
        "pump (+) or valve (−)",
        "change asked for [cm³]",
    ]
    assert (
        max(np.abs(mark.y).max() for mark in marks(drawn[0], Curve)) == 1.0
    )  # s, of a sample of 1 s


def test_a_board_knows_the_pump_of_a_full_battery():
    """As `firmware` writes it, whatever is left of the battery: it pumps too short a time."""
    step = Step(*DEPTHS, 14400.0)
    weak, strong = (
        trial(FLOAT, BOUND, step, Drawn(2, None, supply, supervised=True, tick=1.0))
        for supply in (12.0, math.inf)
    )
    own = at_voltage(FLOAT, 12.0)
    knows = trial(own, BOUND, step, Drawn(2, None, supervised=True, tick=1.0))
    assert weak.settle_95 > 1.1 * knows.settle_95
    assert strong.settle_95 < weak.settle_95
    assert strong.settled == weak.settled == 1.0


@pytest.mark.prove
def test_a_supervisor_that_ends_the_flight_or_turns_it_round_is_a_no():
    with pytest.raises(NoAnswerError, match="brings it up: time limit"):
        tune(changed("supervisor", time_limit=3600.0), depth_range=DEPTHS, runs=20)
    with refused(InputError, field="depth_range", value=300.0):
        tune(changed("supervisor", depth_limit=250.0), depth_range=DEPTHS, runs=20)


def test_the_fast_law_is_sooner_there_than_the_one_it_had(fast):
    own = trial(FLOAT, BOUND, fast.step, Drawn(20, AROUND, fast.supply))
    assert fast.region.settled == 1.0
    assert fast.region.settle_95 < 0.8 * own.settle_95
    assert fast.region.rms < OWN.tolerance
    assert 0.0 < fast.radius < 1.0
    assert (fast.law.name, fast.depths, fast.step[:2]) == ("rate", DEPTHS, DEPTHS)


def test_the_coefficient_is_that_of_the_drag(fast):
    """k_dt/(rho g), whatever speed it is taken at: the drag is quadratic."""
    k = FLOAT.drag.k_dt / FLOAT.water.specific_weight
    assert fast.parameters.coefficient == pytest.approx(k, rel=1e-9)
    assert fast.parameters.tolerance == OWN.tolerance
    json = fast.to_dict()
    assert json["margins"] is None
    assert json["decision_eigenvalue"] == fast.radius
    assert json["parameters"]["far_speed"]["unit"] == "m/s"
    assert json["tuning"]["speed"] == fast.parameters.far_speed


def test_the_vehicle_is_one_that_other_commands_read(fast, tmp_path):
    path = tmp_path / "tuned.toml"
    path.write_text(vehicle_file(fast.vehicle), encoding="utf-8")
    assert bind(load_file(path).controller)[1] == pytest.approx(fast.parameters)


@pytest.mark.prove
def test_a_quiet_law_takes_less_to_hold_than_the_one_it_had():
    """Few of many flights hunt while they hold, and take most of it: it needs all 200.

    Both as flashed, for the pump of a full battery, with one that is nearly empty.
    """
    quiet = tune(FLOAT, goal="quiet", depth_range=(100.0, 1500.0))
    as_flashed = Drawn(200, AROUND, quiet.supply, supervised=True, tick=quiet.sample_time)
    own = trial(FLOAT, BOUND, quiet.step, as_flashed)
    assert own.alarms == quiet.region.alarms == 0.0
    assert quiet.region.power < 0.7 * own.power
    assert quiet.region.starts < own.starts


def test_each_goal_prefers_what_it_is_about():
    base = Trial(20, 1.0, 3600.0, 4000.0, 0.0, 0.0, 5.0, 1e-10, 1e-4, 1e-4, 3000.0, 0.01)
    sooner, calmer = base._replace(settle_95=3000.0), base._replace(power=0.005)
    cheaper, lost = base._replace(energy=2000.0), base._replace(settled=0.5, power=0.0)
    for goal, best in (("fast", sooner), ("quiet", calmer), ("energy", cheaper)):
        every = (base, sooner, calmer, cheaper, lost)
        assert min(every, key=lambda t: float_score(goal, t, 10.0)) is best
        wide = best._replace(overshoot_95=0.5)  # farther than asked by half of its way
        assert min((wide, base), key=lambda t: float_score(goal, t, 10.0, 100.0)) is base
        assert min((wide, base), key=lambda t: float_score(goal, t, 10.0, 15.0)) is wide  # its band
    unknown = base._replace(energy=math.nan, power=math.nan)
    assert float_score("quiet", unknown._replace(rate=1e-11), 10.0) < float_score(
        "quiet", unknown, 10.0
    )


@pytest.mark.parametrize("start", [0.0, 3.0])
@pytest.mark.parametrize("supervised", [False, True])
def test_a_flight_from_the_surface_begins_afloat(start, supervised):
    """It began neutral up there; its board took all volume for out, let in as much, and overshot.

    By 23 % where the law is the preset's; the law alone, which knew better, did not.
    """
    step = Step(start, 300.0, 7200.0)
    drawn = Drawn(2, None, supervised=supervised, tick=1.0)
    flown = traces(FLOAT, BOUND, step, drawn)
    assert flown.volume[0, 0] == FLOAT.stroke.maximum
    assert flown.depth[0, 0] < 0.2
    assert flown.depth[0, 1] == 300.0
    assert trial(FLOAT, BOUND, step, drawn).overshoot_95 < 0.05
    let_in = flown.actions[0][0, 1]
    assert -let_in < FLOAT.stroke.maximum - FLOAT.trim_error + 30e-6


@pytest.mark.parametrize("supervised", [False, True])
def test_the_energy_of_actions_is_that_of_the_ledger(supervised):
    """Rates and powers at the depth of each action, against the loop's own integral."""
    step = Step(*DEPTHS, 14400.0)
    drawn = Drawn(4, None, supervised=supervised, tick=1.0)
    asked = {"target": [300.0, 100.0], "start_depth": [100.0, 300.0], "duration": step.duration}
    flown = fly(FLOAT, BOUND, **asked, supervised=supervised, tick=1.0)
    assert [len(acts) for acts in flown.actions] == flown.drive_runs.tolist()
    moved = np.array([acts[:, 1].sum() for acts in flown.actions])
    assert moved == pytest.approx(flown.volume[-1] - flown.volume[0], abs=2e-6)
    for lane in range(2):
        assert energy_of(FLOAT, flown, lane).sum() == pytest.approx(flown.energy[lane], rel=0.02)
    found = trial(FLOAT, BOUND, step, drawn)
    assert found.energy == pytest.approx(flown.energy.mean(), rel=1e-6)


def test_a_pump_that_gives_less_moves_less():
    still = BoundLaw(LAW, OWN._replace(speed_step=0.0, volume_step=0.0), 1.0)
    asked = {"target": 1500.0, "start_depth": 500.0, "duration": 60.0}
    whole, part = (fly(FLOAT, still, vary={"valve": x}, **asked).volume[-1, 0] for x in (1.0, 0.6))
    begin = FLOAT.neutral_volume(500.0)
    assert (part - begin) / (whole - begin) == pytest.approx(0.6, rel=0.02)


def test_floats_are_drawn_from_the_region():
    medium = medium_of(FLOAT, None, reach=300.0)
    drawn = draw(AROUND, runs=4000, seed=1, medium=medium)
    drawn["drag"] = drawn["d_t"] / AROUND.plants[0].d_t
    usual = Spread()
    far = math.sqrt(9.4877)  # 95 % of chi-square with 4 degrees of freedom
    sigma = {"drag": usual.drag, "psi": usual.psi, "pump": usual.pump, "valve": usual.pump}
    for name in FLOATS:
        middle = FLOAT.hull.psi if name == "psi" else 1.0
        off = np.abs(drawn[name] - middle) / sigma[name]
        assert off.max() <= far * (1.0 + 1e-9)
        assert drawn[name].mean() == pytest.approx(middle, abs=0.3 * sigma[name])
    assert np.abs(drawn["V_0"] - FLOAT.trim_error).max() <= 2.0 * usual.trim
    edge = member(FLOAT, np.array([1.0, 0.0, 0.0, 0.0]))
    assert edge.shares["drag"] == pytest.approx(1.0 + far * usual.drag, rel=1e-4)
    assert edge.plant.d_t == pytest.approx(AROUND.plants[0].d_t * edge.shares["drag"])


def test_zones_are_flown_through_in_more_than_a_decision():
    setting = setting_of(FLOAT, sample_time=1.0, supply=13.0, neutral_range=1e-5, depths=DEPTHS)
    quantum = setting.drive.tick * max(setting.drive.rate_out, setting.drive.rate_in)
    for goal in ("fast", "quiet", "energy"):
        for chosen in candidates(setting, goal, 10.0):
            q = gains(setting, chosen)
            interval = q.dead + q.run
            assert q.slow_speed * interval <= 2.0 * q.tolerance
            assert q.near_speed * interval < q.near - q.tolerance + 1e-9
            # a decision and a half: one at least falls into the zone before the next begins
            assert q.far - q.near == pytest.approx(1.5 * q.far_speed * interval, rel=1e-9)
            assert q.speed_band <= q.slow_speed
            # the least change of the volume is no more than what drives it that slowly
            driven = terminal_speed(setting.plant, setting.plant.a_b * q.volume_step)
            assert q.volume_step == pytest.approx(quantum) or driven <= q.slow_speed * (1.0 + 1e-9)


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_a_speed_is_measured_so_long_that_a_band_stands_out_of_the_noise_before_its_zones(noise):
    """By two depths, in whole 5 s: what they make of the speed is an eighth of the band at most."""
    setting = setting_of(FLOAT, sample_time=1.0, supply=13.0, neutral_range=1e-5, depths=DEPTHS)
    longer = 0
    for chosen in candidates(setting._replace(noise=noise), "quiet", 10.0):
        slow = min(0.3 * chosen.speed, 10.0 / (chosen.dead + 10.0))  # crossed in a decision
        off = math.hypot(noise, noise) / chosen.run
        assert off <= chosen.band * slow / 8.0
        assert chosen.run % 5.0 == 0.0
        assert chosen.run >= 10.0
        longer += chosen.run > 10.0
    assert longer > 0


def test_in_the_water_of_a_cast_it_is_flown_there(sea):
    column = cast_column(read_cast(sea))
    step = Step(*DEPTHS, 14400.0)
    even, wet = (trial(FLOAT, BOUND, step, Drawn(4, column=c)) for c in (None, column))
    assert wet.energy != even.energy
    assert wet.settled == 1.0
    with refused(InputError, field="cast"):
        tune(FLOAT, depth_range=(100.0, 900.0), runs=20, cast=column)


def of_no_depths(monkeypatch, vehicle, **given):
    """Return what `tune` looks for, where no depths are asked for."""
    asked = []

    def tuned(self, *_):
        asked.append(self)
        raise NoAnswerError("enough")

    monkeypatch.setattr("swimbladder.design.tuning.run._Request.tuned", tuned)
    with pytest.raises(NoAnswerError):
        tune(vehicle, law=None if vehicle is FLOAT else vehicle.controller.law, **given)
    return asked[0]


@pytest.mark.parametrize("rated", [2000.0, 200.0])
def test_without_depths_a_float_is_tuned_for_its_own_and_says_so(rated, monkeypatch):
    """It was refused: the usual 0 to 10 m are within the band of a float."""
    found = of_no_depths(monkeypatch, changed("hull", depth_limit=rated))
    most = 0.8 * 0.9 * rated  # four fifths of what the supervisor allows of the rating
    assert found.depths == pytest.approx((20.0, most))
    said = f"80 % of {rounded(0.9 * rated, 3)} m, where its supervisor turns it round"
    assert said in " ".join(found._assumptions())
    asked = replace(found, why="")._assumptions()
    assert "depth_range" not in " ".join(asked)


def test_without_depths_it_is_tuned_as_deep_as_the_water_is_known(sea, monkeypatch):
    column = cast_column(read_cast(sea))
    found = of_no_depths(monkeypatch, FLOAT, cast=column)
    assert found.depths == (20.0, column.deepest)


@pytest.mark.parametrize(("rated", "most"), [(100.0, 10.0), (5.0, 0.8 * 0.9 * 5.0)])
def test_without_depths_a_motor_is_tuned_for_ten_metres_or_what_it_has(rated, most, monkeypatch):
    vehicle = load_vehicle("feup-em").but("hull", depth_limit=rated)
    assert of_no_depths(monkeypatch, vehicle).depths == pytest.approx((0.0, most))


PUMP = PowerLawPump(delivery="0.7 mL/s", idle_power="5 W", power_per_pressure="7 mW/dbar")


def test_a_float_of_which_nothing_limits_the_depth_is_refused():
    vehicle = FLOAT.but("actuator", pump=PUMP).but("hull", depth_limit=None)
    with refused(InputError, field="depth_range"):
        tune(vehicle)


SOFT = changed("hull", psi=2e-6)


@pytest.mark.parametrize(
    ("vehicle", "options", "words"),
    [
        (changed("supply", voltage=3.0), {"depth_range": (100.0, 1900.0)}, "leaks back"),
        (FLOAT, {"depth_range": (100.0, 2500.0)}, "rated for 2000 m"),
        (changed("stroke", minimum=-60e-6), {"depth_range": (100.0, 1900.0)}, "outside its stroke"),
        pytest.param(FLOAT, {"hold": 0.2}, "keeps it within 0.2 m", marks=pytest.mark.prove),
        (changed("sensors", depth_noise=0.2), {"hold": 0.5}, "better depth sensor or a wider band"),
        pytest.param(
            *(changed("hull", psi=-4e-6), {"depth_range": (2.0, 40.0), "hold": 0.4}, "no setting"),
            marks=pytest.mark.prove,
        ),
        (SOFT, {"depth_range": (2.0, 100.0), "supervised": False}, "A stiffer hull may help"),
        (changed("actuator", longest_run=2.0), {}, "A longer actuator.longest_run or a faster"),
    ],
)
def test_where_no_setting_does_it_the_answer_is_no_and_why(vehicle, options, words):
    with pytest.raises(NoAnswerError) as told:
        tune(vehicle, runs=20, **({"depth_range": DEPTHS} | options))
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ("d_t", "the motion (mass and drag): logs of dives that differ"),
        ("psi", "psi: logs of dives that differ"),
        ("valve", "pump and valve: runs of both with volume and pressure, and `energy --fit`"),
        ("all", "all parameters together, of none alone: logs of dives that differ"),
    ],
)
def test_what_limits_a_float_is_narrowed_by_its_dives_and_runs(known, said, monkeypatch):
    """It was told to go to a pool and follow `design-experiment`, for a dive to 1500 m."""
    kept = Trial(20, 1.0, 3600.0, 4000.0, 0.0, 0.0, 5.0, 1e-10, 1e-4, 1e-4, 3000.0, 0.01)
    broken = kept._replace(settled=0.5)

    def flown(_vehicle, _law, _step, drawn, *, ballast):  # noqa: ARG001
        return kept if known in drawn.known or drawn.region is None else broken

    monkeypatch.setattr("swimbladder.design.tuning.gains.trial_of", flown)
    promise = promise_of(FLOAT, "energy", least=math.nan, held=10.0, supervised=True)
    drawn = Drawn(20, AROUND, supervised=True, tick=1.0)
    found = limiting(FLOAT, [BOUND], Step(100.0, 300.0, 3600.0), drawn, promise, broken, {})
    assert said in found
    assert "pool" not in found


def test_what_does_not_go_together_is_refused():
    with refused(InputError, field="law"):
        tune(FLOAT, law="planned", depth_range=DEPTHS)
    with refused(InputError, field="law"):
        tune(load_vehicle("feup-em"), law="rate")
    with refused(InputError, field="depth_range"):
        tune(FLOAT, depth_range=(0.0, 10.0))  # within the band
    with refused(InputError, field="hold"):
        tune(FLOAT, depth_range=DEPTHS, hold=-1.0)
    with refused(InputError, field="supply"):
        tune(FLOAT, depth_range=DEPTHS, supply=20.0)


def test_decisions_are_judged_with_the_psi_of_the_cast(sea):
    column = cast_column(read_cast(sea))
    medium = medium_of(FLOAT, column, reach=300.0)
    one = member(FLOAT, np.zeros(len(FLOATS)))
    # by the hull's law itself, over the same 20 m
    z = column.depth
    neutral = neutral_volume(FLOAT, along_hull(column, FLOAT.hull))
    for depth in (50.0, 300.0):
        slope = np.diff(np.interp([depth - 10.0, depth + 10.0], z, neutral))[0] / 20.0
        found = in_water(medium, one, depth).plant
        assert found.psi == pytest.approx(slope, rel=1e-3)
        assert abs(found.psi - one.plant.psi) > 0.1 * abs(one.plant.psi)
    still = medium_of(FLOAT, None, reach=300.0)
    assert in_water(still, one, 300.0).plant == pytest.approx(one.plant, nan_ok=True)


@pytest.mark.prove
def test_the_command_tunes_a_float_in_a_cast_as_python_does(capsys, sea, tmp_path):
    out = tmp_path / "out"
    command = [
        "tune",
        "example-float",
        "--depth-range",
        "100:300 m",
        "--runs",
        "20",
        "--cast",
        str(sea),
    ]
    assert main([*command, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    names = {"vehicle.toml", "report.html", "tune.json", "tune.png"}
    assert {p.name for p in out.iterdir()} == names
    found = tune(FLOAT, depth_range=DEPTHS, runs=20, cast=cast_column(read_cast(sea)))
    assert answer["region"] == pytest.approx(found.to_dict()["region"], rel=1e-2)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "time to the depth, 95 %" in page
    assert "from one decision to the next" in page
    assert bind(load_file(out / "vehicle.toml").controller)[1] == pytest.approx(
        found.parameters, rel=1e-2
    )


def test_the_command_says_no_with_exit_code_1(capsys, tmp_path):
    command = [
        "tune",
        "example-float",
        "--depth-range",
        "100:2500 m",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(command) == 1
    assert "rated for 2000 m" in capsys.readouterr().err
