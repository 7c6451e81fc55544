"""The law that sleeps: its model and gains against SciPy, its hours against the bands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.control.deadband import (
    DEADBAND,
    deadband_gains,
    initial,
    learn_share,
    predict,
    step,
)
from swimbladder.control.law import Measurement, leaves
from swimbladder.design.linear.sampled import BoundLaw
from swimbladder.design.stability.around import wrapped
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Hull, IdentifiedActuator, Sensors
from tests.control.examples import K2, S_P, SLEEPER, T2, blind, by_hand
from tests.vehicles import paper

PSI = SLEEPER.psi
CREEP = SLEEPER.rate_per_volt * SLEEPER.depth_voltage  # m2/s
NOISE = Sensors(depth_noise="2 mm", depth_quantum="5 mm")


def as_seen(_k, seen):
    return seen


def stiff(psi: float):
    """The paper's vehicle with another hull and a spindle that the sea does not drive."""
    return paper(
        hull=Hull(displaced_volume=0.0275, psi=psi, waterplane_area=math.pi / 100, height=1.285),
        actuator=IdentifiedActuator(
            K1="0.444 mm/s/V", T1=0.09, piston_area="75 cm2", depth_voltage=0.0
        ),
    )


def motion(excess: float, psi: float):
    """T2 dw/dt + w = K2 (psi z - excess), with z counted from where psi is counted."""
    return lambda _, y: [y[1], (K2 * (psi * y[0] - excess) - y[1]) / T2]


def asleep(psi: float, creep: float, held: float):
    """The same with the volume that gives way to depths beyond the one it was held at."""

    def rates(_, y):
        return [y[1], (K2 * (psi * y[0] - y[2]) - y[1]) / T2, -creep * (y[0] - held)]

    return rates


@given(
    h=st.floats(0.3, 40.0),
    z=st.floats(-0.2, 0.2),
    w=st.floats(-0.02, 0.02),
    excess=st.floats(-2e-6, 2e-6),
)
def test_the_prediction_is_that_of_the_motion(h, z, w, excess) -> None:
    """SciPy: 8 % off where the sleep is 20 s, twice that at three quarters of psi's e-fold."""
    ideal = solve_ivp(motion(excess, PSI), (0.0, h), [z, w], rtol=1e-10, atol=1e-13).y[:, -1]
    state = initial(SLEEPER, Measurement(0.0, z, 0.0), z)
    state = state._replace(speed=w, neutral=0.0, volume=excess, waited=h)
    found = predict(SLEEPER, state, excess)
    way = abs(w) * h + 0.5 * abs(K2 * (PSI * z - excess)) * h * h / T2 + 1e-9
    assert abs(found.depth - ideal[0]) < 0.15 * h / 40.0 * way + 1e-9
    assert abs(found.speed - ideal[1]) < 0.16 * h / 40.0 * way / h + 1e-9


@given(h=st.floats(0.3, 60.0), more=st.floats(0.3, 60.0))
def test_its_slopes_are_those_of_the_prediction(h, more) -> None:
    """With psi left out the motion is linear in the neutral volume, two sleeps on end as well."""
    p = SLEEPER._replace(psi=0.0)
    start = initial(p, Measurement(0.0, 2.0, 0.0), 2.0)

    def after(neutral):
        state = start._replace(neutral=neutral, waited=h)
        now = predict(p, state, 0.0)
        return predict(p, state._replace(**now._asdict(), waited=more), 0.0)

    found, moved = after(0.0), after(1e-6)
    assert found.depth_slope == pytest.approx((moved.depth - found.depth) / 1e-6, rel=1e-6)
    assert found.speed_slope == pytest.approx((moved.speed - found.speed) / 1e-6, rel=1e-6)


@pytest.mark.parametrize("psi", [PSI, 0.0, -2e-6, -2e-5])
@pytest.mark.parametrize("interval", [5.0, 20.0, 60.0])
@pytest.mark.parametrize("pole", [0.0, 0.5])
@pytest.mark.parametrize("creep", [0.0, CREEP])
def test_the_gains_place_the_poles(psi, interval, pole, creep) -> None:
    """SciPy, the volume held for each interval: after n the error is that of a double pole."""
    gains = deadband_gains(K2, T2, psi, interval, pole, creep=creep)
    y, run = np.array([0.1, 0.004]), []
    for _ in range(6):
        run.append(y)
        u = -gains.k_z * y[0] - gains.k_w * y[1]
        y = solve_ivp(
            asleep(psi, creep, y[0]), (0.0, interval), [*y, -u / K2], rtol=1e-11, atol=1e-15
        ).y[:2, -1]
    scale = max(1.0, float(np.max(np.abs(run))))
    for a, b, c in zip(run, run[1:], run[2:], strict=False):
        np.testing.assert_allclose(c, 2 * pole * b - pole**2 * a, atol=1e-7 * scale)


