"""`tune`: gains for a vehicle's law, with margins over what is not known of the vehicle.

Which law `tune` takes where none is named, and why.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from swimbladder.control.law import Law, leaves
from swimbladder.control.registry import bind, check_command, controller_of, own_law
from swimbladder.control.supervisor_limits import supervisor_parameters
from swimbladder.design.linear.depths import neutral_end, stall
from swimbladder.design.linear.pump_valve import moved_by_volume, pump_stall
from swimbladder.design.tuning import gains, trial
from swimbladder.design.tuning.gains import broken, least_of, limiting, promise_of, violation
from swimbladder.design.tuning.region import Region, region
from swimbladder.design.tuning.result import Tuning
from swimbladder.design.tuning.trial import Trial
from swimbladder.errors import InputError, NoAnswerError, SwimbladderError, check_number
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import each
from swimbladder.physics.arrays import Array
from swimbladder.physics.buoyancy_engine import at_voltage, check_power_known
from swimbladder.physics.dynamics import Plant, body_plant, plant
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.checks import turned_round
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.modes import Layers
from swimbladder.units import rounded, say
from swimbladder.vehicle import Controller, DatasheetPump, Positioner, PumpAndValve, Vehicle
from swimbladder.vehicle.schema import check_choice

_say = partial(say, "design", "tuning")

SOONER = 1.05  # times the time of the fastest law, within which the quietest is taken
MOVED = 10e-3 / 3600.0  # m3/s, that a fast law is to move at most while it holds a depth


def laws_for(vehicle: Vehicle, goal: str) -> list[str]:
    """Return the names of the laws among which one is chosen for a vehicle and a goal.

    For holding a depth those that rest there.
    """
    names = gains.tunable_names(vehicle.command)
    recipes = {name: gains.recipe_of(name) for name in names}
    fit = [name for name, recipe in recipes.items() if goal in gains.goals_of(recipe)]
    resting = [n for n in fit if recipes[n].holds or recipes[n].holds_best]
    return fit if goal == "fast" or not resting else resting


def choose(tunings: Mapping[str, Tuning], goal: str) -> tuple[str, str]:
    """Return the name of the law that is taken, and why in a sentence.

    tunings: one of each law. Those that keep their promises come first, then those that the
    supervisor leaves alone in waves. A fast law: of those that move little, or of all where none
    does, the quietest that is hardly slower than the fastest. For another goal: the best by what
    the goal wants to be small.
    """
    if len(tunings) == 1:
        return next(iter(tunings)), ""
    kept = {name: t for name, t in tunings.items() if not t.unmet} or dict(tunings)
    calm = {name: t for name, t in kept.items() if not t.waves > 0.0} or kept
    if goal != "fast":
        order = sorted(calm, key=lambda name: gains.score(goal, calm[name].region, calm[name].held))
        return order[0], _because(order, tunings, goal, f"is the best for {goal}")
    little = {name: t for name, t in calm.items() if t.region.rate <= MOVED} or calm
    first = min(_time(t.region) for t in little.values())
    near = {name: t for name, t in little.items() if _time(t.region) <= SOONER * first}
    order = sorted(near, key=lambda name: near[name].region.rate)
    taken = tunings[order[0]].region
    limit = f"at most {3.6e6 * MOVED:.3g} L an hour" if taken.rate <= MOVED else "any volume"
    rest = sorted((n for n in tunings if n not in near), key=lambda n: _time(tunings[n].region))
    share = f"{100.0 * (SOONER - 1.0):.0f} %"
    why = f"is the quietest of those within {share} of the fastest that moves {limit}"
    return order[0], _because([*order, *rest], tunings, goal, why)


def _time(t: Trial) -> float:
    return t.settle_95 if math.isfinite(t.settle_95) else math.inf


def _because(order: list[str], tunings: Mapping[str, Tuning], goal: str, why: str) -> str:
    """Return the sentence on a choice; order: the law that is taken, then the runner-up."""
    said = [_figures(tunings[name], goal) for name in order[:2]]
    sentence = f"The law {order[0]} {why} ({said[0]})"
    if len(order) > 1:
        sentence += f"; the runner-up is {order[1]} ({said[1]})"
    return f"{sentence}."


def _figures(t: Tuning, goal: str) -> str:
    r = t.region
    if goal == "fast":
        settle = f"{r.settle_95:.1f} s" if math.isfinite(r.settle_95) else "never settled"
        said = f"{settle}, {3.6e6 * r.rate:.2g} L an hour"
    elif goal == "energy":
        said = f"{rounded(r.energy, 3)} J a trial, {1e3 * r.rms:.2g} mm rms"
    else:
        moved = f"{1e3 * r.rms:.2g} mm rms, {3.6e6 * r.rate:.2g} L"
        said = (
            f"{moved}, {3600.0 * r.starts:.0f} starts and {3600.0 * r.turns:.0f} reversals an hour"
        )
    if t.waves > 0.0:
        said += f", the supervisor takes over in {100.0 * t.waves:.0f} % of half hours in waves"
    return said + (", not as promised" if t.unmet else "")


_SEARCHED = 0.9  # of the work, before what limits gains is looked for
_SHORTER, _FASTER = 4.0, 2.0  # times as short a sample, as fast a motor, that may be needed
_FEW = 40  # runs while that is found out
_LEAST_RUNS = 20  # of a trial
LOW = 0.9  # of the supply's voltage, a battery that is nearly empty
_WATCH = 2700.0  # s, that a hold is watched for: what counts is the last third
_SHOWN = (1, 30)  # runs kept as they went: of the nominal vehicle, over the region
_WATCHED = 10.0  # times the least time of a step
_TIME_LIMIT = 7200.0  # s, that a mission takes at most where the vehicle does not say
_NEUTRAL, _LEAST_NEUTRAL = 10.0, 50e-6  # times its spread, and m3: how far a filter looks for it
_IN_WAVES = 2.0  # m, where a vehicle is held in waves
_SPARE = 1.2  # times the change of the neutral volume that a cast has, that is allowed
_ROWS = 201  # depths at which a cast's layers are looked at
_USUAL_DEPTH = 10.0  # m, down to which a motor's law is tuned where no depths are asked for
_REACH = 0.8  # of the depth at which stroke or supply end: where a vehicle is still to be steered
_UNSTATED = 10.0  # m, that a vehicle of no stated rating is taken to
_TURNED = "its supervisor turns it round"
_TICK = 0.3  # s, of a supervisor where no controller says it; its depth limit hardly depends on it
BAND = 10.0  # m, within which a float has come to its depth, as those of Argo count
_ASKED = "(`depth_range=`, `step=`)"


class Asked(NamedTuple):
    """What gains are to be for, see `tune`."""

    goal: str = "fast"
    depth_range: tuple[float, float] | None = None  # m
    sample_time: float | None = None  # s
    delay: float = 0.1  # of the sample time
    supply: float | None = None  # V
    step: tuple[float, float] | None = None  # m
    hold: float | None = None  # m rms
    runs: int = 200
    cast: Column | None = None
    supervised: bool = True


_USUAL = Asked()


class Tuned(NamedTuple):
    """The gains of a law, how far they are off what they have to keep, and what limits them."""

    answer: Tuning
    off: float
    limit: Callable[[], str]


def tune(
    vehicle: Vehicle,
    *,
    law: str | None = None,
    goal: str = _USUAL.goal,
    depth_range: tuple[float, float] | None = _USUAL.depth_range,
    sample_time: float | None = _USUAL.sample_time,
    delay: float = _USUAL.delay,
    supply: float | None = _USUAL.supply,
    step: tuple[float, float] | None = _USUAL.step,
    hold: float | None = _USUAL.hold,
    runs: int = _USUAL.runs,
    cast: Column | None = _USUAL.cast,
    supervised: bool = _USUAL.supervised,
    advance: Advance = silent,
) -> Tuning:
    """Find the gains of a law for this vehicle and goal, with what they guarantee.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    law
        The name of one that has a recipe; none: the quietest of those that settle nearly as soon as
        the fastest, or the best for the goal; rate for a pump and valve.
    goal
        fast (a step soon settled), quiet (little volume moved and few starts of the motor while a
        depth is held; of a pump and valve least power) or energy (least electrical energy for a
        step and holding).
    depth_range
        Least and greatest [m]; none: 0 to 10 m, of a pump and valve from 20 m to four fifths of
        what rating, stroke, supply and supervisor allow.
    sample_time
        Of the law [s]; none: that of the vehicle's controller.
    delay
        From a sample to its command, as a share of the sample time [-], below 1.
    supply
        The least [V]; none: nine tenths of the vehicle's.
    step
        Depths of the trial [m]; none: 1.5 m within the range, of a pump and valve the whole range.
    hold
        Error allowed to a quiet law or one that saves energy, rms [m]; none: 9.5 mm and 5 cm. Of a
        pump and valve the tolerance; none: that of its law or 10 m.
    runs
        Of a trial, 20 or more.
    cast
        The water that the trials are flown in and that stroke and neutral volume are held against,
        as `read_cast` or `cast_column` returns it; margins are those of the vehicle's own psi and
        density, decisions of a pump and valve with psi as that water has it. None: the vehicle's
        own.
    supervised
        Whether the trials fly law and supervisor, as `firmware` writes them, or the law alone.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Tuning
        The law with its gains, the margins that they guarantee, and what trials gave. What gains do
        not keep that gains for the goal have to is `unmet`; `vehicle` of the answer then raises
        NoAnswerError.

    Raises
    ------
    InputError
        What is asked cannot be.
    NoAnswerError
        No gains hold this vehicle, with what limits them, or the energy of its motor is not known.
    """
    how = Asked(goal, depth_range, sample_time, delay, supply, step, hold, runs, cast, supervised)
    found = search_gains(vehicle, law, how, lambda x: advance(_SEARCHED * x), explained=True)
    answer = found.answer
    if answer.unmet:
        with threadpool_limits(limits=1, user_api="blas"):
            answer = replace(answer, limit=found.limit())
    advance(1.0 - _SEARCHED)
    return answer


def search_gains(
    vehicle: Vehicle, law: str | None, asked: Asked, advance: Advance, *, explained: bool = False
) -> Tuned:
    """Return the gains that `tune` does, with a call that finds what limits them.

    explained: whether, where there are none, an error says what would give one of the laws some.
    """
    goal, given, sample_time, delay, supply, step, hold, runs, cast, supervised = asked
    check_choice(goal, gains.GOALS, "no such goal", field="goal")
    names = laws_for(vehicle, goal) if law is None else [law]
    for name in names:
        _check(vehicle, name, goal, hold)
    how = "Give a share of the sample time"
    check_number(delay, "delay", least=0.0, below=1.0, remedy=how)
    if runs < _LEAST_RUNS:
        raise InputError("too few runs", field="runs", value=runs, remedy=f"Give {_LEAST_RUNS}")
    h = vehicle.sampled_every(sample_time)
    noisy, sensor = _with_noise(vehicle)
    pumped = vehicle.command == "volume change"
    depths, why = given or (0.0, 0.0), ""
    if given is None:
        low, most, why = places(noisy, supervised=supervised)
        most = min(most, math.inf if pumped else _USUAL_DEPTH, cast.deepest if cast else math.inf)
        depths = low if pumped else 0.0, most
    gains.check_depths(depths)
    weak, around = _least_supply(noisy, supply), region(noisy)
    ends = depths if pumped and step is None else _step(depths, step)
    way = abs(ends[1] - ends[0])
    for name in names if pumped else ():
        _check_way(depths, way, _held(noisy, gains.tunable(name), goal, hold))
    judged = tuple(sorted({*depths, *ends}))
    if cast is not None and cast.cast is not None:
        check_cast_unit(cast.cast, judged[-1], noisy.hull.depth_limit)
    layers = medium_of(noisy, cast, reach=judged[-1]).layers
    _check_reach(noisy, judged, weak, around, layers)
    off = layers.along(np.linspace(judged[0], judged[-1], _ROWS))
    if supervised and not pumped:
        noisy = _allowing(noisy, h, off)
    if supervised and judged[-1] > (limit := supervisor_parameters(noisy, h).deep.depth_limit):
        raise turned_round(judged[-1], limit, "depth_range" if depths[1] > limit else "step")
    request = _Request(
        vehicle=noisy,
        sensor=sensor,
        asked=asked,
        depths=depths,
        why=why,
        sample_time=h,
        delay=delay * h,
        supply=weak,
        ends=ends,
        around=around,
        judged=judged,
        off=off,
        least_time=least_of(noisy, goal, ends, supply=weak, sample_time=h),
    )

    def one(name: str) -> Tuned | SwimbladderError:
        """Return a law's tuned gains, or the error that says why it has none."""
        try:
            return request.tuned(name, lambda x: advance(x / len(names)))
        except SwimbladderError as error:
            return error

    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        outcomes = dict(each(one, names))
    tuned = {name: x for name in names if isinstance(x := outcomes[name], Tuned)}
    found = {name: x.answer for name, x in tuned.items()}
    unfit = {name: error for name in names if isinstance(error := outcomes[name], SwimbladderError)}
    reasons = {name: str(error) for name, error in unfit.items()}
    if not found:
        refused = [name for name in names if isinstance(unfit[name], NoAnswerError)]
        with threadpool_limits(limits=1, user_api="blas"):
            instead = request.instead(refused) if explained else ""
        if len(names) == 1 and not instead:
            raise unfit[names[0]]
        if len(names) == 1:
            raise NoAnswerError(f"{reasons[names[0]].rstrip('.')}. {instead}")
        why = "; ".join(f"{name}: {reason.rstrip('.')}" for name, reason in reasons.items())
        raise NoAnswerError(f"no law has gains for this. {why}. {instead}".rstrip())
    taken, why = choose(found, goal)
    if len(found) == 1 < len(names):
        why = f"The law {taken} is the only one that has gains for this."
    return tuned[taken]._replace(answer=replace(found[taken], choice=why, unfit=reasons))


