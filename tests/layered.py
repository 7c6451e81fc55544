"""A float in water with a halocline, its logs from SciPy alone, for tests of casts."""

import numpy as np
from scipy.integrate import solve_ivp

from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import Log
from swimbladder.physics.seawater import Column

G, SEA, FRESHER = 9.80665, 1025.0, 1019.0  # m/s2, kg/m3 below and above the halocline
MIDDLE, WIDTH = 1.2, 0.25  # m
STEP = 0.05  # m


def vehicle():
    """The small float of the preset, trimmed for the sea, with laminar drag alone."""
    base = load_vehicle("ntnu-bv")
    drag = type(base.drag)(law="linear", k_dl=1.6)
    return base.model_copy(
        update={
            "water": base.water.model_copy(update={"density": SEA}),
            "motion": base.motion.model_copy(update={"drag": drag}),
            "trim_error": -8e-6,
        }
    )


def density(z):
    return FRESHER + 0.5 * (SEA - FRESHER) * (1.0 + np.tanh((np.asarray(z) - MIDDLE) / WIDTH))


def column(deepest=8.0):
    depth = np.arange(0.0, deepest + 1e-9, STEP)
    return Column(
        depth=depth,
        pressure=SEA * G * depth,
        density=density(depth),
        temperature=np.full_like(depth, 8.0),
        gravity=G,
        source="halocline",
        compressibility=load_vehicle("ntnu-bv").water.compressibility,
    )


def mean_density(z, height):
    """Over a hull from z down: the integral of tanh is the logarithm of cosh."""

    def integral(x):
        return FRESHER * x + 0.5 * (SEA - FRESHER) * (
            x + WIDTH * np.log(np.cosh((x - MIDDLE) / WIDTH))
        )

    return (integral(z + height) - integral(z)) / height


def added(z, v):
    """What the water adds to the neutral volume: the weight carried by thinner water."""
    weight = SEA * (v.hull.displaced_volume + v.trim_error)
    return weight / mean_density(z, v.hull.height) - weight / SEA


PUSHES = (8.0, 25.0, 2.0, -5.0, 4.0, 18.0, -6.0, 1.0)  # cm3 lighter than neutral below, 25 s each


def sailed(v, *, seed=1, noise=3e-3, error=0.0, drift=0.0, pushes=PUSHES, start=3.0):
    """Return the log of a float that goes up into the halocline and down again."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 25.0 * len(pushes), 0.5)
    wanted = np.repeat(pushes, 50)[: len(time)] * 1e-6
    volume = v.trim_error + np.convolve(np.pad(wanted, 7, "edge"), np.full(15, 1 / 15), "valid")
    k_dl, m, psi = v.drag.k_dl, v.mass, v.hull.psi

    def rate(t, x):
        V = np.interp(t, time, volume)
        rest = v.trim_error + error + drift * t + psi * x[0] + added(x[0], v)
        return [x[1], (SEA * G * (rest - V) - k_dl * x[1]) / m]

    found = solve_ivp(
        rate,
        (0.0, time[-1]),
        [start, 0.0],
        t_eval=time,
        method="DOP853",
        rtol=1e-10,
        atol=1e-12,
        max_step=0.5,
    )
    depth = found.y[0]
    assert 0.3 < depth.min() < 1.3
    assert depth.max() < 7.5
    return Log(
        source=f"sailed {seed}",
        time=time,
        depth=depth + noise * rng.normal(size=len(time)),
        volume=volume,
        volume_absolute=True,
        line=np.arange(len(time)),
    )


COLUMN_HEADER = "pressure [dbar],salinity,temperature [degC]"


def cast_rows(deepest=8.5):
    """Return the rows of a cast that has `density`, as text."""
    import gsw

    pressure = np.arange(0.1, deepest, 0.1)
    SA = gsw.SA_from_rho(density(pressure * 1e4 / (SEA * G)), 8.0, 0.0 * pressure)
    values = zip(pressure, gsw.SP_from_SR(SA), gsw.t_from_CT(SA, 8.0, pressure), strict=True)
    return [f"{p:.2f},{s:.5f},{t:.5f}" for p, s, t in values]
