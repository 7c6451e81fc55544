"""The peers of the joint fit fit the same thing: same depths, same answer."""

import numpy as np
import pytest

from benchmarks.identify import Timing, fits, report
from benchmarks.scipy_fit import INTEGRATORS, Flight, Task, descend, profile, solve
from studies.scenarios import NEUTRAL_STD, SCENARIOS, Campaign, draw

PSI_STD = 4.04e-7


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return draw(SCENARIOS[0], seed=1, index=0)


@pytest.fixture(scope="module")
def task(campaign: Campaign) -> Task:
    """Two of the eight experiments, the largest steps."""
    flights = tuple(Flight(k.time, k.depth, k.volume) for k in campaign.kept[-2:])
    truth = campaign.truth
    start = (1.3 * truth["K2"], 0.8 * truth["T2"], campaign.guess["psi"])
    return Task(flights, campaign.guess["psi"], PSI_STD, NEUTRAL_STD, 2.5e-3, start)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_depths_are_those_of_the_truth(name: str, campaign: Campaign) -> None:
    """The volume is logged at the samples, and straight between them: good for a few 0.1 mm."""
    kept, went = campaign.kept[0], campaign.experiments[0]
    flight = Flight(kept.time, kept.depth, kept.volume)
    truth, step = campaign.truth, went.step
    moved = truth["psi"] * (float(kept.depth[0]) - step.reference_depth)
    found = INTEGRATORS[name](
        flight,
        truth["K2"],
        truth["T2"],
        truth["psi"],
        step.neutral_error + moved,
        step.start_depth,
        step.start_speed,
    )
    assert np.abs(found - went.depth).max() < 3e-4


def test_least_squares_finds_the_truth_and_its_profile_is_its_deviation(task: Task) -> None:
    found = solve(task, INTEGRATORS["odeint"])
    truth = np.log([7935.54, 36.3])
    assert (np.abs(found.x[:2] - truth) < 4.0 * found.deviation[:2]).all()
    (rise,) = profile(task, INTEGRATORS["odeint"], found, 1)
    assert rise == pytest.approx(2.8**2, rel=0.3)  # two experiments: not quite quadratic
    assert solve(task, INTEGRATORS["odeint"], most=1).cost > found.cost


def test_nelder_and_mead_go_downhill(task: Task) -> None:
    found = descend(task, INTEGRATORS["odeint"], most=40)
    begin = np.sum(task.residual(task.begin(), INTEGRATORS["odeint"]) ** 2)
    assert found.cost < begin
    assert found.evaluations <= 41


def test_the_report_compares_like_with_like() -> None:
    ours = Timing("swimbladder", 0.1, 8000.0, 36.0)
    with_profiles = Timing("swimbladder, with profiles", 0.5, 8000.0, 36.0)
    slow = Timing("least_squares on x, with profiles", 50.0, 8000.0, 36.0, 0.0, 12, "slow")
    text = report([ours, with_profiles, slow])
    assert "100 x" in text
    assert "least_squares on x, with profiles: slow" in text


@pytest.mark.prove
def test_quick_fits_name_every_way() -> None:
    said: list[str] = []
    names = [t.name for t in fits(quick=True, note=said.append)]
    assert names[0] == "swimbladder"
    assert {"least_squares on odeint", "Nelder-Mead on odeint"} <= set(names)
    assert "Nelder-Mead on odeint" in said
