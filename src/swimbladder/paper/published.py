"""The paper's numbers and claims beside ours; every verdict is computed here."""

from __future__ import annotations

import math

import numpy as np

from swimbladder.design.linear import linearise
from swimbladder.design.linear.depths import double_integrator_phase_margin, doubling_time
from swimbladder.paper.evidence import VOLUME_STEPS, Evidence
from swimbladder.paper.published_results import published_results
from swimbladder.paper.verdict import Finding, Known, claim, number
from swimbladder.physics.dynamics import plant
from swimbladder.physics.oil import relative_volume_change

_LENGTH, _RADIUS, _FLOTATION, _DRY_MASS = 1.285, 0.1, 5.5e-3, 33.0  # section 3, SI


def published(e: Evidence) -> list[Finding]:
    """Return every published number and claim that can be checked, by subject."""
    return [
        *_actuator(e), *_shallow_claims(e), *_stability(e), *_prototype(e),
        *published_results(e),
    ]  # fmt: skip


def _actuator(e: Evidence) -> list[Finding]:
    change = -100.0 * relative_volume_change(dp=10e6, beta_e=1.5e9)
    assert e.analysis.closed_loop is not None
    load = e.analysis.closed_loop.depth_load
    assert load is not None
    return [
        number(
            "eq. (2)", "relative volume change of oil under 10 MPa", paper=0.6, ours=change,
            unit="%", within=0.05 / 0.6, digits=3,
            known=Known(
                why="10 MPa over 1.5 GPa is 1/150: 0.67 %, printed cut off to 0.6 %, and without "
                "the minus sign of the middle term.",
                value=-100.0 * math.expm1(-1.0 / 150.0), within=0.01,
            ),
        ),
        claim(
            "section 2.1.4", "a depth load that the volume loop does not reject is positive "
            "feedback",
            paper="unstable", ours=f"extra psi {load.extra_psi:.2e} m3/m",
            holds=load.extra_psi > 0.0 and math.isfinite(load.doubling_time),
            why=f"With the printed proportional loop it acts like {100 * load.share_of_psi:.1f} % "
            "of psi; the depth loop around it stabilises both.",
            value=load.extra_psi, unit="m3/m",
        ),
    ]  # fmt: skip


def _shallow_claims(e: Evidence) -> list[Finding]:
    """Section 2.3 neglects the depth load and the compressibility in a pool."""
    a, supply = e.actuator, e.vehicle.supply
    assert supply is not None
    depth = 3.75
    loss = a.depth_voltage * depth / supply.voltage
    drift = a.K1 * a.piston_area * a.depth_voltage * depth
    neutral = e.vehicle.hull.psi * 3.0
    error = e.still_joint.K2 / e.motion.K2 - 1.0
    return [
        claim(
            "section 2.3", "the depth load T_z can be left out in a pool",
            paper="negligible", ours=f"{100 * loss:.1f} % of 12 V, {drift * 1e6:.2f} cm3/s at 0 V",
            holds=loss < 0.05 and e.unheld_rise > 3.0,
            why=f"While driving, yes. But a piston left at 0 V, which in (33) nothing locks, is "
            f"pushed in: after the smallest step the vehicle rises {e.unheld_rise:.2f} m and comes "
            "back. So after a step the piston is held here by k_z/k_u z.",
            accounted_for=loss < 0.05 and e.unheld_rise < 3.0, value=drift, unit="m3/s",
        ),
        claim(
            "section 2.3", "the hull's compressibility F_def can be left out in a pool",
            paper="negligible", ours=f"K2 {100 * error:+.0f} %", holds=abs(error) < 0.1,
            why=f"Over 3 m the neutral volume changes by psi 3 m = {neutral * 1e6:.0f} cm3, "
            f"against a smallest step of {VOLUME_STEPS[0] * 1e6:.0f} cm3. With psi known the same "
            f"fit finds K2 to {abs(e.still_known.K2 / e.motion.K2 - 1.0):.0e}.",
            accounted_for=abs(e.still_known.K2 / e.motion.K2 - 1.0) < 1e-6, value=error,
        ),
    ]  # fmt: skip


