"""Pictures of `size`, `energy` and `ballast`: nothing cut, units, ticks that tell a number."""

import numpy as np
import pytest

from swimbladder.design.ballast import ballast_in, uncertainty_of
from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling
from swimbladder.design.sizing import Dive, size
from swimbladder.io.config import load_vehicle
from swimbladder.physics.seawater import uniform_column
from swimbladder.show.ballast import draw_ballasting
from swimbladder.show.energy import draw_versus
from swimbladder.show.picture import Curve, grid_of, labelled
from swimbladder.show.size import draw_candidates, draw_parts, draw_requirements
from swimbladder.show.static import figure
from tests.pictures import marks, texts


@pytest.fixture(scope="module")
def found():
    return size(load_vehicle("example-eh"), Dive(max_depth=800.0))


def numbered(axis):
    low, high = sorted(axis.get_view_interval())
    return [tick for tick in axis.get_majorticklocs() if low <= tick <= high]


@pytest.mark.parametrize("span", [(1.4, 2.2), (1.4, 9.6), (0.02, 3.0), (1e-3, 1e4)])
def test_a_logarithmic_axis_has_several_numbers_on_any_span(span):
    picture, (panel,) = grid_of((5.0, 4.0), 1, 1)
    panel.xlog, panel.xlim = True, span
    (axes,) = figure(picture).axes
    assert 3 <= len(numbered(axes.xaxis)) <= 12


@pytest.mark.prove
@pytest.mark.prove
def test_the_price_of_a_wish_is_seen_whole(found):
    sides = [panel for panel in draw_requirements(found).panels if marks(panel, Curve)]
    assert len(sides) == 2 * len(found.sweeps)
    for panel in sides:
        low, high = panel.ylim
        top = np.nanmax(marks(panel, Curve)[0].y)
        assert low == 0.0
        assert high > 1.05 * top
        assert "cm3" not in panel.y + panel.x


@pytest.mark.prove
def test_bars_that_are_cut_have_their_mass_written(found):
    (panel,) = draw_parts(found).panels
    edge = panel.xlim[1]
    masses = [float(found.evaluation.mass[c.index]) for c in found.choices if c.index >= 0]
    cut = [text for text in texts(panel) if "kg" in text]
    assert len(cut) == sum(mass > edge for mass in masses)
    names = [*panel.yticks.values()]
    volts = [float(name.split()[1]) for name in names if name.startswith("winding")]
    assert volts == sorted(volts)


@pytest.mark.prove
def test_every_drive_is_shown_or_counted(found):
    (panel,) = draw_candidates(found).panels
    w = found.evaluation
    mass, energy = w.mass[w.feasible], w.cycle_energy[w.feasible] * 1e-3
    (left, right), (low, high) = panel.xlim, panel.ylim
    inside = (left <= mass) & (mass <= right) & (low <= energy) & (energy <= high)
    outside = [m.label for m in labelled([panel]) if "beyond" in m.label]
    told = int(outside[0].split()[0].replace(",", "")) if outside else 0
    assert told == np.count_nonzero(~inside)
    assert left <= w.mass[found.best] <= right


def test_break_even_times_can_be_read_off():
    drive = drive_energy(
        load_vehicle("example-float"), uniform_column(load_vehicle("example-float").water, 2000.0)
    )
    hover = hovering(drive, Thruster(), weight_error=1e-5)
    picture = draw_versus(hover, profiling(drive, Thruster(), speed=0.1), drive)
    assert len(numbered(figure(picture).axes[0].xaxis)) >= 4


def test_no_legend_lies_over_the_ends_of_the_stroke():
    vehicle = load_vehicle("example-eh")
    column = uniform_column(vehicle.water, 1000.0)
    found = ballast_in(vehicle, [column], uncertainty=uncertainty_of(vehicle, {}))
    made = figure(draw_ballasting(found))
    assert all(axes.get_legend() is None for axes in made.axes)
    (legend,) = made.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "ends of the stroke",
        "neutral volume",
        "in 95 % of cases",
    ]
