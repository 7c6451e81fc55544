"""What a guided run shows: lines as things happen or, on a terminal, a panel that lives."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from swimbladder.cli.common import aside, output
from swimbladder.show.text import rich_table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from swimbladder.design.pool_day import News, PoolDay

_LATEST = 6  # lines of news in the panel
_STYLES = {"refused": "yellow", "identified": "bold", "log": "dim", "turned": "dim"}


class View:
    """Shows a day's news: nothing where quiet, a panel on a terminal, else lines on stderr."""

    def __init__(self, day: PoolDay, *, quiet: bool) -> None:
        self.day, self.quiet = day, quiet
        self.live = output.is_terminal and not quiet
        self._news: deque[News] = deque(maxlen=_LATEST)

    def show(self, happening: Iterable[News | None]) -> None:
        """Show everything that happens."""
        with self._panel() as update:
            for news in happening:
                if news is not None:
                    self._tell(news)
                update()

    def _tell(self, news: News) -> None:
        self._news.append(news)
        if not (self.quiet or self.live):
            aside(_line(news))

    @contextlib.contextmanager
    def _panel(self) -> Iterator[Any]:
        if not self.live:
            yield lambda: None
            return
        from rich.live import Live

        with Live(self._drawn(), console=output, refresh_per_second=8, transient=True) as live:
            yield lambda: live.update(self._drawn())

    def _drawn(self) -> RenderableType:
        from rich.console import Group
        from rich.panel import Panel
        from rich.text import Text

        from swimbladder.show.pool import experiment_table, parameter_table

        day = self.day
        parts: list[RenderableType] = [self._state(), Text(day.advice, style="bold cyan"), Text()]
        if day.kept:
            parts += [rich_table(experiment_table(day)), Text()]
        if day.found is not None:
            parts += [rich_table(parameter_table(day)), Text()]
        parts += [Text(_line(n), style=_STYLES.get(n.kind, "")) for n in self._news]
        title = f"swimbladder pool, {day.vehicle.name}, {day.mode}"
        return Panel(Group(*parts), title=title, title_align="left")

    def _state(self) -> RenderableType:
        from rich.text import Text

        day, sample = self.day, self.day.latest
        if sample is None:
            return Text("waiting for the log", style="dim")
        words = Text()
        for name in ("moving", "at rest", "under way"):
            words.append(f" {name} ", style="reverse" if day.doing == name else "dim")
        speed = "" if math.isnan(day.speed) else f"   {1e3 * day.speed:+.1f} mm/s over a minute"
        volume = f"volume {1e6 * sample.volume:+.1f} cm3{speed}"
        words.append(f"   {_clock(sample.time)}   depth {sample.depth:.2f} m   {volume}")
        return words


def _line(news: News) -> str:
    when = f"{_clock(news.time)}  " if news.kind != "log" else ""
    return f"{when}{news.sentence}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(0, math.floor(seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
