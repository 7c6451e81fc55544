"""What the study of losses counts: by hand, and as the campaign that it flies counts it."""

import pytest
from scipy.stats import binom

from studies import losses as study
from studies.losses import Losses, losses, pooled, seeds_of
from swimbladder.io.config import load_vehicle
from swimbladder.sim.faults import faults

NAMES = "3f6c0e", "a92ed5"


@pytest.fixture(scope="module")
def campaigns():
    vehicle = load_vehicle("feup-em")
    known = vehicle.supervisor.model_copy(update={"time_limit": 1860.0})
    vehicle = vehicle.model_copy(update={"supervisor": known})
    return [faults(vehicle, missions=45, healthy=3, seed=s) for s in seeds_of(NAMES[0], 2)]


def test_seeds_follow_from_the_commit_and_from_nothing_else():
    first, second = (seeds_of(name, 5) for name in NAMES)
    assert seeds_of(NAMES[0], 3) == first[:3]
    assert len({*first, *second}) == 10


def test_a_campaign_is_counted_as_it_counts_itself(campaigns):
    for one in campaigns:
        n, kinds = losses(one), {line.name: line for line in one.lines()}
        every, two = kinds["all"], kinds["two faults at once"]
        assert (n.missions, n.healthy) == (45, 3)
        assert n.recoverable == every.recoverable
        assert n.pairs == two.recoverable
        assert n.lost_without == every.lost_without_supervisor
        assert n.lost_single + n.lost_pairs == len(one.lost) + len(one.lost_early)


def test_the_row_pools_the_seeds(campaigns, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(study, "_KEPT", tmp_path)
    asked = f"feup-em --from {NAMES[0]} --seeds 2 --missions 45 --healthy 3"
    study.main([*asked.split(), "--time-limit", "31 min"])
    printed = capsys.readouterr().out.splitlines()
    cells = [cell.strip() for cell in printed[2].split("|")[1:-1]]
    n = pooled([*map(losses, campaigns)])
    assert cells[1] == "90"
    assert cells[3] == str(n.lost_single)
    assert cells[4] == f"{n.lost_pairs} of {n.pairs}"
    assert cells[-1] == f"`{campaigns[0].program[:12]}`"
    assert len(printed) == 3 + n.lost_single + n.lost_pairs


def test_the_limit_is_the_share_that_would_lose_so_few_in_one_of_twenty():
    n = Losses(1000, 700, 350, 0, 2, 250, 100, 0)
    cell = study.row("words", n, "0" * 64).split("|")[6]
    share = float(cell.strip(" %")) / 100.0
    assert binom.cdf(2, 350, share) == pytest.approx(0.05, abs=2e-3)
