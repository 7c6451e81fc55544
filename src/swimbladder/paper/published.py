"""The paper's numbers and claims beside ours, published.toml; every verdict is computed here.

`independent` compares with numbers computed from the printed ones by other code. These references
were made with SciPy (LSODA at a relative tolerance of 1e-9, linear programs, least squares) before
this package existed: linear drag, 12 V limit, no computation delay, rest at the neutral volume
psi z at first with the integral starting there and e(-1) = e(0).
"""

import math
from typing import Any

import numpy as np

from swimbladder.control.registry import bind
from swimbladder.design.linear import linearise
from swimbladder.design.linear.depths import double_integrator_phase_margin, doubling_time
from swimbladder.paper.evidence import TRAVELS, VOLUME_STEPS, Evidence
from swimbladder.paper.verdict import Finding, compared, judged
from swimbladder.physics.actuator import reduced
from swimbladder.physics.dynamics import plant
from swimbladder.physics.oil import relative_volume_change

_LENGTH, _RADIUS, _FLOTATION, _DRY_MASS = 1.285, 0.1, 5.5e-3, 33.0  # section 3, SI
DENOMINATOR = (3.26700, 36.3900, 0.997115, -0.0320596, -0.00203660)
POLES = {  # 1/s
    "growing pole": 0.03704,
    "real part of the pair": -0.03230,
    "imaginary part of the pair": 0.02172,
    "fast pole": -11.111,
}
_TABLE2 = (("(26)", 7935.54, 36.3), ("(27)", 7634.95, 35.7))  # row, K2, T2
_TABLE3 = {  # the gain as printed and its unit over SI's
    "k_pV": (1002.0, "V/dm3", 1e-3),
    "k_pz": (-0.1043, "dm3/m", 1e3),
    "k_iz": (-7.486e-4, "dm3/s/m", 1e3),
    "k_dz": (-2.341, "dm3 s/m", 1e3),
}


def published(e: Evidence) -> list[Finding]:
    """Return every published number and claim that can be checked, by subject."""
    model = (_actuator, _shallow_claims, _stability, _prototype)
    found = (_identification, _table2, _control)
    return [one for findings in (*model, *found) for one in findings(e)]


def _actuator(e: Evidence) -> list[Finding]:
    change = -100.0 * relative_volume_change(dp=10e6, beta_e=1.5e9)
    assert e.analysis.closed_loop is not None
    load = e.analysis.closed_loop.depth_load
    assert load is not None
    grows = load.extra_psi > 0.0 and math.isfinite(load.doubling_time)
    percent = 100 * load.share_of_psi
    return [
        compared("oil", change, expected=-100.0 * math.expm1(-1.0 / 150.0)),
        judged("depth-load", grows, load.extra_psi, percent=percent),
    ]


def _shallow_claims(e: Evidence) -> list[Finding]:
    """Section 2.3 neglects the depth load and the compressibility in a pool."""
    a, supply = e.actuator, e.vehicle.supply
    assert supply is not None
    depth = 3.75
    loss = a.depth_voltage * depth / supply.voltage
    drift = a.K1 * a.piston_area * a.depth_voltage * depth
    small = loss < 0.05
    load: dict[str, Any] = {"e": e, "percent": 100 * loss, "drift": drift * 1e6}
    load["accounted_for"] = small and e.unheld_rise < 3.0
    error = e.still_joint.K2 / e.motion.K2 - 1.0
    known = abs(e.still_known.K2 / e.motion.K2 - 1.0)
    stiff: dict[str, Any] = {"percent": 100 * error, "known": known}
    stiff["neutral"] = e.vehicle.hull.psi * 3.0 * 1e6
    stiff |= {"accounted_for": known < 1e-6, "smallest": VOLUME_STEPS[0] * 1e6}
    return [
        judged("depth-load-left-out", small and e.unheld_rise > 3.0, drift, **load),
        judged("compressibility-left-out", abs(error) < 0.1, error, **stiff),
    ]


