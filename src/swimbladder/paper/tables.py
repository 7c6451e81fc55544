"""The tables of the report, as texts; every number comes from the evidence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from swimbladder.control.registry import bind
from swimbladder.paper.evidence import Evidence
from swimbladder.physics.actuator import reduced, unified
from swimbladder.sim.closed_loop import StepMetrics
from swimbladder.sim.pool import Fit, average


class Table(NamedTuple):
    """A table: caption, heads, rows of texts."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def table1(e: Evidence) -> Table:
    """Return Table 1 with the constants of both examples, and the ratios of the prototype."""
    hydraulic = unified(e.hydraulic.actuator, e.hydraulic.water)
    screw = unified(e.screw.actuator, e.screw.water)
    paper = reduced(e.vehicle.actuator, e.vehicle.water)
    rows: list[tuple[str, ...]] = [
        (symbol, meaning, f"{getattr(hydraulic, field):.4g} {unit}",
         f"{getattr(screw, field):.4g} {unit}", known)
        for symbol, meaning, field, unit, known in (
            ("lambda", "inertia of all that turns", "inertia", "kg m2", f"lambda/k_v = "
            f"{paper.T1:g} s"),
            ("k_u", "stall torque per volt", "k_u", "N m/V",
             f"k_q k_u/k_v = {paper.gain:.4g} m3/s/V"),
            ("k_v", "torque lost per speed", "k_v", "N m s/rad", "in the ratios"),
            ("k_l", "volume leaked per time and depth", "k_l", "m2/s", f"{paper.k_l:g} m2/s"),
            ("k_q", "volume per angle", "k_q", "m3/rad", "in the ratios"),
            ("k_z", "load torque per depth, driving", "k_z", "N m/m",
             f"k_z/k_u = {paper.load_drive:.4g} V/m"),
        )
    ]  # fmt: skip
    b = [v.water.specific_weight for v in (e.hydraulic, e.screw, e.vehicle)]
    rows.append(("k_b", "buoyancy per volume", *(f"{x:.6g} N/m3" for x in b)))
    return Table(
        "",
        ("", "Meaning", "(a) Electrohydraulic, example-eh", "(b) Electromechanical, example-em",
         "The prototype, feup-em"),
        rows,
    )  # fmt: skip


def experiments(e: Evidence) -> Table:
    """Return the eight experiments and their fits."""
    rows = [
        (
            f"({x.step}) {_signed(x.dV * 1e6, 4)} cm3", f"{x.pulse:+.2f} V, {x.pulse_time:.1f} s",
            f"{_signed(x.achieved * 1e6, 4)} cm3", f"{_signed(x.neutral_error * 1e6, 2)} cm3",
            *_fit(by_speed), *_fit(by_depth), f"{by_depth.rms * 1e3:.1f} mm", *_fit(known),
        )
        for x, by_speed, by_depth, known in zip(
            e.experiments, e.speed_fits, e.depth_fits, e.known_fits, strict=True
        )
    ]  # fmt: skip
    return Table(
        "The eight experiments, simulated with sensor noise",
        ("Step, volume asked for", "Timed voltage", "Volume achieved", "Error of the neutral "
        "volume",
         "K2 by (26)", "T2 by (26)", "K2 by (27)", "T2 by (27)", "rms left by (27)",
         "K2 by (32), psi known", "T2 by (32)"),
        rows,
    )  # fmt: skip


def table2(e: Evidence) -> Table:
    """Return Table 2: paper, ours, ours without noise, and what was simulated."""
    by_speed, by_depth = e.table2
    known = average(e.known_fits)
    rows = [
        ("(26), V to dz/dt", "-7935.54", "36.3", *_k(by_speed), *_k(e.still_average[0])),
        ("(27), V to z", "-7634.95", "35.7", *_k(by_depth), *_k(e.still_average[1])),
        ("(32), V to z, psi known", "", "", *_k(known), *_k(e.still_known)),
        ("the simulated vehicle", "", "", *_k(Fit(e.motion.K2, e.motion.T2, 0.0)), "", ""),
    ]  # fmt: skip
    return Table(
        "Table 2, averages over the eight experiments; K in m/s/m3, T in s",
        ("Transfer function", "K, paper", "T, paper", "K, simulated with noise",
         "T, simulated with noise", "K, no noise, exactly neutral", "T, no noise, exactly neutral"),
        rows,
    )  # fmt: skip


