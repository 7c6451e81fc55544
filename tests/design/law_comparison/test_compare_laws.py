"""The comparison as a whole: rows, what is left out, going on where it was stopped."""

import math

import pytest

from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.design.law_comparison import SCENARIOS, compare_laws
from swimbladder.design.law_comparison import run as running
from swimbladder.design.law_comparison.run import Asked, least_times
from swimbladder.design.planning import least_time
from swimbladder.design.tuning.run import places
from swimbladder.design.tuning.trial import ALONE, SUPERVISED
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store
from swimbladder.vehicle import Supervisor

FEUP, TANK = load_vehicle("feup-em"), load_vehicle("ntnu-bv")
FEW = tuple(s for s in SCENARIOS if s.name in ("step-down", "step-uncertain", "hold", "hold-drift"))


def compared(vehicle=TANK, **given):
    return compare_laws(vehicle, **({"runs": 3, "scenarios": FEW} | given))


@pytest.mark.prove
def test_a_positioner_flies_what_its_file_has_and_the_rest_is_left_out():
    b = compared(tune_for=["fast"])
    names = ["position-pid, as in the file", "position-observer, fast"]
    assert [row.who.name for row in b.rows] == names
    assert b.reference is b.rows[0]
    assert b.not_compared["planned"].startswith("it commands a voltage")
    assert "tuned" in b.not_compared["position-pid"]
    assert "actuator.moving_power" in b.no_energy
    assert math.isnan(b.rows[0].cost("hold", "power"))
    assert set(b.rows[0].results) == {s.name for s in FEW}
    assert b.bounds["step-down"] == least_time(TANK, *b.placed[0][1:3]).time
    assert "step-uncertain" in b.no_bound
    told = b.to_dict()
    assert told["laws"][0]["results"]["hold"]["rms_m"] == b.rows[0].results["hold"].rms
    assert told["laws"][0]["reference"] is True


def test_what_is_done_is_not_done_again(tmp_path, monkeypatch):
    first = compared(FEUP, laws=["position-pid"], parts=tmp_path)
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert len(kept) == len(FEW) + 1  # and one least time
    # stopped before the last: one part is gone, one is torn
    flown = [path for path in tmp_path.iterdir() if path.name.startswith("flown")]
    flown[0].unlink()
    flown[1].write_text("{", encoding="utf-8")
    calls = []
    fly = running.fly_scenario

    def counted(*args, **settings):
        calls.append(args[2].scenario.name)
        return fly(*args, **settings)

    monkeypatch.setattr(running, "fly_scenario", counted)
    monkeypatch.setattr(running, "least_times", lambda *_, **__: pytest.fail("done already"))
    again = compared(FEUP, laws=["position-pid"], parts=tmp_path)
    assert len(calls) == 2
    # nan differs from nan: compare as text
    assert repr(again.rows[0].results) == repr(first.rows[0].results)
    assert sorted(path.name for path in tmp_path.iterdir()) == kept
    compared(FEUP, laws=["position-pid"], parts=tmp_path, seed=5)
    assert len(calls) == 2 + len(FEW)  # another seed is another question


def test_least_times_are_the_planners_and_late_ones_are_said():
    steps = [Asked(1.5, 2.0, 12.0), Asked(1.5, 90.0, 12.0)]
    one, two = least_times(FEUP, steps, limit=120.0)
    assert one == {"time": least_time(FEUP, 1.5, 2.0, supply=12.0).time}
    assert "stroke" in two["why"]
    late = least_times(FEUP, steps, limit=1e-3)
    assert [answer["late"] for answer in late] == [True, True]
    assert "took longer than 0.001 s" in late[0]["why"]


def test_a_process_that_ends_by_itself_is_not_said_to_be_late():
    broken = FEUP.model_copy(update={"hull": None})
    (answer,) = least_times(broken, [Asked(1.5, 2.0, 12.0)], limit=120.0)
    assert "process of the linear programs ended: 1" in answer["why"]


def test_a_part_is_that_of_the_vehicle_asked_for(tmp_path):
    store = Store(tmp_path)
    store.write({"a": 1.0}, "flown", FEUP, 3)
    assert store.read("flown", FEUP, 3) == {"a": 1.0}
    assert store.read("flown", FEUP, 4) is None
    assert store.read("flown", FEUP.model_copy(update={"trim_error": 1e-6}), 3) is None
    Store(None).write({}, "x")
    assert Store(None).read("x") is None


