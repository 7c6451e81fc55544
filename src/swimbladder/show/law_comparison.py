"""Laws compared: what each buys with what it moves, and the steps as they went."""

import math
from collections.abc import Iterator
from functools import partial
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from swimbladder.design.law_comparison import LawComparison
from swimbladder.design.law_comparison.contenders import Placed
from swimbladder.design.law_comparison.run import RESULT, Row, front
from swimbladder.design.tuning.run import BAND
from swimbladder.io.answers import as_json
from swimbladder.io.files import rows_csv
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.arrays import Array
from swimbladder.show.html import TEXTS
from swimbladder.show.parts import Drawn, Labelled, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture, grid_of
from swimbladder.units import rounded

_COLORS = (Ink.BLUE, Ink.VERMILION, Ink.GREEN, Ink.ORANGE, Ink.PURPLE, Ink.SKY, Ink.BLACK)
_MARKERS = {"fast": "^", "quiet": "o"}
_STYLES = {"fast": "-", "quiet": "--"}
_SHOWN = ("step-down", "step-small", "step-large", "step-deep")
_WIDE = 100  # letters of a line above a panel
_LONG = 5.0  # times the least time of a step, that is shown


def draw_pareto(comparison: LawComparison) -> Picture:
    """Return settling and holding, each against what is moved, with the fronts."""
    picture, (upper, lower) = grid_of((7.5, 7.6), 2, 1, letters=True, legend="below")
    floats = comparison.vehicle.command == "volume change"
    settled = f"within {BAND:g} m" if floats else "to 2 % of the step"
    across = _Cost("step-down", "settle_median", 1.0, f"settling {settled} [s]")
    up = _Cost("hold", "rate", 3.6e6, "moved while holding [L/h]")
    _pareto(upper, comparison, across, up, comparison.bounds.get("step-down"))
    across = _Cost("hold-drift", "rms", 1e3, "depth error while the trim drifts [mm rms]")
    up = _Cost("hold-drift", "rate", 3.6e6, "moved meanwhile [L/h]")
    _pareto(lower, comparison, across, up, None)
    picture.title = f"{comparison.vehicle.name}: no law beats those on the grey line"
    return picture


class _Cost(NamedTuple):
    """What is to be small, as it is drawn along an axis."""

    scenario: str
    field: str
    factor: float
    label: str

    def of(self, comparison: LawComparison) -> Array:
        costs = [row.cost(self.scenario, self.field) for row in comparison.rows]
        return self.factor * np.array(costs)


def _pareto(
    panel: Panel, comparison: LawComparison, across: _Cost, up: _Cost, bound: float | None
) -> None:
    """Draw one pair of costs."""
    x, y = across.of(comparison), up.of(comparison)
    there = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    along, above = [*x[there], *([] if bound is None else [bound])], y[there].tolist()
    panel.x, panel.y = across.label, up.label
    panel.xlog, panel.ylog = bool(along), bool(above)  # a scale without a value has no ticks
    panel.xlim = _limits(along) if along else (None, None)
    panel.ylim = _limits(above) if above else (None, None)
    best = np.flatnonzero(there)[front(np.stack([x[there], y[there]], axis=1))]
    if len(best) > 0:
        best = best[np.argsort(x[best])]
        panel.steps(x[best], y[best], Ink.GREY, width=3.0, alpha=0.45, layer=1.0)
    missing = []
    for row, a, b, shown in zip(comparison.rows, x, y, there, strict=True):
        marker, size = _MARKERS.get(row.who.tuning, "s"), _size(comparison, row)
        how: Any = {"color": _color(comparison, row), "label": row.who.name, "size": size}
        # without a place it is in the legend all the same
        at = (a, b) if shown else (np.nan, np.nan)
        panel.dots(at[0], at[1], marker, **how)
        if not shown:
            missing.append(row.who.name)
        elif row is comparison.reference:
            panel.rule("x", a, Ink.GREY, dash=":")
            panel.rule("y", b, Ink.GREY, dash=":")
    if bound is not None:
        panel.rule("x", bound, Ink.BLACK, "least time of any", width=1.0, dash="--")
        text = f"least of any: {bound:.1f} s"
        panel.text(bound, 0.5, text, turned=True, up="center", size=8.0, share="y")
    if missing:
        words = ("not settled: " if bound else "not shown: ") + "; ".join(missing)
        panel.note = fill(words, _WIDE)


def _limits(values: list[float]) -> tuple[float, float]:
    """Return limits of a logarithmic axis, a factor of 10 apart at least."""
    least, most = min(values) / 1.3, max(values) * 1.3
    room = max(math.sqrt(10.0 * least / most), 1.0)
    return least / room, most * room


