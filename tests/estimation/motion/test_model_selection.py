"""The evidence for models: what holds for models that hold one another, whatever the data."""

import numpy as np
import pytest

from swimbladder.estimation.motion import Prior, diagnose, identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from tests.estimation.motion.pool import campaign, pool_log, trace

FEUP_EM = load_vehicle("feup-em")


@pytest.mark.parametrize("fixed", [{}, pytest.param({"psi": 0.0}, marks=pytest.mark.prove)])
def test_a_model_that_holds_another_is_never_less_likely(fixed):
    logs = campaign(31, quantum=5e-3, steps=(2e-5, -3e-5, 4.5e-5, -7.5e-5))
    listed = identify(logs, FEUP_EM, fixed=fixed, profiles=False).choices
    found = {(c.drag, c.psi): c.log_likelihood for c in listed}
    for law in ("linear", "quadratic", "blended"):
        assert found[law, "free"] > found[law, "zero"] - 0.1
    for psi in ("free", "zero"):
        assert found["blended", psi] > found["linear", psi] - 0.1
        assert found["blended", psi] > found["quadratic", psi] - 0.1


def test_only_models_that_may_be_the_best_are_fitted_to_the_last_digit(monkeypatch):
    """The truth is linear: no quadratic drag is near it, and a blended one only with psi."""
    solved, solve = [], diagnose.solve

    def counted(problem, starts, *, briefly):
        solved.append((problem.model.law, "psi" in problem.names, briefly))
        return solve(problem, starts, briefly=briefly)

    monkeypatch.setattr(diagnose, "solve", counted)
    identify(campaign(31, quantum=5e-3, steps=(2e-5, -7.5e-5)), FEUP_EM, profiles=False)
    finely = {(law, psi) for law, psi, briefly in solved if not briefly}
    assert finely == {("linear", False), ("blended", True)}
    assert len(solved) == 6


def of_jumps(seed: int, **drag: float) -> Log:
    """Return a log of a vehicle with this drag whose volume jumps every ten seconds."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 200.0, 0.5)
    volume = rng.normal(0.0, 30e-6, len(time) // 20 + 1).repeat(20)[: len(time)]
    depth = trace(time, volume, z0=20.0, V0=4e-5, m=50.0, **drag, psi=-2e-6)
    depth += 2e-3 * rng.normal(size=len(time))
    known = {"line": np.arange(len(time)), "volume_absolute": True}
    return Log(source="log", time=time, depth=depth, volume=volume, **known)


@pytest.mark.parametrize("seed", [1, pytest.param(5, marks=pytest.mark.prove)])
def test_a_model_that_holds_another_is_never_less_likely_with_process_noise(seed):
    """The truth has no laminar drag: a blended one has to find hardly any."""
    log = of_jumps(seed, k_dt=20.0)
    listed = identify([log], FEUP_EM, profiles=False, process_noise="always").choices
    found = {(c.drag, c.psi): c.log_likelihood for c in listed}
    for psi in ("free", "zero"):
        assert found["blended", psi] > found["linear", psi] - 0.1
        assert found["blended", psi] > found["quadratic", psi] - 0.1
    for law in ("linear", "quadratic", "blended"):
        assert found[law, "free"] > found[law, "zero"] - 0.1


@pytest.mark.parametrize("seed", [1, 4])
def test_a_turbulent_drag_that_may_be_none_has_an_interval_that_begins_there(seed):
    """The truth is laminar: of a logarithm the interval went over tens of decades, or below 0.

    Its end allows for the way of a jumping volume between samples, which the log does not show.
    """
    log = of_jumps(seed, k_dl=1.2)
    quick = {"profiles": False, "choices": False, "process_noise": "always"}
    drag = identify([log], FEUP_EM, drag="blended", **quick).parameters["drag_quadratic"]
    assert drag.ci95[0] == 0.0
    assert drag.value < drag.ci95[1] < 2.0


def test_what_the_data_do_not_tell_makes_no_vehicle_and_no_error():
    log = pool_log(7.5e-5, travel=0.35, rng=np.random.default_rng(7))
    found = identify([log], FEUP_EM, neutral_std=float("inf"), profiles=False)
    assert not found.identified
    assert found.result_vehicle == FEUP_EM
    told = found.to_dict()
    assert told["parameters"]["K2"]["value"] is None
    assert all(c["values"] == {} for c in told["choices"])


def test_a_prior_that_the_data_contradict_is_called_out():
    logs = campaign(32, steps=(2e-5, -3e-5, 4.5e-5, -7.5e-5))
    quick = {"profiles": False, "choices": False}
    right = identify(logs, FEUP_EM, priors={"psi": Prior(4e-6, 2e-6)}, **quick)
    wrong = identify(logs, FEUP_EM, priors={"psi": Prior(4.0, 1.0)}, **quick)  # cm3/m meant

    def said(found):
        return [f.sentence for f in found.findings if f.kind == "prior" and f.severity != "note"]

    assert said(right) == []
    (sentence,) = said(wrong)
    assert "4e+06 cm3/m" in sentence
