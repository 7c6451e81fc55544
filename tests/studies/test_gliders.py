"""A glider's speeds by water and hull: the balance by itself, then the measured dives."""

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from studies.gliders import HULLS, G, Glides, glider, main, read_glides, told, vertical_speed

RHO = np.array([1004.6, 1005.5, 1007.0])


def made(pressure, density, temperature, volume, pitch, yo=1):
    n = len(pressure)
    return Glides(
        np.full(n, float(yo)),
        np.asarray(pressure, float),
        np.asarray(density, float),
        np.asarray(temperature, float),
        np.full(n, volume),
        np.full(n, pitch),
        np.zeros(n),
    )


@pytest.mark.parametrize(("volume", "pitch"), [(230e-6, 0.45), (-230e-6, -0.44)])
def test_the_speed_balances_lift_drag_and_weight(volume, pitch):
    """Forces along and across, solved at once by MINPACK for U and the angle of attack."""
    glides = made([1e5, 2e5, 3e5], RHO, [16.0, 12.0, 6.0], volume, pitch)
    w = vertical_speed(glider(0.07, 1e-5, 69e-6), glides, 0.2)
    mass = 1005.0 * (0.07 + 1e-5)
    wing = 2.0 * math.pi * 7.0 / (2.0 + math.sqrt(49.0 / math.cos(math.radians(43.0)) ** 2 + 4.0))
    for k in range(3):
        size = 0.07 * (1.0 - 5e-10 * glides.pressure[k] + 69e-6 * (glides.temperature[k] - 15.0))
        net = G * (RHO[k] * (volume + size) - mass)

        def forces(x, net=net, k=k):
            speed, attack = x
            q = 0.05 * RHO[k] * speed**2
            drag = q * (0.2 + (wing**2 / (math.pi * 5.6) + 9.7) * attack**2)
            lift = q * (wing + 3.8) * attack
            glide = abs(pitch) + attack
            return [drag - abs(net) * math.sin(glide), lift - abs(net) * math.cos(glide)]

        speed, attack = fsolve(forces, [0.3, 0.05], xtol=1e-13)
        assert abs(w[k]) == pytest.approx(speed * math.sin(abs(pitch) + attack), rel=1e-9)
        assert np.sign(w[k]) == np.sign(net)


def test_a_made_up_glider_is_found_again():
    truth, random = glider(0.066, 2e-5, 30e-6), np.random.default_rng(4)
    parts = []
    for yo in range(1, 13):
        for volume, pitch in ((-230e-6, -0.44), (230e-6, 0.45)):
            z = np.linspace(8.0, 38.0, 12)
            rho, T = 1004.9 + 2.0 / (1.0 + np.exp((22.0 - z) / 4.0)), 15.0 - 0.25 * z
            part = made(9.9e3 * z, rho, T, volume, pitch, yo)
            speed = vertical_speed(truth, part, 0.22) + random.normal(0.0, 5e-3, len(z))
            parts.append(part._replace(speed=speed))
    glides = Glides(*(np.concatenate(values) for values in zip(*parts, strict=True)))
    t = told(glides, 30e-6, odd=True)
    assert t.volume[0] == pytest.approx(0.066, abs=4.0 * t.volume[1])
    assert t.trim[0] == pytest.approx(2e-5, abs=4.0 * t.trim[1])
    assert t.error == pytest.approx(5e-3, rel=0.15)
    assert t.error < 0.7 * t.uniform


@pytest.mark.data
@pytest.mark.parametrize("odd", [True, False])
def test_the_water_tells_the_speeds_of_the_other_yos(data_dir, odd):
    glides = read_glides(data_dir)
    assert len(glides.yo) > 350
    for expansion in HULLS.values():
        t = told(glides, expansion, odd=odd)
        assert t.error < 8e-3
        assert t.error < 0.65 * t.constant
        assert t.error < 0.7 * t.uniform
    # What is weighed this way is between a hull without heat and one of aluminium at once.
    cold, warm = (told(glides, expansion, odd=odd).volume[0] for expansion in HULLS.values())
    assert cold < 0.0697 < warm


@pytest.mark.data
def test_the_tables_are_printed(data_dir, capsys):
    main([str(data_dir)])
    said = capsys.readouterr().out
    assert said.count("aluminium") == 2