def draw_steps(comparison: LawComparison) -> Picture:
    """Return the first run of every law on four steps, each with the band to settle in, bound."""
    placed = [p for p in comparison.placed if p.scenario.name in _SHOWN]
    floats = comparison.vehicle.command == "volume change"
    size = (7.5, 2.3 + 2.2 * math.ceil(len(placed) / 2))
    how: Any = {"letters": True, "legend": "below"}
    picture, panels = grid_of(size, len(placed), min(2, len(placed)), **how)
    for panel, p in zip(panels, placed, strict=True):
        name = p.scenario.name
        bound = comparison.bounds.get(name)
        end = p.duration if bound is None else min(_LONG * bound, p.duration)
        for row in comparison.rows:
            trace, dash = row.traces[name], _STYLES.get(row.who.tuning, ":")
            kept, color = trace.time <= end, _color(comparison, row)
            seen = trace.time[kept], trace.depth[kept]
            panel.line(*seen, color, row.who.name, dash=dash, width=1.3)
        half = BAND if floats else 0.02 * abs(p.target - p.start)
        panel.span("y", p.target - half, p.target + half, Ink.GREY)
        if bound is not None:
            panel.rule("x", bound, Ink.BLACK, "least time of any", width=1.0, dash="--")
        far = 0.25 * (p.target - p.start)
        low, high = sorted((p.start - 0.2 * far, p.target + far))
        panel.ylim, panel.xlim, panel.y = (low, high), (0.0, end), "depth [m]"
        panel.x = "time since the set-point changed [s]"
        panel.title = f"{rounded(p.start, 3)} to {rounded(p.target, 3)} m"
    return picture


def _laws(comparison: LawComparison) -> list[str]:
    return list(dict.fromkeys(row.who.law.name for row in comparison.rows))


def _color(comparison: LawComparison, row: Row) -> str:
    return _COLORS[_laws(comparison).index(row.who.law.name) % len(_COLORS)]


def _size(comparison: LawComparison, row: Row) -> float:
    """Return a marker's size: smaller from law to law, so that none hides another wholly."""
    return 10.0 - 0.8 * _laws(comparison).index(row.who.law.name)


SOON = ("law", "settles [s]", "of bound", "95 % [s]", "over [%]", "deep [%]", "lost")
STILL = ("law", "hold", "swell", "deep", "drift", "L/h", "starts", "turns", "J/h")
HEADINGS = (*SOON, *STILL[1:])
_SETTLED = ("settled", "median [s]", "95 % [s]", "of the bound")
STEP_HEADINGS = ("law", *_SETTLED, "overshoot [%]", "95 % [%]", "L/h", "lost")
HOLD_HEADINGS = ("law", "rms [mm]", "farthest [cm]", "L/h", "starts/h", "turns/h", "J/h", "lost")


def notes(comparison: LawComparison) -> tuple[str, ...]:
    """Return what the columns of HEADINGS mean, and why the energy is not known."""
    floats = comparison.vehicle.command == "volume change"
    said = TEXTS["laws"]["floats" if floats else "moving"]
    unknown = comparison.no_energy
    return (
        TEXTS["laws"]["best"],
        *(text.format(band=BAND) for text in said),
        *([] if unknown is None else [f"J/h is unknown: {unknown}."]),
    )


def summary(comparison: LawComparison) -> list[tuple[str, ...]]:
    """Return a row of HEADINGS for each contender."""
    bound, rows = comparison.bounds.get("step-down", math.nan), []
    worst = (comparison.worst_overshoot(where) for where in ("shallow", "deep"))
    flown = zip(comparison.rows, comparison.unbeaten, *worst, comparison.lost, strict=True)
    for row, unbeaten, over, deep, lost in flown:
        median = row.cost("step-down", "settle_median")
        settles = _number(median), _number(median, 1.0 / bound, "{:.2f}")
        uncertain = _number(row.cost("step-uncertain", "settle_95"))
        soon = (*settles, uncertain, _percent(over), _percent(deep), _share(lost))
        holds = ("hold", "hold-swell", "hold-deep", "hold-drift")
        still = [_number(row.cost(name, "rms"), 1e3) for name in holds]
        still += _moved(row, "hold", comparison)
        rows.append((row.who.name + (" *" if unbeaten else ""), *soon, *still))
    return rows


