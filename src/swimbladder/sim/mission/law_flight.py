"""A mission flown by laws that are called at each sample: phases between spans of the closed loop.

`closed_loop` moves the vehicle, its law and its sensors; `mission.core.hooks` says after each
span what that means: arrival, holding, surfacing, the end of a phase, the battery. A span is as
long as one row of the trajectory, and is taken again sample by sample where something is decided in
it, so that phases change at a sample.

Where no law is called the same engine goes on with a held input, in long steps: all volume out to
surface or after the alarm, afloat, at rest within a `rest_band`, and to dive, until the vehicle has
no more volume than makes it neutral at the surface: a law takes the volume that it begins with for
the neutral one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.records import leaves
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.mission import Mission
from swimbladder.jobs import Store, identity
from swimbladder.physics.actuator import reduced
from swimbladder.physics.seawater import Column
from swimbladder.physics.steady_drives import battery_power, terminal_power
from swimbladder.sim.closed_loop.block import Block, Schedule, work_space
from swimbladder.sim.closed_loop.lanes import measure_block
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.sim.closed_loop.rows import Row
from swimbladder.sim.closed_loop.solution import StopReason
from swimbladder.sim.closed_loop.water import Medium, medium_of
from swimbladder.sim.engine.advance import DONE, advance, begin
from swimbladder.sim.engine.books import Account as Sums
from swimbladder.sim.engine.chain import book_steps
from swimbladder.sim.engine.modes import COUNT, Act, Where
from swimbladder.sim.engine.rodas.drive import FULL
from swimbladder.sim.engine.rodas.names import Account, At, Doing, Given, Note, Now, Stop
from swimbladder.sim.mission.core.hooks import phase_step
from swimbladder.sim.mission.core.names import Kind, Stage
from swimbladder.sim.mission.core.names import Row as Out
from swimbladder.sim.mission.orders import ASLEEP, runaway
from swimbladder.sim.mission.phase_laws import PhaseLaw
from swimbladder.sim.mission.prepare import Plan
from swimbladder.vehicle import Positioner, Vehicle

Array = NDArray[np.float64]

_ROWS = 40_000  # of a trajectory, about
_SPAN = 60.0  # s, of a row at the longest
_MOST = 10**8  # samples of a mission
_ROOM = 64  # rows, notes and cycles that a span adds at most
_LOG = 2000  # passages kept of a span
_LOOK, _PAUSE = 10.0, 600.0  # s between two looks of a law that rests, at least and at most
_DRIFT = 0.01  # m/s, about as fast as a vehicle drifts that rests
_STILL = 0.01  # share of its band that a vehicle may drift between two of them, to be let rest
_KEPT = 2000  # rows after which a flight is kept
_SHORT = 0.02  # s, of a step at full voltage at the shortest
_NO_LAYER = 1e-12  # m3: what rounding makes of even water


def medium_for(vehicle: Vehicle, mission: Mission, column: Column) -> Medium:
    """Return the vehicle in the water of a mission; in even water as in its own."""
    depths = [phase.depth for phase in mission.phases if phase.depth is not None]
    reach = max([mission.start_depth, *depths])
    found = medium_of(vehicle, column, reach=reach, bottom_depth=mission.bottom)
    own = medium_of(vehicle, None, reach=reach, bottom_depth=mission.bottom)
    even = found.layers.largest <= _NO_LAYER
    return own if even and math.isclose(found.plant.a_b, own.plant.a_b, rel_tol=1e-9) else found


def _own_medium(medium: Medium, vehicle: Vehicle, given: Array) -> Medium:
    """Return what the numbers of a plan make of it: a float may differ from its vehicle's file."""
    p, delivery = medium.plant, float(given[Given.DELIVERY])
    mass = float(given[Given.MASS]) / vehicle.mass
    own = p._replace(
        V_0=p.V_0 + float(given[Given.TRIM]), psi=p.psi + float(given[Given.GIVE]),
        gain=p.gain * delivery, rate=p.rate * delivery, kappa=p.kappa / delivery, a_b=p.a_b / mass,
        a_s=p.a_s / mass, d_l=float(given[Given.D_L]), d_b=float(given[Given.D_B]),
        d_0=float(given[Given.D_0]), d_t=float(given[Given.D_T]),
    )  # fmt: skip
    return replace(medium, plant=own)


