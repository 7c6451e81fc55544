"""Actuators from datasheets against first principles, SymPy, pint and the paper's own numbers."""

import math

import pint
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.physics import actuator as act
from swimbladder.vehicle import (
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    HydraulicDrive,
    IdentifiedActuator,
    Motor,
    Positioner,
    ScrewDrive,
    UnifiedActuator,
    Water,
)

SEA = Water(density=1025.0)

MOTOR = {
    "resistance": 1.3,
    "torque_constant": 0.05,
    "emf_constant": 0.051,
    "rotor_inertia": 2e-5,
    "viscous_friction": 3e-6,
    "friction_torque": 0.004,
}
PUMP = {
    "pump_displacement": 0.3e-6,
    "pump_efficiency": 0.7,
    "area_ratio": 1.5,
    "pump_leakage": 4e-15,
    "reflected_inertia": 5e-6,
    "viscous_friction": 7e-6,
}
SCREW = {
    "lead": 0.004,
    "gear_ratio": 12.0,
    "efficiency": 0.6,
    "piston_area": 0.0065,
    "reflected_inertia": 5e-6,
    "viscous_friction": 7e-6,
}


def hydraulic(motor=MOTOR, drive=PUMP, **options):
    return ElectrohydraulicActuator(motor=Motor(**motor), drive=HydraulicDrive(**drive), **options)


def screwed(motor=MOTOR, drive=SCREW, **options):
    return ElectromechanicalActuator(motor=Motor(**motor), drive=ScrewDrive(**drive), **options)


def positive(low, high):
    return st.floats(math.log(low), math.log(high)).map(math.exp)


@st.composite
def motors(draw):
    k_T = draw(positive(1e-3, 0.3))
    return {
        "resistance": draw(positive(0.05, 30.0)),
        "torque_constant": k_T,
        "emf_constant": k_T * draw(st.floats(1.0, 1.1)),
        "rotor_inertia": draw(positive(1e-8, 1e-3)),
        "viscous_friction": draw(st.sampled_from([0.0, 1e-6, 1e-4])),
        "friction_torque": draw(st.sampled_from([0.0, 1e-3, 0.05])),
    }


@st.composite
def actuators(draw, **options):
    shared = {
        "reflected_inertia": draw(st.sampled_from([0.0, 1e-6, 1e-4])),
        "viscous_friction": draw(st.sampled_from([0.0, 1e-6, 1e-4])),
    }
    eta = draw(st.floats(0.2, 1.0))
    if draw(st.booleans()):
        drive = {
            "pump_displacement": draw(positive(1e-9, 1e-5)),
            "pump_efficiency": eta,
            "area_ratio": draw(positive(0.2, 5.0)),
            "pump_leakage": draw(st.sampled_from([0.0, 1e-16, 1e-13])),
        }
        return hydraulic(draw(motors()), drive | shared, **options)
    drive = {
        "lead": draw(positive(1e-4, 0.1)),
        "gear_ratio": draw(positive(1.0, 500.0)),
        "efficiency": eta,
        "piston_area": draw(positive(1e-4, 0.1)),
    }
    return screwed(draw(motors()), drive | shared, **options)


# --- dimensions ---------------------------------------------------------------------------------

DIMENSIONS = [
    (act.stall_torque_per_volt, {"k_T": "N*m/A", "R": "ohm"}, "N*m/V"),
    (
        act.speed_loss_coefficient,
        {"B_m": "N*m*s/rad", "k_emf": "V*s/rad", "k_T": "N*m/A", "R": "ohm"},
        "N*m*s/rad",
    ),
    (act.leakage_volume_rate, {"Q_l": "m^3/s", "n_h": ""}, "m^3/s"),
    (
        act.pump_leakage_flow,
        {"k_pl": "m^3/s/Pa", "rho": "kg/m^3", "g": "m/s^2", "z": "m", "n_h": ""},
        "m^3/s",
    ),
    (act.volume_lost_to_leakage, {"k_l": "m^2/s", "z": "m"}, "m^3/s"),
    (
        act.leakage_coefficient,
        {"k_pl": "m^3/s/Pa", "rho": "kg/m^3", "g": "m/s^2", "n_h": ""},
        "m^2/s",
    ),
    (
        act.hydraulic_load_coefficient,
        {"rho": "kg/m^3", "g": "m/s^2", "D_p": "m^3/rad", "eta_p": "", "n_h": ""},
        "N*m/m",
    ),
    (act.hydraulic_volume_per_angle, {"D_p": "m^3/rad", "n_h": ""}, "m^3/rad"),
    (
        act.screw_load_coefficient,
        {"rho": "kg/m^3", "g": "m/s^2", "A": "m^2", "alpha": "m/rad", "eta_e": ""},
        "N*m/m",
    ),
    (act.screw_volume_per_angle, {"A": "m^2", "alpha": "m/rad"}, "m^3/rad"),
]