def _stability(e: Evidence) -> list[Finding]:
    o, a, mo = e.analysis.open_loop, e.actuator, e.motion
    negative = sum(c < 0.0 for c in o.denominator)
    certain = negative >= 2 and o.routh.right >= 1
    p = plant(e.vehicle)
    stiff = [p._replace(psi=psi) for psi in -np.geomspace(1e-8, 1e-4, 41)]
    times = [doubling_time(linearise(x)) for x in stiff]
    free = [doubling_time(linearise(x._replace(load_drive=0.0, load_back=0.0))) for x in stiff]
    unstable = all(map(math.isfinite, times)) and not any(map(math.isfinite, free))
    gains = np.geomspace(1e-4, 1e4, 33)
    main = dict(K1=a.K1, K2=mo.K2, A=a.piston_area, T1=a.T1, T2=mo.T2)
    margins = [double_integrator_phase_margin(**main, gain=float(g)) for g in gains]
    best, at_one = math.degrees(max(margins)), math.degrees(margins[16])
    return [
        judged("open-loop", certain, o.doubling_time, negative=negative, routh=o.routh),
        judged("stiff-hulls", unstable, count=len(times), least=min(times), most=max(times)),
        judged("double-integrator", best < 0.0, best=best, gains=gains, at_one=at_one),
    ]


def _prototype(e: Evidence) -> list[Finding]:
    hull, most, rating = e.vehicle.hull, e.vehicle.stroke.maximum, 100.0
    stall = e.analysis.stall
    assert stall is not None
    by_formula = 0.01 * hull.displaced_volume / 100.0
    cylinder = math.pi * _RADIUS**2 * _LENGTH
    radius_meant = math.pi * (2 * _RADIUS) ** 2 * _LENGTH
    rho = e.vehicle.water.density
    displaced = hull.displaced_volume + _FLOTATION
    enclosed, added = rho * (cylinder - displaced), 8.0 / 3.0 * rho * _RADIUS**3
    heavy = _DRY_MASS + enclosed + added
    deepest, reached = e.analysis.neutral.leaves_stroke, most / by_formula
    by_cylinder, shrunk = 0.01 * cylinder / 100.0, hull.psi * hull.displaced_volume / cylinder
    dm3: dict[str, Any] = {"cylinder": cylinder * 1e3, "displaced": displaced * 1e3}
    stroke: dict[str, Any] = {"squeezed": hull.psi * rating * 1e6, "reached": reached}
    stroke["accounted_for"] = reached > rating > deepest
    radius: dict[str, Any] = {"radius_meant": radius_meant * 1e3}
    radius["accounted_for"] = abs(by_cylinder / hull.psi - 1.0) < 5e-3
    return [
        judged("dives", stall.depth >= rating, stall.depth),
        judged("dives-with-its-stroke", hull.psi * rating <= most, deepest, **stroke),
        judged("radius", radius_meant < 1.1 * cylinder, **radius, **dm3),
        compared("displaced-volume", (_DRY_MASS / rho - _FLOTATION) * 1e3),
        compared("psi", by_formula, expected=shrunk, by_cylinder=by_cylinder),
        compared("mass", e.vehicle.mass, expected=heavy, enclosed=enclosed, added=added, **dm3),
    ]


def _identification(e: Evidence) -> list[Finding]:
    found = e.identified
    area = reduced(e.actuator, e.vehicle.water).gain / e.actuator.K1
    return [
        compared("K1", found.K1 * 1e3),
        compared("T1", found.T1),
        compared("depth-voltage", found.depth_voltage),
        *(
            compared("volume-step", dx * area * 1e6, paper=dV * 1e6, dx=dx * 1e3)
            for dx, dV in zip(TRAVELS, VOLUME_STEPS, strict=True)
        ),
    ]


