"""Laws as plain Python functions, laws that sleep, and laws compiled from a user's module."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.control.law import Law, Measurement
from swimbladder.control.position_pid import POSITION_PID, PositionPidParameters
from swimbladder.errors import InputError
from swimbladder.sim.closed_loop import StopReason, simulate
from tests.oracle import TABLE_3, paper_cascade
from tests.vehicles import paper, pump, stepper

STEP = dict(setpoints=[(0.0, 3.0), (60.0, 2.0)], duration=120.0, start_depth=1.5)


def same(a, b, tolerance: float = 1e-12) -> None:
    """The same run, but for the last digits: the balance may be kept in other steps."""
    for name in ("depth", "speed", "volume", "motor_rate", "command", "voltage"):
        x, y = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance * np.abs(x).max())
    assert [e.kind for e in a.events] == [e.kind for e in b.events]
    for name, value in a.balance.energy.items():
        near = 1e-4 * a.balance.throughput
        assert b.balance.energy[name] == pytest.approx(value, rel=1e-6, abs=near)


class TestFunctions:
    """``law(measurement, reference)``."""

    def test_the_cascade_by_hand_is_the_compiled_one(self) -> None:
        law = paper_cascade(**TABLE_3)
        by_hand = simulate(
            paper(), law=lambda seen, ref: law(seen.time, seen.depth, seen.volume, ref), **STEP
        )
        same(simulate(paper(), **STEP), by_hand, tolerance=1e-10)

    @pytest.mark.parametrize("vehicle", [paper(), pump(R_b=0.3)], ids=["paper", "pump"])
    def test_with_events(self, vehicle) -> None:
        gains = dict(k_pV=8e5, k_pz=-2e-4, k_iz=-1e-6, k_dz=-1e-3, S_p=0.4)
        run = dict(
            setpoints=[(0.0, 6.0), (40.0, 1.0)],
            duration=90.0,
            start_depth=5.0,
            bottom_depth=6.5,
            sample_time=0.4,
        )
        law = paper_cascade(**gains)
        by_hand = simulate(
            vehicle, law=lambda seen, ref: law(seen.time, seen.depth, seen.volume, ref), **run
        )
        compiled = simulate(vehicle, law=CASCADE, parameters=CascadeParameters(**gains), **run)
        assert by_hand.events
        same(compiled, by_hand, tolerance=1e-9)

    def test_a_positioner(self) -> None:
        parameters = PositionPidParameters(
            K_p=0.01,
            K_i=1e-4,
            K_d=0.05,
            threshold=1.0,
            smoothing=0.4,
            position_min=0.0,
            position_max=0.04,
            piston_area=1e-2,
            volume_at_zero=2e-4,
            S_p=0.5,
        )
        state = None

        def function(seen: Measurement, reference: float) -> tuple[float, float]:
            nonlocal state
            if state is None:
                state = POSITION_PID.initial(parameters, seen, reference)
            command, state, wait = POSITION_PID.step(parameters, state, seen, reference)
            return command, wait

        run = dict(setpoints=[(0.0, 4.0)], duration=60.0, start_depth=3.0, sample_time=0.5)
        compiled = simulate(stepper(), law=POSITION_PID, parameters=parameters, **run)
        by_hand = simulate(stepper(), law=function, **run)
        same(compiled, by_hand, tolerance=1e-10)
        assert len(set(compiled.command)) > 10

    def test_what_it_is_given(self) -> None:
        seen: list[tuple[Measurement, float]] = []

        def function(measurement: Measurement, reference: float) -> float:
            seen.append((measurement, reference))
            return 3.0

        s = simulate(paper(), law=function, **STEP)
        assert len(seen) == len(s.time)
        np.testing.assert_array_equal([m.time for m, _ in seen], s.time)
        np.testing.assert_array_equal([m.depth for m, _ in seen], s.depth)
        np.testing.assert_array_equal([m.volume for m, _ in seen], s.volume)
        np.testing.assert_array_equal([r for _, r in seen], s.reference)
        assert all(type(m.depth) is float and type(r) is float for m, r in seen)

    @pytest.mark.parametrize(
        "three",
        [3, 3.0, np.float64(3), np.float32(3), np.array(3.0), (3.0, 0.3), (np.int64(3), 0.1)],
    )
    def test_commands_of_any_numeric_type(self, three: object) -> None:
        expected = simulate(paper(), law=lambda *_: 3.0, **STEP)
        same(expected, simulate(paper(), law=lambda *_: three, **STEP))

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, np.float64("nan")])
    def test_a_command_that_is_no_number_stops_the_run(self, bad: float) -> None:
        s = simulate(paper(), law=lambda seen, _: bad if seen.time > 1.0 else 1.0, **STEP)
        assert s.stop is StopReason.LAW_NOT_FINITE
        assert s.time[-1] == pytest.approx(1.2)
        assert np.all(np.isfinite(s.depth))
        assert "not a finite number" in s.stop.value
        assert not s.finished

    @pytest.mark.parametrize("bad", [math.nan, math.inf])
    def test_nor_does_a_compiled_law_go_on(self, bad: float) -> None:
        parameters = CascadeParameters(**TABLE_3 | {"k_pV": bad})
        s = simulate(paper(), law=CASCADE, parameters=parameters, sample_time=0.3, **STEP)
        assert s.stop is StopReason.LAW_NOT_FINITE
        assert len(s.time) == 1

    @pytest.mark.parametrize("nonsense", [None, "3 V", [3.0, 0.3], (3.0, 0.3, 1.0), {}])
    def test_what_is_no_command_is_refused(self, nonsense: object) -> None:
        with pytest.raises(InputError, match=r"law: .*returned neither a command") as caught:
            simulate(paper(), law=lambda *_: nonsense, **STEP)
        assert caught.value.field == "law"
        assert caught.value.remedy

    def test_exceptions_pass_through(self) -> None:
        class OutOfBatteryError(Exception):
            pass

        def function(seen: Measurement, _: float) -> float:
            if seen.time > 10.0:
                raise OutOfBatteryError(seen.time)
            return 0.0

        with pytest.raises(OutOfBatteryError, match=r"10\.2"):
            simulate(paper(), law=function, **STEP)

    def test_a_callable_object_has_its_class_for_a_name(self) -> None:
        class Idle:
            def __call__(self, seen: Measurement, reference: float) -> float:  # noqa: ARG002
                return 0.0

        assert simulate(paper(), law=Idle(), **STEP).law == "Idle"


class TestSleep:
    """A law says when it wants to be called next; until then its command holds."""

    @pytest.mark.parametrize(
        ("wait", "ticks"),
        [(0.3, 1), (0.31, 2), (0.9, 3), (3.0, 10), (0.0, 1), (-5.0, 1), (0.1, 1), (math.nan, 1)],
    )
    def test_the_calls_are_at_whole_ticks(self, wait: float, ticks: int) -> None:
        calls: list[float] = []

        def function(seen: Measurement, _: float) -> tuple[float, float]:
            calls.append(seen.time)
            return float(len(calls)), wait

        s = simulate(paper(), law=function, **STEP)
        np.testing.assert_allclose(calls, s.time[::ticks], rtol=1e-12)
        np.testing.assert_array_equal(s.command, 1.0 + np.arange(len(s.time)) // ticks)

    def test_never_again(self) -> None:
        calls: list[float] = []

        def function(seen: Measurement, _: float) -> tuple[float, float]:
            calls.append(seen.time)
            return 0.5, math.inf

        s = simulate(paper(), law=function, **STEP)
        assert calls == [0.0]
        assert s.finished
        assert np.all(s.command == 0.5)

    def test_a_compiled_law_that_sleeps(self) -> None:
        """Parameters for 1.2 s on a clock of 0.3 s: the cascade is called at every fourth tick."""
        gains = TABLE_3 | {"S_p": 1.2, "k_pV": 2e5}
        run = dict(STEP, sample_time=0.3)
        s = simulate(paper(), law=CASCADE, parameters=CascadeParameters(**gains), **run)
        changes = np.flatnonzero(np.diff(s.command)) + 1
        assert np.all(changes % 4 == 0)
        law = paper_cascade(**gains)
        by_hand = simulate(
            paper(),
            law=lambda seen, ref: (law(seen.time, seen.depth, seen.volume, ref), 1.2),
            **run,
        )
        same(s, by_hand, tolerance=1e-10)
        # a sample of 1.2 s without the finer clock is the same loop
        coarse = simulate(
            paper(),
            law=CASCADE,
            parameters=CascadeParameters(**gains),
            **dict(run, sample_time=1.2),
        )
        np.testing.assert_allclose(s.depth[::4], coarse.depth, rtol=0.0, atol=1e-11)

    def test_the_vehicles_own_law_at_another_sample_time(self) -> None:
        """Its S_p follows: eqs (36)-(37) divide by the time that passes."""
        s = simulate(paper(), sample_time=0.1, **STEP)
        expected = simulate(
            paper(),
            law=CASCADE,
            parameters=CascadeParameters(**TABLE_3 | {"S_p": 0.1}),
            sample_time=0.1,
            **STEP,
        )
        same(s, expected)


class BangParameters(NamedTuple):
    """Of a law that a user wrote."""

    volts: float
    band: float
    S_p: float


class BangState(NamedTuple):
    """What it remembers."""

    last: float
    volume_reference: float


def bang(parameters, state, measurement, reference):  # type: ignore[no-untyped-def]
    """Full voltage outside a band about the depth ahead, nothing inside."""
    speed = (measurement.depth - state.last) / parameters.S_p
    ahead = measurement.depth + 6.0 * speed - reference
    command = 0.0
    if abs(ahead) > parameters.band:
        command = math.copysign(parameters.volts, ahead)
    return command, BangState(measurement.depth, measurement.volume), parameters.S_p


def bang_initial(parameters, measurement, reference):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return BangState(measurement.depth, measurement.volume)


BANG = Law(
    name="bang",
    summary="full voltage or none",
    command="voltage",
    parameters=BangParameters,
    state=BangState,
    step=bang,
    initial=bang_initial,
)


class TestOwnLaw:
    """A Law of the user's own named tuples."""

    parameters = BangParameters(volts=4.0, band=0.1, S_p=0.5)

    def test_compiled_and_by_hand(self) -> None:
        run = dict(STEP, sample_time=0.5)
        state = None

        def function(seen: Measurement, reference: float) -> tuple[float, float]:
            nonlocal state
            if state is None:
                state = bang_initial(self.parameters, seen, reference)
            command, state, wait = bang(self.parameters, state, seen, reference)
            return command, wait

        compiled = simulate(paper(), law=BANG, parameters=self.parameters, **run)
        same(compiled, simulate(paper(), law=function, **run))
        assert set(compiled.command) == {-4.0, 0.0, 4.0}
        # a state field called volume_reference is recorded
        np.testing.assert_array_equal(compiled.volume_reference, compiled.volume)

    def test_two_laws_cannot_share_a_class_of_parameters(self) -> None:
        """The compiler would take one for the other: it is refused, not confused."""
        simulate(paper(), **STEP)
        mine = replace(CASCADE, name="mine", step=bang)
        with pytest.raises(InputError, match="CascadeParameters") as caught:
            simulate(
                paper(), law=mine, parameters=CascadeParameters(**TABLE_3), sample_time=0.3, **STEP
            )
        assert "of its own" in str(caught.value)
