"""Every answer says itself in a few lines, is plain values, and has a picture that can be drawn."""

import importlib
import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import swimbladder as sb
from swimbladder.errors import NoAnswerError
from swimbladder.io.answers import Answer, json_text
from swimbladder.show import answers
from swimbladder.show.report.html import _made_by
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
    return sb.campaign(job, sb.Workers(count=1))


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


def test_every_answer_has_words_and_a_picture_that_there_are():
    found = {one.__name__: one for one in subclasses()}
    assert set(found) == set(answers._ANSWERS)
    for name, how in answers._ANSWERS.items():
        own = {*dir(found[name]), *found[name].__dataclass_fields__}
        assert how.words or "sentences" in own, name
        assert not (how.files and how.writes), name
        for path in filter(None, how):
            module, _, function = path.rpartition(".")
            assert callable(getattr(importlib.import_module(f"swimbladder.{module}"), function))


@pytest.mark.parametrize("name", MADE)
def test_an_answer_is_short_plain_and_drawn(name, tmp_path):
    answer = MADE[name](tmp_path)
    assert type(answer).__name__ == name
    lines = repr(answer).splitlines()
    assert lines[0] == name
    assert 2 <= len(lines) <= 15
    assert max(map(len, lines)) <= 100
    assert answer._repr_html_().startswith(f"<div><b>{name}</b><ul><li>")
    assert json.loads(json_text(answer.to_dict()))
    assert name not in ("Energy", "FaultResult") or json.dumps(answer.to_dict())
    figure = answer.plot()
    assert isinstance(figure, Figure)
    assert any(axes.get_xlabel().endswith("]") for axes in figure.axes)
    paths = answer.save(tmp_path / "saved")
    assert paths
    for path in paths:
        assert path.is_file()
        assert path.is_relative_to(tmp_path / "saved")
    numbers = [path for path in paths if path.suffix == ".json" and path.parent.name == "saved"]
    said = [json.loads(path.read_text()) for path in numbers]
    assert name == "Library" or json.loads(json_text(answer.to_dict())) in said


def test_what_was_not_asked_for_is_no_picture_but_said():
    found = sb.stability("feup-em", depths=(0.0, 5.0), maps=False)
    with pytest.raises(NoAnswerError, match="no maps were asked for"):
        found.plot()
    too_deep = sb.simulate(
        "feup-em", setpoints=[(0.0, 3.0)], duration=20.0, start_depth=1.0, start_speed=50.0
    )
    assert "It passed the 100 m that it is rated for." in repr(too_deep)


def test_a_long_answer_is_cut_and_says_so():
    class Long(Answer):
        sentences = tuple(f"line {n}, " + "and a word " * 12 for n in range(30))

    answers._ANSWERS["Long"] = answers._Shown()
    try:
        lines = repr(Long()).splitlines()
        assert len(lines) == 15
        assert lines[-1].startswith("... (")
        assert lines[-1].endswith(" lines more)")
        with pytest.raises(NoAnswerError, match="has no picture"):
            Long().plot()
    finally:
        del answers._ANSWERS["Long"]


def test_a_page_says_how_it_was_made():
    assert _made_by("swimbladder tune a&b") == "by <code>swimbladder tune a&amp;b</code>"
    assert _made_by("") == "from Python"