@pytest.mark.prove
def test_tuned_laws_are_flown_beside_the_papers(tmp_path):
    sensors = FEUP.sensors.model_copy(update={"depth_noise": 2e-3})
    noisy = FEUP.model_copy(update={"sensors": sensors})
    told = []
    b = compared(
        noisy,
        laws=["planned"],
        tune_for=("fast",),
        depth_range=(0.0, 5.0),
        parts=tmp_path,
        advance=told.append,
    )
    assert [row.who.name for row in b.rows] == ["cascade, the paper's", "planned, fast"]
    paper, planned = b.rows
    assert b.reference is paper
    assert sum(told) == pytest.approx(1.0, abs=0.02)
    bound = b.bounds["step-down"]
    assert bound == pytest.approx(14.4)  # s, the linear program of planning.least_time
    settled = planned.results["step-down"]
    assert bound <= settled.settle_median <= 1.25 * bound
    assert settled.overshoot_95 < 0.03
    assert planned.results["step-uncertain"].settle_95 < 21.6
    assert paper.results["step-down"].settle_median > 15.0 * bound
    assert paper.results["hold"].rate > planned.results["hold"].rate
    assert paper.results["hold-drift"].rms > planned.results["hold-drift"].rms
    assert b.sentences[0].startswith("planned, fast settles soonest")
    # and again, from what was kept
    assert (
        compared(
            noisy, laws=["planned"], tune_for=("fast",), depth_range=(0.0, 5.0), parts=tmp_path
        )
        .rows[1]
        .who
        == planned.who
    )


def test_a_law_that_cannot_be_tuned_is_left_out_with_the_reason(monkeypatch):
    def refused(_vehicle, _law, asked, _advance):
        raise NoAnswerError(f"no gains for {asked.goal}")

    monkeypatch.setattr("swimbladder.design.law_comparison.contenders.search_gains", refused)
    b = compared(FEUP, laws=["planned"])
    assert b.not_compared == {
        "planned, fast": "no gains for fast",
        "planned, quiet": "no gains for quiet",
    }
    other = FEUP.stroke.model_copy(update={"maximum": 3e-4})  # not the paper's vehicle any more
    bare = FEUP.model_copy(update={"controller": None, "stroke": other})
    with pytest.raises(NoAnswerError, match=r"no controller to compare\. .*no gains for fast"):
        compared(bare, laws=["planned"], sample_time=0.3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"laws": ["pid"]}, "no such law"),
        ({"runs": 1}, "whole number of at least 2"),
        ({"seed": -1}, "of at least 0"),
        ({"depth_range": (3.0, 1.0)}, "no range of depths"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_done(given, words, tmp_path):
    with pytest.raises(InputError, match=words):
        compared(parts=tmp_path / "parts", **given)
    assert not (tmp_path / "parts").exists()


def test_laws_fly_as_flashed_but_for_the_papers():
    """An own law is flown under its supervisor, and its run is that of `simulate_ensemble`."""
    hold = tuple(s for s in SCENARIOS if s.name == "hold")
    noisy = FEUP.with_sensors(depth_noise=2e-3)
    tight = noisy.model_copy(update={"supervisor": Supervisor(patience="3 s", neutral_range=2e-6)})
    own = {**noisy.controller.parameters, "k_pV": "902 V/dm3"}
    other = noisy.controller.model_copy(update={"parameters": own})
    vehicle = tight.model_copy(update={"controller": other})
    given = {"laws": ["position-pid"], "depth_range": (1.0, 6.0), "scenarios": hold, "runs": 4}
    flashed = compared(vehicle, **given)
    alone = compared(vehicle, supervised=False, **given)
    names = [row.who.name for row in flashed.rows]
    assert names == ["cascade, as in the file", "cascade, the paper's"]
    # a supervisor that takes the vehicle for faulty ends the runs of the file's law alone
    assert flashed.rows[0].results["hold"].lost > 0.0
    assert alone.rows[0].results["hold"].lost == 0.0
    assert flashed.rows[1].results["hold"].rms == alone.rows[1].results["hold"].rms
    assert any("the paper's law flies alone" in said for said in flashed.assumptions)
    assert SUPERVISED in flashed.assumptions
    assert ALONE in alone.assumptions


def test_depths_end_where_the_supervisor_turns_the_vehicle_round():
    limit = supervisor_parameters(FEUP, 0.3).deep.depth_limit
    assert limit < 0.8 * 86.0
    where = places(FEUP)
    assert where.most == pytest.approx(0.8 * limit)
    assert "where its supervisor turns it round" in where.words
    assert places(FEUP, supervised=False).most > 60.0
    with pytest.raises(InputError, match=r"say more of the vehicle in its \[supervisor\] table"):
        places(FEUP, (1.0, limit + 1.0))
