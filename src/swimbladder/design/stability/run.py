"""`stability`: what is stable of a vehicle under its law, how far, and from where it recovers.

`Stability` is what it found, in sentences, as tables and for JSON.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.control.law import Law, from_numbers, leaves, numbers
from swimbladder.control.registry import own_law
from swimbladder.design.linear.depths import neutral_end
from swimbladder.design.linear.pump_valve import moved_by_volume, pump_stall
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.around import (
    Around,
    Decided,
    RobustnessTrial,
    around_decisions,
    robustness_around,
    wrapped,
)
from swimbladder.design.stability.around import robustness as with_errors
from swimbladder.design.stability.cycles import (
    Confirmed,
    Held,
    Predicted,
    Seen,
    edge,
    hold,
    hunting,
    predict,
)
from swimbladder.design.stability.recover import Map, Recovery, Verdict, recovery_maps
from swimbladder.design.tuning import gains, tune
from swimbladder.design.tuning.margins import at_rest
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.trial import Drawn, Step, usual_step
from swimbladder.errors import InputError, check_counts, check_number
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Store
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.closed_loop.supervision import supervision_of
from swimbladder.units import length, say
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import no_such

_say = partial(say, "design", "stability")


@dataclass(frozen=True, kw_only=True)
class Stability(Answer):
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
    robustness: tuple[RobustnessTrial, ...]
    unmet: tuple[str, ...]  # what could not be looked at, and why
    decided: Decided | None = None  # of a law of volume changes, in the place of `around`
    supervised: bool = False  # maps and wrong gains fly law and supervisor
    beyond: str = ""  # why part of the depths asked for is out of reach, whatever the law

    @property
    def flown(self) -> str:
        """Who flies: "law adrc and supervisor"."""
        return f"law {self.law} {'and supervisor' if self.supervised else 'alone'}"

    @property
    def _small(self) -> Around | Decided | None:
        return self.around if self.decided is None else self.decided

    @property
    def stable(self) -> bool:
        """Whether small disturbances decay wherever it was looked; where not linear, any step."""
        if self._small is not None:
            return self._small.stable
        return not any(m.name == "steps" and m.count(Verdict.RECOVERED) == 0 for m in self.maps)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know, in order."""
        small: tuple[str, ...] = (_say("not linear", found=self),)
        if self._small is not None:
            small = self._small.sentences(self.depths)
        beyond = (self.beyond,) if self.beyond else ()
        large = (*map(_cycle_words, self.cycles), *map(self._map_words, self.maps))
        between = (_BETWEEN,) if self.supervised else ()
        return (*beyond, *small, *between, *large, *self._robustness_messages(), *self.unmet)

    def _map_words(self, m: Map) -> str:
        said = (
            f"{m.title[0].upper()}{m.title[1:]}: of {m.asked} runs {m.count(Verdict.RECOVERED)} "
            f"are within {length(self.band, small='cm')} in {self.within:g} s and stay, "
            f"{m.count(Verdict.SLOW)} later, {m.count(Verdict.UNSETTLED)} are not there in "
            f"{3.0 * self.within:g} s, {m.count(Verdict.LOST)} are lost"
        )
        if self.supervised:
            said += f", {m.count(Verdict.BROUGHT_UP)} are brought up by the supervisor"
        hopeless = int((m.hopeless & (m.verdicts != int(Verdict.NOT_ASKED))).sum())
        return f"{said}; from {hopeless} of them no controller could come back."

    def _robustness_messages(self) -> tuple[str, ...]:
        said = []
        for law in dict.fromkeys(s.law for s in self.robustness):
            own = [s for s in self.robustness if s.law == law]
            bad = [s for s in own if s.settled < 1.0]
            grows = [s for s in own if s.radius >= 1.0]
            what = (
                f"{law}: all {own[0].draws} draws settle with every gain from "
                f"{min(s.gain for s in own):g} to {max(s.gain for s in own):g}, without and with "
                f"{own[-1].delay:g} s of extra delay."
            )
            if bad:
                each = (f"{100.0 * s.settled:.0f} % at gain {s.gain:g}{_late(s)}" for s in bad)
                cases = ", ".join(each)
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

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            **as_json(
                self, "vehicle law supervised sample_time_s depths_m stable sentences region=words"
            ),
            "linear": None if self.around is None else self.around.to_dict(),
            **({} if self.decided is None else {"decisions": self.decided.to_dict()}),
            "cycles_depth_m": self.depth,
            "cycles": [_cycle(c) for c in self.cycles],
            **as_json(self, "within_s band_m robustness"),
            "maps": [
                {
                    "name": m.name,
                    "title": m.title,
                    "runs": m.asked,
                    **{v.name.lower(): m.count(v) for v in Verdict if v is not Verdict.NOT_ASKED},
                }
                for m in self.maps
            ],
        }


