"""Public functions take names of files and texts with units, and refuse all else by name."""

import inspect

import numpy as np
import pandas as pd
import pytest

import swimbladder as sb
from studies.benches import Motor, random_moves
from swimbladder.errors import InputError
from swimbladder.io.given import accepting, units_of
from swimbladder.units import parse_quantity
from tests.quoted import refused

VEHICLE = sb.load_vehicle("feup-em")
STEP = {"setpoints": [(0.0, 3.0)], "duration": 30.0, "start_depth": 1.5}
MISSION = sb.Mission(
    phases=[
        {"kind": "park", "depth": 40.0, "duration": 600.0},
        {"kind": "surface", "duration": 60.0},
    ]
)
UNKNOWN = VEHICLE.replace({"controller.law": "zz"})


def floats(**changes):
    profiler = sb.load_vehicle("example-float")
    given = {"vehicle": profiler, "mission": MISSION, "floats": 2, "store": "a.zarr"}
    return sb.Floats(**{"columns": [sb.water_of(profiler, MISSION)], **given, **changes})


SHARES = {  # numbers that have no unit
    "stability": {"delay"},
    "tune": {"delay"},
    "design_experiment": {"uncertainty"},
    "read_cast": {"latitude", "longitude", "salinity"},
}
FUNCTIONS = {n: f for n in sb.__all__ if inspect.isfunction(f := getattr(sb, n))}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_number_has_a_unit_that_its_text_may_have(name):
    units = units_of(FUNCTIONS[name])
    for parameter in inspect.signature(FUNCTIONS[name]).parameters.values():
        words = str(parameter.annotation)
        if "float" in words and not any(w in words for w in ("Mapping", "Callable", "Sequence")):
            known = units.get(parameter.name, [""])[0]
            assert bool(known) != (parameter.name in SHARES.get(name, set())), parameter.name
            assert parse_quantity(f"2 {known}".strip(), known) == 2.0


def test_a_text_is_the_number_in_the_unit_of_the_docstring():
    by_text = sb.simulate("feup-em", **{**STEP, "duration": "0.5 min", "start_depth": "150 cm"})
    by_number = sb.simulate(VEHICLE, **STEP)
    np.testing.assert_array_equal(by_text.depth, by_number.depth)
    assert by_text.vehicle == VEHICLE


@pytest.mark.prove
def test_both_of_a_pair_may_be_texts():
    how = {"maps": False, "within": 60.0, "runs": 20}
    by_text = sb.stability(VEHICLE, depth_range=("50 cm", 5), **how)
    as_typed = sb.stability(VEHICLE, depth_range="50:500 cm", **how)
    assert as_typed.to_dict() == by_text.to_dict()
    assert by_text.to_dict() == sb.stability(VEHICLE, depth_range=(0.5, 5.0), **how).to_dict()


def test_set_points_may_be_texts_each_in_its_unit():
    by_text = sb.simulate(VEHICLE, **{**STEP, "setpoints": [("0 s", "2 m"), ("0.1 min", "300 cm")]})
    by_array = sb.simulate(VEHICLE, **{**STEP, "setpoints": np.array([[0.0, 2.0], [6.0, 3.0]])})
    np.testing.assert_array_equal(by_text.depth, by_array.depth)


def test_a_cast_is_water_where_it_is_asked_for(tmp_path):
    rows = [f"{p},{12.0 - 0.02 * p},0" for p in range(0, 42, 2)]
    lake = tmp_path / "lake.csv"
    lake.write_text("pressure_dbar,temperature_degC,salinity\n" + "\n".join(rows) + "\n")
    cast = sb.read_cast(lake, latitude=45.0, longitude=8.0)
    flown = [
        sb.simulate(VEHICLE, **STEP, cast=water).depth
        for water in (cast, sb.cast_column(cast, step=0.1))
    ]
    np.testing.assert_array_equal(*flown)
    assert not np.array_equal(flown[0], sb.simulate(VEHICLE, **STEP).depth)
    with pytest.raises(sb.InputError, match=r"cast: no Cast \(got 3\)\. Give what read_cast"):
        sb.simulate(VEHICLE, **STEP, cast=3)


def test_numbers_of_records_may_be_texts():
    assert sb.Dive(max_depth="1 km", hotel="20 mW") == sb.Dive(max_depth=1000.0, hotel=0.02)
    assert sb.Target(neutral_depth="5 m", probability="90 %") == sb.Target(
        neutral_depth=5.0, probability=0.9
    )
    assert sb.Uncertainty(trim="3 cm3").trim == 3e-6
    assert sb.Thruster(diameter="8 cm", efficiency="40 %") == sb.Thruster(0.08, 0.4)
    assert sb.Flights(step=("1 m", "300 cm"), duration="1 min").step == (1.0, 3.0)
    assert sb.Workers(part="2/8").part == (2, 8)
    assert sb.Spread(trim="5 cm3").trim == 5e-6


def test_files_are_read_by_their_names(tmp_path):
    flown = sb.simulate(VEHICLE, **STEP)
    flown.save(tmp_path)
    path = str(tmp_path / "trajectory.csv")
    sb.save_vehicle(VEHICLE, tmp_path / "v.toml")
    by_name = sb.compare(path, tmp_path / "v.toml", drive="volume")
    by_log = sb.compare(sb.read_log(path), VEHICLE, drive="volume")
    assert by_name.to_dict() == by_log.to_dict()