def check_samples(mission: Mission, plan: Plan) -> None:
    """Raise NoAnswerError where a law would be called too often, with what that costs."""
    for phase, stage, law in zip(mission.phases, plan.stages, plan.laws, strict=True):
        samples = float(stage[Stage.DURATION]) / law.sample_time
        if samples > _MOST and phase.rest_band is None:
            raise NoAnswerError(
                f"the law {law.law.name!r} samples {samples / 1e6:.3g} million times in the phase "
                f"{phase.title!r}, every {law.sample_time:g} s: more than the {_MOST / 1e6:g} "
                "million that are flown. Let it rest (rest_band), take a longer sample_time, or "
                'write law = "rate" in every phase, which looks seldom'
            )


@dataclass
class _Meter:
    """What the drive draws from the battery's cells, from the accounts of the engine."""

    vehicle: Vehicle
    known: bool
    delivery: float  # of the drive over what its file says

    def energy(self, sums: Array, h: float) -> float:
        """Return the energy [J] of h [s] with these sums; 0 where it is not known."""
        a, v = self.vehicle.actuator, self.vehicle
        if not self.known:
            return 0.0
        if isinstance(a, Positioner):
            on = min(float(sums[Sums.MOTOR_ON]), h)
            powers = np.array([a.moving_power or 0.0, a.holding_power])
            cells = battery_power(terminal_power(powers, v.driver), v.supply)
            return float(cells[0] * on + cells[1] * (h - on))
        found = reduced(a, v.water)
        assert found.resistance is not None
        assert found.kappa is not None
        kappa = found.kappa / self.delivery
        motor = float(sums[Sums.U_U] - kappa * sums[Sums.U_Q]) / found.resistance
        cells = battery_power(terminal_power(np.array([motor / h]), v.driver), v.supply)
        return float(cells[0]) * h


class _Loop:
    """The closed loop of one law, from one state on, span by span."""

    def __init__(
        self, vehicle: Vehicle, medium: Medium, law: PhaseLaw, state: Array, depth: float,
        samples: int,
    ) -> None:  # fmt: skip
        self.law, self.start, self.depth, self.samples = law, state, depth, samples
        parts = book_steps(medium.plant, law.sample_time, float(state[3]), medium.layers)
        clock = Schedule(
            tick=law.sample_time, turn=np.zeros(samples + 2, np.int64),
            given=np.zeros(1, np.int64),
        )  # fmt: skip
        block = Block.lay_out(
            plants=np.array(medium.plant)[:, None], law=law.law, parameters=leaves(law.parameters),
            clock=clock, parts=parts, depths=np.array([[depth]]), start=state[:4, None],
            sensors=vehicle.sensors, seeds=None, record=False, books=True, events=True,
            layers=medium.layers,
        )  # fmt: skip
        self.block, self.done, self.running = block, 0, block.begin()

    def ask(self, depth: float) -> None:
        """Ask for a depth [m] from the next sample on."""
        self.block.work[Row.REFERENCE] = depth

    def run(self, noise: Array) -> None:
        """Go on by as many samples as there is noise for [n, 2, 1]; nan: ideal sensors."""
        b, n = self.block, len(noise)
        b.noted[:] = 0
        given = noise if not math.isnan(noise[0, 0, 0]) else noise[:0]
        self.running.advance(self.done, self.done + n, given)
        self.done += n

    def kept(self) -> tuple[Array, Array, int]:
        """Return all that `put_back` needs to go back to here."""
        return self.block.work.copy(), self.block.books.copy(), self.done

    def put_back(self, kept: tuple[Array, Array, int]) -> None:
        """Go back to an earlier sample."""
        self.block.work[:], self.block.books[:], self.done = kept


_NUMBERS = ("mode", "q", "rests", "seen", "pause", "phase_begin", "phase_from")