def _stability(e: Evidence) -> list[Finding]:
    o, a, mo = e.analysis.open_loop, e.actuator, e.motion
    negative = sum(c < 0.0 for c in o.denominator)
    p = plant(e.vehicle)
    stiff = [p._replace(psi=psi) for psi in -np.geomspace(1e-8, 1e-4, 41)]
    times = [doubling_time(linearise(x)) for x in stiff]
    free = [doubling_time(linearise(x._replace(load_drive=0.0, load_back=0.0))) for x in stiff]
    gains = np.geomspace(1e-4, 1e4, 33)
    margins = [
        double_integrator_phase_margin(
            K1=a.K1, K2=mo.K2, A=a.piston_area, T1=a.T1, T2=mo.T2, gain=float(g)
        )
        for g in gains
    ]
    return [
        claim(
            "section 2.5, eq. (34)", "at least two coefficients are negative, so it is unstable",
            paper="unstable", ours=f"{negative} negative, {o.routh.right} growing root",
            holds=negative >= 2 and o.routh.right >= 1,
            why=f"{o.routh.sentence} It doubles a disturbance in {o.doubling_time:.1f} s.",
            value=o.doubling_time, unit="s",
        ),
        claim(
            "section 2.5", "with psi < 0 it is unstable still, because of k_z and k_l",
            paper="unstable", ours=f"unstable for all of {len(times)} psi from -1e-8 to -1e-4 m3/m",
            holds=all(map(math.isfinite, times)) and not any(map(math.isfinite, free)),
            why=f"Doubling times {min(times):.0f} to {max(times):.0f} s. Without k_z and k_l "
            "nothing would grow.",
        ),
        claim(
            "section 2.5, eq. (35)", "a double integrator with negative phase margin",
            paper="unstable", ours=f"{math.degrees(max(margins)):.2g} degrees at best",
            holds=max(margins) < 0.0,
            why=f"For every gain from {gains[0]:g} to {gains[-1]:g} V/m; at 1 V/m it is "
            f"{math.degrees(margins[16]):.1f} degrees.",
        ),
    ]  # fmt: skip


def _prototype(e: Evidence) -> list[Finding]:
    hull, stroke = e.vehicle.hull, e.vehicle.stroke
    stall = e.analysis.stall
    assert stall is not None
    by_formula = 0.01 * hull.displaced_volume / 100.0
    cylinder = math.pi * _RADIUS**2 * _LENGTH
    radius_meant = math.pi * (2 * _RADIUS) ** 2 * _LENGTH
    rho = e.vehicle.water.density
    displaced = hull.displaced_volume + _FLOTATION
    enclosed, added = rho * (cylinder - displaced), 8.0 / 3.0 * rho * _RADIUS**3
    deepest = e.analysis.neutral.leaves_stroke
    rating = 100.0
    return [
        claim(
            "section 3", "dives to 100 m", paper="100 m",
            ours=f"12 V turn the motor down to {stall.depth:.1f} m", holds=stall.depth >= rating,
            value=stall.depth, unit="m",
        ),
        claim(
            "section 3", "dives to 100 m with a volume change of +-350 cm3", paper="+-350 cm3",
            ours=f"psi 100 m = {hull.psi * rating * 1e6:.0f} cm3",
            holds=hull.psi * rating <= stroke.maximum,
            why=f"Trimmed neutral at the surface with the piston in the middle, it can be neutral "
            f"down to {deepest:.1f} m only. It can with the psi that the printed formula gives, "
            f"down to {stroke.maximum / by_formula:.0f} m, or trimmed for depth.",
            accounted_for=stroke.maximum / by_formula > rating > deepest, value=deepest, unit="m",
        ),
        claim(
            "section 3", "outer radius 200 mm, length 1285 mm", paper="200 mm",
            ours=f"diameter: {cylinder * 1e3:.1f} dm3", holds=radius_meant < 1.1 * cylinder,
            why=f"With that radius the cylinder would hold {radius_meant * 1e3:.0f} dm3; with that "
            f"diameter it holds {cylinder * 1e3:.1f} dm3, which is also what psi was computed "
            "from.",
            accounted_for=abs(0.01 * cylinder / 100.0 / hull.psi - 1.0) < 5e-3,
        ),
        number(
            "section 3", "displaced volume V_p: dry mass less added flotation",
            paper=27.5, ours=(_DRY_MASS / rho - _FLOTATION) * 1e3, unit="dm3",
            within=5e-3, why="33 kg in fresh water less about 5.5 dm3.",
        ),
        number(
            "section 3.2", "psi = 0.01 V_p/100", paper=4.04e-6, ours=by_formula, unit="m3/m",
            within=5e-3,
            known=Known(
                why=f"The printed V_p gives {by_formula:.2e}; the printed psi is what the volume "
                f"of the outer cylinder gives, {0.01 * cylinder / 100.0:.3e}. The printed psi is "
                "used.",
                value=hull.psi * hull.displaced_volume / cylinder, within=5e-3,
            ),
        ),
        number(
            "section 3.2", "mass that K2 and T2 imply, rho g T2/K2, against the dry mass",
            paper=_DRY_MASS, ours=e.vehicle.mass, unit="kg", within=0.02,
            known=Known(
                why=f"Water moves with it: the outer cylinder of {cylinder * 1e3:.1f} dm3 encloses "
                f"{enclosed:.1f} kg around the {displaced * 1e3:.1f} dm3 displaced, and the added "
                f"mass of a disc of its radius, 8/3 rho r^3, is {added:.1f} kg: together "
                f"{_DRY_MASS + enclosed + added:.1f} kg.",
                value=_DRY_MASS + enclosed + added, within=0.1,
            ),
        ),
    ]  # fmt: skip
