"""Long work in chunks: on all cores or a cluster, kept on disk in case of a kill.

A `Store` keeps answers under a hash of the question and of the source that computes, so that a run
that was killed goes on, and an edited package computes anew. `each` does items by threads. A `Job`
is work that outgrows this process: any process can do a chunk of it, and what is done is known
from the disk alone, by a marker that is written last; `run` does it.
"""

import asyncio
import contextlib
import hashlib
import json
import multiprocessing
import os
import re
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent import futures
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol, TypeVar
from zipfile import BadZipFile

import numpy as np
from pydantic import BaseModel

from swimbladder.errors import InputError, NoAnswerError, Parameter, SwimbladderError, check_counts
from swimbladder.io.files import (
    file_there,
    make_folder,
    source_hash,
    write_atomically,
    write_through,
)
from swimbladder.io.progress import Advance, silent, so_far
from swimbladder.vehicle import Vehicle
from swimbladder.vehicle.plugins import optional
from swimbladder.vehicle.schema import check_choice

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_PACKAGE = Path(__file__).resolve().parent
_SHOWN = ("cli", "show")  # parts of the package that compute nothing
_REMARKS = {"provenance", "description"}  # of a vehicle: nothing depends on them
EXECUTORS = ("threads", "processes", "dask")
_POLL = 0.5  # s, between two reads of the markers
_PATIENCE = 10.0  # s, with a scheduler that does not answer
_WHERE = (
    "Give the address of a dask scheduler that runs, like tcp://host:8786, or the file that it "
    "wrote (dask scheduler --scheduler-file FILE)"
)
_TRIES = 3  # times that workers may die one after the other without a chunk that is done


# How the answers of a store are read, by the endings of their files.
_LOADERS: dict[str, Callable[[Any], Any]] = {
    ".npy": np.load,
    ".npz": lambda file: dict(np.load(file)),
    ".json": json.load,
}


@cache
def software() -> str:
    """Return a hash of all source of this package that computes."""
    return source_hash(
        path
        for path in _PACKAGE.rglob("*")
        if path.suffix in (".py", ".toml") and path.relative_to(_PACKAGE).parts[0] not in _SHOWN
    )


def release() -> str:
    """Return the version of this package and the hash of its source, for messages."""
    return f"{version('swimbladder')}, its source {software()}"


def identity(*values: Any) -> str:
    """Return a hash of values: the same for the same in every process, another for others.

    Of numbers, strings, arrays, records, tables of settings (pydantic) and what they are nested in;
    raises TypeError for what has no value that can be read.
    """
    digest = hashlib.sha256()
    _feed(digest, values)
    return digest.hexdigest()[:20]


def _feed(digest: Any, value: Any) -> None:
    digest.update(f"{type(value).__name__}(".encode())
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | Enum | Path):
        digest.update(repr(value).encode())
    elif isinstance(value, np.ndarray | np.generic):
        digest.update(f"{value.dtype.str} {value.shape} ".encode() + value.tobytes())
    elif isinstance(value, BaseModel):
        digest.update(value.model_dump_json(exclude=_REMARKS).encode())
        if isinstance(value, Vehicle) and (acts := value.engine) is not value.actuator:
            _feed(digest, acts)  # whatever its kind makes of it now
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(digest, (key, value[key]))
    elif isinstance(value, tuple | list):
        for item in value:
            _feed(digest, item)
    elif is_dataclass(value):
        for field in fields(value):
            _feed(digest, getattr(value, field.name))
    else:
        raise TypeError(f"{type(value).__name__} has no place in a question")
    digest.update(b")")


