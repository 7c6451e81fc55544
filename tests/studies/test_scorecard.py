"""The table of real vehicles on the site's front page is what the measured data give."""

from pathlib import Path

import pytest

from studies.scorecard import main

PAGE = Path(__file__).parents[2] / "docs" / "index.md"


@pytest.mark.data
@pytest.mark.slow
def test_the_front_page_has_the_scorecard(data_dir, capsys):
    main([str(data_dir)])
    table = capsys.readouterr().out
    assert table.count("\n") >= 8
    assert table in PAGE.read_text(encoding="utf-8")
