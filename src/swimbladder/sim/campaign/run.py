"""A campaign as a job: which floats there are, how one is flown, and what is kept of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.jobs import identity, software
from swimbladder.physics.arrays import Array
from swimbladder.physics.seawater import Column
from swimbladder.sim.campaign.draw import Design, Drawn, draw, varied
from swimbladder.sim.campaign.store import CYCLES, FLOATS, Layout
from swimbladder.sim.closed_loop.single import check_counts
from swimbladder.sim.engine.rodas.records import OF_DRIVE, OF_LOADS, Account, Stop
from swimbladder.sim.mission.balance import battery_life
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.law_flight import Pilot, pilot_of
from swimbladder.sim.mission.plan_check import check_flight
from swimbladder.sim.mission.prepare import Plan, State, cost_words, first_state, make_plan
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.spread import Spread

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
        if not 1 <= self.floats <= MOST:
            what, remedy = "must be a whole number from 1 to a million", "Give `floats=4000`"
            raise InputError(what, field="floats", value=self.floats, remedy=remedy)
        check_counts(floats=(self.floats, 1), seed=(self.seed, 0))
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
            float(x["charge"]),
            math.sqrt(float(held[Holding.SQUARES]) / time) if time > 0.0 else math.nan,
            float(min(low - g["v_min"], g["v_max"] - high)),
            math.nan if life is None else float(life),
            *(float(accounts[one]) for one in _AVOIDED),
        ], rows


_MADE = ("plans", "design", "layout")
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
