"""A day at the pool as it is shown: its verdict, what is next, and the parameters."""

from collections.abc import Iterator, Mapping
from typing import Any

from swimbladder.design.pool_day import PoolDay
from swimbladder.show.estimates import rows
from swimbladder.show.parts import Part, Shown, Table


class PoolDayShown(Shown[PoolDay]):
    """The verdict first; its files are written as it goes."""

    name, alone = "pool", True

    @property
    def good(self) -> bool:
        """Whether the parameters are good enough."""
        return self.found.verdict.good

    def numbers(self) -> Mapping[str, Any]:
        """Return what is known."""
        return {name: value for name, value in self.found.answer().items() if name != "files"}

    def parts(self) -> Iterator[Part]:
        """Give the verdict, what is next, and the parameters."""
        yield self.found.verdict.sentence
        if not self.good:
            yield f"Next: {self.found.next.sentence()}"
        if self.found.found is not None:
            yield parameter_table(self.found)


def parameter_table(day: PoolDay) -> Table:
    """Return the parameters with their intervals, beside how well they are to be known."""
    assert day.found is not None
    aims = {t.name: t for t in day.asked.targets}
    listed = []
    for r in rows(day.found):
        e = day.found.parameters.get(r.name)
        if e is None:
            continue
        aim = aims.get(r.name)
        goal = known = ""
        if aim is not None:
            goal = f"{100.0 * aim.std:.3g} %" if aim.relative else f"{aim.std:.3g} {e.unit}"
        if r.std and e.value:
            known = f"{100.0 * e.std / abs(e.value):.2g} %"
        listed.append((r.name, r.value, r.std, r.ci95, r.unit, known, goal))
    headings = ("", "value", "1 sigma", "95 % interval", "unit", "known to", "target")
    return Table(headings, listed)
