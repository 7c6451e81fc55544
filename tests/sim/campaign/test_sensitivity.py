"""Sobol indices: against functions and a mission whose indices are known in closed form."""

import json

import numpy as np
import pytest
from scipy.stats import norm

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.jobs import Workers, run
from swimbladder.physics.seawater import uniform_column
from swimbladder.show.campaign import draw_sensitivity
from swimbladder.show.static import figure
from swimbladder.sim.campaign.result import Sensitivity
from swimbladder.sim.campaign.run import Design, Drawn, Floats, indices
from swimbladder.vehicle.spread import Spread

THREE = Spread(trim=1.0, psi=1.0, drag=0.3, pump=0.0)


def designed(spread, *, floats, casts=1, noisy=False):
    design = Design.of(spread, casts=casts, noisy=noisy, seed=5, floats=floats)
    drawn = np.array([design.drawn(n)[0] for n in range(design.floats)])
    return design, drawn


def found_for(design, values):
    return dict(zip(design.names, indices(values.reshape(design.rows, design.width)), strict=True))


def ishigami(drawn):
    z = drawn[:, [Drawn.TRIM, Drawn.PSI]], (drawn[:, Drawn.DRAG] - 1.0) / 0.3
    x = np.pi * (2.0 * norm.cdf(np.column_stack(z)) - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


# Ishigami and Homma, 1990: variances of x1 alone, x2 alone, and x1 with x3.
V1 = 0.5 * (1.0 + 0.1 * np.pi**4 / 5.0) ** 2
V2, V13 = 49.0 / 8.0, 0.01 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
V = V1 + V2 + V13


def test_ishigami():
    """Draws of the floats, turned into uniform numbers; 3 sigma cut 0.3 % of them."""
    design, drawn = designed(THREE, floats=5 * 4096)
    assert design.rows == 4096
    found = found_for(design, ishigami(drawn))
    right = {
        "trim": (V1 / V, (V1 + V13) / V),
        "psi": (V2 / V, V2 / V),
        "drag": (0.0, V13 / V),
    }
    for name, (first, total) in right.items():
        one = found[name]
        assert one.first == pytest.approx(first, abs=0.02), name
        assert one.total == pytest.approx(total, abs=0.02), name
        assert one.first_ci95[0] <= first <= one.first_ci95[1]
        assert one.total_ci95[0] - 0.005 <= total <= one.total_ci95[1] + 0.005


def test_ishigami_of_two_inputs_together():
    """The group of x1 and x3 takes what they do together; correlated by next to nothing here."""
    pair = [{"of": ("trim", "drag"), "value": 1e-9}]
    design, drawn = designed(Spread(**{**THREE.model_dump(), "correlation": pair}), floats=4 * 4096)
    assert design.names == ["trim and drag", "psi"]
    found = found_for(design, ishigami(drawn))
    for name, share in (("trim and drag", (V1 + V13) / V), ("psi", V2 / V)):
        assert found[name].first == pytest.approx(share, abs=0.02)
        assert found[name].total == pytest.approx(share, abs=0.02)


def test_correlated_inputs_of_a_sum():
    """Of y = a + b + c with a, b correlated by r the group has (2 + 2 r) of (3 + 2 r)."""
    r = 0.6
    spread = Spread(
        trim=1.0, psi=1.0, drag=0.0, pump=0.3, correlation=[{"of": ("trim", "psi"), "value": r}]
    )
    design, drawn = designed(spread, floats=4 * 2048)
    y = drawn[:, Drawn.TRIM] + drawn[:, Drawn.PSI] + (drawn[:, Drawn.PUMP] - 1.0) / 0.3
    found = found_for(design, y)
    share = (2.0 + 2.0 * r) / (3.0 + 2.0 * r)
    assert found["trim and psi"].first == pytest.approx(share, abs=0.02)
    assert found["trim and psi"].total == pytest.approx(share, abs=0.02)
    assert found["pump"].total == pytest.approx(1.0 - share, abs=0.02)


def test_noise_and_water_are_inputs_like_the_others():
    """y = cast + a share of noise; drag spreads and changes nothing."""
    design, drawn = designed(
        Spread(trim=0.0, psi=0.0, pump=0.0), floats=5 * 2048, casts=2, noisy=True
    )
    assert design.names == ["drag", "cast", "sensor noise"]
    assert set(drawn[:, Drawn.CAST]) == {0.0, 1.0}
    seeds = np.array([design.drawn(n)[1] for n in range(design.floats)])
    noise = np.random.default_rng(1).normal(0.0, 0.5, seeds.max() + 1)[seeds]  # as cast's
    found = found_for(design, drawn[:, Drawn.CAST] + noise)
    for name, share in (("drag", 0.0), ("cast", 0.5), ("sensor noise", 0.5)):
        assert found[name].first == pytest.approx(share, abs=0.05)
        assert found[name].total == pytest.approx(share, abs=0.05)


def test_one_input_alone_has_it_all():
    design, drawn = designed(Spread(trim=0.0, psi=0.0, pump=0.0), floats=3 * 1024)
    (one,) = found_for(design, drawn[:, Drawn.DRAG]).values()
    assert one.first == pytest.approx(1.0, abs=0.02)
    assert one.total == pytest.approx(1.0, abs=0.02)


def test_rows_of_a_design_differ_in_one_group_only():
    design, drawn = designed(Spread(mass=0.1), floats=8 * 16, casts=3)
    rows = drawn.reshape(design.rows, design.width, -1)
    places = [Drawn.TRIM, Drawn.PSI, Drawn.DRAG, Drawn.PUMP, Drawn.MASS, Drawn.CAST]
    assert [group for group in design.groups] == [
        ("trim",),
        ("psi",),
        ("drag",),
        ("pump",),
        ("mass",),
        ("cast",),
    ]
    for k, place in enumerate(places):
        right = rows[:, 0].copy()
        right[:, place] = rows[:, 1, place]
        assert np.array_equal(rows[:, 2 + k], right)


@pytest.mark.parametrize(
    ("spread", "floats", "words"),
    [
        (Spread(), 50, "too few floats"),
        (Spread(trim=0.0, psi=0.0, drag=0.0, pump=0.0), 5000, "nothing spreads"),
    ],
)
def test_designs_that_say_nothing_are_refused(spread, floats, words):
    with pytest.raises(InputError, match=words):
        Design.of(spread, casts=1, noisy=False, seed=1, floats=floats)


@pytest.mark.parametrize("groups", [1, 2, 3])
def test_a_design_takes_sixteen_rows_and_no_float_more_than_there_are(groups):
    spread = Spread(trim=1e-5, psi=1e-7 * (groups > 1), drag=0.1 * (groups > 2), pump=0.0)
    given = dict(casts=1, noisy=False, seed=1)
    fewest = 16 * (2 + groups)
    assert Design.of(spread, floats=fewest, **given).floats == fewest
    assert Design.of(spread, floats=2 * fewest - 1, **given).floats == fewest
    with pytest.raises(InputError, match="too few floats"):
        Design.of(spread, floats=fewest - 1, **given)


@pytest.fixture(scope="module")
def parked(tmp_path_factory):
    """Floats that begin neutral at 60 m, and are left alone there."""
    vehicle = load_vehicle("example-float")
    quiet = vehicle.sensors.model_copy(update={"depth_noise": 0.0})
    # so heavy that the upper end of its stroke is always the nearer one
    still = vehicle.model_copy(update={"sensors": quiet, "trim_error": 1e-4})
    phases = [{"kind": "park", "depth": 60.0, "tolerance": 30.0, "duration": 600.0}]
    job = Floats(
        vehicle=still,
        mission=Mission(start_depth=60.0, phases=phases, cycles=1),
        columns=[uniform_column(vehicle.water, 150.0)],
        floats=5 * 512,
        seed=4,
        spread=Spread(trim=5e-6, psi=5e-8, drag=0.1, pump=0.0),
        sensitivity=True,
        store=tmp_path_factory.mktemp("parked") / "campaign.zarr",
    )
    assert run(job, Workers())
    return Sensitivity(
        design=job.design, table=job.layout.table(), energy_unknown="", asked=job.floats
    )


@pytest.mark.prove
def test_the_stroke_margin_of_a_float_that_rests(parked):
    """Its neutral volume is trim + psi z more, which leaves so much less above: linear in both."""
    (one,) = [o for o in parked.outputs if o.name == "stroke margin"]
    found = dict(zip(parked.design.names, one.indices, strict=True))
    a, b = 5e-6**2, (60.0 * 5e-8) ** 2
    for name, share in (("trim", a / (a + b)), ("psi", b / (a + b)), ("drag", 0.0)):
        assert found[name].first == pytest.approx(share, abs=0.03), name
        assert found[name].total == pytest.approx(share, abs=0.03), name
        assert found[name].total_ci95[0] <= found[name].total <= found[name].total_ci95[1]
    assert one.std == pytest.approx((a + b) ** 0.5, rel=0.03)
    assert {o.name: o.why for o in parked.outputs}["failed flights"] == (
        "it is the same in all flights"
    )


@pytest.mark.prove
def test_outputs_that_some_flights_lack_have_no_indices_and_say_so(parked):
    table = parked.table.copy()
    table["arrival_mean"][::9] = np.nan
    table["phases_missed_in_all"][::9] = 1.0
    some = Sensitivity(design=parked.design, table=table, energy_unknown="no motor", asked=9)
    found = {one.name: one for one in some.outputs}
    assert "energy per cycle" not in found
    lost = len(table[::9])
    assert found["time to depth"].why.startswith(f"{lost} of {len(table)} flights have none")
    assert found["time to depth"].indices == ()
    assert found["failed flights"].indices
    assert found["failed flights"].mean == pytest.approx(1.0 / 9.0, abs=0.05)
    figure(draw_sensitivity(some))


@pytest.mark.prove
def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(
        "schema_version = 1\ncycles = 1\n[[phases]]\nkind = 'descend'\ndepth = 50\n"
        "[[phases]]\nkind = 'surface'\nduration = 60\n"
    )
    (tmp_path / "s.toml").write_text(
        "schema_version = 1\ntrim = '3 cm3'\npsi = 0\npump = 0\n"
        "[[correlation]]\nof = ['trim', 'drag']\nvalue = 0.5\n"
    )
    asked = ["campaign", "example-float", "m.toml", "--sensitivity", "--spread", "s.toml"]
    assert main([*asked, "--floats", "60", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["spread"]["trim"] == 3e-6
    found = answer["sensitivity"]
    assert found["inputs"] == [["trim", "drag"]]
    assert found["floats"] == found["good"] == 48
    assert found["asked"] == 60
    assert answer["floats"] == 32  # those that are independent
    outputs = {one["what"]: one for one in found["outputs"]}
    # all of the variance is the group's
    (energy,) = outputs["energy per cycle"]["indices"]
    assert energy["total"] == pytest.approx(1.0, abs=0.3)
    assert energy["first_ci95"][0] < energy["first"] < energy["first_ci95"][1]
    assert (tmp_path / "swimbladder-campaign" / "sensitivity.png").stat().st_size > 10_000
    assert main([*asked, "--floats", "60"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith(
        "48 of the 60 floats asked for were flown, 16 (a power of 2) rows of 3: 48 did every phase"
        " of every cycle. Counts, shares and numbers are of the 32 drawn independently, two of each"
        " row. output comes from first order 95 % total 95 % energy per cycle"
    )
    assert main([*asked, "--floats", "60", "--drag-std", "0"]) == 2
    assert "spread" in capsys.readouterr().err  # the store of another campaign
    assert main(["campaign", "example-float", "m.toml", "--identified", "--out", "x"]) == 2
    assert "--identified: nothing was identified" in capsys.readouterr().err


@pytest.mark.prove
def test_the_command_says_no_where_a_float_of_the_design_failed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(
        "schema_version = 1\ncycles = 1\n[[phases]]\nkind = 'descend'\ndepth = 50\n"
        "timeout = '12 min'\n[[phases]]\nkind = 'surface'\nduration = 60\n"
    )
    asked = ["campaign", "example-float", "m.toml", "--sensitivity", "--floats", "100"]
    assert main([*asked, "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    found = answer["sensitivity"]
    assert (found["asked"], found["floats"], answer["floats"]) == (100, 96, 32)
    assert answer["good"] <= found["good"] < 96
    assert main(asked) == 1
    assert f": {found['good']} did every phase" in " ".join(capsys.readouterr().out.split())
