"""The tables of the report, as texts; every number comes from the evidence."""

from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.control.registry import bind
from swimbladder.paper.evidence import Evidence
from swimbladder.paper.verdict import texts
from swimbladder.physics.actuator import reduced, unified
from swimbladder.sim.closed_loop import StepMetrics
from swimbladder.sim.pool import Fit, average

Rows = Sequence[Sequence[str]]
_ABOUT = texts("page")["tables"]


class Table(NamedTuple):
    """A table: caption, heads, rows of texts."""

    caption: str
    head: Sequence[str]
    rows: Rows


def tables(e: Evidence) -> dict[str, Table]:
    """Return the tables by name, with what page.toml has to stand over them."""
    rows = (table1, table2, table3, experiments, neglect, pulses, steps, pairs)
    return {
        made.__name__: Table(about["caption"], about["head"], made(e))
        for made in rows
        for about in (_ABOUT[made.__name__],)
    }


def table1(e: Evidence) -> Rows:
    """Return Table 1 with the constants of both examples, and the ratios of the prototype."""
    examples = [unified(v.engine, v.water) for v in (e.hydraulic, e.screw)]
    ratios = reduced(e.vehicle.engine, e.vehicle.water)
    b = [v.water.specific_weight for v in (e.hydraulic, e.screw, e.vehicle)]
    rows = [("k_b", "buoyancy per volume", *(f"{x:.6g} N/m3" for x in b))]
    for symbol, meaning, field, unit, known in reversed(_ABOUT["table1"]["constants"]):
        values = (f"{getattr(u, field):.4g} {unit}" for u in examples)
        rows.insert(0, (symbol, meaning, *values, known.format(p=ratios)))
    return rows


def experiments(e: Evidence) -> Rows:
    """Return the eight experiments and their fits."""
    rows = []
    fits = zip(e.speed_fits, e.depth_fits, e.known_fits, strict=True)
    for x, (by_speed, by_depth, known) in zip(e.experiments, fits, strict=True):
        done = f"{_signed(x.achieved * 1e6, 4)} cm3", f"{_signed(x.neutral_error * 1e6, 2)} cm3"
        pulse = f"{x.pulse:+.2f} V, {x.pulse_time:.1f} s"
        row = (f"({x.step}) {_signed(x.dV * 1e6, 4)} cm3", pulse, *done, *_fit(by_speed))
        rows.append((*row, *_fit(by_depth), f"{by_depth.rms * 1e3:.1f} mm", *_fit(known)))
    return rows


def table2(e: Evidence) -> Rows:
    """Return Table 2: paper, ours, ours without noise, and what was simulated."""
    by_speed, by_depth = e.table2
    known = average(e.known_fits)
    return [
        ("(26), V to dz/dt", "-7935.54", "36.3", *_k(by_speed), *_k(e.still_average[0])),
        ("(27), V to z", "-7634.95", "35.7", *_k(by_depth), *_k(e.still_average[1])),
        ("(32), V to z, psi known", "", "", *_k(known), *_k(e.still_known)),
        ("the simulated vehicle", "", "", *_k(Fit(e.motion.K2, e.motion.T2, 0.0)), "", ""),
    ]


def neglect(e: Evidence) -> Rows:
    """Return K2 and T2 without noise against the size of the step."""
    fits = {f"{dV * 1e6:g} cm3": fit for dV, fit in e.still if dV > 0.0} | {
        "average of the eight": e.still_average[1],
        "all eight jointly": e.still_joint,
        "all eight jointly, psi known": e.still_known,
    }
    return [
        (name, *_fit(fit), f"{fit.K2 / fit.T2:.1f}", f"{fit.rms * 1e3:.2f} mm")
        for name, fit in fits.items()
    ]


def pulses(e: Evidence) -> Rows:
    """Return the timed voltages: asked for, when the voltage ends, once the motor stands."""
    rows = []
    for p in e.pulses:
        row = [f"{_signed(p.dx * 1e3, 3)} mm", f"{p.depth:g} m"]
        row += [f"{p.voltage:+.2f} V, {p.time:.1f} s"]
        for x in p.simulated:
            row += [f"{_signed(x * 1e3, 4)} mm", f"{_signed(100 * (x / p.dx - 1), 2)} %"]
        rows.append(row)
    return rows


def table3(e: Evidence) -> Rows:
    """Return Table 3 as printed and in SI."""
    assert e.vehicle.controller is not None
    law, gains = bind(e.vehicle.controller)
    printed = (
        ("C_V, k_p", "k_pV", "1002 V/dm3"),
        ("C_z, k_p", "k_pz", "-0.1043 dm3/m"),
        ("C_z, k_i", "k_iz", "-7.486e-4 dm3/s/m"),
        ("C_z, k_d", "k_dz", "-2.341 dm3 s/m"),
    )
    return [(*row, f"{getattr(gains, row[1]):.6g} {law.units[row[1]]}") for row in printed]


def steps(e: Evidence) -> Rows:
    """Return the steps of Fig. 16 in numbers."""
    rows = []
    for s in e.step_rows:
        way = "down" if s.target > s.start else "up"
        least, most = (_signed(V * 1e6, 3) for V in (s.lowest_volume, s.highest_volume))
        volume = f"{least} to {most} cm3"
        rows.append((f"{s.start:g} to {s.target:g} m", way, *_metrics(s.metrics), volume))
    return rows


def pairs(e: Evidence) -> Rows:
    """Return the overshoot up and down between the same depths."""
    rows = []
    for p in e.pairs:
        down, up = p.down.overshoot_pct, p.up.overshoot_pct
        more = f"{_signed(up - down, 2)} points"
        rows.append((f"{p.shallow:g} and {p.deep:g} m", f"{down:.2f} %", f"{up:.2f} %", more))
    return rows


def _fit(fit: Fit) -> tuple[str, str]:
    return f"{fit.K2:.0f}", f"{fit.T2:.1f}"


def _k(fit: Fit) -> tuple[str, str]:
    return f"{-fit.K2:.2f}", f"{fit.T2:.1f}"


def _metrics(m: StepMetrics) -> tuple[str, ...]:
    times = ("never" if t is None else f"{t:.1f} s" for t in (m.rise90_s, m.settle2_s))
    return f"{m.overshoot_pct:.1f} %", *times


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}g}"