@pytest.mark.parametrize(("function", "units", "result"), DIMENSIONS)
def test_every_coefficient_has_the_unit_it_states(function, units, result):
    """pint does the dimensions; an angle has none, so revolutions are tested by value below."""
    ureg = pint.UnitRegistry()
    value = function(**{name: ureg.Quantity(1.7, unit) for name, unit in units.items()})
    assert value.check(ureg.Quantity(1.0, result).dimensionality)
    plain = function(**dict.fromkeys(units, 1.7))
    assert value.to_base_units().magnitude == pytest.approx(plain, rel=1e-14)


# --- each constant alone ------------------------------------------------------------------------

# What doubling one number of the datasheet does: the power of 2 in k_u, k_q, k_z and k_l.
MOTOR_POWERS = {
    "resistance": (-1, 0, 0, 0),
    "torque_constant": (1, 0, 0, 0),
    "emf_constant": (0, 0, 0, 0),
    "rotor_inertia": (0, 0, 0, 0),
    "viscous_friction": (0, 0, 0, 0),
    "friction_torque": (0, 0, 0, 0),
}
PUMP_POWERS = {
    "pump_displacement": (0, 1, 1, 0),
    "pump_efficiency": (0, 0, -1, 0),
    "area_ratio": (0, -1, -1, -2),
    "pump_leakage": (0, 0, 0, 1),
    "reflected_inertia": (0, 0, 0, 0),
    "viscous_friction": (0, 0, 0, 0),
}
SCREW_POWERS = {
    "lead": (0, 1, 1, 0),
    "gear_ratio": (0, -1, -1, 0),
    "efficiency": (0, 0, -1, 0),
    "piston_area": (0, 1, 1, 0),
    "reflected_inertia": (0, 0, 0, 0),
    "viscous_friction": (0, 0, 0, 0),
}
CASES = [
    *[(hydraulic, "motor", MOTOR, name, powers) for name, powers in MOTOR_POWERS.items()],
    *[(screwed, "motor", MOTOR, name, powers) for name, powers in MOTOR_POWERS.items()],
    *[(hydraulic, "drive", PUMP, name, powers) for name, powers in PUMP_POWERS.items()],
    *[(screwed, "drive", SCREW, name, powers) for name, powers in SCREW_POWERS.items()],
]


@pytest.mark.parametrize(("make", "part", "numbers", "name", "powers"), CASES)
def test_each_number_of_a_datasheet_goes_where_it_belongs(make, part, numbers, name, powers):
    """Halved, not doubled, so that an efficiency stays one."""
    before = act.unified(make(), SEA)
    after = act.unified(make(**{part: numbers | {name: numbers[name] / 2.0}}), SEA)
    for field, power in zip(("k_u", "k_q", "k_z", "k_l"), powers, strict=True):
        expected = getattr(before, field) * 0.5**power
        assert getattr(after, field) == pytest.approx(expected, rel=1e-14), field
    m = Motor(**(MOTOR | ({name: numbers[name] / 2.0} if part == "motor" else {})))
    d = PUMP | ({name: numbers[name] / 2.0} if part == "drive" else {})
    inertia = m.rotor_inertia + d["reflected_inertia"]
    losses = m.viscous_friction + d["viscous_friction"]
    assert after.inertia == pytest.approx(inertia, rel=1e-14)
    assert after.k_v == pytest.approx(
        losses + m.emf_constant * m.torque_constant / m.resistance, rel=1e-14
    )
    assert (after.friction_torque, after.resistance) == (m.friction_torque, m.resistance)
    assert after.emf_constant == m.emf_constant
    assert after.efficiency == d.get(name if "efficiency" in name else "", before.efficiency)


