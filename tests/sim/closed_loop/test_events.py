"""End stops, surface, bottom, friction, supply, arrival: each against the oracle or by hand."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.sim.closed_loop import Event, Solution, StopReason, drive, simulate
from swimbladder.vehicle import Drag, Hull, IdentifiedActuator
from tests.oracle import Run, closed_loop
from tests.vehicles import BLENDED, LINEAR, QUADRATIC, SWITCHED, paper, pump, screw, stepper

TICK = 0.25
STEP = TICK / 2**20  # s, the accuracy to which events are located


def both(
    vehicle: Any, commands: list[tuple[float, float]], duration: float, **start: Any
) -> tuple[Solution, Run]:
    """The engine and the oracle under commands (from time, value); start: depth, volume, ..."""

    def command(t: float) -> float:
        return [u for at, u in commands if at <= t + 1e-9][-1]

    renamed = {"bottom": "bottom_depth"}
    ours = simulate(
        vehicle,
        law=lambda seen, _: command(seen.time),
        sample_time=TICK,
        duration=duration,
        setpoints=[(0.0, start["depth"])],
        checked=False,
        **{renamed.get(k, f"start_{k}"): v for k, v in start.items()},
    )
    theirs = closed_loop(
        vehicle,
        lambda t, *_: command(t),
        setpoints=[(0.0, 0.0)],
        duration=duration,
        tick=TICK,
        **start,
    )
    return ours, theirs


def times(solution: Solution, kind: str) -> list[float]:
    return [e.time for e in solution.events if e.kind == kind]


def agree(ours: Solution, theirs: Run, *, drag: float = 0.0) -> None:
    """Same events to twice their stated accuracy, same states as well as that allows.

    A motor that starts or stops up to a tick late leaves its rate times the tick in V, which the
    vehicle integrates twice. drag: what the steps of a nonlinear drag may add [m].
    """
    assert ours.finished
    inner = {"stands still", "drives", "driven back", "pump turns", "pump stops"}
    inner |= {"supply", "arrived", "drag law"}
    expected = [(t, kind) for t, kind in theirs.events if kind not in inner]
    assert [e.kind for e in ours.events] == [kind for _, kind in expected]
    for mine, (t, _) in zip(ours.events, expected, strict=True):
        assert mine.time == pytest.approx(t, abs=2 * len(theirs.events) * STEP)
    late = len(theirs.events) * STEP
    V = late * np.abs(ours.motor_rate).max() + 1e-14
    z = late * np.abs(ours.speed).max() + drag + 1e-11
    z += 9806.65 / ours.vehicle.mass * V * ours.time[-1] ** 2
    np.testing.assert_allclose(ours.volume, theirs.volume, rtol=0.0, atol=V)
    np.testing.assert_allclose(ours.depth, theirs.depth, rtol=0.0, atol=z)


class TestEndStops:
    """The piston at the end of its travel."""

    def test_upper_and_back(self) -> None:
        ours, theirs = both(paper(), [(0.0, 12.0), (12.0, -6.0)], 20.0, depth=40.0, volume=300e-6)
        agree(ours, theirs)
        (reached,), (left,) = (
            times(ours, f"{verb} the upper end stop") for verb in ("reached", "left")
        )
        assert left == 12.0
        there = (ours.time > reached) & (ours.time <= left)
        assert np.all(ours.motor_rate[there] == 0.0)
        assert np.all(ours.volume[there] == 350e-6)
        assert np.all(ours.volume <= 350e-6)

    def test_lower_and_back(self) -> None:
        ours, theirs = both(paper(), [(0.0, -12.0), (12.0, 9.0)], 20.0, depth=40.0, volume=-300e-6)
        agree(ours, theirs)
        assert len(times(ours, "reached the lower end stop")) == 1
        assert np.all(ours.volume >= -350e-6)

    def test_the_load_pushes_the_piston_off_the_upper_stop(self) -> None:
        """With 1 V at 59 m the water wins (4.5 V): no friction holds the piston."""
        ours, theirs = both(paper(), [(0.0, 12.0), (5.0, 1.0)], 9.0, depth=60.0, volume=340e-6)
        agree(ours, theirs)
        assert times(ours, "left the upper end stop") == [5.0]
        assert ours.motor_rate[-1] < 0.0

    def test_leaking_pump_holds_the_upper_stop(self) -> None:
        """At the stop the pump delivers what leaks, k_l z, until the voltage no longer does."""
        vehicle = pump(leak=2e-12)
        start = dict(depth=30.0, volume=195e-6)
        ours, theirs = both(vehicle, [(0.0, 24.0), (6.0, 14.0), (10.0, 0.2)], 16.0, **start)
        agree(ours, theirs)
        reached = times(ours, "reached the upper end stop")[0]
        there = (ours.time > reached) & (ours.time <= 10.0)
        k_l = 2e-12 * 9806.65
        np.testing.assert_allclose(ours.motor_rate[there], k_l * ours.depth[there], rtol=1e-9)
        assert times(ours, "left the upper end stop") == [10.0]

    def test_a_stop_pushes_and_never_pulls(self) -> None:
        """A leaking pump leaves the stop where it would leave a very stiff spring.

        Its rate is k_l z there. Sinking, the leakage grows by k_l w, and the motor has to speed up
        to keep the volume: the stop is left before the motor's steady rate is down to k_l z.
        """
        K, T1, k_l, load, stop = 5e-6, 0.4, 1e-7, 0.2, 350e-6
        vehicle = paper(
            actuator=IdentifiedActuator(
                K1=K / 5e-3, T1=T1, piston_area=5e-3, k_l=k_l, depth_voltage=load
            ),
            trim_error=stop - 4.04e-6 * 10.0,
        )
        commands = [(0.0, 12.0), (0.5, 2.23)]
        start = dict(depth=10.0, volume=stop, speed=0.1)
        ours, theirs = both(vehicle, commands, 3.0, **start)
        agree(ours, theirs)
        left = times(ours, "left the upper end stop")[0]
        assert 0.6 < left < 2.0

        def rates(_t: float, x: np.ndarray, volts: float) -> list[float]:
            q, over, z, w = x  # volumes in cm3, over: beyond the stop
            rate = q - 1e6 * k_l * z
            push = max(1e9 * over + 1e5 * rate, 0.0) if over > 0.0 else 0.0
            sink = 7935.54 * (4.04e-6 * (z - 10.0) - 1e-6 * over) - w
            return [(1e6 * K * (volts - load * z) - q - push) / T1, rate, w, sink / 36.3]

        x = np.array([1e6 * k_l * 10.0, 0.0, 10.0, 0.1])
        for (t, volts), end in zip(commands, (0.5, 3.0), strict=True):
            spring = solve_ivp(
                rates,
                (t, end),
                x,
                args=(volts,),
                method="Radau",
                rtol=1e-9,
                atol=1e-12,
                dense_output=True,
            )
            x = spring.y[:, -1]
        after = ours.time > left
        np.testing.assert_allclose(
            1e6 * (ours.volume[after] - stop), spring.sol(ours.time[after])[1], rtol=1e-3, atol=1e-6
        )

    def test_a_vehicle_that_rises_rests_at_the_stop_as_the_leakage_slackens(self) -> None:
        """From a counter-example: between k_l (z + T1 w) and k_l z it left and met it each tick."""
        K, T1, k_l = 5e-6, 0.4, 1e-7
        vehicle = paper(actuator=IdentifiedActuator(K1=K / 5e-3, T1=T1, piston_area=5e-3, k_l=k_l))
        volts = k_l * (10.0 - 0.5 * T1 * 0.2) / K
        ours, theirs = both(vehicle, [(0.0, volts)], 5.0, depth=10.0, volume=350e-6, speed=-0.2)
        agree(ours, theirs)
        assert times(ours, "left the upper end stop") == []

    def test_leaking_pump_must_overtake_the_leakage_to_leave_the_lower_stop(self) -> None:
        vehicle = pump(leak=2e-11)
        start = dict(depth=30.0, volume=-195e-6)
        ours, theirs = both(vehicle, [(0.0, 0.0), (10.0, 12.0), (18.0, 1.0)], 30.0, **start)
        agree(ours, theirs)
        left = times(ours, "left the lower end stop")[0]
        # the pump spins up from rest with T1, the leak k_l z waits
        motor_start = theirs.times("pump turns")[0]
        assert motor_start == 10.0
        assert 10.0 + 100 * STEP < left < 10.0 + 0.25
        assert ours.volume[-1] == pytest.approx(-200e-6, abs=1e-11)  # leaked back to the stop

    def test_a_pump_too_slow_for_the_leakage_stays_at_the_lower_stop(self) -> None:
        vehicle = pump(leak=2e-10)
        ours, theirs = both(vehicle, [(0.0, 12.0)], 10.0, depth=60.0, volume=-200e-6)
        agree(ours, theirs)
        assert np.all(ours.volume == ours.volume[1])
        assert 0.0 < ours.motor_rate[-1] < 2e-10 * 9806.65 * ours.depth[-1]

    def test_a_pump_that_still_turns_when_the_leakage_wins(self) -> None:
        """Slower than the leak, but turning: reaching the lower stop does not stop the pump."""
        vehicle = pump(leak=5e-11, friction=0.0)
        ours, theirs = both(vehicle, [(0.0, 9.0), (4.0, 14.0)], 8.0, depth=60.0, volume=-199e-6)
        agree(ours, theirs)
        reached = times(ours, "reached the lower end stop")[0]
        at = int(np.searchsorted(ours.time, reached))
        assert ours.motor_rate[at] > 0.0

    def test_volume_that_turns_inside_a_step_near_the_stop(self) -> None:
        """Past the stop and back within one sample: a blow, not a dip that goes unseen."""
        vehicle = paper(actuator=IdentifiedActuator(K1=1e-3, T1=0.5, piston_area=75e-4))
        commands = [(0.0, 12.0), (1.0, -12.0)]
        free = closed_loop(
            vehicle,
            lambda t, *_: 12.0 if t < 1.0 else -12.0,
            setpoints=[(0.0, 0.0)],
            duration=2.0,
            tick=TICK,
            depth=20.0,
            volume=0.0,
        )
        peak = free.volume.max()  # at a sample; between samples it is higher
        ours, theirs = both(vehicle, commands, 2.0, depth=20.0, volume=350e-6 - peak - 2e-8)
        assert len(theirs.times("reached the upper end stop")) == 1
        assert theirs.volume.max() < 350e-6 - 1e-9  # no sample sees it
        agree(ours, theirs)

    def test_resting_at_a_stop_costs_no_search_and_moves_nothing(self) -> None:
        """At the upper stop, a nanometre above the water: rounding must not hide the push."""
        vehicle = paper(
            actuator=IdentifiedActuator(K1=1e-4, T1=0.4, piston_area=5e-3, depth_voltage=0.5)
        )
        ours = simulate(
            vehicle,
            law=lambda *_: 0.0,
            sample_time=0.1,
            setpoints=[(0.0, 0.0)],
            duration=5.0,
            start_depth=0.0,
            start_volume=350e-6,
        )
        assert ours.finished
        assert np.all(ours.volume == 350e-6)


class TestBottomAndSurface:
    """The vehicle against the ground and the air."""

    def test_landing_and_release(self) -> None:
        vehicle = paper()
        ours, theirs = both(vehicle, [(0.0, -12.0), (20.0, 12.0)], 60.0, depth=3.0, bottom=5.0)
        agree(ours, theirs)
        landed, off = (times(ours, f"{verb} the bottom")[0] for verb in ("reached", "left"))
        ground = (ours.time > landed) & (ours.time < off)
        assert np.all(ours.speed[ground] == 0.0)
        assert np.all(ours.depth[ground] == 5.0)
        assert ours.depth.max() == 5.0
        # it leaves when it is neutral there: V = psi z
        k = int(np.searchsorted(ours.time, off))
        V = np.interp(off, ours.time[k - 1 : k + 1], ours.volume[k - 1 : k + 1])
        assert abs(V - 4.04e-6 * 5.0) < 1e-10

    def test_landing_light_is_a_bounce_without_rest(self) -> None:
        """Sinking on momentum alone, the vehicle touches and is off again at once."""
        ours, theirs = both(
            paper(), [(0.0, 0.0)], 12.0, depth=4.9, volume=40e-6, speed=0.1, bottom=5.0
        )
        agree(ours, theirs)
        assert [e.kind for e in ours.events] == ["reached the bottom", "left the bottom"]
        assert ours.events[0].time == ours.events[1].time
        assert ours.speed[-1] < 0.0

    def test_starting_on_the_bottom_with_speed_is_a_blow(self) -> None:
        ours = simulate(
            paper(),
            law=lambda *_: -1.0,
            sample_time=TICK,
            setpoints=[(0.0, 5.0)],
            duration=2.0,
            start_depth=5.0,
            start_volume=-50e-6,
            start_speed=0.2,
            bottom_depth=5.0,
        )
        assert ours.events[0] == Event(0.0, "reached the bottom")
        np.testing.assert_array_equal(ours.speed[1:], 0.0)
        np.testing.assert_array_equal(ours.depth, 5.0)
        assert ours.balance.energy["bottom"] == pytest.approx(
            0.5 * paper().mass * 0.2**2, rel=1e-12
        )

    def test_aground_with_the_hull_out_of_the_water(self) -> None:
        """In 0.2 m of water the top 0.1 m of the hull is dry: its weight holds the vehicle down.

        psi z + V_0 alone would let it rise at V = 0 and fall back at once.
        """
        vehicle = screw(efficiency=1.0)
        A_w = 0.02
        lift = -1e-6 * 0.2 + A_w * 0.1  # m3 of displacement to float: more than the stroke has
        assert lift > 200e-6
        ours, theirs = both(vehicle, [(0.0, 12.0)], 30.0, depth=0.2, volume=0.0, bottom=0.2)
        agree(ours, theirs)
        assert [e.kind for e in ours.events] == ["reached the upper end stop"]
        shallow = dict(depth=0.295, volume=0.0, bottom=0.295)
        ours, theirs = both(vehicle, [(0.0, 12.0)], 25.0, **shallow)  # 100 cm3 lift it here
        agree(ours, theirs)
        assert ours.events[0].kind == "left the bottom"

    @pytest.mark.parametrize("tick", [0.3, 0.5, 5.0])
    def test_bobbing_has_the_frequency_and_the_damping_of_an_oscillator(self, tick: float) -> None:
        vehicle = paper()
        m, rho_g, psi = vehicle.mass, 9806.65, 4.04e-6
        stiffness = (rho_g * math.pi / 100 - rho_g * psi) / m
        decay = 0.5 / 36.3
        omega = math.sqrt(stiffness - decay**2)
        V = 300e-6
        rest = -rho_g * V / m / stiffness  # the hull floats this deep, 9.6 mm out
        z0 = rest + 0.004
        time = np.arange(0.0, 60.0, tick)
        ours = drive(vehicle, time=time, volume=np.full(time.shape, V), start_depth=z0)
        c, s = np.cos(omega * time), np.sin(omega * time)
        expected = rest + 0.004 * np.exp(-decay * time) * (c + decay / omega * s)
        assert ours.depth.max() < 0.0
        np.testing.assert_allclose(ours.depth, expected, rtol=0.0, atol=1e-14)
        assert ours.events == ()
        assert ours.balance.relative_energy_residue < 1e-3

    def test_bobbing_in_and_out_of_the_water_line(self) -> None:
        ours, theirs = both(paper(), [(0.0, 0.0)], 60.0, depth=0.3, volume=150e-6)
        agree(ours, theirs)
        assert len(times(ours, "began to emerge")) >= 5

    @pytest.mark.parametrize("drag", [SWITCHED, QUADRATIC], ids=lambda d: d.law)
    def test_bobbing_under_nonlinear_drag(self, drag: Drag) -> None:
        """The hull's stiffness, not only the drag, decides how long a step may be."""
        vehicle = screw(efficiency=1.0, drag=drag)
        run: dict[str, Any] = dict(setpoints=[(0.0, 0.8)], duration=40.0)
        ours = simulate(
            vehicle, law=lambda *_: 0.0, sample_time=1.0, start_depth=0.8, start_volume=5e-5, **run
        )
        theirs = closed_loop(vehicle, lambda *_: 0.0, tick=1.0, depth=0.8, volume=5e-5, **run)
        assert len(times(ours, "began to emerge")) >= 4
        np.testing.assert_allclose(ours.depth, theirs.depth, rtol=0.0, atol=4e-6)

    def test_bobbing_faster_than_the_sample(self) -> None:
        """A sample of 6 s, a period of 2.4 s: no emergence goes unseen."""
        vehicle = paper()
        ours = simulate(
            vehicle,
            law=lambda *_: 0.0,
            sample_time=6.0,
            setpoints=[(0.0, 0.0)],
            duration=60.0,
            start_depth=0.3,
            start_volume=150e-6,
        )
        theirs = closed_loop(
            vehicle,
            lambda *_: 0.0,
            setpoints=[(0.0, 0.0)],
            duration=60.0,
            tick=6.0,
            depth=0.3,
            volume=150e-6,
        )
        np.testing.assert_allclose(ours.depth, theirs.depth, rtol=0.0, atol=1e-5)
        kinds = ("began to emerge", "submerged")
        assert [e.kind for e in ours.events] == [k for _, k in theirs.events if k in kinds]

    def test_leaving_the_water_stops_the_run(self) -> None:
        vehicle = paper(
            hull=Hull(displaced_volume=0.0275, psi=0.0, waterplane_area=1e-4, height=0.2)
        )
        ours = simulate(
            vehicle,
            law=lambda *_: 0.0,
            sample_time=TICK,
            setpoints=[(0.0, 1.0)],
            duration=60.0,
            start_depth=3.0,
            start_volume=350e-6,
        )
        assert ours.stop is StopReason.LEFT_WATER
        assert ours.time[-1] < 60.0
        assert ours.depth[-1] > -0.2
        assert np.all(np.isfinite(ours.depth))

    def test_sinking_without_end_stops_the_run(self) -> None:
        ours = simulate(
            paper(),
            law=lambda *_: -12.0,
            sample_time=10.0,
            setpoints=[(0.0, 1.0)],
            duration=1e5,
            start_depth=80.0,
        )
        # psi > 0: the deeper the heavier, at the rate of the pole of eq. (34)
        assert ours.stop is StopReason.TOO_DEEP
        assert 0.8 * 12000.0 < ours.depth[-1] <= 12000.0


