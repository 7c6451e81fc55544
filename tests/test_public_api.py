"""The public names: all there, all documented, none imported before it is used."""

import ast
import inspect
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import get_type_hints

import pytest

import swimbladder
import swimbladder as sb
from swimbladder.cli import COMMANDS, command_of
from swimbladder.cli.options import Options
from swimbladder.codegen.pool import PoolOptions
from swimbladder.design.planning.task import Limits
from swimbladder.design.pool_day.day import rules_of
from swimbladder.design.pool_day.rehearsal import check_waiting
from swimbladder.design.sizing.candidates import Parts
from swimbladder.io.pump_runs import read_pump_runs


@pytest.mark.parametrize("name", swimbladder.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name):
    value = getattr(swimbladder, name)
    assert inspect.getdoc(value)
    assert value.__name__ == name
    assert not inspect.ismodule(value)


def test_the_docstring_is_the_map():
    for name in swimbladder.__all__:
        assert f"``{name}``" in swimbladder.__doc__


def test_the_list_is_sorted_short_and_the_same_as_dir():
    assert swimbladder.__all__ == sorted(swimbladder.__all__)
    assert len(swimbladder.__all__) <= 60
    shown = [name for name in dir(swimbladder) if not name.startswith("_")]
    assert shown == swimbladder.__all__


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        swimbladder.nonsense  # noqa: B018


def test_importing_the_package_imports_nothing_else():
    code = "import sys; old = set(sys.modules); import swimbladder; print(*set(sys.modules) - old)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    ours = {name for name in done.stdout.split() if name.startswith("swimbladder")}
    assert ours == {"swimbladder"}
    assert not {"numpy", "numba", "pydantic"}.intersection(done.stdout.split())


def test_the_example_of_the_docstring_runs(capsys):
    _, _, rest = swimbladder.__doc__.partition("::\n\n")
    example, _, _ = rest.partition("\n\nEvery command")
    names = {}
    exec(inspect.cleandoc("\n" + example), names)
    assert "overshoot_pct=14.6988" in capsys.readouterr().out
    assert names["dataset"].depth.attrs["positive"] == "down"


def test_the_version_is_the_one_that_is_installed():
    from importlib.metadata import version

    assert swimbladder.__version__ == version("swimbladder")


def undocumented(within, path=()):
    """Yield the functions and classes of five lines or more without docstring, local ones too.

    Ruff has the shorter ones that are not local.
    """
    for node in ast.iter_child_nodes(within):
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield from undocumented(node, path)
        elif not node.name.startswith("_"):
            own = (*path, node.name)
            if node.end_lineno - node.lineno >= 4 and not ast.get_docstring(node):
                yield ".".join(own)
            yield from undocumented(node, own)


def test_functions_within_public_functions_say_what_they_do():
    sources = Path(swimbladder.__file__).parent.rglob("*.py")
    found = {path: [*undocumented(ast.parse(path.read_text("utf-8")))] for path in sources}
    assert {path: names for path, names in found.items() if names} == {}


FUNCTIONS = [name for name in sb.__all__ if inspect.isfunction(getattr(sb, name))]
NEVER_RAISE = {"preset_names", "step_metrics"}


def sections(docstring):
    """Return the lines of each numpydoc section of a docstring, by its heading."""
    lines, found, heading = inspect.cleandoc(docstring).splitlines(), {}, None
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line and below == "-" * len(line):
            heading = line
            found[heading] = []
        elif heading is not None and line.strip("-"):
            found[heading].append(line)
    return found


