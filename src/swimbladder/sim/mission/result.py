"""A mission flown, from vehicle, phases and water to numbers and sentences."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swimbladder.control.supervisor import Reason
from swimbladder.errors import check_counts
from swimbladder.io.answers import Answer, attributes
from swimbladder.io.mission import Mission
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.arrays import Array
from swimbladder.physics.hull import linear_psi
from swimbladder.physics.seawater import Cast
from swimbladder.sim.closed_loop.supervision import Alarm
from swimbladder.sim.engine.rodas.records import OF_DRIVE, Account, Ice, Note, Stop
from swimbladder.sim.mission.balance import (
    MissionBalance,
    battery_life,
    close_balance,
    drawn_energy,
)
from swimbladder.sim.mission.core.phases import Holding
from swimbladder.sim.mission.flight import Flight, Reach, fly_mission
from swimbladder.sim.mission.orders import law_facts
from swimbladder.sim.mission.prepare import water_of
from swimbladder.sim.mission.words import holding_words, note_words, reason_words, span_words
from swimbladder.vehicle import Vehicle

if TYPE_CHECKING:
    import xarray as xr

_ASKED = (
    "vehicle=flight.vehicle.name mission=flight.mission.name water=flight.column.source sentence "
    "completed"
)
_FLOWN = (
    "supervised=flight.plan.supervised alarm laws reasons notes cycles duration_s=flight.duration"
)
_HELD = (
    "held stroke_margin=reach.margin stroke_margin_flown=flown_margin least_volume=reach.least "
    "most_volume=reach.most"
)
_ENERGY = (
    "battery_J=balance.battery drawn_J=balance.drawn drive_per_cycle_J battery_cycles "
    "battery_left=_left sinks_J=balance.sinks"
)
_TIMES = (Account.PUMP_TIME, Account.VALVE_TIME, Account.STALLED)
_BACK = 0.5  # m below where it turned back, it has


@dataclass(frozen=True)
class MissionResult(Answer):
    """A flight, what it took of the stroke, and what follows."""

    flight: Flight
    reach: Reach

    @cached_property
    def balance(self) -> MissionBalance:
        """Volume and energy, and what does not add up."""
        return close_balance(self.flight)

    @property
    def completed(self) -> bool:
        """Whether every cycle that was asked for was flown, with every phase done."""
        done = self.flight.stop is Stop.FINISHED and not self.missed and not self.not_held
        return done and self.ice_least > self.flight.vehicle.hull.emergence_depth

    @property
    def not_held(self) -> dict[str, int]:
        """In how many cycles each park and hold was in its tolerance for too little time."""
        return self._counts("not_held")

    def _counts(self, column: str) -> dict[str, int]:
        bits = self.flight.cycles[column].astype(np.int64)
        counts = {
            title: int(np.sum(bits >> n & 1)) for n, title in enumerate(self.flight.mission.titles)
        }
        return {name: count for name, count in counts.items() if count}

    @cached_property
    def held(self) -> dict[str, dict[str, float]]:
        """How each park and hold went, by its title, over the time since its arrivals.

        share: of that time within its tolerance [-]; rms and farthest [m] from its depth.
        """
        kept = self.flight.accounts[len(Account) :].reshape(-1, len(Holding))
        return {
            title: {
                "share": float(one[Holding.INSIDE] / one[Holding.TIME]),
                "rms": float(np.sqrt(one[Holding.SQUARES] / one[Holding.TIME])),
                "farthest": float(one[Holding.MOST]),
            }
            for title, phase, one in zip(
                self.flight.mission.titles, self.flight.mission.phases, kept, strict=True
            )
            if phase.kind in ("park", "hold") and one[Holding.TIME] > 0.0
        }

    @property
    def flown_margin(self) -> float:
        """Share of the stroke that was left at the nearer end, below where it dives and fills."""
        stroke = self.flight.vehicle.stroke
        rows = self.flight.rows
        deep = rows["v"][rows["z"] > self.flight.plan.given["shallow"]]
        if deep.size == 0:
            return 1.0
        left = min(stroke.maximum - float(deep.max()), float(deep.min()) - stroke.minimum)
        return left / (stroke.maximum - stroke.minimum)

    @property
    def holding(self) -> list[str]:
        """How each park and hold went, in sentences."""
        return holding_words(self)

    @property
    def notes(self) -> list[str]:
        """What of the vehicle's file changes nothing here, and what the answer hides."""
        return note_words(self)

    @cached_property
    def laws(self) -> list[dict[str, Any]]:
        """The law of each phase, its parameters and where they come from."""
        f = self.flight
        return law_facts(f.vehicle, f.mission, supervised=f.plan.supervised)

    @property
    def alarm(self) -> Alarm | None:
        """Why and when the supervisor took over; None: it did not, or there is none."""
        notes = self.flight.notes
        for note in notes[notes["what"] == Note.ALARM]:
            return Alarm(Reason(int(note["number"])), float(note["t"]))
        return None

    @cached_property
    def grounded(self) -> dict[str, list[float]]:
        """Depths [m] at which the vehicle took itself to be grounded, by the phase's title."""
        return self._on_bottom(Note.GROUNDED, "z")

    @cached_property
    def shifted(self) -> dict[str, list[float]]:
        """Depths [m] above the bottom at which phases went on, by their title."""
        return self._on_bottom(Note.SHIFTED, "number")

    def _on_bottom(self, what: Note, column: str) -> dict[str, list[float]]:
        notes, found = self.flight.notes, dict[str, list[float]]()
        phase = 0
        for note in notes[np.isin(notes["what"], (Note.GROUNDED, Note.SHIFTED))]:
            if note["what"] == Note.GROUNDED:
                phase = int(note["number"])
            if note["what"] == what:
                title = self.flight.mission.titles[phase]
                found.setdefault(title, []).append(float(note[column]))
        return found

    @property
    def ice(self) -> list[Ice]:
        """What it did, each time that there may have been ice."""
        notes = self.flight.notes
        return [Ice(int(number)) for number in notes["number"][notes["what"] == Note.ICE]]

    @cached_property
    def ice_least(self) -> float:
        """Least depth to which it rose after it had turned back for ice [m]; inf: it never did."""
        rows, notes, least = self.flight.rows, self.flight.notes, np.inf
        turns = notes[(notes["what"] == Note.ICE) & (notes["number"] != Ice.PASSED)]
        at = np.append(np.searchsorted(rows["t"], turns["t"]), len(rows))
        for z, (begin, end) in zip(turns["z"], pairwise(at), strict=True):
            after = rows["z"][begin:end]
            deeper = np.flatnonzero(after > z + _BACK)
            rose = after[: deeper[0] if len(deeper) else len(after)]
            least = min(least, float(z), float(rose.min(initial=np.inf)))
        return least

    @property
    def cycles(self) -> int:
        """Whole cycles flown."""
        return int(self.flight.whole["cycle"])

    @property
    def missed(self) -> dict[str, int]:
        """How often each phase ran out of time, by its title."""
        return self._counts("missed")

    @property
    def energy_known(self) -> bool:
        """Whether the drive's electrical energy is known."""
        return not self.flight.plan.energy_known

    @property
    def arrival(self) -> float | None:
        """Time to the first phase's depth, of the first cycle [s]; None: never, or none."""
        first = float(self.flight.cycles["arrival"][0])
        return None if np.isnan(first) else first

    def per_cycle(self, *accounts: Account) -> Array:
        """Return the sum of some accounts in each cycle [n]."""
        table = self.flight.cycles["accounts"]
        return np.diff(sum(table[:, int(a)] for a in accounts), prepend=0.0)

    @property
    def drive_per_cycle(self) -> float:
        """Energy of pump, valve and holding in a cycle, mean [J]."""
        energy = self.per_cycle(*OF_DRIVE)
        return float(np.mean(energy[: max(self.cycles, 1)]))

    @cached_property
    def battery_cycles(self) -> int | None:
        """Cycles that a full battery lasts, as of `battery_life`; None: not known."""
        f = self.flight
        return battery_life(f.plan, f.mission, f.cycles, stop=f.stop, whole=self.cycles)

    @property
    def sentence(self) -> str:
        """The answer in a sentence."""
        first = self.flight.mission.phases[0]
        parts = []
        if first.depth is not None:
            parts.append(
                f"reaches {first.depth:g} m in {span_words(self.arrival)}"
                if self.arrival is not None and self.flight.stop is not Stop.LOST
                else f"does not reach {first.depth:g} m"
            )
        if self.energy_known and self.cycles:
            parts.append(f"{_joules(self.drive_per_cycle)} per cycle for the drive")
        if self.battery_cycles is not None:
            parts.append(f"{self.battery_cycles} cycles on this battery")
        answer = ", ".join(parts)
        stroke = self.flight.vehicle.stroke
        length = 1e6 * (stroke.maximum - stroke.minimum)
        planned, flown = 100.0 * self.reach.margin, 100.0 * self.flown_margin
        margin = (
            f"stroke margin {planned:.0f} % of {length:.4g} cm3 as planned, {flown:.0f} % flown"
        )
        return f"{answer}; {margin}" if answer else margin

    @property
    def reasons(self) -> list[str]:
        """Why the mission ended, and what was not met on the way."""
        return reason_words(self)

    def dataset(self, **given: Any) -> xr.Dataset:
        """Return what mission.nc has, in the terms of OG 1.0.

        given: begin, latitude and longitude, as `og1_dataset` takes them.
        """
        from swimbladder.sim.mission.export import og1_dataset

        return og1_dataset(self, **given)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain values, SI."""
        f, a = self.flight, self.flight.accounts
        deepest = float(np.max(f.cycles["deepest"]))
        energy = attributes(self, _ENERGY)
        return {
            **attributes(self, _ASKED),
            "stop": f.stop.name.lower().replace("_", "-"),
            **attributes(self, _FLOWN),
            "deepest_m": deepest,
            **attributes(self, "arrival_s missed grounded_m"),
            "ice_turns": int(a[Account.ICE_TURNS]),
            "ice_least_m": self.ice_least if a[Account.ICE_TURNS] else None,
            "surfaced_under_ice": int(a[Account.UNDER_ICE]),
            **attributes(self, _HELD),
            "psi_m3_m": linear_psi(f.vehicle, f.column, min(deepest, f.column.deepest)),
            **{one.name.lower(): int(a[one]) for one in (Account.PUMP_RUNS, Account.VALVE_RUNS)},
            **{f"{one.name.lower()}_s": float(a[one]) for one in _TIMES},
            "energy_unknown": f.plan.energy_known or None,
            **(energy if self.energy_known else dict.fromkeys(energy)),
            **attributes(self, "energy_residue=balance.relative_residue volume_m3=balance.volume"),
            "steps": int(f.whole["steps"]),
        }

    @property
    def _left(self) -> float | None:
        full = float(self.flight.plan.given["charge"])
        if full <= 0.0 or not self.energy_known:
            return None
        return float(self.flight.end["charge"]) / full

    def charge(self) -> Array:
        """Return the share of the full battery that is left at each row [n]; nan: not known."""
        full = float(self.flight.plan.given["charge"])
        rows = self.flight.rows
        if full <= 0.0 or not self.energy_known:
            return np.full(len(rows), np.nan)
        return np.asarray(1.0 - drawn_energy(rows) / full)


def _joules(energy: float) -> str:
    """Return an energy with its unit: "36 J", "12.7 kJ"."""
    return f"{energy / 1e3:.3g} kJ" if abs(energy) >= 1e3 else f"{energy:.3g} J"


def mission(
    vehicle: Vehicle,
    mission: Mission,
    cast: Cast | None = None,
    *,
    seed: int | None = None,
    supervised: bool | None = None,
    keep: Path | None = None,
    advance: Advance = silent,
) -> MissionResult:
    """Simulate a mission of phases and cycles: depth, time, pump, battery.

    Parameters
    ----------
    vehicle, mission
        As `load_vehicle` and `load_mission` return them; `Mission.limited` has other cycles,
        `Mission.over` another bottom.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.
    seed
        Of the sensors' noise; none: they have neither noise nor quantum.
    supervised
        False: the laws fly alone. Else under the supervisor, where the vehicle's file has one.
    keep
        Folder of unfinished work: a flight that was killed goes on there.
    advance
        Called with the share of the mission that was flown since.

    Returns
    -------
    MissionResult
        The flight, whether it did what it should, and its energy.

    Raises
    ------
    InputError
        Vehicle, mission and water do not go together.
    NoAnswerError
        The mission cannot be done.
    """
    check_counts(seed=(seed, 0))
    flight = fly_mission(
        vehicle,
        mission,
        water_of(vehicle, mission, cast),
        seed=seed,
        supervised=supervised,
        keep=keep,
        advance=advance,
    )
    return MissionResult(flight, flight.reach)
