"""`compare_laws`: contenders found, flown on every scenario, and kept as they come.

A law flies a scenario in many runs, each with noise of its own. The least time of each step is
found in a process of its own: some programs take very long.
"""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swimbladder.control.law import leaves
from swimbladder.control.registry import bind
from swimbladder.design.law_comparison import contenders
from swimbladder.design.law_comparison.contenders import GOALS, Contender, Placed, Scenario
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.planning import least_time
from swimbladder.design.tuning import trial
from swimbladder.design.tuning.region import Region, region
from swimbladder.design.tuning.run import BAND, LOW, Places, places
from swimbladder.design.tuning.trial import ALONE, BOARD, SUPERVISED, Drawn, Trial, summarise
from swimbladder.errors import NoAnswerError, SwimbladderError, check_counts
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.jobs import Store, each
from swimbladder.physics.arrays import Array, Flags
from swimbladder.physics.buoyancy_engine import check_power_known
from swimbladder.physics.dynamics import plant
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.cast import check_cast_unit
from swimbladder.sim.closed_loop.checks import check_sample_time
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.closed_loop.water import depth_error, medium_of
from swimbladder.vehicle import Vehicle

_SHOWN = 900.0  # s of the first run of a hold that are kept to be drawn; of a step all of it


def no_energy(vehicle: Vehicle) -> str | None:
    """Return why the electrical energy is not known; None where it is."""
    try:
        check_power_known(vehicle)
    except NoAnswerError as error:
        motor = vehicle.command == "voltage"
        return "R and k_T of the motor are not known" if motor else str(error)
    return None


def fly_scenario(
    vehicle: Vehicle, who: Contender, placed: Placed, drawn: trial.Drawn
) -> tuple[trial.Measured, Array, Array]:
    """Return what was measured, and time [s] and depth [m] of the first run, to be looked at.

    A run that the supervisor ends counts as lost. drawn: how many, in which water, and from which
    region where the scenario draws them. Every law meets the same noise, waves, drift and vehicles:
    those of the seed. Of a float `starts` are all
    runs of its drive.
    """
    s, h, column = placed.scenario, who.sample_time, drawn.column
    supervised = who.supervised and drawn.supervised
    pumped = vehicle.command == "volume change"
    before = trial.held_before(h) if supervised and not pumped else None
    whole = placed.duration + (before or 0.0)
    medium = medium_of(vehicle, column, reach=max(placed.start, placed.target))
    given: dict[str, Any] = {"vary": {}}
    runs, seed = drawn.runs, drawn.seed
    if s.drawn:
        assert drawn.region is not None
        given["vary"] = trial.draw(drawn.region, runs=runs, seed=seed, medium=medium)
    if vehicle.voltage_driven:
        given["vary"]["supply"] = s.supply * plant(vehicle).supply
    if s.swell is not None:
        time = trial.sample_times(whole, h)
        given["depth_error"] = depth_error(
            s.swell, vehicle, time, depth=placed.target, runs=runs, seed=seed
        )
    if s.drift > 0.0:
        given["neutral_change"] = trial.random_walk(s.drift, whole, drawn, sample_time=h)
    if not pumped:  # neutral is otherwise what its stepper makes of it
        given["start_volume"] = medium.neutral_volume(placed.start)
    flown = trial.fly(
        vehicle,
        BoundLaw(who.law, who.parameters, h),
        target=placed.target,
        duration=placed.duration,
        before=before,
        supervised=supervised,
        count=runs,
        start_depth=placed.start,
        seed=seed,
        cast=column,
        balance=no_energy(vehicle) is None,
        workers=1,
        **given,
    )
    time, depth = flown.time, flown.depth
    rating = math.inf if vehicle.hull.depth_limit is None else vehicle.hull.depth_limit
    found = trial.measure(flown, s.counted)
    lost = np.maximum(found.lost, np.nanmax(depth, axis=0) > rating)
    found = found._replace(lost=np.maximum(lost, found.alarms))
    if pumped:
        settle = trial.arrivals(time, ~(np.abs(depth - placed.target) <= BAND)) - h
        starts, turns = flown.drive_runs / float(time[-1]), np.zeros(runs)
        found = found._replace(settle=np.maximum(settle, 0.0), starts=starts, turns=turns)
    kept = time <= (placed.duration if placed.is_step else _SHOWN)
    return found, time[kept], depth[kept, 0]


