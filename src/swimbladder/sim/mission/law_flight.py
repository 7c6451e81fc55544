"""What flies a mission by laws that sample: a block of the closed loop for each law in turn."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law, leaf_names, leaves
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.physics.actuator import reduced
from swimbladder.physics.arrays import Array
from swimbladder.physics.steady_drives import battery_power, terminal_power
from swimbladder.sim.closed_loop.block import Block, Running, like_of
from swimbladder.sim.closed_loop.dispatch import extent
from swimbladder.sim.closed_loop.lane import Row, rows
from swimbladder.sim.closed_loop.lanes import OVER, Schedule
from swimbladder.sim.closed_loop.solution import StopReason
from swimbladder.sim.engine.chain import base_steps
from swimbladder.sim.engine.modes import POSITIONER
from swimbladder.sim.engine.rodas.records import Stop
from swimbladder.sim.mission.core.hooks import MANY, fly
from swimbladder.sim.mission.core.phases import Phases
from swimbladder.sim.mission.core.sampled import WAY, Boarded, Numbers, Sampled, Way
from swimbladder.sim.mission.orders import ASLEEP, growth_rate
from swimbladder.sim.mission.prepare import Plan, cost_words
from swimbladder.vehicle import Positioner, Vehicle

_ROWS = 40_000  # of a trajectory, about
_SPAN = 60.0  # s, of a row at the longest
_CHUNK = 1 << 14  # samples between calls: progress, interruption, memory of the noise
_PAUSE = 600.0  # s between two checks of a law that rests, at most
_DRIFT = 0.01  # m/s, about as fast as a vehicle drifts that rests


class ByRule:
    """A mission by its own rule, or by a law of volume changes in the place of that.

    What the rule remembers stands in the arrays of the phases.
    """

    rows = 40_000  # of a part

    def __init__(self, mission: Mission, plan: Plan) -> None:
        self.mission, self.own = mission, dict[str, Any]()
        self.watch = plan.watch.over(1) if plan.watch else ()
        for law in plan.laws[:1]:
            like = like_of(law.law, law.parameters, self.watch)
            work = np.zeros(rows(extent(like.parameters), extent(like.state)))
            self.own = {"law": law.law, "like": like, "work": work}

    def board(self, phases: Phases) -> Boarded | None:  # noqa: ARG002
        """Return what flies at every tick, where a board does."""
        return None

    def fly(self, phases: Phases) -> Stop:
        """Fly on until a cycle is over, a buffer is full, or the mission ends."""
        stop = fly(phases, **self.own, board=self.board(phases))
        if self.own and stop is Stop.STUCK:
            why = int(self.own["work"][Row.STOPPED] % OVER)
            said = list(StopReason)[why].value if why else "It asks to be called again at once."
            raise _stuck(self.own["law"], self.mission, phases, said)
        return stop

    def kept(self) -> dict[str, NDArray[Any]]:
        """Return what `resume` needs beside the phases."""
        return {"work": self.own["work"]} if self.own else {}

    def resume(self, kept: dict[str, NDArray[Any]]) -> None:
        """Go on from what was kept."""
        for name, there in self.kept().items():
            there[:] = kept[name]


class ByBoard(ByRule):
    """A mission of a float as flashed: its board's law at every tick, the supervisor on watch."""

    rows = 4000  # of a part

    def __init__(self, mission: Mission, plan: Plan) -> None:
        cost_words(mission, plan.laws)  # refuses what is too long
        super().__init__(mission, plan)
        first, like, work = plan.laws[0], self.own["like"], self.own["work"]
        self.tick = first.sample_time
        work[Row.PLANT + POSITIONER] = math.nan  # neither a motor nor a positioner
        work[Row.LOW_U], work[Row.HIGH_U] = -self.tick, self.tick
        # one in a tick at most, beside those of what happens
        self.last, self.span = np.zeros(1), max(min(_SPAN, plan.longest / _ROWS), self.tick)
        floats = extent(like.parameters) + leaf_names(first.law.state).index("floats")
        self.knows = work[Row.LAW + floats :][:1]

    def board(self, phases: Phases) -> Boarded:
        """Return the board."""
        assert self.watch
        return Boarded(phases, self.tick, self.span, self.last, self.watch.reason, self.knows)

    def kept(self) -> dict[str, NDArray[Any]]:
        """Return what `resume` needs beside the phases."""
        assert self.watch
        return super().kept() | {"watch": self.watch.memory, "last": self.last}


