"""What depth does to a vehicle: the load on the motor, the neutral volume, where either gives up.

Also the claims of section 2.5 on open-loop stability, as functions.
"""

import math
from typing import NamedTuple

import numpy as np

from swimbladder.design.linear.models import StateSpace, linearise
from swimbladder.physics.dynamics import Plant
from swimbladder.physics.electric import largest_voltage, stall_depth


class DepthLoad(NamedTuple):
    """The positive feedback that the depth load keeps when a loop around V does not reject it.

    With u = k_pV (U - V) the volume settles at V = U - extra_psi z: less lift with depth, as if the
    hull were that much softer (end of section 2.1.4).
    """

    k_pV: float  # V/m3, of the inner loop at low frequency
    extra_psi: float  # m3/m, (k_z/k_u + k_l/(K1 A))/k_pV
    share_of_psi: float  # -, extra_psi/psi; inf for psi = 0
    doubling_time: float  # s, of a disturbance of depth while U is held
    doubling_time_rejected: float  # s, the same if the load were fully rejected


class Stall(NamedTuple):
    """Where the supply can no longer turn the motor against the sea."""

    depth: float  # m, stall of the motor at the voltage that the sagging supply leaves it
    depth_without_sag: float  # m, the same if the supply had no internal resistance
    holding_depth: float  # m, where the pump only just makes up for its leakage
    back_drive_depth: float  # m, below which the sea turns a motor without voltage
    voltage: float  # V, at the motor at stall
    extending_rate: float  # m3/s, fastest at the depth that was asked about; 0 below the stall
    limit: float | None  # m, the depth limit; None where none is stated

    @property
    def within_limit(self) -> bool | None:
        """Whether the motor turns down to the depth limit; None where no limit is stated."""
        return None if self.limit is None else self.depth > self.limit


class NeutralVolume(NamedTuple):
    """The volume at which the vehicle rests, against depth."""

    depths: tuple[float, ...]  # m
    volumes: tuple[float, ...]  # m3
    leaves_stroke: float  # m, depth at which it is no longer within the stroke


class StiffHull(NamedTuple):
    """The vehicle with a hull as much stiffer than water as its own is softer (section 2.5)."""

    psi: float  # m3/m, negative
    poles: tuple[complex, ...]  # 1/s, with the loads k_z and k_l
    doubling_time: float  # s
    poles_without_loads: tuple[complex, ...]  # 1/s, with k_z = k_l = 0
    unstable: bool  # with the loads


def doubling_time(system: StateSpace) -> float:
    """Return the time in which the fastest growing disturbance doubles [s]; inf if none grows."""
    growth = float(np.max(system.poles.real))
    noise = 1e-12 * float(np.linalg.norm(system.A, 2))
    return math.log(2.0) / growth if growth > noise else math.inf


def depth_load(p: Plant, *, k_pV: float) -> DepthLoad:
    """Return the positive feedback left by a proportional inner loop of gain k_pV [V/m3]."""
    extra = (p.load_drive + p.k_l / p.gain) / k_pV
    softer = p._replace(psi=p.psi + extra)
    return DepthLoad(
        k_pV=k_pV,
        extra_psi=extra,
        share_of_psi=extra / p.psi if p.psi else math.inf,
        doubling_time=doubling_time(_motion(softer)),
        doubling_time_rejected=doubling_time(_motion(p)),
    )


def _motion(p: Plant) -> StateSpace:
    """The vertical motion alone, driven by the volume."""
    return linearise(p._replace(positioner=1.0))


def stall(p: Plant, *, depth: float, depth_limit: float | None) -> Stall:
    """Return where the supply can no longer turn the motor, and how fast it extends at `depth` [m].

    At stall the current is the voltage over the motor's resistance, so a supply with internal
    resistance leaves E/(1 + sag) of its E. Dry friction takes its part of it.
    """
    at_motor = largest_voltage(E=p.supply, sag=p.sag, emf=0.0)
    free = at_motor - p.friction
    motor = dict(E=p.supply, load=p.load_drive, friction=p.friction)
    # Turning forward the motor's own voltage lowers the current, and so the sag.
    recovered = 1.0 - p.gain * p.sag * p.kappa / (1.0 + p.sag)
    rate = p.gain * (free - p.load_drive * depth) / recovered
    return Stall(
        depth=stall_depth(sag=p.sag, **motor),
        depth_without_sag=stall_depth(sag=0.0, **motor),
        holding_depth=_ratio(free, p.load_drive + p.k_l * recovered / p.gain),
        back_drive_depth=_ratio(p.friction, p.load_back),
        voltage=at_motor,
        extending_rate=max(rate, 0.0),
        limit=depth_limit,
    )


def _ratio(free: float, load: float) -> float:
    if load == 0.0:
        return math.inf if free > 0.0 else 0.0
    return max(free, 0.0) / load


def neutral_volume(p: Plant, *, down_to: float, points: int = 11) -> NeutralVolume:
    """Return the neutral volume psi z + V0 at `points` depths down to `down_to` [m]."""
    depths = tuple(float(z) for z in np.linspace(0.0, down_to, points))
    return NeutralVolume(depths, tuple(p.psi * z + p.V_0 for z in depths), neutral_end(p))


def neutral_end(p: Plant) -> float:
    """Return the depth at which the neutral volume leaves the stroke [m]; inf where none does."""
    end = p.V_max if p.psi > 0.0 else p.V_min
    return (end - p.V_0) / p.psi if p.psi else math.inf


def stiff_hull(p: Plant) -> StiffHull | None:
    """Return what becomes of a vehicle with psi < 0: section 2.5 says it stays unstable.

    The constant term of (34) is -K2 (K1 A k_z/k_u + k_l), whatever psi: with any load at all the
    coefficients differ in sign. None where psi = 0 or nothing loads the motor's volume.
    """
    if p.psi == 0.0 or p.positioner:
        return None
    stiff = p._replace(psi=-abs(p.psi))
    loaded = linearise(stiff)
    free = linearise(stiff._replace(load_drive=0.0, k_l=0.0))
    time = doubling_time(loaded)
    return StiffHull(
        psi=stiff.psi,
        poles=tuple(complex(x) for x in loaded.poles),
        doubling_time=time,
        poles_without_loads=tuple(complex(x) for x in free.poles),
        unstable=math.isfinite(time),
    )


def double_integrator_phase_margin(
    *, K1: float, K2: float, A: float, T1: float, T2: float, gain: float = 1.0
) -> float:
    """Return the phase margin [rad] of eq. (35) under u = -gain (z_ref - z); negative for any gain.

    The two integrators take 180 degrees and the two lags the rest. K1 [m/s/V]; K2 [1/m2/s];
    A [m2]; T1, T2 [s]; gain [V/m].
    """
    k = gain * K1 * K2 * A
    # |L| = 1: w^2 sqrt(1 + (T1 w)^2) sqrt(1 + (T2 w)^2) = k, cubed and quadratic in w^2.
    squares = np.roots([(T1 * T2) ** 2, T1**2 + T2**2, 1.0, 0.0, -(k**2)])
    w = math.sqrt(max(float(r.real) for r in squares if abs(r.imag) <= 1e-9 * abs(r)))
    return -(math.atan(T1 * w) + math.atan(T2 * w))
