"""Every actuator as a mission sees it: the paper's model in its limit, orifices, locks."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics import buoyancy_engine as be
from swimbladder.physics import steady_drives as sd
from swimbladder.physics.actuator import reduced, unified
from swimbladder.physics.dynamics import State, motor_rhs, plant
from swimbladder.physics.electric import steady_drive
from swimbladder.physics.steady_drives import OilLine, pump_start
from swimbladder.vehicle import (
    CurvePump,
    DatasheetPump,
    Driver,
    Oil,
    Positioner,
    PowerLawPump,
    PumpAndValve,
    Supply,
    UnifiedActuator,
    Valve,
)

PRESSURES = np.array([0.0, 2e5, 1e6, 5e6, 1e7, 1.9e7])
ATMOSPHERE = 101325.0


def changed(vehicle, **update):
    return vehicle.model_copy(update=update)


def as_built(vehicle, **extra):
    """An electrohydraulic vehicle as pump and valve, its pump from the same datasheets."""
    a = vehicle.actuator
    pump = DatasheetPump(motor=a.motor, drive=a.drive)
    return changed(vehicle, actuator=PumpAndValve(pump=pump, valve=Valve(flow=1e-8), **extra))


# --- the paper's model in its limit ---------------------------------------------------------------
@pytest.mark.parametrize("R_b", [0.0, 0.25])
def test_with_ideal_valves_the_pump_is_the_papers_electrohydraulic_drive(R_b):
    """Rate and power by steady_drive at the voltage that eqs (11) and the battery leave."""
    paper = load_vehicle("example-eh")
    supply = paper.supply.model_copy(update={"internal_resistance": R_b})
    paper = changed(paper, supply=supply)
    found = be.drive_map(as_built(paper), PRESSURES)
    a, water = unified(paper.actuator, paper.water), paper.water
    for p, rate, power in zip(PRESSURES, found.rate_out, found.power_out, strict=True):
        z = p / water.specific_weight

        def excess(u, z=z):
            d = steady_drive(a, water, voltage=u, depth=z)
            return supply.voltage - R_b * d.current - u  # at full duty winding and battery share i

        u = brentq(excess, 1.0, supply.voltage, xtol=1e-14) if R_b else supply.voltage
        d = steady_drive(a, water, voltage=u * (1.0 - 1e-12), depth=z, supply=supply)
        assert rate == pytest.approx(d.volume_rate, rel=1e-9)
        assert power == pytest.approx(d.supply, rel=1e-9)


def test_what_distinguishes_it_is_the_check_valve():
    paper = load_vehicle("example-eh")
    built, theirs = (be.drive_map(v, PRESSURES) for v in (as_built(paper), paper))
    assert built.rate_out == pytest.approx(theirs.rate_out, rel=1e-12)
    assert np.all(built.leakage == 0.0)
    assert np.all(built.holding_power == 0.0)
    a = unified(paper.actuator, paper.water)
    assert theirs.leakage == pytest.approx(a.k_l * PRESSURES / paper.water.specific_weight)
    assert theirs.holding_power[-1] > 1.0


def test_rates_at_full_voltage_are_where_the_papers_motor_comes_to_rest():
    """Eq. (11): dq/dt = 0 at the map's rate, outwards and inwards, without a battery's sag."""
    vehicle = load_vehicle("feup-em")
    p, E = plant(vehicle), vehicle.supply.voltage
    pressures = np.array([0.0, 1e5, 9e5])
    found = be.drive_map(vehicle, pressures, power=False)
    assert np.all(np.isnan(found.power_out))
    for i, z in enumerate(pressures / vehicle.water.specific_weight):
        for u, q in ((E, found.rate_out[i]), (-E, -found.rate_in[i])):
            assert motor_rhs(State(q=q, z=z), u, p).q == pytest.approx(0.0, abs=1e-12)


# --- valve, check valve, reservoir ----------------------------------------------------------------
def test_the_valve_is_an_orifice():
    """Flow as the root of the pressure difference, with the reservoir's gas on the other side."""
    vehicle = load_vehicle("example-float")
    a = vehicle.actuator
    found = be.drive_map(vehicle, PRESSURES)
    head = PRESSURES + ATMOSPHERE - a.internal_pressure
    assert found.rate_in == pytest.approx(a.valve.flow * head**0.5, rel=1e-14)
    assert found.bypass_in == pytest.approx(a.bypass.flow * head**0.5, rel=1e-14)
    # C_d A (2/rho)^0.5 of the preset's orifices of 0.6 and 3 mm.
    for valve, d in ((a.valve, 0.6e-3), (a.bypass, 3e-3)):
        expected = 0.62 * math.pi / 4.0 * d**2 * math.sqrt(2.0 / 870.0)
        assert valve.flow == pytest.approx(expected, rel=0.01)
    assert found.leakage == pytest.approx(a.leakage * head)


