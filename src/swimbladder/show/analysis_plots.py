"""Pictures of a linear analysis: Bode of the open loop, the loop gains and their margins, poles."""

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from swimbladder.design.linear import Analysis, ClosedLoop, Margins, StateSpace
from swimbladder.design.linear.margins import frequency_response
from swimbladder.design.linear.pump_valve import drive_rates
from swimbladder.show.style import Ink, new_figure, stacked, styled

_DEPTHS = 401  # of the rates of pump and valve: near the surface a valve goes with a root


class _Break(NamedTuple):
    """A place where the loop is broken, and how it is drawn."""

    name: str
    loop: StateSpace
    margins: Margins | None
    color: str
    line: str


@styled
def draw_open_loop(analysis: Analysis) -> Figure:
    """Draw the Bode diagram of the open loop, command to depth."""
    w, response = analysis.response()
    rates = np.abs([p for p in analysis.open_loop.poles if abs(p) > 1e-9])
    what, unit = ("voltage", "m/V") if analysis.vehicle.voltage_driven else ("volume", "m/m³")
    figure, top, bottom = _bode(f"|depth/{what}| [{unit}]")
    top.loglog(w, np.abs(response), color=Ink.BLUE)
    bottom.semilogx(w, _phase(response), color=Ink.BLUE)
    for rate in sorted({float(f"{rate:.9g}") for rate in rates}):
        for axes in (top, bottom):
            axes.axvline(rate, color=Ink.GREY, linewidth=0.9, linestyle=":")
    title = f"open loop, {what} to depth (dotted: moduli of the poles)"
    top.set_title(f"{analysis.vehicle.name}: {title}")
    return figure


@styled
def draw_drive(analysis: Analysis) -> Figure:
    """Draw the rates of pump and valve against depth.

    Raises ValueError where the vehicle has neither.
    """
    d, stall = analysis.drive, analysis.stall
    if d is None or stall is None:
        raise ValueError("this vehicle has no pump and valve to draw")
    d = drive_rates(analysis.vehicle, np.linspace(0.0, max(d.depths), _DEPTHS).tolist())
    figure, (axes,) = new_figure((7.0, 5.0))
    axes.plot(1e6 * np.array(d.pump), d.depths, color=Ink.BLUE, label="pump, out")
    axes.plot(1e6 * np.array(d.valve), d.depths, color=Ink.VERMILION, label="valve, in")
    if math.isfinite(stall.depth) and stall.depth <= max(d.depths):
        axes.axhline(stall.depth, color=Ink.GREY, linestyle=":", label="the pump stalls")
    axes.invert_yaxis()
    axes.set(xlabel="volume rate [cm³/s]", ylabel="depth [m]")
    axes.set_title(f"{analysis.vehicle.name}: what pump and valve do")
    axes.legend(fontsize=9)
    return figure


