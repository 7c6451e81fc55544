"""An Arduino library of a vehicle's controller: C, examples, a golden trace, and what to do."""

import hashlib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from swimbladder.codegen import wire
from swimbladder.codegen.c99 import CSource, c_field, c_float, c_law, c_number, write_c99
from swimbladder.codegen.golden import BoardProgram, Golden, Mission, first_rows, fly
from swimbladder.codegen.pool import (
    BY_VOLTAGE,
    PoolDay,
    PoolOptions,
    in_float32,
    plan_pool_day,
    pool_summary,
)
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.tree import COUNT, FLOAT
from swimbladder.codegen.twin import MOST_TICKS, SOON
from swimbladder.control.arming import ARMING, DISARMED, Deck
from swimbladder.control.law import NEVER, Law
from swimbladder.control.protocol import POOL
from swimbladder.control.registry import own_law
from swimbladder.control.supervisor import GREW, SUPERVISOR, Reason, SupervisorParameters, Watched
from swimbladder.control.supervisor_limits import (
    arming_parameters,
    board_reach,
    check_time_limit,
    command_limits,
    summary,
    supervisor_parameters,
    time_limit,
)
from swimbladder.design.tuning.trial import usual_step
from swimbladder.errors import InputError, Parameter, check_number
from swimbladder.io.answers import Answer
from swimbladder.io.files import check_place, publish
from swimbladder.io.mission import of_step
from swimbladder.io.progress import Advance, silent
from swimbladder.sim.closed_loop.checks import check_sample_time, turned_round
from swimbladder.sim.closed_loop.floats import board_law
from swimbladder.sim.closed_loop.single import choose_law
from swimbladder.units import length
from swimbladder.vehicle import Vehicle

_ARRIVED = 0.1  # of the step, within which a golden trace has arrived
_LATER = 1.0  # ticks, by which a law may be called later than it says
_ON_BOARD = 100  # rows of the golden trace that a board checks
_ROW_S, _SAVE_S = 5.0, 600.0  # s, between rows of the black box, and between savings of it
LAUNCH, UNDER_WATER = 10, 60  # min, of the mission in a float's sketch
_IN_LOOP, _LOOP_FILES = "examples/HardwareInTheLoop", ("HardwareInTheLoop.ino", "hil.h")


STEP = Mission(1.5, 3.0, 400.0)
DIVE = Mission(0.0, 100.0, 5400.0)
"""What a float does instead. Of both other depths where the controller is for others, or the
supervisor turns the vehicle round above."""


@dataclass(frozen=True, kw_only=True)
class Library(BoardProgram, Answer):
    """The files of a library, and what they were made of."""

    vehicle: Vehicle
    mission: Mission
    golden: Golden
    pool: PoolDay | None
    files: Mapping[str, str]

    @property
    def sentences(self) -> list[str]:
        """The law, its golden trace, and what is to be done."""
        return list(self._words())

    def _words(self) -> Iterator[str]:
        golden, unit = self.golden, "V" if self.law.command == "voltage" else "m3"
        low, high = self.limits
        start, target, _ = self.mission
        end, way = float(golden.depth[-1]), f"{start:g} to {target:g} m"
        commands = f"command {low:.6g} to {high:.6g} {unit}"
        to_do = "fill in the two functions of an example"
        way_m = abs(self.mission.target - self.mission.start)
        there = abs(end - self.mission.target) <= _ARRIVED * way_m
        if self.drive is not None:
            commands, way = "command seconds of pump and valve", f"{way} and up again"
            to_do = "fill in one function of an example, and check its pins"
            there = end <= self.drive.parameters.surface.shallow
            if golden.depth.max() < (1.0 - _ARRIVED) * target:
                end, there = float(golden.depth.max()), False
        yield (
            f"{self.vehicle.name}: law {self.law.name} every {self.tick_s:.9g} s, {commands}; "
            f"C {digest(self).hex()}"
        )
        most, apart = (length(x, 2) for x in (golden.difference, golden.apart))
        moves = f"float32 moves the vehicle by at most {most} on its way, {apart} at its depth"
        ticks = f"{len(golden.depth)} ticks under the supervisor"
        yield f"golden trace: {way} in {ticks}; {moves}"
        if not there:
            yield (
                f"the golden trace ends at {end:.3g} m, before the vehicle has arrived: it tests "
                "less of the C than one with a longer `duration=`"
            )
        if self.drive is not None:
            yield self.drive.summary()
        yield summary(self.supervisor)
        if self.pool is not None:
            yield pool_summary(self.pool)
        yield f"to do: {to_do}; README.md says how, and how to check"

    def to_dict(self) -> dict[str, Any]:
        """Return what a program wants to know, in SI."""
        return {
            "vehicle": self.vehicle.name,
            "law": self.law.name,
            "sha256_of_c": digest(self).hex(),
            "command": self.law.command,
            "command_limits": list(self.limits),
            "tick_s": self.tick_s,
            "parameters": in_float32(self.parameters, self.law),
            "supervisor": in_float32(self.supervisor, SUPERVISOR),
            "arming": in_float32(self.arming, ARMING),
            "golden": {
                "start_depth_m": self.mission.start,
                "target_depth_m": self.mission.target,
                "ticks": len(self.golden.depth),
                "final_depth_m": float(self.golden.depth[-1]),
                "float32_difference_m": self.golden.difference,
                "float32_difference_at_depth_m": self.golden.apart,
            },
            "pool": None if self.pool is None else self.pool.to_dict(),
        } | ({} if self.drive is None else {"drive": self.drive.to_dict()})


