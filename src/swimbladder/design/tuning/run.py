"""`tune`: gains for a vehicle's law, with margins over what is not known of the vehicle.

`Tuning` is what it found, for a person and for JSON, with a vehicle that other commands read.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from swimbladder.control.law import Law, Setting
from swimbladder.control.records import leaves
from swimbladder.control.registry import bind, check_command, controller_of, own_law
from swimbladder.design.linear.depths import stall
from swimbladder.design.linear.pump_valve import moved_by_volume, pump_stall, with_supply
from swimbladder.design.linear.sampled import BoundLaw, SampledLoop
from swimbladder.design.tuning import gains, trial
from swimbladder.design.tuning.margins import MARGINS, loops, margin_words
from swimbladder.design.tuning.region import Region, region
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.answers import as_json
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.buoyancy_engine import known_winding
from swimbladder.physics.dynamics import Plant, plant
from swimbladder.physics.seawater import Column
from swimbladder.physics.seawater.cast_unit import check_cast_unit
from swimbladder.sim.closed_loop.water import medium_of
from swimbladder.sim.engine.layers import Layers
from swimbladder.vehicle import DatasheetPump, PumpAndValve, Vehicle

_MORE = 1.05  # times the rms that was asked for: as near as trials tell
_WIDER = 3.0  # times the rms of a hold, that a band has to be to stand out from it


@dataclass(frozen=True, kw_only=True)
class Tuning(gains.Found):
    """A law with its gains, the margins that they guarantee, and what trials gave.

    vehicle: the one that was given, with the controller found. margins: the worst over the region,
    at the command and at the measured depth. nominal and region: trials of the vehicle as it is
    and of vehicles drawn from the region, with the supply low.
    """

    vehicle: Vehicle
    law: Law
    goal: str
    setting: Setting  # what the gains were made from
    shown: tuple[trial.Runs, trial.Runs]  # a few runs: nominal, and over the region
    step: trial.Step
    sample_time: float  # s
    delay: float  # s
    depths: tuple[float, ...]  # m, that it is for
    judged: tuple[float, ...]  # m, where margins were computed
    supply: float  # V, the least assumed
    held: float  # m rms, that holding a depth was allowed; 0: the goal is fast
    assumptions: tuple[str, ...]
    plants: tuple[Plant, ...]  # of the region, the nominal one first
    band: float = 0.0  # m, of a law of volume changes: within which a flight has arrived

    def loops(self) -> tuple[SampledLoop, ...]:
        """Return the linear loops that the margins are of: none where there are no margins.

        They are those of all `plants` at the first depth, then at the next.
        """
        if self.margins is None:
            return ()
        linear = gains.gains(self.law.name, self.setting, self.knobs._replace(dead=0.0, pause=0.0))
        bound = BoundLaw(self.law, linear, self.sample_time)
        return tuple(loops(bound, self.plants, depths=self.judged, delay=self.delay))

    @property
    def _low(self) -> str:
        low = f" with the supply at {self.supply:.3g} V"
        return low if math.isfinite(self.supply) else ""

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a person wants to know first."""
        if self.law.ways is not None:
            return self._float_sentences
        m, r, n = self.margins, self.region, self.nominal
        settled = (
            f"The step from {self.step.start:g} to {self.step.target:g} m settles to 2 % in "
            f"{_seconds(n.settle_median)} (median of {n.runs} runs of the nominal vehicle), "
            f"{_seconds(r.settle_95)} in 95 % of {r.runs} runs over the region{self._low}; "
            f"overshoot {100.0 * n.overshoot_median:.1f} % and "
            f"{100.0 * r.overshoot_95:.1f} %."
        )
        held = (
            f"Held at {self.step.target:g} m it stays within {1e3 * r.rms:.2g} mm rms and moves "
            f"{3.6e6 * r.rate:.2g} L of volume in {3600.0 * r.starts:.0f} starts from rest and "
            f"{3600.0 * r.turns:.0f} reversals an hour."
        )
        if 0.0 < self.held * _MORE < r.rms:
            held += (
                f" That is more than the {1e3 * self.held:.3g} mm that were asked for: nothing "
                "that was tried holds it better."
            )
        sentences = [settled, held]
        band = 0.02 * abs(self.step.target - self.step.start)
        if band < _WIDER * r.rms:
            sentences.insert(
                1,
                f"2 % of that step are {1e3 * band:.2g} mm, hardly more than it is held to: when "
                "it settles is hardly informative. Use a longer step (--step).",
            )
        if math.isfinite(r.energy):
            sentences.append(
                f"The motor takes {r.energy:.3g} J in the {self.step.duration / 60.0:.3g} min of a "
                f"trial and {1e3 * r.power:.3g} mW while it holds (region, at its terminals)."
            )
        if m is None:
            sentences.append(_NO_MARGINS)
        else:
            sentences.append(f"Over {len(self.plants)} vehicles of the region: {margin_words(m)}.")
        return tuple(sentences)

    @property
    def _float_sentences(self) -> tuple[str, ...]:
        n, r = self.nominal, self.region
        low, high = sorted((self.step.start, self.step.target))
        sentences = [
            f"Between {low:g} and {high:g} m it arrives within {self.band:.3g} m after "
            f"{_hours(n.settle_median)} (median of {n.runs} flights of the nominal vehicle, half "
            f"of them up), {_hours(r.settle_95)} in 95 % of {r.runs} flights over the region"
            f"{self._low}; {100.0 * r.settled:.0f} % of these arrive and stay, overshoot "
            f"{100.0 * r.overshoot_95:.1f} %.",
            f"There it stays within {r.rms:.2g} m rms with {3600.0 * r.starts:.2g} starts of the "
            f"pump and {3600.0 * r.turns:.2g} openings of the valve an hour, "
            f"{3600e6 * r.rate:.2g} cm3 an hour.",
        ]
        if math.isfinite(r.energy):
            sentences.append(
                f"Pump and valve take {r.energy:.3g} J in the {self.step.duration / 3600.0:.3g} "
                f"h of a flight and {3600.0 * r.power:.3g} J an hour while it holds (region, from "
                "the battery's cells)."
            )
        sentences.append(
            f"Over {len(self.plants)} vehicles of the region errors of the speed decay from one "
            f"decision to the next: the largest eigenvalue has the modulus {self.radius:.3f}."
        )
        return tuple(sentences)

    def to_json(self) -> dict[str, Any]:
        """Return it in SI units, ready for JSON; None where a run never settles."""
        return {
            "vehicle": self.vehicle.name,
            "law": self.law.name,
            **as_json(self, _ASKED_FOR),
            "hold_m": self.held or None,
            "parameters": {
                name: {"value": float(value), "unit": self.law.units[name]}
                for name, value in leaves(self.parameters).items()
            },
            "knobs": self.knobs._asdict(),
            "margins": self.margins
            and {**as_json(self.margins, MARGINS), "vehicles": len(self.plants)},
            **({} if math.isnan(self.radius) else {"decision_eigenvalue": self.radius}),
            "nominal": as_json(self.nominal, TRIAL),
            "region": as_json(self.region, TRIAL),
        }