class TestDirectionAndFriction:
    """Between k_z eta^2 z - T_b and k_z z + T_b the motor sticks."""

    def test_the_band_in_which_the_motor_sticks(self) -> None:
        vehicle = screw(efficiency=0.5, friction=2e-3)
        motor, depth = vehicle.actuator.motor, 30.0
        torque = 9806.65 * depth * 60e-4 * 2e-3 / 20 / (2 * math.pi)  # lossless
        k_u = motor.torque_constant / motor.resistance
        high = (torque / 0.5 + 2e-3) / k_u
        low = (torque * 0.5 - 2e-3) / k_u
        assert 0.0 < low < high < 12.0
        for volts, direction in [
            (low - 1e-6, -1),
            (low + 1e-6, 0),
            (high - 1e-6, 0),
            (high + 1e-6, 1),
        ]:
            s = simulate(
                vehicle,
                law=lambda *_, v=volts: v,
                sample_time=TICK,
                setpoints=[(0.0, depth)],
                duration=TICK,
                start_depth=depth,
            )
            assert np.sign(s.motor_rate[1]) == direction

    @pytest.mark.parametrize("friction", [0.0, 3e-3])
    def test_reversals_against_the_oracle(self, friction: float) -> None:
        vehicle = screw(efficiency=0.4, friction=friction, drag=BLENDED)
        commands = [(2.0 * k, 9.0 * math.sin(1.9 * k) + 1.0) for k in range(30)]
        ours, theirs = both(vehicle, commands, 60.0, depth=12.0)
        kinds = [kind for _, kind in theirs.events]
        assert min(kinds.count(k) for k in ("drives", "driven back", "stands still")) >= 5
        agree(ours, theirs)

    def test_a_stuck_motor_is_released_by_the_growing_depth(self) -> None:
        """Stuck at rest, sinking: the sea starts to drive it back in mid-sample."""
        vehicle = screw(efficiency=0.5, friction=1e-3)
        ours, theirs = both(vehicle, [(0.0, 0.3)], 90.0, depth=5.0, volume=-150e-6)
        agree(ours, theirs)
        assert [kind for _, kind in theirs.events] == ["driven back"]
        released = theirs.events[0][0]
        assert 10.0 < released < 80.0
        assert np.all(ours.motor_rate[ours.time < released] == 0.0)
        assert np.all(ours.motor_rate[ours.time > released + 1.0] < 0.0)


