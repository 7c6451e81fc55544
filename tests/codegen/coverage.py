"""Which branches of the generated C its tests take: ``python -m tests.codegen.coverage [LAW...]``.

A law's library, and the same law in a vehicle whose numbers switch on what the first one's switch
off, are compiled with gcov's counters and run by what tests them: the fuzzer's harness with the
inputs that are kept and with random bytes, random pairs of faults in closed loop
(fuzzing/faulted.c), and the golden trace (the library's own extras/check.c). A branch is a way out
of a condition; what no run takes stands in fuzzing/untaken.toml, with reasons.
"""

import gzip
import json
import re
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from swimbladder.vehicle import Sensors, Supervisor, Vehicle
from tests.codegen import fuzz
from tests.codegen.build import run
from tests.codegen.laws import controlled, example
from tests.vehicles import DIVES, FLOATS, SWITCHED, limited, pump, stepper

LEAST = 0.95
_OTHER_GAINS = {"fastest": 0.0, "jerk": 0.0, "shortest": 0.0, "dead": 5e-6}
_OTHER_RATE = {"volume_step": 0.0, "speed_step": 0.0, "tolerance": 5.0, "near": 20.0}
_MISSIONS, _RANDOM = "400", "8000"


class Branch(NamedTuple):
    """A way out of a condition: its line, from the end of its file, and which of the ways."""

    file: str
    from_end: int
    way: int


class Taken(NamedTuple):
    """The branches of a law's C with its supervisor."""

    counts: Mapping[Branch, int]
    lines: Mapping[tuple[str, int], str]  # by file and place from the end

    @property
    def share(self) -> float:
        """Those that were taken."""
        return sum(map(bool, self.counts.values())) / len(self.counts)

    @property
    def untaken(self) -> Counter[str]:
        """How many were not, by "file: line's text"."""
        return Counter(
            f"{b.file}: {self.lines[b.file, b.from_end]}" for b, n in self.counts.items() if not n
        )


def vehicles(name: str) -> tuple[Vehicle, Vehicle]:
    """Return a law's vehicle, and one with all that supervisor and law have numbers for."""
    if LAWS[name].command == "volume change":
        return floats(name)
    first = controlled(name)
    volts = LAWS[name].command == "voltage"
    given = first.controller.parameters
    other = {n: value for n, value in _OTHER_GAINS.items() if n in given}
    own = first.controller.model_copy(update={"parameters": given | other})
    made = (pump if volts else stepper)(
        drag=SWITCHED,
        sensors=Sensors(depth_noise="8 mm", depth_quantum="5 mm"),
        controller=own,
        supervisor=Supervisor(time_limit="40 min", bottom_depth="9 m"),
    )
    return first, made


def floats(name: str) -> tuple[Vehicle, Vehicle]:
    """Return a float with a bypass and an oil line, and one without, whose supervisor has more."""
    first = load_vehicle(FLOATS[name])
    own = first.controller.parameters | (_OTHER_RATE if name == "rate" else {"depth_step": 0.0})
    plain = {"bypass": None, "line": None, "start_volume": 0.0, "longest_run": None, "quantum": 0.0}
    return first, first.model_copy(
        update={
            "actuator": first.actuator.model_copy(update=plain),
            "controller": first.controller.model_copy(update={"parameters": own}),
            "sensors": Sensors(depth_noise="8 mm", depth_quantum="5 mm"),
            "supervisor": Supervisor(time_limit="40 min", bottom_depth="90 m"),
        }
    )


def _libraries(name: str) -> Iterable[Library]:
    for vehicle in vehicles(name):
        if LAWS[name].command == "volume change":
            target, duration = DIVES[name]
            yield firmware(limited(vehicle), step=(0.0, target), duration=duration)
        else:
            yield firmware(limited(vehicle), duration=100 * example(name).tick)


