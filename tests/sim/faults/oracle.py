"""A vehicle in which things fail, once more: slow, plain, and sharing no code with `faults`.

The plant is that of `tests.oracle`: the paper's motor torques and forces, integrated by DOP853 at
1e-12 with its events found on the dense output. What fails is written here from the catalogue in
docs/how-to/faults.md: parts of that machine change, water comes in, a sensor says something else.
The machine is driven by the commands that a flight recorded, so that a law's bits do not matter.
"""

import copy
import math
from enum import IntEnum

import numpy as np

from swimbladder.sim.faults.kinds import FAULTS
from tests.oracle import C, Machine, Oracle

COMPARED = ("depth", "speed", "volume", "applied", "battery", "water")
Fault = IntEnum("Fault", list(FAULTS))
NOT_MOVING = 1e-15  # share of the speed; not 0, as loads are divided by k_u


class Drawn(Machine):
    """A machine of the numbers that a mission drew, in units that make k_u = k_v = 1."""

    def __init__(self, plant, vehicle):
        super().__init__(vehicle, plant.z_bottom)
        p = self.drawn = plant
        self.positioner, self.rate = p.positioner > 0.0, p.rate
        self.lam, self.k_u, self.k_v, self.k_q = p.T1, 1.0, 1.0, p.gain
        self.k_z, self.k_z_back, self.T_b, self.k_l = p.load_drive, p.load_back, p.friction, p.k_l
        self.E, self.R_b = p.supply, p.sag
        self.R, self.k_emf = (1.0, p.kappa * p.gain) if p.kappa > 0.0 else (math.inf, 0.0)
        self.m, self.rho_g, self.psi, self.V_0 = 1.0, p.a_b, p.psi, p.V_0
        self.V_min, self.V_max = p.V_min, p.V_max
        self.z_s, self.A_w, self.z_air = p.z_surface, p.a_s / p.a_b, p.z_air
        self.eps = p.epsilon if math.isfinite(p.epsilon) else 0.0
        self.one_way = self.k_z != self.k_z_back or self.T_b != 0.0

    def drag(self, w):
        p, s = self.drawn, abs(w)
        if s <= p.epsilon:
            return p.d_l * w
        return math.copysign(p.d_b * s + p.d_0 + p.d_t * s * s, w)


class Layered(Machine):
    """A machine in layered water: heavier by what that adds, pressure and loads `share` times."""

    def __init__(self, vehicle, added, share, bottom=math.inf):
        super().__init__(vehicle, bottom)
        self.added, own = added, self.rho_g
        self.rho_g, self.k_z, self.k_z_back, self.k_l = (
            share * x for x in (own, self.k_z, self.k_z_back, self.k_l)
        )

    def weight(self, V, z):
        return super().weight(V, z) + self.rho_g * self.added(z)