class TestSupply:
    """A battery with an internal resistance."""

    def test_the_motor_at_full_duty_settles_where_battery_and_motor_meet(self) -> None:
        vehicle = screw(efficiency=1.0, R_b=0.6)
        s = simulate(
            vehicle,
            law=lambda *_: 12.0,
            sample_time=TICK,
            setpoints=[(0.0, 50.0)],
            duration=8.0,
            start_depth=50.0,
            start_volume=-1e-4,
        )
        u, q, i, z = s.voltage[-1], s.motor_rate[-1], s.current[-1], s.depth[-1]
        assert u == pytest.approx(12.0 - 0.6 * i, rel=1e-12)  # Kirchhoff
        assert i == pytest.approx((u - 0.03 * q / (60e-4 * 1e-4 / 2 / math.pi)) / 1.5, rel=1e-9)
        load = 9806.65 * z * 60e-4 * 1e-4 / (2 * math.pi)
        speed = q / (60e-4 * 1e-4 / (2 * math.pi))
        assert 0.03 * i == pytest.approx(load + 4e-6 * speed, rel=1e-3)  # torques, nearly steady
        assert s.voltage[0] == pytest.approx(12.0 * 1.5 / 2.1, rel=1e-12)  # from rest

    @pytest.mark.parametrize("R_b", [0.2, 0.5])
    def test_against_the_oracle(self, R_b: float) -> None:
        vehicle = screw(efficiency=0.7, R_b=R_b)
        commands = [(1.5 * k, 14.0 * math.sin(2.3 * k)) for k in range(30)]
        ours, theirs = both(vehicle, commands, 45.0, depth=40.0)
        assert len(theirs.times("supply")) >= 2
        agree(ours, theirs)


