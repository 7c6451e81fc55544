"""The sea laws on the paper's vehicle, with the gains that docs/explanation/laws.md recommends."""

from collections.abc import Callable
from typing import Any

import numpy as np

from swimbladder.control.adrc import AdrcParameters, adrc_gains
from swimbladder.control.deadband import DeadbandParameters, deadband_gains
from swimbladder.control.law import Law, Measurement
from swimbladder.control.sea_cascade import SeaCascadeParameters, sea_cascade_gains
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Vehicle
from tests.vehicles import paper

S_P = 0.3
PLANT = plant(paper())
K2, T2 = 7935.54, 36.3

SEA = SeaCascadeParameters(
    gains=sea_cascade_gains(PLANT.a_b, PLANT.d_l, PLANT.gain, 0.35, S_P),
    target_weight=1.0,
    smoothing=0.5,
    leash=0.0,
    fastest=0.25,
    jerk=0.007,
    shortest=3.0,
    volume_per_speed=PLANT.d_l / PLANT.a_b,
    volume_per_acceleration=1.0 / PLANT.a_b,
    psi=PLANT.psi,
    depth_voltage=PLANT.load_drive,
    rate_per_volt=PLANT.gain,
    voltage_limit=12.0,
    volume_min=PLANT.V_min,
    volume_max=PLANT.V_max,
    dead_zone=0.0,
    S_p=S_P,
)

ADRC_FAST = AdrcParameters(
    b=PLANT.a_b,
    drag=PLANT.d_l,
    psi=PLANT.psi,
    gains=adrc_gains(0.2, 1.2, S_P, 0.05),
    k_pV=SEA.gains.k_pV,
    leash=0.0,
    fastest=0.25,
    jerk=0.007,
    shortest=3.0,
    depth_voltage=PLANT.load_drive,
    rate_per_volt=PLANT.gain,
    voltage_limit=12.0,
    volume_min=PLANT.V_min,
    volume_max=PLANT.V_max,
    S_p=S_P,
)

SLEEPER = DeadbandParameters(
    K2=K2,
    T2=T2,
    psi=PLANT.psi,
    depth_noise=0.003,
    neutral_step=1e-7,
    band=0.2,
    speed_band=0.01,
    fastest=0.05,
    **deadband_gains(K2, T2, PLANT.psi, 15.0, creep=PLANT.gain * PLANT.load_drive)._asdict(),
    interval=15.0,
    k_pV=SEA.gains.k_pV,
    tolerance=5e-8,
    depth_voltage=PLANT.load_drive,
    rate_per_volt=PLANT.gain,
    voltage_limit=12.0,
    volume_min=PLANT.V_min,
    volume_max=PLANT.V_max,
    S_p=S_P,
)


class Seen:
    """A law called from Python, what it saw spoilt by `spoil`, its calls kept."""

    def __init__(
        self, law: Law, parameters: Any, spoil: Callable[[int, Measurement], Measurement]
    ) -> None:
        self.law, self.parameters, self.spoil = law, parameters, spoil
        self.states: list[Any] = []
        self.commands: list[float] = []
        self.waits: list[float] = []

    def __call__(self, measurement: Measurement, reference: float) -> tuple[float, float]:
        seen = self.spoil(round(measurement.time / S_P), measurement)
        p = self.parameters
        state = self.states[-1] if self.states else self.law.initial(p, seen, reference)
        command, after, wait = self.law.step(p, state, seen, reference)
        self.states.append(after)
        self.commands.append(command)
        self.waits.append(wait)
        return command, wait


def blind(first: int, last: int, value: float = np.nan, field: str = "depth") -> Any:
    """Return a sensor that says `value` from sample `first` to before `last`."""
    return lambda k, seen: seen._replace(**{field: value}) if first <= k < last else seen


def by_hand(law: Law, parameters: Any, spoil: Any, vehicle: Vehicle | None = None, **run: Any):
    """Return (solution, calls) of a mission under a law that is called from Python."""
    calls = Seen(law, parameters, spoil)
    ran = simulate(vehicle or paper(), law=calls, sample_time=S_P, **run)
    return ran, calls
