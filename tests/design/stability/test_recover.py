"""Maps of recovery lie within what any controller can do, and a killed run goes on."""

import numpy as np
import pytest

from swimbladder.control.registry import bind
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability import recover
from swimbladder.design.stability.recover import Recovery, Verdict, holdable_depth, recovery_maps
from swimbladder.io.config import load_vehicle
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate

FEUP = load_vehicle("feup-em")
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