class TestPositioner:
    """A piston that moves at a constant rate."""

    def test_the_ramp_and_its_end(self) -> None:
        vehicle = stepper()
        s = simulate(
            vehicle,
            law=lambda *_: 50e-6,
            sample_time=TICK,
            setpoints=[(0.0, 5.0)],
            duration=6.0,
            start_depth=5.0,
            start_volume=0.0,
        )
        rate = 2e-3 * 1e-2
        np.testing.assert_allclose(s.volume, np.minimum(rate * s.time, 50e-6), rtol=0, atol=1e-18)
        assert np.all(s.volume[s.time > 2.5] == 50e-6)
        assert np.all(np.isnan(s.voltage))

    def test_turning_back_before_arrival(self) -> None:
        """A new target behind a moving piston turns it; it does not jump there."""
        vehicle = stepper(LINEAR)
        commands = [(0.0, 150e-6), (2.0, -50e-6), (5.0, 300e-6), (9.5, 149e-6), (20.0, -180e-6)]
        ours, theirs = both(vehicle, commands, 40.0, depth=8.0)
        agree(ours, theirs)
        travel = np.abs(np.diff(ours.volume))
        assert travel.max() <= 2e-5 * TICK * (1 + 1e-9)
        assert ours.volume[int(5.0 / TICK)] == pytest.approx(-8e-6 + 40e-6 - 60e-6, abs=1e-11)

    def test_commands_beyond_the_stroke_end_at_the_stop(self) -> None:
        ours, theirs = both(stepper(BLENDED), [(0.0, 1.0), (20.0, -1.0)], 60.0, depth=8.0)
        agree(ours, theirs)
        assert ours.volume.max() == 200e-6
        assert ours.volume[-1] == -200e-6