@styled
def draw_loop_gains(analysis: Analysis) -> Figure:
    """Draw the Bode diagram of both loop gains with their margins marked.

    Raises ValueError where the vehicle has no closed loop.
    """
    c = _closed_loop(analysis)
    nyquist = math.pi / c.sample_time
    slowest = min(abs(m.s) for m in c.modes if math.isfinite(m.s.real))
    figure, top, bottom = _bode("loop gain |L| [-]")
    top.axhline(1.0, color=Ink.GREY, linewidth=0.9)
    for place in _breaks(analysis, c):
        w, values = frequency_response(place.loop)
        w, values = w[w > 0.1 * slowest], values[w > 0.1 * slowest]
        phase = _phase(values)
        at = place.margins.phase_frequency if place.margins else w[len(w) // 2]
        if math.isfinite(at):  # of all turns, the one in which the crossover lies next to -180
            phase -= 360.0 * round((float(np.interp(at, w, phase)) + 180.0) / 360.0)
        label = f"broken at the {place.name}"
        top.loglog(w, np.abs(values), color=place.color, linestyle=place.line, label=label)
        bottom.semilogx(w, phase, color=place.color, linestyle=place.line)
        if place.margins is not None:
            _mark_gains(top, place)
            _mark_phase(bottom, place, w, phase)
    bottom.axhline(-180.0, color=Ink.GREY, linewidth=0.9)
    half = "half the sampling frequency"
    top.axvline(nyquist, color=Ink.GREY, linewidth=0.9, linestyle="--", label=half)
    bottom.axvline(nyquist, color=Ink.GREY, linewidth=0.9, linestyle="--")
    bottom.set_xlim(0.08 * slowest, 20.0 * nyquist)  # room for what is written
    top.legend(fontsize=9, loc="lower left")
    top.set_title(_title(analysis, c, "loop gain"))
    return figure


@styled
def draw_nyquist(analysis: Analysis) -> Figure:
    """Draw both loop gains in the complex plane around -1, with the disks that they stay out of.

    Raises ValueError where the vehicle has no closed loop.
    """
    c = _closed_loop(analysis)
    figure, (axes,) = new_figure((8.0, 6.8))
    circle = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 361))
    axes.plot(circle.real, circle.imag, ":", color=Ink.GREY, linewidth=0.9, label="|L| = 1")
    for place in _breaks(analysis, c):
        _, values = frequency_response(place.loop)
        for half in (values, values.conj()):
            (line,) = axes.plot(half.real, half.imag, place.line, color=place.color)
            line.set_label(f"broken at the {place.name}" if half is values else None)
        if place.margins is not None:
            # Where (2 + alpha e)/(2 - alpha e) L = -1 for some |e| = 1: a circle around -1.
            alpha = place.margins.disk
            disk = -(2.0 - alpha * circle) / (2.0 + alpha * circle)
            axes.fill(disk.real, disk.imag, color=place.color, alpha=0.07, linewidth=0.0)
            how: Any = {"linewidth": 0.8, "label": f"its disk margin, {alpha:.2f}"}
            axes.plot(disk.real, disk.imag, place.line, color=place.color, **how)
    axes.plot(-1.0, 0.0, "+", color="black", markersize=12, label="-1")
    axes.set(xlim=(-3.2, 2.2), ylim=(-2.2, 2.2), xlabel="Re L [-]", ylabel="Im L [-]")
    axes.set_aspect("equal")
    axes.legend(fontsize=9, loc="upper right")
    axes.set_title(_title(analysis, c, "Nyquist"), fontsize=10)
    return figure


@styled
def draw_poles(analysis: Analysis) -> Figure:
    """Draw the poles: open loop in the s-plane, closed loop in the z-plane."""
    c = analysis.closed_loop
    figure = Figure(figsize=(7.0 if c is None else 11.0, 5.0))
    left = figure.add_subplot(1, 1 if c is None else 2, 1)
    poles = np.array(analysis.open_loop.poles)
    smallest = min((abs(p) for p in poles if abs(p) > 1e-9), default=1.0)
    left.axvspan(0.0, 1e6, color=Ink.VERMILION, alpha=0.08, linewidth=0.0)
    left.axvline(0.0, color=Ink.GREY, linewidth=0.9)
    _crosses(left, poles, Ink.BLUE)
    # Rates from 0.01 to 100 1/s share a picture only on an axis that is linear near 0.
    left.set_xscale("symlog", linthresh=10.0 ** math.floor(math.log10(smallest)))
    largest = float(np.max(np.abs(poles)))
    left.set_xlim(-3.0 * largest, 3.0 * max(float(poles.real.max()), smallest))
    reach = 1.5 * max(float(np.max(np.abs(poles.imag))), smallest)
    left.set(ylim=(-reach, reach), xlabel="Re s [1/s], linear near 0", ylabel="Im s [rad/s]")
    left.set_title(f"{analysis.vehicle.name}: open loop (shaded: growing)")
    if c is not None:
        right = figure.add_subplot(1, 2, 2)
        circle = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 361))
        right.plot(circle.real, circle.imag, color=Ink.GREY, linewidth=0.9, label="|z| = 1")
        z = np.array([mode.z for mode in c.modes])
        _crosses(right, z, Ink.VERMILION, label="closed loop")
        right.set(xlabel="Re z [-]", ylabel="Im z [-]")
        right.set_aspect("equal", adjustable="datalim")
        right.legend(fontsize=9, loc="upper left")
        if np.any(np.abs(z - 1.0) < 0.05):
            _near_one(right, z)
        right.set_title(f"under {c.law}, sampled every {c.sample_time:.4g} s")
    return figure