@pytest.mark.parametrize("name", ["density", "gravity"])
def test_the_load_and_the_leakage_grow_with_the_waters_weight(name):
    water = Water(density=950.0, gravity=9.75)
    heavier = water.model_copy(update={name: getattr(water, name) * 1.01})
    a, b = act.unified(hydraulic(), water), act.unified(hydraulic(), heavier)
    assert b.k_z / a.k_z == pytest.approx(1.01, rel=1e-12)
    assert b.k_l / a.k_l == pytest.approx(1.01, rel=1e-12)
    assert (a.k_u, a.k_q, a.k_v) == (b.k_u, b.k_q, b.k_v)
    c, d = act.unified(screwed(), water), act.unified(screwed(), heavier)
    assert d.k_z / c.k_z == pytest.approx(1.01, rel=1e-12)


def test_a_revolution_of_the_shaft_is_what_the_datasheet_calls_one():
    """One turn presses out D_p/n_h, or moves the piston by the lead over the gear ratio."""
    turn = 2.0 * math.pi
    pressed = act.unified(hydraulic(), SEA).k_q * turn
    assert pressed == pytest.approx(0.3e-6 / 1.5, rel=1e-14)
    moved = act.unified(screwed(), SEA).k_q * turn / SCREW["piston_area"]
    assert moved == pytest.approx(0.004 / 12.0, rel=1e-14)


def test_the_text_form_of_a_datasheet_gives_the_same():
    """Units at the edge: the same pump, its displacement in cc/rev and its flow in mL/min."""
    drive = PUMP | {"pump_displacement": "0.3 cc/rev", "pump_leakage": "2.4e-7 mL/min/Pa"}
    motor = MOTOR | {"emf_constant": f"{0.051 * math.pi / 30.0} V/rpm"}
    given, expected = act.unified(hydraulic(motor, drive), SEA), act.unified(hydraulic(), SEA)
    for field in ("k_q", "k_z", "k_l", "k_v"):
        assert getattr(given, field) == pytest.approx(getattr(expected, field), rel=1e-12)


# --- eqs (3)-(9) from the block diagrams --------------------------------------------------------


def test_eqs_3_to_8_follow_from_the_circuit_of_figure_4():
    rho, g, z, n_h, D_p, eta, k_pl, theta = sp.symbols(
        "rho g z n_h D_p eta k_pl theta", positive=True
    )
    A1 = sp.Symbol("A1", positive=True)
    A2 = A1 / n_h
    sea_pressure = rho * g * z
    pump_pressure = sea_pressure * A2 / A1  # the amplifier's pistons are in balance
    stroke = D_p * theta / (2 * sp.pi) / A1  # of the amplifier, the oil being incompressible
    volume = stroke * A2  # what the sea sees
    leak = k_pl * pump_pressure
    leak_volume_rate = leak / A1 * A2
    shaft_work = pump_pressure * D_p * theta / (2 * sp.pi) / eta
    numbers = {
        rho: 1027,
        g: 9.81,
        z: 640,
        n_h: 2.5,
        D_p: 3e-7,
        eta: 0.7,
        k_pl: 5e-15,
        theta: 11,
        A1: 4e-3,
    }
    medium = {"rho": 1027.0, "g": 9.81}

    def value(expression):
        return float(expression.subs(numbers))

    Q_l = act.pump_leakage_flow(k_pl=5e-15, z=640.0, n_h=2.5, **medium)
    k_l = act.leakage_coefficient(k_pl=5e-15, n_h=2.5, **medium)
    assert Q_l == pytest.approx(value(leak), rel=1e-12)
    assert act.leakage_volume_rate(Q_l=Q_l, n_h=2.5) == pytest.approx(
        value(leak_volume_rate), rel=1e-12
    )
    assert k_l == pytest.approx(value(sp.diff(leak_volume_rate, z)), rel=1e-12)
    assert act.volume_lost_to_leakage(k_l=k_l, z=640.0) == pytest.approx(
        value(leak_volume_rate), rel=1e-12
    )
    k_z = act.hydraulic_load_coefficient(D_p=3e-7, eta_p=0.7, n_h=2.5, **medium)
    assert k_z == pytest.approx(value(sp.diff(shaft_work, theta, z)), rel=1e-12)
    k_q = act.hydraulic_volume_per_angle(D_p=3e-7, n_h=2.5)
    assert k_q == pytest.approx(value(sp.diff(volume, theta)), rel=1e-12)


