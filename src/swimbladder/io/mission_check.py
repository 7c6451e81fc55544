"""Whether a vehicle can be asked to do a mission of set-points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from swimbladder.errors import InputError
from swimbladder.io.mission import Mission
from swimbladder.vehicle import Vehicle

__all__ = ["MOST_SAMPLES", "check_mission"]

MOST_SAMPLES = 100_000_000


def check_mission(
    vehicle: Vehicle,
    mission: Mission,
    *,
    names: Mapping[str, str] | None = None,
    sample_time: float | None = None,
    neutral: Callable[[float], float] | None = None,
) -> None:
    """Check that a vehicle can be asked to do a mission; simulate nothing.

    names: what the user calls the mission's fields (``{"start_depth": "--start"}``).
    sample_time: of the control law [s], the vehicle's own when None. neutral: the neutral volume
    [m3] at a depth [m] in the water of a cast, the vehicle's own when None.
    Raises InputError where a depth is above the surface, below the bottom or the vehicle's
    rating, where the stroke does not reach the neutral volume there, and where the duration is
    shorter than a sample or absurdly long.
    """
    if not mission.setpoints:
        raise InputError(
            "the mission has phases, and this command takes set-points", field="phases",
            remedy="Fly it with `swimbladder mission`, or write [[setpoints]]",
        )  # fmt: skip
    called = dict(names or {})
    _check_duration(vehicle, mission, called.get("duration", "duration"), sample_time)
    places = [("start_depth", mission.start_depth)]
    places += [(f"setpoints[{i}].depth", p.depth) for i, p in enumerate(mission.setpoints)]
    for name, depth in places:
        field = called.get(name, name)
        bottom = called.get("bottom_depth", "bottom_depth")
        _check_depth(vehicle, depth, mission.bottom, field, bottom)
        _check_stroke(vehicle, depth, field, neutral)


def _check_duration(
    vehicle: Vehicle, mission: Mission, field: str, sample_time: float | None
) -> None:
    if sample_time is None:
        if vehicle.controller is None:
            raise InputError(
                f"the vehicle {vehicle.name!r} has no controller, so no loop can be closed",
                field="controller",
                remedy="Add a table [controller] with law, sample_time and parameters",
            )
        sample_time = vehicle.controller.sample_time
    samples = mission.span / sample_time
    problem = partial(InputError, field=field, value=mission.span, unit="s")
    if samples < 1.0:
        raise problem(
            f"the duration is shorter than one sample of {sample_time:g} s",
            remedy="Lengthen it, or shorten the controller's sample time",
        )
    if samples > MOST_SAMPLES:
        raise problem(
            f"the duration is {samples:.3g} samples of {sample_time:g} s, more than "
            f"{MOST_SAMPLES:.0e} are not kept",
            remedy="Shorten it, or split it into several",
        )


def _check_depth(
    vehicle: Vehicle, depth: float, bottom: float, field: str, bottom_field: str
) -> None:
    problem = partial(InputError, field=field, value=depth, unit="m")
    if depth < 0.0:
        raise problem("the depth is above the surface", remedy="Depths are positive downwards")
    if depth > bottom:
        raise problem(
            f"the depth is below the bottom at {bottom:g} m",
            remedy=f"Give a depth of at most {bottom:g} m, or a deeper bottom ({bottom_field})",
        )
    limit = vehicle.hull.depth_limit
    if limit is not None and depth > limit:
        raise problem(
            f"the vehicle {vehicle.name!r} is rated for {limit:g} m (hull.depth_limit)",
            remedy=f"Ask for {limit:g} m at most",
        )


def _within_stroke(vehicle: Vehicle, outwards: bool) -> str:
    """Return what to do where the stroke ends, at its largest volume (outwards) or its least."""
    end = vehicle.stroke.maximum if outwards else vehicle.stroke.minimum
    psi, over = vehicle.hull.psi, end - vehicle.trim_error
    if psi == 0.0 or over / psi <= 0.0:  # at no depth, or at none below the surface
        return "Trim the vehicle otherwise (trim_error), or lengthen the stroke"
    depth = over / psi
    if outwards != (psi > 0.0):
        return f"The stroke suffices below {depth:.4g} m: ask for more, or lengthen it"
    less = " by more than a step overshoots, for what passes that depth sinks" if outwards else ""
    return f"The stroke ends at {depth:.4g} m: ask for less{less}, or lengthen the stroke"


def _check_stroke(
    vehicle: Vehicle, depth: float, field: str, of_cast: Callable[[float], float] | None
) -> None:
    stroke, neutral = vehicle.stroke, (of_cast or vehicle.neutral_volume)(depth)
    if stroke.minimum < neutral < stroke.maximum:
        return
    if of_cast is None:
        where, remedy = "there", _within_stroke(vehicle, neutral >= stroke.maximum)
    else:
        where = "there, in the water of the cast"
        remedy = "Trim the vehicle for this water (`swimbladder ballast --cast` says how, and "
        remedy += "writes the vehicle), or lengthen the stroke"
    raise InputError(
        f"the stroke is smaller than the neutral volume {where}: {neutral * 1e6:.4g} cm3 is "
        f"outside {stroke.minimum * 1e6:g} to {stroke.maximum * 1e6:g} cm3",
        field=field, value=depth, unit="m", remedy=remedy,
    )  # fmt: skip
