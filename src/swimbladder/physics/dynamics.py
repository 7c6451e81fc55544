"""The vertical motion assembled (eqs 11-16, 31): a Plant of plain floats and its right-hand side.

The state is ``(q, V, z, w)``: the volume rate that the motor drives q = k_q omega [m3/s], the
volume V [m3], the depth z [m] and the vertical speed w = dz/dt [m/s], positive down. Dividing
eqs (11)-(13) by lambda/k_v and m leaves only what a log can identify::

    T1 dq/dt = K1 A (u - c z) - q          eq. (11), c = k_z/k_u
       dV/dt = q - k_l z                   eq. (12)
       dz/dt = w
       dw/dt = (k_b/m) (psi z + V0 - V) - F_d(w)/m + contact    eq. (13), (31)

A positioner moves V at a constant rate; its q is that rate.
"""

import math
from functools import partial
from typing import NamedTuple

from swimbladder.errors import InputError
from swimbladder.physics.actuator import ReducedActuator, reduced, refuse_pump_and_valve
from swimbladder.vehicle import Drag, IdentifiedMotion, Positioner, Supply, Vehicle


class State(NamedTuple):
    """The state of a vehicle: motor-driven volume rate, volume, depth, vertical speed."""

    q: float = 0.0  # m3/s
    V: float = 0.0  # m3
    z: float = 0.0  # m
    w: float = 0.0  # m/s


class Plant(NamedTuple):
    """A vehicle as the kernels take it; every field a float, so an ensemble is an array of them."""

    positioner: float  # 0: voltage-driven motor; 1: rate-limited positioner
    T1: float  # s, lambda/k_v
    gain: float  # m3/s/V, K1 A = k_q k_u/k_v
    load_drive: float  # V/m, k_z/k_u while the motor drives against the pressure
    load_back: float  # V/m, the same while the sea drives the motor back
    friction: float  # V, dry friction T_b/k_u
    k_l: float  # m2/s, leakage
    rate: float  # m3/s, speed of a positioner
    V_min: float  # m3, end stop
    V_max: float  # m3, end stop
    supply: float  # V, open-circuit voltage
    sag: float  # -, internal resistance of the supply over that of the motor
    kappa: float  # V s/m3, back electromotive force per volume rate, k_emf/k_q
    a_b: float  # 1/m2/s2, k_b/m
    psi: float  # m3/m
    V_0: float  # m3, neutral volume at z = 0
    d_l: float  # 1/s, laminar drag k_dl/m
    d_b: float  # 1/s, linear part of the drag above epsilon
    d_0: float  # m/s2, constant part of the drag above epsilon
    d_t: float  # 1/m, turbulent drag k_dt/m
    epsilon: float  # m/s, speed of the transition; inf: always laminar
    z_surface: float  # m, depth at which the hull starts to emerge
    a_s: float  # 1/s2, stiffness of the emerging hull, rho g A_w/m
    z_air: float  # m, depth at which the hull would have left the water
    z_bottom: float  # m, inf without one
    switch_in: float = -math.inf  # m3, at which a limit switch cuts what drives further in
    switch_out: float = math.inf  # m3, the same outwards


class DragTerms(NamedTuple):
    """The terms of `drag_law` of a vehicle, each as in Plant."""

    d_l: float
    d_b: float
    d_0: float
    d_t: float
    epsilon: float


def plant(vehicle: Vehicle, *, bottom_depth: float = math.inf) -> Plant:
    """Return the Plant of a vehicle over a bottom at `bottom_depth` [m].

    Raises InputError where the supply's internal resistance does not fit the motor's, for a pump
    and valve, which have no voltage, and for drag that is not the same up and down: `mission`
    takes both.
    """
    refuse_pump_and_valve(vehicle.engine)
    if vehicle.drag.rising_ratio != 1.0:
        raise InputError(
            "only `mission`, `ballast`, `energy` and `size` know a drag that differs up and down",
            field="motion.drag.rising_ratio",
            value=vehicle.drag.rising_ratio,
            remedy="Leave the line out here, and give a drag between the two",
        )
    body, actuator = body_plant(vehicle, bottom_depth=bottom_depth), vehicle.engine
    if isinstance(actuator, Positioner):
        a, supply, sag = ReducedActuator(1.0, *5 * (0.0,), None, None), math.inf, 0.0
        body = body._replace(positioner=1.0, rate=actuator.speed * actuator.piston_area)
    else:
        assert vehicle.supply is not None  # Vehicle checks it
        a, supply = reduced(actuator, vehicle.water), vehicle.supply.voltage
        body, sag = body._replace(positioner=0.0, rate=0.0), _sag(vehicle.supply, a)
    driven = {name: value for name, value in a._asdict().items() if name in Plant._fields}
    return body._replace(**driven | {"supply": supply, "sag": sag, "kappa": a.kappa or 0.0})


def body_plant(vehicle: Vehicle, *, bottom_depth: float = math.inf) -> Plant:
    """Return the Plant of a vehicle whatever drives it; what only the drive knows is nan."""
    hull, stroke, m = vehicle.hull, vehicle.stroke, vehicle.mass
    k_b = vehicle.water.specific_weight
    return Plant(*[math.nan] * len(Plant._fields))._replace(
        V_min=stroke.minimum,
        V_max=stroke.maximum,
        a_b=k_b / m,
        psi=hull.psi,
        V_0=vehicle.trim_error,
        **drag_terms(vehicle.drag, m)._asdict(),
        z_surface=hull.emergence_depth,
        a_s=k_b * hull.waterplane_area / m,
        z_air=hull.emergence_depth - hull.height,
        z_bottom=bottom_depth,
        switch_in=-math.inf if stroke.switch_margin is None else stroke.lowest,
        switch_out=math.inf if stroke.switch_margin is None else stroke.highest,
    )