@pytest.mark.parametrize(("psi", "creep"), [(PSI, 0.0), (PSI, CREEP), (-PSI, CREEP)])
def test_growth_and_longest_sleep_are_those_of_the_unstable_mode(psi, creep) -> None:
    """SciPy: long asleep, what is off grows by `growth` in an interval, whatever it began with."""
    gains = deadband_gains(K2, T2, psi, 20.0, creep=creep)
    ran = solve_ivp(
        asleep(psi, creep, 0.0),
        (0.0, 720.0),
        [1e-6, 0.0, 0.0],
        t_eval=[700.0, 720.0],
        rtol=1e-11,
        atol=1e-15,
    ).y[0]
    assert gains.growth == pytest.approx(ran[1] / ran[0], rel=1e-5)
    e_fold = 20.0 / math.log(gains.growth)
    assert gains.longest == pytest.approx(max(0.6 * e_fold, 20.0), rel=1e-12)


def test_a_fifth_of_an_error_is_left_where_nothing_else_is_asked() -> None:
    assert deadband_gains(K2, T2, PSI, 20.0) == deadband_gains(K2, T2, PSI, 20.0, 0.2)


def test_what_does_not_run_away_may_sleep_an_hour() -> None:
    assert deadband_gains(K2, T2, -PSI, 20.0)[2:] == (1.0, 3600.0)


HOUR = dict(setpoints=[(0.0, 2.0)], start_depth=2.0, duration=7200.0)


@pytest.fixture(scope="module")
def hours():
    """Two hours of the unstable vehicle, neutral 1 cm3 from where it starts, and noise."""
    return simulate(
        paper(sensors=NOISE),
        law=DEADBAND,
        parameters=SLEEPER,
        sample_time=S_P,
        seed=3,
        start_volume=PSI * 2.0 + 1e-6,
        **HOUR,
    )


def test_it_holds_an_unstable_vehicle_within_its_band(hours) -> None:
    assert np.max(np.abs(hours.depth - 2.0)) < SLEEPER.band
    assert np.max(np.abs(hours.depth - 2.0)) > 0.02  # the start was off


def test_it_hardly_moves_the_motor(hours) -> None:
    """Less than a hundredth of what the paper's cascade moves under this noise, some 60 L/h."""
    assert np.sum(np.abs(np.diff(hours.volume))) < 2.0 * 0.5e-3
    running = np.abs(np.diff(hours.volume)) > 1e-7
    assert np.sum(running[1:] & ~running[:-1]) < 2 * 100


def test_without_it_the_vehicle_is_lost() -> None:
    """The same vehicle with the voltage that holds the piston: the oracle that this was needed."""
    ran = simulate(
        paper(),
        law=lambda seen, _: SLEEPER.depth_voltage * seen.depth,
        sample_time=S_P,
        start_volume=PSI * 2.0 + 1e-6,
        **HOUR | {"duration": 400.0},
    )
    assert np.max(np.abs(ran.depth - 2.0)) > 1.0


@pytest.mark.parametrize("target", [3.0, 12.0])
def test_it_goes_to_a_new_depth(target) -> None:
    ran = simulate(
        paper(),
        law=DEADBAND,
        parameters=SLEEPER,
        sample_time=S_P,
        start_depth=2.0,
        setpoints=[(0.0, target)],
        duration=1500.0,
    )
    assert np.max(np.abs(ran.depth[ran.time > 900.0] - target)) < SLEEPER.band
    assert np.max(np.abs(ran.speed)) < 2.0 * SLEEPER.fastest