def front(costs: ArrayLike) -> Flags:
    """Return which rows of costs [rows, kinds], all to be small, no other row beats.

    A row beats another where it is nowhere worse and somewhere better. nan: worse than any number;
    rows without any number are not on the front.
    """
    c = np.asarray(costs, float)
    c = np.where(np.isnan(c), np.inf, c)
    no_worse = (c[:, None, :] <= c[None, :, :]).all(axis=-1)
    better = (c[:, None, :] < c[None, :, :]).any(axis=-1)
    return np.asarray(~(no_worse & better).any(axis=0) & np.isfinite(c).any(axis=1))


# What a law is judged by: name, unit, scenario, and the number of a Trial that is to be small.
COSTS = (
    ("settling", "s", "step-down", "settle_median"),
    ("hold", "m", "hold", "rms"),
    ("drift", "m", "hold-drift", "rms"),
    ("travel", "m3/s", "hold", "rate"),
    ("starts", "1/s", "hold", "starts_and_turns"),
)


class Trace(NamedTuple):
    """The first run of a scenario: time [s] and depth [m]."""

    time: Array
    depth: Array


class Row(NamedTuple):
    """A contender with its result on every scenario, by name."""

    who: Contender
    results: Mapping[str, Trial]
    traces: Mapping[str, Trace]

    def cost(self, scenario: str, field: str) -> float:
        """Return one number of a result; nan where the scenario was not flown."""
        found = self.results.get(scenario)
        return math.nan if found is None else float(getattr(found, field))


@dataclass(frozen=True, kw_only=True)
class LawComparison(Answer):
    """Every contender on every scenario, with the bounds that no controller can beat."""

    vehicle: Vehicle
    where: Places
    placed: Sequence[Placed]
    rows: Sequence[Row]
    not_compared: Mapping[str, str]  # laws that are not compared, and why
    bounds: Mapping[str, float]  # s, of each step that has one
    no_bound: Mapping[str, str]  # why a step has none
    no_energy: str | None  # why the energy is not known
    assumptions: Sequence[str]
    runs: int
    seed: int

    @property
    def reference(self) -> Row:
        """The row that others are measured by: the paper's, a tuned cascade, or the file's."""
        papers = [row for row in self.rows if row.who.tuning.startswith(contenders.PAPER)]
        cascades = [row for row in self.rows if row.who.law.name == "cascade"]
        return [*papers, *cascades, *self.rows][0]

    @property
    def unbeaten(self) -> tuple[bool, ...]:
        """Whether no other row is nowhere worse and somewhere better in all of COSTS."""
        costs = [[row.cost(s, field) for _, _, s, field in COSTS] for row in self.rows]
        return tuple(bool(one) for one in front(costs))

    def worst_overshoot(self, at: str) -> tuple[float, ...]:
        """Return each row's largest 95 % overshoot over the nominal vehicle's steps there [-]."""
        steps = [p.scenario for p in self.placed if p.is_step and p.scenario.at == at]
        names = [s.name for s in steps if not s.drawn]
        every = [[row.cost(name, "overshoot_95") for name in names] for row in self.rows]
        return tuple(max(costs, default=math.nan) for costs in every)

    @property
    def lost(self) -> tuple[float, ...]:
        """The share of runs that each row lost in its worst scenario [-]."""
        return tuple(max(r.lost for r in row.results.values()) for row in self.rows)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know first: the soonest, the stillest, the thriftiest."""
        said = []
        bound = self.bounds.get("step-down")
        alone = len(self.rows) == 1
        for verb, best_of, when, scenario, field, shown in _BEST:
            costs = [row.cost(scenario, field) for row in self.rows]
            least = min(filter(math.isfinite, costs), default=None)
            if least is None:
                continue
            best, reference = self.rows[costs.index(least)], self.reference
            words = f"{verb} {when}" if alone else f"{verb} {best_of} {when}"
            text = f"{best.who.name} {words}: {shown(least)}"
            if field == "settle_95" and bound:
                ratio = least / bound
                text += f", {ratio:.2f} of the least that any controller needs ({bound:.1f} s)"
            if reference is not best:
                text += f"; {reference.who.name}: {shown(reference.cost(scenario, field))}"
            said.append(text + ".")
        return tuple(said)

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON."""
        return {
            "vehicle": self.vehicle.name,
            **as_json(self, "runs seed energy_unknown=no_energy assumptions not_compared"),
            "depths_m": [self.where.least, self.where.most],
            "scenarios": {
                p.scenario.name: {
                    "words": p.scenario.words,
                    **as_json(p, "start_m target_m duration_s"),
                    "least_time_s": self.bounds.get(p.scenario.name),
                    "no_least_time": self.no_bound.get(p.scenario.name),
                }
                for p in self.placed
            },
            "laws": [
                {
                    "law": row.who.law.name,
                    **as_json(row.who, "name tuning sample_time_s"),
                    "unbeaten": unbeaten,
                    "reference": row is self.reference,
                    "parameters": leaves(row.who.parameters),
                    "results": {name: as_json(r, RESULT) for name, r in row.results.items()},
                }
                for row, unbeaten in zip(self.rows, self.unbeaten, strict=True)
            ],
        }


