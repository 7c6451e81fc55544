"""What is given away: wheel, sdist, description, dependencies, lock and recipe say the same."""

import ast
import re
import sys
import sysconfig
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path
from zipfile import ZipFile

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from scripts import dist
from scripts.long_description import alone

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = {
    name: [Requirement(text) for text in texts]
    for name, texts in PROJECT["optional-dependencies"].items()
}
CORE = [Requirement(text) for text in PROJECT["dependencies"]]
LOCK = dist.pins((ROOT / "requirements.lock").read_text(encoding="utf-8"))
# What opens netCDF for xarray, which imports it by itself.
UNSEEN = {"h5netcdf"}
# What only the package that it is a part of can pin.
PARTS = {"llvmlite": "numba", "pydantic_core": "pydantic"}


USERS = {name: needs for name, needs in EXTRAS.items() if name not in ("dev", "docs")}
ALL = [*CORE, *(need for needs in EXTRAS.values() for need in needs)]


def names(needs):
    """Return the names of packages, as an index has them."""
    return {canonicalize_name(need.name) for need in needs}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the sdist of this tree."""
    return dist.build(ROOT, tmp_path_factory.mktemp("dist"))


def test_wheel_and_sdist_are_fit_for_an_index_and_alike(built):
    dist.check(*built, ROOT)


@pytest.mark.parametrize("name", ["swimbladder/extra.toml", "tests/test_it.py"])
def test_a_wheel_with_more_than_the_package_is_refused(name, built, tmp_path):
    wheel, sdist = built
    other = tmp_path / wheel.name
    with ZipFile(other, "w") as packed:
        for member, text in dist.contents(wheel).items():
            packed.writestr(member, text)
        packed.writestr(name, "")
    with pytest.raises(dist.FaultError, match=f"differ in {name}"):
        dist.check(other, sdist, ROOT)


def test_a_wheel_that_the_sdist_does_not_make_is_refused(built, tmp_path):
    wheel, sdist = built
    other = tmp_path / wheel.name
    with ZipFile(other, "w") as packed:
        for member, text in dist.contents(wheel).items():
            packed.writestr(member, text + b"#" * (member == "swimbladder/units.py"))
    with pytest.raises(dist.FaultError, match=r"of the sdist differ in swimbladder/units\.py$"):
        dist.check(other, sdist, ROOT)


@pytest.mark.slow
def test_the_installed_wheel_simulates_and_draws(built, tmp_path):
    packages = Path(sysconfig.get_path("purelib"))
    there = dist.Environment.beside(packages, tmp_path.resolve() / "environment")
    pip = (sys.executable, "-m", "pip", "--python", there.bin / "python", "install", "--quiet")
    dist.run(*pip, "--no-index", "--no-deps", built[0])
    dist.try_basics(there)


def test_the_description_has_no_link_into_the_tree(built):
    metadata = next(
        text.decode() for name, text in dist.contents(built[0]).items() if "METADATA" in name
    )
    _, description = metadata.split("\n\n", 1)
    assert "# swimbladder" in description
    outside = re.sub(r"^```.*?^```$", "", description, flags=re.MULTILINE | re.DOTALL)
    assert set(re.findall(r"\]\(([^)]*)\)", outside)) != set()
    assert not [at for at in re.findall(r"\]\(([^)]*)\)", outside) if not at.startswith("http")]
    assert "<!--" not in outside


def test_links_of_the_description_lead_to_the_source_where_it_is_known():
    page = (
        "![a picture](docs/a.png) of [this](docs/a.md#b), [that](https://x.org), [here](#c).\n"
        "<!-- not run -->\n```python\na[0](b)  # <!-- kept -->\n```\n"
    )
    code = "```python\na[0](b)  # <!-- kept -->\n```\n"
    assert alone(page, None) == " of this, [that](https://x.org), [here](#c).\n" + code
    assert alone(page, "https://host.org/us/") == (
        "![a picture](https://host.org/us/raw/HEAD/docs/a.png) of "
        "[this](https://host.org/us/blob/HEAD/docs/a.md#b), [that](https://x.org), [here](#c).\n"
        + code
    )


def imported(path):
    """Return the packages that a module imports when it runs, at its top or in a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    unused = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in set(ast.walk(tree)) - unused:
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.partition(".")[0]


