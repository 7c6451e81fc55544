"""``swimbladder analyse``: linear models, stability, margins and what depth does."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from swimbladder.cli.common import Output, console, emit_json, output, progress, quantity

if TYPE_CHECKING:
    from swimbladder.design.linear import Analysis, Margins
    from swimbladder.design.linear.pump_valve import DriveRates


def analyse(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Preset or TOML file.")],
    depth: Annotated[
        str, typer.Option("--depth", metavar="DEPTH", help="Depth of the rest it is about.")
    ] = "0 m",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for analysis.json, analysis.txt and pictures."
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object and nothing else.")
    ] = False,
) -> None:
    """Linear models with their numbers, poles, Routh's table, margins of the sampled loop.

    The depth is in m, or carries a unit: --depth "50 m". Exit code 1 when the vehicle has a
    controller and its closed loop is not stable, or cannot rest at the depth.
    """
    metres = quantity(depth, "m", "--depth")
    assert metres is not None
    with progress("analysing"):
        a = _analysis(vehicle, metres)
    files = [] if out is None else _write(a, out)
    if json:
        emit_json({**a.to_json(), "files": [str(path) for path in files]})
    else:
        _show(a, output)
        for path in files:
            output.print(f"wrote {path}", soft_wrap=True)
    if not a.rests:
        console.print(
            f"no rest: stroke or supply do not hold {a.vehicle.name} at {a.depth:g} m",
            soft_wrap=True,
        )
    if a.stable is False or not a.rests:
        raise typer.Exit(1)


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


def _write(a: Analysis, out: Path) -> list[Path]:
    """Write the answer, the report and the pictures; return their paths."""
    import io
    import json

    from swimbladder.io.files import make_folder, write_atomically

    folder = make_folder(out)
    text = io.StringIO()
    _show(a, Output(file=text, width=100, color_system=None))
    report = "".join(line.rstrip() + "\n" for line in text.getvalue().splitlines())
    answer = json.dumps(a.to_json(), indent=2, allow_nan=False)
    files = [
        write_atomically(folder / "analysis.json", answer + "\n"),
        write_atomically(folder / "analysis.txt", report),
    ]
    with progress("drawing"):
        from swimbladder.show.plots import linear
        from swimbladder.show.plots.style import save

        pictures = {"open_loop": linear.draw_open_loop, "poles": linear.draw_poles}
        if a.drive is not None:
            pictures["drive"] = linear.draw_drive
        if a.closed_loop is not None:
            pictures |= {"loop_gains": linear.draw_loop_gains, "nyquist": linear.draw_nyquist}
        files += [save(draw(a), folder / f"{name}.png") for name, draw in pictures.items()]
    return files


def _show(a: Analysis, console: Console) -> None:
    """Print everything there is to read, tables between the sentences."""
    for part in _report(a):
        console.print(part)


def _report(a: Analysis) -> list[RenderableType]:
    """Return what is printed, part by part."""
    said = a.findings
    parts: list[RenderableType] = [
        Text(f"Linear analysis of {a.vehicle.name} at {a.depth:g} m", style="bold")
    ]
    parts += _section("Rest", said["rest"], ())
    loops = (_transfer_functions(a), _poles(a), _routh(a))
    moving, drive = ((), ()) if a.drive is None else ((_motions(a),), (_drive(a.drive),))
    parts += _section("Open loop", said["open loop"], (*loops, *moving))
    parts += _section("Depth", said["depth"], (_neutral_volume(a), *drive))
    tables = () if a.closed_loop is None else (_modes(a), _margins(a))
    parts += _section("Closed loop", said["closed loop"], tables)
    return parts


def _section(
    title: str, sentences: Sequence[str], tables: Sequence[Table]
) -> Iterator[RenderableType]:
    yield Text(f"\n{title}", style="bold")
    yield from (Text(sentence) for sentence in sentences)
    yield from (Padding(table, (1, 0, 0, 2)) for table in tables)


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="", box=None, pad_edge=False)
    for heading in headings:
        left = heading in ("equation", "numbers", "row", "")
        table.add_column(heading, justify="left" if left else "right")
    return table


def _transfer_functions(a: Analysis) -> Table:
    table = _table("Transfer functions", "equation", "numbers")
    for t in a.transfer_functions:
        name = ", ".join(f"({number})" for number in t.equations)
        numbers = f"({_polynomial(t.numerator)}) / ({_polynomial(t.denominator)})"
        table.add_row(f"{name} {t.output}/{t.input}", f"{t.symbols}\n= {numbers}")
    return table


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
    table = _table("Poles of the open loop", "1/s", "time constant s", "period s")
    for pole in a.open_loop.poles:
        decays = f"{-1.0 / pole.real:.4g}" if pole.real < 0.0 else ""
        grows = f"grows, {1.0 / pole.real:.4g}" if pole.real > 0.0 else "stays"
        period = f"{2.0 * math.pi / abs(pole.imag):.4g}" if pole.imag else ""
        table.add_row(_complex(pole), decays or grows, period)
    return table


def _routh(a: Analysis) -> Table:
    routh = a.open_loop.routh
    width = max(len(row) for row in routh.rows)
    table = _table("Routh's table of the open loop", "row", *[" "] * width, "")
    for power, row, note in zip(routh.powers, routh.rows, routh.notes, strict=True):
        table.add_row(f"s^{power}", *row, *[""] * (width - len(row)), note)
    return table


def _neutral_volume(a: Analysis) -> Table:
    table = _table("Neutral volume", "depth m", "volume cm3", "")
    stroke = a.vehicle.stroke
    for z, volume in zip(a.neutral.depths, a.neutral.volumes, strict=True):
        outside = "" if stroke.minimum <= volume <= stroke.maximum else "outside the stroke"
        table.add_row(f"{z:g}", f"{volume * 1e6:.2f}", outside)
    return table


def _motions(a: Analysis) -> Table:
    headings = ("speed cm/s", "1/s", "speed follows in s", "grows e-fold in s", "period s")
    table = _table("The body at rest and on its way, its volume kept", *headings)
    for m in a.motions:
        times = (m.time_constant, m.growth_time, m.period)
        texts = [f"{t:.4g}" if math.isfinite(t) else "" for t in times]
        table.add_row(f"{100.0 * m.speed:g}", ", ".join(map(_complex, m.poles)), *texts)
    return table


def _drive(d: DriveRates) -> Table:
    headings = (
        "depth m",
        "pump cm3/s",
        "its power W",
        "valve cm3/s",
        "bypass cm3/s",
        "leaks cm3/d",
    )
    table = _table("Pump and valves", *headings)
    for z, pump, power, valve, bypass, leak in zip(
        d.depths, d.pump, d.pump_power, d.valve, d.bypass, d.leakage, strict=True
    ):
        rates = (f"{1e6 * rate:.4g}" for rate in (valve, bypass))
        table.add_row(
            f"{z:g}", f"{1e6 * pump:.4g}", f"{power:.4g}", *rates, f"{86400e6 * leak:.3g}"
        )
    return table


def _modes(a: Analysis) -> Table:
    assert a.closed_loop is not None
    table = _table("Poles of the closed loop", "z", "1/s", "damping", "time constant s")
    for mode in a.closed_loop.modes:
        s = "at once" if mode.s.real == -math.inf else _complex(mode.s)
        time = "grows" if mode.time_constant == math.inf else f"{mode.time_constant:.4g}"
        table.add_row(_complex(mode.z), s, f"{mode.damping:.3f}", time)
    return table


def _margins(a: Analysis) -> Table:
    c = a.closed_loop
    assert c is not None
    command = "voltage" if a.vehicle.voltage_driven else "volume"
    table = _table("Margins, the loop broken at the", "", command, "depth")
    delays = (c.computation_delay, c.depth_delay)
    columns = [
        _column(m, delay) for m, delay in zip((c.at_command, c.at_depth), delays, strict=True)
    ]
    for name, at_command in columns[0].items():
        table.add_row(name, at_command, columns[1][name])
    return table


def _column(m: Margins | None, delay: float) -> dict[str, str]:
    """The margins at one place as text; dashes where the loop is not stable."""

    def text(value: float, unlimited: str = "any") -> str:
        return unlimited if math.isinf(value) else f"{value:.4g}"

    return {
        "gain may grow, times": text(m.gain_up) if m else "-",
        "gain may fall to": text(m.gain_down) if m else "-",
        "phase, degrees": text(math.degrees(m.phase)) if m else "-",
        "delay by the phase, s": text(m.delay) if m else "-",
        "delay by eigenvalues, s": text(delay) if m else "-",
        "peak sensitivity": text(m.peak_sensitivity) if m else "-",
        "disk margin": text(m.disk) if m else "-",
    }


def _complex(value: complex) -> str:
    return f"{value.real:.5g}" if value.imag == 0.0 else f"{value.real:.5g} {value.imag:+.5g}i"