RESULT = (
    "settled settle2_median_s=settle_median settle2_95_s=settle_95 overshoot_median overshoot_95 "
    "rms_m farthest_m volume_rate_m3_s=rate starts_1_s turns_1_s power_W lost"
)
"""Numbers of a result, as `io.answers.as_json` takes them."""


def _seconds(x: float) -> str:
    return f"{x:.1f} s" if math.isfinite(x) else "not within the time watched"


def _millimetres(x: float) -> str:
    return f"{1e3 * x:.2g} mm rms" if math.isfinite(x) else "unknown"


def _litres(x: float) -> str:
    return f"{3.6e6 * x:.2g} L/h" if math.isfinite(x) else "unknown"


_OVER_REGION = "in 95 % of the runs over the 95 % parameter region"
# What is said of the best: verb, adverb among others, when, scenario, number, and its text.
_BEST = (
    (
        "settles",
        "soonest",
        f"after a step, {_OVER_REGION}",
        "step-uncertain",
        "settle_95",
        _seconds,
    ),
    ("holds", "best", "while the trim drifts", "hold-drift", "rms", _millimetres),
    ("moves", "least", "while holding", "hold", "rate", _litres),
)


class Asked(NamedTuple):
    """A step [m] with the supply's voltage [V], None for a positioner."""

    start: float
    target: float
    supply: float | None


def least_times(vehicle: Vehicle, steps: Sequence[Asked], *, limit: float) -> list[dict[str, Any]]:
    """Return for each step its least time [s] as ``time``, or in words ``why`` there is none.

    limit [s]: after which no more are waited for; ``late`` says that one was not.
    """
    command = [sys.executable, "-c", f"from {__name__} import answer; answer()"]
    # as swimbladder's own actuator: the process need not find other packages where this one does
    asked = pickle.dumps((vehicle.model_copy(update={"actuator": vehicle.engine}), steps))
    why = f"the linear programs took longer than {limit:g} s (swimbladder plan has no limit)"
    try:
        done = subprocess.run(command, input=asked, stdout=subprocess.PIPE, timeout=limit)
        printed, why = done.stdout, f"the process of the linear programs ended: {done.returncode}"
    except subprocess.TimeoutExpired as expired:
        printed = expired.stdout or b""
    whole = printed[: printed.rfind(b"\n") + 1].decode()
    found: list[dict[str, Any]] = [json.loads(line) for line in whole.splitlines()]
    return found + [{"why": why, "late": True}] * (len(steps) - len(found))


def answer() -> None:
    """Read a vehicle and steps from stdin, print a line of JSON for each: the process itself."""
    vehicle, steps = pickle.load(sys.stdin.buffer)
    for start, target, supply in steps:
        try:
            found: dict[str, Any] = {"time": least_time(vehicle, start, target, supply=supply).time}
        except SwimbladderError as error:
            found = {"why": str(error)}
        print(json.dumps(found), flush=True)


_TUNING, _FLYING = 0.7, 0.3  # shares of the work
_PATIENCE = 180.0  # s, with the linear programs of the least times
_FEWEST = 2
_NOT_A_STEP = dict.fromkeys(Trial._fields[1:6], math.nan)  # settling and overshoot of a hold


