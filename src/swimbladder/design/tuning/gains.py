"""Gains of each law that is tuned, as its recipe makes them."""

from __future__ import annotations

from typing import Any

from swimbladder.control.law import Law
from swimbladder.control.recipe import Recipe, Setting
from swimbladder.control.registry import LAWS
from swimbladder.errors import InputError
from swimbladder.vehicle.schema import did_you_mean


def tunable_names(command: str | None = None) -> list[str]:
    """Return the names of the laws that are tuned, of those that give a command where named."""
    return [
        name
        for name, law in LAWS.items()
        if law.recipe is not None and command in (None, law.command)
    ]


def tunable(name: str) -> Law:
    """Return the law of that name; raises InputError where it is not one that is tuned."""
    law = LAWS.get(name)
    if law is None or law.recipe is None:
        names = tunable_names()
        raise InputError(
            "this law is not tuned", field="--law", value=name,
            remedy=f"{did_you_mean(name, names)}Choose from {', '.join(names)}",
        )  # fmt: skip
    return law


def recipe_of(name: str) -> Recipe:
    """Return how the parameters of that law are made; raises InputError where it is not tuned."""
    recipe = tunable(name).recipe
    assert recipe is not None
    return recipe


def gains(name: str, setting: Setting, knobs: Any) -> Any:
    """Return the parameters of the law of that name."""
    return recipe_of(name).gains(setting, knobs)
