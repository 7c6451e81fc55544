"""One word for one idea: every option of every command has one name, one type and one meaning."""

import re
from dataclasses import fields

import pytest
import typer

import swimbladder.cli as cli
from swimbladder.cli.options import Options
from tests.test_public_api import FLOWN, groups_of

# The idea of each option, by which its help begins in every command, and the word for its value,
# which has a unit. A new option gets a line here, unless one with its idea is there already.
OPTIONS = {
    "--acceleration-noise INTENSITY": "Acceleration noise density",
    "--against SET": "Compare with single steps",
    "--air-std VOLUME": "1 sigma of the trapped air",
    "--antenna-volume VOLUME": "Volume that lifts the antenna",
    "--arrive HOW": "Arrival",
    "--band SHARE": "Band about the target",
    "--battery-reserve SHARE": "Reserve of the battery",
    "--battery-temperature TEMP": "Battery temperature",
    "--baud N": "Baud rate",
    "--begin DATE": "Start",
    "--bottom-depth DEPTH": "Depth of the bottom",
    "--cast CTD": "CTD cast",
    "--cast-column NAME=COLUMN": "Column of the cast",
    "--cast-format FORMAT": "Format of the cast",
    "--cast-profile N": "Profile in the cast's file",
    "--cast-where COLUMN=VALUE": "Rows of the cast",
    "--cells N": "Cells of a map",
    "--clearance LENGTH": "Distance from bottom and surface",
    "--column NAME=COLUMN": "Column of the log",
    "--config": "Also write Argo's CONFIG_ names",
    "--corrections SHARE": "Added way and energy of corrections",
    "--criterion WHICH": "Criterion",
    "--cycles N": "Cycles",
    "--delay SHARE": "Computation delay",
    "--delay-std TIME": "Delay of the volumes' time stamps",
    "--density-std DENSITY": "1 sigma of the sea's density",
    "--depth DEPTH": "Depth of the operating point",
    "--depth-noise DEPTH": "Depth noise, 1 sigma",
    "--depth-quantum DEPTH": "Quantum of the depth sensor",
    "--depth-range LEAST:MOST": "Depth range",
    "--drag LAW": "Drag law",
    "--drag-std SHARE": "1 sigma of the drag",
    "--drift-std RATE": "Drift of each log's neutral volume",
    "--drive INPUT": "Input",
    "--driver-efficiency SHARE": "Efficiency of the driver",
    "--driver-standby-power POWER": "Standby power of the driver",
    "--duration TIME": "Duration",
    "--executor WHO": "Workers",
    "--feedback-reserve SHARE": "Reserve of supply and stroke for feedback",
    "--file FILE": "File to write",
    "--fit RUNS": "Fit a pump to logged runs",
    "--fixed NAME=VALUE": "Parameter fixed at a value",
    "--floats N": "Number of floats",
    "--follow LOG": "Follow a log",
    "--force": "Overwrite the file",
    "--free NAME,...": "Parameters to identify",
    "--freeboard LENGTH": "Freeboard at full volume",
    "--full": "Print the whole answer",
    "--goal GOAL": "Goal",
    "--healthy N": "Missions without a fault",
    "--heat-std 1/K": "1 sigma of the thermal expansion",
    "--hold DEPTH": "Allowed holding error",
    "--horizons TIME,...": "Horizons of predictions",
    "--hotel POWER": "Power of everything but the drive",
    "--identified": "Spread from the identified covariance",
    "--inversions WHAT": "Inversions of density",
    "--json": "Print one JSON object",
    "--kind KIND": "Actuator",
    "--latitude DEGREES": "Latitude of the cast",
    "--law LAW": "Law",
    "--laws LAW,...": "Laws to compare",
    "--list-scenarios": "Print the scenarios only",
    "--log-format FORMAT": "Format of the log",
    "--longitude DEGREES": "Longitude of the cast",
    "--maps/--no-maps": "Recovery maps",
    "--mass MASS": "Mass on the scale",
    "--mass-std MASS": "1 sigma of the mass",
    "--material WHAT": "Ballast",
    "--max-depth DEPTH": "Greatest depth",
    "--max-experiments N": "Largest number of experiments",
    "--max-mass MASS": "Largest mass of drive and battery",
    "--max-moves N": "Largest number of volume changes in a record",
    "--max-piston-stroke LENGTH": "Longest travel of the piston",
    "--max-record-time TIME": "Longest record",
    "--max-speed SPEED": "Largest vertical speed",
    "--max-volume-change VOLUME": "Largest change of volume",
    "--min-run-time TIME": "Shortest run used",
    "--missions N": "Missions with faults",
    "--netcdf": "Also write netCDF",
    "--neutral-depth DEPTH": "Find the mass that is neutral at this depth",
    "--neutral-std VOLUME": "Prior of each log's neutral volume, 1 sigma",
    "--neutral-volume VOLUME": "Volume of the drive at that depth",
    "--out DIR": "Folder for the files",
    "--paper": "Add the paper's fits",
    "--park-time TIME": "Time at the depth per cycle",
    "--part K/N": "Part K of N",
    "--parts FILE": "List of parts",
    "--piston-diameter LENGTH": "Diameter of the piston",
    "--piston-stroke LENGTH": "Travel of the piston",
    "--plan PLAN": "Plan from design-experiment",
    "--plot": "Also draw",
    "--pool-time TIME": "Pool time",
    "--port PORT": "Serial port",
    "--posterior": "Sample the posterior",
    "--power-at WHEN": "Pressure of a run",
    "--prior NAME=VALUE": "Prior of a parameter",
    "--probability SHARE": "Probability that the stroke suffices",
    "--process-noise MODE": "Process noise",
    "--profiles/--no-profiles": "Profile likelihoods",
    "--psi-std PSI": "1 sigma of psi",
    "--pump-std SHARE": "1 sigma of the pump's delivery",
    "--random-walk INTENSITY": "Random walk of the neutral volume",
    "--real-time": "One tick per sample time",
    "--real-time-factor FACTOR": "Simulated seconds per second",
    "--repeat N": "Repeat this mission",
    "--required NAME,...": "Exit with 1 unless identified",
    "--robustness": "Vary the gain",
    "--rounds N": "Rounds in the pool",
    "--runs N": "Runs of each case",
    "--salinity PSU": "Salinity where the cast has none",
    "--sample-time TIME": "Sample time",
    "--scheduler WHERE": "Dask scheduler",
    "--seed N": "Seed of",
    "--sensitivity": "Sobol sensitivity indices",
    "--settling TIME": "Settling time before a release",
    "--simulate": "Rehearse on the simulated vehicle",
    "--speed SPEED": "Vertical speed",
    "--speed-std SPEED": "Prior of each log's start speed, 1 sigma",
    "--spread FILE": "TOML file with the spread",
    "--step FROM:TO": "Step",
    "--steps": "Also fly steps",
    "--stroke-reserve SHARE": "Reserve of the stroke",
    "--submerged": "Begin at the first depth beyond that",
    "--supervised/--unsupervised": "Supervised, or the law alone",
    "--supply VOLTAGE": "Supply voltage",
    "--surface-energy ENERGY": "Energy for fix and telemetry per cycle",
    "--surface-margin DEPTH": "Smallest depth used",
    "--surface-time TIME": "Time at the surface per cycle",
    "--target-std SHARE": "Target standard error",
    "--thruster-diameter LENGTH": "Propeller diameter",
    "--thruster-efficiency SHARE": "Thruster efficiency",
    "--thruster-idle-power POWER": "Idle power of each thruster",
    "--thruster-number N": "Number of thrusters",
    "--time-limit TIME": "Time limit of the supervisor",
    "--timeout TIME": "Stop if the log has not grown",
    "--travel LENGTH": "Travel that ends an experiment",
    "--trim-std VOLUME": "1 sigma of the neutral volume",
    "--truth VEHICLE": "The vehicle in the simulated water",
    "--turn-time TIME": "Longest time from sinking to rising",
    "--uncertainty SHARE": "Uncertainty of the vehicle's file",
    "--vehicle VEHICLE": "Preset or TOML file",
    "--voltage-quantum VOLTAGE": "Voltage step of the motor's driver",
    "--volume-changes FIRST:LAST": "Volume changes in the pool",
    "--volume-std VOLUME": "1 sigma of the hull's volume",
    "--wait/--no-wait": "Wait for more rows",
    "--weight-error VOLUME": "Excess weight while hovering",
    "--where COLUMN=VALUE": "Rows of the log",
    "--within TIME": "Recovery time",
    "--workers N": "Number of workers",
}
# Words of an option's name that would be another word for an idea, and the word for it.
SYNONYMS = {
    "bottom-depth": {"seabed", "floor"},
    "depth-noise": {"sensor", "sigma"},
    "fixed": {"set", "held"},
    "free": {"fitted", "estimate"},
    "goal": {"minimise", "objective", "optimise"},
    "max": {"deepest", "greatest", "largest", "longest", "most", "maximum", "limit"},
    "min": {"shallowest", "least", "smallest", "shortest", "minimum"},
    "std": {"error", "deviation", "noise"},
    "step": {"start", "target", "from", "to", "setpoint"},
    "no": {"without", "not", "skip"},
    "seed": {"random", "draw", "draws"},
    "out": {"output", "folder", "dir"},
}
# What these names have of such a word is no other word for the idea.
MEANT = {
    "--acceleration-noise",
    "--depth-noise",
    "--process-noise",
    "--random-walk",
    "--target-std",
}
MEANT |= {"--time-limit", "--weight-error"}


