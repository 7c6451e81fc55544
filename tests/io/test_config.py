"""Vehicles and missions from files: what is read, and where an error is said to be."""

import random
import re
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.io.config import load_mission, load_vehicle, locate, vehicle_text
from swimbladder.io.presets import preset_names, preset_text
from swimbladder.io.vehicle_file import vehicle_template

FEUP = preset_text("feup-em")
MISSION = """\
schema_version = 1
name = "down and up"
start_depth = "1.5 m"
bottom_depth = "450 cm"
duration = "10 min"

[[setpoints]]
time = 0
depth = 3.0
[[setpoints]]
time = "5 min"
depth = "150 cm"
"""


def saved(folder, text, name="mine.toml"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refused(folder, text, load=load_vehicle):
    path = saved(folder, text)
    with pytest.raises(InputError) as caught:
        load(path)
    assert caught.value.file == path
    assert caught.value.field
    assert caught.value.remedy
    assert "\n" not in str(caught.value)
    return caught.value


def test_a_file_and_a_preset_of_the_same_text_are_the_same_vehicle(tmp_path):
    path = saved(tmp_path, FEUP)
    assert load_vehicle(path) == load_vehicle(str(path)) == load_vehicle("feup-em")
    assert vehicle_text("feup-em") == vehicle_text(path) == FEUP


def test_a_file_without_suffix_is_found_where_no_preset_has_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    saved(tmp_path, FEUP.replace('"feup-em"', '"other"', 1), "other")
    saved(tmp_path, FEUP.replace('"feup-em"', '"shadow"', 1), "feup-em")
    assert load_vehicle("other").name == "other"
    assert load_vehicle("feup-em").name == "feup-em"
    assert load_vehicle("./feup-em").name == "shadow"


def test_a_byte_order_mark_and_windows_line_ends_are_read(tmp_path):
    text = b"\xef\xbb\xbf" + FEUP.replace("\n", "\r\n").encode()
    assert load_vehicle(saved(tmp_path, text)) == load_vehicle("feup-em")
    error = refused(tmp_path, text.replace(b"0.09 s", b"-1 s"))
    assert (
        error.line == FEUP[: FEUP.index("0.09 s")].count("\n") + 1 or error.field == "actuator.T1"
    )


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ('psi = "4.04e-6 m3/m"', 'psy = "4.04e-6 m3/m"', "hull.psy", "Did you mean psi?"),
        ('"75 cm2"', '"75 cm3"', "actuator.piston_area", "Give it in m2"),
        ('"75 cm2"', '"-75 cm2"', "actuator.piston_area", "must be greater than 0"),
        ('"75 cm2"', "nan", "actuator.piston_area", "not a finite number"),
        ('"36.3 s"', "inf", "motion.T2", "not a finite number (got inf"),
        ('"36.3 s"', '"36,3 s"', "motion.T2", "with a decimal point"),
        ('"36.3 s"', "[36.3]", "motion.T2", "not a quantity"),
        ('"36.3 s"', "2024-05-02", "motion.T2", "not a quantity"),
        ('law = "cascade"', "law = 3", "controller.law", "Write it in quotes"),
        ('k_pV = "1002 V/dm3"', "k_pV = true", "controller.parameters.k_pV", "not a quantity"),
        ('minimum = "-350 cm3"', 'minimum = "350 cm3"', "stroke.minimum", "not below"),
        ('kind = "identified"\nK1', 'kind = "identifed"\nK1', "actuator.kind", "Did you mean"),
        ('"hull.psi" =', '"hull.psi" = 3 #', 'provenance."hull.psi"', "Write it in quotes"),
        ('law = "cascade"', 'law = "casacde"', "controller.law", "Did you mean cascade?"),
        ('"1002 V/dm3"', '"1002 V/dm2"', "controller.parameters.k_pV", "of another kind"),
        (
            'k_pV = "1002 V/dm3"',
            'k_pv = "1002 V/dm3"',
            "controller.parameters.k_pv",
            "Did you mean k_pV?",
        ),
        (
            'voltage = "12 V"',
            'voltage = "12 V"\ninternal_resistance = "0.1 ohm"',
            "supply.internal_resistance",
            "Give the motor's data",
        ),
        ("[motion]", "[motoin]", "motoin", "Did you mean motion?"),
        ("schema_version = 1", "schema_version = 2", "schema_version", "Update swimbladder"),
        (
            "schema_version = 1",
            'schema_version = "1"',
            "schema_version",
            "Write schema_version = 1",
        ),
        (
            "schema_version = 1",
            "schema_version = true",
            "schema_version",
            "Write schema_version = 1",
        ),
        ("schema_version = 1", "schema_version = 0", "schema_version", "no such schema version"),
    ],
)
def test_an_error_names_the_line_of_what_was_changed(tmp_path, old, new, field, words):
    assert FEUP.count(old) == 1
    error = refused(tmp_path, FEUP.replace(old, new))
    line = FEUP[: FEUP.index(old)].count("\n") + 1
    assert error.field == field
    assert error.line == line + ("internal" in new)
    assert words in str(error)


