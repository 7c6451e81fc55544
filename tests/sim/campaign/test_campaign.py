"""An array of floats: each is the mission of such a float, draws are fair, kills lose nothing."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
import xarray

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.jobs import Workers, run
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.result import Campaign, share_interval
from swimbladder.sim.campaign.run import Drawn, Floats, draw, varied
from swimbladder.sim.campaign.store import ROW
from swimbladder.sim.engine.rodas.motion import rate_of
from swimbladder.sim.engine.rodas.records import Account, Doing, Stop, Table
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.prepare import make_plan
from swimbladder.vehicle import Identified
from swimbladder.vehicle.spread import Spread
from tests.cf import cf_problems

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


@pytest.fixture
def job(vehicle, column, tmp_path):
    def made(**options):
        store = tmp_path / "out" / "campaign.zarr"
        given = {"vehicle": vehicle, "mission": TASK, "columns": [column], "store": store}
        return Floats(**{**given, **options})

    return made


def flown(job, **workers):
    assert run(job, Workers(**workers))
    return job.layout.table()


@pytest.mark.parametrize(("floats", "chunk"), [(3, 1), (32, 2), (33, 3), (800, 50), (4000, 50)])
def test_small_campaigns_have_sixteen_chunks_and_large_ones_chunks_of_fifty(job, floats, chunk):
    assert job(floats=floats).layout.chunk == chunk


def test_a_float_that_does_not_differ_flies_the_mission(vehicle, column, job):
    same = Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0)
    one = job(floats=1, spread=same)
    row = flown(one)[0]
    alone = fly_mission(vehicle, TASK, column)
    assert row["duration"] == alone.duration
    drive = sum(
        alone.accounts[a]
        for a in (Account.PUMP_ENERGY, Account.VALVE_ENERGY, Account.HOLDING_ENERGY)
    )
    assert row["drive_energy_in_all"] == pytest.approx(drive, rel=1e-12)
    assert row["cycles"] == 2.0
    held = alone.accounts[len(Account) :].reshape(-1, len(Holding)).sum(axis=0)
    rms = (held[Holding.SQUARES] / held[Holding.TIME]) ** 0.5
    assert row["holding_error"] == pytest.approx(rms, rel=1e-12)
    # the same, cycle by cycle, against the trajectory
    with xarray.open_zarr(one.store, chunks=None) as data:
        cycle = alone.rows["cycle"]
        for n in range(2):
            rows = alone.rows[cycle == n]
            found = data.isel(float=0, cycle=n)
            assert float(found.deepest) == pytest.approx(rows["z"].max(), abs=0.01)
            assert float(found.begin) == pytest.approx(rows["t"][0], abs=1e-6)
        assert float(data.drive_energy.sum()) == pytest.approx(drive, rel=1e-12)
        assert float(data.battery_energy.sum()) == pytest.approx(
            row["battery_energy_in_all"], rel=1e-12
        )
        assert float(data.end[0, 1]) == row["duration"]
        under = alone.rows[alone.rows["z"] > 1.0]
        margin = under["v"].min() - vehicle.stroke.minimum
        above = vehicle.stroke.maximum - under["v"].max()
        assert float(row["stroke_margin_of_all"]) <= min(margin, above) + 1e-9
        assert float(data.stroke_margin.min()) == row["stroke_margin_of_all"]


def test_a_float_that_is_trimmed_otherwise_is_one_with_more_ballast(vehicle, column):
    """The trim drawn is the file's trim_error; only the processor does not know of it."""
    plan = make_plan(vehicle, TASK, column)
    drawn = np.array([8e-6, 3e-9, 1.2, 0.9, 1.0, 0.0])
    g = varied(plan, drawn).given
    hull = vehicle.hull.model_copy(update={"psi": vehicle.hull.psi + 3e-9, "parts": ()})
    plain = vehicle.model_copy(update={"hull": vehicle.hull.model_copy(update={"parts": ()})})
    heavier = plain.model_copy(update={"hull": hull, "trim_error": vehicle.trim_error + 8e-6})
    change = neutral_volume(heavier, column) - neutral_volume(plain, column)
    assert np.allclose(g["trim"] + g["give"] * column.depth, change, rtol=1e-3)
    assert g["neutral_top"] == plan.given["neutral_top"]
    assert g["d_t"] == pytest.approx(1.2 * vehicle.drag.k_dt / vehicle.mass)
    assert g["delivery"] == 0.9
    # with twice the mass a force makes half the acceleration
    slow = varied(plan, np.array([0.0, 0.0, 1.0, 1.0, 2.0, 0.0])).given
    for place in ("d_l", "d_b", "d_0", "d_t", "a_s"):
        assert slow[place] == 0.5 * plan.given[place]
    assert slow["mass"] == 2.0 * plan.given["mass"]