class Places(NamedTuple):
    """Between which depths a vehicle's laws are compared [m], and what ends the range."""

    least: float
    most: float
    words: str


def places(
    vehicle: Vehicle, given: tuple[float, float] | None = None, *, supervised: bool = True
) -> Places:
    """Return a vehicle's range of depths: that given [m], or what rating, stroke and supply allow.

    supervised: and the supervisor, which turns a vehicle round above that. It begins where the hull
    is under water.

    Raises InputError for no range and for one beyond the supervisor's, NoAnswerError where the
    vehicle itself does not reach what was given.
    """
    top = max(vehicle.hull.emergence_depth, 0.0)
    if vehicle.command == "volume change":
        top = max(top, 2.0 * BAND)  # near the surface its processor acts, not the law
    reach, why = _reach(vehicle, supervised=supervised)
    if given is None:
        most = _REACH * reach
        words = f"down to {100.0 * _REACH:.0f} % of {rounded(reach, 3)} m, where {why}"
        if vehicle.hull.depth_limit is None and most > top + _UNSTATED:
            most = top + _UNSTATED
            words = f"down to {most:g} m, as the vehicle states no rating (`depth_range=`)"
        if most <= top:
            at = f"{why} at {rounded(reach, 3)} m"
            raise NoAnswerError(f"there is no depth for a law: {at}")
        return Places(top, most, words)
    least, most = max(given[0], top), given[1]
    if not (given[0] >= 0.0 and least < most < math.inf):
        remedy = "Give the least and the greatest, like 0:10"
        raise gains.refused_depths("no range of depths under water", given, remedy)
    if most >= reach and why == _TURNED:
        raise turned_round(most, reach, "depth_range")
    if most >= reach:
        raise NoAnswerError(
            f"the vehicle cannot be held at {most:g} m: at {reach:.4g} m {why}. Ask for "
            "less depth, or give it more stroke or a higher supply"
        )
    return Places(least, most, "as given")


