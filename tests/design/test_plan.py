"""The plan of experiments as a file: what is read, refused and written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.design.plan import Plan, load_plan, plan_file
from swimbladder.errors import InputError

TEXT = """
schema_version = 1
bottom_depth = "4.5 m"
shallowest = "0.75 m"
deepest = 3.75
sample_time = "300 ms"
[[experiments]]
start_depth = "3.75 m"
longest = "2 min"
[[experiments.moves]]
volume = "30 cm3"
[[experiments.moves]]
volume = "-30 cm3"
depth = "2.2 m"
going = "up"
"""


def written(tmp_path, text):
    path = tmp_path / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_plan_by_hand(tmp_path):
    plan = load_plan(written(tmp_path, TEXT))
    (one,) = plan.experiments
    assert [move.volume for move in one.moves] == [30e-6, -30e-6]
    assert (one.moves[1].depth, one.moves[1].going) == (2.2, "up")
    assert (one.longest, plan.sample_time, plan.time) == (120.0, 0.3, 0.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('going = "up"', "", "moves[1].going"),
        ('going = "up"', 'going = "sideways"', "moves[1].going"),
        ('start_depth = "3.75 m"', 'start_depth = "3.8 m"', "experiments[0].start_depth"),
        ('depth = "2.2 m"', 'depth = "0.5 m"', "experiments[0].moves[1].depth"),
        ('depth = "2.2 m"\ngoing = "up"', "", "experiments[0].moves[1].depth"),
        ('volume = "30 cm3"', 'volume = "30 cm"', "moves[0].volume"),
        ("deepest = 3.75", "deepest = 5.0", "shallowest"),
        ('longest = "2 min"', 'longest = "0 s"', "experiments[0].longest"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(tmp_path, old, new, said):
    with pytest.raises(InputError) as caught:
        load_plan(written(tmp_path, TEXT.replace(old, new)))
    assert said in str(caught.value)
    assert caught.value.line is not None
    assert caught.value.remedy


DEPTHS = st.floats(0.75, 3.75)
VOLUMES = st.floats(-1e-3, 1e-3).filter(lambda v: v == 0.0 or abs(v) > 1e-15)


@given(
    first=VOLUMES,
    later=st.lists(st.tuples(VOLUMES, DEPTHS, st.sampled_from(["up", "down"]))),
    start=DEPTHS,
    longest=st.floats(1.0, 1e4),
    trace=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=4),
)
def test_a_plan_reads_back_as_it_was(tmp_path_factory, first, later, start, longest, trace):
    moves = [{"volume": first}]
    moves += [{"volume": v, "depth": z, "going": going} for v, z, going in later]
    expected = {"time": trace, "depth": trace, "volume": trace}
    plan = Plan.model_validate(
        {
            "name": 'a "name"',
            "bottom_depth": 4.5,
            "shallowest": 0.75,
            "deepest": 3.75,
            "sample_time": 0.3,
            "rest": 5.0,
            "expected": [{"name": "K2", "value": 7935.54, "std": 0.1, "unit": "1/m2/s"}],
            "experiments": [
                {"start_depth": start, "longest": longest, "moves": moves, "trace": expected},
                {"start_depth": 1.0, "longest": 3.0, "moves": [{"volume": 1e-5}]},
            ],
        }
    )
    path = tmp_path_factory.mktemp("plan") / "plan.toml"
    path.write_text(plan_file(plan, head="A comment\nin two lines"), encoding="utf-8")
    assert load_plan(path) == plan
