"""Where a law brings a vehicle back from, beside what no controller can."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from swimbladder.design.stability.recover import Map, Verdict
from swimbladder.design.stability.run import Stability, cycle_rows, robustness_rows
from swimbladder.errors import NoAnswerError
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.style import Ink, label_panels, new_figure, stacked, styled
from swimbladder.units import length

_CAME_BACK = {Verdict.RECOVERED: Ink.BLUE, Verdict.SLOW: Ink.SKY, Verdict.UNSETTLED: Ink.ORANGE}
_COLORS = _CAME_BACK | {Verdict.NOT_ASKED: "#FFFFFF", Verdict.LOST: Ink.VERMILION}
_COLORS |= {Verdict.BROUGHT_UP: Ink.PURPLE}


@styled
def draw_recovery(found: Stability) -> Figure:
    """Return the maps: a cell for each run, a line where no controller comes back any more."""
    figure, panels = new_figure((9.0, 7.5), 2, 2)
    for axes, one in zip(panels, found.maps, strict=True):
        _draw(axes, one)
    label_panels(panels)
    for axes, one in zip(panels, found.maps, strict=True):
        axes.set_title(one.title, fontsize=9.5)
    labels = {
        Verdict.RECOVERED: f"within {length(found.band, 3, 'cm')} in {found.within:g} s, and stays",
        Verdict.SLOW: "later",
        Verdict.UNSETTLED: f"not in {3.0 * found.within:g} s",
        Verdict.LOST: "lost",
    }
    if found.supervised:
        labels[Verdict.BROUGHT_UP] = "brought up by the supervisor"
    handles: list[Any] = [Patch(color=_COLORS[v], label=text) for v, text in labels.items()]
    handles += [line for axes in panels for line in axes.get_lines()][:1]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    figure.suptitle(f"{found.vehicle}, {found.flown}", fontsize=10.5)
    return figure


def _draw(axes: Axes, one: Map) -> None:
    shades = ListedColormap([_COLORS[v] for v in Verdict])
    how: Any = {"vmin": -0.5, "vmax": len(Verdict) - 0.5, "shading": "nearest"}
    axes.pcolormesh(one.x, one.y, one.verdicts, cmap=shades, rasterized=True, **how)
    low, high = axes.get_ylim()
    if np.isfinite(one.edge).any() and float(np.min(one.edge)) < high:
        label = "beyond it no controller comes back"
        axes.plot(one.x, one.edge, color=Ink.BLACK, lw=1.8, label=label)
    axes.set_ylim(low, high)
    if one.name != "steps":  # speeds are spaced by their cube
        axes.set_yscale("function", functions=(np.cbrt, lambda x: x**3))
        sizes = [size for size in (0.01, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0) if size < high]
        axes.set_yticks([-size for size in reversed(sizes)] + [0.0, *sizes])
        axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(visible=False)
    axes.set(xlabel=one.x_label, ylabel=one.y_label)


@styled
def draw_robustness(found: Stability) -> Figure:
    """Return the share of draws that settle against the gain, a line for each law and delay."""
    laws = list(dict.fromkeys(s.law for s in found.robustness))
    figure, panels = stacked((7.5, 2.2 + 1.5 * len(laws)), *[1.0] * len(laws))
    for axes, law in zip(panels, laws, strict=True):
        own = [s for s in found.robustness if s.law == law]
        delays, marks = sorted({s.delay for s in own}), ((Ink.BLUE, "o-"), (Ink.VERMILION, "s--"))
        for delay, (color, mark) in zip(delays, marks, strict=False):
            line = np.array([(s.gain, 100.0 * s.settled) for s in own if s.delay == delay])
            label = f"{delay:g} s late" if delay else "nominal"
            axes.plot(*line.T, mark, color=color, label=label)
        axes.set(ylim=(-5.0, 105.0), ylabel="settle [%]")
        axes.set_title(law, fontsize=9.5)
    panels[-1].set_xscale("log")
    gains = sorted({s.gain for s in found.robustness})
    panels[-1].set_xticks(gains, [f"{g:g}" for g in gains], minor=False)
    panels[-1].set_xticks([], minor=True)
    panels[-1].set_xlabel("gain on the command [-]")
    panels[0].legend(loc="lower left")
    label_panels(panels)
    return figure


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

        from swimbladder.show.tables import dataframe

        frames = [dataframe(one.csv()) for one in self.found.maps]
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
