"""What a day at the pool goes by: what is sought and how well, and when an experiment is over."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from swimbladder.design.pool_day.day import Asked
from swimbladder.design.pool_day.rest import Rules
from swimbladder.design.pool_day.verdict import Target
from swimbladder.errors import InputError
from swimbladder.estimation.motion import NEUTRAL_STD, Prior
from swimbladder.estimation.motion.model import NAMES, check_names, default_names, model_of
from swimbladder.estimation.motion.run import check_std
from swimbladder.io.plan import Plan
from swimbladder.vehicle import Vehicle

_LEAST_CHANGE = 0.008  # of half the stroke
_STD = 0.02  # of a parameter, to which it is to be known


def rules_of(
    vehicle: Vehicle, *, pool_depth: float | None = None, travel: float = Rules().travel,
    plan: Plan | None = None,
) -> Rules:  # fmt: skip
    """Return by which numbers phases are told apart.

    pool_depth: of the bottom, None where it is not known; travel: after which an experiment is
    over [m]. A plan says where its records end. Raises InputError for a distance that tells
    nothing.
    """
    least = Rules().least_travel
    if not travel > least:
        raise InputError(
            f"an experiment has to go further than {least:g} m", field="travel", value=travel,
            unit="m", remedy="Give more, or leave it out",
        )  # fmt: skip
    half = 0.5 * (vehicle.stroke.maximum - vehicle.stroke.minimum)
    change = _LEAST_CHANGE * half
    if plan is not None:
        least = min(abs(one.moves[0].volume) for one in plan.experiments)
        return Rules(
            change=min(change, 0.5 * least), surface=plan.shallowest, bottom=plan.deepest,
            travel=math.inf, turns=True,
            longest=max(one.longest for one in plan.experiments),
        )  # fmt: skip
    # A quarter of the pool's depth is kept clear at either end: see paper_tasks.
    shallowest = vehicle.hull.emergence_depth + (least + 0.1) / 0.75
    if pool_depth is not None and pool_depth <= shallowest:
        raise InputError(
            f"too shallow: an experiment has to go further than {least:g} m", field="pool_depth",
            value=pool_depth, unit="m",
            remedy=f"Give the depth of the bottom, more than {shallowest:.2g} m",
        )  # fmt: skip
    return Rules(
        change=change, surface=vehicle.hull.emergence_depth + 0.1, travel=travel,
        bottom=math.inf if pool_depth is None else pool_depth - 0.05,
    )  # fmt: skip


def asked_of(
    vehicle: Vehicle, *, free: tuple[str, ...] | None = None,
    fixed: Mapping[str, float] | None = None, priors: Mapping[str, Prior] | None = None,
    drag: str | None = None, neutral_std: float = NEUTRAL_STD,
    target: Sequence[Target] | None = None, target_std: float | None = None,
) -> Asked:  # fmt: skip
    """Return what is to be identified, how well, and what is known before.

    target: of each by itself, or target_std [-] of all but psi. Raises InputError for what this
    vehicle does not have.
    """
    fixed, priors = dict(fixed or {}), dict(priors or {})
    model = model_of(vehicle, law=drag, bottom_depth=math.inf)
    chosen = default_names(model.law, list(fixed)) if free is None else free
    for field, given in (("free", chosen), ("fixed", tuple(fixed)), ("priors", tuple(priors))):
        check_names(given, model, voltage=False, option=field)
    check_std("neutral_std", neutral_std, "m3")
    return Asked(
        targets=_targets(target, target_std, chosen), free=free, fixed=fixed, priors=priors,
        drag=drag, neutral_std=neutral_std,
    )  # fmt: skip


def _targets(
    given: Sequence[Target] | None, each: float | None, names: Sequence[str]
) -> tuple[Target, ...]:
    if given is None:
        share = _STD if each is None else each
        _check_share("target_std", share)
        main = [name for name in ("K2", "T2", "mass") if name in names]
        if "mass" in main or not main:
            main = [name for name in names if name != "psi"]
        return tuple(Target(name, share) for name in main)
    if each is not None:
        raise InputError(
            "each is said by itself already", field="target_std", value=each,
            remedy="Give one of the two",
        )  # fmt: skip
    for one in given:
        if one.name not in names:
            raise InputError(
                "it is not identified", field="target", value=one.name,
                remedy=f"Choose from {', '.join(names)}",
            )  # fmt: skip
        if one.relative:
            _check_share("target", one.std)
        elif not one.std > 0.0:
            raise InputError(
                "it must be above 0", field="target", value=one.std, unit=NAMES[one.name].unit,
                remedy="Give a standard deviation, or a share like 2 %",
            )  # fmt: skip
    return tuple(given)


def _check_share(field: str, share: float) -> None:
    if not 0.0 < share < 1.0:
        raise InputError(
            "it must be a share above 0 and below 1", field=field, value=share,
            remedy="Write it like 2 %",
        )  # fmt: skip
