"""Parameters given on the command line: which are sought, what is known of them, and how well."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from swimbladder.cli.options import Options, valued
from swimbladder.cli.texts import Given, Several
from swimbladder.units import quantity


@dataclass(frozen=True)
class Sought(Options):
    """What is identified, and what is known of it."""

    free: Given = valued(
        "NAME,...",
        "Parameters to identify: K2, T2, psi; mass, drag_quadratic; K1, T1 (those of the "
        "drag law, and psi).",
    )
    fixed: Several = valued("NAME=VALUE", 'Parameter fixed at a value: "psi=2e-6 m3/m".')
    priors: Several = valued("NAME=VALUE", 'Prior of a parameter: "psi=2e-6 +- 1e-6 m3/m".')
    drag: Given = valued("LAW", "Drag law: linear, quadratic or blended (the vehicle's).")


def deviation(unit: str) -> Callable[[str, str], float]:
    """Return what reads a standard deviation in `unit`, infinite for ``none``."""

    def read(text: str, option: str) -> float:
        return math.inf if text.strip().lower() == "none" else quantity(text, unit, option)

    return read