def test_a_valve_with_thick_oil_is_an_orifice_behind_a_narrow_way():
    """dp = (Q/flow)^2 + 2 laminar_pressure^0.5 Q/flow; a line of dp far below that pressure."""
    valve = Valve(flow=1e-8, laminar_pressure=4e5)
    head = np.geomspace(1.0, 4e7, 9)
    rate = sd.valve_flow(valve, head)
    x = rate / valve.flow
    np.testing.assert_allclose(x**2 + 2.0 * np.sqrt(4e5) * x, head, rtol=1e-7)
    assert rate[0] == pytest.approx(1e-8 * head[0] / (2.0 * np.sqrt(4e5)), rel=1e-5)
    wide = Valve(flow=1e-8)
    assert rate[-1] == pytest.approx(float(sd.valve_flow(wide, head)[-1]), rel=0.1)
    assert float(sd.valve_flow(valve, np.array([-1.0]))[0]) == 0.0


def test_oil_does_not_come_back_against_the_pressure_inside():
    vehicle = load_vehicle("example-float")
    a = vehicle.actuator.model_copy(update={"internal_pressure": 1.2e5})
    found = be.drive_map(changed(vehicle, actuator=a), [0.0, 1e4, 1e5])
    assert found.rate_in[0] == found.rate_in[1] == 0.0
    assert found.rate_in[2] > 0.0


# --- pumps ----------------------------------------------------------------------------------------
def pump_vehicle(pump, **extra):
    vehicle = load_vehicle("example-float")
    supply = vehicle.supply.model_copy(update={"internal_resistance": 0.0})
    a = PumpAndValve(pump=pump, valve=Valve(flow=1e-8), **extra)
    return changed(vehicle, actuator=a, supply=supply)


def test_a_power_law_is_what_it_says():
    pump = PowerLawPump(
        delivery=1e-6,
        slip=2e-14,
        idle_power=7.0,
        power_per_pressure=8e-7,
        power_per_temperature=-0.1,
        stall_pressure=1.5e7,
    )
    found = be.drive_map(pump_vehicle(pump), PRESSURES, temperature=np.full(6, 5.0))
    assert found.rate_out == pytest.approx([1e-6, 0.996e-6, 0.98e-6, 0.9e-6, 0.8e-6, 0.0])
    assert found.power_out == pytest.approx([8.0, 8.16, 8.8, 12.0, 16.0, 20.0])


LINEAR = {"pressure": [1e6, 5e6, 2e7], "delivery": [1e-6, 8e-7, 5e-8], "power": [8.0, 12.0, 27.0]}


def test_a_curve_goes_through_its_points_and_a_straight_one_is_straight_between():
    vehicle = pump_vehicle(CurvePump(**LINEAR))
    p = np.array([0.0, 1e6, 3e6, 5e6, 8e6, 2e7, 2.001e7])
    run = sd.pump_run(vehicle, vehicle.actuator.pump, p)
    rate = [1e-6, 1e-6, 9e-7, 8e-7, 6.5e-7, 5e-8, 0.0]
    assert run.rate == pytest.approx(rate, rel=1e-12)
    assert run.power == pytest.approx([8.0, 8.0, 10.0, 12.0, 15.0, 27.0, 27.0], rel=1e-12)