def _crosses(axes: Axes, values: NDArray[np.complex128], color: str, **given: Any) -> None:
    axes.plot(values.real, values.imag, "x", color=color, ms=9, mew=2, **given)


def _near_one(axes: Axes, z: NDArray[np.complex128]) -> None:
    """Draw what lies around z = 1 again, larger: the slow poles of a loop that is sampled fast."""
    reach = 1.5 * float(np.max(np.abs(z[np.abs(z - 1.0) < 0.05] - 1.0)))
    inset = axes.inset_axes((0.07, 0.07, 0.34, 0.34))
    angles = np.linspace(-2.0 * reach, 2.0 * reach, 101)
    inset.plot(np.cos(angles), np.sin(angles), color=Ink.GREY, linewidth=0.9)
    inset.plot(z.real, z.imag, "x", color=Ink.VERMILION, markersize=7, markeredgewidth=2)
    inset.set(xlim=(1.0 - reach, 1.0 + 0.5 * reach), ylim=(-0.75 * reach, 0.75 * reach))
    inset.set_xticks([1.0 - reach, 1.0], labels=[f"{1.0 - reach:.3g}", "1"], fontsize=8)
    inset.set_yticks([])
    inset.spines[:].set_visible(True)
    inset.set_title("around z = 1", fontsize=8)


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


def _bode(magnitude: str) -> tuple[Figure, Axes, Axes]:
    figure, (top, bottom) = stacked((8.0, 6.5), 1.0, 1.0)
    top.set_ylabel(magnitude)
    bottom.set(ylabel="phase [degrees]", xlabel="frequency [rad/s]")
    bottom.yaxis.set_major_locator(MultipleLocator(45.0))
    bottom.margins(y=0.12)  # room for what is written
    return figure, top, bottom


def _phase(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.degrees(np.unwrap(np.angle(values)))


def _mark_gains(axes: Axes, place: _Break) -> None:
    """Draw the distance of |L| from 1 at the frequencies of the gain margins."""
    m = place.margins
    assert m is not None
    for k, at in ((m.gain_up, m.gain_up_frequency), (m.gain_down, m.gain_down_frequency)):
        if at > 0.0 and 0.0 < k < math.inf:
            axes.vlines(at, min(1.0, 1.0 / k), max(1.0, 1.0 / k), color=place.color)
            axes.plot(at, 1.0 / k, "o", color=place.color, markersize=5)
            down = -14 if place.line != "-" else 6  # the labels of two loops keep apart
            _label(axes, f"gain × {k:.3g}", at, 1.0 / k, place.color, down)


def _mark_phase(
    axes: Axes, place: _Break, w: NDArray[np.float64], phase: NDArray[np.float64]
) -> None:
    """Draw the distance of the phase from -180 degrees where |L| is 1."""
    m = place.margins
    assert m is not None
    if math.isfinite(m.phase):
        at = m.phase_frequency
        here = float(np.interp(at, w, phase))
        axes.vlines(at, min(here, -180.0), max(here, -180.0), color=place.color)
        axes.plot(at, here, "o", color=place.color, markersize=5)
        _label(axes, f"phase margin {math.degrees(m.phase):.1f}°", at, here, place.color, 6)


def _label(axes: Axes, text: str, x: float, y: float, color: str, up: int) -> None:
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
    how: Any = {"textcoords": "offset points", "fontsize": 9, "color": color, "bbox": box}
    axes.annotate(text, (x, y), (7, up), **how)
