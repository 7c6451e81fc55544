"""Wrapped laws: nothing wrong gives the law itself; a delay gives the exact sampled loop's."""

import numpy as np
import pytest

from swimbladder.control.law import leaf_names
from swimbladder.control.registry import LAWS, bind
from swimbladder.design.linear.models import linearise
from swimbladder.design.linear.sampled import BoundLaw, discretise
from swimbladder.design.stability.around import wrapped, wrapped_law
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import simulate_ensemble

FEUP = load_vehicle("feup-em")
P = plant(FEUP)
LAW, NUMBERS = bind(FEUP.controller)
H = 0.3
RUN = dict(count=2, setpoints=[(0.0, 2.002)], duration=30.0, start_depth=2.0, keep="trajectory")


def flown(numbers=NUMBERS, **wrong):
    form = wrapped(BoundLaw(LAW, numbers, H), rest=P.load_drive * 2.0, **wrong)
    return simulate_ensemble(FEUP, **form._asdict(), **RUN)


def test_every_law_of_the_registry_is_wrapped():
    for law in LAWS.values():
        form = wrapped_law(law)
        assert wrapped_law(law) is form
        assert form.parameters.__annotations__["law"] is law.parameters
        fields, own = leaf_names(form.parameters), leaf_names(law.parameters)
        assert fields[: len(own)] == own
        assert set(form.units) >= set(fields) - {"S_p"}


def test_nothing_wrong_is_the_law_itself():
    own = simulate_ensemble(FEUP, law=LAW, parameters=NUMBERS, sample_time=H, **RUN)
    assert np.array_equal(flown()["depth"], own["depth"])
    assert np.array_equal(flown()["command"], own["command"])


def test_a_gain_is_one_on_the_command():
    # The command of the paper's cascade is proportional to k_pV.
    double = NUMBERS._replace(k_pV=2.0 * NUMBERS.k_pV)
    own = simulate_ensemble(FEUP, law=LAW, parameters=double, sample_time=H, **RUN)
    assert flown(gain=2.0)["depth"].to_numpy() == pytest.approx(own["depth"].to_numpy(), abs=1e-12)


def test_a_late_command_is_that_of_the_sampled_plant_with_a_delay():
    seen = flown(late=True)
    model = discretise(linearise(P, depth=2.0), H, command_delay=0.5 * H)
    x = np.zeros(len(model.states))
    V0, z0, u0 = P.psi * 2.0 + P.V_0, 2.0, P.load_drive * 2.0
    state = None
    for k in range(40):
        z, V = model.C @ x
        assert seen["depth"].to_numpy()[2 * k, 0] == pytest.approx(z0 + z, abs=1e-9)
        measured = (k * H, z0 + z, V0 + V)
        from swimbladder.control.law import Measurement

        if state is None:
            state = LAW.initial(NUMBERS, Measurement(*measured), 2.002)
        u, state, _ = LAW.step(NUMBERS, state, Measurement(*measured), 2.002)
        assert abs(u) < P.supply
        assert seen["command"].to_numpy()[2 * k + 1, 0] == pytest.approx(u, abs=1e-6)
        x = model.A @ x + model.B[:, 0] * (u - u0)


def test_a_command_is_rounded():
    commands = flown(quantum=0.25)["command"].to_numpy() / 0.25
    assert np.array_equal(commands, np.round(commands))
    assert len(np.unique(commands)) > 3


def test_a_sleeping_law_sleeps_as_long_when_late():
    from swimbladder.control.deadband import DEADBAND
    from swimbladder.control.law import Measurement
    from tests.control.examples import SLEEPER

    def seen_at(t):  # a millimetre to and fro: each wake sees another depth
        return Measurement(t, 2.0 + 1e-3 * np.sin(0.37 * t), P.psi * 2.0)

    law, parameters, _ = wrapped(BoundLaw(DEADBAND, SLEEPER, H), late=True)
    seen = seen_at(0.0)
    state = law.initial(parameters, seen, 2.0)
    inner, waits = DEADBAND.initial(SLEEPER, seen, 2.0), []
    for k in range(900):
        now = seen_at(0.5 * H * k)
        before = state
        _, state, wait = law.step(parameters, state, now, 2.0)
        assert wait == 0.5 * H
        if state.law.voltage != before.law.voltage or k == 0:
            waits.append(0.5 * H * k)
    # Woken when it asked to be, each time.
    expected, t = [], 0.0
    while t < 0.5 * H * 900:
        expected.append(t)
        _, inner, wait = DEADBAND.step(SLEEPER, inner, seen_at(t), 2.0)
        t += np.ceil(wait / H - 1e-9) * H
    assert set(np.round(waits, 6)) <= set(np.round(expected, 6))
    assert len(waits) > 5
