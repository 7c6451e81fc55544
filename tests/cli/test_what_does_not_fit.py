"""Laws, vehicles and missions that do not fit: one error for a command and the Python behind it."""

import tomllib
from pathlib import Path

import pytest

from swimbladder.cli import main
from swimbladder.codegen.library import firmware
from swimbladder.control.registry import law_by_name
from swimbladder.design.analysis import analyse
from swimbladder.design.law_comparison import compare_laws
from swimbladder.design.planning import plan
from swimbladder.design.stability import stability
from swimbladder.design.tuning import tune
from swimbladder.errors import InputError, SwimbladderError, as_asked
from swimbladder.io.config import load_mission, load_vehicle
from swimbladder.io.presets import preset_text
from swimbladder.physics.seawater import uniform_column
from swimbladder.sim.campaign.run import Floats
from swimbladder.sim.closed_loop import simulate
from swimbladder.sim.faults import faults
from swimbladder.sim.mission.flight import fly_mission
from swimbladder.vehicle import Controller
from tests.vehicles import limited

PHASES = """
schema_version = 1
name = "a dive"

[[phases]]
kind = "park"
depth = "5 m"
duration = "30 min"
"""
STEP = {"setpoints": [(0.0, 3.0)], "duration": 400.0, "start_depth": 1.5}


def afloat(vehicle, phases, flown, **more):
    mission = load_mission(phases)
    return flown(vehicle, mission, uniform_column(vehicle.water, max_depth=500.0), **more)


# Each command's words after its vehicle, and the function behind it.
COMMANDS = {
    "simulate": ([], lambda v, _: simulate(v, **STEP)),
    "tune": ([], lambda v, _: tune(v, law="planned" if v.voltage_driven else "position-observer")),
    "stability": ([], lambda v, _: stability(v)),
    "analyse": ([], lambda v, _: analyse(v)),
    "compare-laws": ([], lambda v, _: compare_laws(v)),
    "firmware": (
        ["--time-limit", "2 h"],
        lambda v, _: firmware(limited(v), step=(1.5, 3.0), duration=400.0),
    ),
    "faults": (["--time-limit", "2 h"], lambda v, _: faults(limited(v), missions=20)),
    "plan": (["--step", "1:3"], lambda v, _: plan(v, (1.0, 3.0))),
    "mission": (["PHASES"], lambda v, m: afloat(v, m, fly_mission)),
    "campaign": (
        ["PHASES", "--floats", "4", "--cast", "CAST"],
        lambda v, m: afloat(
            v,
            m,
            lambda v, m, c: Floats(
                vehicle=v, mission=m, columns=[c], floats=4, store=Path("campaign.zarr")
            ),
        ),
    ),
}


def controller_of(preset):
    """The table of a preset's controller, as text."""
    text = preset_text(preset)
    return text[text.index("[controller]") :].split("\n[sup")[0].split("\n[ident")[0]


VEHICLES = {
    "a volume law on a voltage": ("feup-em", controller_of("ntnu-bv"), "controller.law"),
    "a voltage law on a pump": ("example-float", controller_of("feup-em"), None),
    "a voltage law on a positioner": ("ntnu-bv", controller_of("feup-em"), "controller.law"),
    "parameters of another law": (
        "feup-em",
        controller_of("feup-em").replace('"cascade"', '"planned"'),
        "controller.parameters.k_pV",
    ),
    "a law of floats": ("feup-em", controller_of("example-float"), "controller.law"),
    "no such law": (
        "feup-em",
        controller_of("feup-em").replace('"cascade"', '"cascado"'),
        "controller.law",
    ),
}


def misfit(preset, table, folder):
    """The vehicle as a file, and as Python makes it without asking whether it fits."""
    text = preset_text(preset)
    path = folder / "misfit.toml"
    path.write_text(text.replace(controller_of(preset), table))
    own = tomllib.loads(table)["controller"]
    controller = Controller.model_validate(own)
    return path, load_vehicle(preset).model_copy(update={"controller": controller})


