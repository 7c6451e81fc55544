"""The whole design: what it says, warns of, refuses, and writes as a plan."""

import math

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.design.experiments import design_experiment
from swimbladder.design.experiments.run import PAPER
from swimbladder.design.plan import load_plan, plan_file
from swimbladder.errors import InputError
from swimbladder.estimation.motion import Prior, identify
from tests.design.experiments.days import logs
from tests.design.experiments.truth import Vehicle

QUICK = {
    "bottom_depth": 4.5,
    "depth_noise": 2e-3,
    "settling": 300.0,
    "max_moves": 1,
    "max_experiments": 2,
}


def test_the_design_fits_the_time_and_beats_the_papers_eight(design):
    assert [r.moves[0].volume for r in design.against.releases] == list(PAPER)
    assert design.chosen.time <= design.budget == pytest.approx(design.against.time, rel=0.01)
    assert design.rival == "the paper's eight"
    assert all(gain > 3.0 for gain in design.gains.values())
    assert design.identifiable
    for name, (low, high) in design.chosen.spread.items():
        assert low <= design.chosen.prediction.share[name] * 1.5
        assert high < 0.02
    # What is known grows with every experiment.
    for name in ("K2", "T2", "psi"):
        last = design.chosen.after[-1][name]
        assert last == pytest.approx(design.chosen.prediction.share[name], rel=1e-3)
        assert last < design.chosen.after[0][name]


