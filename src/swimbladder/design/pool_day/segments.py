"""The phases of the pool procedure, found in a log sample by sample.

The procedure of section 3.1 of the paper shows in depth and volume alone: a minute of rest, a
volume that leaves what held the vehicle there and stays, a glide, its end. `Segmenter.feed` takes a
sample and returns what it made happen; the same samples give the same events, whatever the clock.
`Window` keeps the latest samples, `Glide` follows an experiment that is under way.

While a piston stands the volume is one number, or a slow drift, not the noise of its sensor. A fit
takes a logged volume as what the volume was. Noise and quantum of the piston's sensor then push the
model to and fro: half a quantum of 0.75 cm3 over a glide of the paper's smallest step is 2 % of
what drives it. While the piston stands, the mean of many samples knows the volume better than each
of them.
"""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval
from scipy.ndimage import median_filter

from swimbladder.estimation.series import stretches
from swimbladder.physics.arrays import Array

_SURE = 4.0  # standard errors of a trend that is one
_HALF = 4  # samples to either side of one, that show whether the piston stands
_NOISE = 6.0  # standard deviations of the sensor's noise, between the largest and the least of them
_FEWEST = 8  # samples of a stretch
_SMALL = 0.1  # of the range of the volume, up to which a step may be a quantum
_DECIMALS = 12  # of m3, that are not rounding


def steadied(time: Array, volume: Array) -> Array:
    """Return the volumes [m3] of a glide at times [s], made steady where the piston stands.

    In each such stretch the volume is its mean or, where it leaks by more than the sensor's noise
    and quantum explain, the straight line or the parabola that follows the leak.
    """
    result = volume.copy()
    step = quantum(volume)
    noise = 1.4826 * float(np.median(np.abs(np.diff(volume)))) / math.sqrt(2.0)
    limit = max(1.01 * step, _NOISE * noise, 10.0**-_DECIMALS)
    for first, last in _stands(volume, limit):
        t, v = time[first:last] - time[first:last].mean(), volume[first:last]
        for order in (0, 1, 2):
            smooth = polyval(t, polyfit(t, v, order))
            if not _trend(v - smooth, step):
                break
        result[first:last] = smooth
    return result


def quantum(volume: Array) -> float:
    """Return the smallest step [m3] by which a standing volume jumps, 0 where there is none.

    A step counts where those before and after do not go the same way, as on a ramp, and where it is
    small beside all that the volume does.
    """
    steps = np.diff(np.round(volume, _DECIMALS))
    ahead, behind = np.append(steps[1:], 0.0), np.insert(steps[:-1], 0, 0.0)
    alone = (steps != 0.0) & (steps * ahead <= 0.0) & (steps * behind <= 0.0)
    sizes = np.abs(steps[alone])
    sizes = sizes[sizes <= _SMALL * np.ptp(volume)]
    return float(sizes.min()) if len(sizes) else 0.0


def _stands(volume: Array, limit: float) -> list[tuple[int, int]]:
    """Return the stretches (first, one past the last) in which the volume stands."""
    width = 2 * _HALF + 1
    if len(volume) < width:
        return []
    near = np.lib.stride_tricks.sliding_window_view(volume, width)
    found: list[tuple[int, int]] = []
    for first, last in stretches(np.pad(np.ptp(near, axis=-1) <= limit, _HALF)):
        if found:
            first = max(first, found[-1][1])
        if last - first < width:
            continue
        level = float(np.median(volume[first : first + width]))
        while first > (found[-1][1] if found else 0) and abs(volume[first - 1] - level) <= limit:
            first -= 1
        level = float(np.median(volume[last - width : last]))
        while last < len(volume) and abs(volume[last] - level) <= limit:
            last += 1
        if last - first >= _FEWEST:
            found.append((first, last))
    return found


