"""Compiled code checks no index; here it does: an overrun array costs another its numbers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.prove
@pytest.mark.parametrize(
    "tests",
    [
        "tests/sim/mission/test_board.py",
        "tests/sim/mission/test_volume_laws.py",
        "tests/sim/mission/test_phase_laws.py",
        "tests/sim/closed_loop/test_floats.py",
        "tests/sim/closed_loop/test_supervised.py",
        "tests/sim/campaign/test_campaign.py",
    ],
)
def test_no_index_is_out_of_bounds(tests, tmp_path):
    checked = {"NUMBA_BOUNDSCHECK": "1", "SWIMBLADDER_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", tests],
        cwd=ROOT,
        env={**os.environ, **checked},
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