def test_a_float_under_a_sampled_law_is_a_vehicle_with_the_numbers_drawn(monkeypatch, tmp_path):
    """K1 goes with the pump, K2 and T2 with drag and mass, whatever the law knows of them."""
    trim, psi, drag, pump, mass = 3e-6, 2e-7, 1.1, 0.95, 1.05
    drawn = np.array([trim, psi, drag, pump, mass, 0.0])
    monkeypatch.setattr("swimbladder.sim.campaign.run.draw", lambda *_, **__: drawn)
    file = load_vehicle("feup-em")
    sea = uniform_column(file.water, 30.0)
    task = Mission(
        phases=[
            {"kind": "descend", "depth": 4.0, "tolerance": 0.2},
            {"kind": "park", "depth": 4.0, "tolerance": 0.2, "duration": 60.0},
            {"kind": "surface", "duration": 10.0},
        ],
        cycles=2,
    )
    store = tmp_path / "campaign.zarr"
    floats = Floats(vehicle=file, mission=task, columns=[sea], floats=1, store=store, seed=2)
    floats.create()
    floats.do(0)
    found = xarray.open_zarr(store).isel(float=0)
    actuator, motion = file.actuator, file.motion
    changed = {
        "trim_error": file.trim_error + trim,
        "hull": file.hull.model_copy(update={"psi": file.hull.psi + psi}),
        "actuator": actuator.model_copy(update={"K1": actuator.K1 * pump}),
        "motion": motion.model_copy(update={"K2": motion.K2 / drag, "T2": motion.T2 * mass / drag}),
    }
    other = fly_mission(file.model_copy(update=changed), task, sea, seed=2_000_000, checked=False)
    plain = fly_mission(file, task, sea, seed=2_000_000)
    assert float(found.duration) == pytest.approx(other.duration, rel=1e-9)
    deepest = other.cycles["deepest"] - plain.cycles["deepest"]
    assert np.abs(deepest).max() > 1e-3
    for column, name in (("deepest", "deepest"), ("arrival", "arrival")):
        assert found[name].values == pytest.approx(other.cycles[column], rel=1e-6)


def test_a_pump_that_delivers_less_gives_less_than_the_table(vehicle, column):
    plan = make_plan(vehicle, TASK, column)
    weak = replace(plan, given=plan.given.copy())
    weak.given["delivery"] = 0.8
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


def test_correlated_inputs_go_together_and_are_cut():
    pairs = [{"of": ("psi", "drag"), "value": 0.8}, {"of": ("drag", "mass"), "value": -0.5}]
    spread = Spread(mass=0.1, correlation=pairs)
    many = np.stack([draw(spread, seed=7, number=n, casts=1) for n in range(8000)])
    found = np.corrcoef(many[:, : int(Drawn.CAST)].T)
    assert np.allclose(found, spread.matrix, atol=0.04)  # three sigma
    assert np.std(many[:, Drawn.DRAG]) == pytest.approx(spread.drag, rel=0.05)
    assert np.max(np.abs(many[:, Drawn.DRAG] - 1.0)) <= 3.0 * spread.drag * (1.0 + 1e-12)
    assert spread.groups == [("trim",), ("psi", "drag", "mass"), ("pump",)]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"drag": 2.0}, "drag"),
        ({"correlation": [{"of": ("psi", "psi"), "value": 0.5}]}, "not two inputs"),
        ({"correlation": [{"of": ("psi", "lift"), "value": 0.5}]}, "correlation"),
        (
            {
                "correlation": [
                    {"of": ("psi", "drag"), "value": 0.9},
                    {"of": ("drag", "pump"), "value": 0.9},
                    {"of": ("psi", "pump"), "value": -0.9},
                ]
            },
            "contradict each other",
        ),
    ],
)
def test_what_is_no_spread_is_refused(given, words):
    with pytest.raises(InputError, match=words):
        Spread(**given)


