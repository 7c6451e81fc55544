"""``swimbladder ballast``: what to add, and whether the stroke does, in the sea of a cast."""

from pathlib import Path

from swimbladder.cli.casts import Casts, refuse_doubted_unit
from swimbladder.cli.common import progress
from swimbladder.cli.options import Files, Options, VehicleName, grouped, loaded, valued
from swimbladder.cli.texts import Given


class Targets(Options):
    """What the ballast is to bring about, as a `Target` has it."""

    neutral_depth: Given = valued("DEPTH", "Find the mass that is neutral at this depth.")
    neutral_volume: Given = valued("VOLUME", "Volume of the drive at that depth (0).")
    freeboard: Given = valued("LENGTH", "Freeboard at full volume.")


class Task(Options):
    """Where it is to go, how sure that has to be, and with what."""

    max_depth: Given = valued("DEPTH", "Greatest depth (the rating, or the cast's end).")
    speed: str = valued("SPEED", "Vertical speed.", "0 m/s")
    probability: str = valued("SHARE", "Probability that the stroke suffices.", "95 %")
    material: str = valued("WHAT", "Ballast: lead, steel, ..., a density, or inside.", "lead")
    mass: Given = valued("MASS", "Mass on the scale (that of trim_error).")


class Stds(Options):
    """What is not known, 1 sigma, as an `Uncertainty` has it."""

    mass: Given = valued("MASS", "1 sigma of the mass.", name="--mass-std")
    volume: Given = valued("VOLUME", "1 sigma of the hull's volume.", name="--volume-std")
    trim: Given = valued("VOLUME", "1 sigma of the neutral volume.", name="--trim-std")
    psi: Given = valued("PSI", "1 sigma of psi, the hull's compression.", name="--psi-std")
    heat: Given = valued("1/K", "1 sigma of the thermal expansion.", name="--heat-std")
    air: Given = valued("VOLUME", "1 sigma of the trapped air.", name="--air-std")
    density: Given = valued("DENSITY", "1 sigma of the sea's density.", name="--density-std")


@grouped("max_depth neutral_depth freeboard material mass", out=Path("swimbladder-ballast"))
def ballast(
    vehicle: VehicleName,
    *,
    target: Targets,
    task: Task,
    stds: Stds,
    reading: Casts,
    to: Files,
) -> None:
    r"""Find the ballast in a measured cast, and whether the stroke suffices.

    Without --cast the water is that of the vehicle's file, of constant density. Exit code 1 says
    that the stroke does not cover it with that probability, what is short and by how much.
    """
    v = loaded(vehicle, weighed=True)
    given, sought = stds.read(), target.given()
    asked = task.read()
    casts = reading.casts()

    from swimbladder.design.ballast import Target, material_of, uncertainty_of
    from swimbladder.design.ballast import ballast as find

    material_of(task.material)
    refuse_doubted_unit(casts, asked["max_depth"], v.hull.depth_limit)
    with stds.said_as_typed():
        uncertainty = uncertainty_of(v, given)
    wanted = Target(**sought, probability=asked.pop("probability"), speed=asked.pop("speed"))
    with progress("drawing vehicles", 1.0) as advance:
        found = find(v, casts, target=wanted, uncertainty=uncertainty, advance=advance, **asked)
    to.answer(found)
