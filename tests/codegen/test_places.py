"""Functions that change a law's state where it stands mean what they mean in Python."""

# ruff: noqa: ARG001
import math
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.codegen.c99 import write_c99
from swimbladder.codegen.c_places import in_place
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import twin
from swimbladder.control.law import Law, Measurement
from tests.codegen.build import Compiled
from tests.codegen.laws import bits


class P(NamedTuple):
    a: float  # -


class S(NamedTuple):
    x: float
    y: float
    z: float


def exchanged(s):
    return s._replace(x=s.y, y=s.x, z=s.z + 1.0)


def moved(p, s, by):
    if by > p.a:
        return s._replace(z=s.x + by, x=s.z)
    return s


def twice(p, s, by):
    s = moved(p, s, by)
    s = exchanged(s)
    if s.y > by:
        s = moved(p, s, s.y)
    return s._replace(y=by)


def largest(s):
    return max(max(s.x, s.y), s.z)


def step(p, state, m, reference):
    before = state.x
    s = exchanged(state)
    if m.depth > reference:
        s = twice(p, s, m.depth - before)
    s = s._replace(x=largest(s), y=s.x)
    return before + s.z, s, p.a


def remembers(p, state, m, reference):
    """Keeps the state as it was: a copy has to be made."""
    s = exchanged(state)
    return largest(state) - s.x, s, state.x


def compares(p, state, m, reference):
    """Has two states at once."""
    s = moved(p, state, reference)
    other = exchanged(s)
    if reference > largest(s):
        other = moved(p, other, largest(s))
    return s.x - other.x, other, 1.0


def chooses(p, state, m, reference):
    """One of its two states is not in its place."""
    s = exchanged(state) if reference > 0.0 else state
    return s.x, s, 1.0


def initial(p, m, reference):
    return S(0.0, reference, -0.0)


def law_of(step):
    return Law(
        name="places", summary="", command="voltage", parameters=P, state=S, units={"a": ""},
        step=step, initial=initial,
    )  # fmt: skip


EIGHTHS = st.integers(-32, 32).map(lambda n: n / 8)


@pytest.fixture(scope="module", params=[step, remembers, compares, chooses])
def law(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    made = law_of(request.param)
    return made, twin(made), Compiled(made, tmp_path_factory.mktemp("places"))


@given(numbers=st.lists(EIGHTHS, min_size=6, max_size=6))
def test_the_state_is_that_of_python_and_of_the_twin(law, numbers):
    plain, beside, compiled = law
    p, s, m = P(numbers[0]), S(*numbers[1:4]), Measurement(0.0, numbers[4], 0.0)
    said = plain.step(p, s, m, numbers[5])
    assert bits(beside.step(p, s, m, numbers[5])) == bits(said)
    assert bits(compiled.step(p, s, m, numbers[5])) == bits(said)
    assert bits(compiled.initial(p, m, numbers[5])) == bits(initial(p, m, numbers[5]))


@pytest.mark.parametrize(
    ("step", "placed"),
    [
        (step, {"exchanged", "moved", "twice"}), (remembers, set()), (compares, set()),
        (chooses, set()),
    ],
)  # fmt: skip
def test_what_is_changed_where_it_stands(step, placed):
    program = read_law(law_of(step))
    assert {f.name for f in in_place(program)} == placed
    source = write_c99(program).source
    assert ("static void swb_places_exchanged(swb_places_state *s)" in source) == bool(placed)


class Counts(NamedTuple):
    a: float
    b: float
    c: float
    d: float
    e: float
    f: float


def begin(p, m, reference):
    return Counts(0.0, 0.0, -0.0, 0.0, 0.0, 0.0)


def stay(p, state, m, reference):
    return 0.0, state, 1.0


@pytest.mark.usefixtures("gcc")
def test_a_state_of_zeros_keeps_its_sign(tmp_path):
    law = Law(
        name="zeros", summary="", command="voltage", parameters=P, state=Counts, units={"a": ""},
        step=stay, initial=begin,
    )  # fmt: skip
    assert "memset" in write_c99(read_law(law)).source
    said = Compiled(law, tmp_path).initial(P(1.0), Measurement(0.0, 0.0, 0.0), 0.0)
    assert [math.copysign(1.0, x) for x in said] == [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]
