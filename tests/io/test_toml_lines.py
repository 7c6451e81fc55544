"""The lines of keys, checked against texts whose lines are known by construction."""

import tomllib

from hypothesis import given
from hypothesis import strategies as st

from swimbladder.io.config import key_lines
from swimbladder.vehicle.schema import dotted

TEXT = '''\
# hull.psi = 3
top = "a # b ] = \\" }"
"quoted key" = 'single \\'   # comment

[hull]
psi = 4
range = [
    1, # one
    [2, 3],
    { low = 1, "high one" = "]" },
]
a.b.c = """
psi = 5
\\""" still """"
after = \'\'\'
[no]
\'\'\'

[[setpoints]]
time = 0
[[setpoints]]
time = 1
point = { depth = 3, more = { x = 1 } }
[setpoints.inner]
deep = true
[ x . "y z" ]
date = 2024-05-02T10:00:00Z
'''


def test_every_kind_of_key_and_value():
    lines = key_lines(TEXT)
    expected = {
        "top": 2,
        '"quoted key"': 3,
        "hull": 5,
        "hull.psi": 6,
        "hull.range": 7,
        "hull.range[0]": 8,
        "hull.range[1]": 9,
        "hull.range[1][1]": 9,
        "hull.range[2].low": 10,
        'hull.range[2]."high one"': 10,
        "hull.a": 12,
        "hull.a.b.c": 12,
        "hull.after": 15,
        "setpoints": 19,
        "setpoints[0]": 19,
        "setpoints[0].time": 20,
        "setpoints[1]": 21,
        "setpoints[1].time": 22,
        "setpoints[1].point.depth": 23,
        "setpoints[1].point.more.x": 23,
        "setpoints[1].inner": 24,
        "setpoints[1].inner.deep": 25,
        'x."y z"': 26,
        'x."y z".date': 27,
    }
    assert expected.items() <= lines.items()
    assert "no" not in lines


def places(value, path=()):
    """Every place in what tomllib read."""
    if path:
        yield dotted(path)
    if isinstance(value, dict):
        for key, item in value.items():
            yield from places(item, (*path, key))
    if isinstance(value, list):
        for index, item in enumerate(value):
            yield from places(item, (*path, index))


def test_no_place_is_missed():
    missing = set(places(tomllib.loads(TEXT))) - set(key_lines(TEXT))
    assert missing == {"x"}  # a parent that is named on no line of its own


keys = st.one_of(
    st.from_regex(r"[A-Za-z0-9_-]{1,6}", fullmatch=True),
    st.sampled_from(['"a.b"', "'[c]'", '"= \\" #"', "'\"'"]),
)
scalars = st.sampled_from(
    [
        "1",
        "-0.5e3",
        "true",
        "inf",
        '"x # ]"',
        "'} = \\'",
        '""',
        '"""\nk = 1\n"""',
        "'''[t]\n'''",
        '""""quoted""""',
        "2024-05-02",
        '"\\\\"',
    ],
)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda items: "[\n" + ", # c\n".join(items) + "\n]"),
        st.lists(scalars.filter(lambda v: "\n" not in v), max_size=3).map(
            lambda items: "{" + ", ".join(f"k{i} = {v}" for i, v in enumerate(items)) + "}"
        ),
    ),
    max_leaves=6,
)
statements = st.lists(
    st.tuples(st.sampled_from(["key", "table"]), keys, values, st.integers(0, 2)),
    max_size=8,
    unique_by=lambda statement: tomllib.loads(f"{statement[1]} = 0").popitem()[0],
)


@given(statements, st.sampled_from(["\n", "\r\n"]))
def test_keys_are_found_on_the_line_they_were_written_on(written, end):
    text, expected, table, line = "", {}, (), 1
    for kind, key, value, blanks in written:
        name = tomllib.loads(f"{key} = 0").popitem()[0]
        text += "# k = 1\n" * blanks
        line += blanks
        if kind == "table":
            table = (name,)
            expected[dotted(table)] = line
            text += f"[{key}]\n"
        else:
            expected[dotted((*table, name))] = line
            text += f"{key} = {value}\n"
            line += value.count("\n")
        line += 1
    tomllib.loads(text)
    lines = key_lines(text.replace("\n", end))
    assert expected.items() <= lines.items()
    assert set(places(tomllib.loads(text))) == set(lines)
