"""What tuning found, for a person, for JSON and as a vehicle that the other commands read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swimbladder.control.law import Law, Setting
from swimbladder.control.records import leaves
from swimbladder.design.tuning.gains import gains
from swimbladder.design.tuning.margins import MARGINS, Loop, Worst, decibels, loops
from swimbladder.design.tuning.trial import Step, Traces, Trial
from swimbladder.io.answers import as_json
from swimbladder.physics.dynamics import Plant
from swimbladder.vehicle import Vehicle

_MORE = 1.05  # times the rms that was asked for: as near as trials tell
_WIDER = 3.0  # times the rms of a hold, that a band has to be to be told from it


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """A law with its gains, the margins that they guarantee, and what trials gave.

    vehicle: the one that was given, with the controller found. margins: the worst over the region,
    at the command and at the measured depth. nominal and region: trials of the vehicle as it is
    and of vehicles drawn from the region, with the supply low.
    """

    vehicle: Vehicle
    law: Law
    goal: str
    setting: Setting  # what the gains were made from
    knobs: Any
    parameters: Any
    margins: Worst | None  # None: a law without a linear form around rest
    nominal: Trial
    region: Trial
    shown: tuple[Traces, Traces]  # a few runs: nominal, and over the region
    step: Step
    sample_time: float  # s
    delay: float  # s
    depths: tuple[float, ...]  # m, that it is for
    judged: tuple[float, ...]  # m, where margins were computed
    supply: float  # V, the least reckoned with
    held: float  # m rms, that holding a depth was allowed; 0: the goal is fast
    assumptions: tuple[str, ...]
    plants: tuple[Plant, ...]  # of the region, the nominal one first
    radius: float = math.nan  # -, of a law of volume changes: largest eigenvalue over the region
    band: float = 0.0  # m, likewise: within which a flight has arrived

    def loops(self) -> tuple[Loop, ...]:
        """Return the linear loops that the margins are of: none where there are no margins."""
        if self.margins is None:
            return ()
        linear = gains(self.law.name, self.setting, self.knobs._replace(dead=0.0, pause=0.0))
        return tuple(
            loops(
                self.law, linear, self.plants, depths=self.judged, sample_time=self.sample_time,
                delay=self.delay,
            )
        )  # fmt: skip

    @property
    def _low(self) -> str:
        low = f" with the supply at {self.supply:.3g} V"
        return low if math.isfinite(self.supply) else ""

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know first."""
        if self.law.ways is not None:
            return self._float_sentences
        m, r, n = self.margins, self.region, self.nominal
        settled = (
            f"The step from {self.step.start:g} to {self.step.target:g} m settles to 2 % in "
            f"{_seconds(n.settle_median)} (median of {n.runs} runs of the nominal vehicle), "
            f"{_seconds(r.settle_95)} in 95 % of {r.runs} runs over the region{self._low}; "
            f"overshoot {100.0 * n.overshoot_median:.1f} % and "
            f"{100.0 * r.overshoot_95:.1f} %."
        )
        held = (
            f"Held at {self.step.target:g} m it stays within {1e3 * r.rms:.2g} mm rms and moves "
            f"{3.6e6 * r.rate:.2g} L of volume in {3600.0 * r.starts:.0f} starts from rest and "
            f"{3600.0 * r.turns:.0f} reversals an hour."
        )
        if 0.0 < self.held * _MORE < r.rms:
            held += (
                f" That is more than the {1e3 * self.held:.3g} mm that were asked for: nothing "
                "that was tried holds it better."
            )
        sentences = [settled, held]
        band = 0.02 * abs(self.step.target - self.step.start)
        if band < _WIDER * r.rms:
            sentences.insert(
                1,
                f"2 % of that step are {1e3 * band:.2g} mm, hardly more than it is held to: when "
                "it settles is hardly informative. Use a longer step (--step).",
            )
        if math.isfinite(r.energy):
            sentences.append(
                f"The motor takes {r.energy:.3g} J in the {self.step.duration / 60.0:.3g} min of a "
                f"trial and {1e3 * r.power:.3g} mW while it holds (region, at its terminals)."
            )
        if m is None:
            sentences.append(
                "The law is not linear around rest and has no margins: only trials judge it."
            )
        else:
            sentences.append(
                f"Over {len(self.plants)} vehicles of the region: gain {decibels(m.gain_up)} up "
                f"and {decibels(m.gain_down)} down, phase {math.degrees(m.phase):.0f} degrees, "
                f"{m.delay:.2g} s more delay, peak sensitivity {m.peak_sensitivity:.2f}, balanced "
                f"disk margin {m.disk:.2f}."
            )
        return tuple(sentences)

    @property
    def _float_sentences(self) -> tuple[str, ...]:
        n, r = self.nominal, self.region
        low, high = sorted((self.step.start, self.step.target))
        sentences = [
            f"Between {low:g} and {high:g} m it arrives within {self.band:.3g} m after "
            f"{_hours(n.settle_median)} (median of {n.runs} flights of the nominal vehicle, half "
            f"of them up), {_hours(r.settle_95)} in 95 % of {r.runs} flights over the region"
            f"{self._low}; {100.0 * r.settled:.0f} % of these arrive and stay, overshoot "
            f"{100.0 * r.overshoot_95:.1f} %.",
            f"There it stays within {r.rms:.2g} m rms with {3600.0 * r.starts:.2g} starts of the "
            f"pump and {3600.0 * r.turns:.2g} openings of the valve an hour, "
            f"{3600e6 * r.rate:.2g} cm3 an hour.",
        ]
        if math.isfinite(r.energy):
            sentences.append(
                f"Pump and valve take {r.energy:.3g} J in the {self.step.duration / 3600.0:.3g} "
                f"h of a flight and {3600.0 * r.power:.3g} J an hour while it holds (region, from "
                "the battery's cells)."
            )
        sentences.append(
            f"Over {len(self.plants)} vehicles of the region errors of the speed decay from one "
            f"decision to the next: the largest eigenvalue has the modulus {self.radius:.3f}."
        )
        return tuple(sentences)

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON; None where a run never settles."""
        return {
            "vehicle": self.vehicle.name,
            "law": self.law.name,
            **as_json(
                self,
                "goal sample_time_s computation_delay_s=delay depths_m supply_V step assumptions",
            ),
            "hold_m": self.held or None,
            "parameters": {
                name: {"value": float(value), "unit": self.law.units[name]}
                for name, value in leaves(self.parameters).items()
            },
            "knobs": self.knobs._asdict(),
            "margins": self.margins
            and {**as_json(self.margins, MARGINS), "vehicles": len(self.plants)},
            **({} if math.isnan(self.radius) else {"decision_eigenvalue": self.radius}),
            "nominal": as_json(self.nominal, TRIAL),
            "region": as_json(self.region, TRIAL),
        }


TRIAL = (
    "runs settled settle2_median_s=settle_median settle2_95_s=settle_95 overshoot_median "
    "overshoot_95 rms_m volume_rate_m3_s=rate starts_1_s turns_1_s energy_J power_W"
)
"""Numbers of a trial, as `io.answers.as_json` takes them."""


def _hours(x: float) -> str:
    return f"{x / 3600.0:.3g} h" if math.isfinite(x) else "more than the time watched"


def _seconds(x: float) -> str:
    return f"{x:.1f} s" if math.isfinite(x) else "more than the time watched"
