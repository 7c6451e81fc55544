"""The site: its gallery runs and draws with units, its reference is whole, its references lead."""

import ast
import inspect
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import swimbladder as sb

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GALLERY = DOCS / "gallery"
EXAMPLES = sorted(GALLERY.glob("*/plot_*.py"))
MADE = ("auto_gallery", "generated", "backreferences")


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_an_example_of_the_gallery_draws_with_units(example, monkeypatch):
    monkeypatch.chdir(example.parent)  # it may read what stands beside it, and leaves nothing there
    beside = set(example.parent.iterdir())
    plt.close("all")
    last = run(example)
    figures = [plt.figure(number) for number in plt.get_fignums()]
    if isinstance(last, Figure):
        figures.append(last)
    drawn = [a for figure in figures for a in figure.axes if a.axison and a.has_data()]
    assert drawn
    for axes in drawn:
        bar = axes.get_label() == "<colorbar>"  # has one axis
        labels = [axes.get_ylabel() or axes.get_xlabel()] if bar else _labels(axes, drawn)
        assert all(labels), f"{axes}: {labels}"
        assert any(re.search(r"\[.+\]|,", label) for label in labels), f"no unit: {labels}"
    plt.close("all")
    assert set(example.parent.iterdir()) == beside


def run(example: Path) -> object:
    """Run an example, as the gallery does; return the value that it ends in."""
    tree = ast.parse(example.read_text(encoding="utf-8"))
    if isinstance(tree.body[-1], ast.Expr):
        name = ast.Name("last", ast.Store())
        tree.body[-1] = ast.Assign(targets=[name], value=tree.body[-1].value)
    names: dict[str, object] = {"__name__": "__main__", "last": None}
    exec(compile(ast.fix_missing_locations(tree), str(example), "exec"), names)
    return names["last"]


def _labels(axes: plt.Axes, drawn: list[plt.Axes]) -> list[str]:
    """Return the labels of both axes, or those of the panels below and to the left."""
    found = []
    for which, at in ("x", "x0"), ("y", "y0"):
        place = getattr(axes.get_position(), at)
        line = [a for a in drawn if a.figure is axes.figure]
        line = [a for a in line if abs(getattr(a.get_position(), at) - place) < 0.02]
        texts = [getattr(a, f"get_{which}label")() for a in (axes, *line)]
        texts += [", ".join(_names(getattr(a, f"get_{which}ticklabels")())) for a in line]
        found.append(next(filter(None, texts), ""))
    return found


def _names(ticks: list[Text]) -> list[str]:
    return [tick.get_text() for tick in ticks if re.search("[a-z]{3}", tick.get_text())]


def test_an_example_imports_what_a_reader_would():
    assert EXAMPLES
    for example in EXAMPLES:
        text = example.read_text(encoding="utf-8")
        assert "import swimbladder as sb\n" in text, example
        assert "from swimbladder" not in text, example
        assert re.match(r'"""\n(.+)\n=+\n\n', text), f"{example} begins with its title"


def test_the_reference_lists_every_public_name_and_every_answer():
    listed = re.findall(r"^   ([\w.]+)$", (DOCS / "api" / "index.rst").read_text(), re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert {name for name in listed if "." not in name} == set(sb.__all__)
    answers = {name.rpartition(".")[2] for name in listed if "." in name}
    for name in listed:
        module, _, last = f"swimbladder.{name}".rpartition(".")
        assert hasattr(import_module(module), last), name
    for name in sb.__all__:
        function = getattr(sb, name)
        if inspect.isfunction(function):
            said = inspect.signature(function, eval_str=False).return_annotation
            text = said if isinstance(said, str) else getattr(said, "__name__", str(said))
            last = text.split("[")[0].split(" | ")[0].rpartition(".")[2]
            assert last in answers | set(sb.__all__) | {"dict", "list", "Path", "Dataset"}, name


def build(folder: Path, builder: str) -> set[str]:
    """Build all but the gallery's pictures without a warning; return what lies in the site."""
    shutil.copytree(DOCS, folder / "docs", ignore=shutil.ignore_patterns(*MADE))
    for page in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        shutil.copy(ROOT / page, folder)
    options = ["-W", "--keep-going", "-q", "-b", builder, "-D", "plot_gallery=0"]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, str(folder / "docs"), str(folder / "site")],
        env={**os.environ, "MPLBACKEND": "Agg"},
        text=True,
        capture_output=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    site = folder / "site"
    return {path.relative_to(site).as_posix() for path in site.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_the_site_has_no_wrong_reference(tmp_path):
    """Read and resolved, and not written: references, headings, docstrings, what groups have."""
    read = build(tmp_path, "dummy")
    assert ".doctrees/api/generated/swimbladder.tune.doctree" in read
    for example in EXAMPLES:
        place = f"auto_gallery/{example.parent.name}/{example.stem}"
        assert f".doctrees/{place}.doctree" in read
        assert (tmp_path / "docs" / f"{place}.ipynb").exists()


@pytest.mark.prove
def test_the_site_builds_without_a_warning(tmp_path):
    pages = build(tmp_path, "html")
    assert {"index.html", "search.html", "api/generated/swimbladder.tune.html"} <= pages
    for example in EXAMPLES:
        assert f"auto_gallery/{example.parent.name}/{example.stem}.html" in pages


def test_every_how_to_has_a_picture_and_every_picture_an_example():
    text = (DOCS / "conf.py").read_text(encoding="utf-8")
    pictures = dict(re.findall(r'^    "([\w/-]+)": "(\w+/plot_\w+)",$', text, re.MULTILINE))
    pages = {f"how-to/{path.stem}" for path in (DOCS / "how-to").glob("*.md")}
    assert pages == {page for page in pictures if page.startswith("how-to/")}
    assert all((DOCS / f"{page}.md").is_file() for page in pictures)
    assert set(pictures.values()) <= {f"{e.parent.name}/{e.stem}" for e in EXAMPLES}