def test_a_curve_does_not_overshoot_its_points():
    """A step between level stretches: what lies between two points lies between their values."""
    step = CurvePump(
        pressure=[0.0, 1e6, 2e6, 3e6], delivery=[2e-6, 2e-6, 1e-6, 1e-6], power=[5.0, 5.0, 9.0, 9.0]
    )
    run = sd.pump_run(pump_vehicle(step), step, np.linspace(0.0, 3e6, 301))
    assert run.rate.max() == 2e-6
    assert run.rate.min() == 1e-6
    assert np.all(np.diff(run.rate) <= 1e-20)
    assert np.all(np.diff(run.power) >= -1e-12)


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"pressure": ["10 bar", "50 bar"]}, "delivery", "not as many as pressures"),
        ({"power": [8.0, 12.0]}, "power", "not as many as pressures"),
        ({"pressure": [1e6, 2e7, 5e6]}, "pressure", "do not rise"),
        ({"pressure": [1e6, 1e6, 5e6]}, "pressure", "do not rise"),
        ({"delivery": [1e-6, 1.1e-6, 5e-8]}, "delivery", "no more against more"),
        ({"delivery": [0.0, 0.0, 0.0]}, "delivery", "delivers something"),
        ({"delivery": ["1 mL/s", "1 s", 0.0]}, "delivery[1]", "another kind"),
        ({"pressure": [1e6]}, "pressure", ""),
        ({"power": [8.0, -1.0, 2.0]}, "power[1]", "greater than or equal to 0"),
    ],
)
def test_a_curve_that_is_none_is_refused(change, field, words):
    with pytest.raises(InputError) as caught:
        CurvePump(**(LINEAR | change))
    assert caught.value.field == field
    assert words in str(caught.value)


def test_efficiencies_over_pressure_are_wilsons():
    """Volumetric 1 - k p 2 pi/(D omega); mechanical D p/2 pi over the torque at the shaft."""
    vehicle = load_vehicle("example-float")
    pump = vehicle.actuator.pump
    p = np.array([1e6, 5e6, 2e7])
    run = sd.pump_run(vehicle.model_copy(update={"driver": None}), pump, p)
    m, d = pump.motor, pump.drive
    swept = d.pump_displacement / (2.0 * math.pi)
    omega = (run.rate + d.pump_leakage * p) / swept
    torque = (
        swept * p / d.pump_efficiency
        + (m.viscous_friction + d.viscous_friction) * omega
        + m.friction_torque
    )
    current = torque / m.torque_constant
    volts = m.resistance * current + m.k_emf * omega
    assert volts * current == pytest.approx(run.power, rel=1e-12)
    # No more than the cells less what the battery's resistance takes of the same current.
    sag = vehicle.supply.internal_resistance
    assert volts == pytest.approx(vehicle.supply.voltage - sag * current, rel=1e-12)
    total = p * run.rate / run.power
    mechanical, volumetric = swept * p / torque, run.rate / (swept * omega)
    electrical = torque * omega / run.power
    assert total == pytest.approx(mechanical * volumetric * electrical, rel=1e-12)
    assert np.all(np.diff(mechanical) > 0.0)  # the frictions weigh less under pressure
    assert np.all(np.diff(volumetric) < 0.0)


def test_a_driver_holds_the_speed_as_long_as_the_voltage_allows():
    vehicle = load_vehicle("example-float")
    a = vehicle.actuator
    held = a.pump.model_copy(update={"speed": 300.0})
    slow = changed(vehicle, actuator=a.model_copy(update={"pump": held}))
    found, full = be.drive_map(slow, PRESSURES), be.drive_map(vehicle, PRESSURES)
    d = a.pump.drive
    head = PRESSURES + ATMOSPHERE - a.internal_pressure
    wanted = d.pump_displacement / (2.0 * math.pi) * 300.0 - d.pump_leakage * head
    assert found.rate_out == pytest.approx(wanted, rel=1e-12)
    assert np.all(found.power_out < full.power_out)
    fast = a.pump.model_copy(update={"speed": 1e4})
    fast = changed(vehicle, actuator=a.model_copy(update={"pump": fast}))
    assert be.drive_map(fast, PRESSURES).rate_out == pytest.approx(full.rate_out, rel=1e-12)


