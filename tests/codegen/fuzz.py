"""The generated C under a fuzzer, with the address and undefined-behaviour sanitizers.

``python -m tests.codegen.fuzz [--seconds N] [--law LAW]...`` builds for each law one program: the
law, its controller, the supervisor, the arming, the black box, for the cascade the pool procedure
and for a float pump and valve on their pins. libFuzzer runs it for so long, and a table says what
it did. fuzzing/harness.c says which promises are watched. Division by zero is not looked for: in
IEEE 754 it is defined, and the laws count on its infinities.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

from swimbladder.codegen.c99 import c_law
from swimbladder.codegen.library import Library, firmware, write_library
from swimbladder.codegen.pool import PoolOptions
from swimbladder.control.registry import LAWS
from swimbladder.io.config import load_vehicle
from tests.codegen.build import run
from tests.codegen.laws import controlled, example
from tests.vehicles import DIVES, FLOATS, limited

HERE = Path(__file__).parent / "fuzzing"
INPUTS = HERE / "inputs"  # a file for each law, a line for each input, in hexadecimal
_SANITIZERS = "address,undefined,float-cast-overflow"
_FLAGS = (
    "-std=c99",
    "-ffp-contract=off",
    "-g",
    "-O1",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)


class Fuzzed(NamedTuple):
    """What a run of the fuzzer did."""

    law: str
    runs: int
    covered: str  # lines of the library's C, as "12 of 34"
    crash: Path | None
    said: str


@cache
def library(name: str) -> Library:
    """Return a law's library; the cascade's has the pool procedure, a float's is a dive to 30 m."""
    if LAWS[name].command == "volume change":
        target, duration = (30.0, 1500.0) if name == "rate" else DIVES[name]
        return firmware(limited(load_vehicle(FLOATS[name])), step=(0.0, target), duration=duration)
    pool = PoolOptions(4.5, rounds=2) if name == "cascade" else None
    return firmware(limited(controlled(name)), duration=100 * example(name).tick, pool=pool)


def kept_inputs(name: str, folder: Path) -> list[Path]:
    """Write a law's inputs, which reach far or once broke something, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for n, line in enumerate((INPUTS / f"{name}.hex").read_text().split()):
        found.append(folder / f"kept-{n:03d}")
        found[-1].write_bytes(bytes.fromhex(line))
    return found


def with_files(made: Library, files: Mapping[str, str]) -> Library:
    """Return a library with other files."""
    return replace(made, files=files)


def defines(made: Library) -> list[str]:
    """Return what tells the harness which law it has, and what else."""
    law = f"swb_{c_law(made.law.name)}"
    words = [f"-D{n.upper()}={law}_{n}" for n in ("parameters", "state", "initial", "step")]
    if "src/swb_pool.c" in made.files:
        words.append("-DPOOL")
    if made.law.command == "volume":
        words.append("-DPOSITIONER")
    if made.law.command == "volume change":
        words.append("-DPUMPS")
    return words


def build(made: Library, folder: Path, kind: Literal["libfuzzer", "random", "gcov"]) -> Path:
    """Return a program of a library and the harness.

    libfuzzer: as clang has it; random: with fuzzing/random.c in its place; gcov: the same without
    sanitizers, to count lines.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_library(made, folder / "library")
    sources = [*sorted((folder / "library" / "src").glob("*.c")), HERE / "harness.c"]
    if kind != "libfuzzer":
        sources.append(HERE / "random.c")
    special = {
        "libfuzzer": [f"-fsanitize=fuzzer,{_SANITIZERS}"],
        "random": [f"-fsanitize={_SANITIZERS}"],
        "gcov": ["--coverage", "-O0"],
    }[kind]
    run(
        "clang" if kind == "libfuzzer" else "gcc",
        *_FLAGS,
        *special,
        *defines(made),
        "-I",
        folder / "library" / "src",
        *sources,
        "-o",
        folder / "fuzzed",
        "-lm",
        cwd=folder,
    )
    return folder / "fuzzed"


