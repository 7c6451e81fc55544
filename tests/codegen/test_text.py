"""How C is written: names that are free, lines that are short enough, functions that are needed."""

import re

import numpy as np
import pytest

from swimbladder.codegen import c99, tree
from swimbladder.codegen.c99 import c_field, c_law, c_local, c_number, shortened, wrapped

BONDS = [(", ", " && ", " || "), (" ? ", " : ", " + ", " - "), (" * ", " / ")]


def random_line(random):
    """Return a statement of names and operators, with an indent and here and there no operator."""
    words = ["x", "state->depth", "swb_min(a", "b)", "1.5f", "some_longer_name_of_a_value"]
    marks = [mark for marks in BONDS for mark in marks]
    text = str(random.choice(words))
    for _ in range(random.integers(1, 30)):
        text += str(random.choice(marks)) + str(random.choice(words))
    return "    " * int(random.integers(0, 3)) + text + ";"


def places(line, marks, begin, end):
    """Return where a line may be broken at these marks: after a comma, before an operator."""
    hits = [(hit, mark) for mark in marks for hit in re.finditer(re.escape(mark), line)]
    return [h.start() + (m == ", ") for h, m in hits if h.start() > begin and h.end() < end]


def broken(line, width):
    """Return a line broken at the last of its weakest bonds that fits, while it is too long."""
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    done = []
    while len(line) > width:
        fits = [places(line, marks, len(indent), width) for marks in BONDS]
        at = next((max(found) for found in fits if found), 0)
        if not at:  # after the first comma beyond, or nowhere
            beyond = line.find(", ", width)
            if beyond < 0:
                break
            at = beyond + 1
        done.append(line[:at].rstrip())
        line = indent + line[at:].lstrip()
    return [*done, line]


@pytest.mark.parametrize("width", [100, 40])
def test_lines_are_broken_at_their_weakest_bonds(width):
    random, longest = np.random.default_rng(1), 0
    for _ in range(400):
        line = random_line(random)
        lines = wrapped(line, width).split("\n")
        assert lines == broken(line, width)
        assert " ".join(part.strip() for part in lines) == line.strip()
        longest = max(longest, len(lines))
    assert longest > 3


def test_a_line_that_is_just_short_enough_stays_and_one_without_bonds_too():
    assert wrapped("a" * 60 + ", " + "b" * 38) == "a" * 60 + ", " + "b" * 38
    assert wrapped("a" * 60 + ", " + "b" * 39) == "a" * 60 + ",\n    " + "b" * 39
    assert wrapped("  " + "a" * 120) == "  " + "a" * 120
    beyond = "f(" + "a" * 120 + ", b)"
    assert wrapped(beyond) == "f(" + "a" * 120 + ",\n    b)"


def test_a_name_is_free_and_no_word_of_c():
    taken = {"x"}
    given = [c_local(name, taken) for name in ("x", "x", "__y_", "double", "__", "__")]
    assert given == ["x_", "x__", "y", "double_", "unused", "unused_"]
    assert len({*given, "x"}) == len(given) + 1
    assert taken == {"x", *given}
    assert [c_field(name) for name in ("depth", "short", "sq")] == ["depth", "short_", "sq_"]
    assert c_law("position-pid") == "position_pid"


def test_numbers_counts_and_truths():
    assert c_number(3.0, tree.COUNT) == "3u"
    assert [c_number(x, tree.BOOL) for x in (0.0, 1.0)] == ["false", "true"]
    assert c_number(3.0, tree.FLOAT) == "3.0f"


def test_a_comment_ends_where_it_should():
    assert shortened("Return ``x`` */ of it.") == "Return x * / of it"


def test_helpers_that_are_called_and_those_that_they_call():
    helpers = {"a": "x = b(1);", "b": "y = cc(2);", "c": "", "cc": "", "d": "a(1);"}
    assert c99._used("a(3);", helpers) == {"a", "b", "cc", "c"}  # c( stands in cc(
    assert c99._used("a + b;", helpers) == set()


def test_a_helper_has_a_name_of_its_own():
    types = {"swb_law_found"}
    names = ["swb_law_found", "swb_law_step", "swb_law_my_initial", "swb_law_other"]
    assert [c99._helper(name, types) for name in names] == [
        "swb_law_found_value",
        "swb_law_step_value",
        "swb_law_my_initial_value",
        "swb_law_other",
    ]


def test_what_mentions_a_variable():
    """Neither a field of that name nor a longer word does."""
    assert c99._mentions("y = x + 1;", "x")
    for text in ("y = s.x;", "y = s->x;", "y = xx;", "y = ax;"):
        assert not c99._mentions(text, "x")


def test_places_that_are_the_same_or_within_each_other():
    assert c99._meet(("a",), ("a", "b"))
    assert c99._meet(("a", "b"), ("a",))
    assert c99._meet(("a", "b"), ("a", "b"))
    assert not c99._meet(("a", "b"), ("a", "c"))


def test_only_a_positive_zero_is_one_that_memset_writes():
    zeros = [c99._is_zero(tree.Number(x)) for x in (0.0, -0.0, 1.0)]
    assert zeros == [True, False, False]
    assert not c99._is_zero(tree.Name("x", tree.FLOAT))
