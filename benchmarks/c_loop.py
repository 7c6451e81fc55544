"""The yardstick: `mission.c`, compiled here for this processor and called through ctypes."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from benchmarks.mission import Array, Fleet, Mission

__all__ = ["FLAGS", "LOOPS", "SHAPES", "Build", "Tuned", "built", "compiler", "fastest"]

SOURCE = Path(__file__).with_name("mission.c")
FLAGS = ("-std=c11", "-O3", "-march=native", "-ffast-math", "-fPIC")
OPTIONAL = ("-fschedule-insns",)  # where the compiler knows it
FIELDS = (
    "T1",
    "gain",
    "load_drive",
    "V_min",
    "V_max",
    "supply",
    "a_b",
    "psi",
    "V_0",
    "d_l",
    "z_surface",
    "a_s",
    "z_bottom",
)
SHAPES = ((16, 512), (32, 512), (8, 512), (8, 256), (16, 256), (32, 256))  # lanes, width [bit]
LOOPS = ("ensemble", "ensemble_exact")
RESULTS = ("q", "V", "z", "w", "shallowest", "deepest", "squares")


class _Cascade(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("k_pV", "k_pz", "k_iz", "k_dz", "S_p")]


def compiler() -> str | None:
    """Return the C compiler to use, None without one."""
    names = [os.environ.get("CC", ""), "gcc", "cc", "clang"]
    return next((found for name in names if name and (found := shutil.which(name))), None)


@dataclass(frozen=True)
class Build:
    """One build of the C loop: how many vehicles side by side, how wide a vector [bit]."""

    lanes: int
    width: int
    library: ctypes.CDLL

    @property
    def name(self) -> str:
        """What to call it in a table."""
        return f"blocks of {self.lanes}, {self.width} bit"

    def single(self, mission: Mission, fleet: Fleet, lane: int) -> Array:
        """Return the depth of one vehicle at the samples, by the scalar loop."""
        fields = np.ascontiguousarray(_fields(fleet.take([lane]))[:, 0])
        rows = np.empty((5, mission.samples + 1))
        self.library.single(
            mission.samples,
            _pointer(mission.reference),
            _gains(mission),
            _pointer(fields),
            _pointer(rows),
        )
        depth: Array = rows[2]
        return depth

    def depths(self, mission: Mission, fleet: Fleet, *, loop: str = "ensemble") -> Array:
        """Return the depths [lane, sample] of a fleet, by one of the LOOPS over blocks."""
        padded, count = self._padded(fleet)
        depths = np.empty((mission.samples + 1, len(padded)))
        self._run(loop, mission, padded, 1, depths)
        return np.ascontiguousarray(depths[:, :count].T)

    def summaries(
        self, mission: Mission, fleet: Fleet, threads: int = 1, *, loop: str = "ensemble"
    ) -> dict[str, Array]:
        """Return the last state of each vehicle, its range of depths and its rms error [m]."""
        padded, count = self._padded(fleet)
        rows = self._run(loop, mission, padded, threads, None)[:, :count]
        found = dict(zip(RESULTS, rows, strict=True))
        found["rms"] = np.sqrt(found.pop("squares") / mission.samples)
        return found

    def _padded(self, fleet: Fleet) -> tuple[Fleet, int]:
        """Return a fleet of whole blocks, filled up with its first vehicle, and its true number."""
        count = len(fleet)
        more = -count % self.lanes
        return fleet.take([*range(count), *[0] * more]) if more else fleet, count

    def _run(
        self, loop: str, mission: Mission, fleet: Fleet, threads: int, depths: Array | None
    ) -> Array:
        count = len(fleet)
        fields, results = _fields(fleet), np.empty((len(RESULTS), count))
        blocks = count // self.lanes
        edges = [blocks * i // threads * self.lanes for i in range(threads + 1)]

        def part(first: int, last: int) -> None:
            getattr(self.library, loop)(
                first,
                last,
                count,
                mission.samples,
                _pointer(mission.reference),
                _gains(mission),
                _pointer(fields),
                _pointer(results),
                None if depths is None else _pointer(depths),
            )

        if threads == 1:
            part(0, count)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(part, edges[:-1], edges[1:]))
        return results


@contextmanager
def built(lanes: int = 16, width: int = 512) -> Iterator[Build]:
    """Compile the loop into a temporary folder, for as long as it is used."""
    cc = compiler()
    if cc is None:
        raise FileNotFoundError("no C compiler: neither $CC, gcc, cc nor clang is there")
    with tempfile.TemporaryDirectory(prefix="swimbladder-bench-") as folder:
        target = Path(folder) / "mission.so"
        extra = (*OPTIONAL, f"-mprefer-vector-width={width}")
        options = [*FLAGS, f"-DLANES={lanes}", *(option for option in extra if _takes(cc, option))]
        compiled = target.with_suffix(".o")
        subprocess.run([cc, *options, "-c", "-o", str(compiled), str(SOURCE)], check=True)
        # linked without -ffast-math, which would flush subnormals to zero in the whole process
        subprocess.run([cc, "-shared", "-o", str(target), str(compiled), "-lm"], check=True)
        library = ctypes.CDLL(str(target))
        size, pointer = ctypes.c_ssize_t, ctypes.POINTER(ctypes.c_double)
        gains = ctypes.POINTER(_Cascade)
        library.single.argtypes = [size, pointer, gains, pointer, pointer]
        library.single.restype = None
        for loop in LOOPS:
            function = getattr(library, loop)
            function.argtypes = [size] * 4 + [pointer, gains, pointer, pointer, pointer]
            function.restype = None
        yield Build(lanes, width, library)


class Tuned(NamedTuple):
    """The fastest build for a loop, and the time of each shape [ms per vehicle-hour]."""

    build: Build
    times: dict[str, float]


@contextmanager
def fastest(
    mission: Mission, fleet: Fleet, shapes: Sequence[tuple[int, int]] = SHAPES
) -> Iterator[dict[str, Tuned]]:
    """Compile in several shapes, time each on a part of the fleet, give the best of each loop."""
    sample = fleet.take(list(range(min(len(fleet), 512))))
    with ExitStack() as stack:
        builds = [stack.enter_context(built(lanes, width)) for lanes, width in shapes]
        found = {}
        for loop in LOOPS:
            times = {build.name: _least_time(build, mission, sample, loop) for build in builds}
            found[loop] = Tuned(min(builds, key=lambda build: times[build.name]), times)
        yield found


def _least_time(build: Build, mission: Mission, fleet: Fleet, loop: str) -> float:
    times = []
    for _ in range(4):
        start = process_time()
        build.summaries(mission, fleet, loop=loop)
        times.append(process_time() - start)
    return min(times) / len(fleet) * 3600.0 / mission.duration * 1e3


def _takes(cc: str, option: str) -> bool:
    test = [cc, option, "-x", "c", "-fsyntax-only", "-"]
    return subprocess.run(test, input=b"", capture_output=True, check=False).returncode == 0


def _gains(mission: Mission) -> _Cascade:
    return _Cascade(**mission.gains._asdict())


def _fields(fleet: Fleet) -> Array:
    """Return the rows that the enum of mission.c names: of Plant, then the start state."""
    rest = np.zeros(len(fleet))
    start = [rest, fleet.start_volume, fleet.start_depth, rest]
    return np.array([*(fleet.plants[name] for name in FIELDS), *start])


def _pointer(array: Array) -> ctypes._Pointer[ctypes.c_double]:
    assert array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
