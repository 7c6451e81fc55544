"""A day at the pool: samples in; what happens, what is known and what to do next out.

A day goes by what is sought and how well (`asked_of`), and by when an experiment is over
(`rules_of`); what went wrong is said in sentences. Its experiments are those of a plan, or the
paper's, cut to the vehicle's stroke. It leaves a log for each experiment, and pool.json.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from swimbladder.design.plan import Move, Plan
from swimbladder.design.pool_day import segments
from swimbladder.design.pool_day.verdict import LEAST, Asked, Target, Verdict, judge
from swimbladder.errors import InputError, LogError, Parameter, check_number
from swimbladder.estimation.estimates import read_priors, read_values
from swimbladder.estimation.motion import ExperimentFit, Identification, identify
from swimbladder.estimation.motion.problem import NAMES, UNITS, check_names, default_names, model_of
from swimbladder.estimation.motion.run import check_nuisances, check_std
from swimbladder.io.answers import Answer, as_json
from swimbladder.io.files import write_atomically, write_csv
from swimbladder.io.logs import Log, read_log
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.schema import check_choice

PAPER = (20e-6, 30e-6, 45e-6, 75e-6)  # m3, section 3.1, each up and down
_SHARE = 0.5  # of the volume that is free to either side of neutral
_ALIKE = 1.25  # factor between two changes of volume that count as the same
_CLEARANCE = 0.75  # m, Delta_z, of the depths of rest from bottom and surface
_MARGIN = 0.05  # m, of surface and bottom that counts as arrived


class Task(NamedTuple):
    """An experiment to do: from rest, changes of volume, until the depth leaves a range."""

    change: float  # m3, positive: it rises
    start: float | None  # m, depth of rest; None: not known
    turns: tuple[Move, ...] = ()  # changes of volume under way
    shallowest: float = 0.0  # m
    deepest: float = math.inf  # m
    longest: float = 1200.0  # s

    def sentence(self) -> str:
        """Return what to do, from the beginning."""
        place = "near the surface, all of it under water"
        if self.start is not None:
            place = f"at {self.start:.2f} m"
        elif self.change > 0.0:
            place = "near the bottom, clear of it"
        return f"Bring the vehicle to rest {place}; {self._change()}."

    def release(self) -> str:
        """Return what to do once the vehicle is at rest."""
        text = self._change()
        return f"{text[0].upper()}{text[1:]}."

    def _change(self) -> str:
        how, way = ("increase", "rise") if self.change > 0.0 else ("decrease", "sink")
        size = f"{1e6 * abs(self.change):.3g} cm3 from the mean of the last minute"
        first = f"{how} its volume by {size}"
        if not self.turns:
            return f"{first}, and let it {way} without moving the piston"
        then = "; ".join(
            f"when it passes {turn.depth:g} m on its way {turn.going}, go to "
            f"{1e6 * turn.volume:+.3g} cm3 of that mean"
            for turn in self.turns
        )
        return f"{first}; {then}"


def paper_tasks(vehicle: Vehicle, *, bottom_depth: float | None) -> tuple[Task, ...]:
    """Return the paper's eight experiments, smaller where the stroke is too short for them.

    bottom_depth [m], None where it is not known.
    """
    top = vehicle.hull.emergence_depth
    deep, shallow, end = None, None, math.inf
    if bottom_depth is not None:
        clearance = min(_CLEARANCE, (bottom_depth - top) / 4.0)
        deep, shallow, end = bottom_depth - clearance, top + clearance, bottom_depth - _MARGIN
    stroke = vehicle.stroke
    most, least = (vehicle.neutral_volume(top if z is None else z) for z in (deep, shallow))
    room = min(stroke.maximum - most, least - stroke.minimum)
    factor = min(1.0, _SHARE * room / PAPER[-1])
    tasks = []
    for size in PAPER:
        change = float(f"{factor * size:.2g}")
        for sign, start in ((1.0, deep), (-1.0, shallow)):
            tasks.append(Task(sign * change, start, shallowest=top + _MARGIN, deepest=end))
    return tuple(tasks)


def plan_tasks(plan: Plan) -> tuple[Task, ...]:
    """Return the experiments of a plan."""
    ends = plan.shallowest, plan.deepest
    return tuple(
        Task(one.moves[0].volume, one.start_depth, one.moves[1:], *ends, one.longest)
        for one in plan.experiments
    )


def next_task(tasks: Sequence[Task], done: Sequence[float]) -> Task:
    """Return the task that is due: the first of those done least often.

    done: first changes of volume of the experiments so far [m3].
    """
    counts = done_of(tasks, done)
    return tasks[counts.index(min(counts))]


def undone(tasks: Sequence[Task], done: Sequence[float]) -> int:
    """Return how many tasks have not been done yet; done: as for next_task."""
    return done_of(tasks, done).count(0)


def done_of(tasks: Sequence[Task], done: Sequence[float]) -> list[int]:
    """Return how often each task was done; done: as for next_task."""
    counts = [0] * len(tasks)
    for change in done:
        alike = [change and 1.0 / _ALIKE <= task.change / change <= _ALIKE for task in tasks]
        fitting = [i for i, fits in enumerate(alike) if fits]
        if fitting:
            counts[min(fitting, key=lambda i: counts[i])] += 1
    return counts


STATE = "pool.json"
_MARK = "swimbladder pool"


@dataclass(frozen=True, eq=False)
class Kept:
    """An experiment on disk: its file, its log as `identify` reads it, and what was seen of it.

    set_aside: why it is left out; "" where it is not.
    """

    number: int
    path: Path
    log: Log
    source: str  # the log that it was cut out of
    released_s: float
    change_m3: float
    travel_m: float
    end: str
    rest_depth_m: float
    rest_speed_m_s: float
    remarks: tuple[str, ...]
    set_aside: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return it for pool.json."""
        return {"file": self.path.name, **as_json(self, " ".join(_FACTS)), "remarks": self.remarks}