class _Flight:
    """One mission on its way."""

    def __init__(
        self, vehicle: Vehicle, mission: Mission, column: Column, plan: Plan, state: Any,
        seed: int | None, store: Store,
    ) -> None:  # fmt: skip
        self.vehicle, self.mission, self.plan = vehicle, mission, plan
        self.store, self.written, self.kept = store, 0, 0
        self.x, self.at, self.accounts = state
        self.medium = _own_medium(medium_for(vehicle, mission, column), vehicle, plan.given)
        self.p = np.array(self.medium.plant)
        self.random = None
        if seed is not None:
            self.random = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 0])))
        self.drawn = np.zeros((0, 2, 1))
        self.meter = _Meter(vehicle, not plan.energy_known, float(plan.given[Given.DELIVERY]))
        self.loop: _Loop | None = None
        self.mode = -1  # of the engine while no law is called; -1: it is
        self.q = 0.0
        self.rests, self.seen, self.pause = False, math.nan, _LOOK
        psi = self.medium.plant.psi + self.medium.layers.steepest
        sigma = runaway(vehicle, psi, _DRIFT)
        self.longest_pause = min(_PAUSE, ASLEEP / sigma) if sigma > 0.0 else _PAUSE
        self.phase_begin, self.phase_from = math.nan, math.nan
        self.row_time = min(_SPAN, _longest(plan) / _ROWS)
        self.step = 10.0 / book_steps(self.medium.plant, 10.0, 0.0, self.medium.layers)
        self.chains, self.built = work_space(1)[0], np.zeros(COUNT, np.uint8)
        self.chain_step = 0.0
        self.phases = plan.under_way(state, rows=_ROOM, notes=_LOG + _ROOM, cycles=4)
        self.rows, self.notes = self.phases.rows, self.phases.notes
        self.cycles, self.counts = self.phases.cycles, self.phases.counts
        self.parts: list[tuple[Array, Array, Array]] = []
        self.last: Array | None = None  # the row that the next span begins at

    @property
    def law(self) -> PhaseLaw:
        """The law of the present phase."""
        return self.plan.laws[int(self.at[At.PHASE])]

    @property
    def stage(self) -> Array:
        """The present phase."""
        return np.asarray(self.plan.stages[int(self.at[At.PHASE])])

    def fly(self, advance_by: Callable[[float], None], share: Callable[..., float]) -> None:
        """Fly to the end."""
        if not self.written:
            self._step(0.0, math.nan, 0.0)
        done = 0.0
        while self.at[At.STOP] == 0:
            command = self._command()
            if command is None:
                self._sampled()
            else:
                self._held(command)
            now = min(share(self.x, self.at), 1.0)
            advance_by(now - done)
            done = now
            if sum(len(part[0]) for part in self.parts[self.kept :]) >= _KEPT:
                self._keep()

    def resume(self) -> None:
        """Go on where the last flight that was kept has come to."""
        while (found := self.store.read("part", self.written)) is not None:
            if self.parts:  # what was done from its last row on was not known when it was kept
                self.parts[-1][0][-1, Out.DOING] = found["before"]
            self.parts.append((found["rows"], found["notes"], found["cycles"]))
            self.written += 1
            last = found
        if not self.written:
            return
        self.kept, self.last = len(self.parts), self.parts[-1][0][-1]
        self.x[:], self.at[:], self.accounts[:] = last["x"], last["at"], last["accounts"]
        for name, value in zip(_NUMBERS, last["numbers"].tolist(), strict=True):
            setattr(self, name, value)
        self.mode, self.rests, self.drawn = int(self.mode), bool(self.rests), last["drawn"]
        if self.random is not None:
            generator: Any = self.random.bit_generator
            state = generator.state
            state["state"] = {"counter": last["counter"], "key": last["key"]}
            state["buffer"], state["buffer_pos"] = last["buffer"], int(last["buffer_pos"])
            generator.state = state
        if "work" in last:
            phase, samples, done = (int(n) for n in last["loop"][:3])
            law, depth = self.plan.laws[phase], float(last["loop"][3])
            self.loop = _Loop(self.vehicle, self.medium, law, last["start"], depth, samples)
            self.loop.put_back((last["work"], last["sums"], done))
            self.loop.running.chains[:], self.loop.running.built[:] = last["chains"], last["built"]

    def _keep(self) -> None:
        """Keep what was flown since the last time, and all that it takes to go on from here."""
        new = self.parts[self.kept :]
        rows, notes, cycles = (np.concatenate([part[n] for part in new]) for n in range(3))
        numbers = np.array([getattr(self, name) for name in _NUMBERS], float)
        found = {"rows": rows, "notes": notes, "cycles": cycles, "numbers": numbers}
        found |= {"x": self.x, "at": self.at, "accounts": self.accounts, "drawn": self.drawn}
        found["before"] = np.array(self.parts[self.kept - 1][0][-1, Out.DOING])
        if self.random is not None:
            state: Any = self.random.bit_generator.state
            found |= {**state["state"], "buffer": state["buffer"]}
            found["buffer_pos"] = np.array(state["buffer_pos"])
        if self.loop is not None:
            loop = self.loop
            work, sums, done = loop.kept()
            made = np.array([self.plan.laws.index(loop.law), loop.samples, done, loop.depth])
            found |= {"work": work, "sums": sums, "start": loop.start, "loop": made}
            found |= {"chains": loop.running.chains, "built": loop.running.built}
        self.store.write(found, "part", self.written)
        self.written, self.kept = self.written + 1, len(self.parts)

    def _command(self) -> float | None:
        """Return the input that is held, in volts or m3; None: the law is called."""
        x, at, stage, p = self.x, self.at, self.stage, self.medium.plant
        rested, self.rests = self.rests, False
        surface = stage[Stage.KIND] == Kind.SURFACE
        shallow = x[Now.Z] <= self.plan.given[Given.SHALLOW]
        if at[At.ALARM] == 1 or (surface and (shallow or at[At.ARRIVED] == 1)):
            if p.positioner:
                return p.V_max
            full = x[Now.V] >= p.V_max - FULL * (p.V_max - p.V_min)
            return self._holding_voltage() if full else p.supply
        if self.loop is None or self.mode != -1:  # a law begins, and takes what it sees for neutral
            goal = self.medium.neutral_volume(max(p.z_surface, 0.0))
            if at[At.PLACE] == Where.EMERGING and x[Now.V] > goal + FULL * (p.V_max - p.V_min):
                return goal if p.positioner else -p.supply
        band = self.mission.phases[int(at[At.PHASE])].rest_band
        if band is None or at[At.ARRIVED] == 0:
            self.seen, self.pause = math.nan, _LOOK
        elif self._may_rest(band, rested):
            return float(x[Now.V]) if p.positioner else self._holding_voltage()
        return None

    def _may_rest(self, band: float, rested: bool) -> bool:
        """Return whether the law rests until the next look; rested: it did until this one."""
        depth = float(self.stage[Stage.DEPTH])
        sensor, seen = self.vehicle.sensors, float(self.x[Now.Z])
        if self.random is not None and self.loop is not None:
            work = self.loop.block.work
            work[[Row.Z, Row.V], 0] = self.x[[Now.Z, Now.V]]
            measure_block(work.reshape(-1), (0.0,), self._noise(1), 0)
            seen = float(work[Row.SEEN_DEPTH, 0])
        drift, left = abs(seen - self.seen), band - abs(seen - depth)
        speed = max(drift / self.pause, 1e-9)
        unseen = 0.0 if self.random is None else 3.0 * sensor.depth_noise + sensor.depth_quantum
        still = left >= 0.5 * band and drift <= max(_STILL * band, unseen)
        self.rests = left >= 0.0 if rested else still
        # at constant acceleration from rest it is then at the edge of its band at most
        self.pause = max(min(0.25 * left / speed, 2.0 * self.pause, self.longest_pause), _LOOK)
        if not self.rests:
            self.pause = _LOOK
        self.seen = seen
        return self.rests

    def _holding_voltage(self) -> float:
        """Return the voltage that holds the volume against the sea [V]."""
        p = self.medium.plant
        return max(p.load_back * max(float(self.x[Now.Z]), 0.0) - p.friction, 0.0)

    def _noise(self, n: int) -> Array:
        """Return what the sensors of n samples add, of standard normal distribution [n, 2, 1]."""
        if self.random is None:
            return np.full((n, 2, 1), np.nan)
        lacks = n - len(self.drawn)
        if lacks > 0:
            fresh = self.random.standard_normal((lacks, 2))[:, :, None]
            self.drawn = np.concatenate((self.drawn, fresh))
        found, self.drawn = self.drawn[:n], self.drawn[n:]
        return np.ascontiguousarray(found)

    def _sampled(self) -> None:
        """Fly a span by the law of the phase."""
        x = self.x
        depth, arriving = self._asked()
        law = self.law
        if self.mode != -1 or self.loop is None or not law.continues(self.loop.law):
            state = np.array([0.0 if self.loop is None else self.q, *x[[Now.V, Now.Z, Now.W]]])
            samples = min(_longest(self.plan) / law.sample_time + 2.0, 2.0 * _MOST)
            self.loop = _Loop(self.vehicle, self.medium, law, state, depth, int(samples))
            self.mode = -1
        loop = self.loop
        loop.ask(depth)
        tick = law.sample_time
        band = self.mission.phases[int(self.at[At.PHASE])].rest_band
        span = self.row_time if band is None or self.at[At.ARRIVED] == 0 else _LOOK
        span = span if arriving else tick
        left = math.ceil((x[Now.T_END] - x[Now.T]) / tick - 1e-9)
        n = max(1, min(int(span / tick), left))
        noise = self._noise(n)
        kept = loop.kept()
        self._run(loop, noise)
        if n > 1 and (self._decides(loop) or loop.block.work[Row.STOPPED, 0] != 0.0):
            loop.put_back(kept)
            for k in range(n):
                kept = loop.kept()
                self._run(loop, noise[k : k + 1])
                if self._decides(loop) or loop.block.work[Row.STOPPED, 0] != 0.0:
                    self.drawn = np.concatenate((noise[k + 1 :], self.drawn))
                    break
                if k < n - 1:
                    self._after_samples(loop, kept)
        self._after_samples(loop, kept)

    def _asked(self) -> tuple[float, bool]:
        """Return the depth asked for [m], and whether it stays: at a phase's speed it moves."""
        stage, x = self.stage, self.x
        phase = self.mission.phases[int(self.at[At.PHASE])]
        end = 0.0 if phase.depth is None else float(stage[Stage.DEPTH])
        if phase.speed is None:
            return end, True
        if self.phase_begin != x[Now.T_PHASE]:
            self.phase_begin, self.phase_from = float(x[Now.T_PHASE]), float(x[Now.Z])
        way = phase.speed * (x[Now.T] - x[Now.T_PHASE])
        left = abs(end - self.phase_from) - way
        return end - math.copysign(max(left, 0.0), end - self.phase_from), left <= 0.0

    def _run(self, loop: _Loop, noise: Array) -> None:
        work = loop.block.work
        work[[Row.Z_LOWEST, Row.Z_HIGHEST]] = work[Row.Z]
        work[[Row.V_LOWEST, Row.V_HIGHEST]] = work[Row.V]
        loop.run(noise)

    def _decides(self, loop: _Loop) -> bool:
        """Return whether something that the mission waits for lies in the samples just flown."""
        low, high = loop.block.work[[Row.Z_LOWEST, Row.Z_HIGHEST], 0]
        stage, g = self.stage, self.plan.given
        if stage[Stage.KIND] == Kind.SURFACE:
            return bool(low <= g[Given.SHALLOW] or high > g[Given.DEEPEST])
        depth, tolerance = stage[Stage.DEPTH], stage[Stage.TOLERANCE]
        near = low <= depth + tolerance and high >= depth - tolerance
        return bool((self.at[At.ARRIVED] == 0 and near) or high > g[Given.DEEPEST])

    def _after_samples(self, loop: _Loop, kept: tuple[Array, Array, int]) -> None:
        work, tick = loop.block.work, loop.law.sample_time
        h = (loop.done - kept[2]) * tick
        if work[Row.STOPPED, 0] != 0.0:
            h = max(work[Row.STOP_TICK, 0] - kept[2], 1.0) * tick
            self._stopped(list(StopReason)[int(work[Row.STOPPED, 0])])
        log = loop.block.log[0, : min(int(loop.block.noted[0, 0]), _LOG)].copy()
        log[:, 0] += self.x[Now.T] - kept[2] * tick
        self.at[At.PLACE] = int(work[Row.MODE, 0]) // 20
        self.q = float(work[Row.Q, 0])
        ends = work[[Row.Z_HIGHEST, Row.V_LOWEST, Row.V_HIGHEST], 0]
        self.at[At.LOOKS] += loop.done - kept[2]
        self._enter(work[[Row.V, Row.Z, Row.W], 0], loop.block.books[0] - kept[1][0], ends, log, h)

    def _held(self, u: float) -> None:
        """Go on with a held input, without a law."""
        x, p = self.x, self.medium.plant
        if self.mode == -1:
            self.mode, self.q = begin(
                self.p, self.medium.layers, self.q, x[Now.V], x[Now.Z], x[Now.W]
            )
        moves = abs(u - x[Now.V]) > 0.0 if p.positioner else abs(u) == p.supply
        h = min(self.step, _LOOK, 1.0 if moves else math.inf)
        if moves and not p.positioner:  # no further than to where it is neutral, or to the stop
            top = self.medium.neutral_volume(max(p.z_surface, 0.0))
            way = p.V_max - x[Now.V] if u > 0.0 else x[Now.V] - top
            h = min(h, max(way / (p.gain * p.supply), _SHORT))
        h = min(h, max(float(x[Now.T_END] - x[Now.T]), 1e-6))
        if h != self.chain_step:
            self.built[:], self.chain_step = 0, h
        state = np.array([self.q, x[Now.V], x[Now.Z], x[Now.W], 0.0])
        books, log = np.zeros(len(Sums)), np.zeros((_LOG, 3))
        noted = np.zeros(1, np.int64)
        low, high = (p.V_min, p.V_max) if p.positioner else (-p.supply, p.supply)
        steps = 1
        if self.rests:
            steps = max(int(min(self.pause, float(x[Now.T_END] - x[Now.T])) / h + 1e-9), 1)
        for k in range(steps):
            self.mode, why = advance(
                self.p, self.medium.layers, True, self.mode, state, np.zeros(10),
                min(max(u, low), high), h, float(x[Now.T]) + k * h, self.chains, self.built, books,
                log, noted,
            )  # fmt: skip
            if why != DONE:
                self._stopped(list(StopReason)[int(why)])
                steps = k + 1
                break
        self.q = float(state[0])
        self.at[At.PLACE] = self.mode // 20
        ends = np.array([state[2], state[1], state[1]])
        self._enter(state[1:4], books, ends, log[: min(int(noted[0]), _LOG)], steps * h)

    def _stopped(self, why: StopReason) -> None:
        if why is StopReason.LEFT_WATER:
            self.at[At.STOP] = Stop.LEFT_WATER
        elif why is StopReason.TOO_DEEP:
            self.at[At.STOP] = Stop.LOST
        else:
            raise NoAnswerError(
                f"the law {self.law.law.name!r} in the phase "
                f"{self.mission.titles[int(self.at[At.PHASE])]!r}, after {self.x[Now.T]:.6g} s: "
                f"{why.value}"
            )

    def _enter(self, state: Array, sums: Array, ends: Array, log: Array, h: float) -> None:
        """Enter h [s] of motion to (V, z, w) with the engine's sums, and take the phase's step.

        ends: greatest depth, least and greatest volume on the way. log: passages between modes.
        """
        x, at, a = self.x, self.at, self.accounts
        m, k_b = float(self.plan.given[Given.MASS]), self.medium.specific_weight
        before, z = float(x[Now.V]), float(x[Now.Z])
        x[[Now.V, Now.Z, Now.W]] = state
        x[Now.T] += h
        x[Now.Z_MOST] = max(x[Now.Z_MOST], ends[0])
        x[Now.V_LEAST] = min(x[Now.V_LEAST], ends[1])
        if at[At.PLACE] == Where.SUBMERGED:
            x[Now.V_MOST] = max(x[Now.V_MOST], ends[2])
        energy = self.meter.energy(sums, h)
        net = float(sums[Sums.PUMPED])
        out = max(0.5 * float(sums[Sums.TRAVEL] + x[Now.V] - before), net, 0.0)
        doing = Doing.NOTHING
        if out > 0.0 or out - net > 0.0:
            doing = Doing.PUMPING if net >= 0.0 else Doing.LETTING_IN
        a[Account.PUMPED] += out
        a[Account.LET_IN] += out - net
        a[Account.LEAKED] += sums[Sums.LEAKED]
        a[Account.LEAK_WORK] += k_b * sums[Sums.LEAK_Z]
        a[Account.DRAG] += m * sums[Sums.DRAG]
        a[Account.BLOWS] += m * sums[Sums.BOTTOM_W]
        work = k_b * float(sums[Sums.Z_Q])
        begins = doing != at[At.DOING]
        if doing == Doing.PUMPING:
            a[Account.PUMP_WORK] += work
            a[Account.PUMP_ENERGY] += energy
            a[Account.PUMP_TIME] += min(float(sums[Sums.MOTOR_ON]), h)
            a[Account.PUMP_RUNS] += begins
        elif doing == Doing.LETTING_IN:
            a[Account.LET_IN_WORK] -= work
            a[Account.VALVE_ENERGY] += energy
            a[Account.VALVE_TIME] += min(float(sums[Sums.MOTOR_ON]), h)
            a[Account.VALVE_RUNS] += begins
        else:
            a[Account.HOLDING_ENERGY] += energy
        at[At.DOING] = doing
        at[At.STEPS] += 1
        if self.last is not None:
            self.last[Out.DOING] = doing
        self._note_passages(log)
        self._step(h, z, energy)

    def _note_passages(self, log: Array) -> None:
        """Note where the vehicle came to the surface, the bottom or an end stop."""
        x, at = self.x, self.at
        for t, old, new in log:
            what = []
            act, act_was = _stop_of(int(new)), _stop_of(int(old))
            rocks = at[At.ARRIVED] == 1 and self.stage[Stage.KIND] == Kind.SURFACE
            if act is not None and act != act_was and not rocks:
                what.append(act)
            where, was = Where(int(new) // 20), Where(int(old) // 20)
            if where is not was:
                if where is Where.BOTTOM:
                    what.append(Note.BOTTOM)
                elif was is Where.BOTTOM:
                    what.append(Note.LEFT_BOTTOM)
                else:
                    emerges = where is Where.EMERGING
                    what.append(Note.EMERGED if emerges else Note.SUBMERGED)
            top = self.medium.plant.z_surface
            for one in what:
                surface = one in (Note.EMERGED, Note.SUBMERGED)
                depth = top if surface else x[Now.Z]
                self.notes[self.counts[1]] = (t, one, depth, x[Now.V], x[Now.W])
                self.counts[1] += 1
                if self.counts[1] >= _LOG:
                    return

    def _step(self, h: float, z: float, energy: float) -> None:
        phase_step(self.phases, z, h, energy)
        n_rows, n_notes, n_cycles = (int(n) for n in self.counts)
        rows = self.rows[:n_rows].copy()
        self.parts.append((rows, self.notes[:n_notes].copy(), self.cycles[:n_cycles].copy()))
        if n_rows:
            self.last = rows[-1]
        self.counts[:] = 0


def _stop_of(mode: int) -> Note | None:
    act = Act(mode % 10)
    if act is Act.UPPER:
        return Note.UPPER_STOP
    return Note.LOWER_STOP if act in (Act.LOWER, Act.LOWER_SPINNING) else None


def _longest(plan: Plan) -> float:
    """Return how long the mission lasts at most [s]; a year where it has no end."""
    cycle = float(np.sum(plan.stages[:, Stage.DURATION] + plan.stages[:, Stage.TIMEOUT]))
    cycles, last = float(plan.given[Given.LAST_CYCLE]), float(plan.given[Given.LAST_TIME])
    found = min(last + cycle, cycles * cycle)
    return found if math.isfinite(found) else 365.0 * 86400.0


def fly_by_laws(
    vehicle: Vehicle, mission: Mission, column: Column, plan: Plan, state: Any, *,
    seed: int | None, volume: float | None = None,
    advance: Callable[[float], None] = lambda _: None,
    share: Callable[..., float] = lambda *_: 0.0, keep: Path | None = None,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Fly a mission whose phases have laws; return rows, notes and cycles as the kernel gives them.

    state: of `first_state`, changed to that at the end. seed, volume, keep: as in `fly_mission`.
    """
    check_samples(mission, plan)
    laws = [(source_of(n.law), n.law.name, n.sample_time, leaves(n.parameters)) for n in plan.laws]
    store = Store(keep, *map(identity, (vehicle, mission, column, laws)), seed, volume)
    flight = _Flight(vehicle, mission, column, plan, state, seed, store)
    x, p = flight.x, flight.medium.plant
    if mission.start_depth != 0.0 and volume is None:
        x[Now.V] = flight.medium.neutral_volume(mission.start_depth)
    if not p.V_min <= x[Now.V] <= p.V_max:
        raise InputError(
            f"the stroke, {p.V_min * 1e6:g} to {p.V_max * 1e6:g} cm3, does not hold the volume at "
            "the start", field="start_depth", value=mission.start_depth, unit="m",
            remedy="Start where the stroke can balance the vehicle",
        )  # fmt: skip
    x[Now.V_LEAST] = x[Now.V]
    flight.resume()
    flight.fly(advance, share)
    rows, notes, cycles = (np.concatenate([part[n] for part in flight.parts]) for n in range(3))
    return rows, notes, cycles
