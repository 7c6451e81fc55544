"""An Arduino library of a vehicle's controller: C, examples, a golden trace, and what to do."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from swimbladder.codegen.c99 import MEASUREMENT_H, write_c99
from swimbladder.codegen.c_names import c_field, c_float, c_law, c_number
from swimbladder.codegen.clock import MOST_TURNS, SOON
from swimbladder.codegen.golden import Golden, command_limits, fly
from swimbladder.codegen.meanings import facts_of
from swimbladder.codegen.pool import (
    PoolDay,
    PoolOptions,
    plan_pool_day,
    pool_facts,
)
from swimbladder.codegen.safety import supervisor_parameters
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.tree import COUNT, FLOAT
from swimbladder.codegen.twin import twin
from swimbladder.control.law import NEVER, Law
from swimbladder.control.protocol import POOL
from swimbladder.control.records import leaves
from swimbladder.control.supervisor import SUPERVISOR
from swimbladder.control.supervisor_records import Reason, SupervisorParameters, Watched
from swimbladder.errors import InputError
from swimbladder.io.files import check_place, publish
from swimbladder.sim.closed_loop.checks import check_sample_time
from swimbladder.sim.closed_loop.single import choose_law
from swimbladder.vehicle import Vehicle

__all__ = ["Library", "make_library", "write_library"]

_ON_BOARD = 100  # rows of the golden trace that a board checks


@dataclass(frozen=True, kw_only=True)
class Library:
    """The files of a library, and what they were made of."""

    vehicle: Vehicle
    law: Law
    parameters: Any
    tick_s: float
    limits: tuple[float, float]  # V or m3
    start_depth: float  # m, of the golden mission
    target: float  # m
    golden: Golden
    supervisor: SupervisorParameters
    pool: PoolDay | None
    files: Mapping[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        return {
            "vehicle": self.vehicle.name,
            "law": self.law.name,
            "command": self.law.command,
            "command_limits": list(self.limits),
            "tick_s": self.tick_s,
            "parameters": {
                name: {"value": float(np.float32(value)), "unit": self.law.units[name]}
                for name, value in leaves(self.parameters).items()
            },
            "supervisor": {
                name: {"value": _finite(value), "unit": SUPERVISOR.units[name]}
                for name, value in leaves(self.supervisor).items()
            },
            "golden": {
                "start_depth_m": self.start_depth,
                "target_depth_m": self.target,
                "ticks": len(self.golden.depth),
                "final_depth_m": float(self.golden.depth[-1]),
                "float32_difference_m": self.golden.difference,
            },
            "pool": None if self.pool is None else self.pool.to_json(),
        }


def _finite(value: float) -> float | None:
    """Return a limit as float32, or as the count it is; None where it is off."""
    if isinstance(value, int):
        return None if value == NEVER else value
    return None if math.isinf(value) else float(np.float32(value))


def make_library(
    vehicle: Vehicle, *, start_depth: float = 1.5, target: float = 3.0, duration: float = 400.0,
    seed: int | None = 1, pool: PoolOptions | None = None,
    progress: Callable[[int], None] | None = None,
) -> Library:  # fmt: skip
    """Return the library of a vehicle's controller; the golden mission is a depth step.

    start_depth, target [m], duration [s], seed: of its sensors' noise (None: ideal sensors); pool:
    the pool that its pool procedure is made for (None: it has none).
    Raises InputError where the vehicle has no controller or does not fit the pool, and
    NoAnswerError where it does not come through the mission, or through the pool day.
    """
    vehicle = vehicle if pool is None else _in_pool(vehicle, pool)
    law, parameters, tick_s = choose_law(vehicle, None, None, None)
    limits = supervisor_parameters(vehicle, tick_s, in_pool=pool is not None)
    for name, depth in (("start", start_depth), ("target", target)):
        if depth > limits.deep.depth_limit:
            raise InputError(
                "deeper than the supervisor allows", field=f"--{name}", value=depth, unit="m",
                remedy=f"Give up to {limits.deep.depth_limit:.4g} m, or say more of the vehicle "
                "in its [supervisor] table",
            )  # fmt: skip
    check_sample_time(vehicle, law, parameters, tick_s, depths=[start_depth, target])
    program = read_law(law)
    first = 0.0 if law.command == "voltage" else vehicle.stroke.maximum
    golden = fly(
        vehicle, law, twin(law, program), parameters, tick_s=tick_s, start_depth=start_depth,
        target=target, duration=duration, seed=seed, first=first, progress=progress,
    )  # fmt: skip
    day = None if pool is None else plan_pool_day(vehicle, pool, limits, seed=seed)
    source = write_c99(program)
    supervisor = write_c99(read_law(SUPERVISOR, Watched), private=True)
    facts = _facts(vehicle, law, parameters, tick_s, first) | {
        "reasons": list(Reason), "limits": _numbers(limits, SUPERVISOR.units),
        **facts_of(limits),
        "start": f"{start_depth:g}", "goal": f"{target:g}", "target": c_float(target),
        "ticks": len(golden.depth), "pool": day is not None, "day": False,
        "pushes": limits.proof.same_tried < NEVER,
    }  # fmt: skip
    if day is not None:
        facts |= pool_facts(day) | {"pool_numbers": _numbers(day.parameters, POOL.units)}
    rows = [
        [f"0x{np.float32(x).view(np.uint32):08x}" for x in row]
        for row in zip(*(column[:_ON_BOARD] for column in golden[:4]), strict=True)
    ]
    facts["rows"] = len(rows)
    avr = facts | {"boards": "an AVR (Uno, Nano, Mega)", "avr": True, "wait": False, "pwm": _PWM}
    other = facts | {"boards": "an ESP32 or RP2040", "avr": False, "wait": True, "pwm": _PWM_12}
    files = {
        "library.properties": _render("library.properties.j2", facts),
        "README.md": _render("README.md.j2", facts),
        "src/swb_measurement.h": MEASUREMENT_H,
        f"src/{source.header_name}": source.header,
        f"src/{source.source_name}": source.source,
        "src/swb_controller.h": _render("swb_controller.h.j2", facts),
        "src/swb_controller.c": _render("swb_controller.c.j2", facts),
        f"src/{supervisor.header_name}": supervisor.header,
        f"src/{supervisor.source_name}": supervisor.source,
        "src/swb_vehicle.h": _render("swb_vehicle.h.j2", facts),
        "src/swb_vehicle.c": _render("swb_vehicle.c.j2", facts),
        "examples/FloatAVR/FloatAVR.ino": _render("Float.ino.j2", avr),
        "examples/FloatESP32RP2040/FloatESP32RP2040.ino": _render("Float.ino.j2", other),
        "examples/GoldenTrace/GoldenTrace.ino": _render("GoldenTrace.ino.j2", facts),
        "examples/GoldenTrace/golden.h": _render("golden.h.j2", facts | {"rows": rows}),
        "extras/check.c": _render("check.c.j2", facts),
        "extras/golden.csv": _table(golden, tick_s, _COLUMN[law.command]),
    }
    if day is not None:
        procedure = write_c99(read_law(POOL))
        files |= {
            f"src/{procedure.header_name}": procedure.header,
            f"src/{procedure.source_name}": procedure.source,
            "src/swb_pool_day.h": _render("swb_pool_day.h.j2", facts),
            "src/swb_pool_day.c": _render("swb_pool_day.c.j2", facts),
            "examples/PoolDayAVR/PoolDayAVR.ino": _render("Float.ino.j2", avr | {"day": True}),
            "examples/PoolDayESP32RP2040/PoolDayESP32RP2040.ino": _render(
                "Float.ino.j2", other | {"day": True}
            ),
        }
    return Library(
        vehicle=vehicle, law=law, parameters=parameters, tick_s=tick_s,
        limits=command_limits(vehicle), start_depth=start_depth, target=target, golden=golden,
        supervisor=limits, pool=day, files=files,
    )  # fmt: skip


def _in_pool(vehicle: Vehicle, pool: PoolOptions) -> Vehicle:
    """Return the vehicle whose supervisor knows that it may lie on the pool's bottom."""
    if vehicle.supervisor.bottom_depth is not None:
        return vehicle
    knows = vehicle.supervisor.model_copy(update={"bottom_depth": pool.depth})
    return vehicle.model_copy(update={"supervisor": knows})