def test_the_spread_identified_is_that_of_drawn_parameters(vehicle):
    """Against a draw of K2 and T2 themselves: mass is T2/K2, the laminar drag 1/K2."""
    K2, T2, psi = 16.0, 20.0, 1e-8
    sigma = np.array([0.02 * K2, 0.03 * T2, 1e-9])
    C = np.outer(sigma, sigma) * np.array([[1.0, 0.7, 0.2], [0.7, 1.0, 0.0], [0.2, 0.0, 1.0]])
    known = Identified(
        names=("K2", "T2", "psi"), values=(K2, T2, psi), covariance=C.tolist(), neutral_std=1e-6
    )
    one = vehicle.model_copy(update={"identified": known})
    found = Spread(pump=0.04).identified(one)
    k, t, p = np.random.default_rng(1).multivariate_normal([K2, T2, psi], C, 200_000).T
    drag, mass = K2 / k, (t / k) / (T2 / K2)
    assert found.drag == pytest.approx(np.std(drag), rel=0.02)
    assert found.mass == pytest.approx(np.std(mass), rel=0.02)
    assert found.psi == pytest.approx(1e-9, rel=1e-9)
    assert (found.trim, found.pump) == (1e-6, 0.04)
    names = ["psi", "drag", "mass"]
    at = [("trim", "psi", "drag", "pump", "mass").index(n) for n in names]
    assert np.allclose(found.matrix[np.ix_(at, at)], np.corrcoef([p, drag, mass]), atol=0.02)
    assert found.groups == [("trim",), ("psi", "drag", "mass"), ("pump",)]
    with pytest.raises(InputError, match="nothing was identified"):
        Spread().identified(vehicle)


def test_a_stopped_campaign_goes_on_to_the_same_store(job, tmp_path):
    whole = flown(job(floats=40, seed=2))
    told = []

    def stop(share):
        told.append(share)
        if share:
            raise KeyboardInterrupt

    again = job(floats=40, seed=2, store=tmp_path / "again" / "campaign.zarr")
    with pytest.raises(KeyboardInterrupt):
        run(again, Workers(workers=1), stop)
    done = again.done()
    assert 1 <= len(done) < again.count
    before = {n: (again.store / "stop" / "c" / str(n)).stat().st_mtime_ns for n in done}
    # what is not flown reads as missing
    with xarray.open_zarr(again.store, chunks=None) as data:
        some = data.flown.values == 1
        assert some.sum() == len(done) * again.layout.chunk
        assert np.array_equal(np.isfinite(data.duration.values), some)
        assert np.array_equal(data.stop.values > 0, some)
    assert flown(again).tobytes() == whole.tobytes()
    assert before == {n: (again.store / "stop" / "c" / str(n)).stat().st_mtime_ns for n in done}
    # and is done when it is asked for again
    shares = []
    assert run(again, Workers(executor="processes"), shares.append)
    assert sum(shares) == 1.0


@pytest.mark.prove
def test_parts_fill_one_store_in_any_order(job, tmp_path):
    one = job(floats=40, seed=2)
    flown(one)
    parts = job(floats=40, seed=2, store=tmp_path / "parts.zarr")
    assert [run(parts, Workers(part=(k, 3))) for k in (3, 1)] == [False, False]
    assert run(parts, Workers(part=(2, 3)))
    names = [p.relative_to(one.store) for p in one.store.rglob("*") if p.is_file()]
    assert len(names) > 100
    for name in names:
        assert (one.store / name).read_bytes() == (parts.store / name).read_bytes(), name
    assert {p.relative_to(parts.store) for p in parts.store.rglob("*") if p.is_file()} == {*names}