_FACTS = [f.name for f in fields(Kept) if f.name not in ("path", "log", "remarks")]


def keep(folder: Path, number: int, cut: segments.Cut, source: str, remarks: list[str]) -> Kept:
    """Write an experiment as a log and read it back, so that the fit sees what is on disk."""
    path = write_csv(folder / f"experiment-{number:03d}.csv", cut.columns())
    facts = (cut.released, cut.change, cut.travel, cut.end.value, cut.rest.depth, cut.rest.speed)
    return Kept(number, path, read_log(path), source, *facts, tuple(remarks))


def set_aside(kept: Kept, why: str) -> Kept:
    """Rename an experiment's file, so that it is not among those that count; say why."""
    path = kept.path.with_name(f"set-aside-{kept.number:03d}.csv")
    kept.path.replace(path)
    log = replace(kept.log, source=str(path))
    return replace(kept, path=path, log=log, set_aside=why)


def same_start(kept: Kept, cut: segments.Cut, source: str) -> bool:
    """Say whether a cut is an experiment that is kept, if perhaps cut longer or shorter."""
    columns, log = cut.columns(), kept.log
    n = min(len(log), len(columns["time_s"]), segments.FEWEST)
    begin = [columns[name][:n] for name in ("time_s", "depth_m")]
    return kept.source == source and np.array_equal([log.time[:n], log.depth[:n]], begin)


def state_text(state: Mapping[str, Any]) -> str:
    """Return the text of pool.json."""
    return json.dumps({"made_by": _MARK, **state}, indent=2) + "\n"


def read_state(folder: Path) -> dict[str, Any] | None:
    """Return what pool.json of an earlier run holds, None where there is none.

    Raises InputError where the file is no such thing.
    """
    path = folder / STATE
    if not path.is_file():
        return None
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _foreign(path, f"it cannot be read: {error}") from None
    if not isinstance(state, dict) or state.get("made_by") != _MARK:
        raise _foreign(path, "it was not written by `swimbladder pool`")
    return state


def earlier(folder: Path, state: Mapping[str, Any]) -> list[Kept]:
    """Return the experiments of an earlier run; raises InputError where they are not there."""
    found = []
    try:
        for entry in state["experiments"]:
            path, remarks = folder / Path(entry["file"]).name, tuple(entry["remarks"])
            facts = {name: entry[name] for name in _FACTS}
            found.append(Kept(path=path, log=read_log(path), remarks=remarks, **facts))
    except (KeyError, TypeError) as error:
        raise _foreign(folder / STATE, f"it is not whole: {error} is missing") from None
    return found