def commands(group=None, name=""):
    """Return every command as its words and what typer makes of it."""
    group = group or typer.main.get_command(cli._app(set(cli.COMMANDS), before=False))
    for own, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, own)
        else:
            yield f"{name} {own}".strip(), command


def options():
    """Return (command, name and word for its value, help) of every option of every command."""
    for command, made in commands():
        for one in made.params:
            if one.param_type_name == "option" and "--help" not in one.opts:
                names = "/".join([*one.opts, *one.secondary_opts])
                yield command, f"{names} {one.metavar or ''}".strip(), one.help


def words_of(text):
    return re.findall(r"[\w']+", text)


def begins(text, idea):
    return words_of(text)[: len(words_of(idea))] == words_of(idea)


def test_an_option_is_called_alike_and_means_the_same_in_every_command():
    found = list(options())
    assert {option for _, option, _ in found} == set(OPTIONS)
    wrong = [(c, option, text) for c, option, text in found if not begins(text, OPTIONS[option])]
    assert wrong == []


def test_an_idea_has_one_option():
    assert len({option.split()[0] for option in OPTIONS}) == len(OPTIONS)
    for _, option, text in options():
        others = {other for other, idea in OPTIONS.items() if begins(text, idea)}
        assert others <= {option, *others_that_begin_alike(option)}, text


def others_that_begin_alike(option):
    """Return options whose idea is a beginning of this one's, which says more."""
    return {o for o, i in OPTIONS.items() if o != option and begins(OPTIONS[option], i)}


def test_no_idea_is_the_beginning_of_another():
    assert {option: more for option in OPTIONS if (more := others_that_begin_alike(option))} == {}


@pytest.mark.parametrize("option", sorted({names.split()[0] for names in OPTIONS} - MEANT))
def test_no_option_has_another_word_for_an_idea(option):
    words = set(option.replace("/", "-").split("-"))
    assert {better: words & others for better, others in SYNONYMS.items() if words & others} == {}


@pytest.mark.parametrize("command", FLOWN)
def test_an_option_is_called_as_the_parameter_that_it_is(command):
    """Its name has the words of the parameter, of one of several without their s."""
    for group in groups_of(command):
        if not issubclass(group, Options):
            continue
        options = group.named()
        for one in fields(group):
            named = options[one.name].replace("unsupervised", "supervised")
            taken = {word.removesuffix("s") for word in one.name.split("_")}
            if named == "--cast-format":
                taken.remove("log")
            assert taken <= {word.removesuffix("s") for word in named.split("-")}, one.name