def test_what_spreads_is_said_per_cycle_with_its_quantiles(vehicle, column):
    """Of 21 floats of four cycles, and one that did none: 0 to 20 times what one took in each."""
    k = np.arange(21.0)
    table = np.full(22, np.nan, ROW)
    table["cycles"], table["cycles"][21] = 4.0, 0.0
    of_cycles = {
        "pump_runs_per_cycle": 3.0,
        "drive_energy_per_cycle": 2e3,
        "battery_energy_per_cycle": 5e3,
    }
    for fact, each in of_cycles.items():
        table[fact][:21] = each * k
    table["arrival_mean"][:21], table["deepest_of_all"][:21] = 1800.0 * k, 10.0 * k
    given = {"spread": Spread(), "seed": 1, "energy_unknown": ""}
    campaign = Campaign(vehicle=vehicle, mission=TASK, columns=[column], table=table, **given)
    each = {
        "arrives at the first depth in": ("h", 0.5),
        "deepest": ("m", 10.0),
        "pump runs per cycle": ("", 3.0),
        "drive's energy per cycle": ("kJ", 2.0),
        "battery's energy per cycle": ("kJ", 5.0),
    }
    found = {what: row for what, *row in campaign.spreads()}
    assert set(found) == {"cycles", *each}
    for what, (unit, one) in each.items():
        assert found[what] == [unit, *(pytest.approx(n * one) for n in (10.0, 1.0, 19.0))]
    unknown = replace(campaign, energy_unknown="no supply").spreads()
    assert not any("energy" in what for what, *_ in unknown)


def test_a_table_counts_floats_and_casts_from_one(vehicle, column):
    table = np.zeros(3, ROW)
    table["cast"] = 0.0, 2.0, 1.0
    given = {"spread": Spread(), "seed": 1, "energy_unknown": ""}
    campaign = Campaign(vehicle=vehicle, mission=TASK, columns=[column], table=table, **given)
    assert campaign.by_float()["float"].tolist() == [1.0, 2.0, 3.0]
    assert campaign.by_float()["cast"].tolist() == [1.0, 3.0, 2.0]


def test_how_often_each_float_met_the_bottom_and_ice_is_counted(vehicle, column, job):
    """It is grounded on every way down, and turns back for ice until it has to come up."""
    behaviour = {"grounding": {"volume": 8e-6}, "ice": {"temperature": -1.7, "longest": 7200.0}}
    task = {**TASK.model_dump(), "bottom_depth": 50.0, "cycles": 6, **behaviour}
    task["phases"][1]["check_interval"] = 60.0
    mission = Mission(**task)
    water = replace(column, temperature=np.full_like(column.depth, -1.85))
    one = job(mission=mission, columns=[water], floats=2)
    table = flown(one)
    assert np.all(table["cycles"] == 6.0)
    assert np.all(table["grounded_in_all"] >= 6.0)
    assert np.all(table["ice_turns_in_all"] + table["surfaced_under_ice_in_all"] == 6.0)
    assert np.all((table["ice_turns_in_all"] > 0.0) & (table["surfaced_under_ice_in_all"] > 0.0))
    with xarray.open_zarr(one.store, chunks=None) as data:
        came_up = np.isfinite(data.surfaced.values)
        assert np.array_equal(data.surfaced_under_ice.values, came_up.astype(float))
        assert np.array_equal(data.ice_turns.values, (~came_up).astype(float))
        assert np.all(data.grounded.values >= 1.0)
    given = {"spread": Spread(), "seed": 1, "energy_unknown": ""}
    campaign = Campaign(vehicle=vehicle, mission=mission, columns=[water], table=table, **given)
    assert campaign.by_float()["ice_turns"].tolist() == table["ice_turns_in_all"].tolist()
    said = [words for words, *_ in campaign.spreads()]
    assert said[-3:] == ["times grounded", "ice turns", "surfacings under ice"]


