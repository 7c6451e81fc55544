"""Parameters where the neutral volume walks: truth from matrix exponentials, many campaigns."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.stats import binom

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.motion import DRIFT_STD, Prior, identify
from swimbladder.estimation.motion.problem import Assumed, posed
from swimbladder.estimation.motion.process_noise import fit_process_noise, highest_with_noise
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from tests.estimation.motion.pool import G, trace
from tests.estimation.motion.pool import campaign as pool_campaign
from tests.quoted import refused

VEHICLE = load_vehicle("feup-em")
TRUTH = {"K2": 9000.0, "T2": 30.0, "psi": 3e-6}
NOISE, WALK, JOLT = 4e-3, 0.4e-6, 4e-4


def walked(records, *, acceleration=True, free=None, drag=None, **assumed):
    problem = posed(records, VEHICLE, Assumed(**assumed), free=free, drag=drag)
    without = () if acceleration else ("acceleration",)
    return fit_process_noise(problem, VEHICLE, without=("correlated", *without))


@cache
def discrete(h, random_walk, acceleration):
    """Transition over h [s], what V and dV/dt add, and a root of the noise; volumes in cm3."""
    K2, T2, psi = TRUTH["K2"], TRUTH["T2"], TRUTH["psi"]
    a = 1e-6 * K2 / T2
    A = np.array([[0.0, 1.0, 0.0], [K2 / T2 * psi, -1.0 / T2, a], [0.0, 0.0, 0.0]])
    L = np.diag([0.0, acceleration**2, 1e12 * random_walk**2])
    forced = np.zeros((5, 5))
    forced[:3, :3], forced[1, 3], forced[3, 4] = A, -a, 1.0
    F = expm(forced * h)
    E = expm(np.block([[-A, L], [np.zeros((3, 3)), A.T]]) * h)  # van Loan
    values, vectors = np.linalg.eigh(F[:3, :3] @ E[:3, 3:])
    return F[:3, :3], F[:3, 3:], vectors * np.sqrt(np.maximum(values, 0.0))


def made(seed, *, random_walk=WALK, acceleration=JOLT, n=160, outliers=0.0, neutral_std=5e-6):
    """A dive that starts at 40 m, its volume stepped about: a record and its neutral volumes."""
    rng = np.random.default_rng(seed)
    spans = rng.choice([0.4, 0.5, 0.7], n - 1)
    neutral = 1e6 * TRUTH["psi"] * 40.0
    volume = neutral + rng.normal(0.0, 20.0, 1 + n // 16).repeat(16)[:n]
    states = np.empty((n, 3))
    states[0] = 40.0, 0.0, rng.normal(0.0, 1e6 * neutral_std)
    for k, h in enumerate(spans.tolist()):
        F, B, root = discrete(h, random_walk, acceleration)
        ramp = np.array([volume[k], (volume[k + 1] - volume[k]) / h])
        states[k + 1] = F @ states[k] + B @ ramp + root @ rng.normal(size=3)
    depth = states[:, 0] + rng.normal(0.0, NOISE, n)
    bad = rng.random(n) < outliers
    bad[:10] = False
    depth = depth + np.where(bad, rng.choice([-1.0, 1.0], n) * rng.uniform(0.2, 2.0, n), 0.0)
    return Record(
        drive="volume",
        time=np.append(0.0, np.cumsum(spans)),
        depth=depth,
        volume=1e-6 * volume,
        volume_absolute=True,
        compared=np.ones(n, bool),
        bottom_depth=math.inf,
    ), 1e-6 * states[:, 2]


def campaign(seed, count=4, **change):
    return [made(100 * seed + i, **change)[0] for i in range(count)]


@pytest.mark.prove
def test_the_parameters_and_the_walk_are_found_with_honest_intervals():
    """Of 30 campaigns the 95 % intervals hold the truth as often as they should."""
    runs = 30
    held = dict.fromkeys([*TRUTH, "random_walk", "depth_noise", "acceleration"], 0)
    values = {name: [] for name in held}
    for seed in range(runs):
        found = walked(campaign(seed), acceleration=True)
        estimates = found.estimates | {
            name: found.noises[name] for name in ("random_walk", "depth_noise", "acceleration")
        }
        truth = TRUTH | {"random_walk": WALK, "depth_noise": NOISE, "acceleration": JOLT}
        for name, e in estimates.items():
            held[name] += e.ci95[0] <= truth[name] <= e.ci95[1]
            values[name].append(e.value)
    fewest = binom(runs, 0.95).ppf(0.002)
    assert all(count >= fewest for count in held.values()), held
    for name in TRUTH:
        spread = np.std(values[name]) / math.sqrt(runs)
        assert abs(np.mean(values[name]) - TRUTH[name]) < 4.0 * spread + 0.01 * TRUTH[name]
    assert np.mean(values["random_walk"]) == pytest.approx(WALK, rel=0.15)


def test_one_campaign_tells_its_parameters_and_that_the_neutral_volume_drifts():
    records = [made(seed) for seed in (1, 2, 3, 4)]
    found = walked([r for r, _ in records])
    assert found.names == ("K2", "T2", "psi")
    for name, e in found.estimates.items():
        assert abs(e.value - TRUTH[name]) < 3.5 * e.std
        assert e.ci95[0] < e.value < e.ci95[1]
        assert e.std < 0.2 * e.value
    assert found.drifts
    assert found.noises["random_walk"].ci95[0] < WALK < found.noises["random_walk"].ci95[1]
    assert found.covariance.shape == (3, 3)
    std = [e.std for e in found.estimates.values()]
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), std, rtol=1e-9)
    share = np.array(found.travelled) / [np.ptp(neutral) for _, neutral in records]
    assert np.all((share > 0.4) & (share < 1.1))  # a smoothed walk goes less far than the true one
    told = found.to_dict()
    assert set(told["parameters"]) == set(found.names)
    assert told["noises"]["random_walk"]["unit"] == "m3/s^0.5"


def test_a_neutral_volume_that_stays_is_not_said_to_drift():
    """The likelihood ratio's chance of a false alarm, 1 % each, and intervals that reach 0."""
    alarms = reach = 0
    for seed in range(8):
        found = walked(campaign(seed, 2, random_walk=0.0, acceleration=0.0), acceleration=False)
        alarms += found.drifts
        reach += found.noises["random_walk"].ci95[0] == 0.0
        assert found.noises["acceleration"].origin == "set"
    assert alarms <= 1
    assert reach >= 6