def test_what_the_package_imports_is_what_it_needs():
    met = {name for path in (ROOT / "src").rglob("*.py") for name in imported(path)}
    outside = met - set(sys.stdlib_module_names) - {"swimbladder", "__future__"}
    known = packages_distributions()
    needed = {PARTS.get(name, canonicalize_name(known[name][0])) for name in outside}
    assert needed - set().union(*map(names, USERS.values())) | UNSEEN == names(CORE)


def test_extras_bring_what_their_code_asks_for():
    asked = {extra: library for extra, (library, _) in dist.EXTRAS.items()}
    source = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    called = dict(re.findall(r'optional\("(\w+)[\w.]*", "(\w+)"', source))
    assert {extra: library for library, extra in called.items()} == asked
    known = packages_distributions()
    for extra, needs in USERS.items():
        brought = names(needs).union(*(need.extras for need in needs))
        assert canonicalize_name(known[asked[extra]][0]) in brought


def test_versions_have_a_lower_bound_and_no_upper_one():
    for need in ALL:
        assert [one.operator for one in need.specifier] == [">="], str(need)
    assert PROJECT["requires-python"] == ">=3.11"


def test_developers_have_every_extra():
    texts = {str(need) for need in EXTRAS["dev"]}
    assert {str(need) for needs in USERS.values() for need in needs} <= texts


def test_the_lock_pins_all_that_is_needed_by_hashes():
    for need in ALL:
        line, _ = LOCK[canonicalize_name(need.name)]
        pinned = re.match(r"[\w.-]+(?:\[\w+\])?==([\w.]+)", line)
        assert pinned is not None, line
        assert Version(pinned[1]) in need.specifier, line
    assert all(hashes for _, hashes in LOCK.values())
    assert all("--hash" not in line and "\\" not in line for line, _ in LOCK.values())


def test_a_file_that_is_not_the_locks_is_a_fault():
    def report(name, digest):
        info = {"url": f"file:///{name}.whl", "archive_info": {"hashes": {"sha256": digest}}}
        return {"install": [{"metadata": {"name": name}, "download_info": info}]}

    good = min(LOCK["typing-extensions"][1])
    dist.check_hashes(report("typing_extensions", good), LOCK)
    dist.check_hashes(report("swimbladder", "0"), LOCK)
    for name, digest in (("typing_extensions", "0"), ("numpy", good), ("unheard-of", good)):
        with pytest.raises(dist.FaultError, match=f"no such file: file:///{name}"):
            dist.check_hashes(report(name, digest), LOCK)


def test_the_recipe_is_that_of_the_project():
    recipe = yaml.safe_load((ROOT / "recipe/recipe.yaml").read_text(encoding="utf-8"))
    context, needs = recipe["context"], recipe["requirements"]
    assert context["version"] == PROJECT["version"]
    assert f">={context['python_min']}" == PROJECT["requires-python"]
    named = {"matplotlib": "matplotlib-base"}  # conda's without Qt
    core = [f"{named.get(need.name, need.name)} {need.specifier}" for need in CORE]
    assert needs["run"] == ["python >=${{ python_min }}", *core]
    extras = {
        f"{name} {need.specifier}"
        for needed in USERS.values()
        for need in needed
        for name in (need.name, *need.extras)
    }
    assert needs["run_constraints"] == sorted(extras)
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]
    host = [text.replace(">=", " >=") for text in build["requires"]]
    assert needs["host"] == ["python ${{ python_min }}.*", "pip", *host]
    points = [f"{name} = {at}" for name, at in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == points
    about = recipe["about"]
    assert (about["summary"], about["license"]) == (PROJECT["description"], PROJECT["license"])


def test_the_citation_is_that_of_the_project():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (cited["title"], cited["license"]) == (PROJECT["name"], PROJECT["license"])
    assert {author["name"] for author in cited["authors"]} == {
        author["name"] for author in PROJECT["authors"]
    }


def test_interpreters_are_one_of_each_version_that_the_project_names(capsys):
    found = dist.interpreters(["no-such-python", sys.executable, sys.executable])
    version = "{}.{}".format(*sys.version_info)
    assert found == {version: sys.executable}
    said = capsys.readouterr().out
    missing = [f"3.{minor}" for minor in range(11, 15) if f"3.{minor}" != version]
    assert said == f"not at hand, and not tried: Python {', '.join(missing)}\n"


def test_without_an_interpreter_nothing_passes(capsys):
    assert dist.main(["no-such-python"]) == 1
    assert "PYTHONS names them" in capsys.readouterr().err
