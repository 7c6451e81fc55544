"""Pictures of a linear analysis: written whole, labelled, and saying what they show."""

import struct

import pytest

from swimbladder.design.analysis import analyse
from swimbladder.io.config import load_vehicle
from swimbladder.show import analysis_plots as linear
from swimbladder.show.style import save

WITH_LOOP = [linear.draw_loop_gains, linear.draw_nyquist]
PICTURES = [linear.draw_open_loop, linear.draw_poles, *WITH_LOOP]


@pytest.fixture(scope="module", params=["feup-em", "ntnu-bv"])
def analysis(request):
    return analyse(load_vehicle(request.param), depth=2.0)


@pytest.mark.parametrize("draw", PICTURES, ids=lambda f: f.__name__)
def test_picture_has_labels_with_units(analysis, tmp_path, draw):
    figure = draw(analysis)
    bottom = figure.axes[-1] if draw is not linear.draw_poles else figure.axes[0]
    for label in (figure.axes[0].get_ylabel(), bottom.get_ylabel(), bottom.get_xlabel()):
        assert "[" in label
        assert "]" in label
    assert analysis.vehicle.name in figure.axes[0].get_title()
    header = save(figure, tmp_path / "picture.png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert min(struct.unpack(">II", header[16:24])) >= 500


def test_margins_are_written_where_they_are():
    analysis = analyse(load_vehicle("feup-em"))
    top, bottom = linear.draw_loop_gains(analysis).axes
    assert {t.get_text() for t in top.texts} == {
        "gain × 3.89",
        "gain × 0.00471",
        "gain × 5.04",
        "gain × 0.0461",
    }
    assert {t.get_text() for t in bottom.texts} == {"phase margin 41.1°", "phase margin 74.8°"}
    margins = analysis.closed_loop.at_command
    label = next(t for t in top.texts if t.get_text() == "gain × 3.89")
    assert label.xy == pytest.approx((margins.gain_up_frequency, 1.0 / margins.gain_up))


def test_loop_that_is_one_loop_is_drawn_once():
    figure = linear.draw_loop_gains(analyse(load_vehicle("ntnu-bv"), depth=2.0))
    assert len([t for t in figure.axes[1].texts if "phase margin" in t.get_text()]) == 1


def test_poles_are_where_they_are():
    analysis = analyse(load_vehicle("feup-em"))
    left, right = linear.draw_poles(analysis).axes
    drawn = next(line for line in left.lines if line.get_marker() == "x").get_xydata()
    assert sorted(complex(*p).real for p in drawn) == sorted(
        p.real for p in analysis.open_loop.poles
    )
    drawn = next(line for line in right.lines if line.get_marker() == "x").get_xydata()
    assert sorted(p[0] for p in drawn) == sorted(m.z.real for m in analysis.closed_loop.modes)
    assert right.child_axes  # the slow poles again, larger


@pytest.mark.parametrize("draw", WITH_LOOP, ids=lambda f: f.__name__)
def test_no_loop_no_picture_of_it(draw):
    analysis = analyse(load_vehicle("feup-em").model_copy(update={"controller": None}))
    with pytest.raises(ValueError, match="no closed loop"):
        draw(analysis)
    assert len(linear.draw_poles(analysis).axes) == 1
