"""The vehicles that the linear tests look at, and their laws."""

import pytest

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import Measurement
from swimbladder.control.position_pid import POSITION_PID, PositionPidParameters
from swimbladder.design.linear import BoundLaw, SampledLoop, linearise, linearise_law
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import (
    Drag,
    Hull,
    IdentifiedActuator,
    IdentifiedMotion,
    PhysicalMotion,
    Positioner,
    Stroke,
    Supply,
    UnifiedActuator,
    Vehicle,
)


@pytest.fixture(scope="session")
def table_3() -> CascadeParameters:
    """Table 3 in SI."""
    return CascadeParameters(k_pV=1002e3, k_pz=-0.1043e-3, k_iz=-7.486e-7, k_dz=-2.341e-3, S_p=0.3)


@pytest.fixture(scope="session")
def position_gains() -> PositionPidParameters:
    """Gains, made up, of a PID on a piston's position."""
    return PositionPidParameters(
        K_p=0.02,
        K_i=2e-4,
        K_d=0.3,
        threshold=0.3,
        smoothing=0.4,
        position_min=0.0,
        position_max=0.06,
        piston_area=2e-3,
        volume_at_zero=6e-5,
        S_p=0.5,
    )


@pytest.fixture(scope="session")
def feup() -> Vehicle:
    """The paper's vehicle, its numbers typed in from the paper."""
    return Vehicle(
        name="feup-em",
        actuator=IdentifiedActuator(
            K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2", depth_voltage=7.707e-2
        ),
        supply=Supply(voltage=12.0),
        stroke=Stroke(minimum="-350 cm3", maximum="350 cm3"),
        hull=Hull(
            displaced_volume=0.0275,
            psi=4.04e-6,
            waterplane_area=0.0314,
            height=1.285,
            depth_limit=100.0,
        ),
        motion=IdentifiedMotion(K2=7935.54, T2=36.3),
    )


@pytest.fixture(scope="session")
def lossy() -> Vehicle:
    """A made-up vehicle with everything that the paper's lacks: friction, sag, leak, efficiency."""
    return Vehicle(
        name="lossy",
        actuator=UnifiedActuator(
            inertia=2e-5,
            k_u=0.05,
            k_v=2e-3,
            k_q=1e-8,
            k_z=2e-4,
            k_l=2e-9,
            efficiency=0.6,
            friction_torque=0.02,
            resistance=1.0,
            emf_constant=0.03,
        ),
        supply=Supply(voltage=24.0, internal_resistance=0.2),
        stroke=Stroke(minimum="-300 cm3", maximum="300 cm3"),
        hull=Hull(
            displaced_volume=0.04, psi=-8e-7, waterplane_area=0.03, height=1.2, depth_limit=200.0
        ),
        motion=PhysicalMotion(
            dry_mass=40.0,
            entrained_mass=2.0,
            added_mass=3.0,
            drag=Drag(law="switched", k_dl=2.0, k_dt=20.0, epsilon=0.02),
        ),
        trim_error=1e-5,
    )


@pytest.fixture(scope="session")
def stepper() -> Vehicle:
    """A made-up vehicle whose piston goes where it is told."""
    return Vehicle(
        name="stepper",
        actuator=Positioner(speed="1 mm/s", piston_area=2e-3),
        stroke=Stroke(minimum="-60 cm3", maximum="60 cm3"),
        hull=Hull(displaced_volume=0.012, psi=3e-7, waterplane_area=0.012, height=0.8),
        motion=PhysicalMotion(dry_mass=12.0, drag=Drag(law="linear", k_dl=4.0)),
    )


@pytest.fixture(scope="session")
def paper_loop(feup, table_3):
    """The paper's vehicle under its cascade, sampled every 0.3 s."""
    seen = Measurement(0.0, 0.0, 0.0)
    law = linearise_law(BoundLaw(CASCADE, table_3, 0.3), seen)
    return SampledLoop(plant=linearise(plant(feup)), law=law)


@pytest.fixture(scope="session")
def stepper_loop(stepper, position_gains):
    """The stepper under a PID on its position, sampled every 0.5 s."""
    seen = Measurement(0.0, 2.0, stepper.neutral_volume(2.0))
    law = linearise_law(BoundLaw(POSITION_PID, position_gains, 0.5), seen)
    return SampledLoop(plant=linearise(plant(stepper)), law=law)
