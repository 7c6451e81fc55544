"""What a comparison found, for a person, for a table and for JSON.

Which of several answers no other beats.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swimbladder.control.records import leaves
from swimbladder.design.law_comparison.contenders import PAPER, Contender, LeftOut
from swimbladder.design.law_comparison.fly import Result
from swimbladder.design.law_comparison.scenarios import Placed, Places
from swimbladder.io.answers import as_json
from swimbladder.vehicle import Vehicle


def front(costs: ArrayLike) -> NDArray[np.bool_]:
    """Return which rows of costs [rows, kinds], all to be small, no other row beats.

    A row beats another where it is nowhere worse and somewhere better. nan: worse than any number;
    rows without any number are not on the front.
    """
    c = np.asarray(costs, float)
    c = np.where(np.isnan(c), np.inf, c)
    no_worse = (c[:, None, :] <= c[None, :, :]).all(axis=-1)
    better = (c[:, None, :] < c[None, :, :]).any(axis=-1)
    found: NDArray[np.bool_] = ~(no_worse & better).any(axis=0) & np.isfinite(c).any(axis=1)
    return found


Array = NDArray[np.float64]

# What a law is judged by: name, unit, scenario, and the number of a Result that is to be small.
COSTS = (
    ("settling", "s", "step-down", "settle_median"),
    ("hold", "m", "hold", "rms"),
    ("drift", "m", "hold-drift", "rms"),
    ("travel", "m3/s", "hold", "volume_rate"),
    ("starts", "1/s", "hold", "starts_and_turns"),
)


@dataclass(frozen=True, kw_only=True)
class Trace:
    """The first run of a scenario: time [s] and depth [m]."""

    time: Array
    depth: Array


@dataclass(frozen=True, kw_only=True)
class Row:
    """A contender with its result on every scenario, by name."""

    who: Contender
    results: Mapping[str, Result]
    traces: Mapping[str, Trace]

    def cost(self, scenario: str, field: str) -> float:
        """Return one number of a result; nan where the scenario was not flown."""
        found = self.results.get(scenario)
        return math.nan if found is None else float(getattr(found, field))


@dataclass(frozen=True, kw_only=True)
class LawComparison:
    """Every contender on every scenario, with the bounds that no controller can beat."""

    vehicle: Vehicle
    where: Places
    placed: Sequence[Placed]
    rows: Sequence[Row]
    left_out: Sequence[LeftOut]
    bounds: Mapping[str, float]  # s, of each step that has one
    no_bound: Mapping[str, str]  # why a step has none
    no_energy: str | None  # why the energy is not known
    assumptions: Sequence[str]
    runs: int
    seed: int

    @property
    def reference(self) -> Row:
        """The row that others are measured by: the paper's, a tuned cascade, or the file's."""
        papers = [row for row in self.rows if row.who.tuning.startswith(PAPER)]
        cascades = [row for row in self.rows if row.who.law.name == "cascade"]
        return [*papers, *cascades, *self.rows][0]

    @property
    def unbeaten(self) -> tuple[bool, ...]:
        """Whether no other row is nowhere worse and somewhere better in all of COSTS."""
        costs = [[row.cost(s, field) for _, _, s, field in COSTS] for row in self.rows]
        return tuple(bool(one) for one in front(costs))

    def worst_overshoot(self, at: str) -> tuple[float, ...]:
        """Return each row's largest 95 % overshoot over the nominal vehicle's steps there [-]."""
        names = [
            p.scenario.name
            for p in self.placed
            if p.is_step and not p.scenario.drawn and p.scenario.at == at
        ]
        return tuple(
            max((row.cost(name, "overshoot_95") for name in names), default=math.nan)
            for row in self.rows
        )

    @property
    def lost(self) -> tuple[float, ...]:
        """The share of runs that each row lost in its worst scenario [-]."""
        return tuple(max(r.lost for r in row.results.values()) for row in self.rows)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know first: the soonest, the stillest, the thriftiest."""
        said = []
        bound = self.bounds.get("step-down")
        alone = len(self.rows) == 1
        for words, scenario, field, shown in (
            (f"settles{'' if alone else ' soonest'} after a step, in 95 % of the runs",
             "step-down", "settle_95", _seconds),
            (f"holds{'' if alone else ' best'} while the trim drifts", "hold-drift", "rms",
             _millimetres),
            (f"moves{'' if alone else ' least'} while holding", "hold", "volume_rate", _litres),
        ):  # fmt: skip
            ranked = sorted(
                (row for row in self.rows if math.isfinite(row.cost(scenario, field))),
                key=lambda row: row.cost(scenario, field),
            )
            if not ranked:
                continue
            best, reference = ranked[0], self.reference
            text = f"{best.who.name} {words}: {shown(best.cost(scenario, field))}"
            if field == "settle_95" and bound:
                ratio = best.cost(scenario, field) / bound
                text += f", {ratio:.2f} of the least that any controller needs ({bound:.1f} s)"
            if reference is not best:
                text += f"; {reference.who.name}: {shown(reference.cost(scenario, field))}"
            said.append(text + ".")
        return tuple(said)

    def assuming(self, words: str) -> LawComparison:
        """Return it with one more thing that was assumed, in words."""
        return replace(self, assumptions=(*self.assumptions, words))

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "vehicle": self.vehicle.name,
            **as_json(self, "runs seed energy_unknown=no_energy assumptions"),
            "depths_m": [self.where.least, self.where.most],
            "scenarios": {
                p.scenario.name: {
                    "words": p.scenario.words,
                    **as_json(p, "start_m target_m duration_s"),
                    "least_time_s": self.bounds.get(p.scenario.name),
                    "no_least_time": self.no_bound.get(p.scenario.name),
                }
                for p in self.placed
            },
            "laws": [
                {
                    "law": row.who.law.name,
                    **as_json(row.who, "name tuning sample_time_s"),
                    "unbeaten": unbeaten,
                    "reference": row is self.reference,
                    "parameters": leaves(row.who.parameters),
                    "results": {name: as_json(r, RESULT) for name, r in row.results.items()},
                }
                for row, unbeaten in zip(self.rows, self.unbeaten, strict=True)
            ],
            "left_out": {one.name: one.why for one in self.left_out},
        }


RESULT = (
    "settled settle2_median_s=settle_median settle2_95_s=settle_95 overshoot_median overshoot_95 "
    "rms_m farthest_m volume_rate_m3_s starts_1_s turns_1_s power_W lost"
)
"""Numbers of a result, as `io.answers.as_json` takes them."""


def _seconds(x: float) -> str:
    return f"{x:.1f} s" if math.isfinite(x) else "not within the time watched"


def _millimetres(x: float) -> str:
    return f"{1e3 * x:.2g} mm rms" if math.isfinite(x) else "unknown"


def _litres(x: float) -> str:
    return f"{3.6e6 * x:.2g} L/h" if math.isfinite(x) else "unknown"
