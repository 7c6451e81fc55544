"""Build the wheel and the sdist, check them, and try the wheel in fresh environments.

::

    python scripts/dist.py PYTHON...         # names or paths; the first of each version is taken

Each environment gets the wheel by pip, with what `requirements.lock` pins, and each file that pip
took has to have a hash of the lock. (pip cannot check that itself: with hashes it takes nothing but
pins, and a wheel names ranges.) What is built stays in `dist/`.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[1]
# Of each extra: what its code imports first, and a command that needs it.
EXTRAS = {
    "cluster": ("distributed", "campaign example-float dive.toml --executor dask"),
    "parquet": ("pyarrow", "compare log.parquet --vehicle feup-em --free none"),
    "posterior": ("emcee", "identify log.csv --vehicle feup-em --posterior"),
    "serial": ("serial", "board feup-em --time-limit 2h --port /dev/ttyUSB0"),
}
STEP = "simulate feup-em --step 1.5:3 --duration 400 --plot --out step"
FIRMWARE = "firmware feup-em --time-limit 2h --out controller"
IDENTIFY = "identify step/trajectory.csv --vehicle feup-em --out identified"
SLOWEST = 60  # s that a new user waits for a plot


class FaultError(Exception):
    """What is wrong with what was built."""


def run(*command: str | Path, cwd: Path | None = None, env: dict[str, str] | None = None) -> str:
    """Return what a command prints; raise FaultError where it fails."""
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
    if done.returncode:
        raise FaultError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def build(root: Path, folder: Path) -> tuple[Path, Path]:
    """Build a project's wheel and sdist into a folder, in the place of older ones."""
    for old in folder.glob("swimbladder-*"):
        old.unlink()
    run(sys.executable, "-m", "hatchling", "build", "--directory", folder, cwd=root)
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