def _reach(vehicle: Vehicle, *, supervised: bool) -> tuple[float, str]:
    """Return the depth [m] that ends the vehicle's range, and what happens there."""
    floats = vehicle.command == "volume change"
    p = body_plant(vehicle) if floats else plant(vehicle)
    found = [(math.inf, ""), (neutral_end(p), "its neutral volume leaves the stroke")]
    if vehicle.hull.depth_limit is not None:
        found.append((vehicle.hull.depth_limit, "its rating ends"))
    if vehicle.voltage_driven:
        weak = p._replace(supply=LOW * p.supply)
        held = stall(weak, depth=0.0, depth_limit=None).holding_depth
        found.append((held, f"the motor stalls with {weak.supply:.3g} V"))
    if supervised:
        own = vehicle.controller
        limits = supervisor_parameters(vehicle, _TICK if own is None else own.sample_time)
        found.append((limits.deep.depth_limit, _TURNED))
    if floats:
        found.append((pump_stall(vehicle, depth=0.0).holding_depth, "the pump stalls"))
    return min(found)


@dataclass(frozen=True, kw_only=True)
class _Request:
    """What is asked of any law, checked."""

    vehicle: Vehicle  # with a sensor as noisy as its logs were
    sensor: str  # how noisy that is, in words
    asked: Asked
    depths: tuple[float, float]  # m
    why: str  # these depths, where none are asked for
    sample_time: float  # s
    delay: float  # s, from a sample to its command
    supply: float  # V, the least
    ends: tuple[float, float]  # m, of the trials' step
    around: Region
    judged: tuple[float, ...]  # m, where margins are computed
    off: Array  # m3, that a cast adds to the neutral volume over these depths
    least_time: float  # s, of the step; nan where it does not count

    def but(self, **changes: Any) -> "_Request":
        """Return the request with something else: a faster vehicle, a shorter sample."""
        made = replace(self, **changes)
        times = {"supply": made.supply, "sample_time": made.sample_time}
        least = least_of(made.vehicle, made.asked.goal, made.ends, **times)
        return replace(made, around=region(made.vehicle), least_time=least)

    def others(self, name: str, runs: int = _FEW) -> dict[tuple[str, str], Callable[[], float]]:
        """Return what else may limit a law, and what would be without it, in words, each with how
        far the gains that are made for that are off what they have to keep.
        """
        if self.pumped:
            return {}
        h, vehicle = self.sample_time / _SHORTER, self.vehicle
        sample = f"the sample time of {self.sample_time:g} s", f"a sample time of {h:g} s"
        changes: dict[tuple[str, str], dict[str, Any]]
        changes = {sample: {"sample_time": h, "delay": self.delay / _SHORTER}}
        faster = "the speed of the motor", f"a motor {_FASTER:g} times as fast"
        if isinstance(vehicle.engine, Positioner):
            speed = _FASTER * vehicle.engine.speed
            changes[faster] = {"vehicle": vehicle.but("actuator", speed=speed)}
        elif vehicle.supply is not None:
            fast = vehicle.but("supply", voltage=_FASTER * vehicle.supply.voltage)
            changes[faster] = {"vehicle": fast, "supply": _FASTER * self.supply}

        def after(change: Mapping[str, Any]) -> float:
            try:
                few = self.asked._replace(runs=min(self.asked.runs, runs))
                return self.but(**change, asked=few).tuned(name, silent).off
            except SwimbladderError:
                return math.inf

        return {words: partial(after, change) for words, change in changes.items()}

    def instead(self, names: list[str]) -> str:
        """Return what would give one of the laws gains that have none, as a sentence; empty for a
        float's. The first whose gains would be proven, or the one that is nearest to that.
        """
        least, found = math.inf, ""
        tried = [(n, x, off) for n in names for (_, x), off in self.others(n, _LEAST_RUNS).items()]
        for name, instead, off in tried:
            if least > 0.0 and (left := off()) < least:
                proven = "" if left == 0.0 else ", though unproven ones"
                found = f"With {instead} the law {name} has gains for this{proven}."
                least = left
        which = f"the law {names[0]} any" if len(names) == 1 else "any of them gains"
        ways = dict.fromkeys(instead for _, instead, _ in tried)
        none = f"Neither {' nor '.join(ways)} would give {which}." if ways else ""
        return found or none

    def tuned(self, name: str, advance: Advance) -> Tuned:
        """Return the gains of the law of that name; raises as `tune` does."""
        vehicle, goal, depths, ends = self.vehicle, self.asked.goal, self.depths, self.ends
        h, supply, around, judged = self.sample_time, self.supply, self.around, self.judged
        chosen, recipe = gains.tunable(name), gains.recipe_of(name)
        way = abs(ends[1] - ends[0])
        held = _held(vehicle, chosen, goal, self.asked.hold)
        neutral = around.neutral if self.pumped else max(_NEUTRAL * around.neutral, _LEAST_NEUTRAL)
        neutral += float(np.abs(self.off).max())
        setting = gains.setting_of(
            vehicle, sample_time=h, supply=supply, neutral_range=neutral, depths=judged
        )
        long = _WATCH
        if recipe.lasts is not None:
            long = recipe.lasts(setting, way, goal)
        elif goal == "fast":
            long = _watched(vehicle, supply, way, h)
        watched = trial.Step(*ends, long)
        drawn = trial.Drawn(
            self.asked.runs,
            around,
            supply,
            self.asked.cast,
            supervised=self.asked.supervised,
            tick=h,
        )
        promise = promise_of(
            vehicle, goal, least=self.least_time, held=held, supervised=self.asked.supervised
        )
        asked = gains.Goal(goal, held, judged, watched, drawn, promise)
        search = gains.Search(chosen, vehicle, setting, asked, self.delay, advance)
        found = search.found()
        bound = search.bound(found.tuning)
        few = drawn.nominal._replace(runs=_SHOWN[0]), drawn._replace(runs=_SHOWN[1])
        nominal, drawn_runs = (trial.traces(vehicle, bound, watched, some) for some in few)
        unmet = tuple(words for words, _ in broken(promise, found.region))
        laws = (bound, *([] if search.fastest is None else [search.bound(search.fastest)]))
        waves = math.nan
        if self.asked.supervised and not self.pumped:
            depth = min(max(_IN_WAVES, depths[0]), depths[1])
            waves = trial.alarms_in_waves(vehicle, bound, depth, drawn)
        limit = partial(limiting, vehicle, laws, watched, drawn, promise, found.region)
        answer = Tuning(
            result_vehicle=self._vehicle(controller_of(chosen, found.parameters, sample_time=h)),
            law=chosen,
            goal=goal,
            setting=setting,
            **vars(found),
            shown=(nominal, drawn_runs),
            step=watched,
            sample_time=h,
            delay=self.delay,
            depths=depths,
            judged=judged,
            supply=supply,
            held=held,
            band=trial.arrival_band(bound, watched) if self.pumped else 0.0,
            assumptions=self._assumptions(),
            plants=around.plants,
            least=promise.least,
            ballast=promise.ballast,
            waves=waves,
            unmet=unmet,
        )
        too_much = violation(promise, found.region)
        return Tuned(answer, too_much, lambda: limit(self.others(name)))

    @property
    def pumped(self) -> bool:
        """Whether it is a float, moved by pump and valve."""
        return self.vehicle.command == "volume change"

    @property
    def unlimited(self) -> bool:
        """Whether the supervisor that is flown gets a time limit, as it has none.

        How many days a float's mission takes nobody but its owner knows; `firmware` asks.
        """
        return (
            self.asked.supervised and self.vehicle.supervisor.time_limit is None and not self.pumped
        )

    def _vehicle(self, controller: Controller) -> Vehicle:
        """Return the vehicle with a controller, and where trials had one, with its supervisor."""
        vehicle, (low, high) = self.vehicle, self.depths
        origin = {"controller.parameters": f"tuned for {self.asked.goal}, {low:g} to {high:g} m"}
        own = controller.model_copy(update={"depths": self.depths})
        made = {"controller": own, "provenance": {**vehicle.provenance, **origin}}
        if self.asked.supervised:
            limited = {"time_limit": _TIME_LIMIT} if self.unlimited else {}
            # so that `simulate` flies it as well
            made["supervisor"] = vehicle.supervisor.model_copy(update=limited)
        return vehicle.model_copy(update=made)

    def _assumptions(self) -> tuple[str, ...]:
        """Return what trials and margins assume."""
        together = trial.BOARD if self.pumped else trial.SUPERVISED
        how = together if self.asked.supervised else trial.ALONE
        found = [*self.around.words, self.sensor, how, *_outside(self.depths, self.ends)]
        if self.why and self.depths[1] != _USUAL_DEPTH:
            found.append(f"no depths are asked for (`depth_range=`): the vehicle's own, {self.why}")
        if self.unlimited:
            found.append(_say("time limited"))
        allowed = self.vehicle.supervisor
        widened = bool(allowed.neutral_change or allowed.neutral_range)
        found += _in_water(self.asked.cast, self.off, pumped=self.pumped, widened=widened)
        if math.isfinite(self.supply):
            found.append(f"the supply falls to {self.supply:.3g} V")
        else:
            mover = "pump" if self.pumped else "positioner"
            found.append(f"the {mover} moves {1e6 * _supplied(self.vehicle).rate:.3g} cm3/s")
        if not self.pumped:
            found.append(f"a command comes {1e3 * self.delay:.3g} ms after its sample")
        return tuple(found)


