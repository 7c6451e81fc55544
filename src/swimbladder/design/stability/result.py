"""What `stability` found, in sentences and for JSON.

What `stability` found, as tables.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from swimbladder.design.stability.around import Around, Decided, Mode
from swimbladder.design.stability.confirm import Confirmed
from swimbladder.design.stability.recover import Map, Verdict
from swimbladder.design.stability.robust import Stood
from swimbladder.design.tuning.margins import MARGINS, decibels, falls_short
from swimbladder.io.answers import as_json
from swimbladder.units import length


@dataclass(frozen=True, kw_only=True)
class Stability:
    """All that was found; parts that were not asked for are empty."""

    vehicle: str
    law: str
    sample_time: float  # s
    depths: tuple[float, float]  # m
    depth: float  # m, at which limit cycles were looked at
    words: tuple[str, ...]  # what the region is
    around: Around | None  # None: the law is not linear around rest
    cycles: tuple[Confirmed, ...]
    maps: tuple[Map, ...]
    within: float  # s
    band: float  # m
    stood: tuple[Stood, ...]
    unmet: tuple[str, ...]  # what could not be looked at, and why
    decided: Decided | None = None  # of a law of volume changes, in the place of `around`
    beyond: str = ""  # why part of the depths asked for is out of reach, whatever the law

    @property
    def stable(self) -> bool:
        """Whether small disturbances decay wherever it was looked; where not linear, any step."""
        if self.decided is not None:
            return self.decided.stable
        if self.around is not None:
            return self.around.stable
        return not any(m.name == "steps" and m.count(Verdict.RECOVERED) == 0 for m in self.maps)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know, in order."""
        return (
            *((self.beyond,) if self.beyond else ()),
            *self._small(), *map(_cycle_words, self.cycles), *map(self._map_words, self.maps),
            *self._stood_words(), *self.unmet,
        )  # fmt: skip

    def _small(self) -> tuple[str, ...]:
        a = self.around
        low, high = self.depths
        if self.decided is not None:
            return self.decided.sentences(self.depths)
        if a is None:
            return (
                f"The law {self.law} is not linear around rest: it has no eigenvalues and no "
                "margins. What follows is by simulation.",
            )
        if not a.stable:
            return (
                f"UNSTABLE: with {a.worst_spot.words} small disturbances grow, the largest "
                f"eigenvalue has the modulus {a.radius:.4f}.",
                "A shorter sample time, less delay between sample and command, or gains tuned for "
                "this region (swimbladder tune) would hold it.",
            )
        m = a.margins
        short = falls_short(m)
        mode, spot = a.slowest
        damped, where = a.least_damped
        deep = "the same at all depths" if a.same_at_all_depths else "not the same at all depths"
        return (
            f"Small disturbances decay from {low:g} to {high:g} m over the region: the largest "
            f"eigenvalue found has the modulus {a.radius:.5f} ({a.worst_spot.words}), with "
            f"{1e3 * a.delay:.3g} ms from a sample to its command.",
            f"Looked at: {a.looked} loops of the region, then {a.searched} in a search for the "
            f"worst; {deep}. It is the worst that was found, not a proof over the region.",
            f"The slowest mode decays e-fold in {_time(mode)} ({spot.words}); the least damped "
            f"oscillates every {_period(damped)} with a damping of {damped.damping:.2f} "
            f"({where.words}).",
            f"Worst margins: gain {decibels(m.gain_up)} up and {decibels(m.gain_down)} down, phase "
            f"{math.degrees(m.phase):.0f} degrees, {m.delay:.2g} s more delay, peak sensitivity "
            f"{m.peak_sensitivity:.2f}, balanced disk margin {m.disk:.2f}"
            + (f"; less than is wanted: {', '.join(short)}." if short else ", as is wanted."),
            f"With a whole sample of delay the nominal loop's largest eigenvalue is "
            f"{modulus(a.whole_sample_radius)}: "
            + ("unstable." if a.whole_sample_radius >= 1.0 else "still stable."),
        )

    def _map_words(self, m: Map) -> str:
        said = (
            f"{m.title[0].upper()}{m.title[1:]}: of {m.asked} runs {m.count(Verdict.RECOVERED)} "
            f"are within {length(self.band, small='cm')} in {self.within:g} s and stay, "
            f"{m.count(Verdict.SLOW)} later, {m.count(Verdict.UNSETTLED)} are not there in "
            f"{3.0 * self.within:g} s, {m.count(Verdict.LOST)} are lost"
        )
        hopeless = int((m.hopeless & (m.verdicts != int(Verdict.NOT_ASKED))).sum())
        return f"{said}; from {hopeless} of them no controller could come back."

    def _stood_words(self) -> tuple[str, ...]:
        said = []
        for law in dict.fromkeys(s.law for s in self.stood):
            own = [s for s in self.stood if s.law == law]
            bad = [s for s in own if s.settled < 1.0]
            grows = [s for s in own if s.radius >= 1.0]
            what = (
                f"{law}: all {own[0].draws} draws settle with every gain from "
                f"{min(s.gain for s in own):g} to {max(s.gain for s in own):g}, without and with "
                f"{own[-1].delay:g} s of extra delay."
            )
            if bad:
                cases = ", ".join(
                    f"{100.0 * s.settled:.0f} % at gain {s.gain:g}{_late(s)}" for s in bad
                )
                what = f"{law}: not all of {own[0].draws} draws settle: {cases}."
            if grows:
                moved = max(3.6e6 * s.moved_95 for s in grows)
                what += (
                    " Linearly it is unstable over the region with "
                    + ", ".join(f"gain {s.gain:g}{_late(s)}" for s in grows)
                    + f": the motor then goes to and fro without end (up to {moved:.3g} L an hour),"
                    " whatever the depth does."
                )
            said.append(what)
        return tuple(said)

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            **as_json(self, "vehicle law sample_time_s depths_m stable sentences region=words"),
            "linear": None if self.around is None else _around(self.around),
            **({} if self.decided is None else {"decisions": self.decided.to_json()}),
            "cycles_depth_m": self.depth,
            "cycles": [_cycle(c) for c in self.cycles],
            **as_json(self, "within_s band_m robustness=stood"),
            "maps": [
                {
                    "name": m.name, "title": m.title, "runs": m.asked,
                    **{v.name.lower(): m.count(v) for v in Verdict if v is not Verdict.NOT_ASKED},
                }
                for m in self.maps
            ],
        }  # fmt: skip


