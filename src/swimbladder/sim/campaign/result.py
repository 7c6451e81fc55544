"""What became of the floats of a campaign, with intervals.

Sobol indices of its outputs say which inputs the outcome comes from.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, stdtrit

from swimbladder.io.answers import Answer, attributes
from swimbladder.io.mission import Mission
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Workers, run
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.seawater import Cast, Column
from swimbladder.sim.campaign.run import Design, Floats, Index, indices
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission.prepare import water_of
from swimbladder.sim.mission.words import REASONS
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.spread import Spread

Rows = NDArray[np.void]  # of `store.ROW`


def share_interval(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of Clopper and Pearson (Biometrika 26, 1934, 404) for a share."""
    low = betaincinv(count, total - count + 1, 0.025) if count else 0.0
    high = betaincinv(count + 1, total - count, 0.975) if count < total else 1.0
    return float(low), float(high)


def prediction_interval(values: Array) -> tuple[float, float]:
    """Return an interval that holds the next value of the same kind with a probability of 95 %.

    Parameters
    ----------
    values
        Values seen, 0 or more [n], 2 or more of them.

    Returns
    -------
    tuple of float
        Both ends. Each of the n + 1 gaps between sorted values is as likely to hold the next one,
        whatever the distribution: where there are enough values (39 for 95 %) the ends lie
        between those at the ranks that leave half of the rest on each side. Fewer values are taken
        to be log-normal: Student's t of their logarithms (Hahn and Meeker, Statistical Intervals,
        1991).
    """
    n, tail = len(values), 0.025
    if (n + 1) * tail > 1.0 - 1e-9:
        low, high = np.quantile(values, [tail, 1.0 - tail], method="weibull")
        return float(low), float(high)
    logs = np.log(values + _HALF)
    width = float(stdtrit(n - 1, 1.0 - tail) * np.std(logs, ddof=1)) * (1.0 + 1.0 / n) ** 0.5
    low, high = np.exp(np.mean(logs) + np.array([-width, width])) - _HALF
    return float(low), float(high)


_HALF = 0.5  # so that 0 has a logarithm


def good_floats(table: Rows) -> Flags:
    """Return which floats flew every cycle that was asked for, with every phase done."""
    return np.asarray((table["stop"] == Stop.FINISHED) & (table["phases_missed_in_all"] == 0.0))


_COLUMNS = (
    "trim_m3 psi_m3_m drag_factor pump_factor mass_factor cast stop cycles "
    "phases_missed=phases_missed_in_all arrival_s=arrival_mean deepest_m=deepest_of_all duration_s "
    "pump_runs=pump_runs_in_all holding_error_m stroke_margin_m3=stroke_margin_of_all"
)
_ENERGIES = "drive_J=drive_energy_in_all drawn_J=battery_energy_in_all battery_cycles"


class BatteryLife(NamedTuple):
    """Whole cycles on one battery.

    floats: whose life is known; flown_to_reserve: those of them that it was flown to the end of.
    prediction95: holds the life of the next float in 95 %.
    """

    floats: int
    flown_to_reserve: int
    median: float
    prediction95: tuple[int, int]


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


