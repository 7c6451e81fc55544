"""What each reason of the supervisor means, for the person who flew the vehicle."""

from __future__ import annotations

import math
from typing import Any

from swimbladder.control.law import NEVER, Count
from swimbladder.control.supervisor import Reason
from swimbladder.control.supervisor_records import SupervisorParameters

__all__ = ["facts_of", "meanings", "summary"]


def meanings(p: SupervisorParameters) -> list[tuple[int, str, str, str]]:
    """Return (number, name, what happened, after how long) for each reason."""

    def seconds(count: Count) -> str:
        return f"{count * p.S_p:.3g} s" if count < NEVER else "never"

    age = f"a depth older than {p.late_age:.3g} s"
    same = (
        f"{seconds(p.same)} of the same ({seconds(p.same_noisy)} where its noise has shown), or "
        f"{seconds(p.same_moved)} while the volume changes"
    )
    model = (
        f"{p.neutral_range * 1e6:.3g} cm3 ({p.neutral_change * 1e6:.3g} cm3 from what the dive has "
        f"shown) and {p.model_error:.0%} of the force"
    )
    said = {
        Reason.RESTARTED: ("a watchdog or a brown-out began the program anew", "at once"),
        Reason.LEAK: ("`water_inside` said so", seconds(p.leak)),
        Reason.DEPTH_LIMIT: (
            f"deeper than {p.depth_limit:.4g} m, or too fast to turn before {p.deepest:.4g} m",
            seconds(p.deep),
        ),
        Reason.DEPTH_MISSING: ("the depth was no number", seconds(p.blind)),
        Reason.DEPTH_IMPOSSIBLE: (
            f"the depth was not {p.depth_least:.3g} to {p.depth_most:.4g} m, or jumped",
            seconds(p.blind),
        ),
        Reason.DEPTH_LATE: (age, seconds(p.blind)),
        Reason.DEPTH_FROZEN: ("the depth was the very same to the last digit", same),
        Reason.VOLUME_MISSING: ("the volume was no number", seconds(p.blind)),
        Reason.VOLUME_IMPOSSIBLE: ("the volume was outside the stroke", seconds(p.blind)),
        Reason.NOT_FOLLOWING: (
            "the volume did not follow the commands: motor, driver, piston or its sensor",
            seconds(p.following),
        ),
        Reason.NOT_MOVING_AS_MODELLED: (
            f"depth and volume do not fit, by more than {model}: a sensor is wrong, or the vehicle "
            "is caught, aground, flooded or badly trimmed",
            f"{seconds(p.wrong)}, a third of it where it is beyond doubt",
        ),
        Reason.BATTERY_LOW: (f"below {p.battery_low:.3g} V", seconds(p.battery)),
        Reason.NO_COMMAND: ("the law gave no command", seconds(p.missed)),
        Reason.TICKS_LOST: (
            "the loop took too long: more than a fifth of the ticks never came",
            f"{p.lost_quarters // 4} ticks",
        ),
        Reason.TIME_LIMIT: ("the dive took as long as it may", _time(p) or "never"),
    }
    return [(reason.value, reason.words, *said[reason]) for reason in Reason]


def facts_of(p: SupervisorParameters) -> dict[str, Any]:
    """Return what the templates say of the limits."""
    push = "the volume is commanded to its largest, for good" if p.positioner > 0.0 else (
        f"{p.surface_command:g} V for {p.push * p.S_p:.0f} s, then {p.hold_command:.3g} V to hold "
        "the piston, and the full voltage again now and then"
    )  # fmt: skip
    return {
        "battery_text": f"{p.battery_low:.3g} V",
        "release_text": f"{p.release * p.S_p:.0f}",
        "push_text": f"{p.push * p.S_p:.0f}",
        "rest_text": f"{p.rest * p.S_p:.0f}",
        "surface": push,
        "sinks_text": f"{p.sinks * 1e6:.3g}",
        "reach_text": f"{p.reach * 1e6:.3g}",
        "proof_text": f"{p.unproven * p.S_p:.3g} s",
        "tried_text": f"{p.same_tried * p.S_p:.3g} s",
        "full_text": "the largest volume" if p.positioner > 0.0 else f"{p.surface_command:g} V",
        "meanings": meanings(p),
    }


def summary(p: SupervisorParameters) -> str:
    """Return what the command line says of the supervisor, one line."""
    battery = f"below {p.battery_low:.3g} V" if p.battery_low > 0.0 else "not watched"
    depth = f"{p.depth_limit:.4g} m" if math.isfinite(p.depth_limit) else "none"
    frozen = f"after {p.same * p.S_p:.3g} s"
    if p.same == NEVER:
        frozen = "by the model only, as the noise of the sensor is not known or hidden"
    return (
        f"supervisor: depth limit {depth}, time limit {_time(p) or 'none'}, battery {battery}, "
        f"frozen depth {frozen}"
    )


def _time(p: SupervisorParameters) -> str:
    """Return the time limit, empty where there is none."""
    time = (p.time_blocks * 4096 + p.time_ticks) * p.S_p
    return f"{time:.6g} s" if p.time_blocks < NEVER else ""
