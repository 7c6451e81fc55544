"""Programs that the tests of the firmware run; each test says which it needs."""

import os
import shutil
from pathlib import Path

import pytest


def _need(*programs: str) -> None:
    """Skip where a program is missing, or fail where SWIMBLADDER_REQUIRE asks for it."""
    missing = [p for p in programs if not (Path(p).exists() if "/" in p else shutil.which(p))]
    if not missing:
        return
    reason = f"not installed: {', '.join(missing)} (make tools)"
    if "avr" in os.environ.get("SWIMBLADDER_REQUIRE", "").split(","):
        pytest.fail(f"{reason}, and SWIMBLADDER_REQUIRE asks for it")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def gcc():
    _need("gcc", "g++")


@pytest.fixture(scope="session")
def clang():
    _need("clang")


@pytest.fixture(scope="session")
def cppcheck():
    _need("cppcheck")


@pytest.fixture(scope="session")
def frama_c():
    _need("frama-c")


@pytest.fixture(scope="session")
def avr():
    _need("gcc", "avr-gcc", "avr-size", "/usr/include/simavr/sim_avr.h")


@pytest.fixture(scope="session")
def arduino_core():
    _need("/usr/share/arduino/hardware/arduino/avr/cores/arduino/main.cpp")


@pytest.fixture(scope="session")
def arm():
    _need("arm-none-eabi-gcc")


@pytest.fixture(scope="session")
def qemu():
    _need("arm-none-eabi-gcc", "qemu-system-arm")