def _check(vehicle: Vehicle, law: str, goal: str, hold: float | None) -> None:
    if vehicle.controller is not None:
        own_law(vehicle, sampled=False)
    check_command(gains.tunable(law), vehicle, field="law", among=gains.tunable_names())
    goals = gains.goals_of(gains.recipe_of(law))
    if goal not in goals:
        remedy = f"Choose from {', '.join(goals)}, or another law"
        what = f"the law {law} is not tuned for this"
        raise InputError(what, field="goal", value=goal, remedy=remedy)
    pumped = vehicle.command == "volume change"
    allowed = goal != "fast" or pumped
    if hold is not None and not (allowed and 0.0 < hold < math.inf):
        what = "an error that is allowed is above 0, and for quiet and energy"
        remedy = 'Give something like "1 cm" with `goal="quiet"`'
        raise InputError(what, field="hold", value=hold, unit="m", remedy=remedy)
    if goal == "energy" and not pumped:
        check_power_known(vehicle, "tune for quiet, which moves least")


def _allowing(vehicle: Vehicle, h: float, off: Array) -> Vehicle:
    """Return a vehicle whose supervisor allows what a cast adds to the neutral volume, off [m3].

    What its file says stays, and what is usual where that is as much.
    """
    own, p = vehicle.supervisor, supervisor_parameters(vehicle, h)
    usual = p.motion.neutral_change, p.neutral.neutral_range
    needed = _SPARE * float(np.ptp(off)), _SPARE * float(np.abs(off).max())
    for name, least, most in zip(("neutral_change", "neutral_range"), usual, needed, strict=True):
        if most > least and getattr(own, name) is None:
            vehicle = vehicle.but("supervisor", **{name: most})
    return vehicle