def test_a_law_has_to_command_what_the_actuator_takes(tmp_path):
    text = vehicle_template("positioner")
    start = text.index("[controller]")
    text = text[:start] + FEUP[FEUP.index("[controller]") :]
    error = refused(tmp_path, text)
    assert error.field == "controller.law"
    assert "Choose one of: position-pid" in str(error)


def test_a_missing_field_is_said_to_be_missing_in_its_table(tmp_path):
    text = FEUP.replace('height = "1285 mm"\n', "")
    error = refused(tmp_path, text)
    assert error.field == "hull.height"
    assert text.splitlines()[error.line - 1] == "[hull]"


def test_a_missing_schema_version_is_asked_for(tmp_path):
    error = refused(tmp_path, FEUP.replace("schema_version = 1\n", ""))
    assert error.line is None
    assert error.remedy == "Write schema_version = 1 on the first line"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("schema_version = 1\nname = x\n", 2, "invalid value"),
        ("schema_version = 1\n\n[hull\n", 3, "expected"),
        ("a = 1\na = 2\n", 2, "overwrite"),
        ('a = "no end', 1, ""),
        ("a = " + "[" * 5000, None, "nested too deeply"),
        ("a = " + "9" * 5000, None, ""),
        ("a = 2024-99-99", 1, ""),
        (b"name = '\xff'", None, "not UTF-8 text, at byte 8"),
        ("", None, "schema version"),
    ],
)
def test_what_is_no_toml_is_refused_with_its_line(tmp_path, text, line, words):
    error = refused(tmp_path, text)
    assert words in str(error)
    assert line is None or error.line == line


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_vehicle(tmp_path / "none.toml")
    with pytest.raises(InputError, match="this is a folder"):
        load_mission(tmp_path)
    with pytest.raises(InputError, match="cannot read the file"):
        load_vehicle("a\0b.toml")


def test_a_near_preset_is_offered():
    with pytest.raises(InputError, match=r"Did you mean feup-em\? Presets: .*feup-em"):
        load_vehicle("FEUP_em")


def test_a_mission_is_read(tmp_path):
    mission = load_mission(saved(tmp_path, MISSION))
    assert mission.pairs == [(0.0, 3.0), (300.0, 1.5)]
    assert (mission.start_depth, mission.bottom, mission.duration) == (1.5, 4.5, 600.0)


@pytest.mark.parametrize(
    ("old", "new", "field", "line", "words"),
    [
        ("time = 0\n", "time = 1\n", "setpoints[0].time", 8, "Give the first set-point the time 0"),
        ('"5 min"', "0", "setpoints[1].time", 11, "Sort the set-points"),
        ('"5 min"', '"10 min"', "setpoints[1].time", 11, "is not before the end at 600 s"),
        ('"5 min"', '"-5 min"', "setpoints[1].time", 11, "must be greater than or equal to 0"),
        ('depth = "150 cm"', 'dept = "150 cm"', "setpoints[1].dept", 12, "Did you mean depth?"),
        ('depth = "150 cm"', "", "setpoints[1].depth", 10, "Add a line depth"),
        ('"10 min"', "0", "duration", 5, "must be greater than 0"),
        ('"450 cm"', '"450 s"', "bottom_depth", 4, "of another kind"),
    ],
)
def test_what_is_wrong_in_a_mission(tmp_path, old, new, field, line, words):
    assert MISSION.count(old) == 1
    error = refused(tmp_path, MISSION.replace(old, new), load_mission)
    assert (error.field, error.line) == (field, line)
    assert words in str(error)