def firmware(
    vehicle: Vehicle,
    *,
    step: tuple[float, float] | None = None,
    duration: float | None = None,
    seed: int | None = 1,
    pool: PoolOptions | None = None,
    advance: Advance = silent,
) -> Library:
    """Return the library of a vehicle's controller, with a golden mission.

    The golden mission is a depth step; a float's also comes up again.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    step
        Depths of the golden mission, from rest [m]; none: those of `STEP`, of a float those of
        `DIVE`, or others where the controller is for other depths.
    duration
        Of the golden mission [s]; none: that of `STEP` or `DIVE`.
    seed
        Of the sensors' noise; none: ideal sensors.
    pool
        The pool that the library's pool procedure is made for; none: it has none.
    advance
        Called with the share of the work that was done since.

    Returns
    -------
    Library
        The files of the library, which `write_library` writes, and what they were made of.

    Raises
    ------
    InputError
        The vehicle has no controller, its supervisor no time limit, or it does not fit the pool.
    NoAnswerError
        It does not come through the mission, or through the pool day.
    """
    floats = vehicle.command == "volume change"
    if pool is not None and floats:
        what = f"the pool {BY_VOLTAGE}, and this vehicle has a pump and a valve"
        remedy = "Leave it out, and log a dive of the sketch"
        raise InputError(
            what, field="bottom_depth", value=pool.bottom_depth, unit="m", remedy=remedy
        )
    check_time_limit(vehicle)
    vehicle = vehicle if pool is None else _in_pool(vehicle, pool)
    asked = *(step or (None, None)), duration
    mission, made = plan_program(vehicle, asked, in_pool=pool is not None)
    drive = made.drive
    with of_step():
        golden = fly(vehicle, made, mission, seed, advance)
    day = None if pool is None else plan_pool_day(vehicle, pool, made.supervisor, seed=seed)
    facts = made.facts | {
        "start": mission.start,
        "goal": mission.target,
        "ticks": len(golden.checked),
        "flown": len(golden.depth),
        "pool": day,
        "pool_units": POOL.units,
        "day": False,
        "pushes": made.supervisor.proof.same_tried < NEVER,
        "positioner": made.supervisor.rate.positioner > 0.0,
        "drive": drive,
        "time_limit": time_limit(made.supervisor),
        "launch_min": LAUNCH,
        "dive_min": UNDER_WATER,
        "density": vehicle.water.density,
        "lined": getattr(vehicle.engine, "line", None) is not None,
        "protocol": wire.FACTS,
        "c_bytes": ", ".join(f"0x{byte:02x}" for byte in digest(made)),
    }
    on_board = first_rows(made, golden, _ON_BOARD)
    rows = [[f"0x{np.float32(x).view(np.uint32):08x}" for x in row[:4]] for row in on_board]
    facts |= {"rows": len(rows), "unplugged": len(golden.depth)}
    sketch = "Float.ino.j2" if drive is None else "PumpFloat.ino.j2"
    readme = "README.md.j2" if drive is None else "README_float.md.j2"
    files = {
        "library.properties": render("library.properties.j2", facts),
        "README.md": render(readme, facts),
        **{f"src/{name}": text for name, text in made.sources.items()},
        **_sketches("Float", sketch, facts),
        "examples/GoldenTrace/GoldenTrace.ino": render("GoldenTrace.ino.j2", facts),
        "examples/GoldenTrace/golden.h": render(
            "golden.h.j2", facts | {"rows": rows, "reasons": [row[4] for row in on_board]}
        ),
        **{f"{_IN_LOOP}/{name}": render(f"{name}.j2", facts) for name in _LOOP_FILES},
        "extras/check.c": render("check.c.j2", facts),
        "extras/parts.md": render("parts.md.j2", facts),
        "extras/golden.csv": _table(golden, made.tick_s, made.facts["column"]),
    }
    if drive is not None:
        places = ("src/swb_drive.h", "src/swb_drive.c", "extras/board.c")
        files |= {place: render(f"{Path(place).name}.j2", facts) for place in places}
    if day is not None:
        procedure = write_c99(read_law(POOL))
        files |= {
            f"src/{procedure.header_name}": procedure.header,
            f"src/{procedure.source_name}": procedure.source,
            "src/swb_pool_day.h": render("swb_pool_day.h.j2", facts),
            "src/swb_pool_day.c": render("swb_pool_day.c.j2", facts),
            **_sketches("PoolDay", "Float.ino.j2", facts | {"day": True}),
        }
    return Library(
        **vars(made), vehicle=vehicle, mission=mission, golden=golden, pool=day, files=files
    )