def test_beyond_stall_nothing_comes_out_and_nothing_back():
    vehicle = load_vehicle("example-float")
    found = be.drive_map(vehicle, [1e8, 5e8])
    assert np.all(found.rate_out == 0.0)
    assert np.all(found.power_out > 0.0)


def test_driver_and_battery_take_their_share():
    """P/eta at the terminals, and the cells give E i with P = (E - R_b i) i."""
    pump = PowerLawPump(delivery=1e-6, idle_power=10.0, power_per_pressure=0.0)
    measured = pump_vehicle(pump)
    supply = measured.supply.model_copy(update={"internal_resistance": 0.5})
    lossy = changed(measured, driver=Driver(efficiency=0.5), supply=supply)
    drawn = be.drive_map(lossy, [0.0]).power_out[0]  # a measured power has its driver in it
    i = drawn / supply.voltage
    assert (supply.voltage - 0.5 * i) * i == pytest.approx(10.0, rel=1e-12)
    paper = load_vehicle("example-eh")
    ideal, half = (
        be.drive_map(
            changed(
                paper, driver=d, supply=paper.supply.model_copy(update={"internal_resistance": 0.0})
            ),
            PRESSURES,
        )
        for d in (None, Driver(efficiency=0.5))
    )
    assert half.power_out == pytest.approx(2.0 * ideal.power_out, rel=1e-12)
    assert ideal.power_in[-1] < 0.0  # the sea drives the motor and charges the battery
    assert half.power_in[-1] == 0.0


def test_a_battery_that_cannot_feed_the_pump_is_said():
    pump = PowerLawPump(delivery=1e-6, idle_power=10.0, power_per_pressure=0.0)
    vehicle = pump_vehicle(pump)
    weak = vehicle.supply.model_copy(update={"internal_resistance": 20.0})
    with pytest.raises(NoAnswerError, match=r"10 W.*2\.59 W.*internal_resistance"):
        be.drive_map(changed(vehicle, supply=weak), [0.0])


def test_a_start_falls_short_by_what_its_line_takes():
    pump = PowerLawPump(delivery=1e-6, idle_power=7.0, power_per_pressure=1e-6)
    line = Oil(volume=2e-5, trapped_air=0.1)
    found = be.drive_map(pump_vehicle(pump, line=line, start_volume=1e-6), PRESSURES)
    assert found.start_volume[0] == pytest.approx(1e-6)
    # At 19 MPa the air is as good as gone, the oil 1.3 % smaller.
    assert found.start_volume[-1] == pytest.approx(1e-6 + 2e-6 + 1.8e-5 * 1.9e7 / 1.5e9, rel=0.05)
    # while it fills, the pump takes what the line's pressure does, not what the sea's would
    full = (found.start_volume[-1] - 1e-6) / found.rate_out[-1] * found.power_out[-1]
    start = pump_start(
        OilLine(line),
        lambda dp: 1e-6 + 0.0 * dp,
        PRESSURES[-1:] + ATMOSPHERE,
        power=lambda dp: 7.0 + 1e-6 * dp,
    )
    assert found.start_saving[-1] == pytest.approx(full - start.energy[0], rel=1e-9)
    assert 0.4 * full < found.start_saving[-1] < full
    assert np.all(be.drive_map(pump_vehicle(pump, start_volume=1e-6), PRESSURES).start_saving == 0)
    assert sd.delivered(1e-6, 10.0, 4e-6) == pytest.approx(6e-6)
    assert sd.delivered(1e-6, 2.0, 4e-6) == 0.0