def test_a_mission_without_set_points(tmp_path):
    head = MISSION[: MISSION.index("[[")]
    assert "Write [[setpoints]]" in str(refused(tmp_path, head, load_mission))
    assert refused(tmp_path, head + "setpoints = []", load_mission).field == "setpoints"
    assert "not a list" in str(refused(tmp_path, head + "setpoints = 3", load_mission))


def test_an_error_found_later_is_given_its_line(tmp_path):
    path = saved(tmp_path, MISSION)
    error = locate(InputError("no", field="setpoints[1].depth", remedy="Yes"), path)
    assert (error.file, error.line) == (path, 12)


def outcome(load, path):
    """The InputError of reading a file, None where it was read."""
    try:
        load(path)
    except InputError as error:
        return error
    return None


def mutated(text, seed):
    """The text with a few characters, words or lines changed at random."""
    chance = random.Random(seed)
    for _ in range(chance.randint(1, 4)):
        kind = chance.randrange(6)
        lines = text.splitlines(keepends=True) or ["\n"]
        index = chance.randrange(len(lines))
        at = chance.randrange(len(text) + 1)
        if kind == 0:
            text = text[:at] + chance.choice(string.printable) + text[at + 1 :]
        elif kind == 1:
            text = (
                text[:at]
                + chance.choice(['"', "[", "]", "{", "=", "#", "\n", "nan", "-"])
                + text[at:]
            )
        elif kind == 2:
            text = "".join(lines[:index] + lines[index + 1 :])
        elif kind == 3:
            lines.insert(index, chance.choice(lines))
            text = "".join(lines)
        elif kind == 4:
            key, _, value = lines[index].partition("=")
            new = chance.choice(
                [
                    "nan",
                    "-inf",
                    "1e999",
                    "true",
                    '""',
                    "[]",
                    "{}",
                    "9" * 30,
                    '"1 m"',
                    '"x"',
                    "{a=1}",
                ]
            )
            lines[index] = f"{key}= {new}\n" if value else lines[index]
            text = "".join(lines)
        else:
            chance.shuffle(lines)
            text = "".join(lines)
    return text


@given(st.integers(0, 2**32), st.sampled_from(preset_names()))
def test_no_mutation_of_a_vehicle_file_ends_in_anything_but_an_input_error(
    tmp_path_factory, seed, preset
):
    path = saved(tmp_path_factory.mktemp("mutated"), mutated(preset_text(preset), seed))
    error = outcome(load_vehicle, path)
    assert error is None or (error.file == path and error.field and error.remedy)


@given(st.integers(0, 2**32))
def test_no_mutation_of_a_mission_file_ends_in_anything_but_an_input_error(tmp_path_factory, seed):
    path = saved(tmp_path_factory.mktemp("mutated"), mutated(MISSION, seed))
    error = outcome(load_mission, path)
    assert error is None or (error.file == path and error.field and error.remedy)


@given(st.binary(max_size=200))
def test_no_bytes_end_in_anything_but_an_input_error(tmp_path_factory, content):
    path = saved(tmp_path_factory.mktemp("bytes"), content)
    with pytest.raises(InputError):
        load_vehicle(path)


@pytest.mark.parametrize(
    ("line", "wrong", "said"),
    [
        ('dead = "60 s"', 'dead = "-5 s"', "controller.parameters.dead: it must be 0.05 or more"),
        ('run = "10 s"', "run = 0", "controller.parameters.run: it must be 0.05 or more"),
        ('far_speed = "10 cm/s"', "far_speed = 0", "parameters.far_speed: it must be above 0"),
        ('volume_step = "0.2 cm3"', "volume_step = -1", "parameters.volume_step: it must be 0 or"),
    ],
)
def test_a_law_of_missions_whose_numbers_are_none_is_refused(tmp_path, line, wrong, said):
    text = preset_text("example-float")
    assert line in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(line, wrong))
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        load_vehicle(path)
    assert refused.value.line == 1 + text[: text.index(line)].count("\n")