def test_gross_outliers_do_not_move_it_by_a_deviation():
    clean = walked(campaign(5))
    dirty = walked(campaign(5, outliers=0.1))
    for name, e in clean.estimates.items():
        assert abs(dirty.estimates[name].value - e.value) < e.std
    assert dirty.noises["depth_noise"].value == pytest.approx(
        clean.noises["depth_noise"].value, rel=0.15
    )


def test_what_is_fixed_stays_and_a_prior_holds():
    fixed = walked(campaign(6), fixed={"psi": 3e-6})
    assert fixed.names == ("K2", "T2")
    assert fixed.values["psi"] == 3e-6
    prior = walked(campaign(6), priors={"psi": Prior(3e-6, 1e-9)})
    assert prior.estimates["psi"].value == pytest.approx(3e-6, abs=3e-9)
    assert prior.estimates["psi"].std <= 1.01e-9
    for name in ("K2", "T2"):
        same = prior.estimates[name]
        assert same.value == pytest.approx(fixed.estimates[name].value, rel=0.01)


def test_the_quadratic_law_is_found_as_well():
    """The linear truth, met by a quadratic drag of the same force at the speeds that occur."""
    found = walked(campaign(7), drag="quadratic")
    assert found.names == ("mass", "drag_quadratic", "psi")
    mass = VEHICLE.water.specific_weight * TRUTH["T2"] / TRUTH["K2"]
    assert found.estimates["mass"].value == pytest.approx(mass, rel=0.25)
    linear = walked(campaign(7))
    assert linear.log_likelihood > found.log_likelihood


def test_what_cannot_be_is_refused():
    (record, _) = made(1)
    with refused(InputError, field="drive", value="voltage"):
        walked([replace(record, drive="voltage", voltage=record.volume)])
    with refused(InputError, field="free", value="K3"):
        walked([record], free=["K3"])
    still = replace(record, volume=np.full_like(record.volume, record.volume[0]))
    nothing = walked([replace(still, depth=np.full_like(record.depth, 40.0))])
    assert all(e.std > 0.3 * e.value for e in nothing.estimates.values())


def correlated_campaign(seed):
    """The paper's eight experiments; of the noise 0.9 is left at the next sample."""
    rng = np.random.default_rng(seed)
    logs = []
    for log in pool_campaign(seed, noise=0.0):
        noise = lfilter(
            [math.sqrt(1.0 - 0.9**2)], [1.0, -0.9], rng.normal(0.0, 2e-3, len(log) + 99)
        )
        logs.append(replace(log, depth=log.depth + noise[99:]))
    return logs


def test_correlated_noise_of_the_depth_is_no_motion():
    found = identify(correlated_campaign(3), VEHICLE, profiles=False, choices=False)
    fit = found.process_noise
    assert fit is not None
    noise = fit.noises["correlated"], fit.noises["correlation_time"]
    for e, truth in zip(noise, (2e-3, -0.3 / math.log(0.9)), strict=True):
        assert e.ci95[0] < truth < e.ci95[1]
        assert e.value == pytest.approx(truth, rel=0.4)
    assert fit.noises["depth_noise"].value < 0.5e-3
    for name, truth in (("K2", 7935.54), ("T2", 36.3), ("psi", 4.04e-6)):
        assert abs(found.parameters[name].value - truth) < 3.5 * found.parameters[name].std


@pytest.mark.prove
def test_draws_that_cannot_be_made_are_said():
    found = identify(correlated_campaign(4), VEHICLE, profiles=False, choices=False, posterior=1)
    assert found.posterior is None
    (said,) = (f for f in found.findings if f.kind == "posterior")
    assert said.severity == "warning"
    assert "`process_noise='never'`" in said.sentence


