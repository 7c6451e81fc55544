"""What the linear models say, as it is shown: words, tables, pictures."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swimbladder.design.analysis import Analysis
from swimbladder.design.linear import ClosedLoop, Margins, StateSpace
from swimbladder.design.linear.margins import frequency_response
from swimbladder.design.linear.pump_valve import drive_rates
from swimbladder.physics.arrays import Array
from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.picture import Ink, Panel, Picture, grid_of, one_panel, stacked
from swimbladder.show.text import as_text

_DEPTHS = 401  # of the rates of pump and valve: near the surface a valve goes with a root


class _Break(NamedTuple):
    """A place where the loop is broken, and how it is drawn."""

    name: str
    loop: StateSpace
    margins: Margins | None
    color: str
    line: str


def draw_open_loop(analysis: Analysis) -> Picture:
    """Draw the Bode diagram of the open loop, command to depth."""
    w, response = analysis.response()
    rates = np.abs([p for p in analysis.open_loop.poles if abs(p) > 1e-9])
    what, unit = ("voltage", "m/V") if analysis.vehicle.voltage_driven else ("volume", "m/m³")
    title = f"open loop, {what} to depth (dotted: moduli of the poles)"
    name = f"{analysis.vehicle.name}: {title}"
    picture, top, bottom = _bode(f"|depth/{what}| [{unit}]", name)
    top.line(w, np.abs(response))
    bottom.line(w, _phase(response))
    for rate in sorted({float(f"{rate:.9g}") for rate in rates}):
        for panel in (top, bottom):
            panel.rule("x", rate, dash=":", width=0.9)
    return _with_phases(picture)


def draw_drive(analysis: Analysis) -> Picture:
    """Draw the rates of pump and valve against depth.

    Raises ValueError where the vehicle has neither.
    """
    d, stall = analysis.drive, analysis.stall
    if d is None or stall is None:
        raise ValueError("this vehicle has no pump and valve to draw")
    d = drive_rates(analysis.vehicle, np.linspace(0.0, max(d.depths), _DEPTHS).tolist())
    title = f"{analysis.vehicle.name}: what pump and valve do"
    how: Any = {"x": "volume rate [cm³/s]", "y": "depth [m]", "title": title, "legend": "best"}
    picture, panel = one_panel((7.0, 5.0), **how)
    panel.line(1e6 * np.array(d.pump), d.depths, label="pump, out")
    panel.line(1e6 * np.array(d.valve), d.depths, Ink.VERMILION, "valve, in")
    if math.isfinite(stall.depth) and stall.depth <= max(d.depths):
        panel.rule("y", stall.depth, Ink.GREY, "the pump stalls", dash=":", width=1.5)
    return picture


def draw_loop_gains(analysis: Analysis) -> Picture:
    """Draw the Bode diagram of both loop gains with their margins marked.

    Raises ValueError where the vehicle has no closed loop.
    """
    c = _closed_loop(analysis)
    nyquist = math.pi / c.sample_time
    slowest = min(abs(m.s) for m in c.modes if math.isfinite(m.s.real))
    picture, top, bottom = _bode("loop gain |L| [-]", _title(analysis, c, "loop gain"))
    top.rule("y", 1.0, width=0.9)
    for place in _breaks(analysis, c):
        w, values = frequency_response(place.loop)
        w, values = w[w > 0.1 * slowest], values[w > 0.1 * slowest]
        phase = _phase(values)
        at = place.margins.phase_frequency if place.margins else w[len(w) // 2]
        if math.isfinite(at):  # of all turns, the one in which the crossover lies next to -180
            phase -= 360.0 * round((float(np.interp(at, w, phase)) + 180.0) / 360.0)
        label = f"broken at the {place.name}"
        top.line(w, np.abs(values), place.color, label, dash=place.line)
        bottom.line(w, phase, place.color, dash=place.line)
        if place.margins is not None:
            _mark_gains(top, place)
            _mark_phase(bottom, place, w, phase)
    bottom.rule("y", -180.0, width=0.9)
    top.rule("x", nyquist, Ink.GREY, "half the sampling frequency", dash="--", width=0.9)
    bottom.rule("x", nyquist, dash="--", width=0.9)
    top.xlim, top.legend = (
        (0.08 * slowest, 20.0 * nyquist),
        "lower left",
    )  # room for what is written
    return _with_phases(picture)


def draw_nyquist(analysis: Analysis) -> Picture:
    """Draw both loop gains in the complex plane around -1, with the disks that they stay out of.

    Raises ValueError where the vehicle has no closed loop.
    """
    c = _closed_loop(analysis)
    title = _title(analysis, c, "Nyquist")
    limits: Any = {"xlim": (-3.2, 2.2), "ylim": (-2.2, 2.2), "equal": True, "title": title}
    labels: Any = {"x": "Re L [-]", "y": "Im L [-]", "legend": "upper right"}
    picture, panel = one_panel((8.0, 6.8), **limits, **labels)
    circle = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 361))
    panel.line(circle.real, circle.imag, Ink.GREY, "|L| = 1", dash=":", width=0.9)
    for place in _breaks(analysis, c):
        _, values = frequency_response(place.loop)
        label, dash = f"broken at the {place.name}", place.line
        panel.line(values.real, values.imag, place.color, label, dash=dash)
        panel.line(values.real, -values.imag, place.color, label, dash=dash)
        if place.margins is not None:
            # Where (2 + alpha e)/(2 - alpha e) L = -1 for some |e| = 1: a circle around -1.
            alpha = place.margins.disk
            disk = -(2.0 - alpha * circle) / (2.0 + alpha * circle)
            label = f"its disk margin, {alpha:.2f}"
            panel.area(disk.real, disk.imag, place.color, alpha=0.07)
            panel.line(disk.real, disk.imag, place.color, label, dash=dash, width=0.8)
    panel.dots(-1.0, 0.0, "+", Ink.BLACK, "-1", size=12.0)
    return picture


def draw_poles(analysis: Analysis) -> Picture:
    """Draw the poles: open loop in the s-plane, closed loop in the z-plane, and around z = 1."""
    c = analysis.closed_loop
    z = np.array([] if c is None else [mode.z for mode in c.modes])
    near = z[np.abs(z - 1.0) < 0.05]
    count = 1 + (c is not None) + (len(near) > 0)
    picture, (left, *others) = grid_of((1.0 + 4.6 * count, 4.6), count, count)
    poles = np.array(analysis.open_loop.poles)
    smallest = min((abs(p) for p in poles if abs(p) > 1e-9), default=1.0)
    # Rates from 0.01 to 100 1/s share a picture only on an axis that is linear near 0.
    bent, ticks = _bent(10.0 ** math.floor(math.log10(smallest)), float(np.max(np.abs(poles))))
    low, high = -3.0 * float(np.max(np.abs(poles))), 3.0 * max(float(poles.real.max()), smallest)
    left.xlim, left.xticks = (bent(low), bent(high)), ticks
    reach = 1.5 * max(float(np.max(np.abs(poles.imag))), smallest)
    left.span("x", 0.0, bent(high), Ink.VERMILION, alpha=0.08)
    left.rule("x", 0.0, width=0.9)
    _crosses(left, np.array([bent(p.real) for p in poles]), poles, Ink.BLUE)
    left.ylim = (-reach, reach)
    left.x, left.y = "Re s [1/s], linear near 0", "Im s [rad/s]"
    left.title = f"{analysis.vehicle.name}: open loop (shaded: growing)"
    if c is not None:
        right, *inset = others
        circle = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 3601))
        for panel in others:
            panel.line(circle.real, circle.imag, Ink.GREY, "|z| = 1", width=0.9)
            _crosses(panel, z.real, z, Ink.VERMILION, label="closed loop")
            panel.x, panel.y, panel.legend = "Re z [-]", "Im z [-]", ""
        right.equal, right.legend = True, "upper left"
        right.xlim = right.ylim = (-1.1, 1.1)
        right.title = f"under {c.law}, sampled every {c.sample_time:.4g} s"
        for panel in inset:  # the slow poles of a loop that is sampled fast
            reach = 1.5 * float(np.max(np.abs(near - 1.0)))
            panel.xlim, panel.ylim = (1.0 - reach, 1.0 + 0.5 * reach), (-0.75 * reach, 0.75 * reach)
            panel.title, panel.xticks = "around z = 1", 4
    return picture


def _bent(least: float, most: float) -> tuple[Callable[[float], float], dict[float, str]]:
    """Return a scale that is linear below `least` and logarithmic above, and its ticks."""

    def bent(value: float) -> float:
        return math.copysign(math.log10(1.0 + abs(value) / least), value)

    powers = range(math.floor(math.log10(least)) + 1, math.ceil(math.log10(most)) + 1)
    sizes = [10.0**power for power in powers][:: 1 + len(powers) // 5]
    return bent, {
        bent(side * size): f"{side * size:g}" for size in sizes for side in (-1.0, 1.0)
    } | {0.0: "0"}


def _crosses(
    panel: Panel, x: Array, values: NDArray[np.complex128], color: str, **given: Any
) -> None:
    says = [f"{v.real:.5g} {'+-'[v.imag < 0.0]} {abs(v.imag):.5g} i" for v in values.tolist()]
    panel.dots(x, values.imag, "x", color, size=9.0, says=says, **given)


def _closed_loop(analysis: Analysis) -> ClosedLoop:
    if analysis.closed_loop is None:
        raise ValueError("this analysis has no closed loop to draw")
    return analysis.closed_loop


def _breaks(analysis: Analysis, c: ClosedLoop) -> tuple[_Break, ...]:
    command = "voltage" if analysis.vehicle.voltage_driven else "volume command"
    if c.one_loop:
        command += " or at the depth"
    first = _Break(command, c.loop.broken_at_command(), c.at_command, Ink.BLUE, "-")
    depth = c.loop.broken_at_depth(), c.at_depth, Ink.VERMILION, "-."
    return (first,) if c.one_loop else (first, _Break("measured depth", *depth))


def _title(analysis: Analysis, c: ClosedLoop, what: str) -> str:
    state = "" if c.stable else ", UNSTABLE"
    return f"{analysis.vehicle.name}: {what}, {c.law} every {c.sample_time:.4g} s{state}"


def _bode(magnitude: str, title: str) -> tuple[Picture, Panel, Panel]:
    picture, (top, bottom) = stacked((8.0, 6.5), 1.0, 1.0, title=title)
    top.y, top.xlog, top.ylog, bottom.xlog = magnitude, True, True, True
    bottom.x, bottom.y = "frequency [rad/s]", "phase [degrees]"
    return picture, top, bottom


def _with_phases(picture: Picture) -> Picture:
    """Return a Bode diagram with ticks of a turn's parts, and room for what is written."""
    bottom = picture.panels[-1]
    low, high = bottom.limits("y")
    bottom.ylim = (low - 0.08 * (high - low), high + 0.08 * (high - low))
    step = 45 if high - low < 405.0 else 90
    turns = range(step * math.ceil(low / step), math.floor(high) + 1, step)
    bottom.yticks = {float(turn): f"{turn}" for turn in turns}
    return picture


