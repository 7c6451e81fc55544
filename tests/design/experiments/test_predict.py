"""What records tell: against sensitivities of an exact integration, and against itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from swimbladder.design.experiments.conditions import Release, fisher_information, follow
from swimbladder.design.experiments.evaluation import (
    predict,
    without_drift,
    without_psi,
    without_trim,
)
from swimbladder.estimation.motion import Prior
from tests.design.experiments.truth import Vehicle, depths

CM3 = 1e-6
NAMES = ("K2", "T2", "psi")
TRUE = np.array([7935.54, 36.3, 4.04e-6])
SET = (
    Release.to_and_fro(3.75, [20 * CM3], []),
    Release.to_and_fro(0.75, [-30 * CM3], []),
    Release.to_and_fro(0.75, [-40 * CM3, 40 * CM3], [1.8]),
)
PAPER = [
    Release.to_and_fro(3.75 if v > 0 else 0.75, [v * CM3], [])
    for v in (20, -20, 30, -30, 45, -45, 75, -75)
]


def flights(releases, c):
    return [follow(r, c.question.values, c) for r in releases]


def model(x, records):
    """Return the depths of all records: x is K2, T2, psi as shares, then neutral volume [cm3],
    depth [cm] and speed [cm/s] at the start of each.
    """
    vehicle = Vehicle(*(TRUE * x[:3]))
    own = x[3:].reshape(-1, 3)
    return np.concatenate(
        [
            depths(
                vehicle,
                f.volume,
                f.release.start,
                0.3,
                neutral=v * CM3,
                speed=0.01 * w,
                depth=f.release.start + 0.01 * z,
            )
            for f, (v, z, w) in zip(records, own, strict=True)
        ]
    )


def start(records):
    return np.concatenate([np.ones(3), np.zeros(3 * len(records))])


def slopes(records, x0=None):
    """Return the central differences of model: a record has the vehicle's columns and its own."""
    x0 = start(records) if x0 is None else x0
    blocks = []
    for j, f in enumerate(records):
        own = np.concatenate([x0[:3], x0[3 + 3 * j : 6 + 3 * j]])
        block = np.zeros((len(f.depth), len(x0)))
        for i, column in enumerate([0, 1, 2, 3 + 3 * j, 4 + 3 * j, 5 + 3 * j]):
            h = np.where(np.arange(6) == i, 1e-5 if i < 3 else 1e-4, 0.0)
            block[:, column] = (model(own + h, [f]) - model(own - h, [f])) / (2.0 * h[i])
        blocks.append(block)
    return np.concatenate(blocks)


def information(records, setting, psi_std=math.inf):
    J = slopes(records) / setting.depth_noise
    known = np.zeros(J.shape[1])
    known[3::3] = (CM3 / setting.neutral_std) ** 2
    known[2] = psi_std**-2
    return J.T @ J + np.diag(known)


def but(c, **changes):
    return c._replace(setting=replace(c.setting, **changes))


def with_prior(c, share):
    prior = Prior(TRUE[2], share * TRUE[2])
    return c._replace(question=c.question._replace(priors={"psi": prior}))


@pytest.mark.parametrize("psi_std", [math.inf, 0.01])
def test_the_covariance_is_that_of_exact_sensitivities(conditions, psi_std):
    c = conditions
    if math.isfinite(psi_std):
        c = with_prior(c, psi_std)
    records = flights(SET, c)
    expected = np.linalg.inv(information(records, c.setting, psi_std))[:3, :3] * np.outer(
        TRUE, TRUE
    )
    p = predict(records, c)
    assert p.names == NAMES
    assert p.covariance / expected == pytest.approx(np.ones((3, 3)), rel=2e-4)
    for i, name in enumerate(NAMES):
        e = p.parameters[name]
        assert e.std == pytest.approx(math.sqrt(expected[i, i]), rel=1e-4)
        assert e.value == pytest.approx(TRUE[i])
    low, high = p.parameters["K2"].ci95
    assert low * high == pytest.approx(TRUE[0] ** 2)
    assert not p.open


def test_information_adds_up_over_records(conditions):
    c = conditions
    records = flights(SET, c)
    known = [fisher_information(f, c.question.values, c) for f in records]
    C = np.linalg.inv(sum(k.gain for k in known)) * np.outer(TRUE, TRUE)
    assert C / predict(records, c).covariance == pytest.approx(1.0, rel=1e-6)


def test_the_sources_are_how_the_variance_follows_each_error(conditions):
    """d ln variance/d ln (noise squared) is the noise's share; so for the others."""
    h = 1e-3
    c = with_prior(conditions, 0.02)
    setting, records = c.setting, flights(SET, c)
    p = predict(records, c)

    def slope(changed):
        more = predict(records, changed)
        return [
            2.0 * math.log(more.parameters[n].std / p.parameters[n].std) / (2.0 * math.log1p(h))
            for n in NAMES
        ]

    grown = {
        "noise": but(c, noise=setting.depth_noise * (1 + h), quantum=0.0),
        "neutral volume": but(c, neutral_std=setting.neutral_std * (1 + h)),
        "prior": with_prior(c, 0.02 * (1 + h)),
    }
    for source, changed in grown.items():
        found = [p.sources[name][source] for name in NAMES]
        assert found == pytest.approx(slope(changed), abs=2e-3)
    assert all(sum(p.sources[name].values()) == pytest.approx(1.0) for name in NAMES)


