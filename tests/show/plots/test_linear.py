"""Pictures of a linear analysis: written whole, labelled, and saying what they show."""

import struct

import numpy as np
import pytest

from swimbladder.design.analysis import analyse
from swimbladder.io.config import load_vehicle
from swimbladder.show import analysis as linear
from swimbladder.show.picture import Curve, Note
from swimbladder.show.static import save
from tests.pictures import marks, texts

WITH_LOOP = [linear.draw_loop_gains, linear.draw_nyquist]
PICTURES = [linear.draw_open_loop, linear.draw_poles, *WITH_LOOP]


@pytest.fixture(scope="module", params=["feup-em", "ntnu-bv"])
def analysis(request):
    return analyse(load_vehicle(request.param), depth=2.0)


@pytest.mark.parametrize("draw", PICTURES, ids=lambda f: f.__name__)
def test_picture_has_labels_with_units(analysis, tmp_path, draw):
    picture = draw(analysis)
    bottom = picture.panels[-1] if draw is not linear.draw_poles else picture.panels[0]
    for label in (picture.panels[0].y, bottom.y, bottom.x):
        assert "[" in label
        assert "]" in label
    assert analysis.vehicle.name in picture.title + picture.panels[0].title
    header = save(picture, tmp_path / "picture.png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert min(struct.unpack(">II", header[16:24])) >= 500


def test_margins_are_written_where_they_are():
    analysis = analyse(load_vehicle("feup-em"))
    top, bottom = linear.draw_loop_gains(analysis).panels
    assert {*texts(top)} == {
        "gain × 3.89",
        "gain × 0.00471",
        "gain × 5.04",
        "gain × 0.0461",
    }
    assert {*texts(bottom)} == {"phase margin 41.1°", "phase margin 74.8°"}
    margins = analysis.closed_loop.at_command
    label = next(note for note in marks(top, Note) if note.text == "gain × 3.89")
    assert (label.x, label.y) == pytest.approx((margins.gain_up_frequency, 1.0 / margins.gain_up))


def test_loop_that_is_one_loop_is_drawn_once():
    picture = linear.draw_loop_gains(analyse(load_vehicle("ntnu-bv"), depth=2.0))
    assert len([text for text in texts(picture.panels[1]) if "phase margin" in text]) == 1


def test_poles_are_where_they_are():
    analysis = analyse(load_vehicle("feup-em"))
    left, right, near = linear.draw_poles(analysis).panels
    poles = analysis.open_loop.poles
    (drawn,) = (m for m in marks(left, Curve) if m.marker == "x")
    # on a scale that is linear near 0: in order, and said as they are
    assert np.argsort(drawn.x).tolist() == np.argsort([p.real for p in poles]).tolist()
    assert [float(text.split()[0]) for text in drawn.says] == pytest.approx(
        [p.real for p in poles], rel=1e-4
    )
    ticks = {float(name): place for place, name in left.xticks.items()}
    for p, x in zip(poles, drawn.x, strict=True):
        assert all((size < p.real) == (place < x) for size, place in ticks.items())
    for panel in (right, near):  # the slow poles again, larger
        (drawn,) = (m for m in marks(panel, Curve) if m.marker == "x")
        assert sorted(drawn.x) == sorted(m.z.real for m in analysis.closed_loop.modes)
    assert near.xlim[1] - near.xlim[0] < 0.1 < right.xlim[1] - right.xlim[0]


@pytest.mark.parametrize("draw", WITH_LOOP, ids=lambda f: f.__name__)
def test_no_loop_no_picture_of_it(draw):
    analysis = analyse(load_vehicle("feup-em").model_copy(update={"controller": None}))
    with pytest.raises(ValueError, match="no closed loop"):
        draw(analysis)
    assert len(linear.draw_poles(analysis).panels) == 1
