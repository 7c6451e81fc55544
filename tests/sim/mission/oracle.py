"""A second simulator of missions: SciPy's DOP853 on its own right-hand side, from run to run.

What the processor did and when is taken from the engine's notes; how the vehicle moved is not.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.dynamics import drag_force
from swimbladder.physics.hull import hull_parts, layered_volume, neutral_volume
from swimbladder.sim.engine.rodas.records import Note

ML = 1e6  # volumes are counted in cm3


class Oracle:
    """One vehicle in one water; waves(z, t) [m, m/s] as `seawater.moved`."""

    def __init__(self, vehicle, column, waves=None):
        self.vehicle, self.waves = vehicle, waves
        drive = drive_map(vehicle, column.pressure, temperature=column.temperature)
        self.table = {
            name: _smooth(column.depth, values)
            for name, values in {
                "pressure": column.pressure,
                "neutral": neutral_volume(vehicle, column),
                "layers": layered_volume(vehicle, column),
                "out": drive.rate_out,
                "in": drive.rate_in,
                "bypass": drive.bypass_in,
                "leak": drive.leakage,
                "short": drive.start_volume,
                "temperature": column.temperature,
            }.items()
        }
        self.slope = self.table["pressure"].derivative()
        self.lag = vehicle.hull.thermal_time_constant
        self.grows = sum(p.volume * p.thermal_expansion for p in hull_parts(vehicle))
        self.surface_weight = column.density[0] * column.gravity

    def at(self, name, z):
        """Value of a table; straight beyond the surface where the sea is looked at."""
        f = self.table[name]
        if z >= 0.0:
            return float(f(z))
        if name in ("pressure", "neutral", "layers"):
            return float(f(0.0) + f.derivative()(0.0) * z)
        return float(f(0.0))

    def rhs(self, what):
        hull, m = self.vehicle.hull, self.vehicle.mass

        def f(t, y):
            z, w, v = y[0], y[1], y[2] / ML
            way, u = (0.0, 0.0) if self.waves is None else self.waves(z, t)
            neutral = self.at("neutral", z)
            neutral += self.at("layers", max(z - way, min(z, 0.0))) - self.at("layers", z)
            warms = 0.0
            if self.lag > 0.0:
                colder = self.at("temperature", max(z - way, 0.0)) - y[3]
                neutral += self.grows * colder
                warms = colder / self.lag
            push = float(self.slope(max(z, 0.0))) * (neutral - v)
            emerged = max(hull.emergence_depth - z, 0.0)
            push += self.surface_weight * hull.waterplane_area * emerged
            if what == "nothing":
                rate = -self.at("leak", z) if v > self.vehicle.stroke.minimum else 0.0
            elif what == "priming":
                rate = 0.0
            else:
                rate = self.at(what, z) * (1.0 if what == "out" else -1.0)
            return [w + u, (push - drag_force(self.vehicle.drag, w)) / m, rate * ML, warms]

        return f

    def advance(self, y, t, end, what):
        """Return the state at `end`, crossing the surface at located instants."""
        top = self.vehicle.hull.emergence_depth

        def crosses(_, y):
            return y[0] - top

        crosses.terminal = True
        while t < end:
            found = solve_ivp(
                self.rhs(what),
                (t, end),
                y,
                method="DOP853",
                rtol=1e-10,
                atol=[1e-10, 1e-11, 1e-8, 1e-9],
                events=crosses,
            )
            assert found.success, found.message
            y, t = found.y[:, -1].copy(), float(found.t[-1])
            if found.status == 1:
                self.crossings.append(t)
                y[0] = top + math.copysign(1e-12, y[1])
        return y

    def replay(self, flight):
        """Return the states [k, 3] (m, m/s, m3) at the engine's notes, from its start on."""
        self.crossings = []
        begin = flight.begin
        y = np.array([begin["z"], begin["w"], begin["v"] * ML, begin["hull"]])
        t, what, states = 0.0, "nothing", []
        primed = math.inf
        for note in flight.notes:
            when, kind = float(note["t"]), Note(int(note["what"]))
            if t < primed < when:
                y, t, what = self.advance(y, t, primed, what), primed, "out"
            y, t = self.advance(y, t, when, what), when
            if kind is Note.PUMP:
                short = self.at("short", y[0])
                primed = t + short / self.at("out", y[0]) if short > 0.0 else -1.0
                what = "priming" if short > 0.0 else "out"
            elif kind in (Note.VALVE, Note.BYPASS):
                what = "in" if kind is Note.VALVE else "bypass"
            elif kind is Note.RUN_OVER:
                what, primed = "nothing", math.inf
            states.append((y[0], y[1], y[2] / ML))
        return np.array(states)


def _smooth(depth, values):
    """The cubic through values with the slopes that never overshoot, as the package has it."""
    slopes = PchipInterpolator(depth, values).derivative()(depth)
    return CubicHermiteSpline(depth, values, slopes)