def named(lines):
    """Return the names at the margin of a section, of which a line may have several: ``a, b``."""
    return [name for line in lines if not line.startswith(" ") for name in line.split(", ")]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_says_what_it_takes_returns_and_raises(name):
    function = getattr(sb, name)
    signature, said = inspect.signature(function), sections(function.__doc__)
    kinds = {p.name: p.kind for p in signature.parameters.values()}
    known = [f"**{p}" if k is inspect.Parameter.VAR_KEYWORD else p for p, k in kinds.items()]
    documented = named(said.get("Parameters", []))
    assert set(documented) <= set(known), "no such parameter"
    assert len(documented) == len(set(documented)), "a parameter twice"
    assert {p for p in known if not p.startswith("**")} <= set(documented)
    assert ("Parameters" in said) == bool(known)
    if signature.return_annotation not in (None, "None"):
        assert said["Returns"]
    if name not in NEVER_RAISE:
        assert said["Raises"]
    assert [*said] == [s for s in ("Parameters", "Returns", "Raises") if s in said]
    for lines in said.values():
        assert not lines[0].startswith(" ")
        for line, below in zip(lines, [*lines[1:], ""], strict=True):
            assert line.startswith(" ") or below.startswith(" "), f"nothing is said of {line}"


# What options of a command are in Python: the function's own names for some, and fields of what it
# takes. Files, pictures and JSON are methods of the answer, or functions that write.
READERS = {
    "CastReading": [sb.read_cast],
    "Casts": [sb.read_cast],
    "LogCasts": [sb.read_cast],
    "LogReading": [sb.read_log],
}
RECORDS = {
    "ballast": [sb.Target, sb.Uncertainty],
    "board": [sb.Flights],
    "campaign": [sb.Floats, sb.Spread, sb.Workers],
    "energy": [sb.Thruster, sb.fit_pump, read_pump_runs],
    "firmware": [PoolOptions],
    "mission": [sb.Mission.limited],
    "plan": [Limits],
    "pool": [rules_of, check_waiting],
    "size": [sb.Dive, Parts.with_driver],
}
CALLED = {
    "cast": {"cast", "casts", "columns"},
    "logs": {"logs", "log"},
}
ELSEWHERE = {
    # where it is written, and as what
    *("out", "full", "json", "plot", "netcdf", "config", "begin"),
    # fields of the vehicle's file: vehicle.with_sensors(...), a [supervisor] table, its controller
    *("depth_noise", "depth_quantum", "time_limit", "law"),
    # other functions: fit_pump, paper_fits, Spread.identified, one mission of faults, predict_ahead
    *(
        "fit",
        "paper",
        "identified",
        "repeat",
        "mission",
        "horizons",
        "random_walk",
        "acceleration_noise",
    ),
    # the bottom of a mission: Mission.over; a file with a spread
    *("bottom_depth", "spread"),
    # a list that is printed
    *("list_scenarios", "seed"),
}


def groups_of(command):
    """Return the types of the parameters of a command's function: groups of options, and others."""
    function = command_of(command)
    hints = get_type_hints(getattr(function, "__wrapped__", function))
    return [kind for kind in hints.values() if isinstance(kind, type)]


def options(command):
    """Return (group, field) of every option of a command, and its arguments."""
    inner = getattr(command, "__wrapped__", command)
    for name, kind in get_type_hints(inner).items():
        if isinstance(kind, type) and issubclass(kind, Options):
            yield from ((kind.__name__, field.name) for field in fields(kind))
        elif name != "return":
            yield "", name


def names_of(function):
    """Return the names that a function or a record takes."""
    if function is Limits:
        return {*get_type_hints(Limits)}
    return set(inspect.signature(function).parameters)


FLOWN = sorted({*COMMANDS} - {"vehicle"})


def everything():
    """Return the parameters of all that is public, and the options of all commands."""
    takers = [getattr(sb, name) for name in sb.__all__ if not name.endswith("Error")]
    takers += [taker for several in RECORDS.values() for taker in several]
    python = set().union(*map(names_of, filter(callable, takers)))
    return python, {option for command in FLOWN for _, option in options(command_of(command))}


@pytest.mark.parametrize("command", sorted({*FLOWN} - {"pool"}))
def test_every_command_is_a_function_that_takes_the_same(command):
    name = command.replace("-", "_")
    function = getattr(sb, name)
    for group, option in options(command_of(command)):
        takers = [function, *RECORDS.get(name, []), *READERS.get(group, [])]
        known = set().union(*map(names_of, takers))
        called = CALLED.get(option, {option}) | {option}
        assert called & known or option in ELSEWHERE, f"{command}: {group} {option}"
