"""What records tell: against sensitivities of an exact integration, and against itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag, cholesky, solve_triangular
from scipy.optimize import least_squares

import swimbladder as sb
from swimbladder.design.experiments.conditions import (
    Release,
    fisher_information,
    follow,
    predict,
    without_drift,
    without_psi,
    without_trim,
)
from swimbladder.estimation.motion import Prior
from tests.design.experiments.truth import Vehicle, depths

CM3 = 1e-6
FEUP_EM = sb.load_vehicle("feup-em")
NAMES = ("K2", "T2", "psi")
TRUE = np.array([7935.54, 36.3, 4.04e-6])
TRUTH = Vehicle(*TRUE)
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


OWN = 4  # of each record: neutral volume [cm3], depth [cm], speed [cm/s], drift [cm3/min]
PER_MINUTE = CM3 / 60.0
SHARED = 2  # last: how late the volumes are [s], how early they move, in shares of what is possible


def early(f):
    """Return by how much volumes [n] are off that go as early as they can in each span.

    A motor that is as fast as in the record's fastest span, and moves at once: the mean volume of a
    span is off by change/2 (1 - |change|/largest), of which either end of the span has half.
    """
    change = np.diff(f.volume)
    off = 0.5 * change * (1.0 - np.abs(change) / np.abs(change).max())
    return 0.5 * (np.append(off, 0.0) + np.append(0.0, off))


def of_spans(f):
    """Return the deviation of the mean volume of each span [n - 1, m3]."""
    bends = np.pad(np.abs(np.diff(f.volume, 2)), 1)
    bend = 0.12 * np.maximum(bends[1:], bends[:-1])
    return np.hypot(bend, 2e-5 * (FEUP_EM.stroke.maximum - FEUP_EM.stroke.minimum))


def model(x, records):
    """Return the depths of all records: x is K2, T2, psi as shares, OWN of each record at its
    start, and SHARED.
    """
    vehicle = Vehicle(*(TRUE * x[:3]))
    own = x[3:-SHARED].reshape(-1, OWN)
    return np.concatenate(
        [
            depths(
                vehicle,
                np.interp(f.time + x[-2], f.time, f.volume + x[-1] * early(f)),
                f.release.start,
                f.time[1] - f.time[0],
                neutral=v * CM3,
                speed=0.01 * w,
                depth=f.release.start + 0.01 * z,
                drift=d * PER_MINUTE,
            )
            for f, (v, z, w, d) in zip(records, own, strict=True)
        ]
    )


def start(records):
    return np.concatenate([np.ones(3), np.zeros(OWN * len(records) + SHARED)])


def slopes(records, x0=None):
    """Return the differences of model: a record has the vehicle's columns, its own, the shared."""
    x0 = start(records) if x0 is None else x0
    blocks = []
    for j, f in enumerate(records):
        mine = range(3 + OWN * j, 3 + OWN * (j + 1))
        own = np.concatenate([x0[:3], x0[mine], x0[-SHARED:]])
        block = np.zeros((len(f.depth), len(x0)))
        for i, column in enumerate([0, 1, 2, *mine, None, len(x0) - 1]):
            if column is not None:
                h = np.where(np.arange(len(own)) == i, 1e-5 if i < 3 else 1e-4, 0.0)
                block[:, column] = (model(own + h, [f]) - model(own - h, [f])) / (2.0 * h[i])
        block[:, -2] = speeds(own, f)  # all that drives the vehicle comes so much later
        blocks.append(block)
    return np.concatenate(blocks)


def speeds(own, f):
    """Return the speeds at the samples of a record, from depths between them."""
    fine = np.linspace(f.time[0], f.time[-1], 20 * (len(f.time) - 1) + 1)
    between = model(own, [f._replace(time=fine, volume=np.interp(fine, f.time, f.volume))])
    return np.gradient(between, fine, edge_order=2)[::20]


def covariance_of_depths(records, setting, vehicle):
    """Return the covariance [n, n] of the measured depths of all records: noise, and what a volume
    that is off in one span, and in no other, does from there on.
    """
    blocks = []
    for f in records:
        h, n = f.time[1] - f.time[0], len(f.time)
        P = vehicle.stepper(h)
        state, response = P[:2, 2], np.zeros(n)  # of a volume of 1 m3 more in the first span
        for k in range(1, n):
            response[k] = state[0]
            state = P[:2, :2] @ state
        G = np.array([np.append(np.zeros(k), response[: n - k]) for k in range(n - 1)]).T
        noise = np.hypot(setting.depth_noise, 1e-4)  # how volumes go that no log says
        blocks.append(noise**2 * np.eye(n) + (G * of_spans(f) ** 2) @ G.T)
    return block_diag(*blocks)


def whitened(rows, records, setting, vehicle=TRUTH):
    """Return rows of depths, in deviations."""
    root = cholesky(covariance_of_depths(records, setting, vehicle), lower=True)
    return solve_triangular(root, rows, lower=True)


