"""Programs that the tests of the firmware run; each test says which it needs."""

import os
import shutil

import pytest


def _need(*programs: str) -> None:
    """Skip where a program is missing, or fail where SWIMBLADDER_REQUIRE asks for it."""
    missing = [program for program in programs if shutil.which(program) is None]
    if not missing:
        return
    reason = f"not installed: {', '.join(missing)} (see CONTRIBUTING.md)"
    if "avr" in os.environ.get("SWIMBLADDER_REQUIRE", "").split(","):
        pytest.fail(f"{reason}, and SWIMBLADDER_REQUIRE asks for it")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def gcc():
    _need("gcc")


@pytest.fixture(scope="session")
def clang():
    _need("clang")


@pytest.fixture(scope="session")
def cppcheck():
    _need("cppcheck")


@pytest.fixture(scope="session")
def avr():
    _need("gcc", "avr-gcc", "avr-size", "simavr")


@pytest.fixture(scope="session")
def arm():
    _need("arm-none-eabi-gcc")
