"""Before a vehicle is armed: what arms it, what does not, and what holds it meanwhile."""

import math

import numpy as np
import pytest

from swimbladder.codegen.twin import ControllerTwin, VehicleTwin
from swimbladder.control.arming import ARMING, DISARMED, Deck
from swimbladder.control.registry import LAWS
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.control.supervisor_limits import (
    arming_parameters,
    command_limits,
    supervisor_parameters,
)
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Supervisor
from tests.codegen.laws import controlled, example
from tests.vehicles import paper

P = arming_parameters(paper(), supervisor_parameters(paper(), 0.3))
BENCH = Watched(0.02, 0.1, 1e-5, 12.0, False, 0, 0)


def after(depths, *, was_armed=False, volume=1e-5, p=P):
    """Return the state after some depths, and the tick at which it was armed, or None."""
    s = ARMING.initial(p, Deck(math.nan, math.nan), float(was_armed))
    for n, depth in enumerate(depths):
        _, s, _ = ARMING.step(p, s, Deck(depth, volume), 1.0)
        if s.deck != DISARMED:
            return s, n
    return s, None


def a_vehicle(name="cascade", **supervisor):
    vehicle, parameters, tick = example(name)
    vehicle = vehicle.model_copy(update={"supervisor": Supervisor(**supervisor)})
    low, high = command_limits(vehicle)
    first = 0.0 if vehicle.voltage_driven else high
    law = ControllerTwin(LAWS[name], parameters, tick_s=tick, limits=(low, high), first=first)
    limits = supervisor_parameters(vehicle, tick)
    made = VehicleTwin(law, limits)
    made.switch_on(ARMING, arming_parameters(vehicle, limits))
    return vehicle, made


class TestWhatArms:
    @pytest.mark.promise("water-arms")
    def test_three_seconds_under_water(self):
        assert (P.submerged, P.under) == (1.0, 10)
        s, tick = after([0.2] * 20 + [1.1] * 20)
        assert tick == 29
        assert not s.restarted

    @pytest.mark.promise("disarmed-holds")
    def test_not_a_splash_nor_a_wave_nor_the_weather(self):
        wave = 0.5 + 0.7 * np.sin(2.0 * np.pi * 0.3 * np.arange(2000) / 6.0)
        assert after([*wave])[1] is None
        assert after([0.9] * 5000)[1] is None
        assert after([-0.9] * 5000)[1] is None

    @pytest.mark.promise("disarmed-holds")
    def test_not_a_sensor_that_is_not_there_or_says_nonsense(self):
        assert after([math.nan] * 5000)[1] is None
        assert after([1e6, -50.0, math.inf] * 2000)[1] is None

    @pytest.mark.promise("water-arms")
    def test_gaps_under_water_do_not_delay_it_for_ever(self):
        assert after([0.2] * 20 + [5.0, math.nan, math.nan] * 30)[1] == 20 + 27

    @pytest.mark.promise("power-under-water")
    def test_a_power_on_in_the_deep_is_a_restart(self):
        s, tick = after([30.0] * 20)
        assert tick == 9
        assert s.restarted

    @pytest.mark.promise("power-under-water")
    def test_a_first_sample_of_zero_is_no_surface(self):
        s, _ = after([0.0, 0.0, *[30.0] * 20])
        assert s.restarted

    @pytest.mark.parametrize(("was_armed", "tick"), [(True, 16), (False, None)])
    @pytest.mark.promise("power-under-water")
    def test_what_was_armed_and_sees_nothing_is_armed(self, was_armed, tick):
        """A loss of power in the dive, with a sensor that fails since: `patience`, then up."""
        s, armed = after([math.nan] * 100, was_armed=was_armed)
        assert armed == tick
        assert s.restarted == was_armed

    def test_but_not_once_it_has_been_seen_at_the_surface(self):
        s, tick = after([0.1] * 10 + [math.nan] * 5000, was_armed=True)
        assert tick is None
        assert s.surfaced
        assert not s.was_armed

    @pytest.mark.parametrize("deck", [0, 1, DISARMED ^ 0x8000, DISARMED ^ 1, 65535])
    @pytest.mark.promise("stays-armed")
    def test_memory_that_holds_anything_else_is_armed(self, deck):
        s = ARMING.initial(P, Deck(math.nan, math.nan), 0.0)._replace(deck=deck)
        command, s, _ = ARMING.step(P, s, Deck(0.0, 0.0), 7.5)
        assert command == 7.5
        assert s.deck == deck


