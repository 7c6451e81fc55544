"""Kill -9 of client, worker and scheduler: the store is an undisturbed campaign's, to the bit.

At most one chunk for each worker and kill is flown again, whoever is killed, and when.
"""

import functools
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from swimbladder.jobs import Workers, run
from tests.sim.campaign.counted import floats

pytest.importorskip("distributed")
ROOT = Path(__file__).parents[3]
WORKERS = 2


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    @functools.cache
    def flown(count):
        job = floats(tmp_path_factory.mktemp("undisturbed") / "campaign.zarr", count)
        assert run(job, Workers())
        job.layout.tidy()
        return contents(job.store), job.count

    return flown


class Cluster:
    """A client, and with dask a scheduler and workers, each started again when it is gone."""

    def __init__(self, folder, executor, count):
        self.folder, self.executor, self.count = folder, executor, count
        self.store, self.log = folder / "campaign.zarr", folder / "log"
        self.file = folder / "scheduler.json"
        self.processes = {}

    def _start(self, name, *arguments):
        environment = os.environ | {
            "PYTHONPATH": str(ROOT),
            "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s",
        }
        with (self.folder / f"{name}.txt").open("ab") as said:
            self.processes[name] = subprocess.Popen(
                [sys.executable, *arguments],
                stdout=said,
                stderr=said,
                cwd=self.folder,
                env=environment,
                start_new_session=True,
            )

    def heal(self):
        """Start what is not there."""
        if self.executor == "dask":
            if self._gone("scheduler"):
                self.file.unlink(missing_ok=True)
                self._start(
                    "scheduler",
                    "-m",
                    "distributed.cli.dask_scheduler",
                    "--port",
                    "0",
                    "--host",
                    "127.0.0.1",
                    "--no-dashboard",
                    "--scheduler-file",
                    str(self.file),
                )
                for name in [name for name in self.processes if name.startswith("worker")]:
                    self.kill(name)  # they wait for the one that is gone
            if not self.file.exists():
                return
            for name in (f"worker {n}" for n in range(WORKERS)):
                if self._gone(name):
                    self._start(
                        name,
                        "-m",
                        "distributed.cli.dask_worker",
                        "--no-nanny",
                        "--nthreads",
                        "1",
                        "--no-dashboard",
                        "--scheduler-file",
                        str(self.file),
                    )
        if self._gone("client"):
            self._start(
                "client",
                "-c",
                "from tests.sim.campaign.counted import main; main()",
                str(self.store),
                str(self.log),
                str(self.count),
                self.executor,
                *[str(self.file)] * (self.executor == "dask"),
            )

    def _gone(self, name):
        return name not in self.processes or self.processes[name].poll() is not None

    def begun(self):
        return self.log.read_text().splitlines() if self.log.exists() else []

    def working(self):
        """Return the processes that are known to have begun a chunk, and live."""
        found = {int(line.split()[1]) for line in self.begun()}
        return [pid for pid in sorted(found) if Path(f"/proc/{pid}").exists()]

    def kill(self, name):
        if not self._gone(name):
            self.processes[name].kill()
            self.processes[name].wait()

    def stop(self):
        for name in list(self.processes):
            self.kill(name)


def disturbed(folder, executor, victims, undisturbed, *, count=160):
    """Fly with kills at random times; check the store, and what was flown again."""
    right, chunks = undisturbed(count)
    chance = random.Random(f"{executor} {victims}")
    cluster = Cluster(folder, executor, count)
    kills, begin = 0, time.monotonic()
    try:
        while True:
            cluster.heal()
            time.sleep(0.05)
            finished = cluster.processes.get("client")
            if finished is not None and finished.poll() == 0:
                break
            assert time.monotonic() - begin < 120 + 60 * len(victims), "it does not come to its end"
            flying = cluster.begun()
            # all along the campaign
            if kills < len(victims) and len(flying) > chunks * kills / (len(victims) + 1):
                time.sleep(chance.uniform(0.0, 1.0))
                victim = victims[kills]
                if victim == "process":
                    for pid in cluster.working()[:1]:
                        os.kill(pid, signal.SIGKILL)
                else:
                    cluster.kill(victim)
                kills += 1
    finally:
        cluster.stop()
    assert kills == len(victims), "it was done before all were killed"
    assert contents(cluster.store) == right
    begun = [int(line.split()[0]) for line in cluster.begun()]
    assert set(begun) == set(range(chunks))
    again = len(begun) - chunks
    assert again <= WORKERS * kills, f"{again} chunks flown again after {kills} kills"


@pytest.mark.prove
def test_killed_processes(tmp_path, undisturbed):
    disturbed(tmp_path, "processes", ["process", "client"], undisturbed)


@pytest.mark.prove
def test_killed_dask(tmp_path, undisturbed):
    disturbed(tmp_path, "dask", ["worker 0", "client", "scheduler"], undisturbed)


@pytest.mark.prove
@pytest.mark.parametrize("executor", ["threads", "processes", "dask"])
def test_twenty_kills(executor, tmp_path, undisturbed):
    """Each worker, the client and the scheduler, by chance."""
    who = {
        "threads": ["client"],
        "processes": ["client", "process"],
        "dask": ["client", "scheduler", "worker 0", "worker 1"],
    }
    chance = random.Random(7)
    victims = [chance.choice(who[executor]) for _ in range(20)]
    disturbed(tmp_path, executor, victims, undisturbed, count=3000)