# --- screws ---------------------------------------------------------------------------------------
def screw(back, friction=0.0):
    vehicle = load_vehicle("example-em")
    a = vehicle.actuator
    drive = a.drive.model_copy(update={"back_efficiency": back})
    motor = a.motor.model_copy(update={"friction_torque": friction})
    return changed(vehicle, actuator=a.model_copy(update={"drive": drive, "motor": motor}))


def test_a_screw_that_turns_back_is_held_at_the_cost_of_its_copper():
    """V = c z: the sea's torque eta_b rho g z k_q by current k_T, R i^2 all the while."""
    vehicle = screw(0.3)
    a, p = unified(vehicle.actuator, vehicle.water), np.array([1e5, 5e5])
    found = be.drive_map(vehicle, p)
    current = 0.3 * p * a.k_q / vehicle.actuator.motor.torque_constant
    assert found.holding_power == pytest.approx(a.resistance * current**2, rel=1e-12)


@pytest.mark.parametrize(("back", "friction"), [(0.0, 0.0), (-0.4, 0.0), (0.05, 0.01)])
def test_a_screw_that_locks_costs_nothing_to_hold(back, friction):
    vehicle = screw(back, friction)
    found = be.drive_map(vehicle, [1e5, 5e5])
    assert np.all(found.holding_power == 0.0)
    free = be.drive_map(screw(0.3, friction), [1e5, 5e5])
    assert np.all(found.rate_in < free.rate_in)  # the sea helps it in less, or not at all


def test_a_screw_locks_by_its_angles():
    """tan(lead - friction)/tan(lead) of a real screw is about 2 - 1/eta: the sea must be helped."""
    lead, phi = math.radians(4.0), math.radians(6.0)
    eta = math.tan(lead) / math.tan(lead + phi)
    back = math.tan(lead - phi) / math.tan(lead)
    assert back == pytest.approx(2.0 - 1.0 / eta, abs=0.03)
    vehicle = screw(back)
    x = reduced(vehicle.actuator, vehicle.water)
    assert x.load_back < 0.0
    p = plant(vehicle)
    pushed = motor_rhs(State(z=50.0), 0.5 * 50.0 * x.load_back, p)  # half of what it takes
    assert pushed.q == 0.0
    assert motor_rhs(State(z=50.0), 1.5 * 50.0 * x.load_back, p).q < 0.0


def test_a_back_efficiency_needs_an_efficiency():
    with pytest.raises(InputError, match="back_efficiency"):
        UnifiedActuator(inertia=1e-5, k_u=0.02, k_v=6e-4, k_q=1e-7, k_z=1e-3, back_efficiency=0.1)


def test_a_dead_zone_is_dry_friction_in_volts():
    vehicle = load_vehicle("feup-em")
    a = vehicle.actuator.model_copy(update={"dead_zone": 0.7})
    sticky = changed(vehicle, actuator=a)
    p = plant(sticky)
    assert p.friction == 0.7
    assert motor_rhs(State(), 0.69, p).q == 0.0
    assert motor_rhs(State(), 0.71, p).q > 0.0
    rates = [be.drive_map(v, [0.0], power=False).rate_out[0] for v in (vehicle, sticky)]
    assert rates[1] / rates[0] == pytest.approx((12.0 - 0.7) / 12.0)


# --- what is not known ----------------------------------------------------------------------------
def test_the_fields_that_lack_are_named():
    with pytest.raises(NoAnswerError, match=r"actuator\.motor\.resistance.*torque_constant"):
        be.drive_map(load_vehicle("feup-em"), [0.0])
    with pytest.raises(NoAnswerError, match=r"actuator\.moving_power"):
        be.drive_map(load_vehicle("ntnu-bv"), [0.0])
    unknown = unified(load_vehicle("example-em").actuator, load_vehicle("example-em").water)
    unknown = changed(
        load_vehicle("example-em"), actuator=unknown.model_copy(update={"resistance": None})
    )
    with pytest.raises(NoAnswerError, match=r"give actuator\.resistance from"):
        be.drive_map(unknown, [0.0])
    assert np.isfinite(be.drive_map(unknown, [0.0], power=False).rate_out[0])


