"""The cases: every command on every preset that it takes, small and without noise.

A case is a command line. Its inputs lie in inputs/; `--json` and `--out out` are added to it. What
draws at random has a seed.
"""

from typing import NamedTuple

__all__ = ["CASES", "DISTRIBUTIONS", "LOOSE", "Case", "Distribution", "Tolerance"]


class Case(NamedTuple):
    """A command line whose answer and files are kept."""

    name: str
    arguments: tuple[str, ...]
    before: tuple[tuple[str, ...], ...] = ()  # command lines that make what it reads
    files: bool = True  # it takes --out
    compiler: bool = False  # it needs a C compiler

    @property
    def command(self) -> str:
        return self.arguments[0]


class Tolerance(NamedTuple):
    """How far a number may be from the stored one, and why it may."""

    relative: float
    absolute: float
    why: str


class Distribution(NamedTuple):
    """How near draws have to be to the stored ones where their order has changed, and why it has.

    p: least p-value of a two-sample Kolmogorov-Smirnov test of a list or a column; relative,
    absolute: of a number by itself.
    """

    p: float
    relative: float
    absolute: float
    why: str


# Patterns (fnmatch) of "CASE: PATH", as a failure prints them. The first that fits counts.
LOOSE: dict[str, Tolerance] = {
    "identify-dive: answer.noise.*": Tolerance(
        0.2, 1e-9, "it is small beside the sensor's: processors round otherwise, and it moves"
    ),
    "identify-dive: *": Tolerance(
        2e-2, 1e-9, "processors round otherwise, and the fit of a dive stops elsewhere"
    ),
    "identify-*: *": Tolerance(
        1e-5, 1e-11, "processors round otherwise: it moves where a fit stops, and slopes"
    ),
    "design-experiment: *": Tolerance(
        1e-6, 1e-12, "processors round otherwise: it moves slopes and what a fit makes of them"
    ),
    "plan-*: answer.gap": Tolerance(0.0, 1e-9, "what rounding leaves between a path and its bound"),
    "pool: *": Tolerance(1e-5, 1e-12, "rounding moves where a fit of noisy logs stops"),
    "reproduce: files.trajectories/*": Tolerance(1e-3, 1e-5, "the loop hunts: rounding grows"),
    "reproduce: *": Tolerance(1e-4, 1e-11, "the loop hunts: rounding grows"),
    "stability-*: *.cycles*.simulated.*": Tolerance(
        0.1, 0.0, "a cycle from stop to stop is chaotic"
    ),
    "stability-*: *.cycles*.relative_error.*": Tolerance(0.0, 0.1, "it is that of such a cycle"),
    "stability-*: *.predicted.amplitude_error": Tolerance(
        1e-6, 1e-12, "it is the difference of two amplitudes: the exponential rounds otherwise"
    ),
    "*: *.energy_residue": Tolerance(1e-6, 1e-12, "it is what sums leave: rounding shows in it"),
    "*: *.oscillations at rest": Tolerance(1e-5, 1e-9, "a speed near 0 is mostly rounding"),
    "mission*: *.sinks_J.sea": Tolerance(1e-6, 1e-9, "it is the difference of two large energies"),
    "*: *.peak_frequency_rad_s": Tolerance(1e-6, 1e-12, "a peak is flat: rounding moves its place"),
    "*: *.disk_frequency_rad_s": Tolerance(1e-6, 1e-12, "a peak is flat: rounding moves its place"),
}

# Likewise, of what is compared in distribution and not number by number.
DISTRIBUTIONS: dict[str, Distribution] = {}


def _case(name: str, line: str, **more: bool | tuple[str, ...]) -> Case:
    """Return a case from a line of words; "~" stands for a blank within a word."""
    before = tuple(tuple(w.replace("~", " ") for w in b.split()) for b in more.pop("before", ()))
    return Case(name, tuple(w.replace("~", " ") for w in line.split()), before, **more)


VOLTS = ("example-eh", "example-em", "feup-em")  # presets whose law commands a voltage
LOOPS = (*VOLTS, "ntnu-bv")  # presets that have a sampled loop
PRESETS = (*LOOPS, "example-float")
LAWS = (
    "cascade",
    "sea-cascade",
    "adrc",
    "deadband",
    "observer",
    "pulse",
    "planned",
    "position-pid",
    "position-observer",
)
SIMULATED = "simulate feup-em --step 1.5:2.5 --duration 60 --out before"
POOL = "pool.csv --vehicle feup-em --where run=1,2,3,4"
EXPERIMENT = (
    "--bottom-depth 4.5~m --depth-noise 2~mm --settling 5~min --max-moves 1 --max-experiments 2"
)

