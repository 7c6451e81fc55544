"""What is flown: a table of scenarios, with depths that are those of the vehicle at hand."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from swimbladder.design.linear.depths import stall
from swimbladder.design.linear.pump_valve import pump_stall
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.physics.dynamics import body_plant, plant
from swimbladder.units import rounded
from swimbladder.vehicle import Vehicle

LOW_SUPPLY = 0.9  # of the supply's voltage: what `tune` takes for a battery that is nearly empty
_REACH = 0.8  # of the depth at which stroke or supply end: where a vehicle is still to be steered
_UNSTATED = 10.0  # m, that a vehicle of no stated rating is taken to
_NEAR = (1.5, 0.3)  # m below the least depth, and at most this share of the range: as `tune` steps
_WATCHED = 20.0  # times the least time of a step, that it is watched at least
_HOUR = 3600.0
_SLOW = 0.03  # m/s


class Swell(NamedTuple):
    """Waves: significant height [m] and the periods [s] among which the energy is shared evenly."""

    height: float
    periods: tuple[float, ...]


class Scenario(NamedTuple):
    """One scenario, for any vehicle.

    at: near the least depth of the range, or at its greatest. size [m]: of a step, positive down,
    and at most `share` of the range; 0: a depth is held. duration [s] at least. counted [s]: since
    when errors and volumes count. supply [-]: of the vehicle's. drawn: vehicles from the region
    of what is not known, instead of the nominal one. walk [m3/s^0.5]: intensity of the neutral
    volume's random walk.
    """

    name: str
    words: str
    at: Literal["shallow", "deep"]
    size: float = 0.0
    share: float = 0.4
    duration: float = 900.0
    counted: float = 0.0
    supply: float = 1.0
    drawn: bool = False
    swell: Swell | None = None
    walk: float = 0.0


_SWELL = Swell(1.0, (8.0, 10.0, 12.0))
_WALK = 1e-6 / math.sqrt(_HOUR)  # 1 cm3 per root hour

SCENARIOS: tuple[Scenario, ...] = (
    Scenario("step-down", "a step of 1.5 m down", "shallow", 1.5),
    Scenario("step-up", "the same step up", "shallow", -1.5),
    Scenario("step-small", "a step of 0.5 m down", "shallow", 0.5, share=0.1),
    Scenario("step-small-up", "the same step up", "shallow", -0.5, share=0.1),
    Scenario("step-large", "a step of 5 m down", "shallow", 5.0, share=0.6),
    Scenario("step-large-up", "the same step up", "shallow", -5.0, share=0.6),
    Scenario("step-deep", "a step of 1.5 m down to the greatest depth", "deep", 1.5),
    Scenario("step-low-battery", f"1.5 m down with {100 * LOW_SUPPLY:.0f} % of the supply",
             "shallow", 1.5, supply=LOW_SUPPLY),
    Scenario("step-uncertain", "the same of vehicles drawn from the region of what is not known",
             "shallow", 1.5, supply=LOW_SUPPLY, drawn=True),
    Scenario("hold", "an hour at rest, with the noise of the sensor", "shallow",
             duration=_HOUR, counted=600.0),
    Scenario("hold-swell", f"the same in swell of {_SWELL.height:g} m", "shallow",
             duration=_HOUR, counted=600.0, swell=_SWELL),
    Scenario("hold-deep", "an hour at the greatest depth", "deep", duration=_HOUR, counted=600.0),
    Scenario("hold-drift", "two hours while the neutral volume walks 1 cm3 per root hour",
             "shallow", duration=2.0 * _HOUR, counted=1200.0, walk=_WALK),
)  # fmt: skip

FLOAT_SCENARIOS: tuple[Scenario, ...] = (
    Scenario("step-down", "a step of 100 m down", "shallow", 100.0),
    Scenario("step-up", "the same step up", "shallow", -100.0),
    Scenario("step-small", "a step of 30 m down", "shallow", 30.0),
    Scenario("step-small-up", "the same step up", "shallow", -30.0),
    Scenario("step-large", "a step of 400 m down", "shallow", 400.0, share=0.6),
    Scenario("step-large-up", "the same step up", "shallow", -400.0, share=0.6),
    Scenario("step-deep", "a step of 100 m down to the greatest depth", "deep", 100.0),
    Scenario("step-uncertain", "100 m down, of vehicles drawn from the region of what is not known",
             "shallow", 100.0, drawn=True),
    Scenario("hold", "six hours at rest, with the noise of the sensor", "shallow",
             duration=6.0 * _HOUR, counted=_HOUR),
    Scenario("hold-swell", f"the same in swell of {_SWELL.height:g} m", "shallow",
             duration=6.0 * _HOUR, counted=_HOUR, swell=_SWELL),
    Scenario("hold-deep", "six hours at the greatest depth", "deep",
             duration=6.0 * _HOUR, counted=_HOUR),
    Scenario("hold-drift", "half a day while the neutral volume walks 1 cm3 per root hour",
             "shallow", duration=12.0 * _HOUR, counted=_HOUR, walk=_WALK),
)  # fmt: skip
"""Of floats with pump and valve, whose laws sleep for minutes and keep a band of metres."""

BAND = 10.0  # m, within which such a float has come to its depth, as those of Argo count


def scenarios_of(vehicle: Vehicle) -> tuple[Scenario, ...]:
    """Return what is flown with a vehicle."""
    return FLOAT_SCENARIOS if vehicle.command == "volume change" else SCENARIOS


class Places(NamedTuple):
    """Between which depths a vehicle's laws are compared [m], and what ends the range."""

    least: float
    most: float
    words: str


