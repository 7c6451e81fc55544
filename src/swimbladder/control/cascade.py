"""The paper's cascade: a proportional law on volume inside a PID on depth (Fig. 15, eqs 36-37)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from swimbladder.control import law
from swimbladder.control.law import Measurement

_THIRD = 0.4  # of the natural frequency: the third pole
_GRID = law.Grid((0.3, 0.45), (0.05, 0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23), (0.6, 0.8, 1.0))


class CascadeParameters(NamedTuple):
    """Gains of Table 3 in SI; the sample time is the one eqs (36)-(37) divide by."""

    k_pV: Annotated[float, "V/m3"]
    k_pz: Annotated[float, "m3/m"]
    k_iz: Annotated[float, "m3/s/m"]
    k_dz: Annotated[float, "m3 s/m"]
    S_p: Annotated[float, "s"]


class CascadeState(NamedTuple):
    """What the cascade remembers between samples."""

    integral: float  # m3, U_i of the sample to come
    error: float  # m, of the sample before
    volume_reference: float  # m3, U of the sample before


def initial(
    parameters: CascadeParameters, measurement: Measurement, reference: float
) -> CascadeState:
    """Start at rest: the integral holds the volume as it is, and e(-1) = e(0)."""
    return CascadeState(measurement.volume, reference - measurement.depth, measurement.volume)


def step(
    parameters: CascadeParameters, state: CascadeState, measurement: Measurement, reference: float
) -> tuple[float, CascadeState, float]:
    """Return the voltage [V], eqs (36)-(37) outside and a gain on the volume error inside.

    The voltage is not limited here: the supply limits it.
    """
    p = parameters
    error = reference - measurement.depth
    U = p.k_pz * error + p.k_dz / p.S_p * (error - state.error) + state.integral
    voltage = p.k_pV * (U - measurement.volume)
    return voltage, CascadeState(state.integral + p.k_iz * p.S_p * error, error, U), p.S_p


def _gains(s: law.Setting, k: law.TuningParameters) -> CascadeParameters:
    """Poles of the depth at the natural frequency, and a third one for the integral."""
    d, a = law.stiffness(s.plant)
    w, zeta = k.frequency, k.damping
    third = _THIRD * w
    return CascadeParameters(
        k_pV=k.inner / s.plant.gain,
        k_pz=-(w * w + 2.0 * zeta * w * third + a * s.plant.psi) / a,
        k_iz=-w * w * third / a,
        k_dz=-(2.0 * zeta * w + third - d) / a,
        S_p=s.sample_time,
    )


CASCADE = law.Law(
    name="cascade",
    summary="the paper's: P on volume inside PID on depth (Fig. 15, eqs 36-37, Table 3)",
    command="voltage",
    parameters=CascadeParameters,
    state=CascadeState,
    step=step,
    initial=initial,
    volume_gain="k_pV",
    recipe=law.Recipe(
        gains=_gains,
        fast=_GRID,
        quiet=_GRID._replace(inner=(0.3,), frequency=law.QUIET.frequency),
        volts=(1.0,),
    ),
)
