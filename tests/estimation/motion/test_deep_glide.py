"""Motion under a constant force and quadratic drag: against SciPy, and its slopes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swimbladder.estimation.motion.deep_filter import Resistance, glide

MASS = 28.0


def drawn(count: int):
    """Yield speed, force, drag sinking and rising, time: along the force, against it, turning."""
    rng = np.random.default_rng(4)
    for _ in range(count):
        down = 10.0 ** rng.uniform(1.0, 2.3)
        force = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 0.0)
        yield 0.1 * rng.normal(), force, down, 0.7 * down, rng.uniform(1.0, 60.0)


def test_speed_and_way_are_those_of_scipy() -> None:
    turned = 0
    for w, force, down, up, t in drawn(60):

        def motion(_, y, force=force, down=down, up=up):
            k = down if y[1] > 0.0 else up
            return [y[1], (force - k * y[1] * abs(y[1])) / MASS]

        exact = solve_ivp(motion, (0.0, t), [0.0, w], rtol=1e-10, atol=1e-13).y[:, -1]
        found = glide(w, force, Resistance(MASS, down, up), t)
        assert found[0] == pytest.approx(exact[1], abs=1e-7)
        assert found[1] == pytest.approx(exact[0], abs=1e-6)
        turned += w * exact[1] < 0.0
    assert turned > 5


def test_slopes_are_those_of_small_changes() -> None:
    for w, force, down, up, t in drawn(60):
        body = Resistance(MASS, down, up)
        found = glide(w, force, body, t)
        h, f = 1e-6, 1e-5 * abs(force)
        more, less = (glide(w + s * h, force, body, t) for s in (1.0, -1.0))
        pushed, pulled = (glide(w, force + s * f, body, t) for s in (1.0, -1.0))
        for place, by_w, by_f in ((0, 2, 3), (1, 4, 5)):
            slope = (more[place] - less[place]) / (2.0 * h)
            assert found[by_w] == pytest.approx(slope, rel=1e-4, abs=1e-6 * t)
            slope = (pushed[place] - pulled[place]) / (2.0 * f)
            assert found[by_f] == pytest.approx(slope, rel=1e-4, abs=1e-6)


def test_it_ends_at_the_steady_speed() -> None:
    """F = k w^2."""
    assert glide(0.0, 0.4, Resistance(MASS, 40.0, 10.0), 1e5)[0] == pytest.approx(0.1)
    assert glide(0.3, -0.4, Resistance(MASS, 40.0, 10.0), 1e5)[0] == pytest.approx(-0.2)
