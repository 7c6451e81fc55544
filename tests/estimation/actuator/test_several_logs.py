"""Several logs of one actuator: staircases that agree, that differ, and one that is wrong."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from studies.benches import log_of, measured
from swimbladder.estimation.actuator import identify_actuator

OUT, IN = 2.5e-4, 2.6e-4  # m/s
RATE = math.sqrt(OUT * IN)


def staircase(random, name, *, factor=1.0, scatter=0.0, count=5, step=0.2, hold=16.0, rest=4.0):
    """Moves out, then as many in, at full speed after a lag of 50 ms, and what a sensor saw."""
    begins = rest + np.arange(2 * count) * (hold + rest) + random.uniform(0.0, step, 2 * count)
    time, T1 = np.arange(0.0, begins[-1] + hold + 2.0 * rest, step), 0.05
    position = np.zeros(len(time))
    for k, begin in enumerate(begins):
        speed = (OUT if k < count else -IN) * factor * (1.0 + scatter * random.normal())
        since = np.maximum(time - begin, 0.0)
        driven = since + T1 * np.expm1(-since / T1)
        after = np.maximum(since - hold, 0.0)
        position += speed * (driven - after - T1 * np.expm1(-after / T1))
    return log_of(time, measured(position, random, noise=2e-6, quantum=1e-5), source=name)


def campaign(seed, count, *, differing=0.0, more=None, **of_each):
    random = np.random.default_rng(seed)
    factors = 1.0 + differing * random.normal(size=count)
    factors[-1] *= 1.0 if more is None else more
    return [
        staircase(random, f"{k}.csv", factor=f, step=(0.1, 0.2)[k % 2], **of_each)
        for k, f in enumerate(factors.tolist())
    ]


def kinds(found):
    return {f.kind: f for f in found.findings}


def test_logs_that_agree_are_no_less_certain_together_than_one():
    """Each log's 1 sigma lacked what clocks and scales are right to, which that of all had."""
    logs = campaign(1, 2)
    found = identify_actuator(logs)
    for name in ("rate", "asymmetry"):
        each = [fit.parameters[name] for fit in found.logs]
        assert found.parameters[name].std <= min(e.std for e in each)
        assert min(e.std / e.value for e in each) > 1e-4
    alone = identify_actuator(logs[:1])
    assert alone.parameters["rate"] == found.logs[0].parameters["rate"]
    assert "logs differ" not in kinds(found)
    assert any("mean of all such logs" in said for said in found.assumptions)
    assert any("hold for this log" in said for said in alone.assumptions)


def test_where_all_logs_are_less_certain_than_one_it_says_why():
    """Moves that differ by 1 % determine the speed of two logs too badly for their spread."""
    found = identify_actuator(campaign(1, 2, scatter=0.01))
    said = kinds(found)["few logs"]
    assert said.severity == "note"
    names = said.sentence.split(" by itself")[0]
    for name in ("rate", "asymmetry", "rate_out", "rate_in"):
        joint = {**found.parameters, **found.derived}[name]
        wider = joint.std > min(fit.parameters[name].std for fit in found.logs)
        assert (f" {name}," in names or f" {name} than" in names) == wider, name
    assert "rate" in names
    assert "mean of all such logs" in said.sentence


@pytest.mark.parametrize("count", [2, 3, pytest.param(5, marks=pytest.mark.prove)])
def test_a_log_that_is_wrong_is_named(count):
    found = identify_actuator(campaign(2, count, more=1.1))
    said = kinds(found)["logs differ"]
    assert said.severity == "warning"
    assert f"in {count - 1}.csv" in said.sentence
    stands_apart = f"{count - 1}.csv stands apart" in said.sentence
    assert stands_apart == (count > 2)
    low, high = found.parameters["rate"].ci95
    assert low < RATE < 1.1 * RATE < high or count > 3


@pytest.mark.prove
def test_of_logs_that_differ_alike_none_is_named():
    found = identify_actuator(campaign(3, 5, differing=0.02))
    said = kinds(found)["logs differ"]
    assert "stands apart" not in said.sentence
    low, high = found.parameters["rate"].ci95
    assert low < RATE < high
    assert 0.01 < (high - low) / RATE < 0.12


@pytest.mark.prove
@pytest.mark.parametrize("differing", [0.0, 0.02])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_intervals_of_campaigns_hold_the_rate(count, differing):
    """Of one log its own; clocks and scales are right to as much as the answer says."""
    held, campaigns = 0, 50
    for k in range(campaigns):
        random = np.random.default_rng([5, k])
        scale = 1.0 + 1e-4 * random.normal()
        logs = campaign([6, k], count, differing=differing * (count > 1))
        low, high = identify_actuator(logs).parameters["rate"].ci95
        held += low <= RATE * scale <= high
    assert binomtest(held, campaigns, 0.95).pvalue > 0.001, held
