"""The sentences that go with the numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from swimbladder.estimation.actuator.bench import Bench, Driven
from swimbladder.estimation.actuator.estimate import shown
from swimbladder.estimation.actuator.from_moves import MovesFit
from swimbladder.estimation.actuator.from_voltage import SoftStart
from swimbladder.estimation.actuator.voltage import VoltageFit
from swimbladder.estimation.estimates import Estimate, Finding

ASSUMPTIONS: Mapping[Driven, tuple[str, ...]] = {
    "voltage": (
        "A logged voltage is on the motor from its sample to the next, without delay.",
        "The dead zone is dry friction: it also brakes a motor that runs on.",
        "K1 is the geometric mean of the gains outward and inward, asymmetry their ratio.",
    ),
    "nothing": (
        "The moves are taken to be at full voltage, given at an unknown instant between samples.",
        "The rate is the mean speed of a move once it is at full speed, the geometric mean of both "
        "directions.",
    ),
    "reference": (
        "The actuator is taken to go at full speed while what is asked of it is out of reach for a "
        "whole sample.",
        "The rate is the mean speed meanwhile, the geometric mean of both directions.",
    ),
}

_WIDE = 1.5  # times, by which an interval is wider
_SEVERAL = 0.02  # differences, trends and shares that are worth a sentence


def not_identifiable_finding(name: str, estimate: Estimate) -> Finding:
    """Return the sentence for a parameter that was asked for and is not identifiable."""
    return Finding("not identifiable", "no", f"{name} is not identifiable: {estimate.why}.")


def of_voltage(
    fit: VoltageFit,
    parameters: Mapping[str, Estimate],
    benches: Sequence[Bench],
    soft: SoftStart | None,
) -> Iterator[Finding]:
    """Yield what is to be said of a fit to voltage steps, and of its driver's soft start."""
    problem = fit.problem
    out, total = int((~problem.used & ~problem.early).sum()), len(problem.used)
    if out:
        yield Finding("outliers", "note", f"{out} of {total} samples are outliers, and left out.")
    if problem.early.any():
        yield Finding(
            "start",
            "note",
            f"A log begins in motion: its first {int(problem.early.sum())} samples, which depend "
            "on what was before, are left out.",
        )
    yield from _of_gains(fit)
    if soft is not None:
        yield Finding(
            "soft start",
            "warning",
            f"A voltage that rises along a ramp, to {fit.problem.top:.3g} V in about "
            f"{soft.ramp:.2g} s, explains the logs far better than the logged one: a soft start of "
            "the driver, or a delay. T1 is partly the ramp's; without it about "
            f"{soft.T1:.2g} s are left. Switch the ramp off, or log the voltage on the motor.",
        )
    T1, step = parameters["T1"], min(b.step for b in benches)
    if T1.origin == "data" and T1.value < step:
        yield Finding(
            "time constant",
            "warning",
            f"T1 is shorter than the {step:.3g} s between samples: it is seen as a lag of the "
            "whole motion, which a delay of the logged voltage would change as well.",
        )


def _of_gains(fit: VoltageFit) -> Iterator[Finding]:
    """Yield what is to be said of gains that differ, or may, from one move to the next."""
    if fit.spread.significant:
        share = fit.spread.likely
        yield Finding(
            "gains differ",
            "warning" if share > _SEVERAL else "note",
            f"The gain differs by {100.0 * share:.2g} % (1 sigma) from one move to the next by "
            "more than noise; the intervals take it into account.",
        )
    elif fit.widened >= _WIDE:
        few = "No step was" if fit.repeats < 1 else "Few steps were"
        yield Finding(
            "repeat",
            "note",
            f"{few} repeated, so gains that differ from step to step are hardly seen: the "
            f"intervals allow for {100.0 * fit.spread.typical:.2g} % (1 sigma), and that of K1 is "
            f"{fit.widened:.2g} times as wide as if the gain were the same each time. Apply every "
            "voltage three times or more.",
        )


def of_moves(fits: Sequence[MovesFit]) -> Iterator[Finding]:
    """Yield what is to be said of fits to moves at full speed."""
    out = sum(fit.outliers for fit in fits)
    if out:
        yield Finding("outliers", "note", f"{out} samples are outliers, and left out.")
    ramps = [(way, length) for fit in fits for way, length in fit.ramps.items()]
    if ramps:
        ways = " and ".join(sorted({way for way, _ in ramps}, reverse=True))
        low, high = (shown(end([length for _, length in ramps]), "s", 3) for end in (min, max))
        length = low if low == high else f"{low} to {high}"
        yield Finding(
            "soft start",
            "warning",
            f"The moves {ways} start along a straight ramp of {length}, not along the exponential "
            "of a motor: a soft start of the driver, or a limit of its current. T1 is then the "
            "ramp's, not the motor's: switch the ramp off, or log the voltage that the motor gets.",
        )
    between = max(fit.between for fit in fits)
    if between > 0.25 * _SEVERAL:
        yield Finding(
            "moves differ",
            "note",
            f"The speed differs from one move to the next by {100.0 * between:.2g} % (1 sigma); "
            "the intervals take it into account.",
        )
    worst = max(fits, key=lambda fit: abs(fit.trend * fit.lasting))
    change = 100.0 * worst.trend * worst.lasting
    if abs(change) > 100.0 * _SEVERAL:
        word = "gains" if change > 0.0 else "loses"
        yield Finding(
            "load",
            "note",
            f"Within a move the actuator {word} about {abs(change):.0f} % of its speed: the load "
            "or the voltage changes along the way.",
        )


def logs_differ(
    names: Sequence[str], per_log: Sequence[Mapping[str, Estimate]]
) -> Iterator[Finding]:
    """Yield the sentence on parameters that differ between logs by more than chance."""
    ranges, most = [], 0.0
    for name in names:
        known = [f[name] for f in per_log if name in f and f[name].known]
        low, high = min(e.value for e in known), max(e.value for e in known)
        most = max(most, high / low - 1.0) if low > 0.0 else 1.0
        ranges.append(f"{name} from {shown(low, known[0].unit)} to {shown(high, known[0].unit)}")
    if ranges:
        yield Finding(
            "logs differ",
            "warning" if most > _SEVERAL else "note",
            f"The logs differ by more than chance: {', '.join(ranges)}. What is given for all of "
            "them is the mean, with its own interval.",
        )