_MODE = "frequency_rad_s damping time_constant_s"


def _around(a: Around) -> dict[str, Any]:
    return {
        **as_json(
            a,
            "largest_eigenvalue=radius worst_at=worst_spot loops=looked loops_searched=searched "
            "computation_delay_s=delay largest_eigenvalue_with_a_sample_of_delay="
            "whole_sample_radius",
        ),
        "margins": as_json(a.margins, MARGINS),
        **{
            name: as_json(mode, _MODE) | {"at": spot._asdict()}
            for name, (mode, spot) in (("slowest", a.slowest), ("least_damped", a.least_damped))
        },
        "searches": [as_json(f, "measure on_grid searched at=spot") for f in a.found],
    }


def _cycle(c: Confirmed) -> dict[str, Any]:
    p, s = c.predicted, c.seen
    of_cycle = (
        "amplitude period_s stable third_harmonic=third amplitude_error period_error believed"
    )
    return {
        **as_json(p, "source size unit broken_at=place"),
        "predicted": p.cycle
        and as_json(p.cycle, of_cycle) | {"depth_amplitude_m": p.depth_amplitude},
        "simulated": s and as_json(s, "cycles depth_amplitude_m=amplitude period_s farthest_m"),
        "relative_error": dict(zip(("amplitude", "period"), c.errors, strict=True)),
    }