def test_the_store_says_what_is_in_it(job):
    one = job(floats=4)
    flown(one)
    with xarray.open_zarr(one.store, chunks=None) as data:
        assert dict(data.sizes) == {"float": 4, "cycle": 2}
        assert data.attrs["Conventions"].startswith("CF-")
        assert data.deepest.dims == ("float", "cycle")
        for name, variable in data.variables.items():
            assert "long_name" in variable.attrs, name
            assert {"units", "flag_meanings"} & set(variable.attrs), name
        assert data.deepest.attrs["standard_name"] == "depth"
        for name in ("stop", "flown"):  # what each number means, as CF has it
            flags = data[name].attrs
            assert len(flags["flag_meanings"].split()) == len({*flags["flag_values"]})
            assert {*data[name].values.tolist()} <= {*flags["flag_values"]}
        assert np.array_equal(
            data["drive_energy_in_all"], one.layout.table()["drive_energy_in_all"]
        )
        assert json.loads(data.attrs["campaign"])["seed"] == one.seed
        assert cf_problems(data) == []  # as netCDF, which its attributes allow
    # the unit of every variable is one that the udunits of CF knows
    from pint import UnitRegistry

    units = UnitRegistry()
    for variable in data.variables.values():
        units.parse_units(
            variable.attrs.get("units", "1").replace(" m-1", "/m").replace("m3", "m**3")
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 2}, "what differs: seed"),
        ({"floats": 5}, "what differs: number of floats"),
        ({"cycles": 1}, "what differs: cycles and duration"),
        ({"spread": Spread(drag=0.2)}, "what differs: spread"),
        ({"mission": TASK.model_copy(update={"start_depth": 5.0})}, "what differs: mission"),
    ],
)
def test_the_store_of_another_campaign_is_refused(change, words, job):
    job(floats=4).create()
    with pytest.raises(InputError, match=words):
        run(job(**{"floats": 4, **change}), Workers())


def test_the_vehicles_own_water_is_no_cast_that_differs(job, vehicle):
    """It follows from the vehicle and how deep the mission goes."""
    other = vehicle.model_copy(update={"water": vehicle.water.model_copy(update={"density": 1020})})
    own = [uniform_column(one.water, 150.0) for one in (vehicle, other)]
    job(floats=4, columns=own[:1]).create()
    with pytest.raises(InputError, match=r"what differs: vehicle\. "):
        job(floats=4, columns=own[1:], vehicle=other).create()
    with pytest.raises(InputError, match=r"what differs: cast\. "):
        job(floats=4, columns=own[1:]).create()


def test_the_store_of_another_version_is_refused(job, monkeypatch):
    job(floats=4).create()
    monkeypatch.setattr("swimbladder.sim.campaign.run.software", lambda: "edited")
    with pytest.raises(InputError, match=r"what differs: version \(this is .*, its source"):
        run(job(floats=4), Workers())


def test_a_folder_that_is_no_store_is_refused(job):
    one = job(floats=4)
    one.store.mkdir(parents=True)
    with pytest.raises(InputError, match="no store of a campaign"):
        run(one, Workers())
    (one.store / "zarr.json").write_text("{}")
    with pytest.raises(InputError, match="no store of a campaign"):
        run(one, Workers())


def test_cycles_without_an_end_are_refused(job):
    up = [{"kind": "descend", "depth": 50.0}, {"kind": "profile", "depth": 20.0}]
    endless = Mission(phases=up, duration=1e6)
    with pytest.raises(InputError, match="cycles"):
        job(floats=4, mission=endless)
    assert job(floats=4, mission=endless, cycles=3).layout.cycles == 3
    # a year of cycles of at least 1500 s
    assert job(floats=4, cycles=None, duration=15e3, mission=TASK).layout.cycles == 2
    long = TASK.model_copy(update={"cycles": None, "duration": 15e3})
    assert job(floats=4, mission=long).layout.cycles == 11


def test_a_job_travels_without_its_plans(job):
    one = job(floats=40)
    one.create()
    there = pickle.loads(pickle.dumps(one))
    assert "plans" not in vars(there)
    assert there.name == one.name
    there.do(0)
    assert one.done() == {0}


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
    assert "--trim-std" in said
    assert "-2 cm3" in said
    assert main(["campaign", "example-float", "m.toml", "--part", "3 of 4"]) == 2
    assert "--part" in capsys.readouterr().err


def test_a_cycle_that_the_battery_does_not_last_for_is_in_no_mean_of_a_cycle(vehicle, job):
    short = vehicle.replace({"supply.capacity": "1.5 Wh"})
    one = job(floats=1, vehicle=short, spread=Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0))
    row = flown(one)[0]
    assert (row["stop"], row["cycles"]) == (Stop.BATTERY_EMPTY, 1.0)
    with xarray.open_zarr(one.store, chunks=None) as data:
        for name in ("drive_energy", "battery_energy", "pump_runs"):
            whole, begun = data[name][0].values
            assert row[f"{name}_per_cycle"] == whole
            assert row[f"{name}_in_all"] == pytest.approx(whole + begun, rel=1e-12)
            assert begun > 0.0
