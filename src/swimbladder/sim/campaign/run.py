"""A campaign as a job: which floats there are, how one is flown, and what is kept of it.

What differs from float to float: trim, hull, drag, pump, mass, and the water it is in.

For Sobol indices floats are drawn by a design of their own. Which input, or group of correlated
ones, does the variance of an output come from? The first-order index is the share that goes when
the input is known, the total index the share that stays when all the others are (Saltelli et al.,
Comput. Phys. Commun. 181, 2010, 259). The noise of the sensors is an input like the others: it is
drawn anew for each float.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.errors import InputError, check_counts
from swimbladder.io.mission import Mission
from swimbladder.jobs import identity, software
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Column
from swimbladder.sim.campaign.store import CYCLES, FLOATS, Layout
from swimbladder.sim.engine.rodas.records import OF_DRIVE, OF_LOADS, Account, Stop, made
from swimbladder.sim.mission.balance import battery_life
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import check_flight, fly_mission
from swimbladder.sim.mission.law_flight import Pilot, pilot_of
from swimbladder.sim.mission.prepare import Plan, State, cost_words, first_state, make_plan
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.spread import INPUTS, Spread

_CUT = 3.0  # sigma; a share of -1 or a drag of 0 is no float


class Drawn(IntEnum):
    """What is drawn for a float."""

    TRIM = 0  # m3, more neutral volume
    PSI = 1  # m3/m, more of it per metre
    DRAG = 2  # -, factor
    PUMP = 3  # -, factor
    MASS = 4  # -, factor
    CAST = 5  # which water
    COUNT = 6


def draw(spread: Spread, *, seed: int, number: int, casts: int) -> Array:
    """Return what float `number` of a seed is like: of `Drawn`; the same in every campaign."""
    random = np.random.default_rng([seed, number])
    z = random.standard_normal(4)
    cast = float(random.integers(casts))
    return drawn_of(spread, np.append(z, random.standard_normal()), cast)


def drawn_of(spread: Spread, z: Array, cast: float) -> Array:
    """Return a float of standard normal numbers z [inputs] and its water: of `Drawn`."""
    if spread.correlation:
        values, vectors = np.linalg.eigh(spread.matrix)
        z = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T @ z
    middle = np.array([0.0, 0.0, 1.0, 1.0, 1.0])  # what is added, and factors
    wide = np.array([getattr(spread, name) for name in INPUTS])
    return np.append(middle + wide * np.clip(z, -_CUT, _CUT), cast)


def varied(plan: Plan, drawn: Array) -> Plan:
    """Return a plan for a float that differs so; the table is shared, not copied."""
    given = made(plan.given.dtype, plan.given)
    given["trim"] += drawn[Drawn.TRIM]
    given["give"] += drawn[Drawn.PSI]
    given["delivery"] *= drawn[Drawn.PUMP]
    given["mass"] *= drawn[Drawn.MASS]
    given["a_s"] /= drawn[Drawn.MASS]
    for place in ("d_l", "d_b", "d_0", "d_t"):
        given[place] *= drawn[Drawn.DRAG] / drawn[Drawn.MASS]
    return replace(plan, given=given)


_FEWEST = 16  # rows
_RESAMPLES = 999
_CAST, _NOISE = "cast", "sensor noise"


@dataclass(frozen=True)
class Design:
    """Floats in rows of 2 + groups: of matrix A, of B, and of A with one group's inputs from B.

    rows: a power of 2.
    """

    spread: Spread
    groups: tuple[tuple[str, ...], ...]
    rows: int
    casts: int
    seed: int

    @classmethod
    def of(cls, spread: Spread, *, casts: int, noisy: bool, seed: int, floats: int) -> Design:
        """Return the largest design of at most so many floats; raises InputError for too few."""
        groups: list[tuple[str, ...]] = [*spread.groups]
        groups += [(_CAST,)] * (casts > 1) + [(_NOISE,)] * noisy
        width = 2 + len(groups)
        if not groups:
            what = "nothing spreads, so that nothing can be sensitive to it"
            remedy = "Give a spread, like `trim='5 cm3'`"
            raise InputError(what, field="sensitivity", remedy=remedy)
        if floats < _FEWEST * width:
            what = f"too few floats for the indices of {len(groups)} inputs"
            remedy = f"Give {_FEWEST * width} at least; thousands say more"
            raise InputError(what, field="floats", value=floats, remedy=remedy)
        rows = 1 << ((floats // width).bit_length() - 1)
        return cls(spread, tuple(groups), rows, casts, seed)

    @property
    def width(self) -> int:
        """Floats of a row."""
        return 2 + len(self.groups)

    @property
    def floats(self) -> int:
        """How many floats it takes."""
        return self.rows * self.width

    @property
    def names(self) -> list[str]:
        """What the groups are called."""
        return [" and ".join(group) for group in self.groups]

    @cached_property
    def _points(self) -> Array:
        """Quasi-random points in the unit cube [rows, 2, inputs and cast]."""
        from scipy.stats import qmc

        size = len(INPUTS) + 1
        sobol = qmc.Sobol(2 * size, rng=np.random.default_rng([self.seed, self.rows]))
        return np.asarray(sobol.random(self.rows)).reshape(self.rows, 2, size)

    def drawn(self, number: int) -> tuple[Array, int]:
        """Return what float `number` is like: of `Drawn`, and the seed of its noise."""
        from scipy.special import ndtri

        row, block = divmod(number, self.width)
        chosen = self.groups[block - 2] if block >= 2 else ()
        inputs = (*INPUTS, _CAST)
        other = np.array([block == 1 or name in chosen for name in inputs])
        u = np.where(other, self._points[row, 1], self._points[row, 0])
        noise = 2 * row + (block == 1 or _NOISE in chosen)
        cast = float(min(int(u[-1] * self.casts), self.casts - 1))
        return drawn_of(self.spread, ndtri(np.clip(u[:-1], 1e-12, 1.0 - 1e-12)), cast), noise


class Index(NamedTuple):
    """Indices of an output for a group of inputs, with intervals of 95 %."""

    first: float
    first_ci95: tuple[float, float]
    total: float
    total_ci95: tuple[float, float]


def indices(values: Array, *, seed: int = 1) -> list[Index]:
    """Return the indices of an output for each group; its values are [rows, 2 + groups], finite.

    Intervals by a bootstrap over the rows, its 2.5 and 97.5 percentiles.
    """
    from scipy.stats import bootstrap, sobol_indices

    def both(chosen: NDArray[np.int64]) -> Array:
        """Return first-order and total indices [2, groups] of the chosen rows."""
        part = values[chosen]
        # twice the same output: with one alone SciPy drops an axis too many for a single input
        pair: Any = {
            "f_A": np.tile(part[:, 0], (2, 1)),
            "f_B": np.tile(part[:, 1], (2, 1)),
            "f_AB": np.repeat(part[:, None, 2:].T, 2, axis=1),
        }
        found = sobol_indices(func=pair, n=len(part))
        orders = (found.first_order, found.total_order)
        return np.array([np.reshape(order, (2, -1))[0] for order in orders])

    rows = np.arange(len(values))
    how: dict[str, Any] = dict(n_resamples=_RESAMPLES, vectorized=False, method="percentile")
    random = np.random.default_rng(seed)
    spread = bootstrap((rows,), both, confidence_level=0.95, rng=random, **how)
    low, high = spread.confidence_interval
    (first, total), ends = both(rows).tolist(), np.stack((low, high), axis=-1).tolist()
    firsts, totals = ([tuple(pair) for pair in of_order] for of_order in ends)
    return [Index(*index) for index in zip(first, firsts, total, totals, strict=True)]


CHUNK = 50  # floats at most
_PARTS = 16  # chunks that a small campaign has all the same
MOST = 1_000_000
_LONGEST = 100_000  # cycles


@dataclass(frozen=True, kw_only=True)
class Floats:
    """Floats of a vehicle on a mission, each a little different, in chunks that any process flies.

    columns: the waters that floats are drawn into. cycles, duration [s]: in place of the mission's.
    sensitivity: whether the floats are those of a design for Sobol indices, as many as fit into
    `floats`. store: the zarr folder of the results. supervised: as of `fly_mission`. Raises
    InputError for numbers out of range, for cycles without an end, and for a mission that the
    vehicle cannot do.
    """

    vehicle: Vehicle
    mission: Mission
    columns: Sequence[Column]
    floats: int
    store: Path
    seed: int = 1
    spread: Spread = field(default_factory=Spread)
    cycles: int | None = None
    duration: float | None = None
    sensitivity: bool = False
    supervised: bool | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be flown; the rest of the work knows that it can."""
        if not isinstance(self.store, str | Path):
            what, remedy = "no name of a folder", "Give the folder of the store"
            raise InputError(what, field="store", value=self.store, remedy=remedy)
        object.__setattr__(self, "store", Path(self.store))
        if not self.columns:
            what, remedy = "no water is given", "Give columns=[water_of(vehicle, mission)]"
            raise InputError(what, field="columns", remedy=remedy)
        check_counts(floats=(self.floats, 1, MOST), seed=(self.seed, 0))
        for column in self.columns:
            check_flight(self.vehicle, self.task, column)
        self._most_cycles()
        for column in self.columns:
            fly_mission(self.vehicle, self.task, column, cycles=1, supervised=self.supervised)
        _ = self.cost  # refuses what is too long

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process needs: plans are made there again."""
        return {key: value for key, value in vars(self).items() if key not in _MADE}

    @cached_property
    def plans(self) -> list[Plan]:
        """A plan for each water."""
        return [
            make_plan(self.vehicle, self.task, column, supervised=self.supervised)
            for column in self.columns
        ]

    @property
    def cost(self) -> list[str]:
        """What is worth a word of the samples of each float; raises as `cost_words`."""
        return [f"each float: {words}" for words in cost_words(self.task, self.plans[0].laws)]

    @property
    def task(self) -> Mission:
        """The mission with the cycles and the duration that are asked for."""
        return self.mission.limited(cycles=self.cycles, duration=self.duration)

    @cached_property
    def design(self) -> Design | None:
        """Which floats give the Sobol indices; None where that is not asked for."""
        if not self.sensitivity:
            return None
        sensors = self.vehicle.sensors
        noisy = sensors.depth_noise > 0.0 or sensors.volume_noise > 0.0
        return Design.of(
            self.spread, casts=len(self.columns), noisy=noisy, seed=self.seed, floats=self.floats
        )

    @cached_property
    def layout(self) -> Layout:
        """The shape of the store, and what it says of the campaign."""
        count = self.floats if self.design is None else self.design.floats
        energy = self.plans[0].energy_known
        return Layout(
            folder=self.store,
            floats=count,
            cycles=self._most_cycles(),
            chunk=min(max(math.ceil(count / _PARTS), 1), CHUNK),
            about={
                "vehicle": self.vehicle.name,
                "mission": self.mission.name,
                "waters": [column.source for column in self.columns],
                "casts": sum(column.cast is not None for column in self.columns),
                "seed": self.seed,
                "spread": self.spread.model_dump(mode="json"),
                "energy_unknown": energy,
                "supervised": self.plans[0].supervised,
            },
            hashes={
                "vehicle": identity(self.vehicle),
                "mission": identity(self.mission),
                "cast": identity(list(self.columns)),
                "seed": identity(self.seed),
                "spread": identity(self.spread),
                "number of floats": identity(self.floats),
                "cycles and duration": identity(self.cycles, self.duration),
                "kind of draws": identity(self.sensitivity),
                "supervisor": identity(self.plans[0].supervised),
                "version": software(),
            },
        )

    @property
    def name(self) -> str:
        """A name by which the same job is known everywhere."""
        return identity(self.layout.hashes)

    @property
    def count(self) -> int:
        """How many chunks there are."""
        return self.layout.count

    def check(self) -> bool:
        """Return whether the store is there; raises InputError where it is another campaign's."""
        return self.layout.check()

    def create(self) -> None:
        """Make the store where there is none yet."""
        self.layout.create()

    def do(self, chunk: int) -> None:
        """Fly the floats of a chunk and write them to the store."""
        numbers = self.layout.numbers(chunk)
        flown = [self._one(n) for n in numbers]
        floats = dict(zip(FLOATS, np.array([row for row, _ in flown]).T, strict=True))
        width = self.layout.cycles
        cycles = np.full((len(CYCLES), len(flown), width), np.nan)
        for n, (_, rows) in enumerate(flown):
            cycles[:, n, : len(rows)] = np.array(rows).reshape(-1, len(CYCLES)).T
        self.layout.write(chunk, floats | dict(zip(CYCLES, cycles, strict=True)))

    def done(self) -> set[int]:
        """Return the chunks that are done."""
        return self.layout.done()

    def _most_cycles(self) -> int:
        """Return how many cycles there can be: as many as asked for, or as fit into the time."""
        g, stages = self.plans[0].given, self.plans[0].stages
        last, span = float(g["last_cycle"]), float(g["last_time"])
        shortest = float(np.sum(stages["duration"]))
        if math.isfinite(span) and shortest > 0.0:
            last = min(last, math.floor(span / shortest) + 1.0)
        if last > _LONGEST:
            what = f"a float may do more than {_LONGEST} cycles"
            remedy = "Say how many cycles it does at most: `cycles=1000`"
            raise InputError(what, field="cycles", value=last, remedy=remedy)
        return int(last)

    def _one(self, number: int) -> tuple[list[float], list[list[float]]]:
        """Fly one float; return its row of `FLOATS`, and one of `CYCLES` for each cycle."""
        if self.design is None:
            drawn = draw(self.spread, seed=self.seed, number=number, casts=len(self.columns))
            noise = number
        else:
            drawn, noise = self.design.drawn(number)
        plan = varied(self.plans[int(drawn[Drawn.CAST])], drawn)
        seed = self.seed * MOST + noise
        x, at, accounts = state = first_state(plan, self.mission, seed=seed)
        pilot = pilot_of(self.vehicle, self.task, plan, state, seed=seed)
        flown = _cycles(plan, state, pilot)
        before, rows = np.zeros(len(Account)), list[list[float]]()
        low, high = math.inf, -math.inf
        for cycle in flown:
            now = cycle["accounts"]
            rows.append(_cycle(cycle, now - before, plan.given))
            before = now
            low = min(low, float(cycle["v_least"]))
            high = max(high, float(cycle["v_most"]))
        low, high = min(low, float(x["v_least"])), max(high, float(x["v_most"]))
        kept = np.array(rows).reshape(-1, len(CYCLES)).T
        by = dict(zip(CYCLES, kept, strict=True))
        held = accounts[len(Account) :].reshape(-1, len(Holding)).sum(axis=0)
        time = float(held[Holding.TIME])
        arrived = by["arrival"][np.isfinite(by["arrival"])].tolist()
        drive, other = _energies(accounts)
        g = plan.given
        stop, whole = Stop(int(at["stop"])), int(at["cycle"])
        life = battery_life(plan, self.mission, flown, stop=stop, whole=whole)
        return [
            *drawn,
            float(stop),
            float(whole),
            float(np.sum(by["phases_missed"])),
            sum(arrived) / len(arrived) if arrived else math.nan,
            max([0.0, *by["deepest"].tolist()]),
            float(x["t"]),
            drive,
            drive + other,
            float(accounts[Account.PUMP_RUNS]),
            *(float(np.mean(by[of][:whole])) if whole else math.nan for of in _SPENT),
            float(x["charge"]),
            math.sqrt(float(held[Holding.SQUARES]) / time) if time > 0.0 else math.nan,
            float(min(low - g["v_min"], g["v_max"] - high)),
            math.nan if life is None else float(life),
            *(float(accounts[one]) for one in _AVOIDED),
        ], rows