def test_a_stable_vehicle_sleeps_by_the_hour_and_noise_does_not_wake_the_motor() -> None:
    psi = -2e-6
    gains = deadband_gains(K2, T2, psi, 20.0)
    p = SLEEPER._replace(psi=psi, depth_voltage=0.0, interval=20.0, **gains._asdict())
    ran, calls = by_hand(
        DEADBAND,
        p,
        as_seen,
        vehicle=stiff(psi).model_copy(update={"sensors": NOISE}),
        setpoints=[(0.0, 2.0)],
        start_depth=2.0,
        duration=6 * 3600.0,
        seed=1,
    )
    assert len(calls.waits) < 100
    assert max(calls.waits) > 1000.0
    assert np.max(np.abs(ran.depth - 2.0)) < p.band
    assert np.sum(np.abs(np.diff(ran.volume))) < 2e-6


def test_it_learns_the_neutral_volume() -> None:
    """Started 2 cm3 too light, without noise: the estimate is the truth of the model, psi z = 0."""
    _, calls = by_hand(
        DEADBAND,
        SLEEPER,
        as_seen,
        setpoints=[(0.0, 2.0)],
        start_depth=2.0,
        duration=600.0,
        start_volume=PSI * 2.0 + 2e-6,
    )
    assert calls.states[0].neutral == pytest.approx(2e-6, rel=1e-9)
    assert abs(calls.states[-1].neutral) < 0.2e-6


@given(
    share=st.floats(0.45, 2.2),
    z=st.floats(0.5, 50.0),
    way=st.floats(-0.3, 0.3),
    h=st.floats(5.0, 30.0),
    known=st.floats(0.5, 2.0),
)
def test_a_sleep_tells_what_a_voltage_does(share, z, way, h, known) -> None:
    """SciPy: dV/dt = K1 A (share u - c z) while the depth goes a straight way."""
    p = SLEEPER
    u = p.depth_voltage * z / known
    crept = solve_ivp(
        lambda t, _: [p.rate_per_volt * (share * u - p.depth_voltage * (z + way * t / h))],
        (0.0, h),
        [0.0],
        rtol=1e-10,
        atol=1e-15,
    ).y[0, -1]
    before = initial(p, Measurement(0.0, z, 0.0), z)._replace(voltage=u, share=known, waited=h)
    seen = Measurement(h, z + way, crept)
    found = learn_share(p, before, seen)
    if abs(crept) <= p.tolerance:
        assert found == known
    elif 0.42 < share < 2.4:
        noise = (p.tolerance / (p.rate_per_volt * u * h)) ** 2
        assert found == pytest.approx(share, abs=1e-6 + abs(share - known) * noise)
    # A motor that turns has no part of its rest; nor has a volume that stayed where it was.
    assert learn_share(p, before._replace(moving=p.S_p), seen) == known
    assert learn_share(p, before, seen._replace(volume=0.0)) == known


@pytest.mark.parametrize("tolerance", [0.0, 1e-7])
def test_a_sleep_without_a_voltage_that_counts_tells_nothing(tolerance) -> None:
    """As in water without a load: the volume crept, and the voltage was not why."""
    p = SLEEPER._replace(tolerance=tolerance, depth_voltage=0.0)
    least = tolerance / p.rate_per_volt  # V for a second
    before = initial(p, Measurement(0.0, 2.0, 0.0), 2.0)._replace(share=0.8, waited=1.0)
    for voltage in (0.0, 0.99 * least, -0.99 * least):
        seen = Measurement(1.0, 2.0, 3e-7)
        assert learn_share(p, before._replace(voltage=voltage), seen) == 0.8


class Wrong:
    """The law with a command that is wrong by a factor and comes half a sample late."""

    def __init__(self, gain: float) -> None:
        rest = SLEEPER.depth_voltage * 1.5
        form = wrapped(BoundLaw(DEADBAND, SLEEPER, S_P), gain=gain, late=True, rest=rest)
        self.step, self.first, self.state = form.law.step, form.law.initial, None
        self.numbers = form.parameters

    def __call__(self, seen, reference):
        if self.state is None:
            self.state = self.first(self.numbers, seen, reference)
        u, self.state, wait = self.step(self.numbers, self.state, seen, reference)
        return u, wait


@pytest.mark.parametrize("gain", [0.5, 0.7, 1.4, 2.0])
def test_it_holds_with_a_command_that_is_wrong_and_late(gain) -> None:
    """A step of 1.5 m, as `stability --robustness` makes it; what is learnt is the gain itself."""
    law = Wrong(gain)
    ran = simulate(
        paper(sensors=NOISE),
        law=law,
        sample_time=0.5 * S_P,
        start_depth=1.5,
        duration=600.0,
        setpoints=[(0.0, 3.0)],
        start_volume=PSI * 1.5 + 1e-6,
        seed=4,
    )
    assert np.max(np.abs(ran.depth[ran.time > 400.0] - 3.0)) < SLEEPER.band
    assert leaves(law.state)["share"] == pytest.approx(gain, rel=0.05)


