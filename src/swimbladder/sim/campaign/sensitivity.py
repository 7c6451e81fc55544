"""Which inputs the outcome of a campaign comes from: Sobol indices of its outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.sim.campaign.result import good_floats
from swimbladder.sim.campaign.run import Fact
from swimbladder.sim.campaign.sobol import Design, Index, indices

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Output:
    """An output and its indices, one for each group of inputs; none where `why` says why.

    mean, std: over the independent floats of which it is known.
    """

    name: str
    unit: str
    mean: float
    std: float
    indices: tuple[Index, ...]
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Indices of the outputs of a design's floats; table [floats, Fact.COUNT]."""

    design: Design
    table: Array
    energy_unknown: str

    @property
    def independent(self) -> Array:
        """The floats that are drawn independently of each other, without those of A and B mixed."""
        found: Array = self.table.reshape(self.design.rows, self.design.width, -1)[:, :2]
        return found.reshape(2 * self.design.rows, -1)

    @cached_property
    def outputs(self) -> list[Output]:
        """Failed flights, and what is known of every flight."""
        return [self._output(*one) for one in self._values()]

    def _values(self) -> Iterator[tuple[str, str, Array]]:
        t = self.table
        yield "failed flights", "1", np.where(good_floats(t), 0.0, 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            energy = t[:, Fact.DRAWN] / np.where(t[:, Fact.CYCLES] > 0.0, t[:, Fact.CYCLES], np.nan)
        if not self.energy_unknown:
            yield "energy per cycle", "J", energy
        yield "time to depth", "s", t[:, Fact.ARRIVAL]
        yield "holding error", "m", t[:, Fact.HOLDING]
        yield "stroke margin", "m3", t[:, Fact.MARGIN]

    def _output(self, name: str, unit: str, values: Array) -> Output:
        by_row = values.reshape(self.design.rows, self.design.width)
        alone = by_row[:, :2].ravel()
        known = alone[np.isfinite(alone)]
        lost = int(np.sum(~np.isfinite(values)))
        why, found = "", list[Index]()
        if lost == len(values):
            why = "no flight has it"
        elif lost:
            why = (
                f"{lost} of {len(values)} flights have none: without them, or with something in "
                "their place, the indices would be those of another question"
            )
        elif np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
            why = "it is the same in all flights"
        else:
            found = indices(by_row, seed=self.design.seed)
        return Output(
            name=name, unit=unit, indices=tuple(found), why=why,
            mean=float(np.mean(known)) if known.size else float("nan"),
            std=float(np.std(known, ddof=1)) if known.size > 1 else float("nan"),
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """Return the indices as plain values."""
        return {
            "floats": self.design.floats,
            "rows": self.design.rows,
            "inputs": [list(group) for group in self.design.groups],
            "outputs": [
                {
                    "what": one.name, "unit": one.unit, "mean": one.mean, "std": one.std,
                    "why_none": one.why or None,
                    "indices": [
                        {"inputs": list(group), **found._asdict()}
                        for group, found in zip(self.design.groups, one.indices, strict=False)
                    ],
                }
                for one in self.outputs
            ],
        }  # fmt: skip
