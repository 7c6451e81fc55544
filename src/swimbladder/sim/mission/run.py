"""A mission from vehicle, phases and water to its answer."""

from pathlib import Path

from swimbladder.io.mission import Mission
from swimbladder.io.progress import Advance, silent
from swimbladder.physics.seawater import Cast
from swimbladder.sim.closed_loop.single import check_counts
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.sim.mission.result import MissionResult
from swimbladder.sim.mission.water import water_of
from swimbladder.vehicle import Vehicle


def mission(
    vehicle: Vehicle,
    mission: Mission,
    cast: Cast | None = None,
    *,
    seed: int | None = None,
    supervised: bool | None = None,
    keep: Path | None = None,
    advance: Advance = silent,
) -> MissionResult:
    """Simulate a mission of phases and cycles: depth, time, pump, battery.

    Parameters
    ----------
    vehicle, mission
        As `load_vehicle` and `load_mission` return them; `Mission.limited` has other cycles,
        `Mission.over` another bottom.
    cast
        The water, as `read_cast` returns it; none: that of the vehicle's file, of constant density.
    seed
        Of the sensors' noise; none: they have neither noise nor quantum.
    supervised
        False: the laws fly alone. Else under the supervisor, where the vehicle's file has one.
    keep
        Folder of unfinished work: a flight that was killed goes on there.
    advance
        Called with the share of the mission that was flown since.

    Returns
    -------
    MissionResult
        The flight, whether it did what it should, and its energy.

    Raises
    ------
    InputError
        Vehicle, mission and water do not go together.
    NoAnswerError
        The mission cannot be done.
    """
    check_counts(seed=(seed, 0))
    flight = fly_mission(
        vehicle,
        mission,
        water_of(vehicle, mission, cast),
        seed=seed,
        supervised=supervised,
        keep=keep,
        advance=advance,
    )
    return MissionResult(flight, flight.reach)
