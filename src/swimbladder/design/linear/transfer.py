"""The paper's transfer functions as formulas: eqs (9), (19), (20), (30) and (32)-(35).

Each function returns numerator and denominator in descending powers of s, in the paper's own
normalisation, from the symbols the paper uses. They are plain arithmetic: SymPy symbols pass
through them too.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swimbladder.physics.dynamics import Plant

Ratio = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class TransferFunction:
    """A transfer function with its numbers and what they stand for."""

    equations: tuple[str, ...]  # the paper's numbers
    input: str
    output: str
    symbols: str  # the formula
    numerator: tuple[float, ...]  # descending powers of s
    denominator: tuple[float, ...]

    @property
    def poles(self) -> tuple[complex, ...]:
        """Roots of the denominator [1/s], the largest real part first."""
        roots = [complex(r) for r in np.roots(self.denominator)]
        return tuple(sorted(roots, key=lambda r: (-r.real, -r.imag)))

    def to_control(self) -> Any:
        """Return it as a python-control TransferFunction."""
        import control

        ratio = [*self.numerator], [*self.denominator]
        return control.tf(*ratio, inputs=self.input, outputs=self.output)


def volume_per_voltage(*, inertia: float, k_u: float, k_q: float, k_v: float) -> Ratio:
    """V/U of the unified actuator, eqs (9) and (19), first term [m3/V].

    inertia: lambda [kg m2]; k_u [N m/V]; k_q [m3/rad]; k_v [N m s/rad].
    """
    return (k_u * k_q / k_v,), (inertia / k_v, 1, 0)


def volume_per_depth(*, inertia: float, k_v: float, k_q: float, k_z: float, k_l: float) -> Ratio:
    """V/Z of the unified actuator, eqs (9) and (19), second term [m3/m]: the depth load.

    inertia: lambda [kg m2]; k_v [N m s/rad]; k_q [m3/rad]; k_z [N m/m]; k_l [m2/s].
    """
    return (-inertia * k_l / k_v, -(k_l + k_q * k_z / k_v)), (inertia / k_v, 1, 0)


def depth_per_volume_physical(*, k_b: float, k_def: float, k_dl: float, m: float) -> Ratio:
    """Z/V in physical constants, eq. (20) [m/m3]; has no meaning for k_def = 0.

    k_b [N/m3]; k_def [N/m]; k_dl [N s/m]; m [kg].
    """
    return (-k_b / k_def,), (m / k_def, k_dl / k_def, -1)


def depth_per_volume_identified(*, K2: float, T2: float, k_def: float, k_dl: float) -> Ratio:
    """Z/V with K2 and T2, eq. (30) [m/m3]. K2 [1/m2/s]; T2 [s]; k_def [N/m]; k_dl [N s/m]."""
    return (-K2,), (T2, 1, -k_def / k_dl)


def depth_per_volume(*, K2: float, T2: float, psi: float) -> Ratio:
    """Z/V with K2, T2 and psi, eq. (32) [m/m3]. K2 [1/m2/s]; T2 [s]; psi [m3/m]."""
    return (-K2,), (T2, 1, -psi * K2)


def volume_per_voltage_identified(*, K1: float, A: float, T1: float) -> Ratio:
    """V/U in identified parameters, eq. (33), first term [m3/V]. K1 [m/s/V]; A [m2]; T1 [s]."""
    return (K1 * A,), (T1, 1, 0)


def volume_per_depth_identified(
    *, K1: float, A: float, T1: float, depth_voltage: float, k_l: float
) -> Ratio:
    """V/Z in identified parameters, eq. (33), second and third term over one denominator [m3/m].

    K1 [m/s/V]; A [m2]; T1 [s]; depth_voltage: k_z/k_u [V/m]; k_l [m2/s].
    """
    return (-k_l * T1, -(K1 * A * depth_voltage + k_l)), (T1, 1, 0)


def depth_per_voltage(
    *,
    K1: float,
    K2: float,
    A: float,
    T1: float,
    T2: float,
    psi: float,
    depth_voltage: float,
    k_l: float,
) -> Ratio:
    """Z/U in open loop, eq. (34) [m/V].

    K1 [m/s/V]; K2 [1/m2/s]; A [m2]; T1, T2 [s]; psi [m3/m]; depth_voltage: k_z/k_u [V/m];
    k_l [m2/s].
    """
    return (-K1 * K2 * A,), (
        T1 * T2,
        T1 + T2,
        1 - psi * K2 * T1,
        -(psi + k_l * T1) * K2,
        -K2 * (K1 * A * depth_voltage + k_l),
    )


def depth_per_voltage_without_loads(
    *, K1: float, K2: float, A: float, T1: float, T2: float
) -> Ratio:
    """Z/U where psi, k_l and k_z vanish, eq. (35): a double integrator and two lags [m/V].

    K1 [m/s/V]; K2 [1/m2/s]; A [m2]; T1, T2 [s].
    """
    return (-K1 * K2 * A,), (T1 * T2, T1 + T2, 1, 0, 0)


def transfer_functions(p: Plant, *, m: float, k_b: float) -> tuple[TransferFunction, ...]:
    """Return every transfer function of the paper that a vehicle has, with its numbers.

    m: accelerated mass [kg]; k_b: specific weight of the water [N/m3]. Only ratios of the
    actuator's constants enter (9) and (19). Without a laminar drag K2 and T2 do not exist, nor do
    (30), (32), (34) and (35); without a compressible hull (20) does not.
    """
    k_dl, k_def = p.d_l * m, k_b * p.psi
    K2, T2 = (k_b / k_dl, m / k_dl) if k_dl > 0.0 else (math.inf, math.inf)
    found: dict[str, Ratio] = {}
    if k_def != 0.0:
        found["20 Z/V"] = depth_per_volume_physical(k_b=k_b, k_def=k_def, k_dl=k_dl, m=m)
    if k_dl > 0.0:
        found["30 Z/V"] = depth_per_volume_identified(K2=K2, T2=T2, k_def=k_def, k_dl=k_dl)
        found["32 Z/V"] = depth_per_volume(K2=K2, T2=T2, psi=p.psi)
    if not p.positioner:
        ratios = dict(inertia=p.T1, k_v=1.0, k_q=p.gain)  # those of k_u = k_v = 1
        drive = dict(K1=p.gain, A=1.0, T1=p.T1)  # only the product K1 A enters
        loads = dict(depth_voltage=p.load_drive, k_l=p.k_l)
        found["9 V/U"] = volume_per_voltage(k_u=1.0, **ratios)
        found["9 V/Z"] = volume_per_depth(k_z=p.load_drive, k_l=p.k_l, **ratios)
        found["33 V/U"] = volume_per_voltage_identified(**drive)
        found["33 V/Z"] = volume_per_depth_identified(**drive, **loads)
        if k_dl > 0.0:
            motion = dict(K2=K2, T2=T2, **drive)
            found["34 Z/U"] = depth_per_voltage(psi=p.psi, **motion, **loads)
            found["35 Z/U"] = depth_per_voltage_without_loads(**motion)
    return tuple(_transfer_function(key, found[key]) for key in _SYMBOLS if key in found)


_SYMBOLS = {
    "9 V/U": "k_u k_q/k_v / (s (lambda/k_v s + 1))",
    "9 V/Z": "-(lambda k_l/k_v s + k_l + k_q k_z/k_v) / (s (lambda/k_v s + 1))",
    "20 Z/V": "-(k_b/k_def) / (m/k_def s^2 + k_dl/k_def s - 1)",
    "30 Z/V": "-K2 / (T2 s^2 + s - k_def/k_dl)",
    "32 Z/V": "-K2 / (T2 s^2 + s - psi K2)",
    "33 V/U": "K1 A / (s (T1 s + 1))",
    "33 V/Z": "-(K1 A k_z/k_u / (s (T1 s + 1)) + k_l/s)",
    "34 Z/U": "-K1 K2 A / (T1 T2 s^4 + (T1 + T2) s^3 + (1 - psi K2 T1) s^2 "
    "- (psi + k_l T1) K2 s - K2 (K1 A k_z/k_u + k_l))",
    "35 Z/U": "-K1 K2 A / (s^2 (T1 T2 s^2 + (T1 + T2) s + 1)), where psi = k_l = k_z = 0",
}


def _transfer_function(key: str, ratio: Ratio) -> TransferFunction:
    number, pair = key.split()
    output, input = pair.split("/")
    numerator = [float(c) for c in ratio[0]]
    while len(numerator) > 1 and numerator[0] == 0.0:
        numerator.pop(0)
    return TransferFunction(
        equations=("9", "19") if number == "9" else (number,),
        input=input,
        output=output,
        symbols=_SYMBOLS[key],
        numerator=tuple(numerator),
        denominator=tuple(float(c) for c in ratio[1]),
    )