def _cycle_words(c: Confirmed) -> str:
    p, s = c.predicted, c.seen
    shown = {"V": (1.0, "V"), "m": (1e3, "mm"), "m3": (1e6, "cm3"), "m3/m": (1e6, "cm3/m")}
    factor, unit = shown.get(p.unit, (86400e6, "cm3 a day"))
    head = f"{p.source[0].upper()}{p.source[1:]} ({factor * p.size:.3g} {unit})"
    who = "the describing function"
    if p.place == "decision":
        who = "the balance from decision to decision"
    if p.cycle is None:
        seen = "" if s is None else (
            f"; the simulation goes to and fro by {1e3 * s.amplitude:.3g} mm every {s.period:.3g} s"
            if s.cycles
            else "; in the simulation none is left, and the depth is within "
            f"{length(s.farthest, 2)}"
        )  # fmt: skip
        return f"{head}: {who} predicts no limit cycle{seen}."
    if p.bound:
        most = f"{head}: {length(p.depth_amplitude)} to either side at most"
        if not math.isnan(p.cycle.period):
            most += f", every {p.cycle.period:.3g} s at most"
        if s is None or not s.cycles:
            return f"{most}; the flight comes to rest."
        return f"{most}; the flight has {length(s.amplitude)} every {s.period:.3g} s."
    kind = "a limit cycle" if p.cycle.stable else "the edge of what decays, an unstable cycle,"
    said = (
        f"{head}: {who} predicts {kind} of {length(p.depth_amplitude)} every {p.cycle.period:.3g} s"
    )
    if not p.cycle.believed:
        said += (
            f", and cannot be relied on: its error may be {100 * p.cycle.amplitude_error:.0f} % of "
            f"amplitude and {100 * p.cycle.period_error:.0f} % of period by the third harmonic"
        )
    if s is None and p.place == "decision":
        return f"{said}; the way is too short to show three of them."
    if s is None:
        return f"{said}; the simulation, begun at rest, found no such edge."
    if not s.cycles:
        return f"{said}; the simulation shows no steady cycle (within {length(s.farthest)})."
    a, t = c.errors
    return (
        f"{said}; the simulation shows {length(s.amplitude)} every {s.period:.3g} s "
        f"({100 * a:+.0f} %, {100 * t:+.0f} %)."
    )


def _late(s: Stood) -> str:
    return f" and {s.delay:g} s late" if s.delay else ""


def _time(mode: Mode) -> str:
    return f"{mode.time_constant:.3g} s"


def _period(mode: Mode) -> str:
    return f"{2.0 * math.pi / mode.frequency:.3g} s" if mode.frequency > 0.0 else "never"


def modulus(value: float) -> str:
    """Return the modulus of an eigenvalue [-] with the digits that tell it from 1."""
    off = abs(value - 1.0)
    digits = 3 if off >= 1e-3 or off == 0.0 else min(1 - math.floor(math.log10(off)), 12)
    return f"{value:.{digits}f}"


def cycle_rows(cycles: Sequence[Confirmed]) -> list[tuple[str, ...]]:
    """Return the table of limit cycles: foretold beside simulated."""
    rows: list[tuple[str, ...]] = []
    for c in cycles:
        p, s = c.predicted, c.seen
        kind, foretold = "none", ("", "")
        if p.cycle is not None:
            kind = "stable" if p.cycle.stable else "edge"
            if p.bound:
                kind = "at most"
            elif not p.cycle.believed:
                kind += ", not relied on"
            every = p.cycle.period
            foretold = (length(p.depth_amplitude), "" if every != every else f"{every:.3g} s")
        seen = ("none", "")
        if s is not None and s.cycles:
            seen = (length(s.amplitude), f"{s.period:.3g} s")
        a, t = c.errors
        error = "" if math.isnan(a) or p.bound else f"{100 * a:+.0f} %, {100 * t:+.0f} %"
        rows.append((p.source, kind, *foretold, *seen, error))
    return rows


def robustness_rows(stood: Sequence[Stood]) -> list[tuple[str, ...]]:
    """Return the table of robustness: law, delay, then what share settled with each gain."""
    gains = sorted({s.gain for s in stood})
    rows: list[tuple[str, ...]] = []
    for law, delay in dict.fromkeys((s.law, s.delay) for s in stood):
        own = {s.gain: s for s in stood if (s.law, s.delay) == (law, delay)}
        cells = [
            f"{100 * own[g].settled:.0f}{'!' if own[g].radius >= 1.0 else ''} "
            f"({100 * own[g].overshoot_95:.1f})"
            if g in own
            else ""
            for g in gains
        ]
        rows.append((law, f"{delay:g} s", *cells))
    return rows