_ASKED_FOR = "goal sample_time_s computation_delay_s=delay depths_m supply_V step assumptions"
TRIAL = (
    "runs settled settle2_median_s=settle_median settle2_95_s=settle_95 overshoot_median "
    "overshoot_95 rms_m volume_rate_m3_s=rate starts_1_s turns_1_s energy_J power_W"
)
"""Numbers of a trial, as `io.answers.as_json` takes them."""


def _hours(x: float) -> str:
    return f"{x / 3600.0:.3g} h" if math.isfinite(x) else "more than the time watched"


def _seconds(x: float) -> str:
    return f"{x:.1f} s" if math.isfinite(x) else "more than the time watched"


_NO_MARGINS = "The law is not linear around rest and has no margins: only trials judge it."
_LOW = 0.9  # of the supply's voltage, a battery that is nearly empty
_WATCH = 2700.0  # s, that a hold is watched for: what counts is the last third
_SHOWN = (1, 30)  # runs kept as they went: of the nominal vehicle, over the region
_WATCHED = 10.0  # times the least time of a step
_ROWS = 201  # depths at which a cast's layers are looked at
_ASKED = "(--depth, --step)"


def tune(
    vehicle: Vehicle,
    *,
    law: str | None = None,
    goal: str = "fast",
    depths: tuple[float, float] = (0.0, 10.0),
    sample_time: float | None = None,
    delay: float = 0.1,
    supply: float | None = None,
    step: tuple[float, float] | None = None,
    hold: float | None = None,
    runs: int = 200,
    column: Column | None = None,
    supervised: bool = True,
    advance: Advance = silent,
) -> Tuning:
    """Return the gains of a law for this vehicle and goal, with what they guarantee.

    law: the name of one that has a recipe; planned where not given, rate for a pump and valve.
    goal: fast (a step soon settled), quiet (little volume moved and few starts of the motor while a
    depth is held; of a pump and valve least power) or energy (least electrical energy for a step
    and holding). depths: least and greatest [m].
    sample_time [s]: the controller's where not given. delay: from a sample to its command, as a
    share of the sample time. supply [V]: the least; nine tenths of the vehicle's where not given.
    step: depths [m] of the trial, 1.5 m within the range where not given, of a pump and valve the
    whole range. hold [m rms]: error allowed to a quiet law (9.5 mm) or one that saves energy (5
    cm); of a pump and valve the tolerance, that of its law or 10 m. supervised: whether the trials
    fly law and supervisor, as `firmware` writes them, or the law alone; of a pump and valve always
    alone. advance: called with the share of the work done. column: the water that the trials are
    flown in and that stroke and neutral volume are held against; margins are those of the vehicle's
    own psi and density, decisions of a pump and valve with psi as that water has it.

    Raises InputError for what cannot be; NoAnswerError where no gains hold this vehicle, with what
    limits them, or where the energy of its motor is not known.
    """
    pumped = vehicle.command == "volume change"
    law = law or ("rate" if pumped else "planned")
    chosen = gains.tunable(law)
    _check(vehicle, law, goal, hold)
    gains.check_depths(depths)
    if not 0.0 <= delay < 1.0:
        what, remedy = "a delay is given as a share of the sample time", "Give 0 or more, below 1"
        raise InputError(what, field="--delay", value=delay, remedy=remedy)
    if runs < 20:
        raise InputError("too few runs to tell", field="--runs", value=runs, remedy="Give 20")
    h = _sample_time(vehicle, sample_time)
    vehicle, sensor = _with_noise(vehicle)
    p = _supplied(vehicle)
    if supply is not None and math.isinf(p.supply):
        what = f"a {'power law of a pump' if pumped else 'positioner'} has a supply of its own"
        raise InputError(what, field="--supply", value=supply, unit="V", remedy="Leave it out")
    least = _LOW * p.supply if supply is None else supply
    if not 0.0 < least <= p.supply:
        what = "the least supply must be above 0 and not above the vehicle's"
        remedy = f"Give more than 0 V, and up to {p.supply:g} V"
        raise InputError(what, field="--supply", value=least, unit="V", remedy=remedy)
    around = region(vehicle)
    held = _held(vehicle, chosen, goal, hold)
    ends = depths if pumped and step is None else _step(depths, step)
    if pumped and abs(ends[1] - ends[0]) <= 2.0 * held:
        what = f"the way is no longer than the band of {held:g} m to either side that the law keeps"
        remedy = "Give depths farther apart, like 100:1500, or a narrower band (--hold)"
        raise gains.refused_depths(what, depths, remedy)
    judged = tuple(sorted({*depths, *ends}))
    if column is not None and column.cast is not None:
        check_cast_unit(column.cast, judged[-1], vehicle.hull.depth_limit)
    layers = medium_of(vehicle, column, reach=judged[-1]).layers
    off = layers.along(np.linspace(judged[0], judged[-1], _ROWS))
    _check_reach(vehicle, judged, least, around, layers)
    neutral = around.neutral if pumped else max(10.0 * around.neutral, 20e-6)
    neutral += float(np.abs(off).max())
    setting = gains.setting_of(
        vehicle, sample_time=h, supply=least, neutral_range=neutral, depths=judged
    )
    long = _WATCH
    recipe = gains.recipe_of(law)
    if recipe.lasts is not None:
        long = recipe.lasts(setting, abs(ends[1] - ends[0]), goal)
    elif goal == "fast":
        long = _watched(vehicle, least, abs(ends[1] - ends[0]), h)
    watched = trial.Step(*ends, long)
    supervised = supervised and not pumped
    drawn = trial.Drawn(runs, around, least, column, supervised=supervised)
    asked = gains.Goal(goal, held, judged, watched, drawn)
    search = gains.Search(chosen, vehicle, setting, asked, delay * h, advance)
    with threadpool_limits(limits=1, user_api="blas"):  # matrices too small to share
        found = search.found()
    controller = controller_of(chosen, found.parameters, sample_time=h)
    bound = search.bound(found.knobs)
    few = drawn.nominal._replace(runs=_SHOWN[0]), drawn._replace(runs=_SHOWN[1])
    nominal, drawn_runs = (trial.traces(vehicle, bound, watched, some) for some in few)
    how = trial.SUPERVISED if supervised else trial.ALONE
    assumptions = [*around.words, sensor, how, *_outside(depths, ends)]
    assumptions += _in_water(column, off, pumped=pumped)
    if math.isfinite(least):
        assumptions.append(f"the supply falls to {least:.3g} V")
    else:
        mover = "pump" if pumped else "positioner"
        assumptions.append(f"the {mover} moves {1e6 * p.rate:.3g} cm3/s")
    if not pumped:
        assumptions.append(f"a command comes {1e3 * delay * h:.3g} ms after its sample")
    origin = {"controller.parameters": f"tuned for {goal}, {depths[0]:g} to {depths[1]:g} m"}
    made = {"controller": controller, "provenance": {**vehicle.provenance, **origin}}
    if supervised:
        made["supervisor"] = vehicle.supervisor  # so that `simulate` flies it as well
    return Tuning(
        vehicle=vehicle.model_copy(update=made),
        law=chosen,
        goal=goal,
        setting=setting,
        **vars(found),
        shown=(nominal, drawn_runs),
        step=watched,
        sample_time=h,
        delay=delay * h,
        depths=depths,
        judged=judged,
        supply=least,
        held=held,
        band=trial.arrival_band(bound, watched) if pumped else 0.0,
        assumptions=tuple(assumptions),
        plants=around.plants,
    )