def steps(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of STEP_HEADINGS for each contender on one step."""
    bound = comparison.bounds.get(scenario, math.nan)
    rows: list[tuple[str, ...]] = []
    for row in comparison.rows:
        r = row.results[scenario]
        settles = _number(r.settle_median), _number(r.settle_95)
        relative = _number(r.settle_median, 1.0 / bound, "{:.2f}")
        over = _percent(r.overshoot_median), _percent(r.overshoot_95)
        moved = _number(r.rate, 3.6e6, "{:.3g}")
        settled = f"{100.0 * r.settled:.0f} %"
        rows.append((row.who.name, settled, *settles, relative, *over, moved, _share(r.lost)))
    return rows


def holds(comparison: LawComparison, scenario: str) -> list[tuple[str, ...]]:
    """Return a row of HOLD_HEADINGS for each contender on one hold."""
    rows: list[tuple[str, ...]] = []
    for row in comparison.rows:
        r, moved = row.results[scenario], _moved(row, scenario, comparison)
        off = _number(r.rms, 1e3), _number(r.farthest, 100.0)
        rows.append((row.who.name, *off, *moved, _share(r.lost)))
    return rows


def _moved(row: Row, scenario: str, comparison: LawComparison) -> tuple[str, ...]:
    """Return L/h, starts/h, turns/h and J/h."""
    energy = _number(row.cost(scenario, "power"), 3600.0, "{:.3g}")
    return (
        _number(row.cost(scenario, "rate"), 3.6e6, "{:.3g}"),
        _number(row.cost(scenario, "starts"), 3600.0, "{:.0f}"),
        _number(row.cost(scenario, "turns"), 3600.0, "{:.0f}"),
        "unknown" if comparison.no_energy else energy,
    )


def _share(x: float) -> str:
    return f"{100.0 * x:.0f} %" if x > 0.0 else ""


def _percent(x: float) -> str:
    """Return an overshoot; of one beyond ten times the step only that it is."""
    return "> 999" if x > 9.99 else _number(x, 100.0)


def _number(x: float, factor: float = 1.0, form: str = "{:.1f}") -> str:
    return form.format(x * factor) if math.isfinite(x * factor) else "-"


def table_csv(comparison: LawComparison) -> str:
    """Return every result of every law on every scenario as CSV, in SI units."""
    rows = [
        {"law": row.who.law.name, "tuning": row.who.tuning, "scenario": name} | as_json(r, RESULT)
        for row in comparison.rows
        for name, r in row.results.items()
    ]
    return rows_csv(rows[0], (row.values() for row in rows))


class LawComparisonShown(Shown[LawComparison]):
    """Laws compared: a table, pictures, every scenario, and a vehicle file for each law."""

    name, kind = "laws", "laws on the same scenarios"

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found = self.found
        count = len(found.rows)
        controllers = f"{count} controller{'' if count == 1 else 's'}"
        scenarios = f"{len(found.placed)} scenarios of {found.runs} runs"
        yield f"{found.vehicle.name}, {controllers} on {scenarios}"
        yield from found.sentences
        rows = [dict(zip(HEADINGS, row, strict=True)) for row in summary(found)]
        for shown in (SOON, STILL):
            yield Table(shown, [[row[heading] for heading in shown] for row in rows])
        yield from notes(found)
        yield from (f"left out: {name}: {why}" for name, why in found.not_compared.items())
        yield Drawn("pareto", partial(draw_pareto, found))
        yield Drawn("steps", partial(draw_steps, found))
        yield from map(self._scenario, found.placed)
        yield from labelled("assumed", found.assumptions)
        alike = "every law meets the same noise, waves, drift and vehicles"
        runs = f"{found.runs} runs of each scenario, seed {found.seed}: {alike}"
        yield Labelled("assumed", runs)

    def _scenario(self, p: Placed) -> Table:
        found, name = self.found, p.scenario.name
        where = f"{p.start:.4g} to {p.target:.4g} m" if p.is_step else f"at {p.target:.4g} m"
        title = f"{name}: {p.scenario.words}; {where}"
        if (bound := found.bounds.get(name)) is not None:
            title += f"; no controller settles before {bound:.1f} s"
        elif name in found.no_bound:
            title += f"; no least time: {found.no_bound[name]}"
        headings, of = (STEP_HEADINGS, steps) if p.is_step else (HOLD_HEADINGS, holds)
        return Table(headings, of(found, name), title=title)

    def table(self) -> str:
        """Return every result of every law on every scenario as CSV, in SI units."""
        return table_csv(self.found)

    def files(self) -> dict[str, object]:
        """Return the table, and a vehicle file for each law."""
        files: dict[str, object] = {"laws.csv": self.table()}
        for row in self.found.rows:
            flown = self.found.vehicle.model_copy(update={"controller": row.who.controller()})
            head = f"As flown by swimbladder compare-laws: {row.who.name}."
            slug = row.who.name.replace(", ", "-").replace("'", "").replace(" ", "-")
            files[f"vehicles/{slug}.toml"] = vehicle_file(flown, head=head)
        return files