def plan_program(
    vehicle: Vehicle, asked: Iterable[float | None] = (None,) * 3, *, in_pool: bool = False
) -> tuple[Mission, BoardProgram]:
    """Return the golden mission of a vehicle and its program.

    asked: the mission's numbers, where they are not the usual ones. Raises InputError as
    `firmware` does.
    """
    floats = vehicle.command == "volume change"
    limit = supervisor_parameters(vehicle, _controller(vehicle)[2]).deep.depth_limit
    tuned = None if vehicle.controller is None else vehicle.controller.depths
    least, most = tuned or (max(vehicle.hull.emergence_depth, 0.0), limit)
    usual = _usual(floats, least, min(most, limit))
    mission = Mission(*(u if a is None else a for u, a in zip(usual, asked, strict=True)))
    for depth in mission[:2]:
        if depth > limit:
            raise turned_round(depth, limit, "step")
    if tuned and not least <= mission.target <= most:
        what = f"the controller was tuned for {least:g} to {most:g} m, and the sketch begins here"
        remedy = "Give a depth within these, or tune for others (`swimbladder tune --depth-range`)"
        raise InputError(what, field="step", value=mission.target, unit="m", remedy=remedy)
    made = make_program(vehicle, depths=mission[:2], in_pool=in_pool)
    if floats:
        _check_dive(mission, made.parameters.surface.shallow)
    return mission, made


def _usual(floats: bool, least: float, most: float) -> Mission:
    """Return the golden mission where none is asked for, between two depths [m]."""
    if floats:
        deepest = DIVE.target if DIVE.target <= most else 0.5 * most
        return DIVE._replace(target=max(deepest, least))
    if least <= STEP.start and STEP.target <= most:
        return STEP
    start, target = usual_step(least, most)
    return STEP._replace(start=start, target=target)


def make_program(
    vehicle: Vehicle, *, depths: tuple[float, ...], in_pool: bool = False
) -> BoardProgram:
    """Return the program of a vehicle's controller, which is to hold it at some depths [m].

    in_pool: its supervisor is for a pool. Raises InputError as `firmware` does.
    """
    law, parameters, tick_s = _controller(vehicle)
    limits = supervisor_parameters(vehicle, tick_s, in_pool=in_pool)
    arming = arming_parameters(vehicle, limits)
    drive, ends = None, command_limits(vehicle, tick_s)
    if vehicle.command == "volume change":
        drive = board_law(vehicle, law, parameters, tick_s, deepest=board_reach(limits))
        law, parameters = drive.law, drive.parameters
    else:
        check_sample_time(vehicle, law, parameters, tick_s, depths=list(depths))
    program = read_law(law)
    first = vehicle.stroke.maximum if law.command == "volume" else 0.0
    most_wait = _most_wait(law, parameters, limits)
    command = dict(zip(("unit", "ends", "digits", "column"), _COMMANDS[law.command], strict=True))
    plain = re.sub(r"[^\w .-]", "_", vehicle.name, flags=re.ASCII)
    release = re.match(r"\d+\.\d+\.\d+", version("swimbladder"))
    facts = {
        "vehicle": plain,
        "library": f"Swimbladder {plain}",
        "law": law,
        "tick": tick_s,
        "version": release.group() if release else "0.0.0",
        "low": ends[0],
        "high": ends[1],
        "first": first,
        "most_wait": most_wait,
        "soon": SOON,
        "most_turns": GREW,
        **command,
        "parameters": parameters,
        "reasons": Reason,
        "header": f"time_s,depth_m,volume_m3,{command['column']},reference_depth_m",
        "limits": limits,
        "units": SUPERVISOR.units,
        "arming": arming,
        "arming_units": ARMING.units,
        "disarmed": DISARMED,
        **_box(vehicle, limits, ends),
    }
    sources = {"swb_measurement.h": render("swb_measurement.h", {})}
    on_deck = write_c99(read_law(ARMING, Deck))
    for translated in (write_c99(program), _supervisor_in_c(), on_deck):
        sources[translated.header_name] = translated.header
        sources[translated.source_name] = translated.source
    for around in ("controller", "vehicle", "box"):
        for name in (f"swb_{around}.h", f"swb_{around}.c"):
            sources[name] = render(f"{name}.j2", facts)
    return BoardProgram(
        law=law,
        parameters=parameters,
        tick_s=tick_s,
        first=first,
        most_wait=most_wait,
        limits=ends,
        supervisor=limits,
        arming=arming,
        drive=drive,
        program=program,
        facts=facts,
        sources=sources,
    )


