"""Swell in the reading: what a filter that follows the reading makes of it, and the table."""

import pytest

from studies import swell
from studies.swell import main, swayed


@pytest.mark.prove
def test_planned_loses_its_depth_in_a_swell_that_the_others_hardly_see():
    found = {name: swayed(name, height=0.05, span=900.0) for name in ("planned", "sea-cascade")}
    assert found["planned"]["amplitude"] > 0.3
    assert found["sea-cascade"]["amplitude"] < 0.06
    # twice the wave, twice the way: it is linear while the voltage is not at its limit
    one, two = (swayed("sea-cascade", height=h, span=900.0)["rms"] for h in (0.01, 0.02))
    assert two == pytest.approx(2.0 * one, rel=0.2)


def test_the_command_prints_the_table(capsys, monkeypatch):
    monkeypatch.setattr(
        swell,
        "swayed",
        lambda name, height, period: {
            "amplitude": height,
            "rms": period / 100.0,
            "moved": float(len(name)),
        },
    )
    main(["--height", "4", "--period", "9"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| the sensor reads | `planned` | `sea-cascade` | `adrc` |"
    assert lines[2] == "| 4 cm | 4.0 cm, 7 L/h | 4.0 cm, 11 L/h | 4.0 cm, 4 L/h |"
    main([])
    assert len(capsys.readouterr().out.splitlines()) == 8