def test_the_plan_is_what_was_chosen(design, tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(plan_file(design.plan()), encoding="utf-8")
    plan = load_plan(path)
    assert plan == design.plan()
    assert (plan.bottom_depth, plan.shallowest, plan.deepest) == (4.5, 0.75, 3.75)
    assert plan.time == pytest.approx(design.chosen.time, abs=1.0)
    for one, release in zip(plan.experiments, design.chosen.releases, strict=True):
        assert one.start_depth == release.start
        assert [m.volume for m in one.moves] == [m.volume for m in release.moves]
        assert one.trace.time[0] == 0.0
        assert one.trace.depth[0] == pytest.approx(release.start)
        assert one.trace.time[-1] == pytest.approx(one.duration, abs=0.06)
        assert len(one.trace.time) <= 62
    assert [e.name for e in plan.expected] == ["K2", "T2", "psi"]


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_promised_is_what_a_pool_day_gives(design, vehicle, setting, tmp_path, seed):
    """A motor that begins between two samples, drifts and late stamps: one likelihood for both."""
    path = tmp_path / "plan.toml"
    path.write_text(plan_file(design.plan()), encoding="utf-8")
    true = Vehicle(7935.54, 36.3, 4.04e-6)
    measured = logs(load_plan(path), true, np.random.default_rng([23, seed]), setting)
    answer = identify(measured, vehicle, profiles=False, choices=False, posterior=1)
    assert any(f.kind == "volumes inexact" for f in answer.findings)
    assert any(f.kind == "posterior" and "as exact" in f.sentence for f in answer.findings)
    for name, promised in design.chosen.prediction.parameters.items():
        e = answer.parameters[name]
        assert e.std == pytest.approx(
            promised.std, rel=0.4
        )  # noisy depths set moves off a little early
        assert abs(e.value - promised.value) < 3.5 * e.std


def test_warnings_say_what_would_go_wrong(design):
    kinds = {f.kind for f in design.findings}
    assert {"psi", "limit", "size"} <= kinds
    (psi,) = (f.sentence for f in design.findings if f.kind == "psi")
    assert "refit" in psi
    assert "linearised" in psi
    assert design.against.psi.refit["K2"] > 0.6  # what the paper's eight would hide
    assert design.against.psi.rms < 5e-3


def test_a_larger_step_buys_nothing(design):
    """A step crosses the range before its speed settles: sizes beyond the best tell less."""
    c = design.curve
    at = int(c.steps.argmin())
    assert 0 < at < len(c.sizes) - 1
    assert c.best_step == c.sizes[at]
    assert (c.steps[at + 1 :] > c.steps[at]).all()


def test_what_cannot_be_told_is_said_with_a_remedy(vehicle):
    options = {
        **QUICK,
        "depth_noise": 0.05,
        "max_experiments": 1,
        "against": (),
        "neutral_std": math.inf,
    }
    found = design_experiment(vehicle, **options)
    assert not found.identifiable
    assert found.against is None
    said = " ".join(f.sentence for f in found.findings if f.severity == "no")
    assert "psi" in said
    assert found.plan().neutral_std is None
    assert any(f.kind == "remedy" and "times the pool time" in f.sentence for f in found.findings)


@pytest.mark.prove
def test_a_prior_and_a_value_help(vehicle):
    plain = design_experiment(vehicle, **QUICK)
    fisher_information = design_experiment(vehicle, **QUICK, priors={"psi": Prior(4.04e-6, 4e-8)})
    held = design_experiment(vehicle, **QUICK, fixed={"psi": 4.04e-6})
    for name in ("K2", "T2"):
        shares = [d.chosen.prediction.share[name] for d in (plain, fisher_information, held)]
        assert shares[0] > shares[1] > 0.99 * shares[2]
    assert held.chosen.prediction.names == ("K2", "T2")
    assert fisher_information.chosen.prediction.sources["psi"]["prior"] > 0.1
    assert len(plain.chosen.releases) == 2
    assert all(len(r.moves) == 1 for r in plain.chosen.releases)


@pytest.mark.parametrize(
    ("name", "law"),
    [("ntnu-bv", "blended"), pytest.param("feup-em", "quadratic", marks=pytest.mark.prove)],
)
def test_other_vehicles_and_laws(name, law):
    small = name == "ntnu-bv"
    found = design_experiment(
        sb.load_vehicle(name),
        **{**QUICK, "bottom_depth": 1.5 if small else 4.5},
        drag=law,
        clearance=0.3 if small else 0.75,
        depth_quantum=0.0,
        against=() if small else None,
    )
    names = {
        "blended": ("K2", "T2", "drag_quadratic", "psi"),
        "quadratic": ("mass", "drag_quadratic", "psi"),
    }[law]
    assert found.chosen.prediction.names == names
    assert found.chosen.time <= found.budget


def test_what_the_settling_is_without_being_told(vehicle):
    from swimbladder.design.experiments.run import _settling

    time, how = _settling(vehicle, None, 4.5, 0.75)
    assert 240.0 < time < 600.0  # two to ten times the minute at rest
    assert how.startswith("simulated")
    assert _settling(sb.load_vehicle("ntnu-bv"), None, 1.5, 0.3)[0] == 120.0


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"bottom_depth": 1.6}, "bottom_depth"),
        ({"depth_noise": None}, "depth_noise"),
        ({"depth_noise": -1.0}, "depth_noise"),
        ({"sample_time": 0.0}, "sample_time"),
        ({"neutral_std": 0.0}, "neutral_std"),
        ({"settling": -1.0}, "settling"),
        ({"max_record_time": 1.0}, "max_record_time"),
        ({"uncertainty": 1.5}, "uncertainty"),
        ({"pool_time": 60.0}, "pool_time"),
        ({"criterion": "best"}, "criterion"),
        ({"free": ("K3",)}, "free"),
        ({"free": ()}, "free"),
        ({"fixed": {"K2": -1.0}}, "fixed"),
        ({"fixed": {"psi": 1e-6}, "free": ("K2", "psi")}, "fixed"),
        ({"priors": {"psi": Prior(1e-6, 0.0)}}, "priors"),
        ({"priors": {"psi": Prior(1e-6, 1e-7)}, "free": ("K2",)}, "priors"),
        ({"against": (1e-3,)}, "against"),
        ({"against": (0.0,)}, "against"),
        ({"drag": "switched"}, "drag"),
    ],
)
def test_what_cannot_be_is_refused(vehicle, options, field):
    with pytest.raises(InputError) as caught:
        design_experiment(vehicle, **{**QUICK, **options})
    assert caught.value.field == field
    assert caught.value.remedy
