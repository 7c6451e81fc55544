"""Functions that change a law's state where it stands mean what they mean in Python."""

# ruff: noqa: ARG001
import math
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.codegen.c99 import remarks, write_c99
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.tree import FLOAT, Field, Name, in_place, place_of
from swimbladder.codegen.twin import twin
from swimbladder.control.deadband import DeadbandParameters
from swimbladder.control.law import Law, Measurement
from swimbladder.control.observer import ObserverParameters
from swimbladder.control.registry import law_parameters
from swimbladder.sim.closed_loop import simulate, simulate_ensemble
from tests.codegen.build import Compiled
from tests.codegen.laws import bits
from tests.vehicles import paper


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


def later(s):
    """Return what is late.

    Its first sentence stands beside its C.
    """
    first, then, last = s.z, s.x, s.y
    first, then, last = last, first + 1.0, then
    return first - then * 2.0 + last * 4.0


def rotates(p, state, m, reference):
    """Gives several names new values at once, each from the old ones of those after the first."""
    a, b, c = state.x, state.y, state.z
    a, b, c = m.depth, a, b
    c, a, b = a + later(state), b + c, reference
    b, c, a = m.depth - a, reference, c
    return a - 2.0 * b + 4.0 * c, S(b, c, a), 1.0


def initial(p, m, reference):
    return S(0.0, reference, -0.0)


def law_of(step):
    return Law(
        name="places",
        summary="",
        command="voltage",
        parameters=P,
        state=S,
        step=step,
        initial=initial,
    )


EIGHTHS = st.integers(-32, 32).map(lambda n: n / 8)


@pytest.fixture(scope="module", params=[step, remembers, compares, chooses, rotates])
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
        (step, {"exchanged", "moved", "twice"}),
        (remembers, set()),
        (compares, set()),
        (chooses, set()),
    ],
)
def test_what_is_changed_where_it_stands(step, placed):
    program = read_law(law_of(step))
    assert {f.name for f in in_place(program)} == placed
    source = write_c99(program).source
    assert ("static void swb_places_exchanged(swb_places_state *s)" in source) == bool(placed)


def test_a_functions_first_sentence_stands_beside_its_c():
    source = write_c99(read_law(law_of(rotates))).source
    assert "/* Return what is late. */" in source
    assert "first sentence" not in source


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
        name="zeros",
        summary="",
        command="voltage",
        parameters=P,
        state=Counts,
        step=stay,
        initial=begin,
    )
    assert "memset" in write_c99(read_law(law)).source
    said = Compiled(law, tmp_path).initial(P(1.0), Measurement(0.0, 0.0, 0.0), 0.0)
    assert [math.copysign(1.0, x) for x in said] == [1.0, 1.0, -1.0, 1.0, 1.0, 1.0]


class Slope(NamedTuple):
    error: float  # m
    change: float  # m, over a sample, smoothed


class Share(NamedTuple):
    old: Annotated[float, ""]
    new: Annotated[float, ""]


class Gains(NamedTuple):
    k: Annotated[float, "V/m"]
    d: Annotated[float, "V/m"]
    share: Share


class Nested(NamedTuple):
    gains: Gains
    limit: Annotated[float, "V"]
    S_p: Annotated[float, "s"]


class Remembered(NamedTuple):
    slope: Slope
    ticks: float  # -


def followed(share, slope, error):
    change = share.old * slope.change + share.new * (error - slope.error)
    return Slope(error, change)


def nested_initial(p, m, reference):
    return Remembered(Slope(reference - m.depth, 0.0), 0.0)


def nested_step(p, state, m, reference):
    slope = followed(p.gains.share, state.slope, reference - m.depth)
    wanted = -p.gains.k * slope.error - p.gains.d * slope.change
    command = min(max(wanted, -p.limit), p.limit)
    return command, Remembered(slope, state.ticks + 1.0), p.S_p


NESTED = Law(
    name="nested",
    summary="a law of nested records",
    command="voltage",
    parameters=Nested,
    state=Remembered,
    step=nested_step,
    initial=nested_initial,
)


def test_the_names_that_lead_to_a_place_go_inward():
    of, names = Name("a", FLOAT), ("b", "c", "d", "e")
    for n, name in enumerate(names, 1):
        of = Field(of, name, FLOAT)
        assert place_of(of) == (Name("a", FLOAT), names[:n])


@pytest.mark.prove
@pytest.mark.usefixtures("gcc")
def test_a_law_of_nested_records_flies_and_its_c_agrees_to_the_bit(tmp_path):
    text = {"k": "1.5 V/m", "d": 4.0, "old": 0.7, "new": 0.3, "limit": "6 V"}
    p = law_parameters(NESTED, text, sample_time=0.3)
    assert p == Nested(Gains(1.5, 4.0, Share(0.7, 0.3)), 6.0, 0.3)
    compiled, beside, states = Compiled(NESTED, tmp_path), twin(NESTED), []

    def by_hand(seen, reference):
        state = states[-1] if states else NESTED.initial(p, seen, reference)
        command, after, _ = NESTED.step(p, state, seen, reference)
        states.append(after)
        assert bits(compiled.step(p, state, seen, reference)) == bits(
            beside.step(p, state, seen, reference)
        )
        return command

    run = dict(setpoints=[(0.0, 2.0)], start_depth=1.5, duration=60.0, sample_time=0.3, seed=1)
    alone = simulate(paper(), law=NESTED, parameters=p, **run)
    beside_it = simulate(paper(), law=by_hand, **run)
    np.testing.assert_allclose(alone.command, beside_it.command, rtol=0.0, atol=1e-9)
    varied = simulate_ensemble(
        paper(),
        law=NESTED,
        parameters=p,
        sample_time=0.3,
        setpoints=[(0.0, 2.0)],
        start_depth=1.5,
        duration=60.0,
        count=2,
        vary={"k": [1.5, 3.0]},
        keep="trajectory",
    )
    steeper = simulate(
        paper(),
        law=NESTED,
        parameters=p._replace(gains=p.gains._replace(k=3.0)),
        **run | {"seed": None},
    )
    np.testing.assert_allclose(varied["command"][:, 1], steeper.command, rtol=0.0, atol=1e-9)


def test_a_comment_stays_beside_its_own_field():
    """A field without one does not take that of the next."""
    said = remarks(DeadbandParameters)
    assert said["T2"] == "s"
    assert said["psi"] == "m3/m, neutral volume per depth"
    assert "model" not in remarks(ObserverParameters)