def test_the_spindles_constants_follow_from_the_force_on_the_piston():
    rho, g, z, A, alpha, eta, theta = sp.symbols("rho g z A alpha eta theta", positive=True)
    travel = alpha * theta / (2 * sp.pi)
    work = rho * g * z * A * travel / eta
    numbers = {rho: 1027, g: 9.81, A: 6e-3, alpha: 3e-4, eta: 0.6}
    k_z = act.screw_load_coefficient(rho=1027.0, g=9.81, A=6e-3, alpha=3e-4, eta_e=0.6)
    assert k_z == pytest.approx(float(sp.diff(work, theta, z).subs(numbers)), rel=1e-12)
    k_q = act.screw_volume_per_angle(A=6e-3, alpha=3e-4)
    assert k_q == pytest.approx(float(sp.diff(A * travel, theta).subs(numbers)), rel=1e-12)


def test_eq_9_and_the_reduced_constants_follow_from_the_block_diagram():
    """Fig. 8 solved by SymPy gives eq. (9) as printed, and in it T1, K1 A, k_z/k_u and k_l."""
    lam, k_u, k_v, k_q, k_z, k_l, s = sp.symbols("lambda k_u k_v k_q k_z k_l s", positive=True)
    U, Z, omega, V = sp.symbols("U Z omega V")
    solution = sp.solve(
        [lam * s * omega - (k_u * U - k_v * omega - k_z * Z), s * V - (k_q * omega - k_l * Z)],
        [omega, V],
        dict=True,
    )[0][V]
    lag = s * (lam / k_v * s + 1)
    printed = (k_u * k_q / k_v * U - (lam * k_l / k_v * s + k_l + k_q * k_z / k_v) * Z) / lag
    assert sp.simplify(solution - printed) == 0

    for make in (hydraulic, screwed):
        a = act.unified(make(), SEA)
        r = act.reduced(make(), SEA)
        numbers = {lam: a.inertia, k_u: a.k_u, k_v: a.k_v, k_q: a.k_q, k_z: a.k_z, k_l: a.k_l}
        for frequency in (0.3j, 25j, 4000j):
            lag_of = frequency * (r.T1 * frequency + 1.0)
            per_volt = complex(solution.subs(numbers | {U: 1, Z: 0, s: frequency}))
            assert r.gain / lag_of == pytest.approx(per_volt, rel=1e-12)
            per_metre = complex(solution.subs(numbers | {U: 0, Z: 1, s: frequency}))
            ours = -(r.gain * r.load_drive / lag_of + r.k_l / frequency)
            assert ours == pytest.approx(per_metre, rel=1e-12)


# --- directions ---------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [hydraulic, screwed])
def test_the_load_of_back_driving_is_the_lossless_one_times_the_efficiency(make):
    a, r = act.unified(make(), SEA), act.reduced(make(), SEA)
    lossless = SEA.specific_weight * a.k_q / a.k_u
    assert r.load_drive == pytest.approx(lossless / a.efficiency, rel=1e-14)
    assert r.load_back == pytest.approx(lossless * a.efficiency, rel=1e-14)
    literal = act.reduced(make(literal_efficiency=True), SEA)
    assert literal.load_drive == literal.load_back == r.load_drive
    assert literal._replace(load_back=r.load_back) == r