def _table2(e: Evidence) -> list[Finding]:
    by_speed, by_depth = e.table2
    still_speed, still_depth = e.still_average
    still = tuple(fit for _, fit in e.still)
    rows = (
        (by_speed, e.speed_fits, still_speed, e.still_speeds),
        (by_depth, e.depth_fits, still_depth, still),
    )
    findings = []
    for (row, K2, T2), (ours, fits, clean, clean_fits) in zip(_TABLE2, rows, strict=True):
        seen, usual = (np.median(found, axis=0).tolist() for found in (fits, clean_fits))
        for name, n, sign, paper in (("K", 0, -1.0, -K2), ("T", 1, 1.0, T2)):
            known: Any = {"expected": usual[n], "observed": seen[n]}
            said: Any = {"row": row, "clean": clean[n], "truth": (e.motion.K2, e.motion.T2)[n]}
            number = compared(f"table2-{name}", sign * ours[n], paper=paper, **known, **said)
            findings.append(number)
        findings.append(compared("table2-ratio", ours.K2 / ours.T2, paper=K2 / T2, row=row))
    clean_spread = still_speed.K2 / still_depth.K2 - 1.0
    spread = by_speed.K2 / by_depth.K2 - 1.0
    free = abs(e.without_psi[1].K2 / e.without_psi[0].K2 - 1.0)
    why = {"spread": 100 * spread, "clean": 100 * clean_spread, "free": 100 * free}
    known_why = clean_spread > 0.1 and free < 0.05
    close = judged("rows-close", abs(spread) < 0.05, spread, accounted_for=known_why, **why)
    return [*findings, close]


def _control(e: Evidence) -> list[Finding]:
    assert e.vehicle.controller is not None
    _, bound = bind(e.vehicle.controller)
    assert set(e.vehicle.controller.parameters) == set(_TABLE3)
    differences = [p.up.overshoot_pct - p.down.overshoot_pct for p in e.pairs]
    count, points = len(differences), float(np.mean(differences))
    lower = sum(d < 0.0 for d in differences)
    ascends = lower > 0.8 * count and -5.0 < points < 0.0
    m, end = e.long_metrics, e.long_step.time[-1]
    error = abs(m.final_depth_m - float(e.long_step.reference[-1]))
    settled, overshoot = m.settle2_s, m.overshoot_pct
    tail = f"It takes {settled:.0f} s to stay within 2 %: the integral's tail." if settled else ""
    return [
        *(
            compared("gain", getattr(bound, name) * per, paper=paper, unit=unit, name=name)
            for name, (paper, unit, per) in _TABLE3.items()
        ),
        compared("sample-time", bound.S_p),
        judged("underdamped", 0.0 < overshoot < 25.0, overshoot),
        judged("ascending", ascends, points, lower=lower, count=count, points=-points),
        judged("converges", error < 1e-3, error, error=error * 1e3, end=end, tail=tail),
    ]


def independent(e: Evidence) -> list[Finding]:
    """Return the comparison with every independent number."""
    o, c = e.analysis.open_loop, e.analysis.closed_loop
    m, V, stall = e.check_metrics, e.check_step.volume * 1e6, e.analysis.stall
    assert c is not None
    assert c.at_command is not None
    assert c.depth_load is not None
    assert stall is not None
    growing, pair, _, fast = o.poles
    poles = (growing.real, pair.real, abs(pair.imag), fast.real)
    mean = np.mean([fit for _, fit in e.still], axis=0)
    ours = {
        "overshoot": m.overshoot_pct,
        "rise": m.rise90_s,
        "settling": m.settle2_s,
        "smallest-volume": float(V.min()),
        "largest-volume": float(V.max()),
        "phase-margin": math.degrees(c.at_command.phase),
        "delay": c.computation_delay,
        "extra-psi": c.depth_load.extra_psi,
        "stall": stall.depth,
        "joint-K2": e.still_joint.K2,
        "joint-T2": e.still_joint.T2,
        "joint-rms": e.still_joint.rms * 1e3,
        "average-K2": float(mean[0]),
        "average-T2": float(mean[1]),
        "smallest-step": e.still[0][1].K2,
        "largest-step": e.still[-1][1].K2,
    }
    return [
        *(
            compared("coefficient", x, paper=reference, power=4 - i)
            for i, (reference, x) in enumerate(zip(DENOMINATOR, o.denominator, strict=True))
        ),
        *(
            compared("pole", pole, paper=reference, name=name)
            for (name, reference), pole in zip(POLES.items(), poles, strict=True)
        ),
        *(compared(name, math.nan if x is None else x) for name, x in ours.items()),
    ]
