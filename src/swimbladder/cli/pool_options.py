"""What `swimbladder pool` is told of parameters: what is sought, how well, what is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from swimbladder.cli.common import quantity
from swimbladder.cli.logs import pair
from swimbladder.cli.settings import deviation, held
from swimbladder.cli.settings import priors as priors_of
from swimbladder.errors import InputError, UnitError
from swimbladder.units import parse_quantity

if TYPE_CHECKING:
    from swimbladder.design.pool_day import Asked, Rules, Target
    from swimbladder.io.plan import Plan
    from swimbladder.vehicle import Vehicle

__all__ = ["asked_of", "rules_of"]

_LEAST_CHANGE = 0.008  # of half the stroke
_STD = 0.02  # of a parameter, to which it is to be known


def rules_of(vehicle: Vehicle, bottom: float | None, travel: str, plan: Plan | None) -> Rules:
    """Return by which numbers phases are told apart; bottom [m], None where it is not known.

    A plan says where its records end.

    Raises InputError for a distance that tells nothing.
    """
    from swimbladder.design.pool_day import Rules

    far = quantity(travel, "m", "--travel")
    assert far is not None
    least = Rules().least_travel
    if not far > least:
        raise InputError(
            f"an experiment has to go further than {least:g} m", field="--travel", value=travel,
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
    rules = Rules(
        change=change, surface=vehicle.hull.emergence_depth + 0.1, travel=far,
        bottom=math.inf if bottom is None else bottom - 0.05,
    )  # fmt: skip
    # A quarter of the pool's depth is kept clear at either end: see paper_tasks.
    shallowest = vehicle.hull.emergence_depth + (least + 0.1) / 0.75
    if bottom is not None and bottom <= shallowest:
        raise InputError(
            f"too shallow: an experiment has to go further than {least:g} m",
            field="--pool-depth", value=bottom, unit="m",
            remedy=f"Give the depth of the bottom, more than {shallowest:.2g} m",
        )  # fmt: skip
    return rules


def asked_of(
    vehicle: Vehicle, *, free: tuple[str, ...] | None, fixed: Sequence[str],
    priors: Sequence[str], drag: str | None, neutral_std: str, target: str | None,
    target_std: str | None,
) -> Asked:  # fmt: skip
    """Return what is to be identified, how well, and what is known before.

    Raises InputError for what this vehicle does not have.
    """
    from swimbladder.design.pool_day import Asked
    from swimbladder.estimation.motion.model import check_names, default_names, model_of

    known, before = held(fixed), priors_of(priors)
    model = model_of(vehicle, law=drag, bottom_depth=math.inf)
    chosen = default_names(model.law, list(known)) if free is None else free
    for option, given in (
        ("--free", chosen), ("--set", tuple(known)), ("--prior", tuple(before)),
    ):  # fmt: skip
        check_names(given, model, voltage=False, option=option)
    std = deviation(neutral_std, "m3", "--neutral-std")
    return Asked(
        targets=_targets(target, target_std, chosen), free=free, fixed=known, priors=before,
        drag=drag, neutral_std=std,
    )  # fmt: skip


def _targets(text: str | None, each: str | None, names: Sequence[str]) -> tuple[Target, ...]:
    from swimbladder.design.pool_day import Target
    from swimbladder.estimation.motion.model import NAMES

    if text is not None and each is not None:
        raise InputError(
            "--target says each by itself", field="--target-std", value=each,
            remedy="Give one of the two",
        )  # fmt: skip
    if text is None:
        share = _STD if each is None else _share(each, "--target-std")
        main = [name for name in ("K2", "T2", "mass") if name in names]
        if "mass" in main or not main:
            main = [name for name in names if name != "psi"]
        return tuple(Target(name, share) for name in main)
    found = []
    for item in text.split(","):
        name, value = pair(item, "--target")
        if name not in names:
            raise InputError(
                "it is not identified", field="--target", value=name,
                remedy=f"Choose from {', '.join(names)}",
            )  # fmt: skip
        try:
            found.append(Target(name, _share(value, "--target")))
        except UnitError:
            std = quantity(value, NAMES[name].unit, f"--target {name}")
            assert std is not None
            if not std > 0.0:
                raise InputError(
                    "it must be above 0", field=f"--target {name}", value=value,
                    unit=NAMES[name].unit, remedy="Give a standard deviation, or a share like 2 %",
                ) from None  # fmt: skip
            found.append(Target(name, std, relative=False))
    return tuple(found)


def _share(text: str, option: str) -> float:
    try:
        number = parse_quantity(text, "")
    except InputError as error:
        raise error.at(field=option) from None
    if not 0.0 < number < 1.0:
        raise InputError(
            "it must be a share above 0 and below 1", field=option, value=text,
            remedy="Write it like 2 %",
        )  # fmt: skip
    return number