def _check_way(depths: tuple[float, float], way: float, held: float) -> None:
    """Raise InputError where a float's way [m] is within the band that its law keeps [m]."""
    if way <= 2.0 * held:
        what = f"the way is no longer than the band of {held:g} m to either side that the law keeps"
        remedy = "Give depths farther apart, state hull.depth_limit, or give a smaller `hold=`"
        raise gains.refused_depths(what, depths, remedy)


def _supplied(vehicle: Vehicle) -> Plant:
    """Return the plant, of a pump and valve with the supply of its pump, where it needs one."""
    p = plant(moved_by_volume(vehicle))
    a = vehicle.engine
    if isinstance(a, PumpAndValve) and isinstance(a.pump, DatasheetPump) and vehicle.supply:
        return p._replace(supply=vehicle.supply.voltage)
    return p


def _least_supply(vehicle: Vehicle, given: float | None) -> float:
    """Return the least supply [V], infinite where the actuator has a supply of its own."""
    p = _supplied(vehicle)
    if given is not None and math.isinf(p.supply):
        pumped = vehicle.command == "volume change"
        what = f"a {'power law of a pump' if pumped else 'positioner'} has a supply of its own"
        raise InputError(what, field="supply", value=given, unit="V", remedy="Leave it out")
    least = LOW * p.supply if given is None else given
    if not 0.0 < least <= p.supply:
        what = "the least supply must be above 0 and not above the vehicle's"
        remedy = f"Give more than 0 V, and up to {p.supply:g} V"
        raise InputError(what, field="supply", value=least, unit="V", remedy=remedy)
    return least