def test_a_positioner_draws_what_it_is_said_to():
    vehicle = load_vehicle("ntnu-bv")
    a = vehicle.actuator
    known = Positioner(
        speed=a.speed, piston_area=a.piston_area, moving_power=3.0, holding_power=0.5
    )
    found = be.drive_map(changed(vehicle, actuator=known), [0.0, 1e5])
    assert found.rate_out == pytest.approx(2 * [a.speed * a.piston_area])
    assert list(found.power_in) == [3.0, 3.0]
    assert list(found.holding_power) == [0.5, 0.5]
    assert math.isnan(be.drive_map(vehicle, [0.0], power=False).power_out[0])


def test_driver_and_battery_of_a_positioner_take_their_share():
    """E i = P + R_b i^2 by Kirchhoff, P being the motor's power over the driver's efficiency."""
    vehicle = load_vehicle("ntnu-bv")
    known = vehicle.actuator.model_copy(update={"moving_power": 3.0, "holding_power": 0.5})
    supply = Supply(voltage=12.0, internal_resistance=2.0)
    fed = changed(vehicle, actuator=known, driver=Driver(efficiency=0.8), supply=supply)
    found = be.drive_map(fed, [0.0, 1e5])
    for cells, motor in ((found.power_out, 3.0), (found.power_in, 3.0), (found.holding_power, 0.5)):
        current = brentq(lambda i, P=motor / 0.8: 12.0 * i - 2.0 * i**2 - P, 0.0, 3.0, xtol=1e-15)
        assert cells == pytest.approx(2 * [12.0 * current], rel=1e-12)
    weak = changed(fed, supply=supply.model_copy(update={"internal_resistance": 12.0}))
    with pytest.raises(NoAnswerError, match=r"the positioner's motor draws up to 3\.75 W, .* 3 W"):
        be.drive_map(weak, [0.0])


def test_oil_that_compresses_nothing_is_said():
    paper, built = load_vehicle("example-eh"), load_vehicle("example-float")
    assert paper.actuator.drive.oil is not None
    assert "the oil in actuator.drive.oil, its bulk modulus" in be.oil_note(paper)
    assert "as kind pump-valve and give actuator.line" in be.oil_note(paper)
    line = Oil(volume=1e-4, trapped_air=0.01)
    no_line = changed(built, actuator=built.actuator.model_copy(update={"line": None}))
    with_line = changed(built, actuator=built.actuator.model_copy(update={"line": line}))
    assert "to them, give actuator.line" in be.oil_note(no_line)
    assert be.oil_note(with_line) is None
    assert be.oil_note(load_vehicle("example-em")) is None
    own = built.actuator.pump
    law = PowerLawPump(delivery=1e-6, idle_power=7.0, power_per_pressure=1e-6)
    for pump in (changed(own, drive=changed(own.drive, oil=None)), law):
        assert be.oil_note(pump_vehicle(pump)) is None
    # what the note says: no rate, power or start of the map depends on the oil of the pump
    drive = built.actuator.pump.drive
    foam = Oil(volume=1e-3, bulk_modulus=1e8, trapped_air=0.3)
    pump = built.actuator.pump.model_copy(update={"drive": drive.model_copy(update={"oil": foam})})
    other = changed(built, actuator=built.actuator.model_copy(update={"pump": pump}))
    for a, b in zip(be.drive_map(built, PRESSURES), be.drive_map(other, PRESSURES), strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.all(be.drive_map(with_line, PRESSURES[1:]).start_volume > 4.5e-6)


def test_voltages_and_positions_have_no_pump_and_valve():
    vehicle = load_vehicle("example-float")
    for use in (plant, lambda v: reduced(v.actuator, v.water)):
        with pytest.raises(InputError, match="mission"):
            use(vehicle)
