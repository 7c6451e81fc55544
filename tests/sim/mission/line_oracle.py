"""The oil line of a pump by SciPy: its pressure as a state, eq. (1), with a check valve that gives.

The valve here is a steep orifice, open by what the line's pressure is above the sea's, so that
nothing is decided: no events, no modes. The depths are the flight's.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from swimbladder.sim.engine.rodas.records import Note

ATMOSPHERE, N = 101325.0, 1.4
OPENS = 1e-7  # m3/s/Pa: 12 Pa for the pump's rate


class Line:
    """A line of oil behind a pump of known delivery [m3/s] and power [W] over the head [Pa]."""

    def __init__(self, oil, delivery, power, *, reservoir=ATMOSPHERE, slip=0.0, ratio=1.0):
        self.oil, self.delivery, self.power = oil, delivery, power
        self.reservoir, self.slip, self.ratio = reservoir, slip, ratio

    def give(self, p):
        """V/beta_e of the oil at its absolute pressure [m3/Pa]."""
        gas = self.oil.volume * self.oil.trapped_air * (ATMOSPHERE / p) ** (1.0 / N)
        return (self.oil.volume - gas) / self.oil.bulk_modulus + gas / (N * p)

    def run(self, y, begin, end, sea, *, pumps, tolerance=1e-10):
        """Advance (ln p, volume through the valve [cm3], energy [J]) while the pump runs or not."""

        def slope(t, y):
            p = np.exp(np.clip(y[0], 9.0, 20.0))
            head = self.ratio * (p - self.reservoir)  # as the water has it
            out = OPENS * max(head + self.reservoir - sea(begin + t), 0.0)
            flow = self.delivery(head) if pumps else -self.slip * head
            rate = self.ratio * (flow - out) / (self.give(p) * p)
            return [rate, 1e6 * out, self.power(head) if pumps else 0.0]

        # Radau's Jacobian by differences may overflow, and its last step be of rounding: it goes on
        with np.errstate(over="ignore", divide="ignore"):
            found = solve_ivp(
                slope,
                (0.0, end - begin),
                y,
                method="Radau",
                rtol=tolerance,
                atol=[1e-12, 1e-9, 1e-8],
                first_step=min(1e-6, end - begin),
                max_step=max((end - begin) / 20.0, 1e-6),
            )
        assert found.success
        return found.y[:, -1]


def sea_of(flight):
    """Absolute pressure of the sea [Pa] at the times of a flight."""
    rows = flight.rows[np.concatenate(([True], np.diff(flight.rows["t"]) > 0.0))]
    depth = CubicHermiteSpline(rows["t"], rows["z"], rows["w"])
    c = flight.column
    pressure = CubicHermiteSpline(c.depth, c.pressure, c.density * c.gravity)
    return lambda t: ATMOSPHERE + float(pressure(max(float(depth(t)), 0.0)))


def runs_of(flight):
    """(begin, end) of each run of the pump [s]."""
    notes, found = flight.notes, []
    for k in np.flatnonzero(notes["what"] == Note.PUMP):
        over = notes[k + 1 :][notes["what"][k + 1 :] == Note.RUN_OVER][0]
        found.append((notes["t"][k], over["t"]))
    return found
