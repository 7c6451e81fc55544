"""Vehicles that the tests of the simulator share: the paper's, made-up ones, and random ones."""

import math
from typing import Any

import pytest
from hypothesis import strategies as st

from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from swimbladder.sim.faults.draw import course_of
from swimbladder.vehicle import (
    Controller,
    Drag,
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    Hull,
    HydraulicDrive,
    IdentifiedActuator,
    IdentifiedMotion,
    Motor,
    PhysicalMotion,
    Positioner,
    ScrewDrive,
    Sensors,
    Stroke,
    Supply,
    UnifiedActuator,
    Vehicle,
)

SAMPLED = [name for name, law in LAWS.items() if law.command != "volume change"]
"""The laws of voltages and positions."""
FLOATS = {"rate": "example-float", "argo": "deep-arvor"}
"""A preset with a pump and a valve for each law of volume changes."""
DIVES = {"rate": (30.0, 5400.0), "argo": (300.0, 18000.0)}
"""A depth [m] that each dives to and comes up from in a time [s]."""
QUICK = ("cascade", "adrc", "position-pid")
EACH = [n if n in QUICK else pytest.param(n, marks=pytest.mark.prove) for n in SAMPLED]
"""Parameters of a test that `make test` runs for three laws, `make prove` for the others too."""
TWO = [pytest.param(n, marks=pytest.mark.prove) if n == "adrc" else n for n in EACH]
"""Likewise, of which `make test` runs one that asks for a voltage and one for a position."""

TABLE_3 = {"k_pV": "1002 V/dm3", "k_pz": "-0.1043 dm3/m", "k_iz": "-7.486e-4 dm3/s/m"} | {
    "k_dz": "-2.341 dm3 s/m"
}
LINEAR = Drag(law="linear", k_dl=6.0)
QUADRATIC = Drag(law="quadratic", k_dt=60.0)
BLENDED = Drag(law="blended", k_dl=2.0, k_dt=40.0)
SWITCHED = Drag(law="switched", k_dl=2.0, k_dt=40.0, epsilon=0.03)
LITERAL = Drag(law="switched-literal", k_dl=2.0, k_dt=40.0, epsilon=0.04)


def paper(**changes: Any) -> Vehicle:
    """The paper's vehicle, its numbers typed in from the paper."""
    fields: dict[str, Any] = dict(
        name="paper",
        actuator=IdentifiedActuator(
            K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2", depth_voltage=7.707e-2
        ),
        supply=Supply(voltage=12.0),
        stroke=Stroke(minimum="-350 cm3", maximum="350 cm3"),
        hull=Hull(
            displaced_volume=0.0275, psi=4.04e-6, waterplane_area=math.pi / 100, height=1.285
        ),
        motion=IdentifiedMotion(K2=7935.54, T2=36.3),
        controller=Controller(law="cascade", sample_time=0.3, parameters=TABLE_3),
    )
    return Vehicle(**(fields | changes))


def body(drag: Drag = LINEAR, **changes: Any) -> dict[str, Any]:
    """Hull, mass and stroke of the made-up vehicles; the sensor sits 0.3 m below the top."""
    return (
        dict(
            name="made up",
            supply=Supply(voltage=12.0),
            stroke=Stroke(minimum="-200 cm3", maximum="200 cm3"),
            hull=Hull(
                displaced_volume=0.03,
                psi=-1e-6,
                waterplane_area=0.02,
                emergence_depth=0.3,
                height=1.2,
            ),
            motion=PhysicalMotion(dry_mass=30.0, entrained_mass=2.0, added_mass=4.0, drag=drag),
        )
        | changes
    )


def screw(
    *,
    efficiency: float = 0.5,
    friction: float = 0.0,
    literal: bool = False,
    R_b: float = 0.0,
    drag: Drag = LINEAR,
    **changes: Any,
) -> Vehicle:
    """A motor on a spindle: 60 s from stop to stop, 0.1 to 0.4 V per metre of depth."""
    return Vehicle(
        actuator=ElectromechanicalActuator(
            motor=Motor(
                resistance=1.5,
                torque_constant=0.03,
                rotor_inertia=3e-5,
                viscous_friction=4e-6,
                friction_torque=friction,
            ),
            drive=ScrewDrive(
                lead="2 mm/rev",
                gear_ratio=20,
                efficiency=efficiency,
                piston_area="60 cm2",
                reflected_inertia=2e-5,
            ),
            literal_efficiency=literal,
        ),
        **(body(drag) | dict(supply=Supply(voltage=12.0, internal_resistance=R_b)) | changes),
    )


def pump(
    *,
    leak: float = 2e-14,
    friction: float = 4e-3,
    R_b: float = 0.0,
    drag: Drag = LINEAR,
    efficiency: float = 0.8,
    **changes: Any,
) -> Vehicle:
    """A motor on a leaking pump; leak in m3/s/Pa."""
    return Vehicle(
        actuator=ElectrohydraulicActuator(
            motor=Motor(
                resistance=1.2,
                torque_constant=0.06,
                rotor_inertia=1.5e-5,
                viscous_friction=2e-6,
                friction_torque=friction,
            ),
            drive=HydraulicDrive(
                pump_displacement="0.3 cc/rev",
                pump_efficiency=efficiency,
                pump_leakage=leak,
                reflected_inertia=3e-6,
                viscous_friction=1e-5,
            ),
        ),
        **(body(drag) | dict(supply=Supply(voltage=24.0, internal_resistance=R_b)) | changes),
    )