def _check(vehicle: Vehicle, law: str, goal: str, hold: float | None) -> None:
    if vehicle.controller is not None:
        own_law(vehicle, sampled=False)
    check_command(gains.tunable(law), vehicle, field="--law", among=gains.tunable_names())
    if goal not in gains.GOALS:
        remedy = f"Choose from {', '.join(gains.GOALS)}"
        raise InputError("no such goal", field="--goal", value=goal, remedy=remedy)
    goals = gains.goals_of(gains.recipe_of(law))
    if goal not in goals:
        remedy = f"Choose from {', '.join(goals)}, or another law"
        what = f"the law {law} is not tuned for this"
        raise InputError(what, field="--goal", value=goal, remedy=remedy)
    pumped = vehicle.command == "volume change"
    allowed = goal != "fast" or pumped
    if hold is not None and not (allowed and 0.0 < hold < math.inf):
        what = "an error that is allowed is above 0, and for quiet and energy"
        remedy = 'Give something like "1 cm" with --goal quiet'
        raise InputError(what, field="--hold", value=hold, unit="m", remedy=remedy)
    if goal == "energy" and not pumped:
        known_winding(vehicle, instead="tune for quiet, which moves least")


def _supplied(vehicle: Vehicle) -> Plant:
    """Return the plant, of a pump and valve with the supply of its pump, where it needs one."""
    p = plant(moved_by_volume(vehicle))
    a = vehicle.engine
    if isinstance(a, PumpAndValve) and isinstance(a.pump, DatasheetPump) and vehicle.supply:
        return p._replace(supply=vehicle.supply.voltage)
    return p


