"""What every test may lean on: no window, a thread, no deadline on compilation, measured data."""

import gc
import os
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

os.environ["MPLBACKEND"] = "Agg"
# A worker a core: matrices as small as ours only make the threads of two workers wait for each
# other. Set before numpy is imported, and for the commands that tests run.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The first example of a property may compile a kernel. The examples are the same in every run, so
# that a change is judged by what it changes; `make prove` hunts for new ones (profile "prove", with
# --hypothesis-seed), and what it finds is kept as an @example.
hypothesis.settings.register_profile(
    "swimbladder", deadline=None, derandomize=True, max_examples=60
)
hypothesis.settings.register_profile(
    "prove",
    deadline=None,
    derandomize=False,  # another default holds where CI is set
    max_examples=1000,
    print_blob=True,
)
hypothesis.settings.load_profile("swimbladder")


_SLOW = 20  # a test that is marked so takes as long as so many others


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest, so that no worker is left alone with one."""
    weights = Counter[Path]()
    for item in items:
        weights[item.path] += _SLOW if item.get_closest_marker("slow") else 1
    items.sort(key=lambda item: (-weights[item.path], item.path))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[Any, Any, Any]:
    """Let a second worker collect from the end: each finds half of the tests compiled by the other.

    To rewrite the assertions of all files takes 10 s.
    """
    report = yield
    if isinstance(collector, pytest.Dir) and os.environ.get("PYTEST_XDIST_WORKER") == "gw1":
        report.result.reverse()
    return report


def pytest_collection_finish() -> None:
    """Leave what was imported and collected to no garbage collector; compilers make little."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of measured data; without it a test skips, or fails where the data is required."""
    folder = os.environ.get("SWIMBLADDER_DATA", "")
    if not folder:
        reason = "SWIMBLADDER_DATA is not set: it names the folder of measured data"
        if "data" in os.environ.get("SWIMBLADDER_REQUIRE", "").split(","):
            pytest.fail(f"{reason}, and SWIMBLADDER_REQUIRE asks for it")
        pytest.skip(reason)
    path = Path(folder)
    if not path.is_dir():
        pytest.fail(f"SWIMBLADDER_DATA={folder} is not a folder")
    return path
