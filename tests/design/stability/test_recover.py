"""Maps of recovery lie within what any controller can do, and a killed run goes on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swimbladder.control.registry import bind
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability import recover
from swimbladder.design.stability.recover import Recovery, Verdict, holdable_depth, recovery_maps
from swimbladder.design.tuning.trial import held_before
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate

FEUP = load_vehicle("feup-em")
ADRC = load_vehicle(str(Path(__file__).parents[2] / "frozen" / "inputs" / "law-adrc.toml"))
LAW, NUMBERS = bind(FEUP.controller)
OPTIONS = dict(depths=(0.0, 95.0), cells=9)


def recovery(parts):
    return Recovery(FEUP, BoundLaw(LAW, NUMBERS, 0.3), within=600.0, band=0.05, parts=parts)


@pytest.fixture(scope="module")
def maps():
    return recovery_maps(recovery(Store(None)), **OPTIONS)


def test_nothing_recovers_from_where_no_controller_could(maps):
    for one in maps:
        back = (one.verdicts == Verdict.RECOVERED) | (one.verdicts == Verdict.SLOW)
        assert not (back & one.hopeless).any()
        assert one.asked == sum(one.count(v) for v in Verdict if v is not Verdict.NOT_ASKED)
    assert sum(one.count(Verdict.RECOVERED) for one in maps) > 10
    assert sum(int(one.hopeless.sum()) for one in maps) > 10


def test_what_is_hopeless_is_lost_but_for_what_the_surface_holds(maps):
    for one in maps[1:]:
        bad = one.hopeless & (one.verdicts != int(Verdict.LOST))
        assert not bad.any()


def test_the_deepest_set_point_is_one_that_the_stroke_holds(maps):
    assert maps[-1].title.endswith(f"{0.95 * holdable_depth(plant(FEUP)):.3g} m")


def test_a_cell_is_the_simulation_of_its_start(maps):
    steps = maps[0]
    row, column = next(
        (i, j) for i, j in np.argwhere(steps.verdicts == Verdict.RECOVERED) if steps.y[i] != 0.0
    )
    start, target = float(steps.x[column]), float(steps.x[column] + steps.y[row])
    ran = simulate(FEUP, setpoints=[(0.0, target)], duration=1800.0, start_depth=start)
    outside = np.flatnonzero(np.abs(ran.depth - target) > 0.05)
    assert steps.seconds[row, column] == pytest.approx(ran.time[outside[-1] + 1], abs=0.31)


def test_the_table_has_a_line_for_each_run(maps):
    lines = maps[1].csv().splitlines()
    assert lines[0] == "depth_less_set-point_m,speed_down_m_s,verdict,recovered_s,hopeless"
    assert len(lines) == 1 + maps[1].asked
    assert {line.split(",")[2] for line in lines[1:]} <= {v.name.lower() for v in Verdict}


def test_a_run_that_was_killed_goes_on(tmp_path, monkeypatch, maps):
    real, calls = recover.fly, []

    def killed(*args, **options):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*args, **options)

    monkeypatch.setattr(recover, "fly", killed)
    parts = Store(tmp_path / "parts", "this vehicle")
    with pytest.raises(KeyboardInterrupt):
        recovery_maps(recovery(parts), **OPTIONS)
    again = recovery_maps(recovery(parts), **OPTIONS)
    assert len(calls) == 3 + len(list((tmp_path / "parts").iterdir())) - 2
    for one, other in zip(maps, again, strict=True):
        assert np.array_equal(one.verdicts, other.verdicts)
        assert np.array_equal(one.seconds, other.seconds, equal_nan=True)
    # Another vehicle's parts are not taken; spoilt ones are computed anew.
    assert Store(tmp_path / "parts", "another").get(lambda: [1.5, None], "x") == [1.5, None]
    for path in (tmp_path / "parts").iterdir():
        path.write_text("{", encoding="utf-8")
    assert Store(tmp_path / "parts", "another").get(lambda: 2, "x") == 2
    parts.forget()
    assert not (tmp_path / "parts").exists()


@pytest.fixture(scope="module")
def pair():
    """Maps of a law alone, which learns what disturbs it, and of it under its supervisor."""
    shallow = OPTIONS | {"depths": (0.0, 10.0)}
    law, numbers = bind(ADRC.controller)
    bound = BoundLaw(law, numbers, 0.3)
    alone = Recovery(ADRC, bound, within=600.0, band=0.05, parts=Store(None))
    return [recovery_maps(one, **shallow) for one in (alone, replace(alone, supervised=True))]


def test_a_supervisor_brings_up_what_the_law_would_lose(pair):
    """Cell by cell: no start is lost that the law alone does not lose."""
    saved = 0
    for alone, both in zip(*pair, strict=True):
        lost = both.verdicts == Verdict.LOST
        assert not (lost & (alone.verdicts != Verdict.LOST)).any(), both.name
        saved += int(((alone.verdicts == Verdict.LOST) & ~lost).sum())
    assert saved > 0


def test_a_supervised_step_is_the_simulation_of_its_start(pair):
    """It comes after a time at rest, which its seconds do not count."""
    steps = pair[1][0]
    assert steps.count(Verdict.RECOVERED) > 0.6 * steps.asked
    j, i = np.argwhere(steps.verdicts == Verdict.RECOVERED)[-1]
    start, before = float(steps.x[i]), held_before(0.3)
    run = simulate(
        ADRC,
        setpoints=[(0.0, start), (before, start + float(steps.y[j]))],
        duration=before + 1800.0,
        start_depth=start,
        supervised=True,
    )
    assert run.alarm is None
    outside = np.flatnonzero(np.abs(run.depth - run.reference) > 0.05)
    assert steps.seconds[j, i] == pytest.approx(run.time[outside[-1] + 1] - before, abs=0.31)