def _trend(away: Array, step: float) -> bool:
    """Say whether the residuals differ between thirds by more than noise and quantum do."""
    third = len(away) // 3
    means = [float(away[i * third : (i + 1) * third].mean()) for i in range(3)]
    noise = float(np.diff(away).std()) / math.sqrt(2.0)
    return max(means) - min(means) > max(1.1 * step, _SURE * noise / math.sqrt(third))


FEWEST = 12  # samples of an experiment


class Rules(NamedTuple):
    """Numbers that distinguish the phases; the first three are those of control.protocol."""

    minute: float = 60.0  # s, over which rest is judged
    rest_speed: float = 5e-4  # m/s
    rest_distance: float = 0.02  # m
    still_speed: float = 2e-3  # m/s, up to which a release is taken, and said to be hasty
    change: float = 3e-6  # m3, least change of volume that is one
    surface: float = 0.1  # m, where a glide upward is over
    bottom: float = math.inf  # m, where one downward is over
    margin: float = 0.05  # m, within which a vehicle that something stops does not move
    travel: float = 3.0  # m, after which a glide is over
    turns: bool = False  # whether the volume may be changed again under way, as plans have it
    least_travel: float = 0.3  # m, of an informative glide
    longest: float = 1200.0  # s, of a glide
    gap: float = 5.0  # s without a sample, which ends everything
    before: float = 3.0  # s of rest that an experiment's record begins with


_BLOCK = 5.0  # s; what the vehicle does in less than this is the sensor's noise
_WILD = 8.0  # robust standard deviations, beyond which a volume is a fault of its sensor


class Rest(NamedTuple):
    """A stretch of a log, judged as protocol.at_rest judges the last minute before a release."""

    time: float  # s, its end
    depth: float  # m, of its straight line at its end
    speed: float  # m/s, slope of that line
    spread: float  # m, rms of the depth about it, noise averaged out
    neutral: float  # m3, mean volume
    jitter: float  # m3, standard deviation of the volume


def stillness(time: Array, depth: Array) -> tuple[float, float, float]:
    """Return (speed [m/s], spread [m], depth at the end [m]) of a stretch of depths [m]."""
    t = time - time[0]
    middle, mean = float(t.mean()), float(depth.mean())
    from_middle = t - middle
    speed = float(from_middle @ depth) / float(from_middle @ from_middle)
    away = depth - mean - speed * from_middle
    blocks = (t / _BLOCK).astype(np.intp)
    count = np.bincount(blocks)
    sums = np.bincount(blocks, away)
    spread = math.sqrt(float((sums**2 / np.maximum(count, 1)).sum()) / len(t))
    return speed, spread, mean + speed * (float(t[-1]) - middle)


def neutral_volume(volume: Array) -> tuple[float, float]:
    """Return mean and standard deviation [m3] of the volumes, those that no piston had left out."""
    away = np.abs(volume - np.median(volume))
    limit = _WILD * 1.4826 * float(np.median(away))
    sane = volume if limit == 0.0 else volume[away <= limit]
    return float(sane.mean()), float(sane.std())


def settled(volume: Array, change: float) -> bool:
    """Say whether a stretch of volumes [m3] stands still, by the measure of a change [m3].

    The means of its halves agree to a tenth of the change, and it scatters by less than a fifth:
    a piston that a controller moves does not do so, one with a noisy sensor does.
    """
    half = len(volume) // 2
    moved = abs(float(np.median(volume[half:]) - np.median(volume[:half])))
    away = np.abs(volume - np.median(volume))
    kept = away <= np.sort(away)[-2] if len(away) > 5 else away >= 0.0  # one may be a fault
    scatter = float(volume[kept].std())
    return moved <= 0.1 * abs(change) and scatter <= 0.2 * abs(change)


class Sample(NamedTuple):
    """A row of a log."""

    time: float  # s
    depth: float  # m
    volume: float  # m3, of any zero


