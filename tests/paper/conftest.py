"""The evidence of the report, gathered once."""

import pytest

from swimbladder.paper.evidence import gather


@pytest.fixture(scope="session")
def evidence():
    return gather(2023)
