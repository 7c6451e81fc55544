"""What each reason of the supervisor means, for the person who flew the vehicle."""

from __future__ import annotations

import math
from typing import Any

from swimbladder.control.law import NEVER, Count
from swimbladder.control.supervisor_records import Reason, SupervisorParameters

_VOLUME = (
    Reason.VOLUME_MISSING,
    Reason.VOLUME_IMPOSSIBLE,
    Reason.NOT_FOLLOWING,
    Reason.NOT_MOVING_AS_MODELLED,
)


def meanings(p: SupervisorParameters) -> list[tuple[int, str, str, str]]:
    """Return (number, name, what happened, after how long) for each reason."""

    def seconds(count: Count) -> str:
        return f"{count * p.S_p:.3g} s" if count < NEVER else "never"

    age = f"a depth older than {p.depth.late_age:.3g} s"
    same = (
        f"{seconds(p.same.same)} of the same ({seconds(p.same.same_noisy)} where its noise has "
        f"shown), or {seconds(p.same.same_moved)} while the volume changes"
    )
    model = (
        f"{p.neutral.neutral_range * 1e6:.3g} cm3 ({p.motion.neutral_change * 1e6:.3g} cm3 from "
        f"what the dive has shown) and {p.motion.model_error:.0%} of the force"
    )
    said = {
        Reason.RESTARTED: ("a watchdog or a brown-out began the program anew", "at once"),
        Reason.LEAK: ("`water_inside` said so", seconds(p.board.leak)),
        Reason.DEPTH_LIMIT: (
            f"deeper than {p.deep.depth_limit:.4g} m, or too fast to turn before "
            f"{p.deep.deepest:.4g} m",
            seconds(p.deep.deep),
        ),
        Reason.DEPTH_MISSING: ("the depth was no number", seconds(p.depth.gap)),
        Reason.DEPTH_IMPOSSIBLE: (
            f"the depth was not {p.depth.depth_least:.3g} to {p.depth.depth_most:.4g} m, or jumped",
            seconds(p.depth.gap),
        ),
        Reason.DEPTH_LATE: (age, seconds(p.depth.gap)),
        Reason.DEPTH_FROZEN: ("the depth was the very same to the last digit", same),
        Reason.VOLUME_MISSING: ("the volume was no number", seconds(p.volume.blind)),
        Reason.VOLUME_IMPOSSIBLE: ("the volume was outside the stroke", seconds(p.volume.blind)),
        Reason.NOT_FOLLOWING: (
            "the volume did not follow the commands: motor, driver, piston or its sensor",
            seconds(p.rate.following),
        ),
        Reason.NOT_MOVING_AS_MODELLED: (
            f"depth and volume do not fit, by more than {model}: a sensor is wrong, or the vehicle "
            "is caught, aground, flooded or badly trimmed",
            f"{seconds(p.motion.wrong)}, a third of it beyond twice the limit",
        ),
        Reason.BATTERY_LOW: (f"below {p.board.battery_low:.3g} V", seconds(p.board.battery)),
        Reason.NO_COMMAND: ("the law gave no command", seconds(p.board.missed)),
        Reason.TICKS_LOST: (
            "the loop took too long: more than a fifth of the ticks never came",
            f"{p.time.lost_quarters // 4} ticks",
        ),
        Reason.TIME_LIMIT: ("the dive took as long as it may", _time(p) or "never"),
    }
    return [(reason.value, reason.words, *said[reason]) for reason in Reason]


def facts_of(p: SupervisorParameters) -> dict[str, Any]:
    """Return what the templates say of the limits."""
    floats = p.rate.positioner > 0.0 and p.rate.rate == 0.0
    push = "the volume is commanded to its largest, for good" if p.rate.positioner > 0.0 else (
        f"{p.push.surface_command:g} V for {p.push.push * p.S_p:.0f} s, then "
        f"{p.push.hold_command:.3g} V to hold the piston, and the full voltage again now and then"
    )  # fmt: skip
    if floats:
        push = (
            f"valves close and the pump runs for {p.push.push * p.S_p:.0f} s, and on while the "
            f"vehicle moves, then {p.push.again * p.S_p:.0f} s of it every "
            f"{(p.push.rest + p.push.again) * p.S_p:.0f} s"
        )
    return {
        "unwatched": _VOLUME if floats else (),
        "battery_text": f"{p.board.battery_low:.3g} V",
        "release_text": f"{p.push.release * p.S_p:.0f}",
        "push_text": f"{p.push.push * p.S_p:.0f}",
        "rest_text": f"{p.push.rest * p.S_p:.0f}",
        "surface": push,
        "sinks_text": f"{p.proof.sinks * 1e6:.3g}",
        "reach_text": f"{p.proof.reach * 1e6:.3g}",
        "proof_text": f"{p.proof.unproven * p.S_p:.3g} s",
        "tried_text": f"{p.proof.same_tried * p.S_p:.3g} s",
        "full_text": "the largest volume"
        if p.rate.positioner > 0.0
        else f"{p.push.surface_command:g} V",
        "meanings": meanings(p),
    }


def summary(p: SupervisorParameters) -> str:
    """Return what the command line says of the supervisor, one line."""
    battery = f"below {p.board.battery_low:.3g} V" if p.board.battery_low > 0.0 else "not watched"
    depth = f"{p.deep.depth_limit:.4g} m" if math.isfinite(p.deep.depth_limit) else "none"
    frozen = f"after {p.same.same * p.S_p:.3g} s"
    if p.same.same == NEVER:
        frozen = "by the model only, as the noise of the sensor is not known or hidden"
    return (
        f"supervisor: depth limit {depth}, time limit {_time(p) or 'none'}, battery {battery}, "
        f"frozen depth {frozen}"
    )


def _time(p: SupervisorParameters) -> str:
    """Return the time limit, empty where there is none."""
    time = (p.time.time_blocks * 4096 + p.time.time_ticks) * p.S_p
    return f"{time:.6g} s" if p.time.time_blocks < NEVER else ""