def refit(records, setting, measured):
    """Return by how much K2, T2, psi come out off, as shares: a step of Gauss and Newton."""
    off = (measured - model(start(records), records)) / setting.depth_noise
    J = slopes(records) / setting.depth_noise
    return np.linalg.solve(information(records, setting), J.T @ off)[:3]


def test_a_drift_does_what_a_refit_of_a_drifting_truth_shows(conditions):
    """A neutral volume that is right at the release and drifts evenly before and after."""
    records = flights(SET, conditions)
    c = but(conditions, drift_std=0.02e-6 / 60.0)
    slow, values = c.setting, c.question.values
    one = [slow.drift_std, 0.0, 0.0]
    true = Vehicle(*TRUE)

    def with_drifts(rates):
        return np.concatenate(
            [
                depths(true, f.volume, f.release.start, 0.3, drift=d, neutral=-d * 5.1)
                for f, d in zip(records, rates, strict=True)
            ]
        )

    expected = refit(records, slow, with_drifts([slow.drift_std] * 3))
    found = without_drift(records, c).linear
    assert [found[n] for n in NAMES] == pytest.approx(expected, rel=2e-3, abs=2e-7)
    # One record alone: what adds up in squares.
    single = refit(records, slow, with_drifts(one))
    gains = sum(fisher_information(f, values, c).gain for f in records)
    score = fisher_information(records[0], values, c).drift
    step = np.linalg.solve(gains, score) * slow.drift_std
    assert step == pytest.approx(single, rel=2e-3, abs=2e-7)
    p = predict(records, c)
    each = [fisher_information(f, values, c).drift for f in records]
    moved = np.linalg.solve(gains, np.array(each).T) * slow.drift_std
    assert [p.drift[n] for n in NAMES] == pytest.approx(np.linalg.norm(moved, axis=1) * TRUE)
    shares = [
        math.hypot(p.parameters[n].std, p.drift[n]) / v for n, v in zip(NAMES, TRUE, strict=True)
    ]
    assert [p.share[n] for n in NAMES] == pytest.approx(shares)


def test_a_trim_does_what_a_refit_of_a_truth_that_is_off_shows(conditions):
    records = flights(SET, conditions)
    true = Vehicle(*TRUE)
    measured = np.concatenate(
        [depths(true, f.volume, f.release.start, 0.3, neutral=0.005e-6) for f in records]
    )
    expected = 100.0 * refit(records, conditions.setting, measured)
    found = without_trim(records, conditions).linear
    scale = np.abs(expected).max()
    assert np.array([found[n] for n in NAMES]) / scale == pytest.approx(expected / scale, abs=5e-3)
    assert without_trim(records, but(conditions, neutral_std=math.inf)) is None


def test_leaving_psi_out_is_what_a_refit_without_psi_shows(conditions):
    """The paper's eight: K2 and T2 far off at a few millimetres, which nobody would notice."""
    setting, records = conditions.setting, flights(PAPER, conditions)
    measured = np.concatenate([f.depth for f in records])

    found = without_psi(records, conditions)
    rows = np.repeat(np.arange(len(records)), [len(f.depth) for f in records])
    x, noise = np.delete(start(records), 2), np.full(len(records), setting.depth_noise)

    def full(x):
        return np.concatenate([x[:2], [0.0], x[2:]])

    known = np.zeros((len(records), len(x)))
    known[np.arange(len(records)), 2 + 3 * np.arange(len(records))] = CM3 / setting.neutral_std

    def residual(x):
        return np.concatenate([(model(full(x), records) - measured) / noise[rows], known @ x])

    def slope(x):
        J = np.delete(slopes(records, full(x)), 2, axis=1)
        return np.concatenate([J / noise[rows, None], known])

    # Linearised: one step of Gauss and Newton from the truth without psi.
    linear = np.linalg.lstsq(slope(x), -residual(x), rcond=None)[0]
    assert [found.linear["K2"], found.linear["T2"]] == pytest.approx(linear[:2], rel=1e-3)
    for _ in range(4):  # what the model cannot follow counts as noise, as it would in a fit
        x = least_squares(residual, x, slope, x_scale="jac").x
        off = residual(x)[: len(measured)] * noise[rows]
        left = np.array([np.mean(off[rows == j] ** 2) for j in range(len(records))])
        noise = np.sqrt(left + setting.depth_noise**2)
    assert [found.refit["K2"], found.refit["T2"]] == pytest.approx(x[:2] - 1.0, abs=0.04)
    assert found.refit["K2"] > 0.6
    assert found.rms < 5e-3


def test_psi_left_out_is_nothing_where_there_is_none(conditions):
    records, question = flights(SET[:1], conditions), conditions.question
    for other in (question._replace(fixed={"psi": 0.0}), question._replace(names=("psi",))):
        assert without_psi(records, conditions._replace(question=other)) is None