def lines_covered(made: Library, inputs: Sequence[Path], folder: Path) -> str:
    """Return how many lines of a library's C some inputs reach, as "12 of 34"."""
    program = build(made, folder, "gcov")
    for first in range(0, len(inputs), 500):
        run(program, *inputs[first : first + 500], cwd=folder)
    said = run("gcov", "-n", *folder.glob("*.gcda"), cwd=folder, text=True).stdout
    found = re.findall(r"File '([^']*)'\nLines executed:([\d.]+)% of (\d+)", said)
    ours = [(float(share), int(n)) for name, share, n in found if "/library/src/" in name]
    assert ours, said
    return f"{round(sum(share * n for share, n in ours) / 100)} of {sum(n for _, n in ours)}"


def has_libfuzzer() -> bool:
    """Say whether clang is there with libFuzzer."""
    if shutil.which("clang") is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "empty.c"
        source.write_text(
            "#include <stddef.h>\n#include <stdint.h>\n"
            "int LLVMFuzzerTestOneInput(const uint8_t *b, size_t n);\n"
            "int LLVMFuzzerTestOneInput(const uint8_t *b, size_t n) { (void)b, (void)n; return 0; }"
        )
        words = ["clang", "-fsanitize=fuzzer", source, "-o", Path(folder) / "empty"]
        return subprocess.run(words, capture_output=True, check=False).returncode == 0


def fuzz(made: Library, folder: Path, *, seconds: int = 0, runs: int = -1, seed: int = 1) -> Fuzzed:
    """Return what libFuzzer did in so many seconds, or runs, from the law's inputs on.

    An input that breaks something is left in `folder`, its name in what is returned.
    """
    name, corpus = made.law.name, folder / "corpus"
    program = build(made, folder / "libfuzzer", "libfuzzer")
    corpus.mkdir(parents=True)
    if (INPUTS / f"{name}.hex").exists():
        kept_inputs(name, corpus)
    words = [
        program,
        corpus,
        f"-seed={seed}",
        "-max_len=4096",
        f"-max_total_time={seconds}",
        f"-runs={runs}",
        "-malloc_limit_mb=256",
        "-rss_limit_mb=0",  # the sanitizer's own memory, which differs between machines
        "-print_final_stats=1",
        f"-artifact_prefix={folder}/",
    ]
    done = subprocess.run([str(word) for word in words], capture_output=True, check=False)
    said = done.stderr.decode(errors="replace")
    crash = next((p for p in folder.glob("*-*") if p.is_file()), None)
    assert done.returncode == 0 or crash is not None, said[-4000:]
    count = re.search(r"stat::number_of_executed_units: (\d+)", said)
    reached = sorted(corpus.iterdir())
    return Fuzzed(
        law=name,
        runs=int(count.group(1)) if count else 0,
        crash=crash,
        said=said,
        covered=lines_covered(made, reached, folder / "gcov") if crash is None else "-",
    )


def report(laws: Sequence[str], seconds: int, keep: Path) -> tuple[str, bool]:
    """Return a table, and whether nothing broke; inputs that did are copied into `keep`."""
    rows = ["| law | runs | lines reached | broken |", "|---|---|---|---|"]
    well = True
    for name in laws:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            done = fuzz(library(name), folder, seconds=seconds)
            broken = "nothing"
            if done.crash is not None:
                well = False
                keep.mkdir(parents=True, exist_ok=True)
                kept = keep / f"{name}-{done.crash.name}"
                shutil.copy(done.crash, kept)
                lines = done.said.splitlines()
                why = [s for s in lines if "broken:" in s or "runtime error" in s or "ERROR" in s]
                broken = f"{why[0] if why else 'see'} ({kept})"
        rows.append(f"| {name} | {done.runs} | {done.covered} | {broken} |")
        print(rows[-1], file=sys.stderr)
    return "\n".join(rows), well


def main() -> int:
    """Run from the command line; 1 where something broke."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="for each law (60)")
    parser.add_argument("--law", action="append", choices=[*LAWS], help="only this one")
    parser.add_argument(
        "--keep", type=Path, default=Path("fuzz-broken"), help="folder for inputs that break it"
    )
    given = parser.parse_args()
    if not has_libfuzzer():
        parser.error("clang with libFuzzer is not installed (make tools)")
    table, well = report(given.law or [*LAWS], given.seconds, given.keep)
    print(table)
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
