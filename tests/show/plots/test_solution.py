"""The picture of a simulation: what it shows, with which units, and that it disturbs nothing."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.image import imread

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.show.picture import Area, Rule
from swimbladder.show.solution import draw_solution
from swimbladder.show.static import figure, save
from swimbladder.sim.closed_loop import drive, simulate
from swimbladder.vehicle import Supervisor
from tests.pictures import curve, marks

DEPTH, VOLUME = "depth [m]", "volume [cm³]"
VOLTAGE = "voltage [V]"
POWER, CURRENT = "power [W]\nat samples", "current [A]\nat samples"


def run(name, start, target, **more):
    return simulate(
        load_vehicle(name), setpoints=[(0.0, target)], duration=60.0, start_depth=start, **more
    )


@pytest.mark.parametrize(
    ("solution", "panels"),
    [
        (lambda: run("feup-em", 1.5, 3.0), [DEPTH, VOLUME, VOLTAGE]),
        (lambda: run("example-eh", 20.0, 22.0), [DEPTH, VOLUME, VOLTAGE, POWER, CURRENT]),
        (lambda: run("ntnu-bv", 0.3, 1.0, bottom_depth=1.5), [DEPTH, VOLUME]),
        (
            lambda: drive(
                load_vehicle("feup-em"),
                time=[0.0, 5.0, 9.0],
                volume=[0.0, 2e-5, 0.0],
                start_depth=2.0,
            ),
            [DEPTH, VOLUME],
        ),
    ],
    ids=["identified", "electrohydraulic", "positioner", "recorded volume"],
)
def test_panels_are_what_is_known(solution, panels):
    drawn = figure(draw_solution(solution()))
    shown = [axes for axes in drawn.axes if axes.get_ylabel()]
    assert [axes.get_ylabel() for axes in shown] == panels
    assert drawn.axes[-1].get_xlabel() == "time [s]"
    assert shown[0].yaxis_inverted()  # depth downwards
    assert not any(axes.yaxis_inverted() for axes in shown[1:])


def test_the_band_of_2_percent_and_the_part_in_which_the_volume_moves_are_shown():
    s = run("feup-em", 1.5, 3.0)
    picture = draw_solution(s)
    depth, early, *_ = picture.panels
    (band,) = marks(depth, Area)
    assert picture.leader(early, "y") is depth
    assert (band.y.min(), band.y.max()) == pytest.approx((3.0 - 0.02 * 1.5, 3.0 + 0.02 * 1.5))
    first, end = early.xlim
    moved = np.abs(np.diff(s.volume))
    assert moved[s.time[1:] <= end].sum() > 0.8 * moved.sum()
    assert end - first < 0.3 * (s.time[-1] - s.time[0])


def test_curves_are_the_solution():
    s = run("feup-em", 1.5, 3.0)
    depth, volume, voltage = (panel for panel in draw_solution(s).panels if panel.y)
    assert np.array_equal(curve(depth, "depth")[:, 1], s.depth)
    assert np.array_equal(curve(depth, "set-point")[:, 1], s.reference)
    assert curve(volume, "volume")[:, 1] == pytest.approx(s.volume * 1e6)
    assert curve(volume, "asked for")[:, 1] == pytest.approx(s.volume_reference * 1e6)
    assert np.array_equal(curve(voltage, "")[:, 1], s.voltage)


def test_surface_bottom_and_end_stops_are_marked():
    v = load_vehicle("feup-em")
    s = drive(
        v,
        time=np.arange(0.0, 60.0, 0.5),
        volume=np.full(120, -60e-6),
        start_depth=3.5,
        bottom_depth=4.5,
    )
    depth, _ = draw_solution(s).panels
    assert curve(depth, "reached the bottom")[:, 1] == pytest.approx([4.5], abs=0.03)
    time = np.arange(0.0, 60.0, 0.3)
    s = drive(v, time=time, voltage=np.full(len(time), -12.0), start_depth=3.5, bottom_depth=4.5)
    _, volume, _ = draw_solution(s).panels
    assert [stop.at for stop in marks(volume, Rule, "end stop")] == [pytest.approx(-350.0)]


def test_what_is_asked_for_does_not_hide_the_volume():
    """The derivative asks for litres at a set-point; the axis is that of the volume."""
    s = run("feup-em", 0.5, 4.0)
    low, high = draw_solution(s).panels[2 if draw_solution(s).columns == 2 else 1].ylim
    assert high - low < 3.0 * np.ptp(s.volume) * 1e6


def test_the_file_is_a_picture_and_the_same_each_time(tmp_path):
    s = run("feup-em", 1.5, 3.0)
    path = save(draw_solution(s), tmp_path / "a.png")
    assert path == tmp_path / "a.png"
    height, width, _ = imread(path).shape
    assert width > 800
    assert height > 500
    save(draw_solution(s), tmp_path / "b.png")
    assert path.read_bytes() == (tmp_path / "b.png").read_bytes()
    save(draw_solution(s), tmp_path / "a.svg")
    save(draw_solution(s), tmp_path / "b.svg")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "a.svg", "b.png", "b.svg"]


def test_the_callers_style_is_left_alone_and_does_not_get_in(tmp_path):
    s = run("feup-em", 1.5, 3.0)
    plain = save(draw_solution(s), tmp_path / "plain.svg").read_bytes()
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        before = dict(mpl.rcParams)
        assert save(draw_solution(s), tmp_path / "styled.svg").read_bytes() == plain
        assert dict(mpl.rcParams) == before


def test_a_place_that_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match="cannot write the file"):
        save(draw_solution(run("feup-em", 1.5, 3.0)), tmp_path / "none" / "a.png")


def test_an_alarm_of_the_supervisor_is_marked_where_it_came():
    limited = load_vehicle("feup-em").model_copy(update={"supervisor": Supervisor(depth_limit=2.5)})
    step = {"setpoints": [(0.0, 3.0)], "duration": 60.0, "start_depth": 1.5}
    s = simulate(limited, **step)
    ((at, depth),) = curve(draw_solution(s).panels[0], "supervisor took over")
    assert at == s.alarm.time
    assert depth == np.interp(at, s.time, s.depth)