def _held(vehicle: Vehicle, law: Law, goal: str, given: float | None) -> float:
    """Return the error of the depth that is allowed [m]."""
    if given is not None:
        return given
    assert law.recipe is not None  # tunable
    if law.recipe.held == 0.0:
        return gains.HELD.get(goal, 0.0)
    own = vehicle.controller
    if own is not None and own.law == law.name:
        return float(leaves(bind(own)[1])[law.band])
    return law.recipe.held


def _with_noise(vehicle: Vehicle) -> tuple[Vehicle, str]:
    """Return the vehicle with a sensor as noisy as its logs were, and in words how noisy it is."""
    sensors, known = vehicle.sensors, vehicle.identified
    if sensors.depth_noise == 0.0 and known is not None and known.depth_noise > 0.0:
        vehicle = vehicle.but("sensors", depth_noise=known.depth_noise)
        return vehicle, f"depth noise of {1e3 * known.depth_noise:.2g} mm, as in the logs"
    if sensors.depth_noise == 0.0 and sensors.depth_quantum == 0.0:
        return vehicle, "a depth sensor without noise: say what yours has (`depth_noise=`)"
    words = f"depth noise of {1e3 * sensors.depth_noise:.2g} mm"
    if sensors.depth_quantum > 0.0:
        words += f" and a quantum of {1e3 * sensors.depth_quantum:.2g} mm"
    return vehicle, words


