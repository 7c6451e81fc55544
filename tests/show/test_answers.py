"""Every answer says itself in a few lines, is plain values, and has a picture that can be drawn."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import swimbladder as sb
from swimbladder.design.pool_day import paper_tasks
from swimbladder.design.pool_day.day import asked_of, rules_of
from swimbladder.design.pool_day.verdict import Asked
from swimbladder.errors import NoAnswerError
from swimbladder.io.answers import Answer, json_text
from swimbladder.physics.dynamics import drag_force
from swimbladder.show import answers
from swimbladder.show.answers import dataset_of, split
from swimbladder.show.html import TEXTS, _made_by
from swimbladder.show.parts import Shown
from tests.cf import cf_problems
from tests.pages import figures_of, without_scripts
from tests.vehicles import limited

STEP = {"setpoints": [(0.0, 3.0)], "duration": 60.0, "start_depth": 1.5}
DIVE = sb.Mission(
    phases=[
        {"kind": "park", "depth": 40.0, "tolerance": 5.0, "duration": 1800.0},
        {"kind": "surface", "duration": 60.0},
    ]
)


def campaign(folder):
    floater = sb.load_vehicle("example-float")
    columns = [sb.water_of(floater, DIVE)]
    job = sb.Floats(vehicle=floater, mission=DIVE, columns=columns, floats=3, store=folder / "a")
    return sb.campaign(job, sb.Workers(workers=1))


MADE = {
    "Solution": lambda _: sb.simulate(sb.load_vehicle("feup-em"), **STEP),
    "Analysis": lambda _: sb.analyse(sb.load_vehicle("feup-em")),
    "Ballasting": lambda _: sb.ballast(sb.load_vehicle("example-float")),
    "Energy": lambda _: sb.energy(sb.load_vehicle("example-eh")),
    "MissionResult": lambda _: sb.mission(sb.load_vehicle("example-float"), DIVE),
    "Campaign": campaign,
    "Library": lambda _: sb.firmware(limited(sb.load_vehicle("feup-em")), duration=30.0),
    "FaultResult": lambda _: sb.faults(limited(sb.load_vehicle("feup-em")), missions=3, healthy=2),
}


def subclasses():
    for package in ("codegen", "design", "estimation", "sim"):
        root = Path(sb.__file__).parent
        for path in sorted((root / package).rglob("*.py")):
            if "(Answer)" in path.read_text() or ", Answer)" in path.read_text():
                parts = path.relative_to(root).with_suffix("").parts
                importlib.import_module(".".join(("swimbladder", *parts)))
    return Answer.__subclasses__()


def test_every_answer_is_shown_in_one_place():
    found = {one.__name__: one for one in subclasses()}
    assert {*found, "Vehicle"} == set(answers.ROOMS)
    for name, room in answers.ROOMS.items():
        module = importlib.import_module(f"swimbladder.show.{room}")
        shown = getattr(module, f"{name}Shown")
        assert shown.name
        assert shown.parts is not Shown.parts
        if name == "Vehicle":  # below all answers, and a file of its own
            continue
        own = {*dir(found[name]), *found[name].__dataclass_fields__}
        assert shown.table is not Shown.table or "columns" in own or name == "BoardAnswer"


@pytest.mark.parametrize("name", MADE)
def test_an_answer_is_short_plain_and_drawn(name, tmp_path):
    answer = MADE[name](tmp_path)
    assert type(answer).__name__ == name
    lines = repr(answer).splitlines()
    assert lines[0] == name
    assert 2 <= len(lines) <= 15
    assert max(map(len, lines)) <= 100
    assert answer._repr_html_().startswith(f"<div><b>{name}</b><ul><li>")
    assert json.loads(json.dumps(answer.to_dict(), allow_nan=False))
    figure = answer.plot()
    assert isinstance(figure, Figure)
    assert any(axes.get_xlabel().endswith("]") for axes in figure.axes)
    _check_tables(answer)
    page = answer.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert figures_of(page)
    assert len(page) < 3_000_000
    assert not re.search(r"(?:src|href)=|https?://", re.sub("<li><a.*", "", without_scripts(page)))
    paths = answer.save(tmp_path / "saved")
    assert paths[0] == tmp_path / "saved/report.html"
    for path in paths:
        assert path.is_file()
        assert path.is_relative_to(tmp_path / "saved")
    numbers = [path for path in paths if path.suffix == ".json" and path.parent.name == "saved"]
    said = [json.loads(path.read_text()) for path in numbers]
    assert json.loads(json_text(answer.to_dict())) in said


def test_an_answer_is_plain_values_whatever_it_is_made_of():
    class Made(Answer):
        def to_dict(self):
            """Return numbers as numpy has them."""
            return {"depth_m": np.arange(2.0), "least_m": np.float64(1.5), "z": (np.nan, {1: 2})}

    assert Made().to_dict() == {"depth_m": [0.0, 1.0], "least_m": 1.5, "z": [None, {"1": 2}]}
    assert Made.to_dict.__doc__ == "Return numbers as numpy has them."


def _check_tables(answer):
    """A table has a unit for each array, which the dataset has too, along one dimension."""
    frame, found = answer.to_dataframe(), answer.to_dataset()
    assert len(frame) > 0
    units = frame.attrs["units"]
    assert set(units) <= set(frame)
    assert all(re.fullmatch(r"[A-Za-z]+[0-9]?( [A-Za-z]+-[1-9])?", unit) for unit in units.values())
    assert len(found.sizes) == 1
    (size,) = found.sizes.values()
    assert size == len(frame)
    assert {array.attrs["units"] for array in found.values() if "units" in array.attrs}
    assert cf_problems(found) == []


@pytest.mark.parametrize(
    ("column", "name", "unit"),
    [
        ("depth_m", "depth", "m"),
        ("volume_rate_m3_s", "volume_rate", "m3 s-1"),
        ("density_kg_m3", "density", "kg m-3"),
        ("energy_per_volume_J_m3", "energy_per_volume", "J m-3"),
        ("temperature_degC", "temperature", "degC"),
        ("phases_missed", "phases_missed", ""),
        ("m", "m", ""),
    ],
)
def test_a_column_says_its_unit(column, name, unit):
    assert dict(split([column])) == {column: (name, unit)}


def test_a_table_lies_along_its_first_column_where_that_rises():
    s = sb.simulate("feup-em", **STEP)
    frame = s.to_dataframe()
    assert np.array_equal(frame["depth_m"], s.depth)
    assert np.array_equal(s.to_dataset()["depth"], s.depth)
    plain = dataset_of(frame, "a step")
    assert plain["depth"].dims == ("time",)
    assert (plain["depth"].attrs["long_name"], plain["depth"].attrs["units"]) == ("depth", "m")
    assert np.array_equal(plain["time"], s.time)
    found = sb.analyse("feup-em")
    response = found.to_dataframe()
    system = found.to_control()
    at = response["frequency_rad_s"].to_numpy()
    expected = np.abs(system(1j * at)[system.output_index["z"], 0])
    assert response["gain"].to_numpy() == pytest.approx(expected, rel=1e-6)


def test_a_page_says_where_the_answer_is_no(tmp_path):
    deep = sb.simulate(
        "feup-em", setpoints=[(0.0, 3.0)], duration=20.0, start_depth=1.0, start_speed=50.0
    )
    fine = sb.simulate("feup-em", **STEP)
    pages = [one.report(tmp_path / "page.html").read_text("utf-8") for one in (deep, fine)]
    assert ["The answer is no." in page for page in pages] == [True, False]
    assert all("<title>feup-em: simulation</title>" in page for page in pages)
    assert all("Depth, volume and drive." in page for page in pages)


def test_a_vehicle_has_a_page_and_a_picture(tmp_path):
    for name in sb.preset_names():
        v = sb.load_vehicle(name)
        assert v._repr_html_().startswith("<div><b>Vehicle</b><ul><li>")
        page = v.report(tmp_path / f"{name}.html").read_text("utf-8")
        traces = figures_of(page)["reach"]["data"]
        (neutral,) = (one for one in traces if one["name"] == "neutral")
        at = dict(zip(neutral["y"], neutral["x"], strict=True))
        depth = max(at)
        assert at[depth] == pytest.approx(1e6 * v.neutral_volume(depth), rel=1e-4)
        (speed,) = (one for one in traces if one["name"] in ("terminal speed", "sinking"))
        volume, fast = 1e-6 * speed["x"][-1], 0.01 * speed["y"][-1]
        # at its terminal speed the drag is the weight of that volume of water
        assert drag_force(v.drag, fast) == pytest.approx(v.water.specific_weight * volume, rel=1e-4)
        rows = re.findall(r"<td><code>([^<]+)</code></td>", page)
        assert {"water.density", "stroke.minimum", "hull.psi"} <= set(rows)
    assert isinstance(v.plot(), Figure)
    source = "section 3.1: 0.444 mm/s/V"
    page = sb.load_vehicle("feup-em").report(tmp_path / "page.html").read_text("utf-8")
    assert source in page
    changed = sb.load_vehicle("feup-em").replace({"motion.K2": 6500.0})
    assert "set by hand" in changed.report(tmp_path / "page.html").read_text("utf-8")


def test_the_page_of_a_firmware_has_its_golden_trace_and_what_is_watched(tmp_path):
    made = MADE["Library"](None)
    page = made.report(tmp_path / "page.html").read_text("utf-8")
    figure = figures_of(page)["golden"]
    (depth,) = (one for one in figure["data"] if one["name"] == "measured")
    flown, after = np.split(np.array(depth["y"], float), [len(made.golden.depth)])
    assert flown == pytest.approx(made.golden.depth, rel=1e-5)
    assert np.isnan(after).all()  # the sensor is out
    assert figure["layout"]["yaxis3"]["ticktext"] == ["watches", "depth missing"]
    for said in ("depth impossible", "ticks lost", "SHA-256", "swb_cascade.c", "250 B + 135 B"):
        assert said in page


def test_what_a_law_takes_of_a_board_is_as_measured():
    page = (Path(__file__).parents[2] / "docs/reference/boards.md").read_text("utf-8")
    form = r"^\| ([a-z-]+) \| \d+ \| (\d+) \| (\d+) \+ (\d+) \| (\d+) \| (\d+) \| (\d+) \|"
    listed = {name: [*map(int, x)] for name, *x in re.findall(form, page, re.MULTILINE)}
    assert listed == TEXTS["boards"]


def test_a_day_at_the_pool_has_a_page_before_it_begins(tmp_path):
    v = sb.load_vehicle("feup-em")
    day = sb.PoolDay(
        v,
        tmp_path,
        rules=rules_of(v, bottom_depth=4.5),
        tasks=paper_tasks(v, bottom_depth=4.5),
        asked=asked_of(v, Asked()),
        mode="followed",
    )
    assert "No experiment yet" in repr(day)
    page = day.report(tmp_path / "page.html").read_text("utf-8")
    assert "The answer is no." not in page
    traces = figures_of(page)["precision"]["data"]
    ours = {one["name"]: one["y"] for one in traces if one["name"].endswith("expected")}
    # as `design_experiment` has the paper's eight, in a pool that is as deep
    settings = {
        "bottom_depth": 4.5,
        "depth_noise": 2e-3,
        "settling": 300.0,
        "max_moves": 1,
        "rest": 3.0,
    }
    theirs = sb.design_experiment(v, **settings, max_experiments=1).against.prediction.share
    for name, share in theirs.items():
        assert ours[f"{name}, expected"][-1] == pytest.approx(100.0 * share, rel=0.15)
    assert [path.name for path in day.save(tmp_path / "kept")] == [
        "report.html",
        "pool.json",
        "plan.png",
        "precision.png",
    ]


def test_the_page_of_a_plan_names_the_vehicle(tmp_path):
    page = sb.plan("feup-em", (1.5, 2.0)).report(tmp_path / "page.html").read_text("utf-8")
    assert "<title>feup-em: plan</title>" in page


def test_what_was_not_asked_for_is_no_picture_but_said():
    found = sb.stability("feup-em", depth_range=(0.0, 5.0), maps=False)
    with pytest.raises(NoAnswerError, match="no maps were asked for"):
        found.plot()
    too_deep = sb.simulate(
        "feup-em", setpoints=[(0.0, 3.0)], duration=20.0, start_depth=1.0, start_speed=50.0
    )
    assert "It passed the 100 m that it is rated for." in repr(too_deep)


def test_a_long_answer_is_cut_and_says_so(monkeypatch):
    class Long(Answer):
        pass

    class LongShown(Shown[Long]):
        def parts(self):
            return [f"line {n}, " + "and a word " * 12 for n in range(30)]

    monkeypatch.setattr(answers, "shown", LongShown)
    lines = repr(Long()).splitlines()
    assert len(lines) == 15
    assert lines[-1].startswith("... (")
    assert lines[-1].endswith(" lines more)")
    with pytest.raises(NoAnswerError, match="has no picture"):
        Long().plot()
    with pytest.raises(NoAnswerError, match="has no table"):
        Long().to_dataframe()


def test_a_page_says_how_it_was_made():
    assert _made_by("swimbladder tune a&b") == "by <code>swimbladder tune a&amp;b</code>"
    assert _made_by("") == "from Python"