def _phase(values: NDArray[np.complex128]) -> Array:
    return np.degrees(np.unwrap(np.angle(values)))


def _mark_gains(panel: Panel, place: _Break) -> None:
    """Draw the distance of |L| from 1 at the frequencies of the gain margins."""
    m = place.margins
    assert m is not None
    for k, at in ((m.gain_up, m.gain_up_frequency), (m.gain_down, m.gain_down_frequency)):
        if at > 0.0 and 0.0 < k < math.inf:
            panel.between(at, min(1.0, 1.0 / k), max(1.0, 1.0 / k), place.color)
            panel.dots(at, 1.0 / k, "o", place.color, size=5.0)
            down = -14.0 if place.line != "-" else 6.0  # the labels of two loops keep apart
            panel.text(at, 1.0 / k, f"gain × {k:.3g}", color=place.color, shift=(7.0, down))


def _mark_phase(panel: Panel, place: _Break, w: Array, phase: Array) -> None:
    """Draw the distance of the phase from -180 degrees where |L| is 1."""
    m = place.margins
    assert m is not None
    if math.isfinite(m.phase):
        at = m.phase_frequency
        here = float(np.interp(at, w, phase))
        panel.between(at, min(here, -180.0), max(here, -180.0), place.color)
        panel.dots(at, here, "o", place.color, size=5.0)
        text = f"phase margin {math.degrees(m.phase):.1f}°"
        panel.text(at, here, text, color=place.color, shift=(7.0, 6.0))