CASES: tuple[Case, ...] = (
    *(_case(f"simulate-{v}", f"simulate {v} --duration 90~s --netcdf") for v in LOOPS),
    *(
        _case(f"simulate-law-{law}", f"simulate law-{law}.toml --duration 90~s --seed 3")
        for law in LAWS
    ),
    _case(
        "simulate-feup-em-cast",
        "simulate feup-em --duration 60~s --cast pond.csv --bottom-depth 4~m --latitude 45",
    ),
    *(_case(f"analyse-{v}", f"analyse {v} --depth 2~m", files=False) for v in LOOPS),
    *(
        _case(
            f"compare-{drive}",
            f"compare before/trajectory.csv --vehicle feup-em --drive {drive}",
            before=(SIMULATED,),
        )
        for drive in ("volume", "voltage", "setpoint")
    ),
    _case("identify-pool", f"identify {POOL} --no-profiles --paper"),
    _case("identify-process-noise", f"identify {POOL} --no-profiles --process-noise always"),
    _case("identify-dive", "identify dive.csv --vehicle deep-float.toml --cast cast.csv"),
    _case("identify-actuator", "identify-actuator bench.csv --vehicle feup-em"),
    _case("design-experiment", f"design-experiment feup-em {EXPERIMENT} --against none"),
    _case("pool", "pool feup-em --simulate --max-experiments 2"),
    *(
        _case(f"ballast-{v}", f"ballast {v} --cast cast.csv --max-depth {deepest}~m")
        for v, deepest in zip(PRESETS, (1000, 100, 50, 2, 2000), strict=True)
    ),
    _case("tune-cascade", "tune feup-em --law cascade --runs 20"),
    _case("tune-planned", "tune example-em --law planned --runs 20"),
    _case(
        "tune-position-observer",
        "tune ntnu-bv --law position-observer --runs 20 --depth-range 0:1~m",
    ),
    *(_case(f"energy-{v}", f"energy {v}") for v in ("example-eh", "example-em", "example-float")),
    _case("energy-cast", "energy example-float --cast cast.csv --max-depth 1500~m"),
    _case(
        "energy-fit",
        "energy example-float --fit runs.csv --column pressure_Pa=pressure_dbar@dbar "
        "--column volume_m3=volume_mL@mL",
    ),
    *(_case(f"plan-{v}", f"plan {v} --step 1.5:2.5~m") for v in VOLTS),
    _case("plan-ntnu-bv", "plan ntnu-bv --step 0.4:0.9~m --goal effort"),
    _case("plan-energy", "plan example-em --step 1.5:2.5~m --goal energy"),
    _case("bench-control", "bench-control feup-em --laws position-pid --runs 2"),
    *(
        _case(f"stability-{v}", f"stability {v} --cells 5 --within 100~s --depth-range 0:{deep}~m")
        for v, deep in (("feup-em", 5), ("ntnu-bv", 1))
    ),
    _case("size", "size example-eh --max-depth 800~m --parts parts.toml"),
    _case("mission", "mission example-float mission.toml --netcdf"),
    _case("mission-cast", "mission example-float mission.toml --cast cast.csv --cycles 2"),
    *(_case(f"mission-{v}", f"mission {v} mission-law.toml") for v in LOOPS),
    _case("mission-rule", "mission example-em mission-rule.toml"),
    _case("campaign", "campaign example-float mission.toml --floats 6"),
    _case("campaign-cast", "campaign example-float mission.toml --floats 4 --cast cast.csv"),
    *(
        _case(f"firmware-law-{law}", f"firmware law-{law}.toml --duration 60 --time-limit 7200")
        for law in LAWS
    ),
    *(
        _case(f"firmware-{v}", f"firmware {v} --duration 60 --time-limit 7200 {pool}")
        for v, pool in (("example-eh", ""), ("example-em", "--bottom-depth 4.5~m"))
    ),
    _case(
        "faults",
        "faults feup-em --missions 31 --healthy 4 --time-limit 1839.8286367098249",
        compiler=True,
    ),
    _case("faults-one", "faults feup-em --repeat 7 --time-limit 1839.8286367098249", compiler=True),
    _case(
        "faults-ntnu-bv",
        "faults ntnu-bv --missions 16 --healthy 2 --time-limit 5503.885375157806",
        compiler=True,
    ),
    _case("reproduce", "reproduce"),
    *(_case(f"vehicle-{v}", f"vehicle show {v}", files=False) for v in PRESETS),
    _case("vehicle-list", "vehicle list", files=False),
)
