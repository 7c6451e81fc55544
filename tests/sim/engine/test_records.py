"""Records of kernels: numbers by name, and what a kernel costs on the way in."""

import copy
import pickle
import sys

import numba
import pytest

from swimbladder.sim.engine.rodas.records import NOW, made


def test_a_record_is_given_to_a_kernel_without_running_python_code():
    """What Ctrl-C raises in Python code that Numba runs to unbox an argument may get lost."""

    @numba.njit
    def sum_of(x):
        return x.t + x.z

    now = made(NOW)
    now.t, now.z = 2.0, 3.0
    sum_of(now)
    ran = []
    sys.setprofile(lambda frame, event, _: ran.append(frame.f_code) if event == "call" else None)
    try:
        found = sum_of(now)
    finally:
        sys.setprofile(None)
    assert found == 5.0
    assert {code.co_name for code in ran} <= {"sum_of"}  # a kernel shows itself to a profiler


def test_a_record_is_copied_and_kept_with_its_fields():
    now = made(NOW)
    now.t, now.law[3] = 5.0, 7.0
    twins = copy.deepcopy(now), pickle.loads(pickle.dumps(now)), made(NOW, now)
    now.t = 6.0
    assert [(twin.t, twin.law[3]) for twin in twins] == [(5.0, 7.0)] * 3
    with pytest.raises(AttributeError, match="no field 'depth'"):
        _ = now.depth
