"""``swimbladder campaign``: an array of floats on one mission, each a little different."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swimbladder.cli.casts import Casts, warn_of_mass
from swimbladder.cli.common import aside, asked_of, progress, working
from swimbladder.cli.options import (
    Files,
    Options,
    VehicleName,
    flag,
    grouped,
    loaded,
    supervised,
    valued,
)
from swimbladder.cli.texts import Given
from swimbladder.errors import InputError

if TYPE_CHECKING:
    from swimbladder.sim.campaign.store import Layout
    from swimbladder.vehicle import Vehicle
    from swimbladder.vehicle.spread import Spread


class Flown(Options):
    """How many floats are flown, for how long."""

    cycles: int | None = valued("N", "Cycles (as in the mission).", min=1)
    duration: Given = valued("TIME", "Duration: no cycle begins after it.")
    seed: int = valued("N", "Seed of all random draws.", 1, min=0)
    supervised: bool | None = supervised()


class Spreads(Options):
    """How much floats differ, by the inputs of a `Spread`."""

    trim: Given = valued("VOLUME", "1 sigma of the neutral volume (5 cm3).", name="--trim-std")
    psi: Given = valued("PSI", "1 sigma of psi (0.002 cm3/m).", name="--psi-std")
    drag: Given = valued("SHARE", "1 sigma of the drag (10 %).", name="--drag-std")
    pump: Given = valued("SHARE", "1 sigma of the pump's delivery (5 %).", name="--pump-std")

    spread: Path | None = valued("FILE", "TOML file with the spread.")
    identified: bool = flag("--identified", "Spread from the identified covariance.")
    sensitivity: bool = flag("--sensitivity", "Sobol sensitivity indices of the outcome.")

    def of(self, vehicle: Vehicle) -> Spread:
        """Return the spread of a file, or the usual one; as identified; with what is stated."""
        from swimbladder.io.config import file_text, read_model
        from swimbladder.vehicle.spread import Spread

        file = self.spread
        found = Spread() if file is None else read_model(Spread, file_text(file), file)
        if self.identified:
            try:
                found = found.identified(vehicle)
            except InputError as error:
                raise error.but(field="--identified") from None
        inputs = {name: getattr(self, name) for name in ("trim", "psi", "drag", "pump")}
        given = {name: text for name, text in inputs.items() if text is not None}
        return Spread(**{**found.model_dump(), **given})


class Work(Options):
    """Who flies them, as `jobs.Workers` has it."""

    executor: str = valued("WHO", "Workers: threads, processes or dask.", "threads")
    workers: int | None = valued("N", "Number of workers (one per core).")
    scheduler: Given = valued("WHERE", "Dask scheduler: address, or its file.")
    part: str = valued(
        "K/N", "Part K of N of the chunks, into the same folder.", "1/1", show_default=False
    )


_MISSION = typer.Argument(metavar="MISSION", help="TOML file with phases and cycles.")


@grouped("floats cycles duration sensitivity", out=Path("swimbladder-campaign"))
def campaign(
    vehicle: VehicleName,
    mission: Annotated[Path, _MISSION],
    floats: Annotated[int, typer.Option(metavar="N", help="Number of floats.")] = 4000,
    *,
    how: Flown,
    stated: Spreads,
    work: Work,
    reading: Casts,
    to: Files,
) -> None:
    """Simulate many floats on a mission: success, and battery life.

    Trim, hull, drag and pump differ, and the water where several casts are given. All results go to
    campaign.zarr in the folder, a chunk of floats at a time, by as many workers as there are.

    Exit code 1: a float did not do every phase. A run that is killed goes on where it was.
    """
    from swimbladder.io.config import load_mission

    v, task = loaded(vehicle, weighed=True), load_mission(mission)
    asked, who = how.read(), work.read()
    casts = reading.casts(task.latitude)
    warn_of_mass(v)
    with progress("loading the simulator"):
        from swimbladder.jobs import Workers, run
        from swimbladder.sim.campaign.result import result_of, waters_of
        from swimbladder.sim.campaign.run import Floats
    with asked_of(mission, task), progress("tabulating the water"):
        columns = waters_of(v, task, casts)

    workers = Workers(**who)
    drawn = stated.of(v)
    with asked_of(mission, task, duration=how.duration):
        job = Floats(
            vehicle=v,
            mission=task,
            columns=columns,
            floats=floats,
            spread=drawn,
            sensitivity=stated.sensitivity,
            store=to.out / "campaign.zarr",
            **asked,
        )
    layout = job.layout
    doing = f"flying {layout.floats} floats"
    job.check()
    aside(*job.cost)
    with working(doing, keep=job.store) as advance:
        whole = run(job, workers, advance)
    if not whole:
        _unfinished(layout, work.part, to)
        return
    found = result_of(job)
    to.answer(found, [job.store])


def _unfinished(layout: Layout, part: str, to: Files) -> None:
    """Say how far the campaign is of which this was a part."""
    done = len(layout.done())
    chunks = f"{done} of {layout.count} chunks of the campaign are done"
    sentence = f"part {part} is flown: {chunks}, the others are for other parts"
    state = {"sentence": sentence, "chunks": layout.count, "done": done}
    to.show({**state, "files": [str(layout.folder)]}, [sentence])