def test_the_log_of_an_actuator_needs_no_depth(tmp_path):
    log, path = random_moves(np.random.default_rng(4), Motor()), tmp_path / "bench.csv"
    rows = [f"{time},{x}" for time, x in zip(log.time, log.piston, strict=True)]
    path.write_text("\n".join(["time_s,piston_m", *rows]), encoding="utf-8")
    rate = sb.identify_actuator(path).parameters["rate"].value
    assert rate == pytest.approx(sb.identify_actuator([log]).parameters["rate"].value)


def test_runs_of_a_pump_are_read_by_their_name_or_from_a_frame(tmp_path):
    """A name or a frame ended in an AttributeError."""
    pressure = np.tile(np.linspace(1e5, 5e6, 8), 2)
    columns = {"duration_s": np.full(16, 30.0), "pressure_Pa": pressure}
    columns["power_W"] = 10.0 + 4e-6 * pressure + 0.01 * np.cos(np.arange(16.0))
    frame = pd.DataFrame(columns)
    frame.to_csv(tmp_path / "runs.csv", index=False)
    one, other = sb.fit_pump(frame), sb.fit_pump(tmp_path / "runs.csv")
    assert one.parameters == other.parameters
    with refused(InputError, field="runs", value=3):
        sb.fit_pump(3)


def test_one_log_need_not_be_a_list(tmp_path):
    sb.simulate(VEHICLE, **STEP).save(tmp_path)
    path = tmp_path / "trajectory.csv"
    alone = sb.identify(path, VEHICLE, profiles=False)
    assert alone.to_dict() == sb.identify([str(path)], VEHICLE, profiles=False).to_dict()


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: sb.simulate("feup", **STEP), "Did you mean feup-em?"),
        (lambda: sb.simulate(3, **STEP), "vehicle: no Vehicle (got 3). Give what load_vehicle"),
        (
            lambda: sb.simulate(VEHICLE, **{**STEP, "duration": "30 m"}),
            "duration: the unit 'm' is of another kind (got '30 m', expected unit s)",
        ),
        (
            lambda: sb.simulate(VEHICLE, **{**STEP, "duration": [30.0]}),
            "duration: not a number (got [30.0], expected unit s). Give a number in s, or a text",
        ),
        (lambda: sb.stability(VEHICLE, depth_range=5.0), "depth_range: not two numbers (got 5.0)"),
        (
            lambda: sb.stability(VEHICLE, depth_range=("0 m", "5 s")),
            "depth_range: the unit 's' is of",
        ),
        (lambda: sb.tune(VEHICLE, delay="ten"), "delay: "),
        (lambda: sb.analyse(VEHICLE, sample_time=-1.0), "sample_time: it must be above 0"),
        (lambda: sb.mission("example-float", MISSION, seed=-1), "seed: must be a whole number"),
        (lambda: floats(columns=[]), "columns: no water is given"),
        (lambda: floats(store=None), "store: no name of a folder"),
        (lambda: floats(seed=1.5), "seed: must be a whole number"),
        (lambda: sb.save_vehicle(UNKNOWN, "v.toml"), "controller.law: unknown control law"),
        (lambda: sb.ballast("example-float", "c.csv"), "c.csv, file: there is no such file"),
        (lambda: sb.ballast("example-float", 3), "casts: no Cast (got 3). Give what read_cast"),
        (
            lambda: sb.simulate(VEHICLE, **{**STEP, "setpoints": [("0 s", "3 V")]}),
            "setpoints[0]: the unit 'V' is of another kind (got '3 V', expected unit m)",
        ),
        (lambda: sb.simulate(VEHICLE, **{**STEP, "setpoints": [3]}), "setpoints[0]: not two numb"),
        (lambda: sb.simulate(VEHICLE, **{**STEP, "setpoints": 3}), "setpoints: not a list (got 3)"),
        (lambda: sb.design_experiment(VEHICLE, bottom_depth=4.5, against=["x"]), "against[0]"),
        (
            lambda: sb.design_experiment(VEHICLE, bottom_depth=4.5, priors={"psi": 3}),
            'Write it as `priors={"psi": "MEAN +- STD m3/m"}`',
        ),
        (lambda: sb.simulate(VEHICLE, bottom_depth=2.0), "step: the depth is below the bottom"),
        (lambda: sb.ballast("example-float", ["c.csv"]), "c.csv, file: there is no such file"),
        (lambda: sb.ballast("example-float", [3]), "casts[0]: no Cast (got 3). Give what read_c"),
        (lambda: sb.mission("example-float", "m.toml"), "m.toml, file: there is no such file"),
        (lambda: sb.Dive(max_depth="50 s"), "max_depth: the unit 's' is of another kind"),
        (lambda: sb.Workers(part="8/1"), "part: no part of a whole (got '8/1')"),
        (lambda: sb.Workers(part="one"), "part: no part of a whole (got 'one')"),
    ],
)
def test_what_is_none_of_these_is_refused_by_name(call, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sb.InputError) as refused:
        call()
    assert says in str(refused.value)


def test_a_default_is_left_as_it_is_and_a_wrong_name_is_a_type_error():
    @accepting
    def made(a: float = "as it is", *, b: tuple[float, float] | None = None) -> object:
        """Return both.

        Parameters
        ----------
        a, b
            Lengths [n] [m].
        """
        return a, b

    assert made() == ("as it is", None)
    assert made("2 km", b=None) == (2000.0, None)
    assert made(1, b=["3 cm", np.float64(4.0)]) == (1, (0.03, 4.0))
    with pytest.raises(TypeError, match=r"^made\(\): got an unexpected keyword argument 'c'"):
        made(c=1)