def _cycle(c: Confirmed) -> dict[str, Any]:
    p, s = c.predicted, c.seen
    kept = "amplitude period_s stable third_harmonic=third amplitude_error period_error believed"
    return {
        **as_json(p, "source size unit broken_at=place"),
        "predicted": p.cycle and as_json(p.cycle, kept) | {"depth_amplitude_m": p.depth_amplitude},
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
        seen = ""
        if s is not None and s.cycles:
            size = f"{1e3 * s.amplitude:.3g} mm every {s.period:.3g} s"
            seen = f"; the simulation goes to and fro by {size}"
        elif s is not None:
            left = "in the simulation none is left, and the depth is within"
            seen = f"; {left} {length(s.farthest, 2)}"
        return f"{head}: {who} predicts no limit cycle{seen}."
    if p.bound:
        most = f"{head}: {length(p.depth_amplitude)} to either side at most"
        if not math.isnan(p.cycle.period):
            most += f", every {p.cycle.period:.3g} s at most"
        if s is None or not s.cycles:
            return f"{most}; the flight comes to rest."
        return f"{most}; the flight has {length(s.amplitude)} every {s.period:.3g} s."
    kind = "a limit cycle" if p.cycle.stable else "the edge of what decays, an unstable cycle,"
    size = f"{length(p.depth_amplitude)} every {p.cycle.period:.3g} s"
    said = f"{head}: {who} predicts {kind} of {size}"
    if not p.cycle.believed:
        said += _say("not relied on", p=p)
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


def _late(s: RobustnessTrial) -> str:
    return f" and {s.delay:g} s late" if s.delay else ""


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


def robustness_rows(trials: Sequence[RobustnessTrial]) -> list[tuple[str, ...]]:
    """Return the table of robustness: law, delay, then what share settled with each gain."""
    factors = sorted({s.gain for s in trials})
    rows: list[tuple[str, ...]] = []
    for law, delay in dict.fromkeys((s.law, s.delay) for s in trials):
        own = {s.gain: s for s in trials if (s.law, s.delay) == (law, delay)}
        cells = (_settling(own[g]) if g in own else "" for g in factors)
        rows.append((law, f"{delay:g} s", *cells))
    return rows


def _settling(s: RobustnessTrial) -> str:
    """Return what share settled [%], with ! where linearly unstable, and the overshoot [%]."""
    mark = "!" if s.radius >= 1.0 else ""
    return f"{100 * s.settled:.0f}{mark} ({100 * s.overshoot_95:.1f})"


_NOT_LINEAR = "Limit cycles are predicted for loops that are linear and stable at rest."
_RATE_LIMIT = "The actuator takes a volume: its rate limit has no describing function here."
_BETWEEN = (
    "Eigenvalues, margins and limit cycles are those of the law, between the supervisor's pushes; "
    "maps and wrong gains are of both together, as flashed."
)
_DEPTHS = 0.0, 10.0  # m, where the controller says of none that it was tuned for them
_SOON = 600.0  # s, in which a disturbance is to be gone
_AROUND = 1.5  # times its tolerance: a law of volume changes lets it drift to the edge of that
_BAND = 0.05  # m, from the set-point, that counts as there
_TUNED = 20  # runs of a tuning that only serves a comparison
_STILL = {"depth_noise": 0.0, "volume_noise": 0.0, "depth_quantum": 0.0, "volume_quantum": 0.0}
# A stroke and a sea without ends, for a cycle of the voltage's limit alone.
_ENDLESS = {"V_min": -1.0, "V_max": 1.0, "z_surface": -1e4, "z_air": -2e4}


def stability(
    vehicle: Vehicle,
    *,
    depth_range: tuple[float, float] | None = None,
    delay: float = 0.1,
    within: float | None = None,
    cells: int = 21,
    voltage_quantum: float = 0.0,
    maps: bool = True,
    robustness: bool = False,
    laws: Sequence[str] = (),
    runs: int = 200,
    supervised: bool | None = None,
    keep: Path | None = None,
    advance: Advance = silent,
) -> Stability:
    """Find what is stable of a vehicle under its controller.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it, with a controller.
    depth_range
        Least and greatest [m]; none: what the controller was tuned for, 0 to 10 m where that is not
        known.
    delay
        From a sample to its command, as a share of the sample time [-], below 1.
    within
        In which a disturbance is to be gone [s]; none: 600 s, of a law of volume changes one and a
        half times the whole way and an hour.
    cells
        Of a map, to a side, 5 to 201.
    voltage_quantum
        Of the motor's driver [V].
    maps
        Whether to draw where it recovers from.
    robustness
        Whether to try wrong gains and late commands, over `runs` from the region; of the own law,
        and of `laws`.
    laws
        Names of other laws, which are tuned first.
    runs
        Of each case, with vehicles from the region, 20 or more.
    supervised
        Whether maps and wrong gains fly under the vehicle's supervisor, as flashed; none: where its
        file has one. Those of a law of volume changes never do.
    keep
        A folder for what is done, so that a run that was killed goes on there; none: nothing is
        kept.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Stability
        All that was found; parts that were not asked for are empty.

    Raises
    ------
    InputError
        What is asked cannot be, or the vehicle has no controller.
    NoAnswerError
        One of `laws` cannot be tuned for this vehicle.
    """
    tuned = None if vehicle.controller is None else vehicle.controller.depths
    depths = depth_range or ((tuned[0], tuned[-1]) if tuned else _DEPTHS)
    gains.check_depths(depths, vehicle.hull.emergence_depth)
    how = "Give a share of the sample time"
    check_number(delay, "delay", least=0.0, below=1.0, remedy=how)
    check_number(within, "within", "s", above=0.0, below=1e6)
    check_number(voltage_quantum, "voltage_quantum", "V", least=0.0, below=1e3)
    check_counts(cells=(cells, 5, 201), runs=(runs, 20, 100_000))
    law, numbers = own_law(vehicle, sampled=False)
    if law.command == "volume change" and law.recipe is None:
        what = "it waits for what the vehicle does, and has no speeds and times to be analysed by"
        remedy = "Fly it with `mission` and `campaign`, or give the vehicle the law 'rate'"
        raise InputError(what, field="controller.law", value=law.name, remedy=remedy)
    known = gains.tunable_names()
    for name in laws:
        if name not in (*known, law.name):
            raise no_such("not a law that can be tuned for this", name, known, field="laws")
    if law.ways is not None and (robustness or laws):
        raise InputError(
            f"commands come late or wrong there; the vehicle flies {law.name!r} without samples",
            field="robustness" if robustness else "laws",
            remedy="Leave it out: the rates of pump and valve over the region are gains that err",
        )
    within = _within(law, numbers, depths) if within is None else within
    assert vehicle.controller is not None  # own_law
    h = vehicle.controller.sample_time
    bound = BoundLaw(law, numbers, h if law.ways is None else math.nan)
    low, high = depths
    if supervised and law.ways is not None:
        what = "maps of a law of volume changes are of its decisions, without a supervisor"
        remedy = "Leave it out; `simulate` and `faults` fly both"
        raise InputError(what, field="supervised", value=supervised, remedy=remedy)
    watched = law.ways is None and bool(supervision_of(vehicle, h, supervised))
    parts = Store(keep, vehicle, source_of(law), depths, within, watched, _BAND)
    unmet: list[str] = []
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        at, decided, around = _cycle_depth(vehicle, depths), None, None
        cycles: tuple[Confirmed, ...] = ()
        band = max(_BAND, float(leaves(numbers).get(law.band, 0.0)))
        three = (low, 0.5 * (low + high), high)
        if law.ways is not None:
            band *= _AROUND
            decided = around_decisions(vehicle, bound, depths=three)
            cycles = hunting(vehicle, bound, depth=at, depths=depths)
        else:
            small = bound.without_rest
            around = robustness_around(
                vehicle, small, three, delay=delay * h, advance=lambda x: advance(0.1 * x)
            )
            if around is None or not around.stable:
                unmet.append(_NOT_LINEAR)
            elif not vehicle.voltage_driven:
                unmet.append(_RATE_LIMIT)
            else:
                cycles = _cycles(vehicle, bound, at, voltage_quantum)
        advance(0.2)
        found: tuple[Map, ...] = ()
        if maps:
            recovery = Recovery(vehicle, bound, within, band, parts, watched)
            found = recovery_maps(recovery, depths, cells, lambda x: advance(0.4 * x))
        trials: list[RobustnessTrial] = []
        if robustness:
            start, target = usual_step(max(low, vehicle.hull.emergence_depth), high)
            step = Step(start, target, math.ceil(within / h) * h)
            others = [name for name in dict.fromkeys(laws) if name != law.name]
            chosen = [bound, *(_tuned(vehicle, name, depths, parts, watched) for name in others)]
            share = 0.3 / len(chosen)
            for one in chosen:
                drawn = Drawn(runs, region(vehicle), supervised=watched)
                trials += with_errors(
                    vehicle, one, step, drawn, parts, lambda x: advance(share * x)
                )
    return Stability(
        vehicle=vehicle.name,
        law=law.name,
        sample_time=h,
        depths=depths,
        depth=at,
        words=region(vehicle).words,
        around=around,
        cycles=cycles,
        maps=found,
        within=within,
        band=band,
        robustness=tuple(trials),
        unmet=tuple(unmet),
        supervised=watched,
        beyond=_beyond(vehicle, depths[1]),
        decided=decided,
    )


def _within(law: Law, numbers: Any, depths: tuple[float, float]) -> float:
    """Return the time [s] in which a disturbance is to be gone, where none is given."""
    if law.ways is None:
        return _SOON
    slowest = min(way.speed for way in law.ways(numbers) if way.name in ("far", "ascent"))
    return 1.5 * (depths[1] - depths[0]) / slowest + 3600.0


def _beyond(vehicle: Vehicle, deepest: float) -> str:
    """Return why the deepest of what was asked for is out of reach; empty where it is not."""
    p, rating = plant(moved_by_volume(vehicle)), vehicle.hull.depth_limit
    if vehicle.command == "volume change":
        stalls = pump_stall(vehicle, depth=deepest).holding_depth
        if stalls < deepest:
            return _say("pump leaks", stalls=stalls)
    neutral = neutral_end(p)
    if neutral < deepest:
        return _say("stroke ends", neutral=neutral)
    if rating is not None and rating < deepest:
        return f"The hull is rated for {rating:g} m only; the depths asked for go beyond."
    return ""


def _cycle_depth(vehicle: Vehicle, depths: tuple[float, float]) -> float:
    """Return a depth within the range to hold [m]: a multiple of the depth's quantum."""
    quantum = vehicle.sensors.depth_quantum
    middle = 0.5 * (depths[0] + depths[1])
    return round(middle / quantum) * quantum if quantum > 0.0 else middle


def _cycles(
    vehicle: Vehicle, bound: BoundLaw, depth: float, voltage_quantum: float
) -> tuple[Confirmed, ...]:
    p, quantum = plant(vehicle), vehicle.sensors.depth_quantum
    linear = at_rest(bound.without_rest, p, depth=depth)
    quanta = {"depth_quantum": quantum, "voltage_quantum": voltage_quantum}
    predicted = predict(p, bound, linear, depth=depth, **quanta)
    return tuple(Confirmed(one, _simulated(vehicle, bound, one, depth)) for one in predicted)


def _simulated(vehicle: Vehicle, bound: BoundLaw, one: Predicted, depth: float) -> Seen | None:
    """Return what the simulator shows of one nonlinearity, the others left out."""
    p, h = plant(vehicle), bound.sample_time
    quantised = one.source == "quantum of the depth"
    quantum = {"depth_quantum": one.size} if quantised else {}
    alone = vehicle.but("sensors", **(_STILL | quantum))
    if one.source != "dead zone of the law":
        bound = bound.without_rest
    vary: dict[str, float] = {}
    if one.source != "friction of the motor":
        vary = {"friction": 0.0, "load_back": p.load_drive}
    if one.source == "quantum of the voltage":
        bound = wrapped(bound, quantum=one.size, rest=p.load_drive * depth)
    held = Held(alone, bound, depth, vary)
    period, size, stable = 100.0 * h, 1e-2, True
    if one.cycle is not None:
        period, size, stable = one.cycle.period, one.depth_amplitude, one.cycle.stable
    if not stable:
        endless = held._replace(vary=vary | _ENDLESS)
        seen = edge(endless, (0.05 * size, 20.0 * size), period)
        return seen and seen[0]
    off = min(3.0 * size, 0.5 * (depth - p.z_surface))
    return hold(held, off, period, quantised=quantised)


def _tuned(
    vehicle: Vehicle, name: str, depths: tuple[float, float], parts: Store, supervised: bool
) -> BoundLaw:
    """Return a law of another name, tuned for depths [m]; supervised: under the supervisor."""
    law, goal = gains.tunable(name), gains.goals_of(gains.recipe_of(name))[0]

    def values() -> list[float]:
        how: Any = {"depth_range": depths, "runs": _TUNED, "supervised": supervised}
        found = tune(vehicle, law=name, goal=goal, **how)
        return [float(np.asarray(x)) for x in numbers(found.parameters)]

    kept = parts.get(values, "tuned", name, source_of(law), depths)
    assert vehicle.controller is not None  # own_law
    return BoundLaw(law, from_numbers(law.parameters, kept), vehicle.controller.sample_time)