def _sag(supply: Supply, actuator: ReducedActuator) -> float:
    """Return the supply's internal resistance over the motor's [-].

    Raises InputError where the sag is not known, or where full duty would not give most voltage.
    """
    if supply.internal_resistance == 0.0:
        return 0.0
    R_b = supply.internal_resistance
    problem = partial(InputError, field="supply.internal_resistance", value=R_b, unit="ohm")
    if actuator.resistance is None or actuator.kappa is None:
        raise problem(
            "the supply has an internal resistance, but the motor's resistance and k_emf, which "
            "decide how far the voltage sags, are not known",
            remedy="Give the motor's data, or leave the internal resistance out",
        )
    sag = R_b / actuator.resistance
    if sag > 1.0:
        raise problem(
            f"the supply's internal resistance is above the motor's, {actuator.resistance:g} ohm: "
            "the supply would lose more than it gives",
            remedy="Check both resistances and their units",
        )
    return sag


def drag_terms(drag: Drag, m: float) -> DragTerms:
    """Return the terms while sinking."""
    k_dl, k_dt, eps = drag.k_dl, drag.k_dt, drag.epsilon
    if drag.law == "linear":
        return DragTerms(k_dl / m, 0.0, 0.0, 0.0, math.inf)
    if drag.law == "quadratic":
        return DragTerms(0.0, 0.0, 0.0, k_dt / m, 0.0)
    if drag.law == "blended":
        return DragTerms(k_dl / m, k_dl / m, 0.0, k_dt / m, 0.0)
    step = (k_dl * eps - k_dt * eps**2) / m if drag.law == "switched" else 0.0
    return DragTerms(k_dl / m, 0.0, step, k_dt / m, eps)


def even_drag(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle with the drag of sinking both ways."""
    motion = vehicle.motion
    if isinstance(motion, IdentifiedMotion) or motion.drag.rising_ratio == 1.0:
        return vehicle
    drag = motion.drag.model_copy(update={"rising_ratio": 1.0})
    return vehicle.model_copy(update={"motion": motion.model_copy(update={"drag": drag})})


def drag_law(
    w: float, d_l: float, d_b: float, d_0: float, d_t: float, epsilon: float
) -> tuple[float, float, float]:
    """Return drag over mass F_d(w)/m [m/s2] at a speed w [m/s], its slope [1/s], and d_l w less it.

    Eq. (16), symmetric in speed (the paper tests w, not |w|); the terms are those of Plant.
    Compiled kernels are made of this function too, for many vehicles at once: it has no branches.
    """
    size = abs(w)
    laminar = (size <= epsilon) & (epsilon > 0.0)
    beside = d_l * size - (d_b * size + d_0 + d_t * size * size)
    beside = beside if w > 0.0 else -beside
    rest = 0.0 if laminar | (size == 0.0) else beside
    return d_l * w - rest, d_l if laminar else d_b + 2.0 * d_t * size, rest


def drag_per_mass(w: float, p: Plant) -> float:
    """Drag over mass F_d(w)/m [m/s2], eq. (16)."""
    return drag_law(w, p.d_l, p.d_b, p.d_0, p.d_t, p.epsilon)[0]


def drag_force(drag: Drag, w: float) -> float:
    """Drag F_d(w) [N] at a speed w [m/s], eq. (16), symmetric but for `rising_ratio`."""
    share = 1.0 if w >= 0.0 else drag.rising_ratio
    return drag_law(w, *drag_terms(drag, 1.0 / share))[0]


def terminal_speed(p: Plant, pull: float) -> float:
    """Return the speed [m/s] at which the drag over mass is `pull` [m/s2], not below 0."""
    if pull <= 0.0:
        return 0.0
    if pull <= p.d_l * p.epsilon:
        return pull / p.d_l
    beyond = max(pull - p.d_0, 0.0)
    root = p.d_b + math.sqrt(p.d_b * p.d_b + 4.0 * p.d_t * beyond)
    return max(2.0 * beyond / root, p.epsilon)  # epsilon: where the drag jumps past the pull


def acceleration(V: float, z: float, w: float, p: Plant) -> float:
    """Vertical acceleration dw/dt [m/s2] off the bottom, eqs (10), (13), (15), (31)."""
    emerged = p.a_s * max(p.z_surface - z, 0.0)
    return p.a_b * (p.psi * z + p.V_0 - V) - drag_per_mass(w, p) + emerged


def motor_rhs(x: State, u: float, p: Plant) -> State:
    """Right-hand side of eqs (11)-(13) at voltage u [V], between the end stops.

    The depth load and the dry friction oppose the motor's motion; at rest they hold it until the
    voltage beats them.
    """
    q, V, z, w = x
    load = p.load_drive * z + p.friction if q > 0.0 else p.load_back * z - p.friction
    if q == 0.0:
        load = min(max(u, p.load_back * z - p.friction), p.load_drive * z + p.friction)
    dq = (p.gain * (u - load) - q) / p.T1
    return State(dq, q - p.k_l * z, w, acceleration(V, z, w, p))
