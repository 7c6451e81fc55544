"""``swimbladder analyse``: linear models, stability, margins and what depth does."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.padding import Padding
from rich.text import Text

from swimbladder.cli.common import Output, aside, progress, table, text_lines, typed_command
from swimbladder.cli.options import Files, Options, VehicleName, grouped, valued

if TYPE_CHECKING:
    from rich.table import Table

    from swimbladder.design.linear import Analysis, Margins
    from swimbladder.design.linear.pump_valve import DriveRates


@dataclass(frozen=True)
class Asked(Options):
    """Where the vehicle rests."""

    depth: str = valued("DEPTH", "Depth of the operating point.", "0 m")


@grouped(out=None)
def analyse(vehicle: VehicleName, *, asked: Asked, to: Files) -> None:
    """Linear models: poles, Routh's table, margins of the sampled loop.

    The depth is in m, or carries a unit: --depth "50 m". Exit code 1 when the vehicle has a
    controller and its closed loop is not stable, or cannot rest at the depth. Files are written
    with --out.
    """
    with progress("analysing"):
        a = _analysis(vehicle, asked.read()["depth"])
    if not a.rests:
        aside(f"no rest: stroke or supply do not hold {a.vehicle.name} at {a.depth:g} m")
    to.answer(a.to_dict(), _shown(a), partial(_files, a), good=a.rests and a.stable is not False)


def _files(a: Analysis, numbers: Mapping[str, Any]) -> Mapping[str, object]:
    from swimbladder.show.answers import contents

    paper = Output(width=100, color_system=None, highlight=False)
    lines = (line for part in _shown(a) for line in text_lines(part, paper))
    report = "".join(f"{line}\n" for line in lines)
    return {**contents(a, numbers, typed_command()), "analysis.txt": report}


def _analysis(vehicle: str, depth: float) -> Analysis:
    from swimbladder.design.analysis import analyse as analyse_vehicle
    from swimbladder.design.linear.analyse import check_depth
    from swimbladder.errors import InputError
    from swimbladder.io.config import load_vehicle, locate

    check_depth(depth, field="--depth")
    loaded = load_vehicle(vehicle)
    try:
        return analyse_vehicle(loaded, depth=depth)
    except InputError as error:
        raise (locate(error, vehicle) if Path(vehicle).is_file() else error) from None


def _shown(a: Analysis) -> Iterator[object]:
    """Give what there is to read, then the tables."""
    yield Text(f"Linear analysis of {a.vehicle.name} at {a.depth:g} m", style="bold")
    yield from a.sentences
    closed = [] if a.closed_loop is None else [_modes(a), _margins(a)]
    pumped = [] if a.drive is None else [_drive(a.drive), _motions(a)]
    tables = (*closed, _neutral_volume(a), *pumped, _poles(a), _routh(a), _transfer_functions(a))
    yield from (Padding(one, (1, 0, 0, 2)) for one in tables)


def _titled(title: str, headings: Sequence[str], rows: Iterable[Iterable[str]]) -> Table:
    left = {"equation", "numbers", "row", ""}
    given = {"title_justify": "left", "title_style": "", "collapse_padding": False}
    return table(headings, rows, left=left, title=title, **given)


def _transfer_functions(a: Analysis) -> Table:
    rows = []
    for t in a.transfer_functions:
        name = ", ".join(f"({number})" for number in t.equations)
        numbers = f"({_polynomial(t.numerator)}) / ({_polynomial(t.denominator)})"
        rows.append((f"{name} {t.output}/{t.input}", f"{t.symbols}\n= {numbers}"))
    return _titled("Transfer functions", ("equation", "numbers"), rows)


def _polynomial(coefficients: Sequence[float]) -> str:
    """Text of a polynomial in s, descending powers."""
    terms: list[str] = []
    for power, c in zip(range(len(coefficients) - 1, -1, -1), coefficients, strict=True):
        if c != 0.0 or len(coefficients) == 1:
            variable = "" if power == 0 else " s" if power == 1 else f" s^{power}"
            sign = ("- " if c < 0.0 else "+ ") if terms else ("-" if c < 0.0 else "")
            terms.append(f"{sign}{abs(c):.6g}{variable}")
    return " ".join(terms)


def _poles(a: Analysis) -> Table:
    rows = []
    for pole in a.open_loop.poles:
        time = f"{abs(1.0 / pole.real):.4g}" if pole.real else "stays"
        period = f"{2.0 * math.pi / abs(pole.imag):.4g}" if pole.imag else ""
        rows.append((_complex(pole), f"{'grows, ' if pole.real > 0.0 else ''}{time}", period))
    return _titled("Poles of the open loop", ("1/s", "time constant s", "period s"), rows)


def _routh(a: Analysis) -> Table:
    routh = a.open_loop.routh
    width = max(len(row) for row in routh.rows)
    rows = (
        (f"s^{power}", *row, *[""] * (width - len(row)), note)
        for power, row, note in zip(routh.powers, routh.rows, routh.notes, strict=True)
    )
    return _titled("Routh's table of the open loop", ("row", *[" "] * width, ""), rows)


def _neutral_volume(a: Analysis) -> Table:
    stroke = a.vehicle.stroke
    rows = []
    for z, volume in zip(a.neutral.depths, a.neutral.volumes, strict=True):
        inside = stroke.minimum <= volume <= stroke.maximum
        rows.append((f"{z:g}", f"{volume * 1e6:.2f}", "" if inside else "outside the stroke"))
    return _titled("Neutral volume", ("depth m", "volume cm3", ""), rows)


def _motions(a: Analysis) -> Table:
    headings = ("speed cm/s", "1/s", "speed follows in s", "grows e-fold in s", "period s")
    rows = []
    for m in a.motions:
        times = (m.time_constant, m.growth_time, m.period)
        texts = [f"{t:.4g}" if math.isfinite(t) else "" for t in times]
        rows.append((f"{100.0 * m.speed:g}", ", ".join(map(_complex, m.poles)), *texts))
    return _titled("The body at rest and on its way, its volume kept", headings, rows)


def _drive(d: DriveRates) -> Table:
    columns = {
        "depth m": [f"{z:g}" for z in d.depths],
        "pump cm3/s": [f"{1e6 * rate:.4g}" for rate in d.pump],
        "its power W": [f"{power:.4g}" for power in d.pump_power],
        "valve cm3/s": [f"{1e6 * rate:.4g}" for rate in d.valve],
        "bypass cm3/s": [f"{1e6 * rate:.4g}" for rate in d.bypass],
        "leaks cm3/d": [f"{86400e6 * leak:.3g}" for leak in d.leakage],
    }
    return _titled("Pump and valves", [*columns], zip(*columns.values(), strict=True))


def _modes(a: Analysis) -> Table:
    assert a.closed_loop is not None
    rows = []
    for mode in a.closed_loop.modes:
        s = "at once" if mode.s.real == -math.inf else _complex(mode.s)
        time = "grows" if mode.time_constant == math.inf else f"{mode.time_constant:.4g}"
        rows.append((_complex(mode.z), s, f"{mode.damping:.3f}", time))
    return _titled("Poles of the closed loop", ("z", "1/s", "damping", "time constant s"), rows)


def _margins(a: Analysis) -> Table:
    c = a.closed_loop
    assert c is not None
    command = "voltage" if a.vehicle.voltage_driven else "volume"
    at_command = _column(c.at_command, c.computation_delay)
    at_depth = _column(c.at_depth, c.depth_delay)
    rows = ((name, text, at_depth[name]) for name, text in at_command.items())
    return _titled("Margins, the loop broken at the", ("", command, "depth"), rows)


def _column(m: Margins | None, delay: float) -> dict[str, str]:
    """The margins at one place as text; dashes where the loop is not stable."""
    numbers = {
        "gain may grow, times": m and m.gain_up,
        "gain may fall to": m and m.gain_down,
        "phase, degrees": m and math.degrees(m.phase),
        "delay by the phase, s": m and m.delay,
        "delay by eigenvalues, s": m and delay,
        "peak sensitivity": m and m.peak_sensitivity,
        "disk margin": m and m.disk,
    }
    return {
        name: "-" if x is None else "any" if math.isinf(x) else f"{x:.4g}"
        for name, x in numbers.items()
    }


def _complex(value: complex) -> str:
    return f"{value.real:.5g}" if value.imag == 0.0 else f"{value.real:.5g} {value.imag:+.5g}i"