def compare_laws(
    vehicle: Vehicle,
    *,
    laws: Sequence[str] | None = None,
    runs: int = 40,
    depth_range: tuple[float, float] | None = None,
    seed: int = 1,
    sample_time: float | None = None,
    scenarios: Sequence[Scenario] | None = None,
    tune_for: Sequence[str] = GOALS,
    parts: Path | None = None,
    cast: Column | None = None,
    supervised: bool = True,
    advance: Advance = silent,
) -> LawComparison:
    """Fly every law on the same scenarios, each tuned fast and tuned quiet for this vehicle.

    The vehicle's own controller is always flown, and the paper's where the vehicle is the paper's.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    laws
        Names of laws; none: all that fit the actuator.
    runs
        Of each scenario, with noise of the vehicle's sensors; 2 or more.
    depth_range
        Least and greatest [m]; none: what rating, stroke and supply allow, and with `supervised`
        the supervisor.
    seed
        Of noise and draws, 0 or more.
    sample_time
        Of the tuned laws [s]; none: that of the vehicle's controller.
    scenarios
        What is flown; none: the scenarios for this kind of actuator.
    tune_for
        Goals of `tune`.
    parts
        A folder where what is done is kept: a comparison that was stopped goes on there. None:
        nothing is kept.
    cast
        The water of all runs and of the tuner's trials, as `read_cast` or `cast_column` returns it;
        none: the vehicle's own.
    supervised
        Whether trials and runs are of law and supervisor, as `firmware` writes them, or of the law
        alone; the paper's law is always alone.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    LawComparison
        Every controller on every scenario, which laws are left out and why, and the bounds that no
        controller can beat.

    Raises
    ------
    InputError
        What is asked cannot be.
    NoAnswerError
        No controller is left to fly, or the vehicle does not reach the depths.
    """
    check_counts(runs=(runs, _FEWEST), seed=(seed, 0))
    everyone = contenders.own(vehicle)
    names, not_compared = contenders.choose_laws(vehicle, laws)
    where = places(vehicle, depth_range, supervised=supervised)
    medium_of(vehicle, cast, reach=where.most)  # refuses a cast that ends above
    if cast is not None and cast.cast is not None:
        asked = None if depth_range is None else depth_range[1]
        check_cast_unit(cast.cast, asked, vehicle.hull.depth_limit)
    placed = [
        contenders.place(one, vehicle, where)
        for one in scenarios or contenders.scenarios_of(vehicle)
    ]
    if vehicle.controller is not None and vehicle.command != "volume change":
        by = *bind(vehicle.controller), vehicle.controller.sample_time
        check_sample_time(vehicle, *by, depths=(where.least, where.most))
    around = region(vehicle)
    store = Store(parts)
    how = contenders.tuner(
        vehicle, where, sample_time=sample_time, column=cast, supervised=supervised
    )
    jobs = [(name, goal) for name in names for goal in tune_for]
    with ThreadPoolExecutor(1) as aside:  # they have a process of their own
        bounding = aside.submit(_bounds, vehicle, placed, store)
        share = _TUNING / max(len(jobs), 1)
        for name, goal in jobs:
            found = contenders.tuned(vehicle, name, goal, how, store, lambda x: advance(share * x))
            if isinstance(found, str):
                not_compared[f"{name}, {goal}"] = found
            else:
                everyone.append(found)
        if not everyone:
            why = "; ".join(f"{name}: {why}" for name, why in not_compared.items())
            raise NoAnswerError(f"there is no controller to compare. {why}")
        flying = _FLYING if jobs else _FLYING + _TUNING
        drawn = Drawn(runs, around, column=cast, seed=seed, supervised=supervised)
        rows = _fly_all(vehicle, everyone, placed, drawn, store, lambda x: advance(x * flying))
        bounds, missing = bounding.result()
    return LawComparison(
        vehicle=vehicle,
        where=where,
        placed=placed,
        rows=rows,
        not_compared=not_compared,
        bounds=bounds,
        no_bound=missing,
        no_energy=no_energy(vehicle),
        runs=runs,
        seed=seed,
        assumptions=_assumptions(vehicle, where.words, around, cast, supervised=supervised),
    )


