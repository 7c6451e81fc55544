"""`swimbladder stability`: what it says, writes and refuses."""

import json

import pytest

from swimbladder.cli import main
from swimbladder.design.stability import stability
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.presets import preset_text
from swimbladder.io.vehicle_file import vehicle_file

QUICK = ["--cells", "5", "--within", "200 s"]


def test_it_says_what_is_stable_and_writes_it(capsys, tmp_path):
    out = tmp_path / "out"
    assert main(["stability", "feup-em", "--depth-range", "0:5 m", *QUICK, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.index("Small disturbances decay") < said.index("limit cycle from")
    assert "With a whole sample of delay" in said
    assert "unstable." in said
    assert {p.name for p in out.iterdir()} == {
        "report.html",
        "stability.json",
        "stability.txt",
        "maps.png",
        "map-steps.csv",
        "map-errors-1.csv",
        "map-errors-2.csv",
        "map-errors-3.csv",
    }
    assert [p.name for p in tmp_path.iterdir()] == ["out"]  # nothing left of its parts


@pytest.mark.prove
def test_robustness_is_a_table_of_gain_and_delay(capsys, tmp_path):
    out = tmp_path / "out"
    command = ["stability", "feup-em", "--no-maps", "--robustness", "--runs", "20"]
    assert main([*command, "--within", "500 s", "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    trials = answer["robustness"]
    assert [(s["gain"], s["delay"]) for s in trials] == [
        (gain, delay) for delay in (0.0, 0.15) for gain in (0.5, 0.7, 1.0, 1.4, 2.0)
    ]
    assert answer["maps"] == []
    assert answer["stable"]
    assert (out / "robustness.png").exists()
    # Of the same loop: half a sample of delay takes stability away.
    radii = {(s["gain"], s["delay"]): s["radius"] for s in trials}
    assert radii[2.0, 0.15] > radii[2.0, 0.0]


def test_an_unstable_loop_is_exit_code_1_with_where_and_what_would_help(capsys, tmp_path):
    v = load_vehicle("feup-em")
    gains = v.controller.parameters | {"k_pV": "5010 V/dm3"}
    wild = v.model_copy(
        update={"controller": v.controller.model_copy(update={"parameters": gains})}
    )
    path = tmp_path / "wild.toml"
    path.write_text(vehicle_file(wild, head="too much"), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["stability", str(path), "--no-maps", "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert "UNSTABLE: with K2" in said.out
    assert "shorter sample time" in said.out
    assert "not stable" in said.err
    assert json.loads((out / "stability.json").read_text(encoding="utf-8"))["stable"] is False


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--depth-range", "5:1 m"], "no range of depths"),
        (["--delay", "150 %"], "0 or more and below 1"),
        (["--cells", "2"], "whole number from 5 to 201"),
        (["--within", "0 s"], "above 0 and below 1e+06"),
        (["--runs", "3"], "whole number from 20 to"),
        (["--voltage-quantum", "1 m"], "of another kind"),
        (["--law", "plannd"], "Did you mean planned?"),
    ],
)
def test_bad_options_are_named(capsys, tmp_path, options, words):
    assert main(["stability", "feup-em", *options, "--out", str(tmp_path / "out")]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_a_vehicle_without_a_controller_is_refused(capsys, tmp_path):
    v = load_vehicle("feup-em").model_copy(update={"controller": None})
    path = tmp_path / "bare.toml"
    path.write_text(vehicle_file(v, head="bare"), encoding="utf-8")
    assert main(["stability", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "has no controller" in " ".join(capsys.readouterr().err.split())


@pytest.mark.prove
def test_a_positioner_has_eigenvalues_and_maps_but_no_describing_function(capsys, tmp_path):
    command = [
        "stability",
        "ntnu-bv",
        "--depth-range",
        "0.2:1.5 m",
        *QUICK,
        "--out",
        str(tmp_path / "o"),
    ]
    code = main(command)
    said = capsys.readouterr().out
    assert code in (0, 1)
    assert "The actuator takes a volume" in said or "UNSTABLE" in said


def test_depths_are_those_of_the_controller_where_none_are_asked_for(capsys, tmp_path):
    """A float tuned for 100 to 1500 m was judged from 0 to 10 m."""
    v = load_vehicle("ntnu-bv")
    tuned = v.controller.model_copy(update={"depths": (0.2, 1.2)})
    path = tmp_path / "tuned.toml"
    path.write_text(vehicle_file(v.model_copy(update={"controller": tuned})), encoding="utf-8")
    for vehicle, depths in ((str(path), [0.2, 1.2]), ("ntnu-bv", [0.0, 10.0])):
        main(["stability", vehicle, "--no-maps", "--json", "--out", str(tmp_path / "out")])
        assert json.loads(capsys.readouterr().out)["depths_m"] == depths


def test_a_float_is_followed_from_decision_to_decision(capsys, tmp_path):
    """By its law alone, also where its file has a table of a supervisor."""
    out, path = tmp_path / "out", tmp_path / "watched.toml"
    path.write_text(preset_text("example-float") + "\n[supervisor]\n", encoding="utf-8")
    command = ["stability", str(path), "--depth-range", "100:500 m", "--cells", "5"]
    assert main([*command, "--out", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["linear"] is None
    assert answer["supervised"] is False
    with pytest.raises(InputError, match="without a supervisor"):
        stability(load_vehicle(path), depth_range=(100.0, 500.0), supervised=True)
    decisions = answer["decisions"]
    assert 0.0 < decisions["largest_eigenvalue"] < 1.0
    assert {w["way"] for w in decisions["ways"]} == {"far", "near", "ascent"}
    assert decisions["rest"]["growth_time_s"] is None
    assert [c["source"] for c in answer["cycles"]][:2] == [
        "compressibility, sinking",
        "compressibility, rising",
    ]
    assert all(m["lost"] == 0 for m in answer["maps"])
    assert (out / "maps.png").exists()


def test_a_float_that_asks_for_too_much_is_exit_code_1_with_its_parameters(capsys, tmp_path):
    v = load_vehicle("example-float")
    wild = v.controller.parameters | {"coefficient": "3000 cm3 s2/m2"}
    v = v.model_copy(update={"controller": v.controller.model_copy(update={"parameters": wild})})
    path = tmp_path / "wild.toml"
    path.write_text(vehicle_file(v), encoding="utf-8")
    command = ["stability", str(path), "--depth-range", "100:500 m", "--no-maps"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    assert "UNSTABLE: with drag" in captured.out
    assert "not stable" in captured.err
