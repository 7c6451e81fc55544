"""From a log in any unit to firmware in three commands, and what a log's columns are taken for."""

import contextlib
import re
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.errors import LogError
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log
from tests.estimation.motion.pool import campaign

AREA = 75e-4  # m2, of the piston of feup-em


@pytest.fixture(scope="module")
def log():
    return campaign(61, quantum=5e-3, steps=(2e-5,))[0]


def written(path, log, **columns):
    """A table with semicolons and decimal commas, of columns (factor, offset, digits) of a log."""
    lines = [";".join(columns)]
    for k in range(len(log.time)):
        row = []
        for of, factor, offset, digits in columns.values():
            row.append(f"{getattr(log, of)[k] * factor + offset:.{digits}f}".replace(".", ","))
        lines.append(";".join(row))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


IMPERIAL = {
    "Time (min)": ("time", 1.0 / 60.0, 0.0, 6),
    "Depth (feet)": ("depth", 1.0 / 0.3048, 0.0, 5),
    "Volume (mL)": ("volume", 1e6, 0.0, 4),
}
DRUCK = {
    "Zeit [ms]": ("time", 1e3, 0.0, 1),
    "Druck (psi)": ("depth", 9806.65 / 6894.757293168, 14.6959, 5),
    "Piston mm": ("volume", 1e3 / AREA, 0.0, 5),
}


def test_a_log_in_feet_and_minutes_becomes_firmware_in_three_commands(
    log, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    written(Path("odd.csv"), log, **IMPERIAL)
    assert main(["identify", "odd.csv", "--vehicle", "feup-em", "--no-profiles"]) == 0
    said = capsys.readouterr()
    taken = "time_s from 'Time (min)', depth_m from 'Depth (feet)', volume_m3 from 'Volume (mL)'"
    assert f"odd.csv: columns taken by their names: {taken}" in said.err
    found = load_vehicle("swimbladder-identify/vehicle.toml")
    assert pytest.approx(7935.54, rel=0.15) == found.motion.K2
    quick = ["--law", "adrc", "--runs", "20", "--depth-range", "0:5 m", "--step", "1.5:3 m"]
    assert main(["tune", "swimbladder-identify/vehicle.toml", *quick]) == 0
    assert main(["firmware", "swimbladder-tune/vehicle.toml", "--duration", "30"]) == 0
    assert Path("swimbladder-firmware/src/swb_adrc.c").is_file()


@pytest.mark.parametrize("columns", [IMPERIAL, DRUCK])
def test_units_of_a_foreign_log_are_taken_as_its_names_say(log, tmp_path, columns):
    path = written(tmp_path / "odd.csv", log, **columns)
    form = None
    if columns is DRUCK:
        with pytest.raises(LogError, match="density that turns pressure_Pa into depth is missing"):
            read_log(path)
        from swimbladder.io.log_format import LogFormat

        form = LogFormat(water_density="1000 kg/m3", atmospheric_pressure="14.6959 psi")
    read = read_log(path, log_format=form)
    np.testing.assert_allclose(read.time - read.time[0], log.time - log.time[0], atol=1e-3)
    np.testing.assert_allclose(read.depth, log.depth, atol=1e-4)
    volume = read.volume if columns is IMPERIAL else AREA * read.piston
    np.testing.assert_allclose(volume, log.volume, atol=1e-9)
    assert "the numbers have decimal commas" in read.report


def test_the_density_is_the_vehicles_and_the_surface_is_asked_for_as_it_is_typed(
    log, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    written(Path("odd.csv"), log, **DRUCK)
    command = ["compare", "odd.csv", "--vehicle", "feup-em"]
    assert main(command) == 2
    said = capsys.readouterr().err
    (option,) = re.findall(r'--log-format "atmospheric_pressure=gauge"', said)
    assert "looks absolute" in said
    assert main([*command, *option.replace("gauge", "14.6959psi").replace('"', "").split()]) == 0
    assert "water of 1000 kg/m3, the vehicle's, makes depths of it" in capsys.readouterr().err


def test_texts_of_times_say_themselves_what_they_are(log, tmp_path):
    begin = datetime(2024, 5, 1, 23, 59, 30)
    stamps = [begin + timedelta(seconds=float(t)) for t in log.time]
    for name, texts in {
        "iso.csv": [stamp.isoformat() for stamp in stamps],
        "clock.csv": [stamp.strftime("%H:%M:%S.%f") for stamp in stamps],
    }.items():
        rows = zip(texts, log.depth, strict=True)
        table = "".join(f"{text},{1e2 * z:.4f}\n" for text, z in rows)
        (tmp_path / name).write_text(f"Timestamp,depth_cm\n{table}", encoding="ascii")
        read = read_log(tmp_path / name)
        np.testing.assert_allclose(read.time, log.time - log.time[0], atol=1e-5)
        np.testing.assert_allclose(read.depth, log.depth, atol=1e-5)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("Time,Depth (ft)", 'Say it: `columns={"time_s": "Time@s"}`, or @ms, @min, @h'),
        ("Time (s),Depth", '{"depth_m": "Depth@m"}'),
        (
            "Time (s),Depth (ft),Tiefe (m)",
            '{"depth_m": "Depth (ft)"}` `columns={"depth_m": "Tiefe (m)"}',
        ),
        ("Time (s),Depth (kg)", '{"depth_m": "Depth (kg)@m"}'),
    ],
)
def test_what_may_be_two_things_is_refused_with_what_to_type(tmp_path, header, words):
    path = tmp_path / "log.csv"
    rows = "1,2,3\n2,3,4\n" if header.count(",") == 2 else "1,2\n2,3\n"
    path.write_text(f"{header}\n{rows}", encoding="ascii")
    with pytest.raises(LogError) as caught:
        read_log(path)
    assert words in str(caught.value)


def test_a_stepper_in_degrees_is_told_how_it_is_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("Time (s),Depth (ft),Stepper (deg)\n1,2,3\n2,3,4\n", encoding="ascii")
    read = read_log(path)
    (note,) = (note for note in read.report if note.startswith("not read: piston_m"))
    (column,) = re.findall(r'{"piston_m": "(.*?)"}', note)
    assert column == "Stepper (deg)@0.01 mm/deg"
    again = read_log(path, columns={"piston_m": column})
    assert again.piston.tolist() == pytest.approx([3e-5, 4e-5])


def test_without_a_vehicle_the_choice_is_offered(log, tmp_path, capsys):
    path = written(tmp_path / "odd.csv", log, **IMPERIAL)
    for command in ("identify", "compare"):
        assert main([command, str(path), "--out", str(tmp_path / "out")]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert "--vehicle: which vehicle made the log is not said" in said
        assert "example-float, feup-em, ntnu-bv" in said


@pytest.mark.data
def test_a_format_that_is_known_names_its_vehicle(data_dir, tmp_path, capsys):
    path = data_dir / "ntnu_bv" / "missions.csv.gz"
    with contextlib.chdir(tmp_path):
        assert main(["compare", str(path), "--where", "log=47"]) == 0
    said = capsys.readouterr().err
    assert "the logs are in the format of ntnu-bv: --vehicle ntnu-bv" in said
    assert "its columns are those of the log format ntnu-bv, and read so" in said