def _held(vehicle: Vehicle, law: Law, goal: str, given: float | None) -> float:
    """Return the error of the depth that is allowed [m]."""
    if given is not None:
        return given
    assert law.recipe is not None  # tunable
    if law.recipe.held == 0.0:
        return gains.HELD.get(goal, 0.0)
    own = vehicle.controller
    if own is not None and own.law == law.name:
        return float(leaves(bind(own)[1])[law.band])
    return law.recipe.held


def _with_noise(vehicle: Vehicle) -> tuple[Vehicle, str]:
    """Return the vehicle with a sensor as noisy as its logs were, and in words how noisy it is."""
    sensors, known = vehicle.sensors, vehicle.identified
    if sensors.depth_noise == 0.0 and known is not None and known.depth_noise > 0.0:
        noisy = sensors.model_copy(update={"depth_noise": known.depth_noise})
        vehicle = vehicle.model_copy(update={"sensors": noisy})
        return vehicle, f"depth noise of {1e3 * known.depth_noise:.2g} mm, as in the logs"
    if sensors.depth_noise == 0.0 and sensors.depth_quantum == 0.0:
        return vehicle, "a depth sensor without noise: say what yours has (--depth-noise)"
    words = f"depth noise of {1e3 * sensors.depth_noise:.2g} mm"
    if sensors.depth_quantum > 0.0:
        words += f" and a quantum of {1e3 * sensors.depth_quantum:.2g} mm"
    return vehicle, words


def _sample_time(vehicle: Vehicle, given: float | None) -> float:
    if given is None and vehicle.controller is not None:
        return vehicle.controller.sample_time
    if given is None or not 0.0 < given < math.inf:
        what = "the sample time must be a finite time above 0"
        remedy = 'Give it, like --sample-time "0.3 s"'
        raise InputError(what, field="--sample-time", value=given, unit="s", remedy=remedy)
    return given


