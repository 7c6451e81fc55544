"""The evidence of the report, gathered once."""

import pytest

from swimbladder.reproduce.evidence import gather


@pytest.fixture(scope="session")
def evidence():
    return gather(2023)
