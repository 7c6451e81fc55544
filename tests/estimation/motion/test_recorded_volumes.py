"""Volumes that are not recorded as they were: in coarse steps, through a filter, with spikes.

The truth is SciPy's: a vehicle in a sampled depth loop whose volume goes straight between samples.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from swimbladder.estimation.comparison.record import record
from swimbladder.estimation.motion import identify
from swimbladder.estimation.motion.problem import Assumed, posed
from swimbladder.estimation.motion.process_noise import covariance, highest_with_noise
from swimbladder.estimation.series import followed, quantum
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log

VEHICLE = load_vehicle("feup-em")
TRUTH = {"K2": 7935.54, "T2": 36.3, "psi": 4.04e-6}
G = 9.80665e3  # N/m3, rho g
STEP, FINE = 0.3, 6  # s, parts of it
NOISE = 2e-3  # m


def response(h):
    """Return what depth and speed after h are of these before, of a net volume and of its rate."""
    a, d, psi = TRUTH["K2"] / TRUTH["T2"], 1.0 / TRUTH["T2"], TRUTH["psi"]

    def after(z, w, V, rate):
        def slopes(t, x):
            return x[1], a * (psi * x[0] - V - rate * t) - d * x[1]

        return solve_ivp(slopes, (0.0, h), (z, w), "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    unit = 1e-6  # m3
    columns = after(1, 0, 0, 0), after(0, 1, 0, 0), after(0, 0, unit, 0), after(0, 0, 0, unit)
    return np.stack(columns, axis=1) / [1.0, 1.0, unit, unit]


AFTER = response(STEP / FINE)


def dive(seed, *, span=300.0, step=0.0, lag=0.0, spikes=0.0, early=False, quiet=False, kick=0.0):
    """Return the log of three set-points.

    step: in which the volume is recorded [m3]; lag: of its filter [s]; spikes: in 5 % of the
    samples [m3]; early: it begins on its way at once, 40 cm3/s, and stays until the next sample;
    quiet: the loop knows the depth without noise. kick: of a law with a fiftieth of the gain, in
    the sample where the set-point changes [m3].
    """
    rng = np.random.default_rng(seed)
    n, h = int(span / STEP) + 1, STEP / FINE
    neutral = rng.normal(0.0, 0.5e-6) - TRUTH["psi"] * 1.5
    state, V, smooth, measured, fine = np.array([1.5, 0.0]), 0.0, None, [], []
    for k in range(n):
        measured.append(state[0] + NOISE * rng.normal())
        wanted = [z for at, z in ((0, 3.0), (100, 1.5), (200, 2.5)) if at <= k * STEP][-1]
        seen = state[0] if quiet else measured[-1]
        before = seen if smooth is None else smooth
        smooth = before + STEP / (1.0 + STEP) * (seen - before)
        aim = 100e-6 * (smooth - wanted) + 1500e-6 * (smooth - before) / STEP
        if kick:
            aim = 0.02 * aim + kick * (k * STEP in (99.0, 201.0))
        aim = min(max(aim, -100e-6), 100e-6)
        part = min(max(aim - V, -40e-6 * STEP), 40e-6 * STEP) / FINE
        for _ in range(FINE):
            fine.append(V)
            new = V + (min(max(aim - V, -40e-6 * h), 40e-6 * h) if early else part)
            state = AFTER @ [*state, V - neutral, (new - V) / h]
            V = new
    volume = followed(h * np.arange(len(fine)), np.array(fine), lag)[::FINE]
    if step:
        volume = step * np.round(volume / step + rng.uniform())
    if spikes:
        volume += spikes * (rng.uniform(size=n) < 0.05) * rng.choice([-1.0, 1.0], n)
    depth = np.round(measured, 3)
    time = STEP * np.arange(n)
    return Log(source="dive", time=time, depth=depth, volume=volume, line=np.arange(n))


def off(log):
    """Return how far each parameter is from the truth [deviations], None where it is refused."""
    found = identify([log], VEHICLE, choices=False, profiles=False)
    if not found.identified:
        return None, found
    parts = []
    for name, true in TRUTH.items():
        e = found.parameters[name]
        logarithmic = name != "psi"
        over = e.value * math.log(e.value / true) if logarithmic else e.value - true
        parts.append(over / e.std)
    return np.array(parts), found


def test_a_coarse_volume_widens_the_intervals():
    apart, found = off(dive(4, step=10e-6))
    assert np.abs(apart).max() < 3.0  # psi was 5 deviations off
    assert found.parameters["K2"].std > 0.02 * TRUTH["K2"]
    assert any("in steps of 10 cm3" in f.sentence for f in found.findings)
    known = off(dive(4, step=1e-8))[1]
    assert not any("in steps" in f.sentence for f in known.findings)
    assert known.parameters["K2"].std < 0.5 * found.parameters["K2"].std


def test_a_coarse_volume_is_not_taken_as_exact_where_the_model_follows_it_by_chance():
    apart, found = off(dive(5, step=1e-6))
    assert np.abs(apart).max() < 3.0  # K2 was 8.8 deviations off
    assert any("in steps of 1 cm3" in f.sentence for f in found.findings)


def test_a_volume_that_went_through_a_long_filter_is_refused():
    apart, found = off(dive(1, lag=1.0))
    assert apart is None  # T2 was 5 deviations off
    (no,) = (f.sentence for f in found.findings if f.severity == "no")
    assert "s later than" in no


def test_a_motor_that_moves_early_in_each_sample_moves_no_value():
    apart, found = off(dive(3, early=True, quiet=True))
    assert np.abs(apart).max() < 2.5  # K2 was 9.7 deviations off, T2 8
    early = found.process_noise.values["early_moves"]
    assert 0.5 < early < 1.5


def test_a_kick_of_the_law_is_neither_a_spike_nor_relied_on():
    """It moved the vehicle. Taken for a spike, it made K2 five times less known, or put it off."""
    apart, found = off(dive(1, quiet=True, kick=10e-6))
    assert any("neither is relied on" in note for note in found.notes)
    assert np.abs(apart).max() < 2.5
    assert found.parameters["K2"].std < 0.012 * TRUTH["K2"]


def test_a_search_ends_at_the_top_of_a_narrow_ridge():
    """Nelder and Mead's simplex of all parameters and nuisances finds nothing above."""
    log = dive(1, early=True, quiet=True)
    problem = posed([record(log, VEHICLE, drive="volume")], VEHICLE, Assumed(delay_std=0.2))
    at = highest_with_noise(problem, VEHICLE)
    names = [q.name for q in at.full.quantities]
    ridge = [names.index(n) for n in ("K2", "T2", "psi", "volume_delay", "early_moves")]
    wide = np.linalg.cholesky(covariance(at.full, at.x)[np.ix_(ridge, ridge)])

    def below(steps):
        x = at.x.copy()
        x[ridge] += wide @ steps
        return at.height - at.full(x)

    corners = np.vstack([np.zeros(5), np.eye(5)])
    found = minimize(below, np.zeros(5), method="Nelder-Mead", options={"initial_simplex": corners})
    assert below(np.zeros(5)) == pytest.approx(0.0, abs=1e-9)
    assert found.fun > -0.05