@pytest.mark.prove
def test_intervals_hold_the_truth_in_correlated_noise():
    runs, held = 100, dict.fromkeys(("K2", "T2", "psi"), 0)
    for seed in range(runs):
        found = identify(correlated_campaign(seed), VEHICLE, profiles=False, choices=False)
        for name, truth in (("K2", 7935.54), ("T2", 36.3), ("psi", 4.04e-6)):
            low, high = found.parameters[name].ci95
            held[name] += low < truth < high
    fewest = binom(runs, 0.93).ppf(0.005)
    assert all(count >= fewest for count in held.values()), held


@pytest.mark.parametrize(
    "seed", [0, 2, *(pytest.param(n, marks=pytest.mark.prove) for n in (1, 3))]
)
def test_more_freedom_never_fits_worse(seed):
    """Free a noise, or a parameter: what is most probable does not become less so."""
    rng = np.random.default_rng(seed)
    records = campaign(seed, 1 + seed % 2, acceleration=JOLT * rng.choice([0.0, 3.0]))
    held = posed(records, VEHICLE, Assumed(fixed={"psi": rng.normal(3e-6, 3e-6)}))
    free = posed(records, VEHICLE, Assumed())
    everything = highest_with_noise(free, VEHICLE).height
    for problem in (held, free):
        full = highest_with_noise(problem, VEHICLE).height
        for without in (["random_walk"], ["correlated"], ["acceleration", "random_walk"]):
            assert highest_with_noise(problem, VEHICLE, without=without).height < full + 0.1
        assert full < everything + 0.1


def test_a_model_of_an_unstable_vehicle_does_not_pass_for_one_that_follows():
    """A filter of it corrects itself at every sample; from its start on the model goes astray."""
    time = np.arange(0.0, 120.0, 0.5)
    rng = np.random.default_rng(5)
    depth = 1.0 + np.cumsum(rng.normal(0.0, 0.02, len(time)))
    volume = rng.normal(0.0, 5e-6, len(time) // 20 + 1).repeat(20)[: len(time)]
    log = Log(source="x", time=time, depth=depth, volume=volume, line=np.arange(len(time)))
    found = identify([log], VEHICLE, profiles=False, choices=False)
    assert not found.identified


@pytest.mark.parametrize("seed", [0, 3])
def test_a_drift_that_is_assumed_is_in_the_intervals(seed):
    """What no random walk shows still shifts psi: as much as the prior of the drift allows."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 200.0, 0.5)
    volume = rng.normal(0.0, 20e-6, len(time) // 40 + 1).repeat(40)[: len(time)]
    drift = 0.15e-6 / 60.0 * (1.0 - 2.0 * (seed % 2))
    truth = {"m": 44.0, "k_dl": 1.2, "psi": -2e-6}
    depth = trace(time, volume - drift * time, z0=20.0, V0=4e-5, **truth)
    arrays = {"volume": volume, "depth": depth + 2e-3 * rng.normal(size=len(time))}
    log = Log(source="x", time=time, line=np.arange(len(time)), volume_absolute=True, **arrays)
    quick = {"process_noise": "always", "profiles": False, "choices": False}
    found = identify([log], VEHICLE, **quick).parameters["psi"]
    assert abs(found.value - truth["psi"]) < 3.0 * found.std
    assert found.std < 0.2e-6


@cache
def drifting(rate):
    """Return records without process noise, whose neutral volumes drift steadily by a rate."""
    found = []
    for k in range(3):
        record, _ = made(800 + k, random_walk=0.0, acceleration=0.0, n=400, neutral_std=0.0)
        time = record.time
        truth = {"m": G * TRUTH["T2"] / TRUTH["K2"], "k_dl": G / TRUTH["K2"], "psi": TRUTH["psi"]}
        noise = np.random.default_rng(900 + k).normal(scale=NOISE, size=len(time))
        depth = trace(time, record.volume - rate * time, z0=40.0, **truth) + noise
        found.append(replace(record, depth=depth))
    return found


def test_a_steady_drift_is_no_process_noise():
    """Drift of two deviations of its prior over four minutes: a walk without a drift of its own."""
    rate = 2.0 * DRIFT_STD
    steady = walked(drifting(rate), drift_std=DRIFT_STD)
    assert steady.p_any > 0.01
    walks = walked(drifting(rate), drift_std=0.0)
    assert walks.p_value < 1e-6
    for name, true in TRUTH.items():
        e = steady.estimates[name]
        assert abs(e.value - true) < 3.5 * e.std
        assert e.std < walks.estimates[name].std
    for record, track in zip(drifting(rate), steady.tracks, strict=True):
        went, C = np.diff(track.smoothed[[0, -1], 2]).item(), track.covariance[[0, -1], 2, 2]
        assert abs(went - rate * record.time[-1]) < 3.5 * math.sqrt(C.sum())
        assert math.sqrt(C.sum()) < 0.5 * rate * record.time[-1]