class End(Enum):
    """What ended an experiment."""

    TRAVEL = "it had gone far enough"
    SURFACE = "it reached the surface"
    BOTTOM = "it reached the bottom"
    STOPPED = "it was stopped, by the bottom it seems"
    PISTON = "the piston moved"
    GAP = "the log has a gap"
    LONG = "it took too long"
    LOG = "the log ended"


_FASTEST = 3.0  # m/s, at which no float moves


class Why(Enum):
    """Why a stretch of the log is no experiment, and what to do."""

    NOT_AT_REST = (
        "the vehicle was not at rest before it moved at {mm:.0f} mm/s with the piston at a "
        "standstill. Hold it still for {minute:g} s first"
    )
    NO_FLOAT = "no float moves at {size:.3g} m/s. Check the units of depth and time"
    NOT_SETTLED = (
        "the volume was changed by up to {cm3:+.3g} cm3 and did not stand still. Open the loop "
        "before the release, and leave the piston alone"
    )
    SHORT = "it went only {size:.2g} m{end}. Start further from where it ends"
    FEW_SAMPLES = "{size:.0f} samples are too few. Log faster, or start further off"
    STUCK = (
        "the volume was changed by {cm3:+.3g} cm3 and the vehicle did not move. Is it on the "
        "bottom, at the surface, or held by its tether?"
    )


class Cut(NamedTuple):
    """An experiment that is over, cut out of a log."""

    time: float  # s, when it was over
    rest: Rest  # before it
    samples: tuple[Sample, ...]  # from a little before the release on
    released: float  # s
    change: float  # m3, of the volume, from the mean of the rest
    travel: float  # m, to the furthest point, positive down
    end: End
    turns: int = 0  # changes of volume under way

    @property
    def glide(self) -> list[Sample]:
        """The samples since the release."""
        return [s for s in self.samples if s.time >= self.released]

    def columns(self) -> dict[str, Array]:
        """Return the columns of a log that `identify` reads.

        The volume counts from where the vehicle was neutral: the mean over the minute of rest. So
        does its first row, since a log's first row is taken as neutral; what the piston did there,
        while it held the depth, is not: it jitters about that mean. While it stands: `steadied`.
        """
        time, depth, volume = np.array(self.samples).T
        glide = time >= self.released
        volume[glide] = steadied(time[glide], volume[glide])
        volume = volume - self.rest.neutral
        volume[0] = 0.0
        return {"time_s": time, "depth_m": depth, "volume_m3": volume}


class Ready(NamedTuple):
    """The vehicle has been at rest for a minute."""

    time: float  # s
    rest: Rest


class Changed(NamedTuple):
    """The volume was changed, and stands: an experiment is under way."""

    time: float  # s, of the release
    change: float  # m3
    rest: Rest


class Turned(NamedTuple):
    """The volume was changed again under way, and stands."""

    time: float  # s
    volume: float  # m3, above the one at rest


class Refused(NamedTuple):
    """A stretch of the log looks like an experiment and is none."""

    time: float  # s
    why: Why
    number: float  # m/s, m3, m or samples: by how much
    end: End | None = None

    def sentence(self, rules: Rules) -> str:
        """Return why it is none, and what to do."""
        end = f": {self.end.value}" if self.end is not None else ""
        size, cm3 = abs(self.number), 1e6 * self.number
        facts = {"size": size, "mm": 1e3 * size, "cm3": cm3, "minute": rules.minute, "end": end}
        text = self.why.value.format(**facts)
        return f"No experiment: {text}" + ("" if text.endswith("?") else ".")


Event = Ready | Changed | Turned | Cut | Refused


TIME, DEPTH, VOLUME, SMOOTH = range(4)  # SMOOTH: the median of the last five depths
_WIDTH = 5


