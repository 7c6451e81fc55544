"""What went wrong, in sentences."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.design.pool_day.growing_log import Cut, End, Refused, Why
from swimbladder.design.pool_day.rest import Rules
from swimbladder.estimation.motion import ExperimentFit

_EARLY = 0.6  # m
_FEW = 30  # samples under way
_OUTLIERS = 0.1  # of the samples
_CREEP = 0.05  # of the change of volume
_FAR = 4.0  # standard deviations


def of_cut(cut: Cut, rules: Rules) -> list[str]:
    """Return what is to be said of an experiment as it was cut out of the log."""
    said = []
    glide = [s for s in cut.samples if s.time >= cut.released]
    if abs(cut.rest.speed) > rules.rest_speed:
        said.append(
            f"It was not quite at rest before: {1e3 * abs(cut.rest.speed):.2g} mm/s over the last "
            f"minute, more than {1e3 * rules.rest_speed:g} mm/s. Wait longer next time."
        )
    if len(glide) < _FEW:
        said.append(
            f"Only {len(glide)} samples: a smaller change of volume, or a faster logger, gives "
            "more."
        )
    early = cut.end in (End.SURFACE, End.BOTTOM, End.STOPPED) and abs(cut.travel) < _EARLY
    if early:
        other = "deeper" if cut.travel < 0.0 else "higher"
        said.append(
            f"{cut.end.value[0].upper()}{cut.end.value[1:]} after only {abs(cut.travel):.2g} m: "
            f"rest {other} before the release."
        )
    if cut.end is End.PISTON:
        said.append(
            f"The piston moved after {abs(cut.travel):.2g} m; what came then is left out. Leave it "
            "alone until the vehicle has arrived."
        )
    last = [s.volume for s in glide[-max(3, len(glide) // 10) :]]
    half = [s.volume for s in glide[len(glide) // 2 :][: len(last)]]
    crept = sum(last) / len(last) - sum(half) / len(half)
    if not cut.turns and abs(crept) > _CREEP * abs(cut.change):
        said.append(
            f"The volume crept by {1e6 * crept:+.2g} cm3 during the glide; the fit takes it as "
            "logged."
        )
    return said


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
    drift = min(
        abs(fit.drift.value) / (_FAR * fit.drift.std) if fit.drift.std > 0.0 else 0.0,
        abs(drifted) / neutral_std,
    )
    if outliers > max(neutral, drift):
        return outliers, f"{fit.outliers} of its {used} depths are outliers: check the sensor"
    if neutral >= drift:
        return neutral, (
            f"it did not start neutral but {1e6 * e.value:+.2g} +- {1e6 * e.std:.1g} cm3 off, "
            f"where {1e6 * neutral_std:.2g} cm3 is assumed. Rest longer before the release, "
            "clear of bottom and surface"
        )
    return drift, (
        f"its neutral volume drifted by {1e6 * drifted:+.2g} cm3 under way: trapped air, a leak, a "
        "slip of the piston's sensor, or a touch of the tether"
    )


def of_refusal(refused: Refused, rules: Rules) -> str:
    """Return why a stretch of the log is no experiment, and what to do."""
    why, number = refused.why, refused.number
    if why is Why.NOT_AT_REST:
        return (
            f"No experiment: the vehicle was not at rest before it moved at "
            f"{1e3 * abs(number):.0f} mm/s with the piston at a standstill. Hold it still for "
            f"{rules.minute:g} s first."
        )
    if why is Why.NOT_SETTLED:
        return (
            f"No experiment: the volume was changed by up to {1e6 * number:+.3g} cm3 and did not "
            "stand still. Open the loop before the release, and leave the piston alone."
        )
    if why is Why.STUCK:
        return (
            f"No experiment: the volume was changed by {1e6 * number:+.3g} cm3 and the vehicle did "
            "not move. Is it on the bottom, at the surface, or held by its tether?"
        )
    if why is Why.FEW_SAMPLES:
        return f"No experiment: {number:.0f} samples are too few. Log faster, or start further off."
    end = f": {refused.end.value}" if refused.end is not None else ""
    return (
        f"No experiment: it went only {abs(number):.2g} m{end}. Start further from where it ends."
    )