@dataclass(frozen=True)
class Sensitivity:
    """Indices of the outputs of a design's floats; table: [floats] of `store.ROW`.

    asked: how many floats were asked for.
    """

    design: Design
    table: Rows
    energy_unknown: str
    asked: int

    @property
    def good(self) -> Flags:
        """Which floats of the design did every phase of every cycle."""
        return good_floats(self.table)

    @property
    def sentence(self) -> str:
        """Say how many of the floats asked for were flown, and of which the shares are given."""
        d, count = self.design, int(np.sum(self.good))
        return (
            f"{d.floats} of the {self.asked} floats asked for were flown, {d.rows} (a power of 2) "
            f"rows of {d.width}: {count} did every phase of every cycle. Counts, shares and "
            f"numbers are of the {2 * d.rows} drawn independently, two of each row."
        )

    @property
    def independent(self) -> Rows:
        """The floats that are drawn independently of each other, without those of A and B mixed."""
        return self.table.reshape(self.design.rows, self.design.width)[:, :2].ravel()

    @cached_property
    def outputs(self) -> list[Output]:
        """Failed flights, and what is known of every flight."""
        return [self._output(*one) for one in self._values()]

    def _values(self) -> Iterator[tuple[str, str, Array]]:
        t = self.table
        yield "failed flights", "1", np.where(self.good, 0.0, 1.0)
        if not self.energy_unknown:
            yield "energy per cycle", "J", t["battery_energy_per_cycle"]
        yield "time to depth", "s", t["arrival_mean"]
        yield "holding error", "m", t["holding_error"]
        yield "stroke margin", "m3", t["stroke_margin_of_all"]

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
            name=name,
            unit=unit,
            indices=tuple(found),
            why=why,
            mean=float(np.mean(known)) if known.size else float("nan"),
            std=float(np.std(known, ddof=1)) if known.size > 1 else float("nan"),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the indices as plain values."""
        return {
            **attributes(self, "asked floats=design.floats"),
            "good": int(np.sum(self.good)),
            **attributes(self, "rows=design.rows inputs=design.groups"),
            "outputs": [
                {
                    **attributes(one, "what=name unit mean std"),
                    "why_none": one.why or None,
                    "indices": [
                        {"inputs": list(group), **found._asdict()}
                        for group, found in zip(self.design.groups, one.indices, strict=False)
                    ],
                }
                for one in self.outputs
            ],
        }


@dataclass(frozen=True, kw_only=True)
class Campaign(Answer):
    """Floats of one vehicle on one mission; table: [n] of `store.ROW`.

    supervised: whether the laws fly under the vehicle's supervisor. sensitivity: where the floats
    are those of a design drawn independently, what the outcome comes from.
    """

    vehicle: Vehicle
    mission: Mission
    columns: Sequence[Column]
    spread: Spread
    seed: int
    table: Rows
    energy_unknown: str
    supervised: bool = False
    sensitivity: Sensitivity | None = None

    @property
    def completed(self) -> bool:
        """Whether every float that was flown did every phase of every cycle."""
        return bool((self if self.sensitivity is None else self.sensitivity).good.all())

    @property
    def good(self) -> Flags:
        """Which floats flew every cycle that was asked for, with every phase done."""
        return good_floats(self.table)

    def shares(self) -> list[tuple[str, int, float, tuple[float, float]]]:
        """Return (what, floats, share, its 95 % interval) of every way it ended."""
        total, stop = len(self.table), self.table["stop"]
        late = self.table["phases_missed_in_all"] > 0.0
        found = [("every phase of every cycle done", int(np.sum(self.good)))]
        found.append(("a phase ran out of time, or was not held", int(np.sum(late))))
        found += [
            (REASONS[reason], int(np.sum(stop == reason)))
            for reason in Stop
            if reason is not Stop.GOES_ON and np.any(stop == reason)
        ]
        return [(words, n, n / total, share_interval(n, total)) for words, n in found]

    def numbers(self) -> list[tuple[str, str, Array]]:
        """Return (what, unit, of each float that has it [k]) of the numbers that floats have."""
        t = self.table
        found: list[tuple[str, str, Array]] = [
            ("cycles", "", t["cycles"]),
            ("arrives at the first depth in", "h", t["arrival_mean"] / 3600.0),
            ("deepest", "m", t["deepest_of_all"]),
            ("pump runs per cycle", "", t["pump_runs_per_cycle"]),
        ]
        if not self.energy_unknown:
            energies = {x: t[f"{x}_energy_per_cycle"] / 1e3 for x in ("drive", "battery")}
            found += [(f"{x}'s energy per cycle", "kJ", kJ) for x, kJ in energies.items()]
        found += [(words, "", values) for words, values in self._avoided.items()]
        known = [(words, unit, x[np.isfinite(x)]) for words, unit, x in found]
        return [one for one in known if one[2].size]

    def spreads(self) -> list[tuple[str, str, float, float, float]]:
        """Return (what, unit, median, 5 %, 95 %) of the numbers over all floats."""
        found = []
        for words, unit, values in self.numbers():
            low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
            found.append((words, unit, float(middle), float(low), float(high)))
        return found

    @property
    def battery_life(self) -> BatteryLife | None:
        """Cycles on one battery; None: not known of two floats."""
        life, stop = self.table["battery_cycles"], self.table["stop"]
        known = np.isfinite(life)
        if np.sum(known) < 2:
            return None
        low, high = np.round(prediction_interval(life[known]), 6)
        ended = np.isin(stop, (Stop.RESERVE, Stop.BATTERY_EMPTY))
        return BatteryLife(
            floats=int(np.sum(known)),
            flown_to_reserve=int(np.sum(ended)),
            median=float(np.median(life[known])),
            prediction95=(math.ceil(low), math.floor(high)),
        )

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        n, count = len(self.table), int(np.sum(self.good))
        low, high = share_interval(count, n)
        return (
            f"{count} of {n} floats did every phase of every cycle: {100.0 * count / n:.1f} % "
            f"({100.0 * low:.1f} to {100.0 * high:.1f} %)"
        )

    def by_float(self) -> dict[str, Array]:
        """Return the columns of floats.csv: a row per float."""
        t = self.table.view(np.recarray)
        found: dict[str, Array] = {"float": np.arange(1.0, len(t) + 1.0)}
        found |= attributes(t, _COLUMNS) | {"cast": t["cast"] + 1.0}
        found |= {} if self.energy_unknown else attributes(t, _ENERGIES)
        return found | {words.replace(" ", "_"): one for words, one in self._avoided.items()}

    @property
    def _avoided(self) -> dict[str, Array]:
        """How often each float met bottom and ice [n], where the mission looks for them."""
        t, found = self.table, dict[str, Array]()
        if self.mission.grounding is not None:
            found["times grounded"] = t["grounded_in_all"]
        if self.mission.ice is not None:
            found["ice turns"] = t["ice_turns_in_all"]
            found["surfacings under ice"] = t["surfaced_under_ice_in_all"]
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain values, SI but for what its unit says."""
        life = self.battery_life
        return {
            **attributes(self, "vehicle=vehicle.name mission=mission.name"),
            "waters": [column.source for column in self.columns],
            "supervised": self.supervised,
            "floats": len(self.table),
            **attributes(self, "seed sentence"),
            "good": int(np.sum(self.good)),
            "spread": self.spread.model_dump(mode="json", exclude={"schema_version"}),
            "shares": [
                {"what": words, "floats": n, "share": share, "ci95": list(interval)}
                for words, n, share, interval in self.shares()
            ],
            "numbers": [
                {"what": words, "unit": unit, "median": middle, "q05": low, "q95": high}
                for words, unit, middle, low, high in self.spreads()
            ],
            "battery_cycles": None if life is None else {"unit": "1", **life._asdict()},
            "energy_unknown": self.energy_unknown or None,
            **({} if self.sensitivity is None else {"sensitivity": self.sensitivity.to_dict()}),
        }