def test_in_the_bands_nothing_moves_and_out_of_one_it_does() -> None:
    """At rest and neutral 5 cm off: sleep. 19 cm off, or too fast: the motor runs at once."""
    for depth, speed, acts in ((2.05, 0.0, False), (2.19, 0.0, True), (2.0, 0.011, True)):
        seen = Measurement(0.0, depth, PSI * depth)
        state = initial(SLEEPER, seen, 2.0)._replace(speed=speed)
        u, after, wait = step(SLEEPER, state, seen, 2.0)
        assert (after.moving > 0.0) == acts
        assert (wait == S_P) == acts
        assert (abs(u - SLEEPER.depth_voltage * depth) > 0.1) == acts
        assert not acts or (u > 0.0)  # too deep or sinking: lighter


@pytest.mark.parametrize("noise", [1e-3, 0.1])
def test_the_edge_leaves_room_for_growth_and_noise(noise) -> None:
    """An error that grows in a sleep to the band, less 3 sigma of the sensor, half at most."""
    p = SLEEPER._replace(depth_noise=noise)
    edge = p.band / p.growth
    edge = max(edge - 3.0 * noise, 0.5 * edge)
    for off, acts in ((0.999 * edge, False), (1.001 * edge, True)):
        seen = Measurement(0.0, 2.0 + off, PSI * (2.0 + off))
        _, after, _ = step(p, initial(p, seen, 2.0), seen, 2.0)
        assert (after.acting > 0.0) == acts


def test_it_acts_until_it_rests_well_inside() -> None:
    """Once out of the band: until it would come to rest in half of it, then one last move."""
    edge = SLEEPER.band / SLEEPER.growth - 3.0 * SLEEPER.depth_noise
    for off, acts in ((0.49 * edge, False), (0.51 * edge, True)):
        seen = Measurement(0.0, 2.0 + off, PSI * (2.0 + off) + 5e-6)
        state = initial(SLEEPER, seen, 2.0)._replace(acting=1.0)
        _, after, _ = step(SLEEPER, state, seen, 2.0)
        assert (after.acting > 0.0) == acts
        rest = SLEEPER.psi * (2.0 + off) + after.neutral
        assert (after.volume_reference == pytest.approx(rest, rel=1e-12)) != acts


def test_a_motor_that_stalls_is_given_up_until_the_next_decision() -> None:
    """The volume does not move: after an interval it is decided anew, not waited for ever."""
    state = initial(SLEEPER, Measurement(0.0, 2.5, 0.0), 2.0)
    elapsed, decisions = 0.0, set()
    while elapsed < 100.0:
        _, state, wait = step(SLEEPER, state, Measurement(elapsed, 2.5, 0.0), 2.0)
        elapsed += wait
        if state.moving == S_P:
            decisions.add(round(elapsed))
    assert len(decisions) >= 4


@given(
    z=st.lists(st.floats(-1.0, 100.0), min_size=1, max_size=30),
    reference=st.floats(0.0, 100.0),
)
def test_it_stays_within_its_limits(z, reference) -> None:
    p = SLEEPER
    state = initial(p, Measurement(0.0, z[0], 0.0), reference)
    for depth in z:
        u, state, wait = step(p, state, Measurement(0.0, depth, 0.0), reference)
        assert abs(u) <= 12.0
        assert p.volume_min <= state.volume_reference <= p.volume_max
        assert S_P <= wait <= p.longest


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30])
@pytest.mark.parametrize("field", ["depth", "volume"])
@pytest.mark.parametrize("first", [0, 300])
def test_it_recovers_when_the_sensor_does(value, field, first) -> None:
    """A minute without it, at the start or later: back in the band all the same."""
    ran, calls = by_hand(
        DEADBAND,
        SLEEPER,
        blind(first, first + 200, value, field),
        setpoints=[(0.0, 2.0)],
        start_depth=2.0,
        start_volume=PSI * 2.0 + 1e-6,
        duration=1200.0,
    )
    assert len(ran.time) == 4001
    assert np.all(np.isfinite(np.array(calls.states)))
    assert np.max(np.abs(ran.depth[ran.time > 600.0] - 2.0)) < SLEEPER.band
