"""Every sentence of a package is used, and gets the values that it names."""

import ast
from pathlib import Path
from string import Formatter

import pytest

import swimbladder
from swimbladder.estimation.estimates import Finding, sentence
from swimbladder.units import per_si, texts_of

ROOT = Path(swimbladder.__file__).parent
ROOM, TEXTS = ROOT / "estimation", texts_of("estimation")
OTHERS = ("design", "physics", "sim")
DRIVEN = {"voltage", "nothing", "reference"}  # keys by what drives an actuator
PER_SI = {
    "%": 100.0,
    "cm": 1e2,
    "cm/s": 1e2,
    "cm3": 1e6,
    "cm3/m": 1e6,
    "cm3/s": 1e6,
    "cm3/h": 3.6e9,
    "mL": 1e6,
    "L": 1e3,
    "L/h": 3.6e6,
    "mm": 1e3,
    "mm/s": 1e3,
    "min": 1.0 / 60.0,
}


def calls():
    """Yield the literal places that the code names, and the names of values given there."""
    for path in ROOM.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("Finding.of", "sentence"):
                words = [a.value for a in node.args if isinstance(a, ast.Constant)]
                given = {k.arg for k in node.keywords}
                yield path.name, ast.unparse(node.func), words, given, len(node.args)


def fields(text):
    named = (name for _, name, _, _ in Formatter().parse(text) if name)
    return {name.split(".")[0].split("[")[0] for name in named}


def rooms_of(tree):
    """Return the package and the room whose sentences a module says: `_say = partial(...)`."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_say":
            return [a.value for a in node.value.args[1:]]
    return None


def test_every_call_gives_the_values_that_its_sentence_names():
    checked = 0
    for file, function, words, given, count in calls():
        # a key or values that the code makes up are tried by the tests of that code
        if len(words) < 2 or None in given:
            continue
        room, key, *other = words
        text = "text" if function == "Finding.of" or not other else other[0]
        if function == "sentence" and count != len(words):
            continue
        assert fields(TEXTS[room][key][text]) == given, (file, room, key)
        checked += 1
    assert checked > 30


@pytest.mark.parametrize("package", OTHERS)
def test_every_sentence_of_a_room_is_said_with_the_values_that_it_names(package):
    spoken = {room: set() for room in texts_of(package)}
    for path in (ROOT / package).rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree) if (place := rooms_of(tree)) else ():
            if not (isinstance(node, ast.Call) and ast.unparse(node.func) == "_say"):
                continue
            of, room = place
            texts, (key, *_) = texts_of(of)[room], node.args
            choices = [a.value for a in ast.walk(key) if isinstance(a, ast.Constant)]
            for choice in (one for one in choices if one in texts):
                assert fields(texts[choice]) == {k.arg for k in node.keywords}, (path.name, choice)
                spoken[room].add(choice)
    assert spoken == {room: set(texts) for room, texts in texts_of(package).items()}


def test_every_sentence_is_used():
    source = "".join(path.read_text(encoding="utf-8") for path in ROOM.rglob("*.py"))
    for room, keys in TEXTS.items():
        for key, known in keys.items():
            assert f'"{key}"' in source or key in DRIVEN, (room, key)
            assert known["text"].strip() == known["text"]


@pytest.mark.parametrize("unit", PER_SI)
def test_a_number_in_si_is_written_in_another_unit(unit):
    assert per_si(unit) == PER_SI[unit]


def test_a_number_is_written_in_the_unit_of_the_sentence():
    said = sentence("motion", "logs differ", psi=2.5e-8, drag=0.123, drift="1", means="none")
    assert "2.5" not in said.split("drag")[1]
    assert "psi differs by 0.025 cm3/m and drag by 12 %" in said


def test_a_finding_has_the_kind_and_severity_of_its_table_unless_another_is_given():
    assert Finding.of("motion", "adds little", name="psi")[:2] == ("prior", "note")
    values = {"log": "a.csv", "out": 3, "used": 9, "largest": 0.5}
    assert Finding.of("motion", "outliers", "warning", **values)[:2] == ("outliers", "warning")