_DRAWN = {
    "open_loop": draw_open_loop,
    "poles": draw_poles,
    "loop_gains": draw_loop_gains,
    "nyquist": draw_nyquist,
    "drive": draw_drive,
}


class AnalysisShown(Shown[Analysis]):
    """What there is to read, then the tables."""

    name, kind = "analysis", "linear analysis"

    @property
    def good(self) -> bool:
        """Whether it can rest there, and is stable."""
        return self.found.rests and self.found.stable is not False

    def parts(self) -> Iterator[Part]:
        """Give the answer first."""
        a = self.found
        yield f"Linear analysis of {a.vehicle.name} at {a.depth:g} m"
        yield from a.sentences
        pictures = ["open_loop", "poles"]
        if a.closed_loop is not None:
            yield from (_modes(a), _margins(a))
            pictures += ["loop_gains", "nyquist"]
        yield _neutral_volume(a)
        if a.drive is not None:
            yield from (_drive(a), _motions(a))
            pictures.append("drive")
        yield from (_poles(a), _routh(a), _transfer_functions(a))
        yield from (Drawn(name, partial(_DRAWN[name], a)) for name in pictures)

    def table(self) -> dict[str, Any]:
        """Return the open loop's frequency response, command to depth."""
        w, values = self.found.response()
        phase = np.unwrap(np.angle(values))
        return {"frequency_rad_s": w, "gain": np.abs(values), "phase_rad": phase}

    def files(self) -> dict[str, object]:
        """Return analysis.txt: all that is printed."""
        return {"analysis.txt": as_text(list(self.parts()))}