def _check_reach(
    vehicle: Vehicle, depths: tuple[float, ...], supply: float, around: Region, layers: Layers
) -> None:
    """Raise NoAnswerError where stroke or supply does not reach one of the depths, least first."""
    deepest, rating = depths[-1], vehicle.hull.depth_limit
    if rating is not None and deepest > rating:
        raise NoAnswerError(_say("rated", rating=rating, deepest=deepest, asked=_ASKED))
    stroke = vehicle.stroke
    for depth in depths:
        each = [p.psi * depth + p.V_0 + layers.at(depth) for p in around.plants]
        low, high = min(each) - around.neutral, max(each) + around.neutral
        if not (stroke.lowest < low and high < stroke.highest):
            at = f"at {depth:g} m the vehicle is neutral at {1e6 * each[0]:.4g} cm3"
            raise NoAnswerError(
                _say("beyond stroke", at=at, low=low, high=high, stroke=stroke, asked=_ASKED)
            )
    if vehicle.command == "volume change":
        pump = pump_stall(at_voltage(vehicle, supply), depth=deepest)
        if pump.holding_depth <= deepest:
            at = f"with {supply:.3g} V " if math.isfinite(supply) else ""
            raise NoAnswerError(_say("pump leaks", at=at, pump=pump, deepest=deepest, asked=_ASKED))
        return
    if not vehicle.voltage_driven:
        return
    p = plant(vehicle)._replace(supply=supply)
    limit = stall(p, depth=deepest, depth_limit=None).depth
    if limit is not None and deepest >= limit:
        raise NoAnswerError(
            _say("stalls", supply=supply, limit=limit, deepest=deepest, asked=_ASKED)
        )


