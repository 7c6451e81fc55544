"""A mission as it is shown: depth, volume, power by consumer, battery."""

import datetime
from collections.abc import Iterator
from functools import partial
from itertools import cycle, product
from textwrap import fill
from typing import Any

import numpy as np

from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import neutral_volume
from swimbladder.physics.seawater import Cast
from swimbladder.show.parts import Drawn, Part, Shown, Table, labelled
from swimbladder.show.picture import Ink, Panel, Picture
from swimbladder.sim.engine.rodas.records import HOLDING, Note, Records
from swimbladder.sim.mission.balance import PUMP, VALVE, consumer_energy, drawn_energy, mean_power
from swimbladder.sim.mission.export import (
    cycle_columns,
    cycle_words,
    events_csv,
    float_configuration,
    speeds,
    trajectory_columns,
)
from swimbladder.sim.mission.orders import law_words
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.words import span_words

_NEAR_EMPTY = 50.0  # % of charge, below which zero is drawn too
_LAYERS = 20  # in which speeds are drawn
_MINUTE, _HOUR, _DAY = 60.0, 3600.0, 86400.0


def draw_mission(result: MissionResult) -> Picture:
    """Return the picture of a mission: the first cycle in depth and volume, then all cycles."""
    flight = result.flight
    title = f"{flight.vehicle.name}: {flight.mission.name or 'mission'}, {flight.column.source}"
    count = 3 + result.energy_known
    picture = Picture((9.5, 2.7 * count), count, 2, title=title, letters=True)
    first = flight.rows[flight.rows["cycle"] == 0.0]
    unit, words = _unit(float(first["t"][-1]))
    _depth(result, first, unit, words, picture.add(0, 0))
    _speed(result, picture.add(0, 1))
    _volume(result, first, unit, words, picture.add(1, 0))
    _neutral(result, first, picture.add(1, 1))
    if result.energy_known:
        _power(result, len(first), unit, words, picture)
    _energy(result, picture.add(count - 1, 0))
    _battery(result, picture.add(count - 1, 1))
    return picture


def _unit(seconds: float) -> tuple[float, str]:
    for unit, words, most in ((_MINUTE, "min", 3 * _HOUR), (_HOUR, "h", 3 * _DAY)):
        if seconds <= most:
            return unit, words
    return _DAY, "d"


def _depth(result: MissionResult, first: Records, unit: float, words: str, panel: Panel) -> None:
    panel.line(first["t"] / unit, first["z"], label="depth")
    notes = result.flight.notes
    notes = notes[notes["t"] <= first["t"][-1]]
    pump, valve = ("^", Ink.VERMILION, "pump starts"), ("v", Ink.GREEN, "valve opens")
    for what, how in ((Note.PUMP, pump), (Note.VALVE, valve)):
        some = notes[notes["what"] == what]
        if len(some):
            panel.dots(some["t"] / unit, some["z"], *how, size=4.0)
    bottom, known = result.flight.mission.bottom, np.isfinite(result.flight.mission.bottom)
    if known:
        panel.rule("y", bottom, dash=":", width=1.2)
    panel.y = "depth [m]" + "\n(dotted: bottom)" * bool(known)
    panel.x = f"time in the first cycle [{words}]"


def _speed(result: MissionResult, panel: Panel) -> None:
    table = speeds(result.flight)
    for way, color in (("sinking", Ink.BLUE), ("rising", Ink.VERMILION)):
        depth, speed = _smoothed(table["depth_m"], table[f"{way}_m_s"])
        if np.isfinite(speed).any():
            panel.line(100.0 * speed, depth, color, way)
    panel.x, panel.y, panel.xlim = "mean vertical speed [cm/s]", "depth [m]", (0.0, None)


def _smoothed(depth: Array, speed: Array) -> tuple[Array, Array]:
    """Return depths and mean speeds of thicker layers: pump runs make single ones a saw-tooth."""
    layers = np.array_split(np.arange(len(depth)), _LAYERS)
    time = [1.0 / speed[one][np.isfinite(speed[one])] for one in layers]
    mean = [1.0 / np.mean(one) if len(one) else np.nan for one in time]
    return np.array([np.mean(depth[one]) for one in layers]), np.array(mean)


def _volume(result: MissionResult, first: Records, unit: float, words: str, panel: Panel) -> None:
    panel.line(first["t"] / unit, 1e6 * first["v"])
    for stop in (result.flight.vehicle.stroke.minimum, result.flight.vehicle.stroke.maximum):
        panel.rule("y", 1e6 * stop, dash=":", width=1.2)
    panel.x, panel.y = f"time in the first cycle [{words}]", "volume [cm³]\n(dotted: end stops)"


def _neutral(result: MissionResult, first: Records, panel: Panel) -> None:
    flight = result.flight
    within = flight.column.depth <= float(np.max(first["z"])) * 1.02
    neutral = neutral_volume(flight.vehicle, flight.column)
    lags = flight.vehicle.hull.thermal_time_constant > 0.0
    label = "neutral, with a hull as warm as the water" if lags else "neutral"
    panel.line(1e6 * first["v"], first["z"], label="volume", width=1.0)
    panel.line(1e6 * neutral[within], flight.column.depth[within], Ink.ORANGE, label, dash="--")
    panel.x, panel.y = "volume [cm³]", "depth [m]"