def _most_wait(law: Law, parameters: Any, limits: SupervisorParameters) -> int:
    """Return the ticks that a board's law may wait: as it says, or as a command may fail to come.

    Raises InputError where that is longer than the board counts.
    """
    least = limits.board.missed
    if law.longest_wait is None:
        return least
    longest = law.longest_wait(parameters)
    most = longest / limits.S_p + _LATER
    if not most <= MOST_TICKS:
        what = f"the law {law.name} may wait for {longest:g} s, longer than the board counts"
        remedy = f"Give parameters with which it waits for {MOST_TICKS * limits.S_p:.3g} s at most"
        raise InputError(what, field="controller.parameters", remedy=remedy)
    return max(least, math.ceil(most))


@cache
def _supervisor_in_c() -> CSource:
    """Return the supervisor's C, which is every vehicle's."""
    return write_c99(read_law(SUPERVISOR, Watched), private=True)


def digest(made: BoardProgram) -> bytes:
    """Return 8 bytes by which a program's C is known, on a board too."""
    text = "".join(f"{name}\0{made.sources[name]}\0" for name in sorted(made.sources))
    return hashlib.sha256(text.encode("utf-8")).digest()[:8]


def _box(
    vehicle: Vehicle, limits: SupervisorParameters, ends: tuple[float, float]
) -> dict[str, float]:
    """Return what the black box of a vehicle counts in: ticks, m, m3 and the command's unit."""
    every = max(1, round(_ROW_S / limits.S_p))
    volume = 1.1 * max(abs(vehicle.stroke.minimum), abs(vehicle.stroke.maximum))
    return {
        "box_every": every,
        "box_save": max(1, round(_SAVE_S / (every * limits.S_p))),
        "box_depth": limits.depth.depth_most / 32767.0,
        "box_volume": volume / 32767.0,
        "box_command": max(map(abs, ends)) / 127.0,
    }


def _controller(vehicle: Vehicle) -> tuple[Law, Any, float]:
    """Return (law, its parameters, its sample time [s]) of a vehicle's own controller."""
    if vehicle.command != "volume change":
        return choose_law(vehicle, None, None, None)
    law, parameters = own_law(vehicle, sampled=False)
    assert vehicle.controller is not None  # own_law checks it
    return law, parameters, vehicle.controller.sample_time


def _check_dive(mission: Mission, shallow: float) -> None:
    """Raise InputError where a float's golden mission is none."""
    start, target, duration = mission
    check_number(start, "step", "m", least=0.0, remedy="A float starts at the surface or below it")
    deeper = f"A float dives deeper than {shallow:.3g} m"
    check_number(target, "step", "m", above=shallow, remedy=deeper)
    check_number(duration, "duration", "s", above=0.0)


def _in_pool(vehicle: Vehicle, pool: PoolOptions) -> Vehicle:
    """Return the vehicle whose supervisor knows that it may lie on the pool's bottom."""
    if vehicle.supervisor.bottom_depth is not None:
        return vehicle
    return vehicle.but("supervisor", bottom_depth=pool.bottom_depth)