class Store:
    """A folder of answers, each in a file of its own that appears whole or not at all.

    An answer is found by what was asked, by what the whole store is about, and by `software`. It
    is an array, a mapping of arrays, or what JSON has. Without a folder nothing is kept.
    """

    def __init__(self, folder: Path | None, *about: Any) -> None:
        self.folder = folder
        self._about = about

    def read(self, *asked: Any) -> Any:
        """Return the answer that is kept; None where there is none, or none that can be read."""
        if self.folder is None:
            return None
        stem = self._stem(asked)
        try:
            for suffix, load in _LOADERS.items():
                if os.path.exists(stem + suffix):
                    with open(stem + suffix, "rb") as file:
                        return load(file)
        except (OSError, ValueError, EOFError, BadZipFile):
            pass  # spoilt: it is computed anew
        return None

    def write(self, answer: Any, *asked: Any) -> None:
        """Keep an answer; raises InputError where it cannot be written."""
        if self.folder is None:
            return
        make_folder(self.folder)
        stem = self._stem(asked)
        parts = answer.values() if isinstance(answer, Mapping) else [None]
        if isinstance(answer, np.ndarray):
            write_through(f"{stem}.npy", lambda at: np.save(at, answer))
        elif all(isinstance(part, np.ndarray) for part in parts):
            write_through(f"{stem}.npz", lambda at: np.savez(at, **answer))
        else:
            write_atomically(f"{stem}.json", json.dumps(answer))

    def get(self, compute: Callable[[], Answer], *asked: Any) -> Answer:
        """Return the answer that is kept, or compute and keep it; tuples may return as lists."""
        found: Answer | None = self.read(*asked)
        if found is None:
            found = compute()
            self.write(found, *asked)
        return found

    def forget(self) -> None:
        """Remove the folder."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _stem(self, asked: tuple[Any, ...]) -> str:
        assert self.folder is not None
        return str(self.folder / f"{asked[0]}-{identity(software(), self._about, asked)}")


def each(
    work: Callable[[Item], Answer],
    items: Iterable[Item],
    *,
    workers: int | None = None,
    processes: bool = False,
) -> Iterator[tuple[Item, Answer]]:
    """Yield (item, its answer) as they come, on all cores by threads: kernels let others run.

    processes: instead of threads, for work that holds Python's lock. Few items wait at a time, so
    that there may be any number. After an error no other is begun.
    """
    count = workers or os.cpu_count() or 1
    left, waiting = iter(items), dict[futures.Future[Answer], Item]()
    with _processes(count) if processes else futures.ThreadPoolExecutor(count) as pool:
        try:
            while True:
                for item in left:
                    waiting[pool.submit(work, item)] = item
                    if len(waiting) == 2 * count:
                        break
                if not waiting:
                    return
                done, _ = futures.wait(waiting, return_when=futures.FIRST_COMPLETED)
                for future in done:
                    yield waiting.pop(future), future.result()
        finally:
            for future in waiting:
                future.cancel()


class Job(Protocol):
    """Work in chunks that any process can do from a pickle of it, in any order, also twice."""

    @property
    def name(self) -> str:
        """The same for the same job everywhere, another for every other."""

    @property
    def count(self) -> int:
        """How many chunks there are."""

    def check(self) -> bool:
        """Return whether something is on disk; raises InputError where it is another job's."""

    def create(self) -> None:
        """Make the place on disk where there is none yet, whoever else does so just now."""

    def do(self, chunk: int) -> None:
        """Do a chunk: put what comes of it on disk, and its marker last."""

    def done(self) -> set[int]:
        """Return the chunks whose marker stands."""


@dataclass(frozen=True, kw_only=True)
class Workers:
    """Who does a job.

    executor: one of `EXECUTORS`. workers: threads, processes or local dask workers; a worker for
    each core where not given. scheduler: address of a dask scheduler that runs, or the file that it
    wrote; without one dask's workers are local. part: (k, n), or "k/n", for each nth chunk from the
    kth, from 1: n such runs, started in any order on any machines, do all of it.
    Raises InputError for what cannot be, and where dask is not installed.
    """

    executor: str = "threads"
    workers: int | None = None
    scheduler: str | None = None
    part: tuple[int, int] = (1, 1)

    def __post_init__(self) -> None:
        """Read the part; refuse what cannot be."""
        remedy = "Give a number and how many there are, like `part='1/8'`"
        given = self.part.split("/") if isinstance(self.part, str) else self.part
        try:
            k, n = map(int, given)
        except (TypeError, ValueError):
            what = "no part of a whole"
            raise InputError(what, field="part", value=self.part, remedy=remedy) from None
        object.__setattr__(self, "part", (k, n))
        check_choice(self.executor, EXECUTORS, "no such executor", field="executor")
        check_counts(workers=(self.workers, 1, 4096))
        if self.scheduler is not None and self.executor != "dask":
            what, remedy = "only dask has a scheduler", "Give `executor='dask'`"
            raise InputError(what, field="scheduler", value=self.scheduler, remedy=remedy)
        if self.scheduler is not None and self.workers is not None:
            what, remedy = "a scheduler has workers of its own", "Leave it out"
            raise InputError(what, field="workers", value=self.workers, remedy=remedy)
        if not 1 <= k <= n <= 1_000_000:
            raise InputError("no part of a whole", field="part", value=f"{k}/{n}", remedy=remedy)
        if self.executor == "dask":
            _dask()

    @property
    def local(self) -> int:
        """How many work on this machine."""
        return self.workers or os.cpu_count() or 1


