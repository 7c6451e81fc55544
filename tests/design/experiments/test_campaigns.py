"""Days at the pool, simulated by an integration of its own: what was predicted, and what came."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from swimbladder.design.experiments.conditions import Conditions, Flight, follow, predict, ramps
from swimbladder.design.plan import load_plan, plan_file
from swimbladder.estimation.motion import identify
from tests.design.experiments.days import logs
from tests.design.experiments.truth import Vehicle, depths

pytestmark = pytest.mark.prove

NAMES = ("K2", "T2", "psi")
CAMPAIGNS = 60


def truth(k):
    """Return the vehicle of a campaign: the paper's, each number off by a tenth or so."""
    by = np.exp(0.1 * np.random.default_rng([7, k]).normal(size=3))
    return Vehicle(7935.54 * by[0], 36.3 * by[1], 4.04e-6 * by[2])


@pytest.fixture(scope="module")
def campaigns(design, vehicle, setting, tmp_path_factory):
    """Return of both sets, over campaigns: errors, deviations reported and predicted, as shares,
    and covariances reported and predicted.
    """
    limits = ramps(vehicle, setting)
    found = {}
    for name, evaluated in (("planned", design.chosen), ("paper", design.against)):
        path = tmp_path_factory.mktemp(name) / "plan.toml"
        path.write_text(plan_file(design.plan(evaluated)), encoding="utf-8")
        plan, rows = load_plan(path), []
        for k in range(CAMPAIGNS):
            true = truth(k)
            values = np.array([true.K2, true.T2, true.psi])
            measured = logs(plan, true, np.random.default_rng([11, k]), setting)
            answer = identify(measured, vehicle, profiles=False, choices=False)
            asked = design.conditions.question
            there = asked.values | dict(zip(NAMES, values.tolist(), strict=True))
            question = asked._replace(model=asked.model._replace(values=there))
            c = Conditions(question, setting, limits, vehicle)
            flights = [follow(r, there, c) for r in evaluated.releases]
            expected = predict(flights, c)
            rows.append(
                (
                    np.array([answer.parameters[n].value for n in NAMES]) / values - 1.0,
                    np.array([answer.parameters[n].std for n in NAMES]) / values,
                    np.array([expected.parameters[n].std for n in NAMES]) / values,
                    answer.correlation,
                    expected.correlation,
                )
            )
        found[name] = [np.array(column) for column in zip(*rows, strict=True)]
    return found


def rms(errors):
    return np.sqrt(np.mean(errors**2, axis=0))


def test_the_planned_set_is_better_than_the_papers_in_no_more_time(design, campaigns):
    """Realised errors, the same vehicles and the same pool time."""
    assert design.chosen.time <= design.against.time
    ours, theirs = rms(campaigns["planned"][0]), rms(campaigns["paper"][0])
    assert (theirs / ours > 3.0).all(), (ours, theirs)


@pytest.mark.parametrize("name", ["planned", "paper"])
def test_the_deviation_predicted_is_the_scatter_that_comes(campaigns, name):
    """Within its sampling error: the squares of 60 errors over the predicted deviation."""
    errors, _, predicted, *_ = campaigns[name]
    squares = ((errors / predicted) ** 2).sum(axis=0)
    low, high = chi2.ppf([0.001, 0.999], CAMPAIGNS)
    assert ((low < squares) & (squares < high)).all(), squares / CAMPAIGNS


@pytest.mark.parametrize("name", ["planned", "paper"])
def test_the_covariance_predicted_is_the_one_reported(campaigns, name):
    """Up to the noise, which a fit estimates, and to where noisy depths set off the moves: they
    do so a little early.
    """
    _, reported, predicted, said, expected = campaigns[name]
    ratio = reported / predicted
    assert np.median(ratio, axis=0) == pytest.approx(np.ones(3), abs=0.08)
    assert np.mean(np.abs(ratio - 1.0) < 0.4) > 0.9  # where it turns decides in an unstable vehicle
    assert np.median(np.abs(said - expected)) < 0.03


@pytest.mark.parametrize("name", ["planned", "paper"])
def test_intervals_hold_the_truth_under_all_that_the_plan_assumes(campaigns, name):
    """Noise, quantum, neutral volumes that are off and drift, volumes that are late, and a motor
    that begins between two samples.
    """
    errors, reported, *_ = campaigns[name]
    held = (np.abs(errors) < 1.96 * reported).sum(axis=0)
    assert (held >= binom(CAMPAIGNS, 0.95).ppf(0.002)).all(), held / CAMPAIGNS


def test_of_the_records_as_they_came_the_covariance_is_reported(design, vehicle, conditions):
    """Nothing is left but the noise that a fit estimates, from some two thousand depths; and where
    the scores of a few blocks scatter more than the information says, intervals are wider.
    """
    plan, true, setting = design.plan(), Vehicle(7935.54, 36.3, 4.04e-6), conditions.setting
    neutral, ratios = replace(setting, neutral_std=0.0, drift_std=0.0, delay_std=0.0), []
    for k in range(12):
        measured = logs(plan, true, np.random.default_rng([17, k]), neutral)
        answer = identify(measured, vehicle, profiles=False, choices=False)
        flights = [
            Flight(
                release,
                log.time,
                log.volume - 1e-4,
                depths(true, log.volume - 1e-4, release.start, plan.sample_time),
                (17,),
                "longest",
            )
            for log, release in zip(measured, design.chosen.releases, strict=True)
        ]
        expected = predict(flights, conditions._replace(question=design.conditions.question))
        size = np.sqrt(np.diag(answer.covariance) / np.diag(expected.covariance))
        assert answer.correlation == pytest.approx(expected.correlation, abs=0.06)
        ratios.append(size * setting.depth_noise / answer.depth_noise)
    assert np.min(ratios) > 0.94
    assert np.mean(np.array(ratios) < 1.06) > 0.9
    assert np.median(ratios, axis=0) == pytest.approx(np.ones(3), abs=0.02)
