"""`Tuning`: the gains that were found, for a person and for JSON, with what they guarantee."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from swimbladder.control.law import Law, Setting, leaves
from swimbladder.design.linear.sampled import BoundLaw, SampledLoop
from swimbladder.design.tuning import gains, trial
from swimbladder.design.tuning.margins import MARGINS, loops, margin_words
from swimbladder.errors import NoAnswerError
from swimbladder.io.answers import Answer, as_json
from swimbladder.physics.dynamics import Plant
from swimbladder.units import rounded, say
from swimbladder.vehicle import Vehicle

_say = partial(say, "design", "tuning")

_WIDER = 3.0  # times the rms of a hold, that a band has to be to stand out from it


@dataclass(frozen=True, kw_only=True)
class Tuning(gains.Found, Answer):
    """A law with its gains, the margins that they guarantee, and what trials gave.

    margins: the worst over the region, at the command and at the measured depth. nominal and
    region: trials of the nominal vehicle and of vehicles drawn from the region, with the supply
    low. least: the least time of the step that any controller could take. waves: share of half
    hours in which waves alarm the supervisor. unmet: what the gains do not keep, in words; limit:
    what is in the way.
    """

    result_vehicle: Vehicle = field(repr=False)  # with the controller, whether proven or not
    law: Law
    goal: str
    setting: Setting  # what the gains were made from
    shown: tuple[trial.Runs, trial.Runs]  # a few runs: nominal, and over the region
    step: trial.Step
    sample_time: float  # s
    delay: float  # s
    depths: tuple[float, ...]  # m, that it is for
    judged: tuple[float, ...]  # m, where margins were computed
    supply: float  # V, the least assumed
    held: float  # m rms, that holding a depth was allowed; 0: the goal is fast
    assumptions: tuple[str, ...]
    plants: tuple[Plant, ...]  # of the region, the nominal one first
    band: float = 0.0  # m, of a law of volume changes: within which a flight has arrived
    least: float = math.nan  # s; nan where it does not count
    ballast: float = 0.0  # m3, that it was off; 0: was not tried
    waves: float = math.nan
    unmet: tuple[str, ...] = ()
    limit: str = ""
    choice: str = ""  # why this law, where none was named
    unfit: Mapping[str, str] = field(default_factory=dict)  # and why others have no gains for this

    @property
    def proven(self) -> bool:
        """Whether the gains keep all that gains for this goal have to."""
        return not self.unmet

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle with the controller found; raises NoAnswerError where it is not proven."""
        self.check()
        return self.result_vehicle

    def check(self) -> None:
        """Raise NoAnswerError where the gains do not keep what they have to, with what limits."""
        if self.unmet:
            raise NoAnswerError(self.verdict)

    @property
    def verdict(self) -> str:
        """What the gains do not keep, and what limits them; empty where they are proven."""
        if not self.unmet:
            return ""
        what = f"The best gains of the law {self.law.name} for {self.goal} are unproven"
        return f"{what}: {'; '.join(self.unmet)}. {self.limit}"

    def loops(self) -> tuple[SampledLoop, ...]:
        """Return the linear loops that the margins are of: none where there are no margins.

        They are those of all `plants` at the first depth, then at the next.
        """
        if self.margins is None:
            return ()
        bound = BoundLaw(self.law, self.parameters, self.sample_time).without_rest
        return tuple(loops(bound, self.plants, depths=self.judged, delay=self.delay))

    @property
    def _low(self) -> str:
        own = self.result_vehicle.supply
        if not math.isfinite(self.supply) or own is None:
            return ""
        full = "" if self.supply == own.voltage or self.band else f" or {own.voltage:.3g}"
        return f" with the supply at {self.supply:.3g}{full} V"

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know first."""
        named = ((name, why.rstrip(".")) for name, why in self.unfit.items())
        unfit = (f"The law {name} does not fit: {why}." for name, why in named)
        first = (*filter(None, (self.verdict, self.choice)), *unfit)
        if self.law.ways is not None:
            return (*first, *self._float_sentences)
        m, r, n = self.margins, self.region, self.nominal
        median, most, slowest = map(_seconds, (n.settle_median, r.settle_95, r.slowest))
        settled = _say("settles", t=self, median=median, most=most, slowest=slowest)
        held = _say("is held", t=self, hour=_hourly(r))
        if math.isfinite(self.least):
            settled += f" No controller can do it in less than {self.least:.4g} s."
        sentences = [*first, settled, held]
        band = 0.02 * abs(self.step.target - self.step.start)
        if band < _WIDER * r.rms:
            sentences.insert(-1, _say("short step", band=band))
        if math.isfinite(r.energy):
            joules, power = rounded(r.energy, 3), rounded(1e3 * r.power, 3)
            sentences.append(_say("motor takes", joules=joules, power=power, step=self.step))
        if self.ballast and math.isfinite(r.ballast):
            off = f"With its ballast off by {1e6 * self.ballast:.3g} g to either side"
            sentences.append(f"{off} it settles in {r.ballast:.1f} s.")
        if math.isfinite(self.waves):
            share = f"takes over in {100.0 * self.waves:.0f} % of them"
            over = share if self.waves else "never takes over"
            sentences.append(f"In half hours in waves of 1 m the supervisor {over}.")
        if m is None:
            sentences.append(_NO_MARGINS)
        else:
            sentences.append(f"Over {len(self.plants)} vehicles of the region: {margin_words(m)}.")
        return tuple(sentences)

    @property
    def _float_sentences(self) -> tuple[str, ...]:
        n, r = self.nominal, self.region
        low, high = sorted((self.step.start, self.step.target))
        median, most = map(_hours, (n.settle_median, r.settle_95))
        sentences = [_say("arrives", t=self, low=low, high=high, median=median, most=most)]
        sentences.append(_say("stays", t=self, hour=_hourly(r)))
        if math.isfinite(r.energy):
            sentences.append(_say("drive takes", t=self, hour=_hourly(r)))
        return (*sentences, _say("decisions decay", plants=len(self.plants), radius=self.radius))

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON; None where a run never settles."""
        return {
            "vehicle": self.result_vehicle.name,
            "law": self.law.name,
            **as_json(self, _ASKED_FOR),
            "hold_m": self.held or None,
            "parameters": {
                name: {"value": float(value), "unit": self.law.units[name]}
                for name, value in leaves(self.parameters).items()
            },
            "tuning": self.tuning._asdict(),
            "margins": self.margins
            and {**as_json(self.margins, MARGINS), "vehicles": len(self.plants)},
            **({} if math.isnan(self.radius) else {"decision_eigenvalue": self.radius}),
            "nominal": as_json(self.nominal, TRIAL),
            "region": as_json(self.region, TRIAL),
            **as_json(
                self, "proven unmet limit choice unfit least_time_s=least waves ballast_m3=ballast"
            ),
            **as_json(self.region, "settle2_off_ballast_s=ballast"),
        }


_ASKED_FOR = "goal sample_time_s computation_delay_s=delay depths_m supply_V step assumptions"
TRIAL = (
    "runs settled settle2_median_s=settle_median settle2_95_s=settle_95 settle2_all_s=slowest "
    "overshoot_median overshoot_95 rms_m volume_rate_m3_s=rate starts_1_s turns_1_s energy_J "
    "power_W"
)
"""Numbers of a trial, as `io.answers.as_json` takes them."""


def _hourly(r: trial.Trial) -> trial.Trial:
    """Return a trial with what it moves [m3], starts, turns and takes [J] in an hour."""
    names = ("rate", "starts", "turns", "power")
    return r._replace(**{name: 3600.0 * getattr(r, name) for name in names})


def _hours(x: float) -> str:
    return f"{x / 3600.0:.3g} h" if math.isfinite(x) else "more than the time watched"


def _seconds(x: float) -> str:
    return f"{x:.1f} s" if math.isfinite(x) else "more than the time watched"


_NO_MARGINS = "The law is not linear around rest and has no margins: only trials judge it."
