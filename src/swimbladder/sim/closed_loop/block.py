"""A block of vehicles laid out for the kernel, and what comes out of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swimbladder.control.law import Law, from_numbers, leaf_names
from swimbladder.io.progress import Advance, silent, so_far
from swimbladder.physics.arrays import Array
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.closed_loop.lane import RECORDED, Lanes, Like, Row, rows
from swimbladder.sim.closed_loop.lanes import Schedule, measure_block, start_block
from swimbladder.sim.closed_loop.outside import kernel_of
from swimbladder.sim.closed_loop.pumped import Pumped
from swimbladder.sim.closed_loop.supervision import Supervision
from swimbladder.sim.engine.accounts import Account
from swimbladder.sim.engine.advance import EVENTS
from swimbladder.sim.engine.chain import COEFFICIENTS, LEVELS
from swimbladder.sim.engine.modes import COUNT, NO_LAYERS, Layers
from swimbladder.vehicle import Sensors

_V_0 = Row.PLANT + Plant._fields.index("V_0")
_CHUNK = 4096  # ticks between calls: progress, interruption, memory of the noise
_SHOWN = 256  # ticks between calls of `advance` where every tick is a call


def schedule(times: Sequence[float], duration: float, tick: float) -> Schedule:
    """Return set-points given at `times` [s], each at the first tick not before it."""
    n = max(1, math.ceil(duration / tick - 1e-9))
    given = np.array([math.ceil(t / tick - 1e-9) for t in times], dtype=np.int64)
    lasts = np.diff(np.minimum([0, *given, n + 1], n + 1))
    turn = np.repeat(np.arange(-1, len(given)), lasts)
    return Schedule(tick=tick, turn=turn, given=given)


def work_space(lanes: int) -> Array:
    """Return room for the exponentials of so many lanes; only what is used takes memory."""
    return np.empty((lanes, COUNT, LEVELS + 1, COEFFICIENTS))


@dataclass(kw_only=True)
class Block:
    """Lanes that run together; see closed_loop.lanes for the layout of `work`.

    plants [len(Plant), lanes] start at (q, V, z, w) [4, lanes]; of a stepper, those of
    `dynamics.body_plant`. parameters: of the law by name, each a number or an array [lanes]; then
    the law's own, for their types. seeds: of the sensors' noise, one for each lane that counts;
    None: ideal sensors. recorded, booked, logged: whether what they name is kept, beyond summaries.
    """

    plants: Array
    law: Law
    parameters: Any
    clock: Schedule
    parts: int
    depths: Array  # [set-points, lanes]
    start: Array
    sensors: Sensors
    seeds: Sequence[Sequence[int]] | None = None
    recorded: bool = False
    booked: bool = False
    logged: bool = False
    depth_error: Array | None = None  # [ticks + 1, lanes], m, beyond the noise
    neutral: Array | None = None  # [ticks + 1, lanes], m3, beyond the plant's V_0, from a tick on
    layers: Layers = NO_LAYERS  # of the water of all lanes, beyond the plant's psi z + V_0
    hooks: Any = ()  # what stands between the parts of the loop, see `lane`
    watch: Supervision | tuple[()] = ()  # the supervisor over the law of each lane
    stepper: Pumped | None = None  # what moves the lanes, if not their modes' exponentials
    live: int | None = None  # the first so many lanes count; None: all
    loses: bool = False  # whether the vehicle gets heavier, by the rows from LOST on, see `lane`
    lanes: int = field(init=False)
    work: Array = field(init=False)  # [rows, lanes]
    built: NDArray[np.uint8] = field(init=False)  # [lanes, COUNT], see `advance.ModeLane`

    def __post_init__(self) -> None:
        """Lay the lanes out."""
        p, names = Plant(*self.plants), leaf_names(self.law.parameters)
        lanes = self.lanes = self.plants.shape[1]
        work = self.work = _aligned(rows(len(names), len(leaf_names(self.law.state))), lanes)
        self.built = np.zeros((lanes, COUNT), np.uint8)
        work[Row.Q : Row.Q + 4] = self.start
        work[Row.PLANT : Row.PLANT + len(p)] = self.plants
        own = work[Row.LAW : Row.LAW + len(names)]
        for row, name in zip(own, names, strict=True):
            row[:] = self.parameters[name]
        self.parameters = from_numbers(self.law.parameters, own[:, 0].tolist())
        positioner = p.positioner != 0.0
        work[Row.LOW_U] = np.where(positioner, np.maximum(p.V_min, p.switch_in), -p.supply)
        work[Row.HIGH_U] = np.where(positioner, np.minimum(p.V_max, p.switch_out), p.supply)
        if self.stepper is not None and self.stepper.seconds is not None:
            work[Row.LOW_U], work[Row.HIGH_U] = -self.clock.tick, self.clock.tick
        for name in ("depth_noise", "depth_quantum", "volume_noise", "volume_quantum"):
            work[Row[name.upper()]] = getattr(self.sensors, name)
        work[[Row.SEEN_DEPTH, Row.Z_LOWEST, Row.Z_HIGHEST]] = self.start[2]
        work[[Row.SEEN_VOLUME, Row.V_LOWEST, Row.V_HIGHEST]] = self.start[1]
        self.nonlinear = bool(np.any(np.isfinite(p.epsilon)))
        # a copy: a view that cannot be written has a type, and so a kernel, of its own
        self.depths = np.array(
            np.broadcast_to(self.depths, (len(self.clock.given), lanes)), order="C"
        )
        self.noise: list[np.random.Generator] | None = None
        if self.seeds is not None:
            streams = map(np.random.SeedSequence, self.seeds)
            self.noise = [np.random.Generator(np.random.Philox(stream)) for stream in streams]
        self._drawn: tuple[int, Array] | None = None  # of the chunk that begins at this tick
        samples = self.clock.ticks + 1 if self.recorded else 0
        self.record = np.full((len(RECORDED), samples, lanes), np.nan)
        self.accounts = np.zeros((lanes, len(Account) if self.booked else 0))
        self.log = np.zeros((lanes, EVENTS if self.logged else 0, 3))
        self.noted = np.zeros((lanes, 1), np.int64)

    def begin(self, chains: Array | None = None) -> Running:
        """Return the block under way, before its first tick; chains: see `run`."""
        return Running(self, work_space(self.lanes) if chains is None else chains)

    def run(
        self,
        advance: Advance = silent,
        chains: Array | None = None,
        ask: Callable[[int], None] | None = None,
    ) -> None:
        """Run to the end; `advance` gets the share of each chunk.

        chains: work space of an earlier run of as many lanes, see `work_space`. ask: called with
        the number of each tick before the law is, once the sensors have measured.
        """
        running, report = self.begin(chains), so_far(advance)
        own, now = self.work[_V_0].copy(), np.zeros(self.lanes)
        sigma = self.work[Row.DEPTH_NOISE].copy()
        if self.depth_error is not None:
            self.work[Row.DEPTH_NOISE] = 1.0  # of what _sensor_error returns
            if self.noise is None:
                self.work[[Row.DEPTH_QUANTUM, Row.VOLUME_QUANTUM]] = 0.0  # ideal sensors
        unseen = np.zeros((0, 2, self.lanes))
        for first, last in self._spans(_CHUNK if ask is None else 1):
            if self.neutral is not None and np.any(self.neutral[first] != now):
                now = self.neutral[first]
                self.work[_V_0] = own + now
                running.restart()
                self.work[Row.SLOW][self.work[Row.STOPPED] != 0.0] = 1.0  # as the kernel left them
            noise = self._sensor_error(first, last, sigma)
            if ask is not None:
                if len(noise):
                    measure_block(running.lanes, noise, 0)
                    noise = unseen
                ask(first)
            running.advance(first, last, noise)
            if ask is None or last % _SHOWN == 0 or last > self.clock.ticks:
                report(last / (self.clock.ticks + 1))
            if bool(np.all(self.work[Row.STOPPED, : self.live] != 0.0)):
                break

    def _spans(self, most: int) -> Iterator[tuple[int, int]]:
        """Yield (first, end) of at most so many ticks, in which the neutral volume stays."""
        end = self.clock.ticks + 1
        if self.neutral is None:
            yield from ((k, min(k + most, end)) for k in range(0, end, most))
            return
        turns = 1 + np.flatnonzero(np.any(np.diff(self.neutral, axis=0), axis=1))
        yield from itertools.pairwise(sorted({*range(0, end, most), end, *turns.tolist()}))

    def _sensor_error(self, first: int, last: int, sigma: Array) -> Array:
        """Return what the sensors add to the state over their noise, [ticks, 2, lanes], or nothing.

        sigma [m]: of the depth, by which its noise is multiplied where it has an error as well.
        """
        if self.noise is None and self.depth_error is None:
            return np.zeros((0, 2, self.lanes))
        found = self._noise_of(first, last)
        if self.depth_error is not None:
            found = found.copy()
            found[:, 0] = found[:, 0] * sigma + self.depth_error[first:last]
        return found

    def _noise_of(self, first: int, last: int) -> Array:
        """Return the noise of some ticks, [ticks, 2, lanes]; it is drawn for a chunk at once."""
        if self.noise is None:
            return np.zeros((last - first, 2, self.lanes))
        begin = first - first % _CHUNK  # no span goes over the end of a chunk
        if self._drawn is None or self._drawn[0] != begin:
            drawn = np.zeros((min(_CHUNK, self.clock.ticks + 1 - begin), 2, self.lanes))
            for i, generator in enumerate(self.noise):
                drawn[:, :, i] = generator.standard_normal(drawn.shape[:2])
            self._drawn = begin, drawn
        return self._drawn[1][first - begin : last - begin]


def _aligned(rows: int, lanes: int) -> Array:
    """Return zeros that begin where a cache line does: the widest vectors then lie in one each."""
    room = np.zeros(rows * lanes + 7)
    first = -room.ctypes.data % 64 // room.itemsize
    return room[first : first + rows * lanes].reshape(rows, lanes)


def like_of(law: Law, parameters: Any, watch: Any = ()) -> Like:
    """Return what the compiler knows the numbers of a law by."""
    fields = leaf_names(law.state)
    state = from_numbers(law.state, [0.0] * len(fields))
    row, wide = (fields.index(n) if n in fields else -1 for n in ("volume_reference", "wide"))
    computed = -1 if wide < 0 else fields.index("volume")
    return Like(parameters, state, row, watch, wide, computed)


class Running:
    """A block under way: its kernel, and the work space that goes from span to span."""

    def __init__(self, block: Block, chains: Array) -> None:
        self.block, self.chains = block, chains
        self._law = like_of(block.law, block.parameters, block.watch)
        self.built = block.built
        self.lanes = Lanes(
            S=block.work.reshape(-1),
            token=(0.0,) * block.lanes,
            live=block.live or block.lanes,
            # one vehicle: one kernel for all drags; a block: one without what laminar drag lacks
            bend=(0.0,) if block.nonlinear or block.lanes == 1 else (),
            sea=(0.0,) if block.loses else (),
            layers=block.layers,
            parts=block.parts,
            depths=block.depths,
            record=block.record,
            built=self.built,
            accounts=block.accounts,
            log=block.log,
            noted=block.noted,
        )
        self._kernel = kernel_of(block.law, pumped=block.stepper is not None, hooks=block.hooks)
        self.restart()

    def restart(self) -> None:
        """Find each lane's mode anew: at the begin, and where its plant has changed."""
        b = self.block
        if b.stepper is not None:  # finds it by itself
            return
        self.built[:] = 0
        start_block(self.lanes, self.chains, b.clock.tick / b.parts)

    def advance(self, first: int, last: int, noise: Array) -> None:
        """Run from tick `first` to `last`; noise [ticks, 2, lanes], standard normal, or empty."""
        b, span = self.block, (first, last)
        chains = self.chains if b.stepper is None else None
        self._kernel(self.lanes, b.hooks, b.stepper, self._law, b.clock, span, noise, chains)