def _transfer_functions(a: Analysis) -> Table:
    rows = []
    for t in a.transfer_functions:
        name = ", ".join(f"({number})" for number in t.equations)
        numbers = f"({_polynomial(t.numerator)}) / ({_polynomial(t.denominator)})"
        rows.append((f"{name} {t.output}/{t.input}", f"{t.symbols}\n= {numbers}"))
    headings = ("equation", "numbers")
    return Table(headings, rows, left=headings, title="Transfer functions")


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
    headings = ("1/s", "time constant s", "period s")
    return Table(headings, rows, left=(), title="Poles of the open loop")


def _routh(a: Analysis) -> Table:
    routh = a.open_loop.routh
    width = max(len(row) for row in routh.rows)
    rows = [
        (f"s^{power}", *row, *[""] * (width - len(row)), note)
        for power, row, note in zip(routh.powers, routh.rows, routh.notes, strict=True)
    ]
    headings = ("row", *[" "] * width, "")
    return Table(headings, rows, left=("row", ""), title="Routh's table of the open loop")


def _neutral_volume(a: Analysis) -> Table:
    stroke = a.vehicle.stroke
    rows = []
    for z, volume in zip(a.neutral.depths, a.neutral.volumes, strict=True):
        inside = stroke.minimum <= volume <= stroke.maximum
        rows.append((f"{z:g}", f"{volume * 1e6:.2f}", "" if inside else "outside the stroke"))
    return Table(("depth m", "volume cm3", ""), rows, left=("",), title="Neutral volume")


def _motions(a: Analysis) -> Table:
    headings = ("speed cm/s", "1/s", "speed follows in s", "grows e-fold in s", "period s")
    rows = []
    for m in a.motions:
        times = (m.time_constant, m.growth_time, m.period)
        texts = [f"{t:.4g}" if math.isfinite(t) else "" for t in times]
        rows.append((f"{100.0 * m.speed:g}", ", ".join(map(_complex, m.poles)), *texts))
    title = "The body at rest and on its way, its volume kept"
    return Table(headings, rows, left=(), title=title)


def _drive(a: Analysis) -> Table:
    d = a.drive
    assert d is not None
    columns = {
        "depth m": [f"{z:g}" for z in d.depths],
        "pump cm3/s": [f"{1e6 * rate:.4g}" for rate in d.pump],
        "its power W": [f"{power:.4g}" for power in d.pump_power],
        "valve cm3/s": [f"{1e6 * rate:.4g}" for rate in d.valve],
        "bypass cm3/s": [f"{1e6 * rate:.4g}" for rate in d.bypass],
        "leaks cm3/d": [f"{86400e6 * leak:.3g}" for leak in d.leakage],
    }
    rows = list(zip(*columns.values(), strict=True))
    return Table([*columns], rows, left=(), title="Pump and valves")


def _modes(a: Analysis) -> Table:
    assert a.closed_loop is not None
    rows = []
    for mode in a.closed_loop.modes:
        s = "at once" if mode.s.real == -math.inf else _complex(mode.s)
        time = "grows" if mode.time_constant == math.inf else f"{mode.time_constant:.4g}"
        rows.append((_complex(mode.z), s, f"{mode.damping:.3f}", time))
    headings = ("z", "1/s", "damping", "time constant s")
    return Table(headings, rows, left=(), title="Poles of the closed loop")


def _margins(a: Analysis) -> Table:
    c = a.closed_loop
    assert c is not None
    command = "voltage" if a.vehicle.voltage_driven else "volume"
    at_command = _column(c.at_command, c.computation_delay)
    at_depth = _column(c.at_depth, c.depth_delay)
    rows = [(name, text, at_depth[name]) for name, text in at_command.items()]
    return Table(("", command, "depth"), rows, left=("",), title="Margins, the loop broken at the")


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
