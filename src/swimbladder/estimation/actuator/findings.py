"""The sentences that go with the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swimbladder.estimation.actuator.bench import Bench, Driven
from swimbladder.estimation.actuator.estimate import Estimate, shown
from swimbladder.estimation.actuator.from_moves import MovesFit
from swimbladder.estimation.actuator.from_voltage import SoftStart
from swimbladder.estimation.actuator.result import Finding
from swimbladder.estimation.actuator.voltage import VoltageFit

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
    return Finding("not identifiable", f"{name} is not identifiable: {estimate.why}.", "no")


def of_voltage(
    fit: VoltageFit,
    parameters: Mapping[str, Estimate],
    benches: Sequence[Bench],
    soft: SoftStart | None,
) -> list[Finding]:
    """Return what is to be said of a fit to voltage steps, and of its driver's soft start."""
    found = []
    problem = fit.problem
    out = int((~problem.used & ~problem.early).sum())
    if out:
        total = len(problem.used)
        found.append(Finding("outliers", f"{out} of {total} samples are outliers, and left out."))
    if problem.early.any():
        found.append(
            Finding(
                "start",
                f"A log begins in motion: its first {int(problem.early.sum())} samples, which "
                "depend on what was before, are left out.",
            )
        )
    found += _of_gains(fit)
    if soft is not None:
        found.append(
            Finding(
                "soft start",
                f"A voltage that rises along a ramp, to {fit.problem.top:.3g} V in about "
                f"{soft.ramp:.2g} s, explains the logs far better than the logged one: a soft "
                "start of the driver, or a delay. T1 is partly the ramp's; without it about "
                f"{soft.T1:.2g} s are left. Switch the ramp off, or log the voltage on the motor.",
                "warning",
            )
        )
    T1, step = parameters["T1"], min(b.step for b in benches)
    if T1.value is not None and T1.origin == "data" and T1.value < step:
        found.append(
            Finding(
                "time constant",
                f"T1 is shorter than the {step:.3g} s between samples: it is seen as a lag of the "
                "whole motion, which a delay of the logged voltage would change as well.",
                "warning",
            )
        )
    return found


def _of_gains(fit: VoltageFit) -> list[Finding]:
    """Return what is to be said of gains that differ, or may, from one move to the next."""
    if fit.spread.significant:
        share = fit.spread.likely
        return [
            Finding(
                "gains differ",
                f"The gain differs by {100.0 * share:.2g} % (1 sigma) from one move to the next by "
                "more than noise; the intervals take it into account.",
                "warning" if share > _SEVERAL else "note",
            )
        ]
    if fit.widened < _WIDE:
        return []
    few = "No step was" if fit.repeats < 1 else "Few steps were"
    return [
        Finding(
            "repeat",
            f"{few} repeated, so gains that differ from step to step are hardly seen: the "
            f"intervals allow for {100.0 * fit.spread.typical:.2g} % (1 sigma), and that of K1 is "
            f"{fit.widened:.2g} times as wide as if the gain were the same each time. Apply every "
            "voltage three times or more.",
        )
    ]


def of_moves(fits: Sequence[MovesFit]) -> list[Finding]:
    """Return what is to be said of fits to moves at full speed."""
    found = []
    out = sum(fit.outliers for fit in fits)
    if out:
        found.append(Finding("outliers", f"{out} samples are outliers, and left out."))
    found += _of_ramps(fits)
    between = max(fit.between for fit in fits)
    if between > 0.25 * _SEVERAL:
        found.append(
            Finding(
                "moves differ",
                f"The speed differs from one move to the next by {100.0 * between:.2g} % (1 sigma)"
                "; the intervals take it into account.",
            )
        )
    worst = max(fits, key=lambda fit: abs(fit.trend * fit.lasting))
    change = 100.0 * worst.trend * worst.lasting
    if abs(change) > 100.0 * _SEVERAL:
        word = "gains" if change > 0.0 else "loses"
        found.append(
            Finding(
                "load",
                f"Within a move the actuator {word} about {abs(change):.0f} % of its speed: the "
                "load or the voltage changes along the way.",
            )
        )
    return found


def _of_ramps(fits: Sequence[MovesFit]) -> list[Finding]:
    """Return the sentence on moves that start along a ramp."""
    ramps = [(way, length) for fit in fits for way, length in fit.ramps.items()]
    if not ramps:
        return []
    ways = " and ".join(sorted({way for way, _ in ramps}, reverse=True))
    low, high = (shown(end([length for _, length in ramps]), "s", 3) for end in (min, max))
    length = low if low == high else f"{low} to {high}"
    return [
        Finding(
            "soft start",
            f"The moves {ways} start along a straight ramp of {length}, not along the exponential "
            "of a motor: a soft start of the driver, or a limit of its current. T1 is then the "
            "ramp's, not the motor's: switch the ramp off, or log the voltage that the motor gets.",
            "warning",
        )
    ]


def logs_differ(names: Sequence[str], per_log: Sequence[Mapping[str, Estimate]]) -> list[Finding]:
    """Return the sentence on parameters that differ between logs by more than chance."""
    ranges, most = [], 0.0
    for name in names:
        known = [(f[name].value, f[name].unit) for f in per_log if name in f]
        values = [value for value, _ in known if value is not None]
        most = max(most, max(values) / min(values) - 1.0) if min(values) > 0.0 else 1.0
        ranges.append(f"{name} from {shown(min(values), known[0][1])} to "
                      f"{shown(max(values), known[0][1])}")  # fmt: skip
    if not ranges:
        return []
    return [
        Finding(
            "logs differ",
            f"The logs differ by more than chance: {', '.join(ranges)}. What is given for all of "
            "them is the mean, with its own interval.",
            "warning" if most > _SEVERAL else "note",
        )
    ]