def run(job: Job, workers: Workers, advance: Advance = silent) -> bool:
    """Do what is not done yet of a job; return whether all of it is done, whoever did it.

    advance: called with the share of the job that was done, by these workers or others.
    Raises InputError where the executor cannot be had, or its workers have another version of
    this software; NoAnswerError where they died. Where it fails, what is done stays done.
    """
    job.check()
    k, n = workers.part
    done = job.done()
    ours = [chunk for chunk in range(k - 1, job.count, n) if chunk not in done]
    done_so_far = so_far(advance)

    def report() -> None:
        done_so_far(len(job.done()) / job.count)

    report()
    if ours:
        do = {"threads": _by_threads, "processes": _by_pool, "dask": _by_dask}
        do[workers.executor](job, ours, workers, report)
        report()
    return len(job.done()) == job.count


def _by_threads(job: Job, chunks: list[int], workers: Workers, report: Callable[[], None]) -> None:
    job.create()
    for _ in each(job.do, chunks, workers=workers.local):
        report()


def _by_pool(job: Job, chunks: list[int], workers: Workers, report: Callable[[], None]) -> None:
    """Do chunks by processes; those of a pool that broke by another."""
    job.create()
    work, tries = partial(_do, job.name, software(), job), 0
    while chunks:
        before = len(chunks)
        with contextlib.suppress(BrokenProcessPool):
            for _ in each(work, chunks, workers=workers.local, processes=True):
                report()
        done = job.done()
        chunks = [chunk for chunk in chunks if chunk not in done]
        tries = 0 if len(chunks) < before else tries + 1
        if tries >= _TRIES:
            what = (
                f"the worker processes died {tries} times without doing anything. Look for what "
                "kills them, such as too little memory, or use `executor='threads'`"
            )
            raise NoAnswerError(what)