def check(wheel: Path, sdist: Path, root: Path) -> None:
    """Raise FaultError where an index would refuse a file, or the wheel is not just the package."""
    run(sys.executable, "-m", "twine", "check", "--strict", wheel, sdist)
    has = contents(wheel)
    source = root / "src"
    package = {
        path.relative_to(source).as_posix()
        for path in (source / "swimbladder").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    found = {name for name in has if ".dist-info/" not in name}
    if odd := sorted(found ^ package):
        raise FaultError(f"{wheel.name} and src/swimbladder differ in {', '.join(odd)}")
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(sdist) as packed:
            # an argument of `extractall` only from Python 3.11.4 on
            packed.extraction_filter = getattr(tarfile, "data_filter", None)
            packed.extractall(folder)
        again, _ = build(Path(folder) / sdist.name.removesuffix(".tar.gz"), Path(folder) / "again")
        rebuilt = contents(again)
    if odd := sorted(name for name in has | rebuilt if has.get(name) != rebuilt.get(name)):
        raise FaultError(f"{wheel.name} and a wheel of the sdist differ in {', '.join(odd)}")


def contents(wheel: Path) -> dict[str, bytes]:
    """Return the files in a wheel."""
    with ZipFile(wheel) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def pins(lock: str) -> dict[str, tuple[str, set[str]]]:
    """Return of each package in a lock its line without hashes, and its hashes."""
    found: dict[str, tuple[str, set[str]]] = {}
    for entry in re.split(r"\n(?=\S)", lock.strip()):
        line, *hashes = re.split(r"\s*\\\n\s*--hash=sha256:", entry)
        found[line.partition("==")[0]] = line, set(hashes)
    return found


def check_hashes(report: dict, lock: dict[str, tuple[str, set[str]]]) -> None:
    """Raise FaultError where pip took a file that the lock does not have."""
    for one in report["install"]:
        name = re.sub(r"[-_.]+", "-", one["metadata"]["name"]).lower()
        taken = one["download_info"]["archive_info"]["hashes"]["sha256"]
        if name != "swimbladder" and taken not in lock.get(name, ("", set()))[1]:
            raise FaultError(f"requirements.lock has no such file: {one['download_info']['url']}")


@dataclass
class Environment:
    """A virtual environment, and a folder beside it in which its commands run.

    Nothing is compiled there yet, and it sees no packages but its own.
    """

    folder: Path

    def __post_init__(self) -> None:
        """Make the folder, and leave out of the environment what would show other packages."""
        self.bin = self.folder / ("Scripts" if os.name == "nt" else "bin")
        self.work = self.folder / "work"
        self.work.mkdir()
        kept = {name: text for name, text in os.environ.items() if not name.startswith("PYTHON")}
        caches = {"SWIMBLADDER_CACHE_DIR": "kernels", "MPLCONFIGDIR": "matplotlib"}
        own = {name: str(self.folder / where) for name, where in caches.items()}
        self.env = kept | own | {"MPLBACKEND": "Agg"}

    @classmethod
    def fresh(cls, python: str, folder: Path) -> "Environment":
        """Make one that has nothing but pip."""
        run(python, "-m", "venv", folder)
        return cls(folder)

    @classmethod
    def beside(cls, packages: Path, folder: Path) -> "Environment":
        """Make one without pip that has the packages of another, and its own before them."""
        run(sys.executable, "-m", "venv", "--without-pip", folder)
        (next(folder.rglob("site-packages")) / "beside.pth").write_text(f"{packages}\n")
        return cls(folder)

    def install(self, wheel: Path, lock: str, extras: str = "") -> None:
        """Install a wheel with what a lock pins."""
        known = pins(lock)
        constraints, report = self.folder / "pins.txt", self.folder / "report.json"
        constraints.write_text("\n".join(line for line, _ in known.values()))
        said = ("--quiet", "--disable-pip-version-check", "--only-binary=:all:", "--report", report)
        self("python", "-m", "pip", "install", *said, "-c", constraints, f"{wheel}{extras}")
        check_hashes(json.loads(report.read_text(encoding="utf-8")), known)
        self("python", "-m", "pip", "--disable-pip-version-check", "check")

    def __call__(self, program: str, *arguments: str | Path) -> str:
        """Return what a program of the environment prints."""
        return run(self.bin / program, *arguments, cwd=self.work, env=self.env)

    def swimbladder(self, line: str) -> str:
        """Return what a command prints."""
        return self("swimbladder", *line.split())

    def seconds(self, program: str, *arguments: str) -> float:
        """Return how long a program takes at best of three times [s]."""
        took = []
        for _ in range(3):
            began = time.perf_counter()
            self(program, *arguments)
            took.append(time.perf_counter() - began)
        return min(took)


def try_basics(there: Environment) -> float:
    """Use what is installed as a new user does; return how long the first plot takes [s]."""
    at = there("python", "-c", "import swimbladder; print(swimbladder.__file__)").strip()
    if not Path(at).is_relative_to(there.folder):
        raise FaultError(f"another swimbladder is imported: {at}")
    version = there("python", "-c", "import swimbladder; print(swimbladder.__version__)").strip()
    if there.swimbladder("--version").split() != ["swimbladder", version]:
        raise FaultError("--version and __version__ differ")
    began = time.perf_counter()
    there.swimbladder(STEP)
    first_plot = time.perf_counter() - began
    if not (there.work / "step/trajectory.png").read_bytes().startswith(b"\x89PNG"):
        raise FaultError("the picture of simulate is none")
    return first_plot


def try_all(there: Environment) -> None:
    """Ask each command for its help, identify a vehicle, and write firmware."""
    listed = there("python", "-c", "from swimbladder.cli import COMMANDS; print(*COMMANDS)")
    for name in ("", *listed.split()):
        if "Usage: swimbladder" not in there.swimbladder(f"{name} --help"):
            raise FaultError(f"swimbladder {name} --help says nothing")
    there.swimbladder(IDENTIFY)
    if not (there.work / "identified/vehicle.toml").is_file():
        raise FaultError("identify wrote no vehicle")
    there.swimbladder(FIRMWARE)
    if not (there.work / "controller").is_dir():
        raise FaultError("firmware wrote nothing")


def give_files(folder: Path) -> None:
    """Write what the commands of `EXTRAS` read."""
    rows = "".join(f"{t / 2},{1 + 5e-5 * t * t},{-2e-5 * (t > 2)}\n" for t in range(120))
    (folder / "log.csv").write_text("time_s,depth_m,volume_m3\n" + rows)
    (folder / "log.parquet").write_bytes(b"PAR1PAR1")
    phase = '[[phases]]\nkind = "surface"\nduration = "1 min"\n'
    (folder / "dive.toml").write_text(f"schema_version = 1\n{phase}")


def try_extras(there: Environment, wheel: Path, lock: str) -> None:
    """Raise FaultError unless a command names the extra that it needs, and has enough with it."""
    give_files(there.work)
    for extra, (library, command) in EXTRAS.items():
        try:
            there.swimbladder(command)
        except FaultError as fault:
            if f'pip install "swimbladder[{extra}]"' in str(fault):
                continue
            raise
        raise FaultError(f"swimbladder {command} does without {library}")
    there.install(wheel, lock, f"[{','.join(EXTRAS)}]")
    for library, _ in EXTRAS.values():
        there("python", "-c", f"import {library}")
    table = "import pandas; pandas.read_csv('step/trajectory.csv').to_parquet('log.parquet')"
    there("python", "-c", table)
    there.swimbladder(EXTRAS["parquet"][1])
    there.swimbladder(f"{IDENTIFY} --posterior")


def interpreters(names: Iterable[str]) -> dict[str, str]:
    """Return those that are at hand and new enough, one of each version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    versions = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    ask = "import sys; print('%d.%d' % sys.version_info[:2], sys.executable)"
    found: dict[str, str] = {}
    for name in names:
        try:
            version, path = run(name, "-c", ask).strip().split(" ", 1)
        except (OSError, FaultError):  # not there, or a shim of what is not there
            continue
        if version in versions:
            found.setdefault(version, path)
    if missing := ", ".join(version for version in versions if version not in found):
        print(f"not at hand, and not tried: Python {missing}")
    return dict(sorted(found.items()))


def main(arguments: Sequence[str]) -> int:
    """Build, check and try; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("python", nargs="+", help="interpreters to try the wheel with")
    at_hand = interpreters(parser.parse_args(arguments).python)
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    try:
        if not at_hand:
            raise FaultError("no Python to try the wheel with: PYTHONS names them")
        wheel, sdist = build(ROOT, ROOT / "dist")
        check(wheel, sdist, ROOT)
        print(f"{wheel.name}, {sdist.name}: fit for an index, and alike")
        for version, python in at_hand.items():
            with tempfile.TemporaryDirectory() as folder:
                there = Environment.fresh(python, Path(folder).resolve() / "fresh")
                there.install(wheel, lock)
                first_plot = try_basics(there)
                try_all(there)
                helped = there.seconds("swimbladder", "--help")
                imported = there.seconds("python", "-c", "import swimbladder")
                imported -= there.seconds("python", "-c", "")
                try_extras(there, wheel, lock)
            print(
                f"Python {version}: installed and tried. The first plot takes {first_plot:.0f} s "
                f"of {SLOWEST}, with compilation; --help {helped:.2f} s, import {imported:.3f} s"
            )
    except FaultError as fault:
        print(fault, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