class Faulty:
    """A machine under faults (kind, severity, second one, first tick, tick of the end)."""

    def __init__(
        self,
        machine,
        vehicle,
        fault_rows,
        *,
        tick,
        depth,
        volume,
        speed=0.0,
        drift=0.0,
        swell=0.0,
        swell_omega=1.0,
        swell_phase=0.0,
        gravity=9.80665,
        first=0,
    ):
        self.healthy, self.fault_rows, self.tick, self.first = machine, fault_rows, tick, first
        self.drift, self.stroke = drift, vehicle.stroke
        self.swell = swell, swell_omega, swell_phase, gravity
        self.oracle = Oracle(vehicle, depth=depth, volume=volume, speed=speed)
        self.oracle.m = copy.copy(machine)
        if machine.one_way:
            self.oracle.mode.turn = 0
        self.applied = volume if machine.positioner else 0.0
        self.way = 0.0  # in which the driver last was on
        self.flows = 1.0  # which way the flow through a port was last driven
        self.stops = {}  # what blocks the actuator, by fault: found where it begins

    def on(self, kind, k):
        """Yield (severity, second one, seconds since it began) of the faults of a kind."""
        for fault, first, second, begin, end in self.fault_rows:
            if fault == kind and begin <= k < end:
                yield first, second, (k - begin) * self.tick

    def heavier(self, k):
        """Return (water that came in, all the volume that is lost) [m3] at tick k."""
        leaks = (Fault.LEAK_SMALL, Fault.LEAK_LARGE)
        water = sum(rate * since for kind in leaks for rate, _, since in self.on(kind, k))
        t, z = k * self.tick, self.oracle.state[2]
        swell, omega, phase, g = self.swell
        wavenumber = omega**2 / g  # of waves in deep water
        pull = swell * math.exp(-wavenumber * max(z, 0.0)) * math.cos(omega * t + phase)
        return water, water + self.drift * t + pull

    def machine(self, k):
        """Return the machine at tick k."""
        m, o = copy.copy(self.healthy), self.oracle
        speed = math.prod([first for first, _, _ in self.on(Fault.SLOW, k)])
        if any(self.on(Fault.STALLED, k)):
            speed = NOT_MOVING
        m.rate *= speed
        m.k_u, m.T_b = m.k_u * speed, m.T_b * speed
        load = speed * math.prod([first for first, _, _ in self.on(Fault.WEAK, k)])
        m.k_z, m.k_z_back = m.k_z * load, m.k_z_back * load
        for share, _, _ in self.on(Fault.BATTERY_SAG, k):
            if not m.k_emf > 0.0:  # nothing is known of it: all that grows with speed counts as it
                m.R, m.k_emf = 1.0, self.healthy.k_v / self.healthy.k_u
            m.R_b = max(m.R_b, share * m.R)
        length = m.V_max - m.V_min
        m.k_l += length * sum(first for first, _, _ in self.on(Fault.CREEP, k))
        m.V_0 += length * sum(first for first, _, _ in self.on(Fault.WEIGHT, k))
        stroke, V = m.V_max - m.V_min, o.state[1]
        for n, (fault, first, _, begin, _) in enumerate(self.fault_rows):
            if fault in (Fault.BLOCKED_OUT, Fault.BLOCKED_IN) and k >= begin:
                sign = 1.0 if fault == Fault.BLOCKED_OUT else -1.0
                self.stops.setdefault(n, (sign, V + sign * first * stroke))
        m.V_max = min([m.V_max] + [stop for sign, stop in self.stops.values() if sign > 0.0])
        m.V_min = max([m.V_min] + [stop for sign, stop in self.stops.values() if sign < 0.0])
        m.E *= self.charge(k)
        return m

    def throttle(self, m, k):
        """Let the ports take what the driver drives: slower, and out under a larger load."""
        healthy, (_, V, z, _) = self.healthy, self.oracle.state
        if m.positioner:
            way = self.applied - V
            drives = abs(way) > 1e-12 * (healthy.V_max - healthy.V_min)
        else:
            way = self.applied - healthy.k_z * z / healthy.k_u
            drives = abs(way) > 0.01 * healthy.E
        if drives:
            self.flows = math.copysign(1.0, way)
        outward = self.flows > 0.0
        kinds = Fault.PORT_CLOGGED, Fault.PORT_OUT if outward else Fault.PORT_IN
        share = math.prod([first for kind in kinds for first, _, _ in self.on(kind, k)])
        load = share * (2.0 - share) if outward else share
        m.rate, m.k_u, m.T_b = m.rate * share, m.k_u * share, m.T_b * share
        m.k_z, m.k_z_back = m.k_z * load, m.k_z_back * load

    def charge(self, k):
        """Return the battery's open-circuit voltage as a share of the healthy one."""
        shares = [1.0 - rate * since for rate, _, since in self.on(Fault.BATTERY_DECLINE, k)]
        shares += [1.0 - since / life for life, _, since in self.on(Fault.BATTERY_DEAD, k)]
        shares += [1.0 - loss for loss, _, _ in self.on(Fault.BATTERY_DROP, k)]
        if abs(self.applied) > 0.05 * self.healthy.E:
            shares += [1.0 - loss for loss, _, _ in self.on(Fault.BATTERY_CELL, k)]
        return math.prod([max(share, 0.0) for share in shares])

    def terminals(self, m):
        """Return the battery's voltage [V] at its terminals, by Kirchhoff.

        The driver asks a source behind R_b for as much as the motor got a tick ago.
        """
        if m.positioner:
            return math.nan
        u = max(-m.E, min(m.E, self.applied))
        along = math.copysign(1.0, u)
        current = max(abs(u) - along * m.k_emf * self.oracle.state[0] / m.k_q, 0.0)
        return m.E - m.R_b * current / (m.R + m.R_b) if m.R_b > 0.0 else m.E

    def driver(self, m, k, command):
        """Return what the actuator gets [V or m3]."""
        position = self.oracle.state[1]
        way = self.applied - (position if m.positioner else 0.0)
        if abs(way) > 1e-15:
            self.way = math.copysign(1.0, way)
        u = command
        for fault, first, _, begin, end in self.fault_rows:  # one upon the other, in their order
            if not begin <= k < end:
                continue
            if fault == Fault.REVERSED:
                u = -u
            elif fault == Fault.RUNS_ON and (k - begin) * self.tick < first:
                ends = (self.healthy.V_min, self.healthy.V_max) if m.positioner else (-m.E, m.E)
                u = ends[1] if self.way > 0.0 else ends[0]
        low, high = (self.healthy.V_min, self.healthy.V_max) if m.positioner else (-m.E, m.E)
        u = max(low, min(high, u))
        return 0.0 if self.pressed(u, k) else u

    def pressed(self, u, k):
        """Return whether a limit switch cuts the voltage that a motor would get."""
        if self.stroke.switch_margin is None or u == 0.0:
            return False
        outer, V = u > 0.0, self.oracle.state[1]
        if any((side >= 0.5) == outer for side, _, _ in self.on(Fault.SWITCH_OPEN, k)):
            return True
        if any((side >= 0.5) == outer for side, _, _ in self.on(Fault.SWITCH_CLOSED, k)):
            return False
        margin = self.stroke.switch_margin
        beyond = V - self.stroke.maximum if outer else self.stroke.minimum - V
        return beyond >= -margin

    def step(self, k, command, wait):
        """Return a row of COMPARED at tick k, and advance by a tick with the board's command."""
        o = self.oracle
        water, lost = self.heavier(k)
        m = o.m = self.machine(k)
        m.lost = lost
        battery = self.terminals(m)
        self.applied = self.driver(m, k, command)
        self.throttle(m, k)
        _, V, z, w = o.state
        row = (z, w, V, self.applied, battery, water)
        if wait:
            o.t = k * self.tick
            o.hold(self.applied, self.tick)
        return row

    def place(self, depth, speed, volume):
        """Put the vehicle where a flight had it; the motor keeps its speed."""
        self.oracle.y[1:4] = volume * C, depth, speed


def follow(faulty, flown, *, ticks=None, settle=0):
    """Return the oracle's columns by name for the commands of a flight, from its first tick on.

    settle: ticks in which it is put where the flight has it: then its motor turns as that does.
    """
    first = faulty.first
    end = len(flown["command"]) if ticks is None else first + ticks
    rows = []
    for k in range(first, end):
        if k - first <= settle and k > first:
            faulty.place(*(flown[name][k] for name in ("depth", "speed", "volume")))
        rows.append(faulty.step(k, flown["command"][k], k < end - 1))
    return dict(zip(COMPARED, np.array(rows).T, strict=True))
