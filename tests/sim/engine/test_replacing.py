"""`_replace` of named tuples in compiled code: what Python makes of it."""

from typing import NamedTuple

import numba
import pytest

from swimbladder.sim.closed_loop import dispatch


class Inner(NamedTuple):
    c: float
    n: int


class Outer(NamedTuple):
    a: float
    flag: bool
    inner: Inner


def once(r, x):
    return r._replace(a=x)


def several(r, x):
    return r._replace(flag=x > 2.0, inner=r.inner._replace(n=r.inner.n + 1, c=x))


def in_branches(r, x):
    if x > 2.0:
        r = r._replace(a=x)
    return r._replace(flag=True) if x > 1.0 else r


def by_a_variable(r, x):
    method = r._replace
    return method(a=x)


def chosen(r, x):
    method = (r if x > 2.0 else r._replace(a=-1.0))._replace
    return method(flag=False)


def in_a_loop(r, x):
    for k in range(5):
        r = r._replace(a=r.a + x, inner=r.inner._replace(n=k))
    return r


@pytest.mark.parametrize("x", [0.5, 1.5, 2.5])
@pytest.mark.parametrize("function", [once, several, in_branches, by_a_variable, chosen, in_a_loop])
def test_compiled_code_does_as_python(function, x):
    given = Outer(1.0, False, Inner(2.0, 3))
    made = numba.njit(function)(given, x)
    assert made == function(given, x)
    assert type(made) is Outer
    assert type(made.inner) is Inner


def test_python_does_the_same_by_the_function_that_it_becomes():
    given = Inner(2.0, 3)
    assert dispatch.replaced("n,c", given, 4, 5.0) == given._replace(n=4, c=5.0)
