"""A vehicle that is switched on: its C, compiled, against its float32 twin, to the bit."""

import ctypes
import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swimbladder.codegen.library import Library
from swimbladder.codegen.subset import read_law
from swimbladder.codegen.twin import VehicleTwin, twin
from swimbladder.control.arming import ARMING, Deck
from swimbladder.control.supervisor import Reason, Watched
from tests.codegen import chip
from tests.codegen.laws import bits
from tests.codegen.test_supervised import SEEN, VehicleInC, library, said_by
from tests.examples import examples


@pytest.fixture(
    scope="module", params=["feup-em", pytest.param("ntnu-bv", marks=pytest.mark.prove)]
)
def both(request, tmp_path_factory):
    request.getfixturevalue("gcc")
    made = library(request.param)
    return made, VehicleInC(made, tmp_path_factory.mktemp(request.param))


@functools.cache
def arming_twin():
    return twin(ARMING, read_law(ARMING, Deck))


def switched_on(made: Library, *, was_armed: bool = False) -> VehicleTwin:
    vehicle = chip.vehicle_twin(made)
    vehicle.switch_on(arming_twin(), made.arming, was_armed=was_armed)
    return vehicle


def switch_on(in_c: VehicleInC, *, anew: bool = False, was_armed: bool = False, memory=None):
    """Begin as a board does, in memory that holds what it held, or something else."""
    if memory is not None:
        in_c.room = ctypes.create_string_buffer(bytes(memory), len(memory))
    in_c.c.on(ctypes.addressof(in_c.room), int(anew), int(was_armed))


def armed(in_c: VehicleInC) -> bool:
    return bool(in_c.c.armed(ctypes.addressof(in_c.room)) & 1)


_DEPTHS = st.one_of(
    st.floats(-1.0, 3.0, width=32),
    st.sampled_from([0.2, 5.0, math.nan, math.inf, -math.inf, -0.0, 1e-45, 3e38, -1e6]),
)
_VOLUMES = st.sampled_from([1e-5, -2e-4, math.nan, math.inf, 1.0])


@examples(60)
@given(
    stretches=st.lists(
        st.tuples(_DEPTHS, _VOLUMES, st.integers(1, 14), st.booleans()), min_size=1, max_size=14
    ),
    was_armed=st.booleans(),
    by_hand=st.integers(0, 40),
)
@pytest.mark.promise("disarmed-holds")
@pytest.mark.promise("water-arms")
@pytest.mark.promise("as-in-python")
def test_whatever_it_sees_is_met_as_by_the_twin(both, stretches, was_armed, by_hand):
    made, in_c = both
    beside = switched_on(made, was_armed=was_armed)
    in_c.begin(anew=False)
    switch_on(in_c, was_armed=was_armed)
    n = 0
    for depth, volume, ticks, leak in stretches:
        for _ in range(ticks):
            n += 1
            if n == by_hand:
                beside.arm()
                in_c.c.arm(ctypes.addressof(in_c.room))
            seen = SEEN._replace(depth=depth, volume=volume, leak=leak)
            expected, got = said_by(beside, seen, 3.0), in_c.tick(seen, 3.0)
            assert bits(got[0]) == bits(expected[0])
            assert got[1:] == expected[1:]
            assert armed(in_c) == beside.armed
            if not beside.armed:
                assert got[1:] == (0, 0, 0)
                first = made.law.command == "voltage"
                assert got[0] == 0.0 if first else not abs(got[0]) > made.limits[1]


class TestAReset:
    @pytest.mark.promise("stays-armed")
    def test_of_one_that_is_armed_leaves_it_armed(self, both):
        _, in_c = both
        in_c.begin(anew=False)
        switch_on(in_c)
        in_c.c.arm(ctypes.addressof(in_c.room))
        in_c.tick(SEEN, 3.0)
        switch_on(in_c, anew=True)
        assert armed(in_c)
        assert in_c.tick(SEEN._replace(depth=math.nan), 3.0)[1] == Reason.RESTARTED

    @pytest.mark.promise("disarmed-holds")
    def test_of_one_that_is_not_leaves_it_so(self, both):
        """As the reset button, or a serial monitor that is opened, on deck."""
        _, in_c = both
        in_c.begin(anew=False)
        switch_on(in_c)
        in_c.tick(SEEN._replace(depth=0.1), 3.0)
        switch_on(in_c, anew=True)
        assert not armed(in_c)
        for _ in range(200):
            assert in_c.tick(SEEN._replace(depth=0.1, leak=True), 3.0)[1:] == (0, 0, 0)

    @pytest.mark.promise("stays-armed")
    def test_that_cost_the_memory_arms(self, both):
        """A brown-out in the dive: nobody knows, and up is the safe way."""
        made, in_c = both
        rng = np.random.default_rng(3)
        size = in_c.c.size()
        for memory in (bytes(size), b"\xff" * size, b"\x55" * size, rng.bytes(size)):
            switch_on(in_c, anew=True, memory=memory)
            assert armed(in_c)
            command, reason, *_ = in_c.tick(SEEN, 3.0)
            assert reason == Reason.RESTARTED
            assert command == np.float32(made.supervisor.push.surface_command)

    @pytest.mark.promise("disarmed-holds")
    def test_power_on_is_none_whatever_the_memory_holds(self, both):
        made, in_c = both
        in_c.begin(anew=False)
        held = bytes(in_c.room.raw)
        for memory in (held, b"\xff" * len(held), bytes(len(held))):
            switch_on(in_c, memory=memory)
            beside = switched_on(made)
            for depth in [0.1] * 20 + [4.0] * 20:
                seen = SEEN._replace(depth=depth)
                assert in_c.tick(seen, 3.0) == said_by(beside, seen, 3.0)
            assert armed(in_c)

    def test_a_surface_is_told_to_the_board_once_it_is_sure(self, both):
        made, in_c = both
        in_c.begin(anew=False)
        switch_on(in_c, was_armed=True)
        said = []
        for _ in range(made.arming.under + 2):
            in_c.tick(SEEN._replace(depth=0.1), 3.0)
            said.append(in_c.c.armed(ctypes.addressof(in_c.room)) >> 1)
        assert said == [0] * (made.arming.under - 1) + [1] * 3


@pytest.mark.avr
@pytest.mark.usefixtures("avr")
@pytest.mark.promise("water-arms")
def test_on_the_chip_it_is_armed_by_water_as_in_the_twin(tmp_path):
    made = library()
    on_chip, beside = chip.vehicle(made, tmp_path, "atmega328p", "-DDISARMED"), switched_on(made)
    rng, armed_at = np.random.default_rng(2), []
    for n in range(300):
        depth = rng.normal(0.3, 0.4) if n < 200 else 2.0 + 0.01 * rng.normal()
        seen = Watched(depth, 0.1, 1e-5, 12.0, False, 0, 0)
        command, said = on_chip.answer(*seen[:6], 3.0)
        expected = beside.tick(seen, 3.0)
        assert bits(command, said) == bits(expected, beside.state.recovery.reasons), n
        armed_at += [n] * (beside.armed and not armed_at)
    on_chip.close()
    assert len(armed_at) == 1
    assert 205 <= armed_at[0] <= 209