def campaign(
    floats: Floats, workers: Workers | None = None, advance: Advance = silent
) -> Campaign | None:
    """Fly many floats on a mission: how many do it, how long their batteries last.

    Parameters
    ----------
    floats
        The floats, their mission, waters and draws, and the store of their flights, in which a
        campaign that was killed goes on.
    workers
        Who flies them; none: a thread on each core.
    advance
        Called with the share of the floats that was flown since.

    Returns
    -------
    Campaign or None
        What became of the floats; None where `workers` left chunks to others.

    Raises
    ------
    InputError
        The store is another campaign's, or the executor cannot be had.
    NoAnswerError
        The workers died.
    """
    return result_of(floats) if run(floats, workers or Workers(), advance) else None


def waters_of(vehicle: Vehicle, mission: Mission, casts: Sequence[Cast]) -> list[Column]:
    """Return the waters of casts, or the vehicle's own, as deep as a mission goes."""
    return [water_of(vehicle, mission, cast) for cast in casts] or [water_of(vehicle, mission)]


def result_of(job: Floats) -> Campaign:
    """Return what became of the floats of a job all of which is done."""
    job.layout.tidy()
    table, unknown = job.layout.table(), job.plans[0].energy_known
    found = None
    if job.design is not None:
        found = Sensitivity(job.design, table, unknown, job.floats)
        table = found.independent
    return Campaign(
        vehicle=job.vehicle,
        mission=job.mission,
        columns=job.columns,
        spread=job.spread,
        seed=job.seed,
        table=table,
        energy_unknown=unknown,
        supervised=job.plans[0].supervised,
        sensitivity=found,
    )