def neglect(e: Evidence) -> Table:
    """Return K2 and T2 without noise against the size of the step."""
    sizes = [pair for pair in e.still if pair[0] > 0.0]
    rows = [
        (f"{dV * 1e6:g} cm3", *_fit(fit), f"{fit.K2 / fit.T2:.1f}", f"{fit.rms * 1e3:.2f} mm")
        for dV, fit in sizes
    ]
    clean = e.still_average[1]
    for name, fit in (
        ("average of the eight", clean),
        ("all eight jointly", e.still_joint),
        ("all eight jointly, psi known", e.still_known),
    ):
        rows.append((name, *_fit(fit), f"{fit.K2 / fit.T2:.1f}", f"{fit.rms * 1e3:.2f} mm"))
    return Table(
        "Eq. (27) fitted to 3 m of motion without noise from an exactly neutral start",
        ("Change of volume", "K2, 1/(m2 s)", "T2, s", "K2/T2, 1/(m2 s2)", "rms left"), rows,
    )  # fmt: skip


def pulses(e: Evidence) -> Table:
    """Return the timed voltages: asked for, when the voltage ends, once the motor stands."""
    rows = [
        (
            f"{_signed(p.dx * 1e3, 3)} mm", f"{p.depth:g} m", f"{p.voltage:+.2f} V, {p.time:.1f} s",
            f"{_signed(p.simulated[0] * 1e3, 4)} mm",
            f"{_signed(100 * (p.simulated[0] / p.dx - 1), 2)} %",
            f"{_signed(p.simulated[1] * 1e3, 4)} mm",
            f"{_signed(100 * (p.simulated[1] / p.dx - 1), 2)} %",
        )
        for p in e.pulses
    ]  # fmt: skip
    return Table(
        "Asked for and achieved, simulated",
        ("dx asked for", "Depth", "Voltage and time", "When the voltage ends", "Error then",
         "Once the motor stands", "Error that stays"),
        rows,
    )  # fmt: skip


def table3(e: Evidence) -> Table:
    """Return Table 3 as printed and in SI."""
    assert e.vehicle.controller is not None
    law, gains = bind(e.vehicle.controller)
    printed = {
        "k_pV": ("C_V, k_p", "1002 V/dm3"), "k_pz": ("C_z, k_p", "-0.1043 dm3/m"),
        "k_iz": ("C_z, k_i", "-7.486e-4 dm3/s/m"), "k_dz": ("C_z, k_d", "-2.341 dm3 s/m"),
    }  # fmt: skip
    return Table(
        "Table 3, the gains",
        ("Gain", "Name here", "Printed", "In SI"),
        [
            (label, name, text, f"{getattr(gains, name):.6g} {law.units[name]}")
            for name, (label, text) in printed.items()
        ],
    )


def steps(e: Evidence) -> Table:
    """Return the steps of Fig. 16 in numbers."""
    return Table(
        "The steps of Figure 16",
        ("Step", "Direction", "Overshoot", "90 % rise", "2 % settling", "Volume"),
        [
            (
                f"{s.start:g} to {s.target:g} m", "down" if s.target > s.start else "up",
                *_metrics(s.metrics),
                f"{_signed(s.lowest_volume * 1e6, 3)} to {_signed(s.highest_volume * 1e6, 3)} cm3",
            )
            for s in e.step_rows
        ],
    )  # fmt: skip


def pairs(e: Evidence) -> Table:
    """Return the overshoot up and down between the same depths."""
    return Table(
        "Overshoot between the same two depths, from rest: the claim that it is lower ascending",
        ("Depths", "Down", "Up", "Up less down"),
        [
            (
                f"{p.shallow:g} and {p.deep:g} m", f"{p.down.overshoot_pct:.2f} %",
                f"{p.up.overshoot_pct:.2f} %",
                f"{_signed(p.up.overshoot_pct - p.down.overshoot_pct, 2)} points",
            )
            for p in e.pairs
        ],
    )  # fmt: skip


def _fit(fit: Fit) -> tuple[str, str]:
    return f"{fit.K2:.0f}", f"{fit.T2:.1f}"


def _k(fit: Fit) -> tuple[str, str]:
    return f"{-fit.K2:.2f}", f"{fit.T2:.1f}"


def _metrics(m: StepMetrics) -> tuple[str, ...]:
    times = ("never" if t is None else f"{t:.1f} s" for t in (m.rise90_s, m.settle2_s))
    return f"{m.overshoot_pct:.1f} %", *times


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}g}"
