"""An independent simulator to judge the engine by: slow, plain, and sharing no code with it.

Equations (11)-(16) and (31) are written again from the paper in motor torques and forces, and are
integrated by SciPy's DOP853 at 1e-12; what happens in between (end stops, surface, bottom, the
motor's direction, the supply's limit) is found on the dense output by root finding.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from swimbladder.vehicle import (
    ElectrohydraulicActuator,
    ElectromechanicalActuator,
    IdentifiedActuator,
    IdentifiedMotion,
    Positioner,
    UnifiedActuator,
    Vehicle,
)

C = 1e6  # volumes are integrated in cm3
_AT_ONCE = ("left the bottom", "left the upper end stop", "pump turns", "drives", "driven back")


@dataclass
class Machine:
    """Motor, transmission, hull and water in the paper's own quantities."""

    vehicle: Vehicle
    bottom: float = math.inf
    positioner: bool = False
    rate: float = 0.0  # m3/s
    lam: float = 1.0  # kg m2
    k_u: float = 1.0  # N m/V
    k_v: float = 1.0  # N m s/rad
    k_q: float = 1.0  # m3/rad
    k_z: float = 0.0  # N m/m, driving
    k_z_back: float = 0.0
    T_b: float = 0.0  # N m
    k_l: float = 0.0
    R: float = math.inf
    k_emf: float = 0.0
    E: float = math.inf
    R_b: float = 0.0
    lost: float = 0.0  # m3, by which the vehicle is heavier than its volume says: water, swell

    def __post_init__(self) -> None:
        v = self.vehicle
        a = v.actuator
        rho_g = v.water.density * v.water.gravity
        eta, literal = None, False
        if isinstance(a, Positioner):
            self.positioner, self.rate = True, a.speed * a.piston_area
        elif isinstance(a, IdentifiedActuator):
            self.k_v, self.lam = 1.0, a.T1
            self.k_q = a.K1 * a.piston_area
            self.k_z, self.k_l = a.depth_voltage, a.k_l
        elif isinstance(a, UnifiedActuator):
            self.lam, self.k_u, self.k_v, self.k_q = a.inertia, a.k_u, a.k_v, a.k_q
            self.k_z, self.k_l, self.T_b = a.k_z, a.k_l, a.friction_torque
            eta, literal = a.efficiency, a.literal_efficiency
            if a.resistance is not None and a.emf_constant is not None:
                self.R, self.k_emf = a.resistance, a.emf_constant
        else:
            motor, literal = a.motor, a.literal_efficiency
            k_emf = motor.torque_constant if motor.emf_constant is None else motor.emf_constant
            self.R, self.k_emf, self.T_b = motor.resistance, k_emf, motor.friction_torque
            self.k_u = motor.torque_constant / motor.resistance
            self.k_v = (
                motor.viscous_friction
                + k_emf * motor.torque_constant / motor.resistance
                + a.drive.viscous_friction
            )
            self.lam = motor.rotor_inertia + a.drive.reflected_inertia
            if isinstance(a, ElectromechanicalActuator):
                eta = a.drive.efficiency
                pitch = a.drive.lead / a.drive.gear_ratio
                self.k_q = a.drive.piston_area * pitch / (2.0 * math.pi)
            else:
                assert isinstance(a, ElectrohydraulicActuator)
                eta, n_h = a.drive.pump_efficiency, a.drive.area_ratio
                self.k_q = a.drive.pump_displacement / (2.0 * math.pi * n_h)
                self.k_l = a.drive.pump_leakage * rho_g / n_h**2
            self.k_z = rho_g * self.k_q / eta
        self.k_z_back = self.k_z if eta is None or literal else self.k_z * eta**2
        if v.supply is not None:
            self.E, self.R_b = v.supply.voltage, v.supply.internal_resistance
        self.rho_g = rho_g
        if isinstance(v.motion, IdentifiedMotion):
            self.k_dl = rho_g / v.motion.K2
            self.m, self.drag_law = v.motion.T2 * self.k_dl, "linear"
            self.k_dt = self.eps = 0.0
        else:
            d = v.motion.drag
            self.m = v.motion.dry_mass + v.motion.entrained_mass + v.motion.added_mass
            self.drag_law, self.k_dl, self.k_dt, self.eps = d.law, d.k_dl, d.k_dt, d.epsilon
        self.psi, self.V_0 = v.hull.psi, v.trim_error
        self.V_min, self.V_max = v.stroke.minimum, v.stroke.maximum
        self.z_s, self.A_w = v.hull.emergence_depth, v.hull.waterplane_area
        self.z_air = self.z_s - v.hull.height
        self.one_way = self.k_z != self.k_z_back or self.T_b != 0.0

    def drag(self, w: float) -> float:
        """Drag force [N], eq. (16), opposing w."""
        s = abs(w)
        if self.drag_law == "linear":
            return self.k_dl * w
        if self.drag_law == "quadratic":
            return self.k_dt * w * s
        if self.drag_law == "blended":
            return self.k_dl * w + self.k_dt * w * s
        if s <= self.eps:
            return self.k_dl * w
        jump = self.k_dl * self.eps - self.k_dt * self.eps**2 if self.drag_law == "switched" else 0
        return math.copysign(self.k_dt * s * s + jump, w)

    def weight(self, V: float, z: float) -> float:
        """Net force downwards but for drag [N], eqs (13), (15), (31) and the emerged hull."""
        emerged = self.rho_g * self.A_w * max(self.z_s - z, 0.0)
        return self.rho_g * (self.psi * z + self.V_0 + self.lost - V) + emerged

    def full_duty(self, omega: float, sign: float) -> float:
        """|u| [V] at the motor with the battery switched right through, at most E."""
        if self.R_b == 0.0:
            return self.E
        u = (self.R * self.E + self.R_b * self.k_emf * omega * sign) / (self.R + self.R_b)
        return min(u, self.E)

    def voltage(self, u: float, omega: float) -> float:
        """Voltage at the motor [V] when u is asked for."""
        sign = math.copysign(1.0, u)
        return sign * min(self.full_duty(omega, sign), abs(u))