CASES = {
    "1 cm3": {"step": 1e-6},
    "3 cm3": {"step": 3e-6},
    "10 cm3": {"step": 10e-6},
    "filter of 0.2 s": {"lag": 0.2},
    "filter of 0.5 s": {"lag": 0.5},
    "spikes": {"spikes": 1e-6},
    "spikes in a short log": {"spikes": 3e-6, "span": 90.0},
    "early": {"early": True},
    "early, smooth": {"early": True, "quiet": True},
}


@pytest.mark.prove
@pytest.mark.parametrize("case", CASES)
def test_no_answer_is_far_off(case):
    draws = [off(dive(seed, **CASES[case]))[0] for seed in range(20)]
    answered = np.array([apart for apart in draws if apart is not None])
    assert len(answered) >= 19
    assert np.abs(answered).max() < 4.0
    assert np.sqrt(np.mean(answered**2, axis=0)).max() < 2.0


def test_the_step_of_a_recorder_is_found():
    rng = np.random.default_rng(1)
    walk = np.cumsum(rng.normal(0.0, 4e-6, 400))
    assert quantum(10e-6 * np.round(walk / 10e-6) + 3e-6) == pytest.approx(10e-6)
    assert quantum(walk) == 0.0
    ramp = np.clip(12e-6 * np.arange(40.0), 0.0, 75e-6)
    assert quantum(ramp) == 0.0  # its samples are even too, but are passed once
    assert quantum(np.zeros(50)) == 0.0
