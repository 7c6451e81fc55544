"""What the linear models say, as it is shown: words, tables, pictures."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from swimbladder.design.linear import Analysis, Margins
from swimbladder.show import analysis_plots as plots
from swimbladder.show.parts import Drawn, Part, Shown, Table
from swimbladder.show.text import as_text


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
        yield from (Drawn(name, partial(getattr(plots, f"draw_{name}"), a)) for name in pictures)

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
