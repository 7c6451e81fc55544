"""Gains from what a law is tuned with: poles of the loop, and numbers that are the vehicle's."""

import numpy as np
import pytest
from scipy.integrate import quad

from swimbladder.control.law import Measurement, TuningParameters, leaf_names, numbers
from swimbladder.control.motion import drift_time
from swimbladder.control.registry import LAWS
from swimbladder.design.tuning.gains import gains, setting_of
from swimbladder.io.config import load_vehicle

H, SUPPLY = 0.4, 10.8
VEHICLE = load_vehicle("feup-em")
SETTING = setting_of(VEHICLE, sample_time=H, supply=SUPPLY, neutral_range=20e-6)
KNOBS = TuningParameters(
    0.15, 0.7, 1.1, learning=0.1, share=0.7, dead=2e-6, pause=12.0, band=0.02, volts=0.8
)
SAMPLED = [name for name, law in LAWS.items() if law.recipe and law.command == "voltage"]


@pytest.mark.parametrize("psi", [-1e-6, 0.0, 2.5e-6])
@pytest.mark.parametrize("damping", [0.5, 0.7, 1.3])
def test_the_cascade_places_its_poles(damping, psi):
    """With V = U: z'' = a (psi z - U) - d z', U = k_pz e + k_dz e' + k_iz times the integral."""
    setting = SETTING._replace(plant=SETTING.plant._replace(psi=psi))
    d, a = setting.plant.d_l, setting.plant.a_b
    g = gains("cascade", setting, KNOBS._replace(damping=damping))
    loop = [1.0, d - a * g.k_dz, -a * (psi + g.k_pz), -a * g.k_iz]
    w = KNOBS.frequency
    asked = [*np.roots([1.0, 2.0 * damping * w, w * w]), -0.4 * w]
    np.testing.assert_allclose(np.poly(np.roots(loop)), np.poly(asked), rtol=1e-9)
    assert g.k_pV * setting.plant.gain == pytest.approx(KNOBS.inner, rel=1e-12)  # V' = gain u


@pytest.mark.parametrize("name", SAMPLED)
def test_what_is_the_vehicles_stands_in_every_law(name):
    """Under other names of the same thing no law may have another number."""
    p = SETTING.plant
    parameters = gains(name, SETTING, KNOBS)
    found = dict(zip(leaf_names(type(parameters)), numbers(parameters), strict=True))
    known = {
        "S_p": H,
        "psi": p.psi,
        "V_min": p.V_min,
        "V_max": p.V_max,
        "volume_min": p.V_min,
        "volume_max": p.V_max,
        "rate_per_volt": p.gain,
        "depth_voltage": p.load_drive,
        "voltage_limit": KNOBS.volts * SUPPLY,
        "k_pV": KNOBS.inner / p.gain,
        "drag": p.d_l,
        "laminar": p.d_l,
        "quadratic": p.d_t,
        "inertia": 1.0 / p.a_b,
        "volume_per_acceleration": 1.0 / p.a_b,
        "K2": p.a_b / p.d_l,
        "T2": 1.0 / p.d_l,
        "share": KNOBS.share,
        "depth_noise": SETTING.noise,
    }
    shared = found.keys() & known.keys()
    assert "S_p" in shared
    for field in shared:
        assert found[field] == pytest.approx(known[field], rel=1e-9), field


BALANCED = [name for name in SAMPLED if LAWS[name].roundings]


@pytest.mark.parametrize("name", BALANCED)
def test_dry_friction_is_balanced_and_the_law_thinks_as_without(name):
    """0.5 V, and a screw that the sea does not push in, beside a motor without either."""
    law, p = LAWS[name], SETTING.plant
    rough = SETTING._replace(plant=p._replace(friction=0.5, load_back=0.0))
    plain, balanced = (
        gains(name, s, KNOBS._replace(dead=0.0, pause=0.0)) for s in (SETTING, rough)
    )
    rng = np.random.default_rng(1)
    seen = Measurement(0.0, 2.0, p.psi * 2.0)
    states = [law.initial(one, seen, 2.0) for one in (plain, balanced)]
    ways = set()
    for n in range(60):
        depth, volume = 2.0 + rng.normal(0.0, 2e-3), p.psi * 2.0 + rng.normal(0.0, 1e-6)
        seen = Measurement(n * H, depth, volume)
        given = [
            law.step(own, s, seen, 2.0) for own, s in zip((plain, balanced), states, strict=True)
        ]
        (u, before, _), (v, after, _) = given
        states = [before, after]
        np.testing.assert_allclose([*numbers(after)], [*numbers(before)], rtol=1e-9, atol=1e-12)
        load = p.load_drive * 2.0
        ways.add(np.sign(round(v - u, 9)))
        wanted = 0.0 if v == u else 0.9 * (0.5 if v > u else -0.5 - load)
        assert v - u == pytest.approx(wanted, abs=1e-3)  # by the depth that the law estimates
    assert ways >= {-1.0, 1.0}
    assert BALANCED == ["sea-cascade", "adrc", "observer", "pulse", "planned"]


def test_the_sleeper_acts_on_a_speed_that_crosses_its_band_in_an_interval():
    own = gains("deadband", SETTING, KNOBS)
    assert own.interval == pytest.approx(KNOBS.pause, rel=1e-12)
    assert own.speed_band == pytest.approx(KNOBS.band / KNOBS.pause, rel=1e-12)


def test_a_walk_of_the_neutral_volume_takes_it_off_in_the_time_that_is_said():
    """Each step of the walk accelerates from then on: (t - s)^2/2 of its way, added in squares."""
    p, distance, walk = SETTING.plant, 0.03, 2e-8
    t = drift_time(p, distance, walk)
    share = quad(lambda s: (0.5 * (t - s) ** 2) ** 2, 0.0, t)[0]
    assert p.a_b * walk * np.sqrt(20.0 * share) == pytest.approx(distance, rel=1e-9)


def test_the_filter_is_as_fast_as_it_is_asked_to_be():
    """Kalman and Bucy: speed changed by white noise, without drag and psi: poles of that bandwidth.

    Gains sqrt(2) w on the depth and w^2 on the speed, in continuous time.
    """
    h, w = 1e-3, KNOBS.frequency * KNOBS.sharpness
    plant = SETTING.plant._replace(psi=0.0, d_l=1e-6)
    own = gains(
        "observer",
        SETTING._replace(plant=plant, sample_time=h),
        KNOBS._replace(learning=1e-6, pause=12.0),
    )
    found = dict(zip(leaf_names(type(own)), numbers(own), strict=True))
    assert found["l_z"] / h == pytest.approx(np.sqrt(2.0) * w, rel=0.01)
    assert found["l_w"] / h == pytest.approx(w * w, rel=0.01)
