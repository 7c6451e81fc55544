"""A law, an actuator and formats of another package, which is installed here as pip does."""

import json
import re
import subprocess
import sys
import zlib

import numpy as np
import pytest

import swimbladder as sb
from studies.benches import Motor, random_moves
from swimbladder.cli import main
from swimbladder.codegen.library import firmware
from swimbladder.control.law import leaves
from swimbladder.control.registry import LAWS
from swimbladder.design.law_comparison.contenders import choose_laws
from swimbladder.design.stability.around import wrapped_law
from swimbladder.design.tuning import tune
from swimbladder.errors import InputError
from swimbladder.io.casts import read_cast
from swimbladder.io.log_format import log_format
from swimbladder.sim.closed_loop.outside import source_of
from swimbladder.vehicle import Controller
from tests.codegen.build import Compiled
from tests.codegen.conftest import gcc  # noqa: F401
from tests.codegen.laws import bits
from tests.estimation.motion.pool import campaign
from tests.vehicles import limited

FEUP = sb.load_vehicle("feup-em")

STEP = {"setpoints": [(0.0, 3.0)], "duration": 120.0, "start_depth": 1.5}

# The paper's cascade, written anew: what it does is known from the law of the tree.
LAW = """
from typing import Annotated, NamedTuple

from swimbladder import Law
from swimbladder.control.law import QUIET, Grid, Recipe, stiffness


class Gains(NamedTuple):
    inner: Annotated[float, "V/m3"]
    k_p: Annotated[float, "m3/m"]
    k_i: Annotated[float, "m3/s/m"]
    k_d: Annotated[float, "m3 s/m"]
    S_p: Annotated[float, "s"]


class Memory(NamedTuple):
    integral: float  # m3
    error: float  # m
    volume_reference: float  # m3


def initial(parameters, seen, reference):
    return Memory(seen.volume, reference - seen.depth, seen.volume)


def step(parameters, state, seen, reference):
    p = parameters
    error = reference - seen.depth
    wanted = p.k_p * error + p.k_d / p.S_p * (error - state.error) + state.integral
    after = Memory(state.integral + p.k_i * p.S_p * error, error, wanted)
    return p.inner * (wanted - seen.volume), after, p.S_p


def gains(s, k):
    d, a = stiffness(s.plant)
    w, zeta, third = k.frequency, k.damping, 0.4 * k.frequency
    return Gains(
        inner=k.inner / s.plant.gain,
        k_p=-(w * w + 2.0 * zeta * w * third + a * s.plant.psi) / a,
        k_i=-w * w * third / a, k_d=-(2.0 * zeta * w + third - d) / a, S_p=s.sample_time,
    )


GRID = Grid((0.3, 0.45), (0.05, 0.08, 0.12, 0.14, 0.16, 0.18, 0.2, 0.23), (0.6, 0.8, 1.0))
LAW = Law(
    name="hover", summary="the paper's cascade, written anew", command="voltage",
    parameters=Gains, state=Memory, step=step, initial=initial,
    recipe=Recipe(
        gains=gains, fast=GRID, quiet=GRID._replace(inner=(0.3,), frequency=QUIET.frequency),
        volts=(1.0,),
    ),
    volume_gain="inner",
)
OTHER = LAW
"""
FORMATS = '''
import zlib

import numpy as np

from swimbladder.errors import LogError
from swimbladder.io.casts import CastFormat
from swimbladder.io.cast_columns import RawCast

LOG = """
[log]
delimiter = ";"
[log.columns]
time_s = { name = "t", unit = "ms" }
depth_m = { name = "tiefe", unit = "cm" }
volume_m3 = { name = "v", unit = "mL" }
"""


def read(data, path, columns, profile):
    rows = np.frombuffer(zlib.decompress(data[4:]), float).reshape(-1, 3).T
    return RawCast(
        path=path, pressure=rows[0], temperature=rows[1], salinity=rows[2],
        row=np.arange(rows.shape[1]) + 1, row_name="sample", latitude=45.0, longitude=-20.0,
        unit_stated=True,
    ), profile


CAST = CastFormat(recognises=lambda data: data.startswith(b"SWBZ"), read=read)
'''
# A screw drive written anew, and a pump whose delivery falls with the square of the pressure.
KINDS = """
import math
from typing import Annotated, Literal

from pydantic import Field
from swimbladder.vehicle import (
    ActuatorKind, CurvePump, ElectromechanicalActuator, Motor, PumpAndValve, ScrewDrive,
    UnifiedActuator, Unit, Valve,
)

Above0 = Field(gt=0.0)


class Rack(ActuatorKind):
    kind: Literal["rack"] = "rack"
    motor: Motor
    pinion: Annotated[float, Unit("m"), Above0]
    gear_ratio: Annotated[float, Unit(""), Field(ge=1.0)]
    efficiency: Annotated[float, Unit(""), Field(gt=0.0, le=1.0)]
    inertia: Annotated[float, Unit("kg m2"), Above0]
    piston_area: Annotated[float, Unit("m2"), Above0]

    def acts_as(self, water):
        m, travel = self.motor, self.pinion / self.gear_ratio
        return UnifiedActuator(
            inertia=m.rotor_inertia + self.inertia,
            k_u=m.torque_constant / m.resistance,
            k_v=m.viscous_friction + m.torque_constant**2 / m.resistance,
            k_q=self.piston_area * travel,
            k_z=water.density * water.gravity * self.piston_area * travel / self.efficiency,
            efficiency=self.efficiency,
            friction_torque=m.friction_torque,
            resistance=m.resistance,
            emf_constant=m.torque_constant,
        )


class Hose(ActuatorKind):
    kind: Literal["hose"] = "hose"
    delivery: Annotated[float, Unit("m3/s"), Above0]
    opens: Annotated[float, Unit("Pa"), Above0]
    idle: Annotated[float, Unit("W"), Above0]
    valve: Valve
    bypass: Valve

    def acts_as(self, water):
        pressure = tuple(0.05 * n * self.opens for n in range(20))
        rates = tuple(self.delivery * (1.0 - (p / self.opens) ** 2) for p in pressure)
        power = tuple(self.idle + 2.0 * p * rate for p, rate in zip(pressure, rates))
        pump = CurvePump(pressure=pressure, delivery=rates, power=power)
        return PumpAndValve(pump=pump, valve=self.valve, bypass=self.bypass, quantum=1e-3)
"""
POINTS = {
    "actuators": {"rack": "swb_probe.kinds:Rack", "hose": "swb_probe.kinds:Hose"},
    "laws": {"hover": "swb_probe.law:LAW"},
    "log_formats": {"hover-logger": "swb_probe.formats:LOG"},
    "cast_formats": {"hover-cast": "swb_probe.formats:CAST"},
}
# The numbers of Table 3 under the names of this law.
TABLE_3 = dict(
    zip(("inner", "k_p", "k_i", "k_d"), FEUP.controller.parameters.values(), strict=True)
)
HOVER = FEUP.model_copy(
    update={"controller": Controller(law="hover", sample_time="0.3 s", parameters=TABLE_3)}
)