def _foreign(path: Path, what: str) -> InputError:
    return InputError(
        what, file=path, field=Parameter("out"), remedy="Choose another folder with `out=`"
    )


_EARLY = 0.6  # m
_FEW = 30  # samples under way
_OUTLIERS = 0.1  # of the samples
_CREEP = 0.05  # of the change of volume
_FAR = 4.0  # standard deviations


def of_cut(cut: segments.Cut, rules: segments.Rules) -> Iterator[str]:
    """Yield what is to be said of an experiment as it was cut out of the log."""
    glide = cut.glide
    if abs(cut.rest.speed) > rules.rest_speed:
        speed = f"{1e3 * abs(cut.rest.speed):.2g} mm/s over the last minute"
        most = f"more than {1e3 * rules.rest_speed:g} mm/s"
        yield f"It was not quite at rest before: {speed}, {most}. Wait longer next time."
    if len(glide) < _FEW:
        more = "a smaller change of volume, or a faster logger, gives more"
        yield f"Only {len(glide)} samples: {more}."
    ends = segments.End
    if cut.end in (ends.SURFACE, ends.BOTTOM, ends.STOPPED) and abs(cut.travel) < _EARLY:
        other = "deeper" if cut.travel < 0.0 else "higher"
        end = f"{cut.end.value[0].upper()}{cut.end.value[1:]}"
        yield f"{end} after only {abs(cut.travel):.2g} m: rest {other} before the release."
    if cut.end is segments.End.PISTON:
        moved = f"The piston moved after {abs(cut.travel):.2g} m; what came then is left out"
        yield f"{moved}. Leave it alone until the vehicle has arrived."
    last = [s.volume for s in glide[-max(3, len(glide) // 10) :]]
    half = [s.volume for s in glide[len(glide) // 2 :][: len(last)]]
    crept = sum(last) / len(last) - sum(half) / len(half)
    if not cut.turns and abs(crept) > _CREEP * abs(cut.change):
        change = f"{1e6 * crept:+.2g} cm3"
        yield f"The volume crept by {change} during the glide; the fit takes it as logged."


def of_fit(fit: ExperimentFit, neutral_std: float) -> tuple[float, str]:
    """Return how far off an experiment is, 1 at the limit, and a sentence on why.

    Beyond 1 it is no experiment of a constant neutral volume known to `neutral_std` [m3].
    """
    if not math.isfinite(neutral_std):
        return 0.0, ""
    e, span = fit.estimates["neutral_error"], float(np.ptp(fit.record.time))
    neutral = abs(e.value) / (_FAR * neutral_std)
    drifted = fit.drift.value * span
    used = int(np.isfinite(fit.residual).sum())
    outliers = fit.outliers / (_OUTLIERS * used)
    sure = abs(fit.drift.value) / (_FAR * fit.drift.std) if fit.drift.std > 0.0 else 0.0
    drift = min(sure, abs(drifted) / neutral_std)
    if outliers > max(neutral, drift):
        return outliers, f"{fit.outliers} of its {used} depths are outliers: check the sensor"
    if neutral >= drift:
        off = f"{1e6 * e.value:+.2g} +- {1e6 * e.std:.1g} cm3 off"
        why = f"it did not start neutral but {off}, where {1e6 * neutral_std:.2g} cm3 is assumed"
        return neutral, f"{why}. Rest longer before the release, clear of bottom and surface"
    why = "trapped air, a leak, a slip of the piston's sensor, or a touch of the tether"
    return drift, f"its neutral volume drifted by {1e6 * drifted:+.2g} cm3 under way: {why}"


_VERDICT = "good_enough=good state verdict=sentence more_experiments=more limits"
_THERE = 0.2  # m from where a plan wants the vehicle to rest

Doing = Literal["waiting", "moving", "at rest", "under way"]


class News(NamedTuple):
    """Something that happened, in a sentence."""

    kind: Literal["ready", "started", "turned", "ended", "refused", "identified", "log"]
    time: float  # s, in the log
    sentence: str


@dataclass(eq=False)
class PoolDay(Answer):
    """Experiments found in logs, kept in a folder, and identified together after each."""

    vehicle: Vehicle
    folder: Path
    _: KW_ONLY
    rules: segments.Rules
    tasks: Sequence[Task]
    asked: Asked
    mode: str
    kept: list[Kept] = field(default_factory=list)  # in a folder that is gone on with

    def __post_init__(self) -> None:
        self.aside = [k for k in self.kept if k.set_aside]
        self.kept = [k for k in self.kept if not k.set_aside]
        self.refused: list[News] = []
        self.found: Identification | None = None
        self.source = ""
        self._whole = False
        self._segmenter = segments.Segmenter(self.rules)
        self._fed = False
        self.latest: segments.Sample | None = None
        self.verdict: Verdict = self._judge()
        if self.kept:
            self._identify()

    # Samples in, news out

    def begin_log(self, source: str) -> list[News]:
        """Forget the samples so far, not the experiments: those to come are of another log."""
        news = list(self.end_log()) if self._fed else []
        self.source, self._segmenter, self._fed = source, segments.Segmenter(self.rules), False
        return news

    def feed(self, samples: Iterable[segments.Sample]) -> Iterator[News]:
        """Yield what the samples make happen."""
        for sample in samples:
            self._fed, self.latest = True, sample
            for event in self._segmenter.feed(sample):
                yield from self._on(event)

    def end_log(self) -> Iterator[News]:
        """Yield what the end of the log makes happen."""
        for event in self._segmenter.close():
            yield from self._on(event)

    def _on(self, event: segments.Event) -> Iterator[News]:
        if isinstance(event, segments.Ready):
            rest = event.rest
            at = f"{rest.depth:.2f} m ({1e3 * rest.speed:+.2f} mm/s over a minute)"
            yield News("ready", event.time, f"At rest at {at}. {self._at(rest.depth)}")
        elif isinstance(event, segments.Changed):
            changed = f"The volume was changed by {1e6 * event.change:+.3g} cm3"
            said = f"{changed}: experiment {self._number} is under way. Leave the piston alone."
            yield News("started", event.time, said)
        elif isinstance(event, segments.Turned):
            yield News("turned", event.time, f"Now {1e6 * event.volume:+.3g} cm3.")
        elif isinstance(event, segments.Refused):
            yield self._refuse(event.time, event.sentence(self.rules))
        else:
            yield from self._keep(event)

    def _refuse(self, time: float, sentence: str) -> News:
        self.refused.append(News("refused", time, sentence))
        return self.refused[-1]

    def _keep(self, cut: segments.Cut) -> Iterator[News]:
        before = (*self.kept, *self.aside)
        known = next((k for k in before if same_start(k, cut, self.source)), None)
        if known is not None and (known.set_aside or len(known.log) >= len(cut.samples)):
            return  # from an earlier run
        number = known.number if known is not None else self._number
        said = list(of_cut(cut, self.rules))
        one = keep(self.folder, number, cut, self.source, said)
        others = [k for k in self.kept if k is not known]
        self.kept = sorted([*others, one], key=attrgetter("number"))
        yield News("ended", cut.time, _summary(number, cut, said))
        try:
            self._identify()
        except LogError as error:
            self.kept.remove(one)
            one.path.unlink()
            yield self._refuse(cut.time, f"No experiment after all: {error}")
            return
        yield from self._set_aside(cut.time)
        self.keep_state()
        yield News("identified", cut.time, self.verdict.sentence)

    def _set_aside(self, time: float) -> Iterator[News]:
        """Leave out experiments that went wrong, the worst first, as long as most are right."""
        while len(self.kept) >= LEAST and len(self.aside) < (len(self.kept) + 1) // 3:
            faults = self._faults()
            if not faults:
                return
            worst = max(faults, key=lambda k: faults[k][0])
            one = self.kept.pop(self.kept.index(worst))
            why = faults[worst][1]
            self.aside.append(set_aside(one, why))
            self._identify()
            yield News("refused", time, f"Experiment {one.number} is set aside: {why}.")

    def _faults(self) -> dict[Kept, tuple[float, str]]:
        """Return by how much experiments are off, and why, of those that are."""
        if self.found is None:
            return {}
        fits = zip(self.kept, self.found.experiments, strict=True)
        misfits = {k: of_fit(fit, self.asked.neutral_std) for k, fit in fits}
        return {k: fault for k, fault in misfits.items() if fault[0] > 1.0}

    @property
    def _number(self) -> int:
        return 1 + max((k.number for k in (*self.kept, *self.aside)), default=0)

    # What is known

    def settle(self) -> None:
        """Look at what is kept from all sides: with likelihood profiles and other models."""
        if self.kept and not self._whole:
            self._identify(whole=True)

    def _identify(self, *, whole: bool = False) -> None:
        """Identify; from all sides where asked, or where the verdict would else be to stop."""
        self.found = self._identification(profiles=whole, choices=whole)
        self.verdict, self._whole = self._judge(), whole
        if self.verdict.good and not whole:
            self._identify(whole=True)

    def _identification(self, **other: Any) -> Identification:
        settings = {name: x for name, x in vars(self.asked).items() if name != "targets"}
        return identify([k.log for k in self.kept], self.vehicle, **settings | other)

    def _judge(self) -> Verdict:
        due = undone(self.tasks, [k.change_m3 for k in self.kept])
        faults = [f"Experiment {k.number}: {why}." for k, (_, why) in self._faults().items()]
        again = self._identification
        known_neutral = partial(again, neutral_std=1e-9, profiles=False, choices=False)
        return judge(self.found, self.asked, due=due, faults=faults, known_neutral=known_neutral)

    @property
    def doing(self) -> Doing:
        """What the vehicle does, as far as the log says."""
        if not self._fed:
            return "waiting"
        if self._segmenter.under_way:
            return "under way"
        return "at rest" if self._segmenter.ready else "moving"

    @property
    def speed(self) -> float:
        """Mean speed over the last minute [m/s]."""
        return self._segmenter.speed

    @property
    def next(self) -> Task:
        """The experiment that is due."""
        return next_task(self.tasks, [k.change_m3 for k in self.kept])

    @property
    def advice(self) -> str:
        """What to do now, in a sentence."""
        if self.verdict.good:
            return "Stop: the parameters are good enough."
        if self.doing == "under way":
            return "Leave the piston alone until the vehicle has arrived."
        if self.doing == "at rest" and self._segmenter.rest is not None:
            return self._at(self._segmenter.rest.depth)
        return self.next.sentence()

    def _at(self, depth: float) -> str:
        """Return what to do with a vehicle at rest at a depth [m]."""
        task = self.next
        there = task.start is None or abs(depth - task.start) <= _THERE
        return task.release() if there else f"That is the wrong place. {task.sentence()}"

    # What is written

    def keep_state(self) -> Path:
        """Write pool.json; return its path."""
        return write_atomically(self.folder / STATE, state_text(self.state()))

    def state(self) -> dict[str, Any]:
        """Return what is known, and the files, for pool.json."""
        paths = (*(k.path for k in (*self.kept, *self.aside)), self.folder / STATE)
        return {**self.to_dict(), "files": [str(path) for path in paths]}

    def to_dict(self) -> dict[str, Any]:
        """Return what is known in SI units, ready for JSON."""
        found: dict[str, Any] = {"parameters": {}, "findings": [], "assumptions": []}
        found |= {"experiments": []} if self.found is None else self.found.to_dict()
        return {
            "vehicle": self.vehicle.name,
            "mode": self.mode,
            **as_json(self.verdict, _VERDICT),
            "next": self.advice,
            "targets": self.asked.targets,
            **{name: found[name] for name in ("parameters", "findings", "assumptions")},
            "experiments": [
                {**k.to_dict(), "neutral_error": e["neutral_error"], "rms_m": e["rms_m"]}
                for k, e in zip(self.kept, found["experiments"], strict=True)
            ],
            "set_aside": [k.to_dict() for k in self.aside],
            "refused": [{"time_s": n.time, "why": n.sentence} for n in self.refused],
        }


def _summary(number: int, cut: segments.Cut, said: Sequence[str]) -> str:
    way = "down" if cut.travel > 0.0 else "up"
    took = f"{cut.samples[-1].time - cut.released:.0f} s, {len(cut.glide)} samples"
    moved = f"{1e6 * cut.change:+.3g} cm3, {abs(cut.travel):.2f} m {way} in {took}"
    return " ".join([f"Experiment {number} is over, {cut.end.value}: {moved}.", *said])


_LEAST_CHANGE = 0.008  # of half the stroke
_STD = 0.02  # of a parameter, to which it is to be known


def rules_of(
    vehicle: Vehicle,
    *,
    bottom_depth: float | None = None,
    travel: float = segments.Rules().travel,
    plan: Plan | None = None,
) -> segments.Rules:
    """Return by which numbers phases are distinguished.

    bottom_depth: of the bottom, None where it is not known; travel: after which an experiment is
    over [m]. A plan says where its records end. Raises InputError for a distance that says
    nothing.
    """
    least = segments.Rules().least_travel
    further = f"an experiment has to go further than {least:g} m"
    if not travel > least:
        remedy = "Give more, or leave it out"
        raise InputError(further, field="travel", value=travel, unit="m", remedy=remedy)
    half = 0.5 * (vehicle.stroke.maximum - vehicle.stroke.minimum)
    change = _LEAST_CHANGE * half
    if plan is not None:
        longest = max(one.longest for one in plan.experiments)
        change = min(change, *(0.5 * abs(one.moves[0].volume) for one in plan.experiments))
        ends = {"surface": plan.shallowest, "bottom": plan.deepest, "longest": longest}
        return segments.Rules(change=change, travel=math.inf, turns=True, **ends)
    # A quarter of the pool's depth is kept clear at either end: see paper_tasks.
    shallowest = vehicle.hull.emergence_depth + (least + 0.1) / 0.75
    if bottom_depth is not None and bottom_depth <= shallowest:
        remedy = f"Give the depth of the bottom, more than {shallowest:.2g} m"
        what, place = f"too shallow: {further}", "bottom_depth"
        raise InputError(what, field=place, value=bottom_depth, unit="m", remedy=remedy)
    surface = vehicle.hull.emergence_depth + 0.1
    bottom = math.inf if bottom_depth is None else bottom_depth - 0.05
    return segments.Rules(change=change, surface=surface, travel=travel, bottom=bottom)


def asked_of(
    vehicle: Vehicle, known: Asked, *, target_std: float | Sequence[Target] | None = None
) -> Asked:
    """Return what is to be identified, how well, and what is `known` before.

    target_std: of all but psi [-], or of each by itself. Raises InputError for what this vehicle
    does not have.
    """
    fixed, priors = read_values(known.fixed, UNITS), read_priors(known.priors, UNITS)
    known = replace(known, fixed=fixed, priors=priors)
    model = model_of(vehicle, law=known.drag, bottom_depth=math.inf)
    chosen = default_names(model.law, list(known.fixed)) if known.free is None else known.free
    for name, given in (("free", chosen), ("fixed", known.fixed), ("priors", known.priors)):
        check_names(tuple(given), model, voltage=False, option=name)
    check_std("neutral_std", known.neutral_std, "m3")
    check_nuisances(known.drift_std, known.delay_std)
    return replace(known, targets=_targets(target_std, chosen))


def _targets(given: float | Sequence[Target] | None, names: Sequence[str]) -> tuple[Target, ...]:
    how = "Give a standard deviation, or a share like 2 %"
    if given is None or isinstance(given, float | int):
        share = _STD if given is None else given
        check_number(share, "target_std", above=0.0, below=1.0, remedy=how)
        main = [name for name in ("K2", "T2", "mass") if name in names]
        if "mass" in main or not main:
            main = [name for name in names if name != "psi"]
        return tuple(Target(name, share) for name in main)
    for one in given:
        check_choice(one.name, names, "it is not identified", field="target_std")
        unit, below = ("", 1.0) if one.relative else (NAMES[one.name].unit, None)
        check_number(one.std, "target_std", unit, above=0.0, below=below, most=math.inf, remedy=how)
    return tuple(given)
