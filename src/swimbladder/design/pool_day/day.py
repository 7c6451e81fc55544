"""A day at the pool: samples in; what happens, what is known and what to do next out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from swimbladder.design.pool_day.files import STATE, Kept, keep, same_start, set_aside, write_state
from swimbladder.design.pool_day.growing_log import (
    Changed,
    Cut,
    Ended,
    Event,
    Ready,
    Refused,
    Sample,
    Turned,
)
from swimbladder.design.pool_day.messages import of_cut, of_fit, of_refusal
from swimbladder.design.pool_day.rest import Rules
from swimbladder.design.pool_day.segments import Segmenter
from swimbladder.design.pool_day.tasks import Task, next_task, undone
from swimbladder.design.pool_day.verdict import LEAST, Target, Verdict, judge
from swimbladder.errors import LogError
from swimbladder.estimation.motion import NEUTRAL_STD, Identification, Prior, identify
from swimbladder.io.answers import as_json
from swimbladder.vehicle import Vehicle

_THERE = 0.2  # m from where a plan wants the vehicle to rest

Doing = Literal["waiting", "moving", "at rest", "under way"]


class News(NamedTuple):
    """Something that happened, in a sentence."""

    kind: Literal["ready", "started", "turned", "ended", "refused", "identified", "log"]
    time: float  # s, in the log
    sentence: str


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is to be identified, how well, and what is known before."""

    targets: tuple[Target, ...]
    free: tuple[str, ...] | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    drag: str | None = None
    neutral_std: float = NEUTRAL_STD