def described(folder, name, points):
    """Write a package's metadata beside its modules, as an installer does."""
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [
        line
        for group, entries in points.items()
        for line in (f"[swimbladder.{group}]", *(f"{k} = {v}" for k, v in entries.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder into which pip has installed the package."""
    source, target = tmp_path_factory.mktemp("swb-probe"), tmp_path_factory.mktemp("site")
    module = source / "swb_probe"
    module.mkdir()
    (module / "__init__.py").write_text("")
    (module / "law.py").write_text(LAW)
    (module / "formats.py").write_text(FORMATS)
    (module / "kinds.py").write_text(KINDS)
    entries = [
        line
        for group, points in POINTS.items()
        for line in (
            f'[project.entry-points."swimbladder.{group}"]',
            *(f'{name} = "{value}"' for name, value in points.items()),
        )
    ]
    (source / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "swb-probe"\nversion = "1.0"\n' + "\n".join(entries) + "\n"
    )
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-index",
            "--no-deps",
            "--no-build-isolation",
            "--disable-pip-version-check",
            "--target",
            target,
            source,
        ],
        check=True,
        capture_output=True,
        text=True,
    )
    return target


@pytest.fixture
def hover(installed, monkeypatch):
    monkeypatch.syspath_prepend(str(installed))
    return installed


def refused(call, *words):
    with pytest.raises(InputError) as caught:
        call()
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value), str(caught.value)


@pytest.mark.usefixtures("hover")
class TestALaw:
    def test_it_is_there_and_without_its_package_it_is_not(self, hover):
        assert LAWS["hover"].name == "hover"
        assert LAWS.package("hover") == "swb-probe"
        assert LAWS.package("cascade") is None
        assert list(LAWS)[-1] == "hover"
        sys.path.remove(str(hover))
        assert "hover" not in LAWS
        refused(lambda: sb.simulate(HOVER, **STEP), "unknown control law")

    def test_it_is_simulated_as_the_cascade_that_it_is(self):
        own, other = sb.simulate(FEUP, **STEP), sb.simulate(HOVER, **STEP)
        assert np.array_equal(own.depth, other.depth)
        assert np.array_equal(own.command, other.command)

    def test_the_command_line_takes_it_and_says_its_name(self, tmp_path, capsys):
        from swimbladder.io.vehicle_file import vehicle_file

        (tmp_path / "v.toml").write_text(vehicle_file(HOVER), encoding="utf-8")
        code = main(
            [
                "simulate",
                str(tmp_path / "v.toml"),
                "--duration",
                "60",
                "--json",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        assert code == 0
        assert json.loads(capsys.readouterr().out)["vehicle"] == FEUP.name

    @pytest.mark.usefixtures("gcc")
    def test_its_c_is_its_twin(self, tmp_path):
        from swimbladder.codegen.twin import twin

        law = LAWS["hover"]
        compiled, same = Compiled(law, tmp_path), twin(law)
        library = firmware(limited(HOVER), duration=30.0)
        assert library.to_dict()["law"] == "hover"
        parameters = library.parameters
        rng = np.random.default_rng(1)
        seen = sb.Measurement(*map(np.float32, (0.0, 1.5, 6e-6)))
        state = same.initial(parameters, seen, np.float32(3.0))
        assert bits(*compiled.initial(parameters, seen, 3.0)) == bits(*state)
        for _ in range(200):
            seen = sb.Measurement(*map(np.float32, rng.normal([0.0, 2.0, 0.0], [1.0, 1.0, 1e-4])))
            command, after, wait = same.step(parameters, state, seen, np.float32(3.0))
            in_c, state_in_c, wait_in_c = compiled.step(parameters, state, seen, 3.0)
            assert bits(in_c, *state_in_c, wait_in_c) == bits(command, *after, wait)
            state = after

    @pytest.mark.prove
    def test_it_is_tuned_as_the_cascade_is(self):
        given = {"goal": "quiet", "depth_range": (0.0, 5.0), "runs": 20}
        own, other = tune(FEUP, law="cascade", **given), tune(FEUP, law="hover", **given)
        assert list(leaves(other.parameters).values()) == list(leaves(own.parameters).values())
        assert other.margins == own.margins
        assert str(other.region) == str(own.region)  # energies are nan

    def test_it_is_compared_and_has_a_wrapped_form(self):
        kept, out = choose_laws(FEUP, None)
        assert "hover" in kept
        assert "hover" not in out
        form, law = wrapped_law(LAWS["hover"]), LAWS["hover"]
        assert form.parameters.__annotations__["law"] is law.parameters

    def test_an_edit_of_its_source_gives_its_kernels_and_answers_another_name(self):
        def name(text):
            space = {"__name__": f"law_{zlib.crc32(text.encode())}"}
            exec(text, space)
            return source_of(space["LAW"])

        assert source_of(LAWS["cascade"]) == ""
        assert name(LAW) == name(LAW)
        assert name(LAW.replace("p.inner * (", "0.5 * p.inner * (")) != name(LAW)
        assert name(LAW.replace("0.4 * k.frequency", "0.5 * k.frequency")) != name(LAW)


EM, FLOAT = sb.load_vehicle("example-em"), sb.load_vehicle("example-float")
DIVE = """
schema_version = 1
name = "dive"
start_depth = "0 m"
[[phases]]
kind = "descend"
depth = "500 m"
[[phases]]
kind = "park"
depth = "500 m"
duration = "2 h"
[[phases]]
kind = "surface"
duration = "10 min"
"""


def with_actuator(vehicle, **fields):
    """The vehicle with an actuator of these fields, as a file of it is read."""
    from swimbladder.vehicle import Vehicle

    own = {name: getattr(vehicle, name) for name in type(vehicle).model_fields}
    return Vehicle(**{**own, "actuator": fields, "provenance": {}})


def racked(**other):
    """example-em, its spindle as a rack with a pinion of the same travel."""
    a = EM.actuator
    return with_actuator(
        EM,
        **{
            "kind": "rack",
            "motor": a.motor.model_dump(),
            "pinion": a.drive.lead / (2.0 * np.pi),
            "gear_ratio": a.drive.gear_ratio,
            "efficiency": a.drive.efficiency,
            "inertia": a.drive.reflected_inertia,
            "piston_area": "75 cm2",
        }
        | other,
    )


def hosed(**other):
    """example-float with a hose pump, its controller that of the preset."""
    fields = {"kind": "hose", "delivery": "1 mL/s", "opens": "300 bar", "idle": "20 W"}
    valves = {name: getattr(FLOAT.actuator, name).model_dump() for name in ("valve", "bypass")}
    return with_actuator(FLOAT, **(fields | valves | other))


@pytest.mark.usefixtures("hover")
class TestAnActuator:
    def test_it_is_the_drive_that_it_acts_as(self):
        """The oracle is the screw drive of the tree, whose travel a turn is that of the pinion."""
        from swimbladder.physics.actuator import unified
        from swimbladder.physics.buoyancy_engine import drive_map

        made = racked()
        theirs, ours = unified(made.engine, made.water), unified(EM.actuator, EM.water)
        for name, number in ours:
            if isinstance(number, float):
                assert getattr(theirs, name) == pytest.approx(number, rel=1e-12), name
        one, other = sb.simulate(EM, **STEP), sb.simulate(made, **STEP)
        assert other.depth == pytest.approx(one.depth, abs=1e-9)
        assert other.command == pytest.approx(one.command, abs=1e-6)
        p = np.array([0.0, 1e5, 5e5])
        assert drive_map(made, p).power_out == pytest.approx(drive_map(EM, p).power_out, rel=1e-9)

    def test_the_load_goes_with_the_water_of_the_vehicle(self):
        heavier = racked().water.model_copy(update={"density": 1030.0})
        made = racked().model_copy(update={"water": heavier})
        assert made.engine.k_z == pytest.approx(1.03 * racked().engine.k_z, rel=1e-12)

    def test_a_pump_delivers_what_its_formula_says(self):
        """Between the points of its curve too, within what a smooth curve through them misses."""
        from swimbladder.physics.buoyancy_engine import drive_map

        made = hosed()
        p = np.linspace(0.0, 280e5, 57)
        found = drive_map(made, p)
        rate = 1e-6 * (1.0 - (p / 300e5) ** 2)
        assert found.rate_out == pytest.approx(rate, rel=2e-3)
        E, R_b = made.supply.voltage, made.supply.internal_resistance
        drawn = 20.0 + 2.0 * p * rate
        i = (E - np.sqrt(E**2 - 4.0 * R_b * drawn)) / (2.0 * R_b)
        assert found.power_out == pytest.approx(E * i, rel=2e-3)
        assert drive_map(made, [290e5]).rate_out[0] == 0.0  # beyond its last point

    def test_a_file_keeps_its_fields_and_without_the_package_it_is_refused(self, hover, tmp_path):
        from swimbladder.io.vehicle_file import vehicle_file

        for made in (racked(), hosed()):
            path = tmp_path / "v.toml"
            path.write_text(vehicle_file(made), encoding="utf-8")
            assert f'kind = "{made.actuator.kind}"' in path.read_text("utf-8")
            assert sb.load_vehicle(path) == made
        sys.path.remove(str(hover))
        refused(lambda: sb.load_vehicle(path), "line", "actuator.kind", "'hose'", "pump-valve")

    @pytest.mark.parametrize(
        ("make", "change", "words"),
        [
            (racked, {"pinion": "1 s"}, ["actuator.pinion", "got '1 s'", "unit m"]),
            (racked, {"pinion": -1.0}, ["actuator.pinion", "greater than 0"]),
            (racked, {"pinnion": 1.0}, ["actuator.pinnion", "Did you mean pinion?"]),
            (racked, {"efficiency": None}, ["actuator.efficiency"]),
            (racked, {"kind": "rak"}, ["actuator.kind", "'rak'", "Did you mean rack?", "unified"]),
            (racked, {"kind": ["rack"]}, ["actuator.kind"]),
            (hosed, {"valve": {"flow": -1.0}}, ["actuator.valve.flow", "greater than 0"]),
            (hosed, {"idle": "1e14 W", "delivery": "1e8 m3/s"}, ["power[", "beyond any", "swb-pr"]),
        ],
    )
    def test_a_wrong_number_is_named_as_one_of_the_tree_is(self, make, change, words):
        refused(lambda: make(**change), *words)

    def test_an_answer_is_kept_for_what_it_acts_as(self, monkeypatch):
        from swimbladder.jobs import identity

        made = racked()
        before = identity(made)
        assert identity(racked()) == before
        assert identity(racked(pinion=made.actuator.pinion * 1.001)) != before
        acts = made.engine.model_copy(update={"k_v": 2.0 * made.engine.k_v})
        monkeypatch.setattr(type(made.actuator), "acts_as", lambda *_: acts)
        assert identity(made) != before

    def test_logs_of_the_motion_leave_it_as_it_is(self):
        from swimbladder.estimation.motion import identify

        made = racked()
        found = identify(campaign(21, quantum=5e-3), made, profiles=False, choices=False)
        assert found.identified
        assert found.vehicle.actuator == made.actuator
        assert found.vehicle.motion.K2 == found.parameters["K2"].value != made.motion.K2

    def test_logs_of_the_motor_make_an_identified_one_of_it(self):
        from swimbladder.estimation.actuator import identify_actuator

        moves = random_moves(np.random.default_rng(4), Motor(T1=0.05))
        made = racked()
        found = identify_actuator([moves], made)
        now = found.vehicle.actuator
        assert now.kind == "identified"
        assert pytest.approx(0.05, rel=0.1) == now.T1
        assert pytest.approx(0.444e-3, rel=1e-3) == now.K1  # what EM was made for

    @pytest.mark.slow
    def test_commands_take_it(self, tmp_path, capsys, monkeypatch):
        """`make prove` tries those that fly a law as well."""
        from swimbladder.io.vehicle_file import vehicle_file

        monkeypatch.chdir(tmp_path)
        (tmp_path / "v.toml").write_text(vehicle_file(racked()), encoding="utf-8")
        for words in (["vehicle", "show"], ["analyse"], ["energy"]):
            assert main([*words, "v.toml"]) == 0
            assert capsys.readouterr().out, words

    @pytest.mark.prove
    @pytest.mark.parametrize("kind", ["rack", "hose"])
    def test_every_command_takes_it(self, tmp_path, capsys, monkeypatch, kind):
        from swimbladder.io.vehicle_file import vehicle_file

        monkeypatch.chdir(tmp_path)
        (tmp_path / "dive.toml").write_text(DIVE)
        # a sensor without noise that has bobbed and lies still counts as frozen
        made = racked() if kind == "rack" else hosed().with_sensors(depth_noise=0.01)
        mission, law = (None, "sea-cascade") if kind == "rack" else (DIVE, "rate")
        v = str(tmp_path / f"{made.actuator.kind}.toml")
        (tmp_path / v).write_text(vehicle_file(made), encoding="utf-8")
        depth = ["--depth-range", "0:10 m" if mission is None else "10:500 m"]
        dive = [] if mission is None else [str(tmp_path / "dive.toml")]
        out = ["--out", str(tmp_path / f"fw-{law}")]
        compared = ["compare-laws", v, *depth, "--laws", law, "--runs", "2"]
        for words in (
            ["vehicle", "show", v],
            ["simulate", v, "--duration", "60"],
            ["analyse", v],
            ["energy", v],
            ["tune", v, *depth, "--law", law, "--runs", "20", "--out", str(tmp_path / law)],
            ["stability", v, *depth, "--no-maps"],
            [
                "firmware",
                v,
                *out,
                "--time-limit",
                "20 h",
                *(["--duration", "3 h"] if dive else []),
            ],
            ["faults", v, "--missions", "3", "--time-limit", "20 h"],
            *([["mission", v, *dive], compared] if dive else []),
        ):
            code = main(words)
            said = capsys.readouterr()
            assert code in (0, 1), (words, said.err)
            assert said.out, words
        kept = sb.load_vehicle(tmp_path / law / "vehicle.toml")
        assert kept.actuator == made.actuator
        assert kept.controller.law == law


@pytest.mark.usefixtures("hover")
class TestFormats:
    def test_a_log(self, tmp_path, capsys):
        form = log_format("hover-logger")
        assert form.delimiter == ";"
        lines = ["t;tiefe;v"]
        for n in range(400):
            depth = 50.0 + 2.0 * np.exp(-0.01 * n)
            lines.append(f"{250 * n};{depth:.4f};{100.0 + 0.01 * n:.3f}")
        (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
        log = sb.read_log(tmp_path / "log.csv", log_format="hover-logger")
        assert log.time[-1] == pytest.approx(99.75)
        assert log.depth[0] == pytest.approx(0.52)
        code = main(
            [
                "compare",
                str(tmp_path / "log.csv"),
                "--vehicle",
                "feup-em",
                "--json",
                "--log-format",
                "hover-logger",
                "--drive",
                "volume",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        assert code in (0, 1), capsys.readouterr().err
        answer = json.loads(capsys.readouterr().out)
        assert answer["drive"] == "volume", answer

    def test_a_cast(self, tmp_path):
        pressure = np.linspace(0.0, 200.0, 101)
        rows = np.stack([pressure, 20.0 - 0.05 * pressure, 35.0 + 0.0 * pressure], axis=1)
        path = tmp_path / "water.swbz"
        path.write_bytes(b"SWBZ" + zlib.compress(rows.astype(float).tobytes()))
        cast = read_cast(path)
        table = tmp_path / "water.csv"
        np.savetxt(
            table,
            rows,
            delimiter=",",
            comments="",
            header="pressure_dbar,temperature_degC,salinity",
        )
        same = read_cast(table, latitude=45.0, longitude=-20.0)
        assert np.allclose(cast.SA, same.SA, rtol=1e-9)
        assert np.allclose(cast.CT, same.CT, rtol=1e-9)
        path.write_bytes(b"SWBZ no zlib")
        refused(lambda: read_cast(path), "hover-cast", "swb-probe fails", "uninstall it")
        path.write_bytes(b"SWBX")
        with pytest.raises(InputError):
            read_cast(path)


class TestWhatIsBroken:
    @pytest.fixture
    def beside(self, tmp_path, monkeypatch):
        """Return how a package of a name is put beside the others."""
        monkeypatch.syspath_prepend(str(tmp_path))

        def put(name, points, **modules):
            for module, text in modules.items():
                (tmp_path / f"{module}.py").write_text(text)
            described(tmp_path, name, points)

        return put

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("import nothing_of_that_name", "ModuleNotFoundError"),
            ("LAW = 3", "it is no Law"),
            ("def LAW(:", "SyntaxError"),
            ("", "AttributeError"),
            (LAW, "is called 'bad' and the law 'hover'"),
            (
                LAW.replace('name="hover"', 'name="bad"')
                .replace(', "m3 s/m"]', "]", 1)
                .replace("Annotated[float]", "float"),
                "k_d has",
            ),
            (
                LAW.replace('name="hover"', 'name="bad"').replace('"voltage"', '"torque"'),
                "no actuator takes a torque",
            ),
        ],
    )
    def test_it_is_one_line_and_in_nobodys_way(self, beside, text, says):
        module = f"bad_{zlib.crc32(text.encode())}"
        beside("swb-bad", {"laws": {"bad": f"{module}:LAW"}}, **{module: text})
        refused(lambda: LAWS["bad"], says, "swb-bad", "ninstall")
        assert "bad" in LAWS.names()
        assert "bad" not in list(LAWS)
        assert LAWS["cascade"].name == "cascade"
        _, out = choose_laws(FEUP, None)
        assert "swb-bad" in out["bad"]
        bad = FEUP.controller.model_copy(update={"law": "bad"})
        broken = FEUP.model_copy(update={"controller": bad})
        refused(lambda: sb.simulate(broken, **STEP), "swb-bad")
        assert len(sb.simulate(FEUP, **STEP).time) == 401

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("Rack = 3", "it is no ActuatorKind"),
            (KINDS.replace("(ActuatorKind)", ""), "it is no ActuatorKind"),
            (KINDS.replace("def acts_as", "def acts_like"), "acts as"),
            (KINDS.replace('"rack"', '"rick"'), "is called 'rack' and its kind 'rick'"),
            ("import nothing_of_that_name", "ModuleNotFoundError"),
            (KINDS.replace("m, travel = ", "return 3; m, travel = "), "it acts as a int"),
            (KINDS.replace("m, travel = ", "1.0 / 0.0; m, travel = "), "ZeroDivisionError"),
            (KINDS.replace("k_u=m.", "k_u=-m."), "k_u: must be greater than 0"),
        ],
    )
    def test_a_kind_of_actuator_is_one_line_and_in_nobodys_way(self, beside, text, says):
        module = f"bad_{zlib.crc32(text.encode())}"
        beside("swb-bad", {"actuators": {"rack": f"{module}:Rack"}}, **{module: text})
        refused(racked, says, "swb-bad", "pdate" if "with" in says else "")
        assert sb.load_vehicle("example-em") == EM

    def test_a_kind_of_the_tree_is_nobody_elses(self, beside):
        text = KINDS.replace('"rack"', '"unified"')
        beside("swb-thief", {"actuators": {"unified": "thief_kind:Rack"}}, thief_kind=text)
        refused(lambda: racked(kind="unified"), "swb-thief", "swimbladder")
        assert sb.load_vehicle("example-em") == EM

    def test_two_of_one_name_are_refused(self, beside):
        one, two = LAW.replace("OTHER = LAW", ""), LAW
        beside("swb-one", {"laws": {"hover": "one_law:LAW"}}, one_law=one)
        assert LAWS["hover"].name == "hover"
        beside("swb-two", {"laws": {"hover": "two_law:LAW"}}, two_law=two)
        forget()
        refused(lambda: LAWS["hover"], "swb-one and swb-two", "Uninstall swb-two")

    @pytest.mark.parametrize("name", ["cascade", "rate"])
    def test_a_name_of_swimbladders_own_is_refused(self, beside, name):
        text = LAW.replace('name="hover"', f'name="{name}"')
        beside("swb-thief", {"laws": {name: f"thief_{name}:LAW"}}, **{f"thief_{name}": text})
        refused(lambda: LAWS[name], "swb-thief")
        assert LAWS["planned"].name == "planned"

    def test_a_broken_format_of_casts_is_said_and_the_cast_read(self, beside, tmp_path):
        beside("swb-ill", {"cast_formats": {"ill": "ill:X"}, "log_formats": {"ill": "ill:Y"}})
        refused(lambda: log_format("ill"), "swb-ill")
        table = tmp_path / "water.csv"
        table.write_text("pressure_dbar,temperature_degC,salinity\n0,20,35\n50,15,35\n")
        assert any("swb-ill" in line for line in read_cast(table).report)


def forget():
    from swimbladder.vehicle import plugins

    plugins._entry_points.cache_clear()


def test_nothing_of_others_is_imported_before_it_is_used(installed):
    code = (
        "import sys, time; start = time.perf_counter()\n"
        "import swimbladder.cli\n"
        "swimbladder.cli.main(['--help'])\n"
        "print(*sorted(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONPATH": str(installed), "PATH": ""},
    )
    loaded = done.stderr.split()
    assert not re.search(r"swb_probe", done.stderr)
    assert "swimbladder.vehicle.plugins" not in loaded
