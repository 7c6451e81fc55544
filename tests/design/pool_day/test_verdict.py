"""When to stop, and what to say where more would not help."""

from types import SimpleNamespace

import numpy as np
import pytest

from swimbladder.design.pool_day.day import Task, next_task, paper_tasks, undone
from swimbladder.design.pool_day.verdict import MARGIN, Asked, State, Target, forecast, judge
from swimbladder.estimation.estimates import Estimate
from swimbladder.estimation.motion import Finding, Prior
from swimbladder.io.config import load_vehicle

TARGETS = (Target("K2", 0.02), Target("T2", 0.02))


def found(*, n=8, K2=0.01, T2=0.01, psi=0.02, correlation=0.0, findings=()):
    values = {"K2": 8000.0, "T2": 36.0, "psi": 4e-6}
    share = np.array([K2, T2, psi])
    R = np.eye(3)
    R[0, 2] = R[2, 0] = correlation
    size = np.array(list(values.values())) * share
    parameters = {
        name: Estimate.of(v, s, "", logarithmic=name != "psi")
        for (name, v), s in zip(values.items(), size, strict=True)
    }
    return SimpleNamespace(
        names=tuple(values),
        parameters=parameters,
        covariance=R * np.outer(size, size),
        experiments=[None] * n,
        findings=tuple(findings),
        identified=all(f.severity != "no" for f in findings),
    )


def verdict(answer, *, due=0, faults=(), priors=None, neutral=None):
    return judge(
        answer,
        Asked(targets=TARGETS, priors=priors or {}),
        due=due,
        faults=faults,
        known_neutral=lambda: neutral or answer,
    )


def test_the_targets_reached_and_nothing_against_them_is_good():
    assert verdict(found()).good
    assert not verdict(found(K2=0.021)).good


def test_a_target_is_reached_with_a_margin():
    """What is just good enough may only look so: the day would end on a lucky number."""
    told = verdict(found(K2=0.018))
    assert told.state == State.MORE
    assert "1.8 % (target 2 %, which 1.6 % is taken to reach)" in told.sentence
    assert verdict(found(K2=0.0159)).good


def test_fewer_than_four_experiments_are_never_enough():
    assert verdict(None).state == State.MORE
    assert verdict(found(n=3)).more == 1
    assert verdict(found(n=4)).good


def test_a_warning_or_a_fault_speaks_against_the_intervals():
    trend = Finding("step-size trend", "warning", "K2 changes with the step.")
    assert verdict(found(findings=[trend])).state == State.WARNED
    assert "changes with the step" in verdict(found(findings=[trend])).sentence
    assert verdict(found(), faults=["Experiment 2: it drifted."]).state == State.WARNED
    note = Finding("coloured", "note", "Coloured.")
    assert verdict(found(findings=[note])).good


def test_what_the_data_do_not_tell_is_said():
    trade = Finding("trade-off", "no", "K2 and psi trade off.")
    assert verdict(found(findings=[trade]), due=2).state == State.MORE
    told = verdict(found(findings=[trade]))
    assert told.state == State.LIMITED
    assert "trade off" in told.sentence


def test_the_forecast_is_that_of_averaging():
    """n independent experiments of one kind: the variance goes with 1/n."""
    answer = found(n=8, K2=0.022)
    more = forecast(answer, TARGETS, {})
    assert more == int(np.ceil(8 * ((MARGIN * 0.022 / 0.02) ** 2 - 1.0)))
    assert verdict(answer).state == State.MORE
    assert verdict(answer).more == more


def test_a_prior_that_does_not_grow_limits_what_experiments_can_do():
    """psi by its prior alone, K2 by psi alone: the error of K2 stays, however many there are."""
    answer = found(n=8, K2=0.05, psi=0.1, correlation=0.99)
    free = forecast(answer, TARGETS, {})
    held = forecast(answer, TARGETS, {"psi": Prior(4e-6, 4.0001e-7)})
    assert free is not None
    assert held is None
    told = verdict(answer, priors={"psi": Prior(4e-6, 4.0001e-7)})
    assert told.state == State.LIMITED
    assert told.limits["psi"] == pytest.approx(0.99**2)
    assert "What limits K2 is psi" in told.sentence
    assert "narrower prior" in told.sentence


def test_the_neutral_volume_is_named_where_it_limits():
    told = verdict(found(n=4, K2=0.09), neutral=found(n=4, K2=0.01))
    assert told.state == State.LIMITED
    assert told.limits["neutral volume"] == pytest.approx(1.0 - (0.01 / 0.09) ** 2)
    assert "rest longer" in told.sentence


def test_the_papers_experiments_fit_the_stroke():
    paper = paper_tasks(load_vehicle("feup-em"), bottom_depth=4.5)
    assert [round(1e6 * t.change) for t in paper] == [20, -20, 30, -30, 45, -45, 75, -75]
    assert {t.start for t in paper} == {3.75, 0.75}
    small = load_vehicle("ntnu-bv")
    tasks = paper_tasks(small, bottom_depth=1.5)
    for task in tasks:
        volume = small.neutral_volume(task.start) + task.change
        assert small.stroke.minimum < volume < small.stroke.maximum
    ratios = [a.change / b.change for a, b in zip(tasks, paper, strict=True)]
    assert ratios == pytest.approx([ratios[0]] * 8, rel=0.05)


def test_the_next_is_the_first_of_those_done_least():
    tasks = tuple(Task(size, 1.0) for size in (20e-6, -20e-6, 45e-6))
    assert next_task(tasks, []) is tasks[0]
    assert next_task(tasks, [19e-6]) is tasks[1]
    assert next_task(tasks, [19e-6, -21e-6]) is tasks[2]
    assert next_task(tasks, [19e-6, -21e-6, 46e-6]) is tasks[0]
    assert undone(tasks, [19e-6, 21e-6]) == 2
    assert undone(tasks, [100e-6]) == 3