def write_library(library: Library, out: str | Path) -> list[Path]:
    """Write the files of a library into a folder, which appears whole; return their paths.

    In a folder that exists the sources of an earlier library that this one has not are removed: the
    Arduino IDE compiles whatever lies in src.

    Parameters
    ----------
    library
        As `firmware` returns it.
    out
        The folder.

    Returns
    -------
    list of Path
        The path of each file.

    Raises
    ------
    InputError
        The folder cannot be written, or a source cannot be removed.
    """
    out = Path(out)

    def write(folder: Path) -> None:
        """Write every file of the library into a folder, byte for byte."""
        for name, text in library.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode("utf-8"))

    check_place(out)
    publish(out, write)
    for old in (out / "src").glob("swb_*.[ch]"):
        if f"src/{old.name}" in library.files:
            continue
        try:
            old.unlink()
        except OSError as error:
            what = f"cannot remove a source of another law: {error.strerror or error}"
            remedy = "Remove it by hand, or choose an empty folder"
            raise InputError(what, file=old, field=Parameter("out"), remedy=remedy) from error
    return [out / name for name in library.files]


_COMMANDS = {  # unit, what the limits are, digits in a log, column of a table
    "voltage": ("V", "the supply's voltage", 3, "voltage_V"),
    "volume": ("m3", "the ends of the stroke", 9, "reference_volume_m3"),
    "volume change": ("s", "a whole tick of a valve or of the pump", 3, "run_s"),
}
_PWM = "analogWrite(PWM_PIN, 255.0f * fabsf(voltage) / BATTERY_VOLTS), and a pin for its sign"
_PWM_12 = "a duty cycle of fabsf(voltage) / BATTERY_VOLTS, and a pin for its sign"
_BOARDS: dict[str, dict[str, Any]] = {
    "AVR": {"boards": "an AVR (Uno, Nano, Mega)", "avr": True, "wait": False, "pwm": _PWM},
    "ESP32RP2040": {"boards": "an ESP32 or RP2040", "avr": False, "wait": True, "pwm": _PWM_12},
}


def _sketches(name: str, template: str, facts: Mapping[str, Any]) -> dict[str, str]:
    """Return a sketch for each kind of board, and what PlatformIO needs of it, by their places."""
    files = {}
    for board, about in _BOARDS.items():
        folder, known = f"examples/{name}{board}", {**facts, **about}
        files[f"{folder}/{name}{board}.ino"] = render(template, known)
        files[f"{folder}/platformio.ini"] = render("platformio.ini.j2", known)
    return files


def _numbers(parameters: Any, units: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return (designator, value, unit) of each parameter, as C has them."""

    def of(record: Any, within: str) -> Iterator[tuple[str, str, str]]:
        """Yield the fields of a record, those of nested records with their path before."""
        for name, value in record._asdict().items():
            here = f"{within}{c_field(name)}"
            if isinstance(value, tuple):
                yield from of(value, f"{here}.")
            else:
                kind = COUNT if isinstance(value, int) else FLOAT
                yield here, c_number(value, kind), units[name]

    return list(of(parameters, ""))


def render(template: str, facts: Mapping[str, Any]) -> str:
    """Return a template of this package filled in."""
    environment = Environment(
        loader=PackageLoader("swimbladder.codegen", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    tick = facts.get("tick", 0.0)

    def after(count: int) -> str:
        return f"{count * tick:.3g} s" if count < NEVER else "never"

    environment.filters |= {
        "c": c_float,
        "c_law": c_law,
        "g": lambda x, digits: f"{x:.{digits}g}",
        "after": after,
        "numbers": _numbers,
        "seconds": lambda count: f"{count * tick:.0f}",
    }
    return environment.get_template(template).render(facts)


def meanings(limits: SupervisorParameters) -> list[tuple[int, str, str, str]]:
    """Return (number, name, what happened, after how long) for each reason, as README.md has it."""
    facts = {"limits": limits, "tick": limits.S_p, "reasons": Reason}
    text = render("reasons.md.j2", facts | {"time_limit": time_limit(limits)})
    found = []
    for row in text.splitlines()[2:]:
        reason, what, after = row.strip("| ").split(" | ")
        number, _, name = reason.partition(" ")
        found.append((int(number), name, what, after))
    return found


def _table(golden: Golden, tick_s: float, column: str) -> str:
    """Return the golden trace as CSV, each number with the digits that give its float32 back."""
    lines = [f"tick,time_s,depth_m,volume_m3,reference_depth_m,{column},supervisor_reason"]
    for n, (*numbers, reason) in enumerate(golden.checked):
        said = map(str, map(np.float32, numbers))
        lines.append(",".join([str(n), f"{n * tick_s:.9g}", *said, str(reason)]))
    return "\n".join(lines) + "\n"