def _check_reach(
    vehicle: Vehicle, depths: tuple[float, ...], supply: float, around: Region, layers: Layers
) -> None:
    """Raise NoAnswerError where stroke or supply does not reach one of the depths, least first."""
    deepest, rating = depths[-1], vehicle.hull.depth_limit
    if rating is not None and deepest > rating:
        raise NoAnswerError(
            f"the hull is rated for {rating:g} m, and {deepest:g} m are asked for: no law changes "
            f"that. Tune for less depth {_ASKED}"
        )
    stroke = vehicle.stroke
    cure = f"Trim it otherwise, give it more stroke, or tune for other depths {_ASKED}"
    for depth in depths:
        neutral = vehicle.neutral_volume(depth) + layers.at(depth)
        if not stroke.lowest < neutral < stroke.highest:
            raise NoAnswerError(
                f"at {depth:g} m the vehicle is neutral at {1e6 * neutral:.4g} cm3, outside its "
                f"stroke of {1e6 * stroke.lowest:g} to {1e6 * stroke.highest:g} cm3: no law holds "
                f"it there. {cure}"
            )
        each = [p.psi * depth + p.V_0 + layers.at(depth) for p in around.plants]
        low, high = min(each) - around.neutral, max(each) + around.neutral
        if not (stroke.lowest < low and high < stroke.highest):
            raise NoAnswerError(
                f"at {depth:g} m the vehicle may be neutral anywhere from {1e6 * low:.4g} to "
                f"{1e6 * high:.4g} cm3, beyond its stroke of {1e6 * stroke.lowest:g} to "
                f"{1e6 * stroke.highest:g} cm3: no law holds all of these vehicles there. {cure}"
            )
    if vehicle.command == "volume change":
        pump = pump_stall(with_supply(vehicle, supply), depth=deepest)
        if pump.holding_depth <= deepest:
            at = f"with {supply:.3g} V " if math.isfinite(supply) else ""
            raise NoAnswerError(
                f"{at}the pump presses out less than leaks back below {pump.holding_depth:.4g} m: "
                f"no law brings the vehicle up from {deepest:g} m. It takes a stronger pump, a "
                f"higher supply, or less depth {_ASKED}"
            )
        return
    if not vehicle.voltage_driven:
        return
    p = plant(vehicle)._replace(supply=supply)
    limit = stall(p, depth=deepest, depth_limit=None).depth
    if limit is not None and deepest >= limit:
        raise NoAnswerError(
            f"with {supply:.3g} V the motor can no longer extend below {limit:.4g} m: no law holds "
            f"the vehicle at {deepest:g} m. It takes a higher supply, or less depth {_ASKED}"
        )


def _step(depths: tuple[float, float], given: tuple[float, float] | None) -> tuple[float, float]:
    if given is None:
        return trial.usual_step(*depths)
    if not (given[0] != given[1] and min(given) >= 0.0 and max(given) < math.inf):
        remedy = "Give two different depths, like 1.5:3"
        raise gains.refused_depths("no step of depth", given, remedy, field="--step")
    return given


def _outside(depths: tuple[float, float], step: tuple[float, float]) -> list[str]:
    """Return what there is to say of a step that leaves the range of depths [m]."""
    beyond = [f"{end:g} m" for end in step if not depths[0] <= end <= depths[1]]
    if not beyond:
        return []
    return [
        f"the step of the trials, {step[0]:g} to {step[1]:g} m, leaves the depths of "
        f"{depths[0]:g} to {depths[1]:g} m (--depth): the margins are judged at "
        f"{' and '.join(beyond)} as well"
    ]


def _in_water(column: Column | None, off: NDArray[np.float64], *, pumped: bool) -> list[str]:
    """Return what is to be said of a cast; off [m3]: what it adds to the neutral volume."""
    if column is None:
        return []
    judged = "margins are those in the vehicle's own water"
    if pumped:
        judged = "decisions are judged with psi as that water has it at each depth"
    return [
        *(f"cast: {remark}" for remark in column.report),
        f"the trials are flown in the water of {column.source}, which moves the neutral volume by "
        f"{1e6 * float(off.min()):.3g} to {1e6 * float(off.max()):.3g} cm3; {judged}",
    ]


def _watched(vehicle: Vehicle, supply: float, distance: float, h: float) -> float:
    """Return how long a step is watched [s]: many times the least that the motor needs."""
    p = plant(vehicle)
    jerk = (p.gain * supply if vehicle.voltage_driven else p.rate) * p.a_b
    least = math.cbrt(32.0 * distance / jerk)
    return max(math.ceil(_WATCHED * least / h), 200) * h
