"""``swimbladder analyse``: numbers, files, pictures, exit codes, and what is refused."""

import json

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.io.presets import preset_text
from tests.quoted import numbers

PNG = b"\x89PNG\r\n\x1a\n"


def answer(capsys, *arguments, code=0):
    assert main(["analyse", *arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def refused(capsys, *arguments):
    assert main(["analyse", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    return " ".join(captured.err.split())


def vehicle_file(folder, old, new, preset="feup-em"):
    text = preset_text(preset)
    assert old in text
    path = folder / "mine.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


def test_json_has_the_papers_open_loop(capsys):
    found = answer(capsys, "feup-em")["open_loop"]
    expected = [3.26700, 36.3900, 0.997115, -0.0320596, -0.00203660]
    np.testing.assert_allclose(found["denominator"], expected, rtol=1e-6)
    assert found["numerator"] == pytest.approx([-0.444e-3 * 7935.54 * 75e-4])
    poles = np.array(found["poles"])
    np.testing.assert_allclose(
        poles,
        [[0.03704, 0.0], [-0.03230, 0.02172], [-0.03230, -0.02172], [-11.111, 0.0]],
        atol=5e-4,
    )


def test_json_answers_what_was_asked(capsys):
    a = answer(capsys, "feup-em", "--depth", "80 m")
    assert a["depth_m"] == 80.0
    assert a["stall"]["depth_m"] == pytest.approx(12.0 / 0.07707)
    assert a["stall"]["within_limit"] is True
    loop = a["closed_loop"]
    assert loop["margins"]["command"]["phase_deg"] == pytest.approx(41.0, abs=0.5)
    assert loop["computation_delay_limit_s"] == pytest.approx(0.24, abs=0.005)
    assert loop["stable_with_one_sample_of_computation"] is False
    assert loop["depth_load"]["extra_psi_m3_m"] == pytest.approx(7.7e-8, rel=2e-3)
    assert (a["stable"], a["files"]) == (True, [])


def test_text_has_tables_and_sentences(capsys):
    assert main(["analyse", "feup-em", "--depth", "0.1 km", "--full"]) == 1
    captured = capsys.readouterr()
    assert "feup-em at 100 m" in captured.err
    text = " ".join(captured.out.split())
    for phrase in (
        "Linear analysis of feup-em at 100 m",
        "/ (3.267 s^4 + 36.39 s^3 + 0.997115 s^2",
        "s^3 36.39 -0.0320596",
        "155.7 m",
        "outside the stroke",
        "0.99706",
        "phase, degrees 41.07",
        "delay by eigenvalues, s 0.2356",
    ):
        assert phrase in text, phrase


@pytest.mark.parametrize(
    "preset", ["feup-em", pytest.param("example-eh", marks=pytest.mark.prove), "ntnu-bv"]
)
def test_files_are_written(capsys, tmp_path, preset):
    out = tmp_path / "new" / "folder"
    a = answer(capsys, preset, "--out", str(out))
    names = ["analysis.json", "analysis.txt", "loop_gains.png", "nyquist.png", "open_loop.png"]
    assert sorted(p.name for p in out.iterdir()) == [*names, "poles.png", "report.html"]
    assert sorted(a["files"]) == sorted(str(p) for p in out.iterdir())
    written = json.loads((out / "analysis.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in a.items() if key != "files"}
    text = (out / "analysis.txt").read_text(encoding="utf-8")
    assert text.startswith(f"Linear analysis of {preset} at 0 m\n")
    assert not any(line != line.rstrip() for line in text.splitlines())
    for name in out.glob("*.png"):
        assert name.read_bytes().startswith(PNG)


def test_without_a_controller(capsys, tmp_path):
    text = preset_text("feup-em").split("# The cascade")[0]
    text = "\n".join(line for line in text.splitlines() if not line.startswith('"controller.'))
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    a = answer(capsys, str(path), "--out", str(tmp_path / "out"))
    assert (a["closed_loop"], a["stable"]) == (None, None)
    assert sorted(p.name for p in (tmp_path / "out").glob("*.png")) == [
        "open_loop.png",
        "poles.png",
    ]
    assert main(["analyse", str(path)]) == 0
    assert "no controller" in capsys.readouterr().out


def test_unstable_loop_is_the_answer_no(capsys, tmp_path):
    path = vehicle_file(tmp_path, "1002 V/dm3", "4008 V/dm3")
    a = answer(capsys, path, "--out", str(tmp_path / "out"), code=1)
    assert a["closed_loop"]["stable"] is False
    assert a["closed_loop"]["margins"] == {"command": None, "depth": None}
    assert (tmp_path / "out" / "loop_gains.png").read_bytes().startswith(PNG)
    assert main(["analyse", path]) == 1
    assert "UNSTABLE" in capsys.readouterr().out


def test_a_depth_that_stroke_or_supply_do_not_hold_is_the_answer_no(capsys, tmp_path):
    """The stroke of 350 cm3 is used up at 350/4.04 = 86.6 m; 6 V balance 6/0.07707 = 77.9 m."""
    for depth, code in (("86.5", 0), ("86.8", 1)):
        assert answer(capsys, "feup-em", "--depth", depth, code=code)["rests"] is (code == 0)
    path = vehicle_file(tmp_path, 'voltage = "12 V"', 'voltage = "6 V"')
    for depth, code in (("77.8", 0), ("77.9", 1)):
        assert answer(capsys, path, "--depth", depth, code=code)["rests"] is (code == 0)
    assert main(["analyse", path, "--depth", "77.9"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert 77.9 in numbers(said)


def test_gain_limit_that_it_names_is_the_limit(capsys, tmp_path):
    """What `analyse` says of the gain, done to the file, turns its answer around."""
    limit = answer(capsys, "feup-em")["closed_loop"]["margins"]["command"]["gain_up"]
    for share, code in ((0.999, 0), (1.001, 1)):
        path = vehicle_file(tmp_path, "1002 V/dm3", f"{1002 * limit * share!r} V/dm3")
        answer(capsys, path, code=code)


@pytest.mark.parametrize(
    ("arguments", "phrases"),
    [
        (["feup-em", "--depth", "-3"], ["--depth", "-3", "positive down"]),
        (["feup-em", "--depth", "3 kg"], ["--depth", "unit m"]),
        (["feup-em", "--depth", "deep"], ["--depth", "deep"]),
        (["feup-en"], ["feup-em"]),
        (["no/such/file.toml"], ["no/such/file.toml", "no such file"]),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else "",
)
def test_bad_input_is_refused(capsys, arguments, phrases):
    said = refused(capsys, *arguments)
    for phrase in phrases:
        assert phrase in said


def test_bad_law_is_refused_with_its_line(capsys, tmp_path):
    path = vehicle_file(tmp_path, 'law = "cascade"', 'law = "cascad"')
    lines = (tmp_path / "mine.toml").read_text(encoding="utf-8").splitlines()
    line = lines.index('law = "cascad"') + 1
    said = refused(capsys, path)
    for phrase in (
        "mine.toml",
        f"line {line}",
        "controller.law",
        "Did you mean",
    ):
        assert phrase in said


def test_law_of_the_wrong_kind_is_refused(capsys, tmp_path):
    cascade = "".join(preset_text("feup-em").partition("[controller]")[1:])
    text = preset_text("ntnu-bv")
    path = vehicle_file(tmp_path, text[text.index("[controller]") :], cascade, preset="ntnu-bv")
    said = refused(capsys, path)
    assert "commands a voltage" in said
    assert "controller.law" in said


def test_nothing_is_left_where_a_folder_cannot_be_made(capsys, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder", encoding="utf-8")
    assert "--out" in refused(capsys, "feup-em", "--out", str(blocked / "out"))
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_pump_and_valve_has_rates_in_the_place_of_a_voltage(capsys, tmp_path):
    a = answer(capsys, "example-float", "--depth", "1000 m", "--out", str(tmp_path))
    assert (a["command"], a["closed_loop"], a["stable"]) == ("volume change", None, None)
    assert a["open_loop"]["input"] == "V"
    assert a["operating_point"]["voltage_V"] is None
    assert a["operating_point"]["volume_m3"] == pytest.approx(-0.049e-6 * 1000.0)
    assert a["stall"]["within_limit"] is True
    drive = a["drive"]
    assert drive["depth_m"][0] == 0.0
    assert np.all(np.diff(drive["pump_rate_m3_s"]) < 0.0)
    assert np.all(np.diff(drive["valve_rate_m3_s"]) > 0.0)
    rest, *moving = a["motions"]
    assert rest["period_s"] == pytest.approx(2.0 * np.pi / abs(a["open_loop"]["poles"][0][1]))
    assert (rest["growth_time_s"], rest["time_constant_s"]) == (None, None)
    assert [m["speed_m_s"] for m in moving] == [0.02, 0.04, 0.1]
    assert (tmp_path / "drive.png").read_bytes().startswith(PNG)
    assert "stability" in a["notes"][0]


def test_a_float_whose_pump_stalls_above_the_depth_does_not_rest_there(capsys, tmp_path):
    weak = vehicle_file(tmp_path, 'voltage = "14.4 V"', 'voltage = "3 V"', "example-float")
    a = answer(capsys, weak, "--depth", "1500 m", code=1)
    assert a["rests"] is False
    assert a["stall"]["holding_depth_m"] < 1500.0