def _processes(count: int) -> futures.ProcessPoolExecutor:
    spawn = multiprocessing.get_context("spawn")  # a fork has locks of threads that it has not
    return futures.ProcessPoolExecutor(count, spawn, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """End this process when the one that made it ends, also by a kill."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


_MET: dict[str, Job] = {}  # by its name: with it stays what a job makes once for all its chunks


def _do(name: str, source: str, job: Job, chunk: int) -> None:
    """Do a chunk in a process that may be anywhere."""
    if source != software():
        what = f"a worker has another version of swimbladder: {release()}, where {source} is needed"
        raise InputError(what, field="executor", remedy="Install the same on all machines")
    known = _MET.setdefault(name, job)
    if chunk not in known.done():
        known.do(chunk)


def _dask() -> Any:
    return optional("distributed", "cluster", "dask", field="executor", value="dask")


def _by_dask(job: Job, chunks: list[int], workers: Workers, report: Callable[[], None]) -> None:
    distributed = _dask()
    with contextlib.ExitStack() as stack:
        address: Any = workers.scheduler
        if address is None:
            quiet = {"dashboard_address": None, "silence_logs": 50}
            local = distributed.LocalCluster(n_workers=workers.local, threads_per_worker=1, **quiet)
            address = stack.enter_context(local)
        elif file_there(Path(address)):
            address = _written_address(Path(address))
        elif "://" not in address and not re.search(r":\d+$", address):
            what = "there is no such file, and it is no address with a port"
            raise InputError(what, field="scheduler", value=address, remedy=_WHERE)
        client = stack.enter_context(_client(distributed, address))
        stack.enter_context(client.as_current())
        _check_versions(client)
        job.create()
        _send(distributed, client, job, chunks, report)


def _written_address(file: Path) -> str:
    """Return the address in a file that a scheduler wrote."""
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError):
        what = "no file that a scheduler wrote"
        raise InputError(what, file=file, field=Parameter("scheduler"), remedy=_WHERE) from None


def _client(distributed: Any, address: Any) -> Any:
    async def knock() -> None:
        comm = await distributed.core.connect(address, timeout=_PATIENCE)
        await comm.close()

    try:
        if isinstance(address, str):  # a client that finds nobody complains for long
            asyncio.run(knock())
        return distributed.Client(
            address, timeout=_PATIENCE, set_as_default=False, name="swimbladder"
        )
    except (OSError, ValueError) as error:  # a TimeoutError is one too
        what = f"no scheduler answers there: {error}"
        raise InputError(what, field="scheduler", value=str(address), remedy=_WHERE) from None


def _check_versions(client: Any) -> None:
    """Raise InputError where a worker has not the source that this process has."""

    def there() -> str:  # goes by value: a worker may know nothing of this module
        import importlib

        try:
            return str(importlib.import_module("swimbladder.jobs").release())
        except (ImportError, AttributeError) as error:
            return f"none that can be used: {error}"

    here = release()
    for worker, found in sorted(client.run(there, on_error="return").items()):
        if found != here:
            what = (
                f"the worker {worker} has another version of swimbladder: {found}; here it is "
                f"{here}"
            )
            remedy = "Install the same on all machines, and start the workers again"
            raise InputError(what, field="scheduler", remedy=remedy)


def _send(
    distributed: Any, client: Any, job: Job, chunks: list[int], report: Callable[[], None]
) -> None:
    """Have workers of a cluster do chunks; what is done is read from the disk."""
    name, source, left, waiting = job.name, software(), iter(chunks), dict[Any, int]()
    sent = client.submit(_same, job, key=f"swimbladder-{name}", pure=False)
    seen = time.monotonic()
    while True:
        # few wait at a time: they are all submitted again when a worker dies
        room = 32 + 4 * sum(client.nthreads().values()) if client.status == "running" else 0
        for chunk in left if len(waiting) < room else ():
            key = f"swimbladder-{name}-{chunk}"
            waiting[client.submit(_do, name, source, sent, chunk, key=key, pure=False)] = chunk
            if len(waiting) >= room:
                break
        if not waiting:
            return
        with contextlib.suppress(distributed.TimeoutError):
            distributed.wait(list(waiting), timeout=_POLL, return_when="FIRST_COMPLETED")
        if client.status == "running":
            seen = time.monotonic()
        for future in [one for one in waiting if one.done()]:
            if future.status == "error":
                raise _reason(future.exception())
            if future.status == "finished":
                del waiting[future]
        if any(one.cancelled() for one in waiting) or time.monotonic() - seen > _PATIENCE:
            what = (
                "the scheduler no longer answers. What is done stays done: the same command goes "
                "on there with a scheduler that runs"
            )
            raise NoAnswerError(what)
        report()


def _same(job: Job) -> Job:
    return job


def _reason(error: BaseException) -> BaseException:
    """Return an error of a worker as one of ours where it is about workers that died."""
    if isinstance(error, SwimbladderError) or type(error).__name__ != "KilledWorker":
        return error
    what = f"{str(error).rstrip('.')}. What is done stays done: the same command goes on there"
    return NoAnswerError(what)


def place_files(folder: Path, files: Mapping[str, bytes], *, aside: Path) -> None:
    """Put files into a folder, each whole or not at all; after it they outlive a loss of power.

    aside: a folder on the same disk, for what is not whole yet.
    """
    with tempfile.TemporaryDirectory(dir=aside) as made:
        for number, (key, content) in enumerate(files.items()):
            path, target = Path(made, str(number)), folder / key
            with path.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            target.parent.mkdir(parents=True, exist_ok=True)
            path.replace(target)
    if os.name == "posix":  # elsewhere a folder cannot be opened
        for parent in {(folder / key).parent for key in files}:
            handle = os.open(parent, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)
