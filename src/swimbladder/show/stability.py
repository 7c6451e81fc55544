"""Where a law brings a vehicle back from, beside what no controller can."""

import io
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from swimbladder.design.stability.recover import Map, Verdict
from swimbladder.design.stability.run import Stability, cycle_rows, robustness_rows
from swimbladder.errors import NoAnswerError
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture, grid_of, stacked
from swimbladder.units import length

_CAME_BACK = {Verdict.RECOVERED: Ink.BLUE, Verdict.SLOW: Ink.SKY, Verdict.UNSETTLED: Ink.ORANGE}
_COLORS = _CAME_BACK | {Verdict.NOT_ASKED: "#FFFFFF", Verdict.LOST: Ink.VERMILION}
_COLORS |= {Verdict.BROUGHT_UP: Ink.PURPLE}


def draw_recovery(found: Stability) -> Picture:
    """Return the maps: a cell for each run, a line where no controller comes back any more."""
    how: Any = {"letters": True, "legend": "below", "across": 3}
    picture, panels = grid_of((9.0, 7.5), 4, 2, title=f"{found.vehicle}, {found.flown}", **how)
    labels = {
        Verdict.RECOVERED: f"within {length(found.band, 3, 'cm')} in {found.within:g} s, and stays",
        Verdict.SLOW: "later",
        Verdict.UNSETTLED: f"not in {3.0 * found.within:g} s",
        Verdict.LOST: "lost",
    }
    if found.supervised:
        labels[Verdict.BROUGHT_UP] = "brought up by the supervisor"
    for panel, one in zip(panels, found.maps, strict=True):
        _draw(panel, one)
        for verdict, text in labels.items():  # of all kinds, whether they occur or not
            panel.area(np.nan, np.nan, _COLORS[verdict], text, alpha=1.0)
    return picture


def _draw(panel: Panel, one: Map) -> None:
    steps = one.name == "steps"
    scale = np.asarray if steps else np.cbrt  # speeds are spaced by their cube
    y = scale(one.y)
    panel.cells(one.x, y, one.verdicts, [_COLORS[v] for v in Verdict])
    low, high = float(np.min(y)), float(np.max(y))
    half = 0.5 * (high - low) / max(len(y) - 1, 1)
    panel.ylim = (low - half, high + half)
    if np.isfinite(one.edge).any() and float(np.min(scale(one.edge))) < high:
        label = "beyond it no controller comes back"
        panel.line(one.x, scale(one.edge), Ink.BLACK, label, width=1.8)
    if not steps:
        sizes = [
            size for size in (0.01, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0) if size < float(one.y.max())
        ]
        shown = [-size for size in reversed(sizes)] + [0.0, *sizes]
        panel.yticks = {float(np.cbrt(size)): f"{size:g}" for size in shown}
    panel.grid, panel.title, panel.x, panel.y = "", one.title, one.x_label, one.y_label


def draw_robustness(found: Stability) -> Picture:
    """Return the share of draws that settle against the gain, a line for each law and delay."""
    laws = list(dict.fromkeys(s.law for s in found.robustness))
    size = (7.5, 2.2 + 1.5 * len(laws))
    picture, panels = stacked(size, *[1.0] * len(laws), letters=True, legend="below")
    gains = sorted({s.gain for s in found.robustness})
    for panel, law in zip(panels, laws, strict=True):
        own = [s for s in found.robustness if s.law == law]
        delays, marks = (
            sorted({s.delay for s in own}),
            ((Ink.BLUE, "o", "-"), (Ink.VERMILION, "s", "--")),
        )
        for delay, (color, marker, dash) in zip(delays, marks, strict=False):
            line = np.array([(s.gain, 100.0 * s.settled) for s in own if s.delay == delay])
            label = f"{delay:g} s late" if delay else "nominal"
            panel.line(line[:, 0], line[:, 1], color, label, marker=marker, dash=dash)
        panel.ylim, panel.y, panel.title = (-5.0, 105.0), "settle [%]", law
        panel.xlog, panel.xticks = True, {gain: f"{gain:g}" for gain in gains}
    panels[-1].x = "gain on the command [-]"
    return picture


class StabilityShown(Shown[Stability]):
    """How stable a vehicle is: words, maps, limit cycles and wrong gains."""

    name = "stability"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found = self.found
        yield f"{found.vehicle}, {found.flown}, sampled every {found.sample_time:g} s"
        yield from found.sentences
        if found.cycles:
            headings = ["limit cycle from", "kind", "predicted", "every"]
            headings += ["simulated", "every", "error"]
            yield Table(headings, cycle_rows(found.cycles), left=headings[:2])
        if found.maps:
            yield Drawn("maps", partial(draw_recovery, found))
        if found.robustness:
            gains = sorted({s.gain for s in found.robustness})
            headings = ["settle (over) [%]", "late", *(f"gain {g:g}" for g in gains)]
            yield Table(headings, robustness_rows(found.robustness), left=headings[:2])
            yield Drawn("robustness", partial(draw_robustness, found))
        yield from labelled("assumed", found.words)

    def drawn(self) -> Iterator[Drawn]:
        """Give the figures; raises NoAnswerError where there are none."""
        drawn = list(super().drawn())
        if not drawn:
            what = "no maps were asked for: with maps=True there is a picture of them"
            raise NoAnswerError(what)
        return iter(drawn)

    @property
    def error(self) -> str:
        """That it is not stable."""
        return "the loop is not stable over the range that was asked for"

    def table(self) -> dict[str, Any]:
        """Return what became of each run of the maps, a row each."""
        import pandas

        frames = [pandas.read_csv(io.StringIO(one.csv())) for one in self.found.maps]
        for one, frame in zip(self.found.maps, frames, strict=True):
            frame.columns = ["x", "y", *frame.columns[2:]]
            frame.insert(0, "map", one.name)
            frame.insert(1, "x_is", one.x_label)
            frame.insert(3, "y_is", one.y_label)
        whole = pandas.concat(frames) if frames else pandas.DataFrame({"map": []})
        return {str(name): whole[name].to_numpy() for name in whole}

    def files(self) -> dict[str, object]:
        """Return the words, and the maps."""
        maps = {f"map-{one.name}.csv": one.csv() for one in self.found.maps}
        return {"stability.txt": "\n".join(self.found.sentences) + "\n", **maps}
