"""What a law may be made of: each construct means in C and in the twin what it means in Python."""

# ruff: noqa: ARG001, F821
import math
import subprocess
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from swimbladder.codegen.c99 import c_float, write_c99
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import twin
from swimbladder.control.law import NEVER, Count, Law, Measurement, less, more
from swimbladder.errors import InputError
from tests.codegen import odd
from tests.codegen.build import STRICT, Compiled, run, write
from tests.codegen.laws import bits
from tests.codegen.odd import ODD, Found, OddParameters, OddState, Slope
from tests.examples import examples

TWIN = twin(ODD)
# Eighths of small numbers: sums and products are exact in float32 as in Python's own floats.
EIGHTHS = st.integers(-32, 32).map(lambda n: n / 8)
COUNTS = st.one_of(st.integers(0, 9), st.integers(0, NEVER), st.integers(NEVER - 9, NEVER))


@pytest.fixture(scope="module")
def compiled(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    return Compiled(ODD, tmp_path_factory.mktemp("odd"))


@examples(500)
@given(
    parameters=st.builds(
        OddParameters, st.builds(Slope, EIGHTHS), EIGHTHS, EIGHTHS, EIGHTHS, COUNTS
    ),
    state=st.builds(OddState, EIGHTHS, st.builds(Found, EIGHTHS, EIGHTHS), COUNTS, st.booleans()),
    seen=st.builds(Measurement, EIGHTHS, EIGHTHS, EIGHTHS),
    reference=st.one_of(EIGHTHS, st.just(math.inf)),
)
def test_every_construct_means_what_it_means_in_python(parameters, state, seen, reference):
    said = odd.step(parameters, state, seen, reference)
    assert bits(TWIN.step(parameters, state, seen, reference)) == bits(said)
    first = odd.initial(parameters, seen, reference)
    assert bits(TWIN.initial(parameters, seen, reference)) == bits(first)


@examples(1000)
@given(
    numbers=st.lists(st.one_of(EIGHTHS, st.floats(width=32)), min_size=11, max_size=11),
    most=COUNTS,
    n=COUNTS,
    on=st.booleans(),
)
def test_every_construct_is_the_same_to_the_bit_in_c(compiled, numbers, most, n, on):
    p = OddParameters(Slope(numbers[0]), *numbers[1:4], most)
    s = OddState(numbers[4], Found(*numbers[5:7]), n, on)
    m = Measurement(*numbers[7:10])
    reference = numbers[10]
    assert bits(compiled.step(p, s, m, reference)) == bits(TWIN.step(p, s, m, reference))
    assert bits(compiled.initial(p, m, reference)) == bits(TWIN.initial(p, m, reference))


@pytest.mark.parametrize("compiler", ["gcc", "clang", "avr-gcc", "arm-none-eabi-gcc"])
def test_every_construct_compiles_without_a_warning(compiler, request, tmp_path):
    tool = {"avr-gcc": "avr", "arm-none-eabi-gcc": "arm"}.get(compiler, compiler)
    request.getfixturevalue(tool)
    source = write(ODD, tmp_path)
    flags = [flag for flag in STRICT if flag != "-Wdouble-promotion" or tool != "avr"]
    run(compiler, *flags, "-O2", "-c", tmp_path / source.source_name, "-o", tmp_path / "o")


@pytest.mark.usefixtures("cppcheck")
def test_every_construct_pleases_cppcheck(tmp_path):
    write(ODD, tmp_path)
    done = subprocess.run(
        ["cppcheck", "--quiet", "--enable=warning,portability", "--error-exitcode=1", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_nothing_of_double_precision_is_in_the_c():
    written = write_c99(read_law(ODD))
    for word in ("double", "fmin", "fmax", "malloc", " sqrt(", "isnan"):
        assert word not in written.source.replace("SWB_double", ""), word
    assert (
        "typedef struct {\n    float near;\n    float far;\n} swb_odd_one_pair;" in written.source
    )


@example(3.4028234663852886e38)
@example(48313712.0)  # 48313710 is halfway to the float below
@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_literal_is_the_float32_it_stands_for(x):
    text = c_float(x).removesuffix("f")
    exact = Fraction(text)  # what the compiler rounds
    with np.errstate(over="ignore"):
        below, above = np.nextafter(np.float32(x), np.float32([-np.inf, np.inf]))
    for other in (float(below), float(above)):
        if math.isfinite(other):
            assert abs(exact - Fraction(x)) < abs(exact - Fraction(other))


@given(n=COUNTS, by=COUNTS)
def test_counts_stay_within_16_bits(n, by):
    assert more(n, by) == sorted((0, n + by, 2**16 - 1))[1]
    assert less(n, by) == sorted((0, n - by, 2**16 - 1))[1]


def test_special_literals():
    assert [c_float(x) for x in (math.nan, math.inf, -math.inf, 0.1, 1.0)] == [
        "NAN",
        "INFINITY",
        "-INFINITY",
        "0.1f",
        "1.0f",
    ]


class P(NamedTuple):
    a: float
    n: "int" = 1


class Q(NamedTuple):
    a: float


class S(NamedTuple):
    x: float
    n: Count = 0


class T(NamedTuple):
    y: list


HUGE = 1e300
NAMES = {"gain": 2.0}
GLOBAL = 1.0
OWED = -1


def start(p, m, r):
    return S(m.depth)


def recursive(x):
    return recursive(x - 1.0) if x > 0.0 else x


def helper(x, y=1.0):
    return x


def once(x):
    return x


def nothing(x):
    if x > 0.0:
        return x


# Each of these is refused: (its step, what is said, the text of the line it is said of).
def power(p, s, m, r):
    return p.a**2, s, 1.0


def sine(p, s, m, r):
    return math.sin(r), s, 1.0


def method(p, s, m, r):
    return s.count(r), s, 1.0


def replaced_field(p, s, m, r):
    return r, s._replace(z=1.0), 1.0


def replaced_type(p, s, m, r):
    return r, s._replace(x=r > 1.0), 1.0


def replaced_nothing(p, s, m, r):
    return r, S(r)._replace(x=1.0), 1.0


def while_(p, s, m, r):
    while r > 0.0:
        r = r - 1.0
    return r, s, 1.0


def listed(p, s, m, r):
    return sum([r, r]), s, 1.0


def indexed(p, s, m, r):
    return s[0], s, 1.0


def text(p, s, m, r):
    return "r", s, 1.0


def truthy(p, s, m, r):
    if r:
        r = 1.0
    return r, s, 1.0


def perhaps(p, s, m, r):
    if r > 0.0:
        x = 1.0
    return x, s, 1.0


def early(p, s, m, r):
    for i in range(3):
        y = x if i > 0.0 else r
        x = y
    return x, s, 1.0


def other_type(p, s, m, r):
    r = r > 1.0
    return r, s, 1.0


def variable_range(p, s, m, r):
    for _ in range(r):
        r = r + 1.0
    return r, s, 1.0


def out_of_loop(p, s, m, r):
    for _ in range(3):
        if r > 0.0:
            return r, s, 1.0
    return r, s, 1.0


def three_least(p, s, m, r):
    return min(r, 1.0, 2.0), s, 1.0


def huge(p, s, m, r):
    return r * HUGE, s, 1.0


def tiny(p, s, m, r):
    return r * 1e-60, s, 1.0


def looked_up(p, s, m, r):
    return r * NAMES["gain"], s, 1.0


def calls_itself(p, s, m, r):
    return recursive(r), s, 1.0


def defaulted(p, s, m, r):
    return helper(r), s, 1.0


def too_many(p, s, m, r):
    return once(r, r), s, 1.0


def no_return(p, s, m, r):
    return nothing(r), s, 1.0


def no_field(p, s, m, r):
    return p.b, s, 1.0


def wrong_field(p, s, m, r):
    return r, S(r > 0.0), 1.0


def other_tuple(p, s, m, r):
    return r, T(r), 1.0


def not_the_state(p, s, m, r):
    return r, p, 1.0


def only_two(p, s, m, r):
    return r, s


def two_ways(p, s, m, r):
    if r > 0.0:
        return r, s, 1.0
    return r, s


def assigned_field(p, s, m, r):
    s.x = r
    return r, s, 1.0


def tried(p, s, m, r):
    try:
        return r, s, 1.0
    except ValueError:
        return r, s, 1.0


def global_(p, s, m, r):
    global GLOBAL
    GLOBAL = r
    return r, s, 1.0


def divided(p, s, m, r):
    return r // 2.0, s, 1.0


def printed(p, s, m, r):
    print(r)
    return r, s, 1.0


def starred(p, s, m, r):
    return once(*s), s, 1.0


def dead(p, s, m, r):
    return r, s, 1.0
    return r, s, 2.0


def in_(p, s, m, r):
    return (1.0 if r in (1.0, 2.0) else 0.0), s, 1.0


def walrus(p, s, m, r):
    return (y := r) + y, s, 1.0


def count_added(p, s, m, r):
    return r, s._replace(n=s.n + 1), 1.0


def count_compared(p, s, m, r):
    return r, s._replace(n=less(s.n, 1) if s.n > r else 0), 1.0


def count_beyond(p, s, m, r):
    return r, s._replace(n=more(s.n, 65536)), 1.0


def count_owed(p, s, m, r):
    return r, s._replace(n=more(s.n, OWED)), 1.0


def count_below(p, s, m, r):
    return r, s._replace(n=more(s.n, -1)), 1.0


def count_halved(p, s, m, r):
    return r, s._replace(n=s.n if r > 0.0 else 0.5), 1.0


def count_turned(p, s, m, r):
    return r, s._replace(n=~s.n), 1.0


def bits_of_floats(p, s, m, r):
    return r, s._replace(n=r | 1), 1.0


@pytest.mark.parametrize(
    ("step", "says", "line"),
    [
        (count_added, "Write float(n)", "n=s.n + 1"),
        (count_compared, "this is no count", "s.n > r"),
        (count_beyond, "not 0 to 65535", "65536"),
        (count_owed, "not 0 to 65535", "OWED"),
        (count_below, "this is no count", "more(s.n, -1)"),
        (count_halved, "this is no count", "0.5"),
        (count_turned, "Use & and |", "~s.n"),
        (bits_of_floats, "this is no count", "r | 1"),
        (power, "Multiply", "p.a**2"),
        (sine, "where the parameters are made", "math.sin"),
        (method, "calls no methods", "s.count(r)"),
        (replaced_field, "not its fields", "_replace(z=1.0)"),
        (replaced_type, "has another type", "_replace(x=r > 1.0)"),
        (replaced_nothing, "no name of a NamedTuple", "S(r)._replace"),
        (while_, "'while' statement", "while r"),
        (listed, "where the parameters are made", "sum([r, r])"),
        (indexed, "'subscript'", "s[0]"),
        (text, "literals are numbers", '"r"'),
        (truthy, "not true or false", "if r:"),
        (perhaps, "not for certain", "return x"),
        (early, "not for certain", "y = x if"),
        (other_type, "changes its type", "r = r > 1.0"),
        (variable_range, "constant range", "range(r)"),
        (out_of_loop, "out of a loop", "for _ in range(3)"),
        (three_least, "takes 2 numbers", "min(r, 1.0, 2.0)"),
        (huge, "beyond float32", "HUGE"),
        (tiny, "beyond float32", "1e-60"),
        (looked_up, "'subscript'", "NAMES["),
        (calls_itself, "do not call themselves", "recursive(x - 1.0)"),
        (defaulted, "not those of (x, y)", "helper(r), s"),
        (too_many, "not those of (x)", "once(r, r)"),
        (no_return, "without a return", "def nothing"),
        (no_field, "no such field", "p.b"),
        (wrong_field, "has another type", "S(r > 0.0)"),
        (other_tuple, "'y' of T is no float", "T(r)"),
        (not_the_state, "does not return (command, state", "def not_the_state"),
        (only_two, "does not return (command, state", "def only_two"),
        (two_ways, "different types", "return r, s"),
        (assigned_field, "plain names only", "s.x = r"),
        (tried, "'try' statement", "try:"),
        (global_, "'global' statement", "global GLOBAL"),
        (divided, "Divide with /", "r // 2.0"),
        (printed, "'expr' statement", "print(r)"),
        (starred, "no * and **", "once(*s)"),
        (dead, "never done", "return r, s, 2.0"),
        (in_, "compares numbers only", "r in"),
        (walrus, "'namedexpr'", "(y := r)"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_what_is_refused_names_file_line_and_remedy(step, says, line):
    law = Law(
        name="wrong",
        summary="",
        command="voltage",
        parameters=Q,
        state=S,
        step=step,
        initial=start,
    )
    with pytest.raises(InputError) as caught:
        read_law(law)
    error = caught.value
    assert says in str(error)
    assert error.remedy
    assert str(error.file) == __file__
    with open(__file__, encoding="utf-8") as file:
        assert line in file.read().splitlines()[error.line - 1]


def most_turns(p, s, m, r):
    for _ in range(32767):
        r = r + 1.0
    return r, s, 1.0


def too_many_turns(p, s, m, r):
    for _ in range(32768):
        r = r + 1.0
    return r, s, 1.0


def test_loops_turn_as_often_as_an_int_of_16_bits_counts():
    made = {
        "name": "turns",
        "summary": "",
        "command": "voltage",
        "parameters": Q,
        "state": S,
        "initial": start,
    }
    read_law(Law(step=most_turns, **made))
    with pytest.raises(InputError, match="not 1 to 32767 turns"):
        read_law(Law(step=too_many_turns, **made))


def test_parameters_that_are_no_floats_are_refused():
    law = Law(
        name="wrong",
        summary="",
        command="voltage",
        parameters=P,
        state=S,
        step=power,
        initial=start,
    )
    with pytest.raises(InputError, match="'n' of P is no float"):
        read_law(law)


class B(NamedTuple):
    within: S
    x: float


def test_two_numbers_of_one_name_are_refused():
    law = Law(
        name="wrong",
        summary="",
        command="voltage",
        parameters=B,
        state=S,
        step=power,
        initial=start,
    )
    with pytest.raises(InputError, match="'x' stands in B twice") as caught:
        read_law(law)
    assert "a name of its own" in str(caught.value)


def test_one_class_for_parameters_and_state_is_refused():
    law = Law(
        name="wrong",
        summary="",
        command="voltage",
        parameters=Q,
        state=Q,
        step=power,
        initial=start,
    )
    with pytest.raises(InputError, match="same class"):
        read_law(law)


def test_a_function_without_source_is_refused():
    space = {}
    exec("def step(p, s, m, r):\n    return r, s, 1.0\n", space)
    law = Law(
        name="wrong",
        summary="",
        command="voltage",
        parameters=Q,
        state=S,
        step=space["step"],
        initial=start,
    )
    with pytest.raises(InputError, match="cannot be read"):
        read_law(law)