def write_library(library: Library, out: Path) -> list[Path]:
    """Write the files into the folder `out`, which appears whole; return their paths.

    In a folder that exists the sources of an earlier library that this one has not are removed:
    the Arduino IDE compiles whatever lies in src. Raises InputError where that is not possible.
    """

    def write(folder: Path) -> None:
        for name, text in library.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode("utf-8"))

    check_place(out)
    publish(out, write)
    for old in [*(out / "src").glob("swb_*.c"), *(out / "src").glob("swb_*.h")]:
        if f"src/{old.name}" not in library.files:
            _remove(old)
    return [out / name for name in library.files]


def _remove(path: Path) -> None:
    try:
        path.unlink()
    except OSError as error:
        raise InputError(
            f"cannot remove a source of another law: {error.strerror or error}", file=path,
            field="--out", remedy="Remove it by hand, or choose an empty folder",
        ) from error  # fmt: skip


_COLUMN = {"voltage": "voltage_V", "volume": "reference_volume_m3"}
_PWM = "analogWrite(PWM_PIN, 255.0f * fabsf(voltage) / BATTERY_VOLTS), and a pin for its sign"
_PWM_12 = "a duty cycle of fabsf(voltage) / BATTERY_VOLTS, and a pin for its sign"


def _facts(
    vehicle: Vehicle, law: Law, parameters: Any, tick_s: float, first: float
) -> dict[str, Any]:
    """Return what the templates are filled with."""
    plain = re.sub(r"[^\w .-]", "_", vehicle.name, flags=re.ASCII)
    low, high = command_limits(vehicle)
    volts = law.command == "voltage"
    columns = f"time_s,depth_m,volume_m3,{_COLUMN[law.command]},reference_depth_m"
    release = re.match(r"\d+\.\d+\.\d+", version("swimbladder"))
    return {
        "vehicle": plain,
        "library": f"Swimbladder {plain}",
        "version": release.group() if release else "0.0.0",
        "law": law.name,
        "c_law": c_law(law.name),
        "command": law.command,
        "unit": "V" if volts else "m3",
        "ends": "the supply's voltage" if volts else "the ends of the stroke",
        "tick": c_float(tick_s),
        "tick_text": f"{tick_s:.9g}",
        "tick_us": round(tick_s * 1e6),
        "low": c_float(low),
        "high": c_float(high),
        "low_text": f"{low:.6g}",
        "high_text": f"{high:.6g}",
        "first": c_float(first),
        "soon": SOON,
        "most_turns": MOST_TURNS,
        "digits": 3 if volts else 9,
        "header": columns,
        "drive": "put the voltage on the motor, positive: the volume grows" if volts
        else "send the actuator to the volume [m3]",
        "bench": "a positive voltage must make it grow." if volts
        else "the actuator must go where it is sent.",
        "parameters": _numbers(parameters, law.units),
    }  # fmt: skip


def _numbers(parameters: Any, units: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return (designator, value, unit) of each parameter, as C has them."""

    def of(record: Any, within: str) -> Iterator[tuple[str, str, str]]:
        for name, value in record._asdict().items():
            here = f"{within}{c_field(name)}"
            if isinstance(value, tuple):
                yield from of(value, f"{here}.")
            else:
                kind = COUNT if isinstance(value, int) else FLOAT
                yield here, c_number(value, kind), units[name]

    return list(of(parameters, ""))


def _render(template: str, facts: Mapping[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("swimbladder.codegen", "templates"),
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    return environment.get_template(template).render(facts)


def _table(golden: Golden, tick_s: float, column: str) -> str:
    """Return the golden trace as CSV, each number with the digits that give its float32 back."""
    lines = [f"tick,time_s,depth_m,volume_m3,reference_depth_m,{column}"]
    for n, row in enumerate(zip(*golden[:4], strict=True)):
        lines.append(",".join([str(n), f"{n * tick_s:.9g}", *map(str, row)]))
    return "\n".join(lines) + "\n"