def _run(made: Library, folder: Path) -> None:
    """Compile a library with counters, and run all that tests it."""
    write_library(made, folder / "library")
    src = folder / "library" / "src"
    flags = [
        *("-std=c99", "-ffp-contract=off", "-O0", "--coverage", "-I", src, "-I", fuzz.HERE),
        *fuzz.defines(made),
    ]
    harness = [fuzz.HERE / "harness.c", fuzz.HERE / "random.c"]
    check = folder / "library" / "extras" / "check.c"
    objects = {}
    for source in (*src.glob("*.c"), *harness, fuzz.HERE / "faulted.c", check):
        objects[source.stem] = folder / f"{source.stem}.o"
        run("gcc", *flags, "-c", source, "-o", objects[source.stem], cwd=folder)
    own = [objects[source.stem] for source in src.glob("*.c")]
    programs = {
        "fuzzed": [*own, objects["harness"], objects["random"]],
        "faulted": [o for o in own if o != objects["swb_vehicle"]] + [objects["faulted"]],
        "check": [*own, objects["check"]],
    }
    for program, parts in programs.items():
        run("gcc", "--coverage", *parts, "-o", folder / program, "-lm")
    run(folder / "fuzzed", *fuzz.kept_inputs(made.law.name, folder / "kept"), cwd=folder)
    run(folder / "fuzzed", _RANDOM, "1", cwd=folder)
    run(folder / "faulted", _MISSIONS, "1", cwd=folder)
    run(folder / "check", folder / "library" / "extras" / "golden.csv", cwd=folder)
    run("gcov", "--json-format", "--branch-probabilities", *folder.glob("*.gcda"), cwd=folder)


_SUPERVISOR = "swb_supervisor_step.h"  # the same for all; a law's numbers switch some of it off


def _counted(made: Library) -> Iterable[tuple[Branch, str, int]]:
    """Yield each branch of a library's C, its line's text, and how often it was taken."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        _run(made, folder)
        for report in folder.glob("*.gcov.json.gz"):
            for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
                path = Path(file["file"])
                if path.parent.name != "src":
                    continue
                text = (folder / "library" / "src" / path.name).read_text().splitlines()
                for line in file["lines"]:
                    at = len(text) - line["line_number"]
                    for way, branch in enumerate(line["branches"]):
                        words = " ".join(text[-1 - at].split())
                        yield Branch(path.name, at, way), words, branch["count"]


@cache
def _watched() -> tuple[tuple[Branch, str, int], ...]:
    """Return the supervisor's branches under a float, a law that rests and one that does not."""
    libraries = (made for name in ("rate", "pulse", "adrc") for made in _libraries(name))
    found = (one for made in libraries for one in _counted(made))
    return tuple(one for one in found if one[0].file == _SUPERVISOR)


def taken(name: str) -> Taken:
    """Return which branches of a law's C its tests take.

    What of the supervisor the numbers of other laws switch on, their tests take; those of a float
    switch most of it off, so that of a float it does not count.
    """
    counts: Counter[Branch] = Counter()
    lines: dict[tuple[str, int], str] = {}
    own = [one for made in _libraries(name) for one in _counted(made)]
    if LAWS[name].command == "volume change":
        own = [one for one in own if one[0].file != _SUPERVISOR]
    else:
        own += _watched()
    for branch, words, count in own:
        counts[branch] += count
        lines[branch.file, branch.from_end] = words
    return Taken(counts, lines)


def reasons(name: str) -> dict[str, str]:
    """Return why the branches on a line are not taken under a law, by "file: line's text"."""
    entries = tomllib.loads((fuzz.HERE / "untaken.toml").read_text(encoding="utf-8"))["untaken"]
    return {
        f"{entry['file']}: {line}": entry["reason"]
        for entry in entries
        if name in entry.get("laws", [name])
        for line in entry["lines"]
    }


def report(laws: Sequence[str]) -> str:
    """Return a table of the branches taken."""
    rows = ["| law + supervisor | branches | taken |", "|---|---|---|"]
    for name in laws:
        found = taken(name)
        n = sum(map(bool, found.counts.values()))
        rows.append(f"| {name} | {len(found.counts)} | {n}, {found.share:.1%} |")
        for line, ways in found.untaken.items():
            if line not in reasons(name):
                print(f"{name}: {ways} of {line}", file=sys.stderr)
    return re.sub(r"(\d)%", r"\1 %", "\n".join(rows))


if __name__ == "__main__":
    print(report(sys.argv[1:] or [*LAWS]))