def same(said, caught):
    """The command says what Python says, with the file before it."""
    said = " ".join(said.split())
    for part in (caught.field, caught.what, caught.remedy):
        assert part
        assert " ".join(part.split()) in said


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("kind", VEHICLES)
def test_a_law_that_does_not_fit(kind, command, tmp_path, capsys):
    preset, table, field = VEHICLES[kind]
    path, vehicle = misfit(preset, table, tmp_path)
    phases, cast = tmp_path / "phases.toml", tmp_path / "cast.csv"
    phases.write_text(PHASES)
    rows = [f"{p},12.0,35.0" for p in range(0, 200, 10)]
    cast.write_text("pressure_dbar,temperature_degC,salinity_psu\n" + "\n".join(rows) + "\n")
    words, function = COMMANDS[command]
    words = [{"PHASES": str(phases), "CAST": str(cast)}.get(word, word) for word in words]
    out = tmp_path / "out"
    assert main([command, str(path), *words, "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    with pytest.raises(InputError) as caught:
        function(vehicle, phases)
    same(said.err, caught.value)
    assert not out.exists()
    pump = kind == "a voltage law on a pump" and command in {"plan", "pool"}
    assert caught.value.field == ("actuator.kind" if pump else field or "controller.law")
    if field == "controller.law":
        assert caught.value.value == vehicle.controller.law
    if "choose one of" in caught.value.remedy.lower():
        fitting = caught.value.remedy.partition(":")[2].strip(" .").split(", ")
        assert {law_by_name(name).command for name in fitting} == {vehicle.command}


# Depths of commands beyond the rating of 100 m (feup-em) or 2000 m (example-float), or the cast.
DEEP = {
    "simulate": (
        "feup-em",
        ["--step", "1.5:120 m"],
        lambda v, _: simulate(v, setpoints=[(0.0, 120.0)], duration=400.0, start_depth=1.5),
    ),
    "firmware": (
        "feup-em",
        ["--step", "1.5:120 m", "--time-limit", "2 h"],
        lambda v, _: firmware(limited(v), step=(1.5, 120.0), duration=400.0),
    ),
    "plan": ("feup-em", ["--step", "1:120"], lambda v, _: plan(v, (1.0, 120.0))),
    "tune": (
        "feup-em",
        ["--depth-range", "0:120 m"],
        lambda v, _: tune(v, depth_range=(0.0, 120.0)),
    ),
    "compare-laws": (
        "feup-em",
        ["--depth-range", "0:120 m"],
        lambda v, _: compare_laws(v, depth_range=(0.0, 120.0)),
    ),
    "faults": (
        "feup-em",
        ["--depth-range", "1:120 m", "--time-limit", "2 h"],
        lambda v, _: faults(limited(v), missions=20, depth_range=(1.0, 120.0)),
    ),
    "mission": ("example-float", ["PHASES"], lambda v, m: afloat(v, m, fly_mission)),
    "campaign": (
        "example-float",
        ["PHASES", "--floats", "4", "--cast", "CAST"],
        COMMANDS["campaign"][1],
    ),
}


@pytest.mark.parametrize("command", DEEP)
def test_a_depth_beyond_the_rating_or_the_cast(command, tmp_path, capsys):
    preset, words, function = DEEP[command]
    phases, cast = tmp_path / "phases.toml", tmp_path / "cast.csv"
    phases.write_text(PHASES.replace('"5 m"', '"600 m"'))
    rows = [f"{p},12.0,35.0" for p in range(0, 510, 10)]
    cast.write_text("pressure_dbar,temperature_degC,salinity_psu\n" + "\n".join(rows) + "\n")
    words = [{"PHASES": str(phases), "CAST": str(cast)}.get(word, word) for word in words]
    if command == "mission":
        words += ["--cast", str(cast)]
    out = tmp_path / "out"
    with pytest.raises(SwimbladderError) as caught:
        function(load_vehicle(preset), phases)
    assert main([command, preset, *words, "--out", str(out)]) == caught.value.exit_code
    said = " ".join(capsys.readouterr().err.split())
    assert not out.exists()
    if isinstance(caught.value, InputError):
        assert caught.value.remedy
        assert caught.value.remedy in said
        assert caught.value.field in {"setpoints[0].depth", "step", "depth_range", "cast"}
        assert caught.value.value in {120.0, "120 m", 500.0}
    else:
        assert (
            as_asked(str(caught.value), {"depth_range": "--depth-range", "step": "--step"}) in said
        )