class PoolDay:
    """Experiments found in logs, kept in a folder, and identified together after each."""

    def __init__(
        self, vehicle: Vehicle, folder: Path, *, rules: Rules, tasks: Sequence[Task], asked: Asked,
        mode: str, kept: Sequence[Kept] = (),
    ) -> None:  # fmt: skip
        self.vehicle, self.folder, self.rules = vehicle, folder, rules
        self.tasks, self.asked, self.mode = tuple(tasks), asked, mode
        self.kept = [k for k in kept if not k.set_aside]
        self.aside = [k for k in kept if k.set_aside]
        self.refused: list[News] = []
        self.found: Identification | None = None
        self.source = ""
        self._whole = False
        self._segmenter = Segmenter(rules)
        self._fed = False
        self.latest: Sample | None = None
        self.verdict: Verdict = self._judge()
        if self.kept:
            self._identify()

    # Samples in, news out

    def begin_log(self, source: str) -> list[News]:
        """Forget the samples so far, not the experiments: those to come are of another log."""
        news = list(self.end_log()) if self._fed else []
        self.source, self._segmenter, self._fed = source, Segmenter(self.rules), False
        return news

    def feed(self, samples: Iterable[Sample]) -> Iterator[News]:
        """Yield what the samples make happen."""
        for sample in samples:
            self._fed, self.latest = True, sample
            for event in self._segmenter.feed(sample):
                yield from self._on(event)

    def end_log(self) -> Iterator[News]:
        """Yield what the end of the log makes happen."""
        for event in self._segmenter.close():
            yield from self._on(event)

    def _on(self, event: Event) -> Iterator[News]:
        if isinstance(event, Ready):
            rest = event.rest
            yield News(
                "ready", event.time,
                f"At rest at {rest.depth:.2f} m ({1e3 * rest.speed:+.2f} mm/s over a minute). "
                f"{self._at(rest.depth)}",
            )  # fmt: skip
        elif isinstance(event, Changed):
            yield News(
                "started", event.time,
                f"The volume was changed by {1e6 * event.change:+.3g} cm3: experiment "
                f"{self._number} is under way. Leave the piston alone.",
            )  # fmt: skip
        elif isinstance(event, Turned):
            yield News("turned", event.time, f"Now {1e6 * event.volume:+.3g} cm3.")
        elif isinstance(event, Refused):
            news = News("refused", event.time, of_refusal(event, self.rules))
            self.refused.append(news)
            yield news
        else:
            yield from self._keep(event)

    def _keep(self, event: Ended) -> Iterator[News]:
        cut = event.cut
        known = next(
            (k for k in (*self.kept, *self.aside) if same_start(k, cut, self.source)), None
        )
        if known is not None and (known.set_aside or len(known.log) >= len(cut.samples)):
            return  # from an earlier run
        number = known.number if known is not None else self._number
        said = of_cut(cut, self.rules)
        one = keep(self.folder, number, cut, self.source, said)
        self.kept = sorted([*(k for k in self.kept if k is not known), one], key=_number)
        yield News("ended", event.time, _summary(number, cut, said))
        try:
            self._identify()
        except LogError as error:
            self.kept.remove(one)
            one.path.unlink()
            news = News("refused", event.time, f"No experiment after all: {error}")
            self.refused.append(news)
            yield news
            return
        yield from self._set_aside(event.time)
        self.save()
        yield News("identified", event.time, self.verdict.sentence)

    def _set_aside(self, time: float) -> Iterator[News]:
        """Leave out experiments that went wrong, the worst first, as long as most are right."""
        while len(self.kept) >= LEAST and len(self.aside) < (len(self.kept) + 1) // 3:
            faults = self._faults()
            if not faults:
                return
            worst = max(faults, key=lambda k: faults[k][0])
            one = self.kept.pop(self.kept.index(worst))
            self.aside.append(set_aside(one, faults[worst][1]))
            self._identify()
            sentence = f"Experiment {one.number} is set aside: {faults[worst][1]}."
            yield News("refused", time, sentence)

    def _faults(self) -> dict[Kept, tuple[float, str]]:
        """Return by how much experiments are off, and why, of those that are."""
        if self.found is None:
            return {}
        misfits = {
            k: of_fit(fit, self.asked.neutral_std)
            for k, fit in zip(self.kept, self.found.experiments, strict=True)
        }
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
        a = self.asked
        settings: dict[str, Any] = {
            "free": a.free, "fixed": a.fixed, "priors": a.priors, "drag": a.drag,
            "neutral_std": a.neutral_std,
        }  # fmt: skip
        return identify([k.log for k in self.kept], self.vehicle, **settings | other)

    def _judge(self) -> Verdict:
        def known_neutral() -> Identification:
            return self._identification(neutral_std=1e-9, profiles=False, choices=False)

        changes = [k.change_m3 for k in self.kept]
        faults = [f"Experiment {k.number}: {why}." for k, (_, why) in self._faults().items()]
        return judge(
            self.found, self.asked.targets, priors=self.asked.priors, faults=faults,
            due=undone(self.tasks, changes), known_neutral=known_neutral,
        )  # fmt: skip

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

    def save(self) -> Path:
        """Write pool.json; return its path."""
        return write_state(self.folder, self.answer())

    def answer(self) -> dict[str, Any]:
        """Return what is known in SI units, ready for JSON."""
        found = None if self.found is None else self.found.to_json()
        each = found["experiments"] if found else []
        return {
            "vehicle": self.vehicle.name,
            "mode": self.mode,
            **as_json(
                self.verdict, "good_enough=good state verdict=sentence more_experiments=more limits"
            ),
            "next": self.advice,
            "targets": [t._asdict() for t in self.asked.targets],
            **{name: found[name] if found else kind() for name, kind in _FOUND},
            "experiments": [
                {**k.to_json(), "neutral_error": e["neutral_error"], "rms_m": e["rms_m"]}
                for k, e in zip(self.kept, each, strict=True)
            ],
            "set_aside": [k.to_json() for k in self.aside],
            "refused": [{"time_s": n.time, "why": n.sentence} for n in self.refused],
            "files": [str(k.path) for k in (*self.kept, *self.aside)] + [str(self.folder / STATE)],
        }


_FOUND: tuple[tuple[str, type], ...] = (
    ("parameters", dict), ("findings", list), ("assumptions", list),
)  # fmt: skip


def _number(kept: Kept) -> int:
    return kept.number


def _summary(number: int, cut: Cut, said: Sequence[str]) -> str:
    way = "down" if cut.travel > 0.0 else "up"
    glide = sum(1 for s in cut.samples if s.time >= cut.released)
    took = cut.samples[-1].time - cut.released
    head = (
        f"Experiment {number} is over, {cut.end.value}: {1e6 * cut.change:+.3g} cm3, "
        f"{abs(cut.travel):.2f} m {way} in {took:.0f} s, {glide} samples."
    )
    return " ".join([head, *said])