def test_without_a_known_efficiency_both_directions_are_alike():
    given_directly = UnifiedActuator(
        inertia=1e-5, k_u=0.02, k_v=1e-3, k_q=1e-8, k_z=2e-4, k_l=1e-12, friction_torque=1e-3
    )
    r = act.reduced(given_directly, SEA)
    assert r == (
        1e-5 / 1e-3,
        1e-8 * 0.02 / 1e-3,
        2e-4 / 0.02,
        2e-4 / 0.02,
        1e-3 / 0.02,
        1e-12,
        None,
        None,
    )
    assert act.unified(given_directly, SEA) is given_directly
    lossy = act.reduced(given_directly.model_copy(update={"efficiency": 0.5}), SEA)
    assert lossy.load_back == pytest.approx(0.25 * r.load_back, rel=1e-14)


@given(actuators())
def test_unified_and_reduced_agree_for_any_datasheet(actuator):
    a, r = act.unified(actuator, SEA), act.reduced(actuator, SEA)
    assert act.reduced(a, SEA) == r
    assert 0.0 < r.load_back <= r.load_drive
    assert r.T1 * r.gain == pytest.approx(a.inertia * a.k_q * a.k_u / a.k_v**2, rel=1e-12)
    assert r.kappa == pytest.approx(actuator.motor.emf_constant / a.k_q, rel=1e-14)
    # A volt that only meets back electromotive force turns the motor fastest: gain <= 1/kappa.
    assert r.gain * r.kappa <= 1.0 + 1e-12


# --- identified, and what is not known ----------------------------------------------------------


def test_an_identified_actuator_is_reduced_as_it_stands():
    """Numbers of Falcao Carneiro et al. 2023, section 3.1, with A = 75 cm2."""
    paper = IdentifiedActuator(K1=0.444e-3, T1=0.09, piston_area=75e-4, depth_voltage=7.707e-2)
    r = act.reduced(paper, SEA)
    assert r == (0.09, pytest.approx(3.33e-6, rel=1e-12), 7.707e-2, 7.707e-2, 0.0, 0.0, None, None)
    assert act.reduced(paper.model_copy(update={"k_l": 1e-12}), SEA).k_l == 1e-12
    assert act.to_identified(paper, SEA) == paper


@given(actuators(), positive(1e-4, 0.1))
def test_a_datasheet_made_identified_moves_alike_while_driving(actuator, area):
    identified = act.to_identified(actuator, SEA, piston_area=area)
    a, b = act.reduced(actuator, SEA), act.reduced(identified, SEA)
    assert identified.piston_area == area
    assert (b.T1, b.load_drive, b.k_l, b.friction) == (a.T1, a.load_drive, a.k_l, a.friction)
    assert b.gain == pytest.approx(a.gain, rel=1e-14)


def test_a_screw_brings_its_own_piston():
    assert act.to_identified(screwed(), SEA).piston_area == SCREW["piston_area"]
    with pytest.raises(InputError, match=r"piston_area.*not known.*electrohydraulic.*m2"):
        act.to_identified(hydraulic(), SEA)


def test_the_electromechanical_example_gives_what_the_paper_identified():
    """Section 3.1: K1 = 0.444 mm/s/V, T1 = 0.09 s; section 3.2: k_z/k_u = 7.707e-2 V/m."""
    vehicle, paper = load_vehicle("example-em"), load_vehicle("feup-em")
    found = act.to_identified(vehicle.actuator, vehicle.water)
    ratios = (found.K1, found.T1, found.depth_voltage)
    assert ratios == pytest.approx((0.444e-3, 0.09, 7.707e-2), rel=1e-3)
    assert found.piston_area == paper.actuator.piston_area
    rest = {"actuator", "name", "description", "provenance"}
    assert vehicle.model_dump(exclude=rest) == paper.model_dump(exclude=rest)


def test_what_an_experiment_cannot_tell_is_refused_by_name():
    paper = IdentifiedActuator(K1=0.444e-3, T1=0.09, piston_area=75e-4)
    with pytest.raises(InputError, match=r"lambda, k_u, k_v, k_q and k_z .*ratios.*reduced\(\)"):
        act.unified(paper, SEA)
    stepper = Positioner(speed=1e-3, piston_area=1e-3)
    for function in (act.unified, act.reduced, act.to_identified):
        with pytest.raises(InputError, match=r"actuator\.kind.*positioner.*speed and piston area"):
            function(stepper, SEA)
