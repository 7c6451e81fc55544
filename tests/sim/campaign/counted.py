"""A campaign in a process of its own that notes which chunks it begins, for tests that kill it.

Its arguments: STORE LOG FLOATS EXECUTOR [SCHEDULER].
"""

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from swimbladder.io.config import load_vehicle
from swimbladder.io.mission import Mission
from swimbladder.jobs import Workers, run
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.run import Floats

TASK = Mission(
    phases=[
        {"kind": "descend", "depth": 60.0, "tolerance": 5.0},
        {"kind": "park", "depth": 60.0, "tolerance": 5.0, "duration": 1200.0},
        {"kind": "surface", "duration": 300.0},
    ],
    cycles=2,
)


def floats(store: Path, count: int) -> Floats:
    vehicle = load_vehicle("example-float")
    return Floats(
        vehicle=vehicle,
        mission=TASK,
        columns=[uniform_column(vehicle.water, 150.0)],
        floats=count,
        store=store,
        seed=3,
    )


@dataclass(frozen=True)
class Counted:
    """A job that notes in a file which chunk is begun, and takes its time."""

    job: Floats
    log: Path
    pause: float = 0.3  # s

    @property
    def name(self):
        return self.job.name

    @property
    def count(self):
        return self.job.count

    def check(self):
        return self.job.check()

    def create(self):
        self.job.create()

    def done(self):
        return self.job.done()

    def do(self, chunk):
        handle = os.open(self.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(handle, f"{chunk} {os.getpid()}\n".encode())
        os.close(handle)
        time.sleep(self.pause)
        self.job.do(chunk)


def main() -> None:
    store, log, count, executor, *scheduler = sys.argv[1:]
    # by its real name: processes of a cluster have another main module
    from tests.sim.campaign.counted import Counted

    job = Counted(floats(Path(store), int(count)), Path(log))
    workers = Workers(executor=executor, scheduler=scheduler[0] if scheduler else None)
    sys.exit(not run(job, workers))
