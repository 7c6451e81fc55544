"""Errors and findings name parameters as Python does, and the command line the options of them."""

import ast
import re
from pathlib import Path

import pytest

import swimbladder
from swimbladder.errors import InputError, NoAnswerError, Parameter, as_asked, column_as
from tests.test_public_api import ELSEWHERE, everything

SOURCE = Path(swimbladder.__file__).parent
OPTION = re.compile(r"(?<![\w-])--[a-z][\w-]*")
REFERENCE = re.compile(r"`(\w+)=[^`]*`")
COMMAND = re.compile(
    r"`(swimbladder )?(identify|energy|tune|ballast|stability|vehicle (show|new))\b[^`]*`"
)
OTHERS = {"sim/faults/c_interface.py", "jobs.py"}  # options of other programs
OTHERS |= {f"show/{name}.py" for name in ("energy", "faults", "text")}  # what is typed next
TABLE = {"goal": "--goal", "hold": "--hold", "columns": "--column", "supervised": "--unsupervised"}
TABLE |= {"span": "--span", "fixed": "--fixed", "step": "--step", "out": "--out"}


def texts():
    """Return where each text of the source is that is no docstring, and the text."""
    for path in sorted(SOURCE.rglob("*.py")):
        name = str(path.relative_to(SOURCE))
        if name.startswith("cli/") or name in OTHERS:
            continue
        tree = ast.parse(path.read_text("utf-8"))
        alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            value = getattr(node, "value", None)
            if isinstance(node, ast.Constant) and isinstance(value, str) and id(node) not in alone:
                yield f"{name}:{node.lineno}", value
    for path in sorted(SOURCE.rglob("*.toml")):
        if path.parts[-2] != "cli":
            yield path.name, re.sub(r"(?m)^#.*$", "", path.read_text("utf-8"))


def test_no_text_below_the_command_line_names_an_option():
    found = [(at, OPTION.findall(COMMAND.sub("", text))) for at, text in texts()]
    assert [(at, named) for at, named in found if named] == []


def test_what_texts_call_parameters_is_one_of_an_option_and_of_python():
    named = {name: at for at, text in texts() for name in REFERENCE.findall(text)}
    assert len(named) > 30
    python, options = everything()
    assert {name: at for name, at in named.items() if name not in options} == {}
    assert {name: at for name, at in named.items() if name not in python | ELSEWHERE} == {}


@pytest.mark.parametrize(
    ("text", "typed"),
    [
        ('with `goal="effort"`, or a wider `hold=`', "with --goal effort, or a wider --hold"),
        ("`hold='1 cm'`", '--hold "1 cm"'),
        (column_as("depth_m", 'z "abs"@cm'), '--column "depth_m=z "abs"@cm"'),
        ("`fixed={'a': 1, 'b': 'x'}`", '--fixed "a=1" --fixed "b=x"'),
        ("`supervised=False`", "--unsupervised"),
        ("`step=(1.5, 3)`", "--step 1.5:3"),
        ("`other=3`", "`other=3`"),
        ("`hold=a b`", "--hold a b"),
        ("an ordinary `word` and a=b", "an ordinary `word` and a=b"),
    ],
)
def test_a_parameter_is_written_as_its_option(text, typed):
    assert as_asked(text, TABLE) == typed
    assert as_asked(text, {}) == text


def test_an_error_has_the_options_of_what_it_names():
    error = InputError("no", field="fixed[psi]", value=2.0, remedy="Give `goal='fast'`")
    assert str(error.asked(TABLE)) == "--fixed psi: no (got 2.0). Give --goal fast."
    assert str(error) == "fixed[psi]: no (got 2.0). Give `goal='fast'`."
    in_a_file = InputError("no", file="a.toml", field="hold")
    assert str(in_a_file.asked(TABLE)) == "a.toml, hold: no."
    whole = {**TABLE, "setpoints[0].depth": "--step"}
    assert InputError("no", field="setpoints[0].depth").asked(whole).field == "--step"
    assert InputError("no", field="setpoints[1].depth").asked(whole).field == "setpoints[1].depth"
    beside = InputError("no", file="a", field=Parameter("out")).asked(TABLE)
    assert str(beside) == "a, --out: no."
    assert str(NoAnswerError("see `hold=`").asked(TABLE)) == "see --hold"