def _bounds(
    vehicle: Vehicle, placed: Sequence[Placed], store: Store
) -> tuple[dict[str, float], dict[str, str]]:
    """Return the least time of each step of the nominal vehicle [s], or why there is none."""
    steps = {p.scenario.name: p for p in placed if p.is_step}
    missing = {n: "each vehicle drawn has its own" for n, p in steps.items() if p.scenario.drawn}
    if vehicle.command == "volume change":
        return {}, dict.fromkeys(steps, "none is computed for a pump and valve") | missing
    if vehicle.controller is None:
        why = "the vehicle has no controller, so no sample time"
        return {}, dict.fromkeys(steps, why) | missing
    volts = None if vehicle.supply is None else vehicle.supply.voltage
    asked = {
        name: Asked(p.start, p.target, None if volts is None else p.scenario.supply * volts)
        for name, p in steps.items()
        if name not in missing
    }
    answers = {name: store.read("least-time", vehicle, one) for name, one in asked.items()}
    wanted = [name for name, answer in answers.items() if answer is None]
    if wanted:
        found = least_times(vehicle, [asked[name] for name in wanted], limit=_PATIENCE)
        for name, answer in zip(wanted, found, strict=True):
            answers[name] = answer
            if "late" not in answer:
                store.write(answer, "least-time", vehicle, asked[name])
    bounds = {name: float(one["time"]) for name, one in answers.items() if "time" in one}
    return bounds, missing | {n: str(answers[n]["why"]) for n in answers if n not in bounds}


def _fly_all(
    vehicle: Vehicle,
    everyone: Sequence[Contender],
    placed: Sequence[Placed],
    drawn: Drawn,
    store: Store,
    advance: Advance,
) -> list[Row]:
    """Fly every contender on every scenario; two or more at a time, as kernels let others run."""
    how = drawn.runs, drawn.seed, drawn.column, drawn.supervised

    def one(job: tuple[int, int]) -> tuple[Trial, Trace]:
        """Return a contender's trial on a scenario and its trace, from the store if kept."""
        who, p = everyone[job[0]], placed[job[1]]
        law = (who.law.name, source_of(who.law), who.parameters, who.sample_time)

        def flight() -> dict[str, Any]:
            flown, time, depth = fly_scenario(vehicle, who, p, drawn)
            result = summarise(flown)._asdict() | ({} if p.is_step else _NOT_A_STEP)
            return {"result": result, "time": time.tolist(), "depth": depth.tolist()}

        kept = store.get(flight, "flown", vehicle, *law, *p, *how)
        return Trial(**kept["result"]), Trace(np.array(kept["time"]), np.array(kept["depth"]))

    jobs = [*product(range(len(everyone)), range(len(placed)))]
    found = {}
    for job, answer in each(one, jobs):
        found[job] = answer
        advance(1.0 / len(jobs))
    names = [p.scenario.name for p in placed]
    rows = []
    for n, who in enumerate(everyone):
        results, traces = zip(*(found[n, k] for k in range(len(placed))), strict=True)
        made = (dict(zip(names, parts, strict=True)) for parts in (results, traces))
        rows.append(Row(who, *made))
    return rows


def _assumptions(
    vehicle: Vehicle, range_words: str, around: Region, column: Column | None, *, supervised: bool
) -> tuple[str, ...]:
    sensors = vehicle.sensors
    noise = f"depth noise of {1e3 * sensors.depth_noise:.2g} mm"
    if sensors.depth_quantum > 0.0:
        noise += f" and a quantum of {1e3 * sensors.depth_quantum:.2g} mm"
    together = BOARD if vehicle.command == "volume change" else SUPERVISED
    found = [f"depths {range_words}", noise, together if supervised else ALONE]
    if supervised and any(one.tuning == contenders.PAPER for one in contenders.own(vehicle)):
        found.append("the paper's law flies alone, as the paper has it")
    if vehicle.supply is not None and vehicle.command != "volume change":
        weak = LOW * vehicle.supply.voltage
        found.append(f"a low battery gives {weak:.3g} V, which the tuned laws assume")
    found += [f"vehicles drawn: {words}" for words in around.words]
    if column is not None:
        found += [f"cast: {remark}" for remark in column.report]
        found.append(
            f"flown and tuned in the water of {column.source}; least times and margins are those "
            "in the vehicle's own water"
        )
    found.append(
        "in swell depths are those in the water, which carries the vehicle along: the sensor reads "
        "of the waves what the length of the hull leaves"
    )
    return tuple(found)