def _power(result: MissionResult, count: int, unit: float, words: str, picture: Picture) -> None:
    """Draw each consumer's power over the first `count` rows, as steps on a logarithmic scale."""
    time, energy = result.flight.rows["t"], consumer_energy(result.flight)
    shown = np.flatnonzero(np.diff(time[: count + 1], append=np.inf)[:count] > 0.0)
    power = {name: mean_power(time, taken)[shown] for name, taken in energy.items()}
    drawn = np.concatenate([np.zeros(0), *(values[values > 0.0] for values in power.values())])
    if not drawn.size:
        return
    panel = picture.add(2, 0, 2, ylog=True, legend="beside")
    least, most = float(drawn.min()), float(drawn.max())
    own = {PUMP: Ink.VERMILION, VALVE: Ink.GREEN, HOLDING: Ink.PURPLE}
    others = cycle(product(("-", "--", ":"), (Ink.BLUE, Ink.ORANGE, Ink.SKY, Ink.BLACK, Ink.GREY)))
    for name, values in power.items():
        dash, color = ("-", own[name]) if name in own else next(others)
        # what is off is far below the axis: a run of seconds in days is a stroke, not a dot
        values = np.where(values > 0.0, values, 1e-6 * least)
        panel.steps(time[shown] / unit, values, color, name, dash=dash, width=1.2)
    panel.ylim = (0.5 * least, 2.0 * most)
    panel.x, panel.y = f"time in the first cycle [{words}]", "power [W]"


def _energy(result: MissionResult, panel: Panel) -> None:
    columns = cycle_columns(result)
    panel.x, panel.counts, panel.legend = "cycle", "x", "best"
    if not result.energy_known:
        panel.bars(columns["cycle"], 1e6 * columns["pumped_m3"])
        panel.y = "pumped [cm³]"
        return
    below = np.zeros(len(columns["cycle"]))
    colors = (Ink.VERMILION, Ink.GREEN, Ink.PURPLE, Ink.GREY)
    for name, color in zip(("pump", "valve", "holding", "loads"), colors, strict=True):
        values = columns[f"{name}_J"] / 1e3
        words = "standby and loads" if name == "loads" else name
        if np.any(values != 0.0):
            panel.bars(columns["cycle"], values, color, words, base=below, thick=0.9)
            below = below + values
    panel.y = "energy per cycle [kJ]"


def _battery(result: MissionResult, panel: Panel) -> None:
    rows, charge = result.flight.rows, result.charge()
    unit, words = _unit(float(result.flight.end["t"]))
    panel.x = f"time [{words}]"
    if not result.energy_known:
        why = result.flight.plan.energy_known.split(". ")[0]
        panel.text(0.5, 0.5, fill(why, 40), across="center", up="center", share="xy")
    elif np.isnan(charge).all():
        panel.line(rows["t"] / unit, drawn_energy(rows) / 1e3)
        panel.y = "energy drawn [kJ]"
    else:
        panel.line(rows["t"] / unit, 100.0 * charge)
        panel.y = "battery left [%]"
        least = 100.0 * float(charge.min())
        if least < _NEAR_EMPTY:
            panel.ylim = (min(0.0, least), 102.0)


class MissionResultShown(Shown[MissionResult]):
    """The answer, its reasons, the cycles, the energy.

    begin: when the mission does, in float.json; cast: the sea that was given.
    """

    name = "mission"
    begin: datetime.datetime | None = None
    cast: Cast | None = None

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        found, flight = self.found, self.found.flight
        count = len(flight.cycles)
        cycles = f"{count} cycle{'s' if count > 1 else ''}, {span_words(flight.duration)}"
        yield f"{flight.vehicle.name} in {flight.column.source or 'the given water'}: {cycles}"
        yield from (found.sentence, *found.reasons, *found.notes, *found.holding)
        yield from law_words(found.laws)
        heading, *lines = cycle_words(found)
        yield Table(heading, lines, left=())
        if len(lines) < count:
            yield f"({count - len(lines)} cycles more in cycles.csv)"
        if found.energy_known:
            battery, drawn = found.balance.battery, found.balance.drawn
            for name, energy in sorted(battery.items(), key=lambda pair: -pair[1]):
                share = 100.0 * energy / drawn if drawn > 0.0 else 0.0
                yield f"{name}: {energy / 1e3:.4g} kJ, {share:.0f} %"
        yield Drawn("mission", partial(draw_mission, found))
        yield from labelled("cast", () if self.cast is None else flight.column.report)

    def table(self) -> Any:
        """Return the columns of trajectory.csv."""
        return trajectory_columns(self.found)

    def files(self) -> dict[str, object]:
        """Return the tables, and the float's configuration."""
        return {
            "trajectory.csv": self.table(),
            "events.csv": events_csv(self.found.flight),
            "cycles.csv": cycle_columns(self.found),
            "vertical-speed.csv": speeds(self.found.flight),
            "float.json": float_configuration(self.found, begin=self.begin),
        }