class ByLaws:
    """A mission by laws that sample, flown from call to call.

    state: of `first_state`; its volume is made the neutral one where none was given. seed: of the
    sensors' noise, None: they have neither noise nor quantum.
    """

    rows = 4000  # of a part

    def __init__(
        self,
        vehicle: Vehicle,
        mission: Mission,
        plan: Plan,
        state: Any,
        *,
        seed: int | None,
        volume: float | None = None,
    ) -> None:
        cost_words(mission, plan.laws)  # refuses what is too long
        self.vehicle, self.mission, self.plan = vehicle, mission, plan
        self.phases = plan.under_way(state)
        self.medium = plan.medium(vehicle)
        x, p = state[0], self.medium.plant
        for number, phase in enumerate(mission.phases):
            self._parts(number, phase.speed or 0.0)
        if mission.start_depth != 0.0 and volume is None:
            x["v"] = self.medium.neutral_volume(mission.start_depth)
        if not p.V_min <= x["v"] <= p.V_max:
            stroke = f"the stroke, {p.V_min * 1e6:g} to {p.V_max * 1e6:g} cm3"
            what, depth = f"{stroke}, does not hold the volume at the start", mission.start_depth
            remedy = "Start where the stroke can balance the vehicle"
            raise InputError(what, field="start_depth", value=depth, unit="m", remedy=remedy)
        x["v_least"] = x["v"]
        same = [[one.continues(law) for one in plan.laws].index(True) for law in plan.laws]
        bands = [phase.rest_band or 0.0 for phase in mission.phases]
        speeds = [phase.speed or 0.0 for phase in mission.phases]
        self.tasks = np.column_stack([same, bands, speeds])  # in C's order: one kernel for all
        self.watch = plan.watch.over(1) if plan.watch else ()
        self.random: np.random.Generator | None = None
        if seed is not None:
            self.random = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 0])))
        self.noise = np.zeros((0, 2, 1))  # drawn, and not used up yet
        self.way = np.zeros(1, WAY)
        self.way[0] = Way()
        self.running: Running

    def fly(self, phases: Phases) -> Stop:
        """Fly on: many samples, or until a law begins, a buffer is full or the mission ends."""
        now: Any = self.way[0]
        x, at = phases.lane.x, phases.lane.at
        law = self.tasks[at["phase"], 0]
        if law != now["law"]:
            q = 0.0 if now["law"] < 0.0 else self.running.block.work[Row.Q, 0]
            now["law"], now["begun"], now["tick"], now["called"] = law, x["t"], 0.0, 0.0
            now["parts"] = self._parts(int(law), x["w"])
            self._lay_out(np.array([q, x["v"], x["z"], x["w"]]))
        block, first = self.running.block, int(now["tick"])
        block.hooks = block.hooks._replace(phases=phases)
        self.running.advance(first, first + _CHUNK, self._drawn(_CHUNK))
        done = int(now["tick"]) - first
        now["drawn"] += done
        self.noise = self.noise[done:]
        why = block.work[Row.STOPPED]
        if at["stop"] == Stop.STUCK:
            raise _stuck(block.law, self.mission, phases, list(StopReason)[int(why[0])].value)
        why[why == OVER] = 0.0
        return Stop(int(at["stop"]))

    def _parts(self, number: int, speed: float) -> int:
        """Return in how many steps a sample of a phase's law is computed, from a speed [m/s] on."""
        try:
            tick = self.plan.laws[number].sample_time
            medium = self.medium
            return base_steps(medium.plant, tick, speed, medium.layers, booked=True)
        except InputError as error:
            if self.mission.phases[number].sample_time is None:
                raise
            what, field = f"it is too long: {error.what}", f"phases[{number}].sample_time"
            given = {"what": what, "field": field, "value": tick, "unit": "s"}
            raise error.but(**given, remedy="Take a shorter one") from None

    def kept(self) -> dict[str, NDArray[Any]]:
        """Return all that `resume` needs to go on from here, beside the phases."""
        block, built = self.running.block, self.running.built
        found = dict(way=self.way, work=block.work, sums=block.accounts, log=block.log)
        found |= {"watch": self.watch.memory} if self.watch else {}
        chains = self.running.chains[built == 1]
        return found | dict(noted=block.noted, built=built, chains=chains)

    def resume(self, kept: dict[str, NDArray[Any]]) -> None:
        """Go on from what was kept."""
        self.way[:] = kept["way"]
        self._lay_out(kept["work"][Row.Q : Row.Q + 4, 0])
        self.running.built[:] = kept["built"]
        self.running.chains[kept["built"] == 1] = kept["chains"]
        for name, there in self.kept().items():
            there[:] = kept[name]
        drawn = int(self.way["drawn"][0])
        for n in range(0, drawn, _CHUNK):
            self.noise = self._drawn(_CHUNK)[min(_CHUNK, drawn - n) :]

    def _drawn(self, samples: int) -> Array:
        """Return what the sensors of so many samples add, of standard normal distribution."""
        lacks = samples - len(self.noise)
        if self.random is not None and lacks > 0:
            fresh = self.random.standard_normal((lacks, 2))[:, :, None]
            self.noise = np.concatenate((self.noise, fresh))
        return self.noise

    def _lay_out(self, start: Array) -> None:
        """Lay out the block of the law that is to fly from a state (q, V, z, w)."""
        now: Any = self.way[0]
        law, medium = self.plan.laws[int(now["law"])], self.medium
        block = Block(
            plants=np.array(medium.plant)[:, None],
            law=law.law,
            parameters=leaves(law.parameters),
            clock=Schedule(tick=law.sample_time, turn=MANY, given=np.zeros(1, np.int64)),
            parts=int(now["parts"]),
            depths=np.zeros((1, 1)),
            start=start[:, None],
            sensors=self.vehicle.sensors,
            booked=True,
            logged=True,
            layers=medium.layers,
            watch=self.watch,
        )
        own = self._numbers(law.sample_time)
        block.hooks = Sampled(
            self.phases,
            own,
            now,
            self.tasks,
            block.accounts,
            log=block.log,
            noted=block.noted,
            reason=self.watch.reason if self.watch else np.zeros(1),
        )
        self.running = block.begin()

    def _numbers(self, tick: float) -> Numbers:
        """Return the numbers of the vehicle while a law of this sample time [s] flies."""
        v, medium, a = self.vehicle, self.medium, self.vehicle.engine
        p, sensor = medium.plant, v.sensors
        sigma = growth_rate(v, p.psi + medium.layers.steepest, _DRIFT)
        found = Numbers(
            tick=tick,
            weight=medium.specific_weight,
            neutral_top=medium.neutral_volume(max(p.z_surface, 0.0)),
            row_samples=float(max(int(min(_SPAN, self.plan.longest / _ROWS) / tick), 1)),
            longest=min(_PAUSE, ASLEEP / sigma) if sigma > 0.0 else _PAUSE,
            unseen=0.0 if self.random is None else 3.0 * sensor.depth_noise + sensor.depth_quantum,
        )
        if self.plan.energy_known:  # why it is not
            return found
        if isinstance(a, Positioner):
            powers = np.array([a.moving_power or 0.0, a.holding_power])
            moving, holding = battery_power(terminal_power(powers, v.driver), v.supply).tolist()
            return found._replace(moving=moving, holding=holding)
        motor = reduced(a, v.water)
        assert motor.resistance is not None
        assert motor.kappa is not None
        given, back = terminal_power(np.array([1.0, -1.0]), v.driver).tolist()
        found = found._replace(
            conductance=1.0 / motor.resistance,
            kappa=motor.kappa / float(self.plan.given["delivery"]),
            given=given,
            back=-back,
        )
        if v.supply is None:
            return found
        return found._replace(emf=v.supply.voltage, resistance=v.supply.internal_resistance)


Pilot = ByRule | ByLaws


def pilot_of(vehicle: Vehicle, mission: Mission, plan: Plan, state: Any, **more: Any) -> Pilot:
    """Return what flies a mission from a state; more: seed and volume, as `ByLaws` has them."""
    if plan.water is None:
        return ByBoard(mission, plan) if plan.watch else ByRule(mission, plan)
    return ByLaws(vehicle, mission, plan, state, **more)


def _stuck(law: Law, mission: Mission, phases: Phases, why: str) -> NoAnswerError:
    """Return what is said of a law that the simulation cannot go on with."""
    x, at = phases.lane.x, phases.lane.at
    where = f"in the phase {mission.titles[int(at['phase'])]!r}, after {x['t']:.6g} s"
    return NoAnswerError(f"the law {law.name!r} {where}: {why}")
