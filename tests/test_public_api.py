"""The public names: all there, all documented, none imported before it is used."""

import inspect
import subprocess
import sys

import pytest

import swimbladder


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
    assert set(swimbladder.__all__) <= set(dir(swimbladder))


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
    example, _, _ = rest.partition("\n\nThe map")
    names = {}
    exec(inspect.cleandoc("\n" + example), names)
    assert "overshoot_pct=14.6988" in capsys.readouterr().out
    assert names["dataset"].depth.attrs["positive"] == "down"


def test_the_version_is_the_one_that_is_installed():
    from importlib.metadata import version

    assert swimbladder.__version__ == version("swimbladder")
