"""`analyse`: a vehicle with its control law, linearised and judged at the law's sample time."""

from typing import Any

from swimbladder.control.law import Law
from swimbladder.control.registry import check_command, own_law
from swimbladder.design.linear import Analysis, analyse_linear
from swimbladder.design.linear.analyse import check_depth
from swimbladder.errors import InputError, check_number
from swimbladder.sim.closed_loop.checks import law_at_rest
from swimbladder.vehicle import Vehicle


def analyse(
    vehicle: Vehicle,
    *,
    depth: float = 0.0,
    law: Law | None = None,
    parameters: Any = None,
    sample_time: float | None = None,
) -> Analysis:
    """Return the linear analysis of a vehicle at rest at a depth.

    Parameters
    ----------
    vehicle
        As `load_vehicle` returns it.
    depth
        At which it rests [m].
    law
        Its control law; none: that of the vehicle's controller. Without either, nothing is said of
        a closed loop.
    parameters
        Of the law; none, without a law: those of the vehicle's controller.
    sample_time
        Of the law [s]; none: that of the vehicle's controller.

    Returns
    -------
    Analysis
        What the linear models say of the vehicle and, where the law is linear around rest, of its
        closed loop; else a note on why there is none.

    Raises
    ------
    InputError
        The law commands what the actuator does not take, it has no sample time, or the depth is
        negative.
    """
    check_depth(depth)
    controller = vehicle.controller
    if law is None and controller is not None:
        law, bound = own_law(vehicle, sampled=False)
        parameters = bound if parameters is None else parameters
    if sample_time is None and controller is not None:
        sample_time = controller.sample_time
    if law is None:
        return analyse_linear(vehicle, depth=depth)
    if sample_time is None:
        raise InputError(
            "the law has no sample time, and the vehicle has no controller to take it from",
            field="sample_time",
            unit="s",
            remedy="Give sample_time",
        )
    check_number(sample_time, "sample_time", "s", above=0.0)
    check_command(law, vehicle)
    if law.command == "volume change":
        note = (
            f"The law {law.name!r} acts when it asks to be called, and changes the volume once: "
            "there is no loop to break, with margins. `swimbladder stability` follows it from one "
            "decision to the next."
        )
        return analyse_linear(vehicle, depth=depth, notes=(note,))
    at_rest = law_at_rest(law, parameters, vehicle, depth=depth, sample_time=sample_time)
    if at_rest.smooth:
        return analyse_linear(vehicle, depth=depth, law=at_rest, law_name=law.name)
    note = (
        f"The law {law.name!r} is not linear around rest (a dead band, a relay, a rounded command "
        "or a limit right there): its closed loop has no poles or margins. Simulate it instead."
    )
    return analyse_linear(vehicle, depth=depth, notes=(note,))
