"""The paper's figures from simulation: the curves are the data, and none is called measured."""

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.show import paper
from swimbladder.show.picture import Curve, Note
from swimbladder.show.static import figure, save
from swimbladder.sim import pool
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Sensors
from tests.pictures import curve, marks, texts

OKABE_ITO = {
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
    "#767676",  # and a grey that contrasts 4.5 to 1 with white
}


@pytest.fixture(scope="module")
def vehicle():
    return load_vehicle("feup-em")


@pytest.fixture(scope="module")
def runs(vehicle):
    noisy = vehicle.model_copy(update={"sensors": Sensors(depth_noise=2e-3, depth_quantum=5e-3)})
    return pool.pool_test(noisy, dVs=[30e-6, 75e-6], seed=1)


@pytest.fixture(scope="module")
def drawings(vehicle, runs):
    experiments = [e for run in runs for e in run.experiments]
    fits = [pool.fit_depth(e.record) for e in experiments]
    mean = pool.average(fits)
    sizes = [20e-6, 45e-6, 75e-6]
    still = pool.still_starts(vehicle, dVs=sizes)
    curve = [(dV, pool.fit_depth(r)) for dV, r in zip(sizes, still, strict=True)]
    steps = simulate(vehicle, setpoints=[(0.0, 2.0), (90.0, 1.0)], duration=180.0, start_depth=1.0)
    long_step = simulate(vehicle, setpoints=[(0.0, 3.5)], duration=900.0, start_depth=1.0)
    return {
        "12": lambda: paper.draw_procedure(runs[0]),
        "13": lambda: paper.draw_speeds(experiments, mean),
        "14": lambda: paper.draw_depths(experiments, mean),
        "psi": lambda: paper.draw_neglect(experiments, fits, curve, pool.Fit(7935.54, 36.3, 0.0)),
        "16": lambda: paper.draw_steps(steps),
        "17": lambda: paper.draw_long_step(long_step),
    }


@pytest.fixture(scope="module")
def figures(drawings):
    return {name: draw() for name, draw in drawings.items()}


NAMES = ("12", "13", "14", "psi", "16", "17")


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_units_and_depth_grows_downwards(figures, name):
    for axes in figure(figures[name]).axes:
        label = axes.get_ylabel()
        assert label == "" or label.endswith("]")
        assert axes.yaxis_inverted() == ("depth" in label) or label == ""
    last = [p for p in figures[name].panels if p.row == figures[name].rows - 1]
    assert all("[" in panel.x for panel in last)


@pytest.mark.parametrize("name", NAMES)
def test_colours_are_told_apart_by_all(figures, name):
    used = {m.color.lower() for panel in figures[name].panels for m in marks(panel, Curve)}
    assert used
    assert used <= OKABE_ITO


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_called_measured(figures, name):
    said = []
    for panel in figures[name].panels:
        said += [m.label for m in marks(panel, Curve)] + [panel.y, *texts(panel)]
    assert not any("measured" in text.lower() for text in said)


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_as_text_is_the_same_each_time_and_has_no_date(drawings, name, tmp_path):
    text, again = (save(drawings[name](), tmp_path / f"{k}.svg").read_text() for k in (1, 2))
    assert text == again
    assert "<dc:date>" not in text
    assert text.rstrip().endswith("</svg>")


def test_figure_12_is_one_record_with_its_steps_marked(figures, runs):
    top, bottom = figures["12"].panels
    run = runs[0]
    end = next(time for time, step, _ in run.phases if step == "") + 5.0
    shown = run.solution.time <= end
    assert np.array_equal(curve(top, "depth, simulated")[:, 1], run.solution.depth[shown])
    assert np.array_equal(curve(top, "depth sensor, simulated")[:, 1], run.seen_depth[shown])
    assert curve(bottom, "")[:, 1] == pytest.approx(run.solution.volume[shown] * 1e6)
    assert texts(top) == ["(a)", "(b)", "(c)", "(d)"]
    centres = [note.x for note in marks(top, Note)]
    assert centres == sorted(centres)


def test_figures_13_and_14_have_a_model_for_every_experiment(figures, runs):
    experiments = [e for run in runs for e in run.experiments]
    for name in ("13", "14"):
        rising, sinking = figures[name].panels
        for axes, step in ((rising, "b"), (sinking, "d")):
            chosen = [e for e in experiments if e.step == step]
            models = [m for m in marks(axes, Curve) if m.dash == "-"]
            seen = [m for m in marks(axes, Curve) if m.dash == ""]
            assert len(models) == len(seen) == len(chosen)
            for e, mark in zip(chosen, seen, strict=True):
                assert np.array_equal(mark.x, e.record.time)
                if name == "14":
                    assert np.array_equal(mark.y, e.record.depth)
            assert [m.label for m in models] == [
                f"{e.dV * 1e6:+.3g} cm³".replace("-", "\u2212") for e in chosen
            ]


def test_figure_17_zooms_in_on_the_target(figures):
    _, near = figures["17"].panels
    assert [figures["17"].letter(panel) for panel in figures["17"].panels] == ["(a)", "(b)"]
    low, high = near.ylim
    assert low < 3.5 < high
    assert high - low < 0.5
