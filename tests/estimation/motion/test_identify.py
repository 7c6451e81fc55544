"""What identify() says of pool experiments whose truth SciPy made."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2

from studies.benches import Motor, random_moves
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.estimation.actuator import identify_actuator
from swimbladder.estimation.motion import Prior, identify, run
from swimbladder.estimation.motion.diagnose import Curvature, directions, single_gains
from swimbladder.estimation.motion.fit import fit
from swimbladder.estimation.motion.run import profile
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from tests.estimation.motion.pool import FEUP, STEPS, campaign, pool_log, trace
from tests.estimation.motion.test_problem import problem_of
from tests.quoted import refused

FEUP_EM = load_vehicle("feup-em")
QUICK = {"profiles": False, "choices": False}


def kinds(identification, severity=None):
    return {f.kind for f in identification.findings if severity in (None, f.severity)}


def test_eight_experiments_of_the_paper():
    found = identify(campaign(21, quantum=5e-3), FEUP_EM)
    assert found.identified
    truth = {"K2": 7935.54, "T2": 36.3, "psi": 4.04e-6}
    for name, value in truth.items():
        e = found.parameters[name]
        assert abs(e.value - value) < 4.0 * e.std
        assert e.std < 0.05 * value
    assert found.depth_noise == pytest.approx(math.hypot(2e-3, 5e-3 / math.sqrt(12.0)), rel=0.1)
    best = found.choices[0]
    assert (best.drag, best.psi, best.reported) == ("linear", "free", True)
    assert sum(c.weight for c in found.choices) == pytest.approx(1.0)
    assert kinds(found, "warning") == set()
    mass = found.derived["mass"]
    assert abs(mass.value - FEUP["m"]) < 4.0 * mass.std
    # K2 and T2 err together: their ratio is known far better than either
    assert mass.std / mass.value < 0.5 * found.parameters["T2"].std / 36.3
    vehicle = found.vehicle
    assert vehicle.replace({"name": "another"}).motion == vehicle.motion  # it can be edited
    assert found.parameters["K2"].value == vehicle.motion.K2
    assert found.parameters["psi"].value == vehicle.hull.psi
    assert vehicle.identified.names == ("K2", "T2", "psi")


def test_leaving_psi_out_is_noticed():
    found = identify(campaign(22, quantum=5e-3), FEUP_EM, fixed={"psi": 0.0}, profiles=False)
    assert found.parameters["K2"].value > 1.5 * 7935.54  # as the paper's own numbers give
    assert found.process_noise is not None  # what the model lacks is no noise of the sensor
    sensor = math.hypot(2e-3, 5e-3 / math.sqrt(12.0))
    assert found.sensor_noise == pytest.approx(sensor, rel=0.1)
    assert found.result_vehicle.identified is None or (
        found.result_vehicle.identified.depth_noise == found.sensor_noise
    )
    assert {"model", "process_noise"} <= kinds(found)
    model = next(f for f in found.findings if f.kind == "model")
    assert "psi estimated" in model.sentence


@pytest.mark.prove
def test_each_drag_law_is_recognised():
    for law, truth in (
        ("quadratic", {"m": 44.0, "k_dt": 14.0, "psi": 1e-6}),
        ("blended", {"m": 44.0, "k_dl": 0.7, "k_dt": 8.0, "psi": 1e-6}),
    ):
        logs = campaign(23, steps=STEPS[2:], **truth)
        found = identify(logs, FEUP_EM, drag=law, profiles=False)
        assert found.choices[0].drag == law
        wrong = identify(logs, FEUP_EM, profiles=False)
        said = [f for f in wrong.findings if f.kind in ("model", "refused")]
        assert len(said) == 1
        assert f"`drag='{law}'`" in said[0].sentence
        assert not wrong.identified  # its neutral volumes would have to wander
        assert "wanders" in kinds(wrong, "no")
        vehicle = found.result_vehicle
        assert vehicle.drag.law == law
        renamed = vehicle.replace({"name": "another"})  # what was identified can be edited
        assert renamed.motion == vehicle.motion


def test_what_the_data_do_not_tell_has_no_number():
    """One short experiment with an unknown neutral volume and psi cannot tell K2."""
    log = pool_log(20e-6, rng=np.random.default_rng(0), longest=15.0)
    found = identify([log], FEUP_EM, neutral_std=math.inf)
    assert not found.identified
    sentences = [f.sentence for f in found.findings if f.severity == "no"]
    assert any("K2" in s and "combination" in s for s in sentences)
    assert "give psi a prior or a value (`priors=`, `fixed=`)" in " ".join(sentences)
    with pytest.raises(NoAnswerError, match="combination"):
        _ = found.vehicle
    json = found.to_dict()
    assert json["parameters"]["K2"]["value"] is None
    assert json["identified"] is False


def test_the_direction_that_is_not_told_is_the_one_of_the_model():
    """Without psi, gravity or drag in play only rho g/m is told: K2/T2, not their product."""
    log = pool_log(20e-6, longest=8.0, step=0.1, rest=1.0)
    problem = problem_of([log], ("K2", "T2"), fixed={"psi": 4.04e-6})
    known, unknown = directions(problem, Curvature.of(problem, fit(problem)))
    assert abs(float(unknown.parts.sum())) > 0.97 * math.sqrt(2.0)
    assert unknown.std > 4.0 * known.std


def test_a_prior_that_the_data_do_not_narrow_is_called_so():
    found = identify(
        [pool_log(45e-6, rng=np.random.default_rng(1))],
        FEUP_EM,
        priors={"psi": Prior(4e-6, 1e-9)},
        **QUICK,
    )
    assert found.parameters["psi"].origin == "prior"
    assert found.parameters["psi"].std == pytest.approx(1e-9, rel=0.05)


def test_profiles_of_a_nearly_linear_problem_are_parabolas():
    problem = problem_of(campaign(24), ("K2", "T2"), fixed={"psi": 4.04e-6})
    found = fit(problem)
    for i in range(2):
        p = profile(problem, found, i)
        std = math.sqrt(found.covariance[i, i])
        u = (np.log(p.values) - found.x[i]) / std
        assert p.deviance == pytest.approx(u**2, rel=0.1, abs=0.02)
        ends = (np.log(p.ci95) - found.x[i]) / std
        assert ends == pytest.approx([-1.96, 1.96], abs=0.06)


def test_a_profile_is_the_constrained_minimum():
    """Against the same fit with the parameter held by a prior of no width."""
    problem = problem_of(campaign(25)[:3], ("K2", "T2", "psi"))
    found = fit(problem)
    p = profile(problem, found, 0)
    at = 1
    held = problem_of(campaign(25)[:3], ("T2", "psi"), fixed={"K2": float(p.values[at])})
    other = fit(held)
    each = np.repeat(found.noise, np.diff(problem.rows))

    def cost(problem, x):
        r = problem.residual(x) / each
        return float(r @ r + (problem.prior_rows(x)[0] ** 2).sum())

    naive = np.linalg.inv(found.information)[0, 0]
    expected = (cost(held, other.x) - cost(problem, found.x)) * naive / found.covariance[0, 0]
    assert p.deviance[at] == pytest.approx(expected, rel=0.02)


def test_single_gains_are_those_of_single_fits():
    problem = problem_of(campaign(26), ("K2", "T2"), fixed={"psi": 0.0})
    found = fit(problem)
    gains = single_gains(problem, found)
    for log, (size, gain, _) in zip(campaign(26)[4:], gains[4:], strict=True):
        alone = problem_of([log], ("K2", "T2"), fixed={"psi": 0.0})
        own = fit(alone).x[0] - found.x[0]
        assert np.sign(gain) == np.sign(own)
        assert gain == pytest.approx(own, abs=0.3 * abs(own) + 0.05)
        assert size == pytest.approx(abs(float(log.volume[-1])), rel=0.01)


def test_neutral_volumes_beyond_their_prior_are_said():
    found = identify(campaign(27, errors=1.5e-6), FEUP_EM, neutral_std=0.5e-6, **QUICK)
    assert "neutral prior" in kinds(found, "warning")
    wrong = identify(campaign(27, errors=9e-6), FEUP_EM, neutral_std=0.5e-6, **QUICK)
    assert not wrong.identified


@pytest.mark.prove
def test_a_prior_that_nobody_stated_is_given_up_where_logs_contradict_it():
    given_up = identify(campaign(27, errors=9e-6), FEUP_EM, **QUICK)
    assert given_up.identified
    assert given_up.neutral_std == math.inf
    looser = identify(campaign(27, errors=3e-6), FEUP_EM, neutral_std=3e-6, **QUICK)
    assert "neutral prior" not in kinds(looser)


def test_a_drifting_neutral_volume_is_said():
    logs = campaign(28)
    rng = np.random.default_rng(28)
    slow = pool_log(20e-6, rng=rng)
    t = slow.time
    drifting = slow.volume + 0.05e-6 * (t - t[0])
    logs.append(
        type(slow)(source="drifting", time=t, depth=slow.depth, volume=drifting, line=slow.line)
    )
    found = identify(logs, FEUP_EM, **QUICK)
    said = [f.sentence for f in found.findings if f.kind == "drift"]
    assert len(said) == 1
    assert said[0].startswith("drifting")
    e = found.experiments[-1]
    assert e.drift.value == pytest.approx(0.05e-6, rel=0.45)  # the other logs say that it is small


def test_a_mass_below_the_dry_one_is_said():
    vehicle = load_vehicle("ntnu-bv")
    heavy = vehicle.model_copy(
        update={"motion": vehicle.motion.model_copy(update={"dry_mass": 500.0})}
    )
    found = identify(campaign(29), heavy, drag="linear", **QUICK)
    assert "mass" in kinds(found, "no")
    assert not found.identified


def test_voltage_drives_where_no_volume_is_logged():
    from swimbladder import drive
    from swimbladder.io.logs import Log

    rng = np.random.default_rng(30)
    logs = []
    for sign in (1.0, -1.0):
        t = np.arange(0.0, 60.0, 0.3)
        hold = 0.07707 * 5.0
        u = np.where((t > 3.0) & (t < 4.5), 10.0 * sign, 0.0) + hold
        s = drive(FEUP_EM, time=t, voltage=u, start_depth=5.0)
        z = s.depth + 1e-3 * rng.normal(size=len(t))
        logs.append(Log(source="x", time=t, depth=z, voltage=u, line=np.arange(len(t))))
    known = identify(
        logs,
        FEUP_EM,
        free=("K1", "T2"),
        fixed={"psi": 4.04e-6, "K2": 7935.54},
        neutral_std=1e-8,
        **QUICK,
    )
    e = known.parameters["K1"]
    assert abs(e.value - 0.444e-3) < 4.0 * e.std < 0.1 * 0.444e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"free": ("K3",)}, "no such parameter"),
        ({"free": ("K2", "K2")}, "named twice"),
        ({"free": ("mass",)}, "drag law linear has no such"),
        ({"free": ("K1",)}, "K1"),
        ({"free": ("K2",), "fixed": {"K2": 1.0}}, "both set and"),
        ({"fixed": {"K2": -1.0}}, "above 0"),
        ({"fixed": {"K2": 1.0, "T2": 1.0, "psi": 0.0}}, "nothing is left"),
        ({"priors": {"psi": Prior(0.0, 0.0)}}, "no such prior"),
        ({"free": ("K2",), "priors": {"psi": Prior(0.0, 1.0)}}, "not identified"),
        ({"drag": "cubic"}, "cannot be identified"),
        ({"neutral_std": 0.0}, "above 0"),
        ({"drive": "setpoint"}, "does not drive the vehicle"),
    ],
)
def test_what_does_not_go_together_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        identify([pool_log(20e-6, longest=10.0)], FEUP_EM, **options)


def test_no_log_is_refused():
    with refused(InputError, field="LOG"):
        identify([], FEUP_EM)


def test_where_no_filter_follows_what_was_read_wrong_is_said(monkeypatch):
    """A piston counted the other way round was "check units"."""

    def none(*_):
        raise NoAnswerError("no filter follows")

    monkeypatch.setattr(run, "_answer", none)
    logs = campaign(3)
    with pytest.raises(NoAnswerError, match="no filter follows"):
        identify(logs, FEUP_EM)
    turned = [dataclasses.replace(log, volume=-log.volume) for log in logs]
    with pytest.raises(NoAnswerError, match="counts the wrong way round"):
        identify(turned, FEUP_EM)


def test_a_log_that_is_given_twice_is_refused():
    """It made an interval narrower by the root of two."""
    log = pool_log(20e-6, longest=10.0)
    for command, logs in (
        (identify, [log, dataclasses.replace(log, source="copy")]),
        (identify_actuator, 2 * [random_moves(np.random.default_rng(4), Motor(T1=0.05))]),
    ):
        with refused(InputError, field="LOG", value=logs[1].source):
            command(logs, FEUP_EM)


@pytest.mark.slow
def test_the_intervals_hold_the_truth_and_are_not_too_wide():
    """The squared error in the metric of the covariance is chi-square distributed."""
    truth = np.array([math.log(7935.54), math.log(36.3), 4.04e-6])
    distances = []
    for seed in range(100, 124):
        problem = problem_of(campaign(seed), ("K2", "T2", "psi"))
        found = fit(problem)
        off = found.x[:3] - truth / np.array([1.0, 1.0, problem.scale[2]])
        distances.append(off @ np.linalg.solve(found.covariance[:3, :3], off))
    total = float(np.sum(distances))
    assert 1e-3 < chi2.cdf(total, 3 * len(distances)) < 1.0 - 1e-3


@pytest.mark.prove
def test_neutral_volumes_that_walk():
    """Truth: each walks by 5 cm3 in a minute; a constant one would be wrong."""
    rng = np.random.default_rng(31)
    logs = []
    for dV in STEPS[2:]:
        log = pool_log(dV, rng=rng)
        steps = rng.normal(0.0, 5e-6 * math.sqrt(0.3 / 60.0), len(log))
        n = len(log)
        true = log.volume - np.cumsum(steps)  # as if: the piston's sensor does not see the walk
        z0 = 3.75 if dV > 0 else 0.75
        z = trace(log.time, true, z0=z0, V0=-FEUP["psi"] * z0, **FEUP) + 2e-3 * rng.normal(size=n)
        logs.append(
            type(log)(source=log.source, time=log.time, depth=z, volume=log.volume, line=log.line)
        )
    found = identify(logs, FEUP_EM, fixed={"psi": 4.04e-6}, process_noise="always")
    assert found.identified
    assert found.process_noise is not None
    assert found.process_noise.drifts
    low, high = found.process_noise.noises["random_walk"].ci95
    assert low < 5e-6 / math.sqrt(60.0) < high
    for name, value in (("K2", 7935.54), ("T2", 36.3)):
        e = found.parameters[name]
        assert abs(e.value - value) < 4.0 * e.std
    assert "process_noise" in kinds(found)
    # Six logs tell how logs differ: the vehicle is that of the means over them.
    known = found.vehicle.identified
    assert known.between is not None
    assert known.random_walk == pytest.approx(found.process_noise.noise.random_walk, rel=0.6)
    assert dict(zip(known.names, known.values, strict=True))["K2"] == pytest.approx(
        found.parameters["K2"].value, rel=0.1
    )
    assert "logs differ" in kinds(found)
    assert found.to_dict()["process_noise"]["noises"]["random_walk"]["unit"] == "m3/s^0.5"


@pytest.mark.prove
def test_a_posterior_on_request():
    pytest.importorskip("emcee")
    found = identify(campaign(42)[4:], FEUP_EM, fixed={"psi": 4.04e-6}, posterior=5, **QUICK)
    assert found.posterior is not None
    low, median, high = found.posterior.interval("K2")
    e = found.parameters["K2"]
    assert [low, median, high] == pytest.approx([e.ci95[0], e.value, e.ci95[1]], abs=0.7 * e.std)


def turned(log, **changes):
    return dataclasses.replace(log, **changes)


@pytest.mark.parametrize("what", [pytest.param("volume", marks=pytest.mark.prove), "depth"])
def test_a_log_the_wrong_way_round_is_said_to_be(what):
    logs = [
        turned(log, **{what: 4.5 - log.depth if what == "depth" else -log.volume})
        for log in campaign(61)[4:]
    ]
    found = identify(logs, FEUP_EM, fixed={"psi": 4.04e-6}, **QUICK)
    assert not found.identified
    assert [f.kind for f in found.findings] == ["backwards"]
    assert "the wrong way round" in found.findings[0].sentence


def test_depths_in_the_wrong_unit_give_a_mass_that_cannot_be():
    for factor, word in ((10.0, "less than the"), (0.1, "times the")):
        logs = [turned(log, depth=factor * log.depth) for log in campaign(62)[4:]]
        found = identify(logs, FEUP_EM, fixed={"psi": 0.0}, neutral_std=math.inf, **QUICK)
        sentences = [f.sentence for f in found.findings if f.kind == "mass"]
        assert any(word in s and "Check the units" in s for s in sentences)
        assert not found.identified


def test_a_simulated_log_without_noise_gives_intervals_that_hold_the_truth():
    """How the volume goes between two samples is not in a log, and costs more than no noise."""
    import swimbladder

    run = swimbladder.simulate(FEUP_EM, setpoints=[(0.0, 3.0)], duration=200.0, start_depth=1.5)
    log = Log(
        source="run",
        time=run.time,
        depth=run.depth,
        volume=run.volume,
        volume_absolute=True,
        line=np.arange(len(run.time)),
    )
    found = identify([log], FEUP_EM)
    assert found.identified
    for name, value in (("K2", 7935.54), ("T2", 36.3), ("psi", 4.04e-6)):
        low, high = found.parameters[name].ci95
        assert low < value < high
        assert high - low < value