class Placed(NamedTuple):
    """A scenario with the depths [m] and the duration [s] that a vehicle gives it."""

    scenario: Scenario
    start: float
    target: float
    duration: float

    @property
    def is_step(self) -> bool:
        """Whether the depth is to change."""
        return self.start != self.target


def places(vehicle: Vehicle, given: tuple[float, float] | None = None) -> Places:
    """Return the range of depths: that given [m], or what rating, stroke and supply allow.

    It begins where the hull is under water.

    Raises InputError for no range, NoAnswerError where the vehicle does not reach what was given.
    """
    top = max(vehicle.hull.emergence_depth, 0.0)
    if vehicle.command == "volume change":
        top = max(top, 2.0 * BAND)  # near the surface its processor acts, not the law
    reach, why = _reach(vehicle)
    if given is None:
        most, words = (
            _REACH * reach,
            f"down to {100.0 * _REACH:.0f} % of {rounded(reach, 3)} m, where {why}",
        )
        if vehicle.hull.depth_limit is None and most > top + _UNSTATED:
            most = top + _UNSTATED
            words = f"down to {most:g} m, as the vehicle states no rating (--depth)"
        if most <= top:
            raise NoAnswerError(
                f"there is no depth to compare laws at: {why} at {rounded(reach, 3)} m"
            )
        return Places(top, most, words)
    least, most = max(given[0], top), given[1]
    if not (given[0] >= 0.0 and least < most < math.inf):
        raise InputError(
            "no range of depths under water", field="--depth", value=f"{given[0]:g}:{most:g}",
            unit="m", remedy="Give the least and the greatest, like 0:10",
        )  # fmt: skip
    if most >= reach:
        raise NoAnswerError(
            f"the vehicle cannot be held at {most:g} m: at {reach:.4g} m {why}. Compare laws for "
            "less depth, or give it more stroke or a higher supply"
        )
    return Places(least, most, "as given")


def _reach(vehicle: Vehicle) -> tuple[float, str]:
    """Return the depth [m] that ends the vehicle's range, and what happens there."""
    floats = vehicle.command == "volume change"
    p = body_plant(vehicle) if floats else plant(vehicle)
    found = [(math.inf, "")]
    if vehicle.hull.depth_limit is not None:
        found.append((vehicle.hull.depth_limit, "its rating ends"))
    if p.psi != 0.0:
        end = p.V_max if p.psi > 0.0 else p.V_min
        found.append(((end - p.V_0) / p.psi, "its neutral volume leaves the stroke"))
    if vehicle.voltage_driven:
        weak = p._replace(supply=LOW_SUPPLY * p.supply)
        held = stall(weak, depth=0.0, depth_limit=None).holding_depth
        found.append((held, f"the motor stalls with {weak.supply:.3g} V"))
    if floats:
        found.append((pump_stall(vehicle, depth=0.0).holding_depth, "the pump stalls"))
    return min(found)


def place(scenario: Scenario, vehicle: Vehicle, where: Places) -> Placed:
    """Return a scenario with depths and duration for a vehicle.

    The duration is at least 20 times the time that the step takes without drag and psi, and at the
    speed that half of the room in the stroke keeps; of a float with pump and valve two hours beyond
    the way at 3 cm/s.
    """
    span = where.most - where.least
    size = min(abs(scenario.size), scenario.share * span)
    shallow = where.least + min(_NEAR[0], _NEAR[1] * span)
    near, far = (shallow, shallow + size) if scenario.at == "shallow" else (
        where.most - size, where.most,
    )  # fmt: skip
    start, target = (far, near) if scenario.size < 0.0 else (near, far)
    if size == 0.0:
        return Placed(scenario, start, target, scenario.duration)
    if vehicle.command == "volume change":
        return Placed(scenario, start, target, size / _SLOW + 2.0 * _HOUR)
    p = plant(vehicle)
    rate = p.rate if p.positioner else p.gain * p.supply
    pull = 0.5 * p.a_b * min(p.V_max - p.V_0, p.V_0 - p.V_min)
    drag = max(p.d_l, p.d_b)
    root = drag + math.sqrt(drag * drag + 4.0 * p.d_t * pull)
    slow = size * root / (2.0 * pull)
    least = math.cbrt(32.0 * size / (p.a_b * rate)) + slow
    return Placed(scenario, start, target, max(scenario.duration, _WATCHED * least))