class Window:
    """Rows of time [s], depth [m], volume [m3] and smoothed depth [m], the latest last."""

    def __init__(self) -> None:
        self._rows, self._count = np.empty((512, 4)), 0

    def add(self, sample: Sample) -> None:
        """Append a sample."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        row = self._rows[self._count]
        row[:3] = sample
        self._count += 1
        last = self.rows[-_WIDTH:, DEPTH].tolist()
        row[SMOOTH] = sorted(last)[len(last) // 2]

    def forget_before(self, time: float) -> None:
        """Drop the samples from before a time [s]; inf: all."""
        kept = self.rows[int(np.searchsorted(self.rows[:, TIME], time)) :]
        self._rows[: len(kept)] = kept
        self._count = len(kept)

    @property
    def rows(self) -> Array:
        """All samples [n, 4]; a view that the next change overwrites."""
        return self._rows[: self._count]

    def since(self, time: float) -> Array:
        """Return the samples after a time [s]."""
        rows = self.rows
        return rows[int(np.searchsorted(rows[:, TIME], time, side="right")) :]


RECENT = 3.0  # s, over which a volume has to have left, or to stand still
_MOVED = 0.05  # m that the vehicle has to have gone before a change of volume is believed
_MOVING = 60.0  # s that a change of volume may take
_TURNING = 20.0  # s that one under way may take
_INSIDE = 0.1  # m from where a glide is over, that it has to have been before
_HALTED = (10.0, 0.015)  # s and m: a vehicle that turns round goes further in that time
_SLOWER = 0.3  # of the largest speed, below which something stops a vehicle that does not turn
_SLOW_SAMPLES = 3  # one after the other that have to say so
_SHORTEST = 3.0  # s of an experiment


class Glide:
    """What is known of a glide. `over` says that it is, or that it never was one."""

    def __init__(
        self, rules: Rules, window: Window, rest: Rest, *, since: float, limit: float, side: float
    ) -> None:
        """Begin with a volume that seems to have left its rest at the time `since` [s].

        limit: mean distance from it that counts as having left [m3]; side: its sign.
        """
        self.rules, self.rest, self.since = rules, rest, since  # until more is known of the two
        self.over = False
        self.volume: float | None = None  # m3, at which the piston stands; None: not believed yet
        self._window, self._limit, self._side = window, limit, side
        self._now = since
        self._change = self._size = 0.0  # m3, of the first and of the last change
        self._extreme = 0.0  # m3, furthest from the rest before it is believed
        self._scatter = 0.0  # m3, about `volume`
        self._left: float | None = None  # s, when the piston moved again
        self._off = self._turns = 0
        self._fastest = 0.0  # m/s
        self._speeds: list[float] = []  # m/s, at the latest looks
        self._slow_samples = 0
        self._least, self._greatest = math.inf, -math.inf  # m, depths so far

    def feed(self, sample: Sample) -> list[Event]:
        """Look at a sample, the window's latest: has the vehicle arrived, has the piston moved?"""
        r, self._now = self.rules, sample.time
        depth = float(self._window.rows[-1, SMOOTH])
        self._least, self._greatest = min(self._least, depth), max(self._greatest, depth)
        if depth <= r.surface < self._greatest - _INSIDE:
            return self.end(End.TRAVEL if r.turns else End.SURFACE)
        if depth >= r.bottom > self._least + _INSIDE:
            return self.end(End.TRAVEL if r.turns else End.BOTTOM)
        if abs(depth - self.rest.depth) >= r.travel:
            return self.end(End.TRAVEL)
        if sample.time - self.since > r.longest:
            return self.end(End.LONG)
        if self.volume is not None and self._left is None:
            away, noise = abs(sample.volume - self.volume), 6.0 * self._scatter
            self._off = self._off + 1 if away > max(0.25 * abs(self._size), noise) else 0
            if self._off == 3:
                self._left = float(self._window.rows[-3, TIME])
                if not r.turns:
                    return self.end(End.PISTON)
        return []

    def evaluate(self) -> list[Event]:
        """Look at the last seconds: does the volume stand, does the vehicle still go?"""
        if self.volume is None:
            return self._believe()
        if self._left is not None:
            return self._turn(self._left)
        recent = self._window.since(self._now - RECENT)
        if len(recent) < 3:
            return []
        if self._halted(recent):
            return self.end(End.STOPPED)
        if self._off == 0:  # follows a leak
            self.volume += 0.1 * (float(np.median(recent[:, VOLUME])) - self.volume)
        return []

    def _believe(self) -> list[Event]:
        """Look whether a volume that seems to have left its rest stands, and the vehicle goes."""
        recent = self._window.since(self._now - RECENT)
        change = float(np.median(recent[:, VOLUME])) - self.rest.neutral
        if self._side * change < 0.5 * self._limit:  # it came back: the controller at work
            self.over = True
            return []
        if self._side * change > abs(self._extreme):
            self._extreme = change
        stands = len(recent) >= 4 and settled(recent[:, VOLUME], change)
        if self._now - self.since > _MOVING:
            self.over = True
            return [Refused(self._now, Why.STUCK if stands else Why.NOT_SETTLED, change)]
        gone = float(np.median(recent[:, DEPTH])) - self.rest.depth
        if not stands or -self._side * gone < _MOVED:
            return []
        self.volume = float(recent[:, VOLUME].mean())
        self._scatter = float(recent[:, VOLUME].std())
        self._change = self._size = change
        return [Changed(self._now, change, self.rest)]

    def _turn(self, left: float) -> list[Event]:
        """Look whether the volume has come to stand elsewhere, or is controlled."""
        assert self.volume is not None
        recent = self._window.since(max(self._now - RECENT, left))
        if len(recent) < 4 or np.ptp(recent[:, TIME]) < 0.6 * RECENT:
            return []
        level = float(np.median(recent[:, VOLUME]))
        size = level - self.volume
        if settled(recent[:, VOLUME], size):
            self._turns += abs(size) > self.rules.change
            self.volume, self._size = level, size
            self._off, self._left, self._fastest = 0, None, 0.0
            self._scatter = float(recent[:, VOLUME].std())
            return [Turned(self._now, level - self.rest.neutral)]
        return self.end(End.PISTON) if self._now - left > _TURNING else []

    def _halted(self, recent: Array) -> bool:
        """Say whether something has stopped the vehicle: its own speed only grows, or turns."""
        if self._turns:
            longest, least = _HALTED
            part = self._window.since(self._now - longest)
            long = np.ptp(part[:, TIME]) > 0.9 * longest
            return bool(long and np.ptp(part[:, SMOOTH]) < least)
        t, z, third = recent[:, TIME], recent[:, SMOOTH], len(recent) // 3
        gone = float(np.median(z[-third:]) - np.median(z[:third]))
        speed = abs(gone / float(t[-third:].mean() - t[:third].mean()))
        slow = speed < _SLOWER * self._fastest and self._fastest > 20.0 * self.rules.rest_speed
        self._slow_samples = self._slow_samples + 1 if slow else 0
        if not slow:
            self._speeds = [*self._speeds[-4:], speed]
            self._fastest = max(self._fastest, float(np.median(self._speeds)))
        return self._slow_samples >= _SLOW_SAMPLES

    def end(self, end: End) -> list[Event]:
        """End the experiment: return it, or why it is none."""
        self.over = True
        rows, rest = self._window.rows.copy(), self.rest
        if self._left is not None:
            rows = rows[rows[:, TIME] < self._left]
        elif end is End.STOPPED:
            away = np.flatnonzero(np.abs(rows[:, SMOOTH] - rows[-1, SMOOTH]) > self.rules.margin)
            rows = rows[: int(away[-1]) + 1] if len(away) else rows[:0]
        rows = rows[rows[:, TIME] >= self.since - self.rules.before]
        glide = rows[rows[:, TIME] >= self.since]
        if self.volume is None:
            self.volume = float(rows[-1, VOLUME]) if len(rows) else rest.neutral
            self._change = self.volume - rest.neutral
            if abs(self._extreme) > 1.1 * abs(self._change):
                return [Refused(self._now, Why.NOT_SETTLED, self._extreme)]
        if len(glide) < FEWEST or np.ptp(glide[:, TIME]) < _SHORTEST:
            return [Refused(self._now, Why.FEW_SAMPLES, float(len(glide)))]
        gone = glide[:, SMOOTH] - rest.depth
        travel = float(gone[int(np.argmax(np.abs(gone)))])
        if abs(travel) < self.rules.least_travel:
            return [Refused(self._now, Why.SHORT, travel, end)]
        samples = tuple(Sample(*row) for row in rows[:, :3].tolist())
        how = (self._change, travel, end, self._turns)
        return [Cut(self._now, rest, samples, self.since, *how)]