def priors(records, setting, psi_std=math.inf):
    known = np.zeros(3 + OWN * len(records) + SHARED)
    noise = np.hypot(setting.depth_noise, 1e-4)
    known[3:-SHARED:OWN] = (CM3 / setting.neutral_std) ** 2
    known[4:-SHARED:OWN] = (0.01 / (3.0 * noise)) ** 2
    known[5:-SHARED:OWN] = (0.01 / 0.1) ** 2
    known[6:-SHARED:OWN] = (PER_MINUTE / setting.drift_std) ** 2
    known[-2:] = setting.delay_std**-2, 0.8**-2
    known[2] = psi_std**-2
    return known


def information(records, setting, psi_std=math.inf):
    J = whitened(slopes(records), records, setting)
    return J.T @ J + np.diag(priors(records, setting, psi_std))


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
    # 0.2 %: in the filter a volume is off by white noise, here by a constant in each span
    assert p.covariance / expected == pytest.approx(np.ones((3, 3)), rel=2e-3)
    for i, name in enumerate(NAMES):
        e = p.parameters[name]
        assert e.std == pytest.approx(math.sqrt(expected[i, i]), rel=1e-3)
        assert e.value == pytest.approx(TRUE[i])
    low, high = p.parameters["K2"].ci95
    assert low * high == pytest.approx(TRUE[0] ** 2)
    assert not p.open


def test_information_adds_up_over_records(conditions):
    c = conditions
    records = flights(SET, c)
    each = [fisher_information(f, c.question.values, c) for f in records]
    shares = np.linalg.inv(sum(each) + c.question.prior(c.setting))[:3, :3]
    C = shares * np.outer(TRUE, TRUE)
    assert C / predict(records, c).covariance == pytest.approx(1.0, rel=1e-6)


def test_the_sources_are_how_the_variance_follows_each_error(conditions):
    """d ln variance/d ln (noise squared) is the noise's share; so for the others."""
    h = 1e-3
    c = but(with_prior(conditions, 0.02), delay_std=0.03)
    setting, records = c.setting, flights(SET, c)
    p = predict(records, c)

    def slope(changed):
        more = predict(records, changed)
        return [
            2.0 * math.log(more.parameters[n].std / p.parameters[n].std) / (2.0 * math.log1p(h))
            for n in NAMES
        ]

    grown = {
        "noise": but(c, noise=setting.noise * (1 + h), quantum=setting.quantum * (1 + h)),
        "neutral volume": but(c, neutral_std=setting.neutral_std * (1 + h)),
        "drift": but(c, drift_std=setting.drift_std * (1 + h)),
        "delay": but(c, delay_std=setting.delay_std * (1 + h)),
        "prior": with_prior(c, 0.02 * (1 + h)),
    }
    for source, changed in grown.items():
        found = [p.sources[name][source] for name in NAMES]
        assert found == pytest.approx(slope(changed), abs=2e-3)
    assert all(sum(p.sources[name].values()) == pytest.approx(1.0) for name in NAMES)


def refit(records, setting, measured):
    """Return by how much K2, T2, psi come out off, as shares: a step of Gauss and Newton."""
    off = whitened(measured - model(start(records), records), records, setting)
    J = whitened(slopes(records), records, setting)
    return np.linalg.solve(information(records, setting), J.T @ off)[:3]


def test_a_drift_does_what_a_refit_of_a_drifting_truth_shows(conditions):
    records = flights(SET, conditions)
    c = but(conditions, drift_std=0.02e-6 / 60.0)
    slow, true = c.setting, TRUTH
    drifting = [depths(true, f.volume, f.release.start, 0.3, drift=slow.drift_std) for f in records]
    expected = refit(records, slow, np.concatenate(drifting))
    found = without_drift(records, c).linear
    assert [found[n] for n in NAMES] == pytest.approx(expected, rel=2e-3, abs=2e-7)


def test_a_trim_does_what_a_refit_of_a_truth_that_is_off_shows(conditions):
    records = flights(SET, conditions)
    true = TRUTH
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
    conditions = but(conditions, drift_std=1e-13, delay_std=1e-6)
    setting, records = conditions.setting, flights(PAPER, conditions)
    measured = np.concatenate([f.depth for f in records])

    found = without_psi(records, conditions)
    rows = np.repeat(np.arange(len(records)), [len(f.depth) for f in records])
    x, noise = np.delete(start(records), 2), np.full(len(records), setting.depth_noise)

    def full(x):
        return np.concatenate([x[:2], [0.0], x[2:]])

    known = np.sqrt(np.delete(priors(records, setting), 2))

    def residual(x):
        return np.concatenate([(model(full(x), records) - measured) / noise[rows], known * x])

    def slope(x):
        J = np.delete(slopes(records, full(x)), 2, axis=1)
        return np.concatenate([J / noise[rows, None], np.diag(known)])

    # Linearised: one step of Gauss and Newton from the truth without psi.
    without = Vehicle(*TRUE[:2], 0.0)
    J = np.delete(slopes(records, full(x)), 2, axis=1)
    J = np.vstack([whitened(J, records, setting, without), np.diag(known)])
    off = whitened(measured - model(full(x), records), records, setting, without)
    linear = np.linalg.lstsq(J, np.append(off, np.zeros(len(x))), rcond=None)[0]
    assert [found.linear["K2"], found.linear["T2"]] == pytest.approx(linear[:2], rel=5e-3)
    known[3:-SHARED:OWN] = 0.0
    known[4:-SHARED:OWN], known[-1] = 0.0, 1e6  # the refit knows no starts, and exact volumes
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
