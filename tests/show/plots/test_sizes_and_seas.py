"""Pictures of `size`, `energy` and `ballast`: nothing cut, units, ticks that tell a number."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from swimbladder.design.ballast import ballast_in, uncertainty_of
from swimbladder.design.energy import Thruster, drive_energy, hovering, profiling
from swimbladder.design.sizing import Dive, size
from swimbladder.io.config import load_vehicle
from swimbladder.physics.seawater import uniform_column
from swimbladder.show.ballast import draw_ballasting
from swimbladder.show.energy import draw_versus
from swimbladder.show.size import draw_candidates, draw_parts, draw_requirements
from swimbladder.show.style import plain_log_ticks


@pytest.fixture(scope="module")
def found():
    return size(load_vehicle("example-eh"), Dive(max_depth=800.0))


def labelled(axis):
    low, high = sorted(axis.get_view_interval())
    return [tick for tick in axis.get_majorticklocs() if low <= tick <= high]


@pytest.mark.parametrize("span", [(1.4, 2.2), (1.4, 9.6), (0.02, 3.0), (1e-3, 1e4)])
def test_a_logarithmic_axis_has_several_numbers_on_any_span(span):
    axes = Figure().add_subplot()
    axes.set_xscale("log")
    axes.set_xlim(*span)
    plain_log_ticks(axes, "x")
    assert 3 <= len(labelled(axes.xaxis)) <= 12


@pytest.mark.prove
def test_the_price_of_a_wish_is_seen_whole(found):
    figure = draw_requirements(found)
    sides = [axes for axes in figure.axes if axes.get_visible() and axes.lines]
    assert len(sides) == 2 * len(found.sweeps)
    for axes in sides:
        low, high = axes.get_ylim()
        top = np.nanmax(axes.lines[0].get_ydata())
        assert low == 0.0
        assert high > 1.05 * top
        assert "cm3" not in axes.get_ylabel() + axes.get_xlabel()


def test_bars_that_are_cut_have_their_mass_written(found):
    axes = draw_parts(found).axes[0]
    edge = axes.get_xlim()[1]
    masses = [float(found.evaluation.mass[c.index]) for c in found.choices if c.index >= 0]
    cut = [text for text in axes.texts if "kg" in text.get_text()]
    assert len(cut) == sum(mass > edge for mass in masses)
    names = [label.get_text() for label in axes.get_yticklabels()]
    volts = [float(name.split()[1]) for name in names if name.startswith("winding")]
    assert volts == sorted(volts)


def test_every_drive_is_shown_or_counted(found):
    axes = draw_candidates(found).axes[0]
    w = found.evaluation
    mass, energy = w.mass[w.feasible], w.cycle_energy[w.feasible] * 1e-3
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    inside = (left <= mass) & (mass <= right) & (low <= energy) & (energy <= high)
    outside = [t.get_text() for t in axes.get_legend().get_texts() if "beyond" in t.get_text()]
    told = int(outside[0].split()[0].replace(",", "")) if outside else 0
    assert told == np.count_nonzero(~inside)
    assert left <= w.mass[found.best] <= right


def test_break_even_times_can_be_read_off():
    drive = drive_energy(
        load_vehicle("example-float"), uniform_column(load_vehicle("example-float").water, 2000.0)
    )
    hover = hovering(drive, Thruster(), weight_error=1e-5)
    figure = draw_versus(hover, profiling(drive, Thruster(), speed=0.1), drive)
    assert len(labelled(figure.axes[0].xaxis)) >= 4


def test_no_legend_lies_over_the_ends_of_the_stroke():
    vehicle = load_vehicle("example-eh")
    column = uniform_column(vehicle.water, 1000.0)
    figure = draw_ballasting(ballast_in(vehicle, [column], uncertainty=uncertainty_of(vehicle, {})))
    assert all(axes.get_legend() is None for axes in figure.axes)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "ends of the stroke",
        "neutral volume",
        "in 95 % of cases",
    ]
