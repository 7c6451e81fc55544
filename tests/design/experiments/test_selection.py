"""The choice of a set: designs that textbooks know, and all sets tried."""

import itertools
import math

import numpy as np
import pytest

from swimbladder.design.experiments.conditions import Release, covariance_of, vehicles
from swimbladder.design.experiments.search import (
    Table,
    choose,
    criterion,
    in_order,
    releases,
    rounded,
    sizes,
)
from swimbladder.errors import InputError
from swimbladder.estimation.motion import Prior
from swimbladder.vehicle import Identified
from tests.quoted import refused


def table(rows, kind, cost=None, known=0.0, shared=0):
    """Return a table of straight-line models; shared: columns at the end that are nuisances."""
    rows = np.array(rows, float)
    gain = (rows[:, :, None] * rows[:, None, :])[:, None]
    p = rows.shape[1] - shared
    return Table(
        gain=gain,
        prior=np.diag([0.0] * p + [known] * shared),
        cost=np.ones(len(rows)) if cost is None else np.array(cost, float),
        parameters=p,
        judge=criterion(kind, ("a", "b", "c")[:p]),
    )


LINE = np.linspace(-1.0, 1.0, 21)


def test_a_straight_line_is_measured_at_its_ends():
    """D-optimal for a straight line: half of the samples at either end."""
    t = table([[1.0, x] for x in LINE], "D")
    assert sorted(LINE[choose(t, 6.0, 99)]) == [-1.0] * 3 + [1.0] * 3


def test_a_parabola_is_measured_at_its_ends_and_in_the_middle():
    t = table([[1.0, x, x * x] for x in LINE], "D")
    assert sorted(LINE[choose(t, 9.0, 99)].tolist()) == [-1.0] * 3 + [0.0] * 3 + [1.0] * 3


def test_for_the_slope_alone_only_the_ends_count_and_for_the_level_any_even_set():
    rows = [[1.0, x] for x in LINE]
    assert sorted(LINE[choose(table(rows, "b"), 4.0, 99)].tolist()) == [-1.0, -1.0, 1.0, 1.0]
    found = choose(table(rows, "a"), 4.0, 99)
    assert np.exp(table(rows, "a").of(found)) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("kind", ["largest", "A", "D", "a,c"])
@pytest.mark.parametrize("seed", range(3))
def test_no_set_of_all_is_much_better(kind, seed):
    """Candidates of different costs, with a nuisance that all share."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(7, 4))
    t = table(rows, kind, cost=rng.uniform(1.0, 2.0, 7), known=1.0, shared=1)
    found = choose(t, 7.0, 6)
    assert t.cost[found].sum() <= 7.0
    best = min(
        t.of(some)
        for n in range(1, 7)
        for some in itertools.combinations_with_replacement(range(7), n)
        if t.cost[list(some)].sum() <= 7.0
    )
    assert t.of(found) <= best + 0.06


def test_the_criterion_counts_what_a_shared_nuisance_adds():
    """One parameter, samples of it plus 3 times a nuisance known to 0.5: variance 1/n + 1.5^2."""
    t = table([[1.0, 3.0]], "largest", known=4.0, shared=1)
    for n in (1, 2, 5):
        assert math.exp(2.0 * t.of([0] * n)) == pytest.approx(1.0 / n + 1.5**2, rel=1e-3)


def test_what_does_not_fit():
    t = table([[1.0, 0.0], [0.0, 1.0]], "D", cost=[300.0, 400.0])
    with refused(InputError, field="pool_time", value=200, holds={5.0}):
        choose(t, 200.0, 99)
    assert len(choose(t, 10_000.0, 3)) == 3
    with refused(InputError, field="criterion", value="E"):
        criterion("E", ("K2", "T2"))


def test_the_order_brings_most_first():
    t = table([[1.0, 0.0], [0.0, 5.0], [0.0, 1.0]], "largest")
    assert set(in_order(t, [2, 0, 1])[:2]) == {0, 1}
    assert sorted(in_order(t, [2, 0, 1])) == [0, 1, 2]


def logs(values):
    return np.array([math.log(values["K2"]), math.log(values["T2"]), values["psi"] / 4.04e-6])


def test_the_vehicles_have_the_mean_and_the_covariance_of_what_is_in_doubt(vehicle, question):
    S = covariance_of(question, vehicle, None)
    assert np.sqrt(np.diag(S)) == pytest.approx([0.3, 0.3, 0.3])
    S[0, 1] = S[1, 0] = 0.05
    found = np.array([logs(v) for v in vehicles(question, S)])
    assert len(found) == 6
    assert found.mean(axis=0) == pytest.approx(logs(question.values))
    assert np.cov(found.T, bias=True) == pytest.approx(S, abs=1e-12)
    assert vehicles(question, np.zeros((3, 3))) == [question.values]


def test_what_is_known_of_a_vehicle_is_not_in_doubt(vehicle, question):
    known = Identified(
        names=("psi", "K2"),
        values=(4.04e-6, 7935.54),
        covariance=((4.04e-8**2, 0.5 * 4.04e-8 * 79.3554), (0.5 * 4.04e-8 * 79.3554, 79.3554**2)),
    )
    fisher_information = vehicle.model_copy(update={"identified": known})
    S = covariance_of(question, fisher_information, None)
    assert np.sqrt(np.diag(S)) == pytest.approx([0.01, 0.3, 0.01])
    assert S[0, 2] == pytest.approx(0.5e-4)
    assert np.sqrt(np.diag(covariance_of(question, fisher_information, 0.2))) == pytest.approx(
        [0.2] * 3
    )
    prior = question._replace(priors={"psi": Prior(2e-6, 1e-7)})
    S = covariance_of(prior, fisher_information, None)
    # In shares of what counts as a whole: 1e-4 of the hull's volume a metre.
    assert S[2] == pytest.approx([0.0, 0.0, (1e-7 / 2.75e-6) ** 2])
    assert prior.values["psi"] == 2e-6


def test_the_library_has_steps_and_to_and_fro_that_the_stroke_allows(conditions):
    _, setting, limits, _ = conditions
    families = releases(conditions)
    least, *_, most = sizes(conditions)
    assert 4 * setting.neutral_std <= least < 5e-6
    assert 80e-6 < most < 200e-6
    for family in families:
        for release in family:
            volumes = [move.volume for move in release.moves]
            assert all(limits.least <= v <= limits.most for v in volumes)
            assert len(volumes) <= setting.moves
            assert (volumes[0] > 0) == (release.start == setting.deepest)
    assert {len(f) for f in families} == {1, 2}


def test_a_person_can_set_the_numbers(setting):
    found = rounded(Release.to_and_fro(3.75, [61.234e-6, -4.56e-6], [2.8412]), setting)
    assert [m.volume for m in found.moves] == [61e-6, -5e-6]
    assert found.moves[1].depth == 2.85
    edge = rounded(Release.to_and_fro(3.75, [1.26e-6, 0.0], [0.1]), setting)
    assert (edge.moves[0].volume, edge.moves[1].depth) == (1.3e-6, 0.8)
