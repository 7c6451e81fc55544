"""An array of floats: each is the mission of such a float, draws are fair, kills lose nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.draw import Drawn, Spread, draw, varied
from swimbladder.sim.campaign.result import share_interval
from swimbladder.sim.campaign.run import Fact, fly_floats
from swimbladder.sim.mission.core.motion import rate_of
from swimbladder.sim.mission.core.names import Account, Doing, Given, Table
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan

TASK = Mission(
    phases=[
        {"kind": "descend", "depth": 60.0, "tolerance": 5.0},
        {"kind": "park", "depth": 60.0, "tolerance": 5.0, "duration": 1200.0},
        {"kind": "surface", "duration": 300.0},
    ],
    cycles=2,
)


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("example-float")


@pytest.fixture(scope="module")
def column(vehicle):
    return uniform_column(vehicle.water, 150.0)


def test_a_float_that_does_not_differ_flies_the_mission(vehicle, column):
    same = Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0)
    row = fly_floats(vehicle, TASK, [column], floats=1, spread=same)[0]
    flown = fly_mission(vehicle, TASK, column)
    assert row[Fact.DURATION] == flown.duration
    drive = sum(
        flown.accounts[a]
        for a in (Account.PUMP_ENERGY, Account.VALVE_ENERGY, Account.HOLDING_ENERGY)
    )
    assert row[Fact.DRIVE] == pytest.approx(drive, rel=1e-12)
    assert row[Fact.CYCLES] == 2.0


def test_a_float_that_is_trimmed_otherwise_is_one_with_more_ballast(vehicle, column):
    """The trim drawn is the file's trim_error; only the processor does not know of it."""
    plan = make_plan(vehicle, TASK, column)
    drawn = np.array([8e-6, 3e-9, 1.2, 0.9, 0.0])
    g = varied(plan, drawn).given
    hull = vehicle.hull.model_copy(update={"psi": vehicle.hull.psi + 3e-9, "parts": ()})
    plain = vehicle.model_copy(update={"hull": vehicle.hull.model_copy(update={"parts": ()})})
    heavier = plain.model_copy(update={"hull": hull, "trim_error": vehicle.trim_error + 8e-6})
    change = neutral_volume(heavier, column) - neutral_volume(plain, column)
    assert np.allclose(g[Given.TRIM] + g[Given.GIVE] * column.depth, change, rtol=1e-3)
    assert g[Given.NEUTRAL_TOP] == plan.given[Given.NEUTRAL_TOP]
    assert g[Given.D_T] == pytest.approx(1.2 * vehicle.drag.k_dt / vehicle.mass)
    assert g[Given.DELIVERY] == 0.9


def test_a_pump_that_delivers_less_gives_less_than_the_table(vehicle, column):
    plan = make_plan(vehicle, TASK, column)
    weak = replace(plan, given=plan.given.copy())
    weak.given[Given.DELIVERY] = 0.8
    rate = float(plan.table[0, Table.RATE_OUT])
    doing = int(Doing.PUMPING)
    assert rate_of(plan.given, plan.table, doing, False, 0.0, 0.0, 0.0)[0] == rate
    assert rate_of(weak.given, weak.table, doing, False, 0.0, 0.0, 0.0)[0] == 0.8 * rate


def test_draws_are_normal_cut_and_the_same_in_every_campaign():
    spread = Spread()
    many = np.stack([draw(spread, seed=7, number=n, casts=3) for n in range(4000)])
    assert np.array_equal(many[5], draw(spread, seed=7, number=5, casts=3))
    assert np.std(many[:, Drawn.TRIM]) == pytest.approx(spread.trim, rel=0.05)
    assert np.mean(many[:, Drawn.DRAG]) == pytest.approx(1.0, abs=0.01)
    assert np.max(np.abs(many[:, Drawn.PUMP] - 1.0)) <= 3.0 * spread.pump * (1.0 + 1e-12)
    counts = np.bincount(many[:, Drawn.CAST].astype(int), minlength=3)
    assert np.all(np.abs(counts - 4000 / 3) < 150)  # five sigma


def test_the_interval_of_a_share_is_that_of_its_tails():
    """By definition each end leaves 2.5 % of the binomial beyond what was counted."""
    from scipy.stats import binom

    low, high = share_interval(37, 50)
    assert binom.sf(36, 50, low) == pytest.approx(0.025, rel=1e-9)
    assert binom.cdf(37, 50, high) == pytest.approx(0.025, rel=1e-9)
    assert share_interval(0, 50)[0] == 0.0
    assert share_interval(50, 50)[1] == 1.0


def test_a_stopped_campaign_goes_on_to_the_same_table(vehicle, column, tmp_path):
    whole = fly_floats(vehicle, TASK, [column], floats=120, seed=2)

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_floats(vehicle, TASK, [column], floats=120, seed=2, keep=tmp_path, advance=stop)
    kept = sorted(tmp_path.rglob("*.npy"))
    assert kept
    before = [path.stat().st_mtime_ns for path in kept]
    again = fly_floats(vehicle, TASK, [column], floats=120, seed=2, keep=tmp_path)
    assert np.array_equal(whole, again, equal_nan=True)
    assert [path.stat().st_mtime_ns for path in kept] == before


def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(
        "schema_version = 1\ncycles = 1\n[[phases]]\nkind = 'descend'\ndepth = 50\n"
        "[[phases]]\nkind = 'surface'\nduration = 60\n"
    )
    assert main(["campaign", "example-float", "m.toml", "--floats", "6", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["good"] == answer["floats"] == 6
    assert main(["campaign", "example-float", "m.toml", "--floats", "0"]) == 2
    assert "--floats" in capsys.readouterr().err
    assert main(["campaign", "example-float", "m.toml", "--duration", "0 d"]) == 2
    assert "--duration: it must be above 0" in capsys.readouterr().err
    assert main(["campaign", "example-float", "m.toml", "--trim-std=-2 cm3"]) == 2
    said = capsys.readouterr().err
    assert "--trim-std: not between 0 and 1 (got '-2 cm3', expected unit m3). Give 1 sigma." in said
    with pytest.raises(InputError, match="--drag-std"):
        Spread(drag=2.0)