@dataclass
class Mode:
    turn: int = 1  # of the motor: 1 driving (or both ways alike), -1 driven back, 0 stuck
    stop: str = ""  # "", "upper", "lower", "lower, pump turning"
    ground: bool = False


@dataclass
class Run:
    time: list[float] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)  # z, w, V, q, command
    events: list[tuple[float, str]] = field(default_factory=list)
    why: str = "finished"
    source: float = 0.0  # J, of u i
    drag: float = 0.0  # J
    hydraulic: float = 0.0  # J, rho g z q

    def __getattr__(self, name: str) -> np.ndarray:
        columns = ("depth", "speed", "volume", "motor_rate", "command")
        if name not in columns:
            raise AttributeError(name)
        return np.array([row[columns.index(name)] for row in self.rows])

    def times(self, kind: str) -> list[float]:
        return [t for t, k in self.events if k == kind]


class Oracle:
    """One vehicle; `hold` advances it with the input held."""

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        depth: float,
        volume: float | None = None,
        speed: float = 0.0,
        bottom: float = math.inf,
        rtol: float = 1e-12,
    ) -> None:
        self.m = m = Machine(vehicle, bottom)
        volume = m.psi * depth + m.V_0 if volume is None else volume
        self.y = np.array([0.0, volume * C, depth, speed, 0.0, 0.0, 0.0])
        self.t = 0.0
        self.mode = Mode()
        self.run = Run()
        self.rtol = rtol
        self.ramp: float | None = None  # m3/s, of a prescribed volume
        if depth >= bottom and speed >= 0.0 and m.weight(volume, depth) >= 0.0:
            self.mode.ground = True
            self.y[3] = 0.0
        if m.one_way:
            self.mode.turn = 0

    @property
    def state(self) -> tuple[float, float, float, float]:
        """(q, V, z, w) in SI."""
        return self.y[0] / C, self.y[1] / C, float(self.y[2]), float(self.y[3])

    # -- the right-hand side ---------------------------------------------------------------------
    def _rhs(self, u: float) -> Callable[[float, np.ndarray], np.ndarray]:
        m, mode = self.m, self.mode

        def f(_t: float, y: np.ndarray) -> np.ndarray:
            q, V, z, w = y[0] / C, y[1] / C, y[2], y[3]
            omega = q / m.k_q
            dq = dV = 0.0
            power = 0.0
            if self.ramp is not None:
                dV = self.ramp
            elif m.positioner:
                dV = mode.turn * m.rate
            else:
                volts = m.voltage(u, omega)
                power = volts * (volts - m.k_emf * omega) / m.R
                load = (m.k_z if mode.turn >= 0 else m.k_z_back) * z
                friction = m.T_b if mode.turn >= 0 else -m.T_b
                alpha = (m.k_u * volts - m.k_v * omega - load - friction) / m.lam
                if mode.stop == "upper":
                    dq = 0.0 if mode.ground else m.k_l * w
                elif mode.stop == "lower":
                    dq = 0.0
                elif mode.stop:
                    dq = m.k_q * alpha
                elif mode.turn == 0:
                    dV = -m.k_l * z
                else:
                    dq, dV = m.k_q * alpha, q - m.k_l * z
            dz = 0.0 if mode.ground else w
            dw = 0.0 if mode.ground else (m.weight(V, z) - m.drag(w)) / m.m
            flow = dV if (self.ramp is not None or m.positioner) else q
            return np.array([dq * C, dV * C, dz, dw, power, w * m.drag(w), m.rho_g * z * flow])

        return f

    # -- what may happen -------------------------------------------------------------------------
    def _conditions(self, u: float) -> dict[str, Callable[[np.ndarray], float]]:
        """Functions that turn positive when something happens."""
        m, mode = self.m, self.mode
        g: dict[str, Callable[[np.ndarray], float]] = {}

        def volts(y: np.ndarray) -> float:
            return m.voltage(u, y[0] / C / m.k_q)

        def surplus(y: np.ndarray) -> float:  # torque left over to drive, in volts
            return volts(y) - (m.k_z * y[2] + m.T_b) / m.k_u

        def deficit(y: np.ndarray) -> float:  # torque left over to turn back, in volts
            return (m.k_z_back * y[2] - m.T_b) / m.k_u - volts(y)

        if mode.ground:
            g["left the bottom"] = lambda y: -m.weight(y[1] / C, y[2])
        else:
            g["reached the bottom"] = lambda y: y[2] - m.bottom
            if self.y[2] < m.z_s or (self.y[2] == m.z_s and self.y[3] < 0.0):
                g["submerged"] = lambda y: y[2] - m.z_s
                g["out of the water"] = lambda y: m.z_air - y[2]
            else:
                g["began to emerge"] = lambda y: m.z_s - y[2]
            if m.eps > 0.0:
                slow = 1.0 if abs(self.y[3]) <= m.eps else -1.0
                g["drag law"] = lambda y: slow * (abs(y[3]) - m.eps)
        if self.ramp is not None:
            return g
        if m.positioner:
            target = max(m.V_min, min(m.V_max, u)) * C
            if mode.turn:
                g["arrived"] = lambda y: mode.turn * (y[1] - target)
            return g
        if m.R_b > 0.0:
            sign = (
                1.0 if abs(u) <= m.full_duty(self.y[0] / C / m.k_q, math.copysign(1, u)) else -1.0
            )
            g["supply"] = lambda y: (
                sign * (abs(u) - m.full_duty(y[0] / C / m.k_q, math.copysign(1.0, u)))
            )
        if mode.stop == "upper":
            if m.k_l > 0.0:

                def pull(y: np.ndarray) -> float:
                    # the torque of the stop, in m3/s: what turns the rotor as the leakage changes
                    slackening = 0.0 if mode.ground else m.lam / m.k_v * y[3]
                    torque = m.k_q * m.k_u / m.k_v * surplus(y)
                    return m.k_l * (y[2] + slackening) - torque

                g["left the upper end stop"] = pull
            else:
                g["left the upper end stop"] = deficit
        elif mode.stop == "lower":
            g["pump turns"] = surplus
        elif mode.stop:
            g["pump stops"] = lambda y: -y[0]
            g["left the lower end stop"] = lambda y: y[0] - m.k_l * C * y[2]
        else:
            g["reached the upper end stop"] = lambda y: y[1] - m.V_max * C
            g["reached the lower end stop"] = lambda y: m.V_min * C - y[1]
            if m.one_way and mode.turn == 0:
                g["drives"], g["driven back"] = surplus, deficit
            elif m.one_way:
                g["stands still"] = lambda y: -mode.turn * y[0]
        return g

    def _happen(self, what: str, u: float, t: float) -> None:
        m, mode = self.m, self.mode
        if what in ("reached the bottom", "left the bottom"):
            mode.ground = what.startswith("reached")
            self.y[3] = 0.0
        elif what == "reached the upper end stop":
            mode.stop, self.y[0], self.y[1] = "upper", m.k_l * self.y[2] * C, m.V_max * C
            mode.turn = 1
        elif what == "reached the lower end stop":
            mode.stop, self.y[1] = "lower", m.V_min * C
            if self.y[0] > 0.0:
                mode.stop, mode.turn = "lower, pump turning", 1
            self.y[0] = max(self.y[0], 0.0)
        elif what == "left the upper end stop":
            mode.stop, mode.turn = "", 1
            if m.k_l == 0.0:
                self.y[0] = 0.0
            if m.one_way and self.y[0] == 0.0:
                mode.turn = -1
        elif what == "pump turns":
            mode.turn = 1
            mode.stop = "lower, pump turning" if m.k_l * self.y[2] > 0.0 else ""
            if not mode.stop:
                what = "left the lower end stop"
        elif what == "pump stops":
            mode.stop, self.y[0] = "lower", 0.0
        elif what == "left the lower end stop":
            mode.stop = ""
        elif what == "stands still":
            self.y[0], mode.turn = 0.0, 0
        elif what == "drives":
            mode.turn = 1
        elif what == "driven back":
            mode.turn = -1
        elif what == "arrived":
            mode.turn, self.y[1] = 0, max(m.V_min, min(m.V_max, u)) * C
        elif what == "out of the water":
            self.run.why = what
        self.run.events.append((t, what))

    # -- time ------------------------------------------------------------------------------------
    def hold(self, u: float, h: float) -> None:
        """Advance by h [s] with the input u held: a voltage [V], or a positioner's volume [m3]."""
        m, end = self.m, self.t + h
        if self.ramp is None and m.positioner:
            target = max(m.V_min, min(m.V_max, u))
            self.mode.turn = int(np.sign(target * C - self.y[1]))
        elif self.ramp is None:
            u = max(-m.E, min(m.E, u))
        before = len(self.run.events)
        while self.t < end and self.run.why == "finished":
            assert len(self.run.events) < before + 200, (
                f"chatter at {self.y}: {self.run.events[-6:]}"
            )
            self._settle(u)
            self._advance(u, end)

    def _settle(self, u: float) -> None:
        """Let happen what the input, having jumped, makes happen at once."""
        for _ in range(10):
            due = [
                name
                for name, g in self._conditions(u).items()
                if g(self.y) > 0.0 and name in _AT_ONCE
            ]
            if not due:
                return
            self._happen(due[0], u, self.t)
        raise AssertionError("the oracle chatters")

    def _advance(self, u: float, end: float) -> None:
        conditions = self._conditions(u)
        slack = {name: max(g(self.y), 0.0) + 1e-13 for name, g in conditions.items()}
        slack |= {name: slack[name] + 1e-10 for name in ("supply", "drag law") if name in slack}
        scale = np.array([1.0, 1.0, 1e-1, 1e-2, 1.0, 1e-3, 1.0])
        solver = DOP853(
            self._rhs(u),
            self.t,
            self.y,
            end,
            rtol=self.rtol,
            atol=self.rtol * scale,
            first_step=min(2e-2, end - self.t),
            max_step=0.25,
        )
        while solver.status == "running":
            assert solver.step() is None
            dense = solver.dense_output()
            happened: list[tuple[float, str]] = []
            grid = np.linspace(solver.t_old, solver.t, 9)
            values = dense(grid)
            for name, g in conditions.items():
                for k in range(1, 9):
                    if g(values[:, k]) > slack[name]:

                        def past(t: float, g=g, s=slack[name], dense=dense) -> float:
                            return g(dense(t)) - s

                        first = (
                            grid[k - 1]
                            if past(grid[k - 1]) >= 0.0
                            else brentq(past, grid[k - 1], grid[k], xtol=1e-14, rtol=1e-15)
                        )
                        happened.append((first, name))
                        break
            if happened:
                t, name = min(happened)
                self.y = dense(t)
                self.t = t
                self._happen(name, u, t)
                return
        self.t, self.y = end, solver.y.copy()

    def note(self, command: float = math.nan) -> None:
        """Record the state."""
        q, V, z, w = self.state
        self.run.time.append(self.t)
        self.run.rows.append((z, w, V, q, command))