_PERIOD = 0.5  # s between two evaluations of the window
_AWAY = 3.0  # standard deviations of the volume's mean over a few seconds
_IDLE = 10.0  # s of standing volume under way, after which a glide from no rest is one


class Segmenter:
    """Finds rest, changes of volume and glides in samples that come one by one."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.rest: Rest | None = None
        self.ready = False
        self._window = Window()
        self._glide: Glide | None = None
        self._evaluated = self._time = -math.inf
        self._last_volume: float | None = None  # m3, volume of the last glide, or of one reported

    @property
    def under_way(self) -> bool:
        """Whether an experiment is."""
        return self._glide is not None and self._glide.volume is not None

    @property
    def speed(self) -> float:
        """Speed over the last minute, or what there is of it [m/s]; nan with too few samples."""
        rows = self._window.since(self._time - self.rules.minute)
        return stillness(rows[:, TIME], rows[:, SMOOTH])[0] if len(rows) >= FEWEST else math.nan

    def feed(self, sample: Sample) -> list[Event]:
        """Return what a sample makes happen.

        One with a number missing, and one that is not later than those before, are left out.
        """
        if sample.time <= self._time or not all(map(math.isfinite, sample)):
            return []
        events: list[Event] = []
        if sample.time - self._time > self.rules.gap and math.isfinite(self._time):
            events += self.close(End.GAP)
        self._time = sample.time
        self._window.add(sample)
        due = sample.time - self._evaluated >= _PERIOD
        if due:
            self._evaluated = sample.time
        if self._glide is None:
            return events + (self._seek() if due else [])
        events += self._glide.feed(sample)
        if due and not self._glide.over:
            events += self._glide.evaluate()
        return self._after(self._glide, events)

    def close(self, end: End = End.LOG) -> list[Event]:
        """Return what the end of the log, or of what is known of it, makes happen."""
        events = self._glide.end(end) if self.under_way and self._glide is not None else []
        self._forget()
        return events

    def _forget(self) -> None:
        if self._glide is not None:
            self._last_volume = self._glide.volume
        self._window.forget_before(math.inf)
        self._glide, self.ready, self.rest, self._evaluated = None, False, None, -math.inf

    def _after(self, g: Glide, events: list[Event]) -> list[Event]:
        """Do what follows from what a glide said, and return that."""
        if any(isinstance(event, Changed) for event in events):
            self._date(g)
        if g.over and events:
            self._forget()
        elif g.over:  # it never was one: the rest goes on
            self._glide = None
        return events

    def _seek(self) -> list[Event]:
        """Look at the last minute: is it rest, has the volume left it?"""
        r, now = self.rules, self._time
        self._window.forget_before(now - r.minute - 2.0 * RECENT - r.before)
        left = self._left()
        if left is not None:
            self._glide = left
            events = left.feed(Sample(*self._window.rows[-1, :3].tolist())) or left.evaluate()
            return self._after(left, events)
        was, self.rest = self.ready, self._rest(now)
        if self.rest is None or not _still(self.rest, r):
            self.ready = False
            return self._hasty()
        if abs(self.rest.speed) <= r.rest_speed and 2.0 * self.rest.spread <= r.rest_distance:
            self.ready = True
        return [Ready(now, self.rest)] if self.ready and not was else []

    def _minute(self, end: float) -> Array:
        """Return the samples of the minute up to a time [s]."""
        rows = self._window.rows
        ends = [end - self.rules.minute - 1e-9, end + 1e-9]
        first, last = np.searchsorted(rows[:, TIME], ends, side="right")
        return rows[first:last]

    def _rest(self, end: float) -> Rest | None:
        """Return how the minute up to a time was; None where the log does not have it all."""
        rows = self._minute(end)
        if len(rows) < FEWEST or end - rows[0, TIME] < 0.95 * self.rules.minute:
            return None
        speed, spread, depth = stillness(rows[:, TIME], rows[:, SMOOTH])
        return Rest(end, depth, speed, spread, *neutral_volume(rows[:, VOLUME]))

    def _left(self) -> Glide | None:
        """Return the beginning of a glide where the volume has left what held a rest."""
        rows, now = self._window.rows, self._time
        recent = self._window.since(now - RECENT)
        if len(recent) < 3 or len(recent) == len(rows):
            return None
        away = float(recent[:, VOLUME].mean()) - float(rows[: -len(recent), VOLUME].mean())
        if abs(away) <= 0.8 * self.rules.change:
            return None
        rest = self._rest(float(rows[-1 - len(recent), TIME]))
        if rest is None or not _still(rest, self.rules):
            return None
        before = self._minute(rest.time)
        blocks = ((rest.time - before[:, TIME]) / RECENT).astype(np.intp)
        count = np.maximum(np.bincount(blocks), 1)
        means = np.bincount(blocks, before[:, VOLUME] - rest.neutral) / count
        limit = max(self.rules.change, _AWAY * float(means.std()))
        away = float(np.median(recent[:, VOLUME])) - rest.neutral
        if abs(away) <= limit:
            return None
        since, side = float(recent[0, TIME]), math.copysign(1.0, away)
        return Glide(self.rules, self._window, rest, since=since, limit=limit, side=side)

    def _date(self, g: Glide) -> None:
        """Give a glide the time when the volume left, and the minute before; drop what is older."""
        assert g.volume is not None
        rows, change = self._window.rows, g.volume - g.rest.neutral
        volume = median_filter(rows[:, VOLUME], 3, mode="nearest")  # no single fault
        away = math.copysign(1.0, change) * (volume - g.rest.neutral)
        half = np.flatnonzero(away <= 0.5 * abs(change))
        at = int(half[-1]) if len(half) else 0
        near = np.flatnonzero(away[: at + 1] <= max(g.rest.jitter, 0.02 * abs(change)))
        since = float(rows[at, TIME])
        rest = self._rest(float(rows[near[-1] if len(near) else at, TIME]))
        g.since, g.rest = since, rest or g.rest
        self._window.forget_before(since - self.rules.before)

    def _hasty(self) -> list[Event]:
        """Look for a glide that did not begin at rest, to report it."""
        r = self.rules
        recent = self._window.since(self._time - _IDLE)
        if len(recent) < FEWEST or self._time - recent[0, TIME] < 0.9 * _IDLE:
            return []
        level, gone = recent[-1, VOLUME], recent[-1, SMOOTH] - recent[0, SMOOTH]
        if self._last_volume is not None and abs(level - self._last_volume) < r.change:
            return []
        if abs(gone) < r.least_travel or np.ptp(recent[:, VOLUME]) > 0.25 * r.change:
            return []
        self._last_volume = float(level)
        speed = float(gone / np.ptp(recent[:, TIME]))
        why = Why.NOT_AT_REST if abs(speed) < _FASTEST else Why.NO_FLOAT
        return [Refused(self._time, why, speed)]


def _still(rest: Rest, rules: Rules) -> bool:
    """Say whether a release from there is taken, even if it is hasty."""
    return abs(rest.speed) <= rules.still_speed and rest.spread <= rules.rest_distance