def test_sliding_along_the_jump_of_the_literal_drag() -> None:
    """Eq. (16) as printed jumps at epsilon: a pull between the two values holds |w| there."""
    epsilon, k_dl, k_dt = 0.1, 2.0, 60.0
    vehicle = screw(drag=Drag(law="switched-literal", k_dl=k_dl, k_dt=k_dt, epsilon=epsilon))
    vehicle = vehicle.model_copy(update={"hull": vehicle.hull.model_copy(update={"psi": 0.0})})
    pull = 0.4  # N, above k_dl epsilon = 0.2 and below k_dt epsilon^2 = 0.6
    s = simulate(
        vehicle,
        law=lambda *_: 0.3,
        sample_time=0.5,
        setpoints=[(0.0, 5.0)],
        duration=60.0,
        start_depth=5.0,
        start_volume=-pull / 9806.65,
    )
    sliding = s.time > 20.0
    assert np.all(s.motor_rate == 0.0)
    np.testing.assert_allclose(s.speed[sliding], epsilon, rtol=0.0, atol=1e-4)
    assert s.depth[-1] - s.depth[60] == pytest.approx(epsilon * 30.0, rel=1e-4)
    assert s.balance.energy["drag"] == pytest.approx(pull * (s.depth[-1] - 5.0), rel=0.1)
    assert s.balance.relative_energy_residue < 1e-3
