"""A planned motion: what to command when, what comes of it, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swimbladder.design.linear.models import Array
from swimbladder.design.planning.minimum_time import LeastTime
from swimbladder.design.planning.task import Task
from swimbladder.io.answers import as_json
from swimbladder.units import rounded

_LOST = 0.1  # of the step: a motion that far from the plan is another


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """The plan at each sample [n + 1], the command held from there on."""

    task: Task
    goal: str
    arrive: str
    time: Array  # s
    depth: Array  # m
    speed: Array  # m/s
    volume: Array  # m3
    command: Array  # V; m3 to go to, for a positioner
    arrival: float  # s, from which on the demand is met
    least: LeastTime  # of the same demand: the least time there is
    moved: float  # m3, to and fro
    energy: float  # J, electrical into the motor; nan where not known
    gap: float  # of primal and dual objective, over 1 + their size
    proven: bool  # whether no motion is better; else none near by
    residual: float  # m, farthest that the simulator, given the commands, is from the plan
    at_limit: dict[str, float]  # share of the samples at each limit

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say."""
        t, h = self.task, self.task.sample_time
        step = f"from {t.start:g} to {t.target:g} m"
        into = f"inside {_length(t.band)} of the target for good"
        every = "every plan" if self.proven else "every plan near it"
        where = into if self.arrive == "band" else "at rest there"
        limits = _limits(t)
        said = [
            f"The least time {step} is {self.least.time:.4g} s ({where}), sampled every {h:g} s"
            f"{limits}: a sample sooner "
            + (
                f"{every} misses by {_length(self.least.short)} or more."
                if self.arrive == "band"
                else f"no {every.removeprefix('every ')} comes to rest."
            )
        ]
        if self.goal != "time":
            what = "volume moved" if self.goal == "effort" else "electrical energy"
            said.append(
                f"In {self.arrival:.4g} s it takes the least {what}"
                + ("." if self.proven else " of all plans near it; others were not ruled out.")
            )
        energy = "" if math.isnan(self.energy) else f", {self.energy:.4g} J into the motor"
        said.append(
            f"It moves {1e6 * self.moved:.4g} cm3 to and fro{energy}; at its fastest it goes "
            f"{100.0 * float(abs(self.speed).max()):.3g} cm/s."
        )
        busy = [f"{n} in {100.0 * s:.0f} %" for n, s in self.at_limit.items() if s > 0.0]
        said.append(
            f"At their limits: {', '.join(busy)} of the samples." if busy else
            "No limit is reached."
        )  # fmt: skip
        said.append(
            f"The simulator, given the plan's commands, keeps within {_length(self.residual, 2)} "
            "of it."
        )
        if self.residual > t.band:
            said.append(
                "That is more than the band: followed blindly this plan does not arrive. Let a "
                f"controller follow it, or {self.nearer}."
            )
        return tuple(said)

    @property
    def lost(self) -> bool:
        """Whether the simulator, given the commands, leaves the plan by far: it is none then."""
        t = self.task
        return self.residual > max(t.band, _LOST * abs(t.target - t.start))

    @property
    def nearer(self) -> str:
        """What to ask for instead where the simulator does not keep to the plan."""
        if self.goal != "time":
            return "plan a shorter step"
        smoother = "plan it with --goal effort, of a smoother motion"
        return smoother if self.arrive == "rest" else f"{smoother}, or with --arrive rest"

    def to_json(self) -> dict[str, Any]:
        """Return the answer in SI units."""
        return {
            "vehicle": self.task.vehicle.name,
            **as_json(self.task, "start_m target_m sample_time_s band_m margin"),
            **as_json(self.least, "least_time_s=time short_a_sample_sooner=short"),
            **as_json(
                self,
                "goal arrive arrival_s moved_m3 energy_J at_limit gap proven residual_m sentences",
            ),
            "duration_s": float(self.time[-1]),
        }

    def columns(self) -> dict[str, Array]:
        """Return the columns of a log of the plan."""
        known = {
            "time_s": self.time,
            "depth_m": self.depth,
            "speed_m_s": self.speed,
            "volume_m3": self.volume,
        }
        name = "reference_volume_m3" if self.task.plant.positioner else "voltage_V"
        return {**known, name: self.command}


def _length(length: float, digits: int = 3) -> str:
    """Return a length [m] in mm, or in m from 1 m on."""
    size, unit = (length, "m") if length >= 1.0 else (1e3 * length, "mm")
    return f"{rounded(size, digits)} {unit}"


def _limits(task: Task) -> str:
    if task.plant.positioner:
        return f", the volume moved by up to {1e6 * task.command[1]:.4g} cm3/s"
    kept = f" ({100.0 * task.margin:g} % kept back)" if task.margin else ""
    return f", with up to {task.command[1]:.4g} V{kept}"
