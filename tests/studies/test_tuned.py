"""The table of tuned laws: rows as they are written, tuning that hold what tuning promises."""

import math

import pytest

from studies import tuned as study
from studies.tuned import FAST, KNOBS, QUIET, gains_of, main, noisy, row
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.tuning.margins import loops, worst
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.trial import Trial

TRIAL = Trial(
    runs=200,
    settled=1.0,
    settle_median=16.2,
    settle_95=16.5,
    overshoot_median=0.002,
    overshoot_95=0.013,
    rms=0.0036,
    rate=8e-6,
    starts=60.0 / 3600.0,
    turns=2.0 / 3600.0,
    energy=math.nan,
    power=math.nan,
)


def test_rows_have_what_their_goal_is_about():
    assert row("x", TRIAL, goal="fast") == "| x | 16.5 s | 1.3 % | 3.6 mm | 29 L/h |  |"
    assert row("x", TRIAL, goal="fast", median=True) == "| x | 16.2 s | 0.2 % |  |  |  |"
    assert row("x", TRIAL, goal="quiet") == "| x |  |  | 3.6 mm | 29 L/h | 60/h, 2/h |"
    never = TRIAL._replace(settle_95=math.nan)
    assert row("x", never, goal="fast").startswith("| x | never |")


@pytest.mark.parametrize("name", [*FAST, *QUIET])
def test_the_knobs_kept_have_the_margins_that_tuning_asks_for(name):
    """Over the region, at the least and greatest depth: 6 dB, 45 degrees, 1.6, 0.5."""
    smooth = gains_of(name, KNOBS[name]._replace(dead=0.0, pause=0.0))  # linear at rest
    plants = region(noisy("fast")).plants
    bound = BoundLaw(*smooth, sample_time=0.3)
    m = worst(loops(bound, plants, depths=(0.0, 5.0), delay=0.03))
    assert m.gain_up > 2.0 > 0.5 > m.gain_down
    assert math.degrees(m.phase) > 44.0
    assert m.peak_sensitivity < 1.65
    assert m.disk > 0.49


def test_the_command_prints_own_rows_then_those_of_the_laws(capsys, monkeypatch):
    class Found:
        nominal = region = TRIAL
        tuning = KNOBS["observer"]

    monkeypatch.setattr(study, "own", lambda runs: [f"| own | {runs} |"])
    monkeypatch.setattr(study, "tuned", lambda *_, **__: Found())
    main(["--law", "planned", "observer", "--runs", "7"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "| own | 7 |"
    assert [line.split("|")[1].strip() for line in lines[3:6]] == [
        "`planned`, fast, nominal (median)",
        "`planned`, fast, 95 % of the region",
        "`observer`, quiet, 95 % of the region",
    ]
    assert lines[6].startswith("planned: TuningParameters(")