class TestOnTheBench:
    @pytest.mark.promise("disarmed-holds")
    def test_nothing_moves_and_nothing_latches_in_an_hour(self):
        """The very same that a vehicle which is armed takes for a fault within seconds."""
        _, made = a_vehicle()
        for _ in range(12_000):
            assert made.tick(BENCH, 3.0) == 0.0
        assert not made.armed
        assert made.reason is None
        assert made.controller.ticks == 0
        made.arm()
        ticks = 0
        while made.reason is None:
            made.tick(BENCH, 3.0)
            ticks += 1
        assert made.armed
        assert ticks * 0.3 < 60.0

    @pytest.mark.promise("disarmed-holds")
    def test_leak_battery_and_time_are_no_reason_either(self):
        _, made = a_vehicle(time_limit="60 s")
        for _ in range(1000):
            made.tick(BENCH._replace(leak=True, battery=3.0, lost=50), 3.0)
        assert made.reason is None
        made.arm()
        made.tick(BENCH, 3.0)
        assert made.reason is None

    @pytest.mark.promise("stays-armed")
    def test_to_arm_what_is_armed_changes_nothing(self):
        _, made = a_vehicle()
        made.arm()
        for _ in range(10):
            made.tick(BENCH._replace(leak=True), 3.0)
        made.arm()
        assert made.reason is Reason.LEAK

    @pytest.mark.promise("disarmed-holds")
    def test_a_positioner_keeps_the_first_volume_that_it_measured(self):
        _, made = a_vehicle("position-pid")
        seen = BENCH._replace(volume=math.nan)
        assert all(math.isnan(made.tick(seen, 3.0)) for _ in range(5))
        held = {made.tick(BENCH._replace(volume=1e-5 + 1e-7 * n), 3.0) for n in range(9)}
        assert held == {1e-5}
        assert math.isnan(after_volume(1.0))

    def test_it_begins_as_one_that_was_armed_at_once(self):
        """What it saw on deck leaves nothing behind in law or supervisor."""
        _, made = a_vehicle()
        for n in range(100):
            made.tick(BENCH._replace(depth=0.1 * (n % 7), volume=1e-6 * n), 3.0)
        made.arm()
        _, other = a_vehicle()
        other.arm()
        for n in range(200):
            seen = BENCH._replace(depth=0.01 * n, volume=-1e-6 * n)
            assert made.tick(seen, 3.0) == other.tick(seen, 3.0)
        assert made.state == other.state


def after_volume(volume):
    vehicle = controlled("position-pid")
    p = arming_parameters(vehicle, supervisor_parameters(vehicle, 0.5))
    s = ARMING.initial(p, Deck(math.nan, math.nan), 0.0)
    return ARMING.step(p, s, Deck(0.1, volume), 1.0)[0]


class TestInTheWater:
    def flown(self, *, start, trim):
        vehicle, made = a_vehicle()
        vehicle = vehicle.model_copy(update={"trim_error": trim})
        armed = []

        def law(seen, reference):
            command = made(seen, reference)
            armed.append(made.armed)
            return command

        ran = simulate(
            vehicle,
            law=law,
            sample_time=0.3,
            start_depth=start,
            setpoints=[(0.0, 3.0)],
            duration=400.0,
            seed=1,
            checked=False,
            supervised=False,
        )
        return ran, made, armed.index(True) if True in armed else None

    @pytest.mark.promise("water-arms")
    def test_a_heavy_vehicle_that_is_let_go_at_the_surface_does_its_mission(self):
        """40 cm3 heavier than neutral it sinks by itself, and is caught."""
        ran, made, tick = self.flown(start=0.2, trim=4e-5)
        assert tick is not None
        assert ran.depth[tick] < 2.0
        assert made.reason is None
        assert ran.depth[-1] == pytest.approx(3.0, abs=0.1)

    @pytest.mark.promise("power-under-water")
    def test_power_that_comes_back_in_the_deep_brings_it_up(self):
        ran, made, tick = self.flown(start=20.0, trim=4e-5)
        assert tick == 9
        assert made.reason is Reason.RESTARTED
        assert ran.depth.max() < 23.0
        assert ran.depth[-1] < 0.5

    def test_a_vehicle_that_floats_stays_there_disarmed(self):
        ran, made, tick = self.flown(start=0.0, trim=-1e-4)
        assert tick is None
        assert made.reason is None
        assert np.all(ran.voltage == 0.0)


class TestNumbers:
    @pytest.mark.parametrize(("name", "depth"), [("feup-em", 1.0), ("example-float", 1.1)])
    def test_a_metre_below_where_the_hull_emerges(self, name, depth):
        vehicle = load_vehicle(name)
        p = arming_parameters(vehicle, supervisor_parameters(vehicle, 1.0))
        assert p.submerged == pytest.approx(depth)
        assert p.under == 3

    def test_half_way_to_a_bottom_that_is_nearer(self):
        vehicle = paper(supervisor=Supervisor(bottom_depth="1.2 m"))
        p = arming_parameters(vehicle, supervisor_parameters(vehicle, 0.3))
        assert p.submerged == pytest.approx(0.6)

    def test_what_the_file_says(self):
        vehicle = paper(supervisor=Supervisor(arm_depth="2 m", arm_after="6 s"))
        p = arming_parameters(vehicle, supervisor_parameters(vehicle, 0.3))
        assert (p.submerged, p.under) == (2.0, 20)

    @pytest.mark.parametrize("given", [{"arm_depth": "80 m"}, {"arm_after": "60 s"}])
    def test_a_vehicle_that_would_be_armed_too_deep_is_refused(self, given):
        vehicle = paper(supervisor=Supervisor(**given))
        with pytest.raises(InputError, match="may be armed at") as caught:
            arming_parameters(vehicle, supervisor_parameters(vehicle, 0.3))
        assert caught.value.field == "supervisor.arm_depth"
