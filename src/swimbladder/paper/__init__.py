"""The paper redone: every figure, table, equation and published number, in one report.

`evidence` simulates and fits, `equations` checks (1) to (37), `published` compares numbers,
`verdict` says what a comparison comes to, `page` puts it together. The texts stand in TOML files
beside the modules.
"""

from pathlib import Path
from typing import Any

from swimbladder.errors import check_counts
from swimbladder.io.answers import plain
from swimbladder.io.files import check_place
from swimbladder.io.progress import Advance, silent
from swimbladder.paper.equations import actuator_checks, motion_checks
from swimbladder.paper.evidence import STAGES, gather
from swimbladder.paper.page import FIGURES, Judged, answer, draw, page, trajectories
from swimbladder.paper.published import independent, published
from swimbladder.show.answers import write_all
from swimbladder.show.parts import REPORT

__all__ = ["AMOUNT", "reproduce"]

AMOUNT = STAGES + len(FIGURES) + 3  # what `advance` adds up to


def reproduce(out: str | Path, *, seed: int = 2023, advance: Advance = silent) -> dict[str, Any]:
    """Write the report of the paper's results into a folder and return its numbers.

    Parameters
    ----------
    out
        The folder.
    seed
        Of the sensors' noise in the pool; the same seed gives the same report.
    advance
        Called for the work that was done since, `AMOUNT` in all.

    Returns
    -------
    dict
        The numbers as results.json has them.

    Raises
    ------
    InputError
        The seed is negative, or the folder cannot be written.
    NoAnswerError
        The pool procedure does not end; nothing is then written.
    """
    check_counts(seed=(seed, 0))
    place = Path(out)
    check_place(place)
    evidence = gather(seed, advance)
    checks = [*actuator_checks(evidence), *motion_checks(evidence)]
    judged = Judged(
        published=published(evidence),
        independent=independent(evidence),
        equations=sorted(checks, key=lambda check: check.number),
    )
    advance(1.0)
    figures = draw(evidence, advance)
    contents: dict[str, object] = {f"figures/{name}.png": drawn for name, drawn in figures.items()}
    curves = trajectories(evidence).items()
    contents |= {f"trajectories/{name}": columns for name, columns in curves}
    files = ["results.json", *contents]
    found = answer(evidence, judged, files)
    html = page(evidence, judged, figures, files)
    advance(1.0)
    write_all(place, {REPORT: html, "results.json": found, **contents}, advance=advance)
    plain_answer: dict[str, Any] = plain(found)
    return plain_answer