def closed_loop(
    vehicle: Vehicle,
    law: Callable[[float, float, float, float], float],
    *,
    setpoints: Sequence[tuple[float, float]],
    duration: float,
    tick: float,
    depth: float,
    volume: float | None = None,
    speed: float = 0.0,
    bottom: float = math.inf,
    rtol: float = 1e-12,
) -> Run:
    """Run ``law(time, depth, volume, reference) -> command`` at every tick."""
    o = Oracle(vehicle, depth=depth, volume=volume, speed=speed, bottom=bottom, rtol=rtol)
    n = math.ceil(duration / tick - 1e-9)
    for k in range(n + 1):
        reference = [z for t, z in setpoints if t <= k * tick + 1e-9][-1]
        _, V, z, _ = o.state
        u = law(k * tick, z, V, reference)
        o.note(u)
        if k < n:
            o.t = k * tick
            o.hold(u, tick)
        if o.run.why != "finished":
            break
    return _finished(o)


def open_loop(
    vehicle: Vehicle,
    times: Sequence[float],
    inputs: Sequence[float],
    *,
    ramps: bool = False,
    depth: float,
    volume: float | None = None,
    speed: float = 0.0,
    bottom: float = math.inf,
) -> Run:
    """Hold each voltage (or, with `ramps`, follow the volume) until the next instant."""
    start = inputs[0] if ramps else volume
    o = Oracle(vehicle, depth=depth, volume=start, speed=speed, bottom=bottom)
    o.t = times[0]
    for k, t in enumerate(times):
        o.note(inputs[k])
        if k == len(times) - 1:
            break
        h = times[k + 1] - t
        if ramps:
            o.ramp = (inputs[k + 1] - inputs[k]) / h
        o.hold(0.0 if ramps else inputs[k], h)
    return _finished(o)


def _finished(o: Oracle) -> Run:
    o.run.source, o.run.drag, o.run.hydraulic = (float(x) for x in o.y[4:])
    return o.run


def paper_cascade(
    *, k_pV: float, k_pz: float, k_iz: float, k_dz: float, S_p: float
) -> Callable[[float, float, float, float], float]:
    """The cascade of Fig. 15, eqs (36)-(37), with its memory, written once more."""
    memory: dict[str, float] = {}

    def law(_t: float, z: float, V: float, reference: float) -> float:
        e = reference - z
        U_i = memory.setdefault("U_i", V)
        e_before = memory.get("e", e)
        U = k_pz * e + U_i + k_dz * (e - e_before) / S_p
        memory["U_i"] = U_i + k_iz * S_p * e
        memory["e"] = e
        return k_pV * (U - V)

    return law


# The gains of Table 3 are per dm3.
TABLE_3 = dict(k_pV=1002.0 / 1e-3, k_pz=-0.1043e-3, k_iz=-7.486e-4 * 1e-3, k_dz=-2.341e-3, S_p=0.3)
