"""``swimbladder vehicle list|show|new|set``."""

import json
import math

import pytest

from swimbladder.cli import main
from swimbladder.control.registry import bind
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_names, preset_text
from swimbladder.io.vehicle_file import KINDS, vehicle_start, vehicle_template


def answer(capsys, *arguments):
    assert main([*arguments, "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return json.loads(captured.out)


def test_list_has_every_preset(capsys):
    found = answer(capsys, "vehicle", "list")["vehicles"]
    assert [v["name"] for v in found] == preset_names()
    assert {"name": "feup-em", "kind": "identified"}.items() <= next(
        v for v in found if v["name"] == "feup-em"
    ).items()
    assert main(["vehicle", "list"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in preset_names())


def test_show_prints_the_file_itself(capsys):
    assert main(["vehicle", "show", "feup-em", "--full"]) == 0
    captured = capsys.readouterr()
    assert captured.out == preset_text("feup-em")
    assert "mass that is accelerated" in captured.err
    assert main(["vehicle", "show", "feup-em"]) == 0
    assert "mass that is accelerated" in capsys.readouterr().out


def test_show_gives_numbers_units_and_what_follows(capsys):
    shown = answer(capsys, "vehicle", "show", "feup-em")
    assert shown["parameters"]["actuator.K1"] == {"value": 4.44e-4, "unit": "m/s/V"}
    assert shown["parameters"]["trim_error"] == {"value": 0.0, "unit": "m3"}
    # Table 3, from dm3 to m3
    assert shown["parameters"]["controller.parameters.k_pV"] == {"value": 1.002e6, "unit": "V/m3"}
    assert shown["parameters"]["controller.parameters.k_dz"]["value"] == -2.341e-3
    assert shown["provenance"]["actuator.T1"].startswith("section 3.1")
    derived = {name: entry["value"] for name, entry in shown["derived"].items()}
    # eqs (28)-(29), (23): m = rho g T2/K2, K1 A; psi z at the rating and where it meets the stroke
    assert derived["mass_kg"] == pytest.approx(9806.65 * 36.3 / 7935.54, rel=1e-12)
    assert derived["K1A_m3_s_V"] == pytest.approx(4.44e-4 * 0.0075, rel=1e-12)
    assert derived["K2_1_m2_s"] == pytest.approx(7935.54, rel=1e-12)
    assert derived["T2_s"] == pytest.approx(36.3, rel=1e-12)
    assert derived["neutral_volume_limit_m3"] == pytest.approx(4.04e-4, rel=1e-12)
    assert derived["neutral_depth_limit_m"] == pytest.approx(350e-6 / 4.04e-6, rel=1e-12)


def test_show_writes_a_page_where_it_is_asked_for(capsys, tmp_path):
    shown = answer(capsys, "vehicle", "show", "feup-em", "--out", str(tmp_path))
    paths = [tmp_path / name for name in ("report.html", "vehicle.json", "reach.png")]
    assert shown.pop("files") == [str(path) for path in paths]
    assert all(path.is_file() for path in paths)
    assert json.loads(paths[1].read_text("utf-8")) == shown
    assert main(["vehicle", "show", "feup-em", "--full", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert captured.out == preset_text("feup-em")
    assert "report.html" in captured.err


def test_show_of_every_preset_and_of_a_file(capsys, tmp_path):
    for name in preset_names():
        assert answer(capsys, "vehicle", "show", name)["name"] == name
    path = tmp_path / "mine.toml"
    path.write_text(preset_text("feup-em").replace('"feup-em"', '"mine"', 1), encoding="utf-8")
    assert answer(capsys, "vehicle", "show", str(path))["name"] == "mine"


@pytest.mark.parametrize("kind", KINDS)
def test_new_writes_a_file_that_loads(capsys, tmp_path, kind):
    path = tmp_path / "float.toml"
    made = answer(capsys, "vehicle", "new", str(path), "--kind", kind)
    assert made == {"kind": kind, "files": [str(path)]}
    vehicle = load_vehicle(path)
    assert (vehicle.name, vehicle.actuator.kind) == ("float", kind)
    assert answer(capsys, "vehicle", "show", str(path))["kind"] == kind


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_file_is_short_and_has_every_field_with_full(tmp_path, kind):
    short, full = tmp_path / "my.toml", tmp_path / "whole.toml"
    assert main(["vehicle", "new", str(short), "--kind", kind]) == 0
    assert main(["vehicle", "new", str(full), "--kind", kind, "--full"]) == 0
    text = short.read_text("utf-8")
    assert text.count("\n") <= (60 if kind == "pump-valve" else 45)
    assert full.read_text("utf-8") == vehicle_template(kind, name="whole")
    every = [line.partition("#")[2].strip() for line in text.splitlines() if line.startswith("[")]
    assert all(every)  # each table says where its numbers come from
    own, whole = load_vehicle(short), load_vehicle(full)
    assert own.supervisor.time_limit > 3600.0
    same = {"name": "", "description": "", "supervisor": own.supervisor}
    assert own.model_copy(update=same) == whole.model_copy(update=same)


@pytest.mark.parametrize("kind", ["electromechanical", "identified", "positioner"])
def test_a_new_file_takes_a_piston_by_diameter_and_stroke(tmp_path, kind):
    path = tmp_path / "my.toml"
    size = ["--piston-diameter", "60 mm", "--piston-stroke", "10 cm"]
    assert main(["vehicle", "new", str(path), "--kind", kind, *size]) == 0
    v, area = load_vehicle(path), math.pi / 4.0 * 0.06**2
    assert 'piston_area = "diameter 60 mm"' in path.read_text("utf-8")
    assert v.piston_area == pytest.approx(area)
    assert v.stroke.maximum - v.stroke.minimum == pytest.approx(0.1 * area, rel=1e-5)
    before = load_vehicle_text(tmp_path, vehicle_start(kind))
    own, old = (bind(one.controller)[1] for one in (v, before))
    if kind == "positioner":
        assert own.piston_area == pytest.approx(area, rel=1e-5)
        assert own.position_max == pytest.approx(0.045)
    else:  # the loop is as fast
        assert own.k_pV * v.piston_area == pytest.approx(old.k_pV * before.piston_area, rel=1e-3)


def load_vehicle_text(folder, text):
    path = folder / "text.toml"
    path.write_text(text, encoding="utf-8")
    return load_vehicle(path)


def test_a_piston_is_an_area_or_a_diameter_in_python_too():
    v = load_vehicle("feup-em")
    changed = v.replace({"actuator.piston_area": "diameter 6 cm"})
    assert changed.piston_area == pytest.approx(math.pi / 4.0 * 0.06**2)
    for wrong in ("diameter 6 kg", "diameter", "about diameter 6 cm"):
        with pytest.raises(InputError):
            v.replace({"actuator.piston_area": wrong})


def test_new_takes_the_kind_as_name_and_does_not_overwrite_unasked(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", "new", "--kind", "unified"]) == 0
    path = tmp_path / "unified.toml"
    path.write_text("mine")
    assert main(["vehicle", "new", "--kind", "unified"]) == 2
    assert "--force" in capsys.readouterr().err
    assert path.read_text() == "mine"
    assert main(["vehicle", "new", "--kind", "unified", "--force"]) == 0
    assert load_vehicle(path).actuator.kind == "unified"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["show", "feup"], "Did you mean feup-em?"),
        (["show", "none.toml"], "there is no such file"),
        (["new", "x.toml", "--kind", "electro"], "Choose from electromechanical, "),
        (["new", "none/x.toml"], "cannot write the file"),
        (
            ["new", "x.toml", "--kind", "unified", "--piston-diameter", "6 cm"],
            "--piston-diameter: this kind",
        ),
        (
            ["new", "x.toml", "--kind", "pump-valve", "--piston-stroke", "6 cm"],
            "--piston-stroke: this kind",
        ),
        (["new", "x.toml", "--piston-diameter", "-6 cm"], "--piston-diameter: it must be above 0"),
        (
            ["new", "x.toml", "--piston-stroke", "6 s"],
            "--piston-stroke: the unit 's' is of another kind",
        ),
    ],
)
def test_bad_input_is_exit_code_2(capsys, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert list(tmp_path.iterdir()) == []


def test_fields_are_set_and_the_vehicle_is_printed_or_written(capsys, tmp_path):
    changes = ["motion.K2=6500", "motion.T2=42 s", "name=slow"]
    assert main(["vehicle", "set", "feup-em", *changes, "--full"]) == 0
    printed = capsys.readouterr().out
    assert main(["vehicle", "set", "feup-em", *changes]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "motion.K2: 7935.54 to 6500.0 1/m2/s" in said
    assert said[-1].startswith("nothing is written: --file FILE")
    path = tmp_path / "slow.toml"
    assert main(["vehicle", "set", "feup-em", *changes, "--file", str(path)]) == 0
    assert path.read_text() == printed
    found = load_vehicle(path)
    given = {"motion.K2": 6500.0, "motion.T2": "42 s", "name": "slow"}
    assert found == load_vehicle("feup-em").replace(given)
    assert (found.motion.K2, found.motion.T2, found.name) == (6500.0, 42.0, "slow")
    assert found.hull == load_vehicle("feup-em").hull
    assert found.provenance["motion.K2"] == "set by hand"
    assert found.provenance["hull.psi"].startswith("section 3.2")


def test_an_element_of_a_list_is_named_by_its_number():
    floater = load_vehicle("example-float")
    part = floater.hull.parts[0]
    found = floater.replace({"hull.parts.0.compressibility": 2.0 * part.compressibility})
    assert found.hull.parts[0].compressibility == 2.0 * part.compressibility
    assert found.hull.parts[0].volume == part.volume
    assert found.hull.parts[1:] == floater.hull.parts[1:]
    assert floater.hull.parts[0] == part


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("motion.K9=1", "motion.K9: unknown field. Known here: K2, T2, kind."),
        ("motion.T2=42 m", "motion.T2: the unit 'm' is of another kind"),
        ("motion.T2=-4", "motion.T2: must be greater than 0"),
        ("foo", "not a pair (got 'foo')"),
        ("controller.law=zz", "controller.law: unknown control law"),
        ("hull.parts.0.volume=3", "hull.parts: "),
        ("provenance.x.y=3", "provenance.x"),
        ("name.first=x", "name.first: the vehicle has no such field"),
        ("stroke.minimum=1", "stroke"),
    ],
)
def test_what_cannot_be_set_is_refused(capsys, tmp_path, monkeypatch, change, words):
    monkeypatch.chdir(tmp_path)
    assert main(["vehicle", "set", "feup-em", change, "--file", "x.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert list(tmp_path.iterdir()) == []


def test_the_help_of_new_names_every_kind(capsys):
    assert main(["vehicle", "new", "--help"]) == 0
    told = capsys.readouterr().out
    assert all(kind in told for kind in KINDS)