def stepper(drag: Drag = LINEAR, **changes: Any) -> Vehicle:
    """A piston that goes where it is told, 20 s from stop to stop."""
    fields = body(drag) | dict(supply=None)
    return Vehicle(actuator=Positioner(speed="2 mm/s", piston_area=1e-2), **(fields | changes))


def exponents(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between two positive bounds, evenly in their logarithm."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


@st.composite
def vehicles(draw: st.DrawFn, *, kinds: str = "identified unified lossy positioner") -> Vehicle:
    """Vehicles of any kind: small motors, psi of both signs, every drag, sag, leak, friction."""
    kind = draw(st.sampled_from(kinds.split()))
    stroke = draw(exponents(1e-5, 1e-3))
    rate = stroke * draw(exponents(0.01, 1.0))  # m3/s at full voltage
    T1 = draw(exponents(2e-3, 0.5))
    k_l = draw(st.sampled_from([0.0, 0.0, 1e-9, 1e-6])) * stroke / 1e-4
    R_b = draw(st.sampled_from([0.0, 0.2, 0.8])) if kind == "lossy" else 0.0
    actuator: Any
    if kind == "positioner":
        actuator = Positioner(speed=rate / 1e-2, piston_area=1e-2)
    elif kind == "identified":
        actuator = IdentifiedActuator(
            K1=rate / 12.0 / 5e-3,
            T1=T1,
            piston_area=5e-3,
            k_l=k_l,
            depth_voltage=draw(st.sampled_from([0.0, 0.077, 0.5])),
        )
    else:
        lossy = kind == "lossy"
        k_u = k_emf = 0.05
        k_v = k_u * k_emf + draw(exponents(1e-6, 1e-3))
        k_q = rate / 12.0 * k_v / k_u
        eta = draw(st.sampled_from([1.0, 0.8, 0.3])) if lossy else 1.0
        actuator = UnifiedActuator(
            inertia=T1 * k_v,
            k_u=k_u,
            k_v=k_v,
            k_q=k_q,
            k_z=9806.65 * k_q / eta,
            k_l=k_l,
            efficiency=eta if lossy else None,
            friction_torque=draw(st.sampled_from([0.0, 0.02, 0.1])) if lossy else 0.0,
            resistance=1.0,
            emf_constant=k_emf,
        )
    laminar, turbulent = draw(exponents(0.1, 100.0)), draw(exponents(1.0, 500.0))
    epsilon = draw(exponents(0.005, 0.2))
    drag = draw(
        st.sampled_from(
            [
                Drag(law="linear", k_dl=laminar),
                Drag(law="quadratic", k_dt=turbulent),
                Drag(law="blended", k_dl=laminar, k_dt=turbulent),
                Drag(law="switched", k_dl=laminar, k_dt=turbulent, epsilon=epsilon),
                Drag(law="switched-literal", k_dl=laminar, k_dt=turbulent, epsilon=epsilon),
            ]
        )
    )
    noise = draw(st.sampled_from([0.0, 2e-3]))
    return Vehicle(
        name="random",
        actuator=actuator,
        supply=Supply(voltage=12.0, internal_resistance=R_b),
        stroke=Stroke(minimum=-stroke, maximum=stroke),
        hull=Hull(
            displaced_volume=0.03,
            psi=draw(st.sampled_from([4e-6, -4e-6, 0.0, 2e-5])) * stroke / 3.5e-4,
            waterplane_area=draw(exponents(3e-3, 0.1)),
            emergence_depth=draw(st.sampled_from([0.0, 0.3])),
            height=draw(st.floats(0.2, 3.0)),
        ),
        motion=PhysicalMotion(dry_mass=draw(exponents(3.0, 300.0)), drag=drag),
        trim_error=draw(st.integers(-3, 3)) * 0.1 * stroke,
        sensors=Sensors(depth_noise=noise, depth_quantum=draw(st.sampled_from([0.0, 5e-3]))),
    )


def by_rule(name: str) -> Vehicle:
    """Return a preset that the mission's own rule flies: without a law that samples."""
    vehicle = load_vehicle(name)
    rate = vehicle.controller is not None and vehicle.controller.law == "rate"
    return vehicle if rate else vehicle.model_copy(update={"controller": None})


def limited(vehicle: Vehicle, seconds: float = 7200.0) -> Vehicle:
    """Return the vehicle with a time limit of its supervisor [s], where it has none."""
    own = vehicle.supervisor
    if own.time_limit is not None:
        return vehicle
    own = own.model_copy(update={"time_limit": seconds})
    return vehicle.model_copy(update={"supervisor": own})


def usual(vehicle: Vehicle, depths: Any = None, column: Any = None) -> Vehicle:
    """Return the vehicle with the time that missions with faults take as its limit."""
    course = course_of(limited(vehicle, 1e6), depths, column)
    return limited(vehicle, course.takes + course.slack)
