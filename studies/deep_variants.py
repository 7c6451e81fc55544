"""One set for all dives of a real float, with this or that reckoned otherwise.

::

    python -m studies.deep_variants DATA

DATA is the folder of measured data; its `mermaid_p0051` is read. The set that fits all looks has
a smaller drag than each dive by itself (`studies.deep_dives`). Printed are its drag, how much of
what the dives say counts, what the volume balance is off by and what the pump gives in all, with
the drag held where the dives by themselves have it, with a pump that slips, with trapped air, and
with a cast that errs five times as much.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studies.deep_data import dives_of
from studies.deep_dives import float_vehicle
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep import effects_json
from swimbladder.estimation.motion.deep_fit import DeepFit, balance, fit_deep
from swimbladder.estimation.motion.deep_model import (
    CAST,
    DEFAULT,
    Body,
    DeepDive,
    body_of,
    priors_of,
    run_volumes,
)

__all__ = ["Variant", "main"]

ERRS = 5.0  # times what a cast is usually taken to err by


@dataclass(frozen=True)
class Variant:
    """What is reckoned otherwise."""

    name: str
    fixed: Mapping[str, float] = field(default_factory=dict)
    more: tuple[str, ...] = ()  # that are identified too
    cast: float = 1.0  # times its usual errors


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("data", type=Path, help="folder of measured data")
    folder = parser.parse_args().data / "mermaid_p0051"
    vehicle = float_vehicle()
    body, dives = body_of(vehicle), dives_of(folder, vehicle)
    known = priors_of(vehicle, {})
    print("| | drag, N s2/m2 | tempering | imbalance, mL rms | pumped, mL |")
    print("|---|---:|---:|---:|---:|")

    def told(variant: Variant) -> DeepFit:
        errors = {name: Prior(0.0, variant.cast * known[name].std) for name in CAST}
        fit = fit_deep(
            body, dives, known | errors, free=(*DEFAULT, *variant.more), fixed=variant.fixed
        )
        print(_row(variant.name, body, dives, fit), flush=True)
        return fit

    drag = (effects_json(told(Variant("one set"))) or {})["drag"]["value"]
    told(Variant(f"drag held at {drag:.0f}", fixed={"drag": drag}))
    told(Variant("a pump that slips", more=("pump_slip",)))
    told(Variant("trapped air", more=("trapped_air",)))
    told(Variant(f"a cast that errs {ERRS:.0f} times as much", cast=ERRS))


def _row(name: str, body: Body, dives: list[DeepDive], fit: DeepFit) -> str:
    imbalances = [
        balance(body, fit.values, float(start), dive)
        for start, dive in zip(fit.starts, dives, strict=True)
    ]
    off = 1e6 * float(np.sqrt(np.mean(np.concatenate(imbalances) ** 2)))
    pumped = 1e6 * sum(float(np.sum(np.maximum(run_volumes(fit.values, d), 0.0))) for d in dives)
    return f"| {name} | {fit.values['drag']:.1f} | {fit.tempering:.2f} | {off:.2f} | {pumped:.0f} |"


if __name__ == "__main__":
    main()