def _step(depths: tuple[float, float], given: tuple[float, float] | None) -> tuple[float, float]:
    if given is None:
        return trial.usual_step(*depths)
    if not (given[0] != given[1] and min(given) >= 0.0 and max(given) < math.inf):
        remedy = "Give two different depths, like 1.5:3"
        raise gains.refused_depths("no step of depth", given, remedy, field="step")
    return given


def _outside(depths: tuple[float, float], step: tuple[float, float]) -> list[str]:
    """Return what there is to say of a step that leaves the range of depths [m]."""
    beyond = [f"{end:g} m" for end in step if not depths[0] <= end <= depths[1]]
    if not beyond:
        return []
    return [_say("step leaves depths", step=step, depths=depths, beyond=" and ".join(beyond))]


def _in_water(column: Column | None, off: Array, *, pumped: bool, widened: bool) -> list[str]:
    """Return what is to be said of a cast; off [m3]: what it adds to the neutral volume.

    widened: whether the supervisor allows more than usual.
    """
    if column is None:
        return []
    judged = "margins are those in the vehicle's own water"
    if widened:
        judged += ", and [supervisor] is written so that it allows that change"
    if pumped:
        judged = "decisions are judged with psi as that water has it at each depth"
    return [
        *(f"cast: {remark}" for remark in column.report),
        f"the trials are flown in the water of {column.source}, which moves the neutral volume by "
        f"{1e6 * float(off.min()):.3g} to {1e6 * float(off.max()):.3g} cm3; {judged}",
    ]


def _watched(vehicle: Vehicle, supply: float, distance: float, h: float) -> float:
    """Return how long a step is watched [s]: many times the least that the motor needs."""
    p = plant(vehicle)
    jerk = (p.gain * supply if vehicle.voltage_driven else p.rate) * p.a_b
    least = math.cbrt(32.0 * distance / jerk)
    return max(math.ceil(_WATCHED * least / h), 200) * h