_MADE = ("plans", "design", "layout")
_SPENT = ("drive_energy", "battery_energy", "pump_runs")
_AVOIDED = (Account.GROUNDED, Account.ICE_TURNS, Account.UNDER_ICE)


def _cycles(plan: Plan, state: State, pilot: Pilot) -> list[np.record]:
    """Fly a float from a state, which is changed; return its cycles."""
    flown, found = plan.under_way(state), list[np.record]()
    stop = Stop.GOES_ON
    while stop is Stop.GOES_ON:
        flown.lane.counts[:] = 0
        stop = pilot.fly(flown)
        found.extend(flown.cycles[: flown.lane.counts[2]].copy())
    return found


def _energies(accounts: Array) -> tuple[float, float]:
    """Return the energy of the drive, and of all else [J]."""
    other = (*OF_LOADS, Account.SELF_DISCHARGED)
    return sum(float(accounts[a]) for a in OF_DRIVE), sum(float(accounts[a]) for a in other)


def _cycle(row: np.void, accounts: Array, given: np.record) -> list[float]:
    """Return what is kept of a cycle, in the order of `CYCLES`; accounts: of this cycle alone."""
    drive, other = _energies(accounts)
    late = int(row["missed"]) | int(row["not_held"])
    margin = min(row["v_least"] - given["v_min"], given["v_max"] - row["v_most"])
    return [
        float(row["t_begin"]),
        float(row["t_end"]),
        float(row["arrival"]),
        float(row["surfaced"]),
        float(row["deepest"]),
        float(late.bit_count()),
        float(margin),
        drive,
        drive + other,
        float(accounts[Account.PUMP_RUNS]),
        *(float(accounts[one]) for one in _AVOIDED),
    ]
