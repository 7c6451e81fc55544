"""A campaign as files: its numbers, a row for each float, pictures."""

from collections.abc import Mapping
from typing import Any

from swimbladder.show.plots.campaign import draw_campaign, draw_sensitivity
from swimbladder.sim.campaign.result import Campaign


def campaign_files(found: Campaign, answer: Mapping[str, Any]) -> dict[str, object]:
    """Return the contents of campaign.json (the answer), floats.csv, campaign.png, sensitivity.png.

    The last where the floats are a design.
    """
    picture = draw_campaign(found)
    files: dict[str, object] = {"campaign.json": answer, "floats.csv": found.by_float()}
    files["campaign.png"] = picture
    if found.sensitivity is not None:
        files["sensitivity.png"] = draw_sensitivity(found.sensitivity)
    return files
