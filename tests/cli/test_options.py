"""Groups of options: as typer sees them, as they are read, and what both refuse alike."""

import inspect
import json
import re
from pathlib import Path

import numpy as np
import pytest
import typer

from swimbladder.cli import COMMANDS, main
from swimbladder.cli.options import Files, Options, flag, grouped, valued
from swimbladder.design.ballast import Target, ballast
from swimbladder.design.energy import PumpFit, PumpRuns, fit_pump, fitted_vehicle, sea
from swimbladder.design.pool_day.day import asked_of, rules_of
from swimbladder.design.pool_day.rehearsal import check_waiting
from swimbladder.design.pool_day.verdict import Asked
from swimbladder.design.pool_day.verdict import Target as PoolTarget
from swimbladder.design.sizing import Dive, load_parts, size
from swimbladder.errors import InputError
from swimbladder.estimation.comparison import compare
from swimbladder.estimation.comparison.ahead import predict_ahead
from swimbladder.estimation.motion import Prior, identify
from swimbladder.io.casts import read_cast
from swimbladder.io.config import load_vehicle
from swimbladder.io.files import write_csv
from swimbladder.io.logs import read_log

FLOAT, FEUP, NTNU = (load_vehicle(name) for name in ("example-float", "feup-em", "ntnu-bv"))


def _twice(text: str, option: str) -> str:
    return f"{option} {text}{text}"


class Some(Options):
    """A group."""

    start_depth: str | None = valued("DEPTH", "", name="--start")
    share: str = valued("SHARE", "", "10 %")
    word: str = valued("DEPTH", "", "a", read=_twice)
    range: str = valued("LEAST:MOST", "", "10:200 cm")
    names: str | None = valued("NAME,...", "")
    count: int = valued("N", "", 3)
    deep: bool = flag("--deep/--shallow", "", default=True)


def test_options_are_read_by_what_they_stand_for():
    some = Some(start_depth="50 cm", names="K2, T2", deep=False)
    assert some.read() == {
        "start_depth": 0.5,
        "share": 0.1,
        "word": "--word aa",
        "range": (0.1, 2.0),
        "names": ("K2", "T2"),
        "count": 3,
        "deep": False,
    }
    assert "names" not in Some().given()
    assert some.changed() == {"--start": "50 cm", "--names": "K2, T2", "--shallow": False}
    with pytest.raises(InputError, match="--start: the unit 's' is of another kind"):
        Some(start_depth="5 s").read()


def test_an_error_below_names_the_option_and_what_was_typed():
    with (
        pytest.raises(InputError, match=r"--start: too deep .got '50 cm'.*Give less --share") as e,
        Some(start_depth="50 cm").said_as_typed(),
    ):
        raise InputError("too deep", field="start_depth", value=0.5, remedy="Give less `share=`")
    assert e.value.field == "--start"
    with (
        pytest.raises(InputError, match=r"--start: too deep .got 'here'"),
        Some(start_depth="50 cm").said_as_typed(z="start_depth"),
    ):
        raise InputError("too deep", field="z", value="here")


def test_a_group_is_options_of_its_command():
    made = {}

    @grouped(out=Path("here"), share="20 %")
    def command(vehicle: str, plain: int = 2, *, some: Some, to: Files) -> None:
        """Say something."""
        made.update(vehicle=vehicle, plain=plain, some=some, to=to)

    taken = inspect.signature(command).parameters
    assert list(taken) == [
        "vehicle",
        "plain",
        "start",
        "share",
        "word",
        "range",
        "names",
        "count",
        "shallow",
        "full",
        "json",
        "out",
    ]
    assert taken["share"].default == "20 %"
    assert taken["vehicle"].default is inspect.Parameter.empty
    app = typer.Typer()
    app.command()(command)
    app(["feup-em", "--start", "1 m", "--shallow", "--json"], standalone_mode=False)
    assert made["some"] == Some(start_depth="1 m", share="20 %", deep=False)
    assert made["to"] == Files(out=Path("here"), json=True)
    assert (made["vehicle"], made["plain"]) == ("feup-em", 2)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A cast of 300 m, runs of a pump and a log, as commands and readers take them."""
    folder = tmp_path_factory.mktemp("given")
    p = np.arange(0.0, 301.0, 2.0)
    write_csv(
        folder / "cast.csv",
        {
            "pressure_dbar": p,
            "temperature_degC": 4.0 + 10.0 * np.exp(-p / 90.0),
            "salinity": np.full_like(p, 35.0),
        },
    )
    n = np.arange(12.0)
    runs = {"duration_s": 60.0 + n, "pressure_Pa": 1e5 * n, "power_W": 8.0 + 0.09 * n}
    write_csv(folder / "runs.csv", runs)
    t = np.arange(0.0, 60.0, 0.3)
    write_csv(
        folder / "log.csv",
        {"time_s": t, "depth_m": 0.5 + 0.2 * np.sin(t / 9.0), "volume_m3": 1e-6 * np.sin(t / 7.0)},
    )
    return folder


def _runs(folder):
    t = np.genfromtxt(folder / "runs.csv", delimiter=",", names=True)
    return PumpRuns(duration=t["duration_s"], pressure=t["pressure_Pa"], power=t["power_W"])


def _log(folder):
    return read_log(folder / "log.csv")


def _told(**parameters):
    none = dict.fromkeys(PumpFit.__dataclass_fields__)
    return PumpFit(**{**none, "parameters": parameters})


BALLAST = ["ballast", "example-float"]
SIZE = ["size", "example-eh"]
POOL = ["pool", "feup-em", "--simulate"]
COMPARE = ["compare", "log.csv", "--vehicle", "ntnu-bv"]
IDENTIFY = ["identify", "log.csv", "--vehicle", "ntnu-bv"]
FIT = ["energy", "--fit", "runs.csv"]


def _cast(**given):
    return lambda folder: read_cast(folder / "cast.csv", **given)


def _ballast(**given):
    return lambda _: ballast(FLOAT, **given)


REFUSED = [
    ([*BALLAST, "--cast", "cast.csv", "--latitude", "95"], _cast(latitude=95.0)),
    ([*SIZE, "--cast", "cast.csv", "--longitude=-400"], _cast(longitude=-400.0)),
    ([*SIZE, "--cast", "cast.csv", "--salinity", "99"], _cast(salinity=99.0)),
    ([*SIZE, "--cast", "cast.csv", "--inversions", "swap"], _cast(inversions="swap")),
    ([*BALLAST, "--max-depth=-5 m"], _ballast(max_depth=-5.0)),
    ([*BALLAST, "--max-depth", "3 km"], _ballast(max_depth=3000.0)),
    (
        [*BALLAST, "--cast", "cast.csv", "--cast-column", "pressure_dbar=pressure_dbar@dbar"],
        lambda folder: ballast(
            FLOAT,
            [read_cast(folder / "cast.csv", columns={"pressure_dbar": "pressure_dbar@dbar"})],
        ),
    ),
    ([*BALLAST, "--mass", "3 kg"], _ballast(mass=3.0)),
    ([*BALLAST, "--material", "cork"], _ballast(material="cork")),
    ([*BALLAST, "--neutral-volume", "1 cm3"], _ballast(target=Target(neutral_volume=1e-6))),
    ([*BALLAST, "--neutral-depth", "9 km"], _ballast(target=Target(neutral_depth=9000.0))),
    ([*BALLAST, "--probability", "30 %"], _ballast(target=Target(probability=0.3))),
    ([*BALLAST, "--speed", "9 m/s"], _ballast(target=Target(speed=9.0))),
    (
        [
            "energy",
            "example-float",
            "--cast",
            "cast.csv",
            "--cast-column",
            "pressure_dbar=pressure_dbar@dbar",
        ],
        lambda folder: sea(
            FLOAT, read_cast(folder / "cast.csv", columns={"pressure_dbar": "pressure_dbar@dbar"})
        ),
    ),
    ([*FIT, "--power-at", "noon"], lambda folder: fit_pump(_runs(folder), power_at="noon")),
    (["energy", "feup-em", *FIT[1:]], lambda _: fitted_vehicle(FEUP, _told())),
    ([*SIZE, "--goal", "money"], lambda _: size(FEUP, Dive(max_depth=50.0), goal="money")),
    ([*SIZE, "--driver-efficiency", "120 %"], lambda _: load_parts().with_driver(1.2)),
    (
        [*SIZE, "--driver-standby-power=-1 W"],
        lambda _: load_parts().with_driver(standby_power=-1.0),
    ),
    ([*SIZE, "--park-time=-1 s"], lambda _: Dive(max_depth=50.0, park_time=-1.0)),
    (["tune", "feup-em", "--depth-noise=-1 mm"], lambda _: FEUP.with_sensors(depth_noise=-1e-3)),
    (
        ["compare-laws", "feup-em", "--depth-quantum", "2 km"],
        lambda _: FEUP.with_sensors(depth_quantum=2000.0),
    ),
    ([*COMPARE, "--bottom-depth=-1 m"], lambda f: compare(_log(f), NTNU, bottom_depth=-1.0)),
    ([*COMPARE, "--surface-margin=-1 m"], lambda f: compare(_log(f), NTNU, surface_margin=-1.0)),
    ([*COMPARE, "--drive", "steam"], lambda f: compare(_log(f), NTNU, drive="steam")),
    (
        [*COMPARE, "--horizons", "5 s,5 s"],
        lambda f: predict_ahead(_log(f), NTNU, horizons=(5.0, 5.0)),
    ),
    ([*IDENTIFY, "--drive", "setpoint"], lambda f: identify([_log(f)], NTNU, drive="setpoint")),
    ([*IDENTIFY, "--neutral-std", "0"], lambda f: identify([_log(f)], NTNU, neutral_std=0.0)),
    ([*IDENTIFY, "--speed-std=-1 m/s"], lambda f: identify([_log(f)], NTNU, speed_std=-1.0)),
    ([*IDENTIFY, "--bottom-depth=-1 m"], lambda f: identify([_log(f)], NTNU, bottom_depth=-1.0)),
    (
        [*IDENTIFY, "--prior", "psi=1e-6 +- 0 m3/m"],
        lambda f: identify([_log(f)], NTNU, priors={"psi": Prior(1e-6, 0.0)}),
    ),
    ([*POOL, "--travel", "1 cm"], lambda _: rules_of(FEUP, travel=0.01)),
    ([*POOL, "--bottom-depth", "0.3 m"], lambda _: rules_of(FEUP, bottom_depth=0.3)),
    ([*POOL, "--target-std", "200 %"], lambda _: asked_of(FEUP, Asked(), target_std=2.0)),
    (
        [*POOL, "--target-std", "K9=2%"],
        lambda _: asked_of(FEUP, Asked(), target_std=[PoolTarget("K9", 0.02)]),
    ),
    (
        [*POOL, "--target-std", "K2=0 1/m2/s"],
        lambda _: asked_of(FEUP, Asked(), target_std=[PoolTarget("K2", 0.0, relative=False)]),
    ),
    ([*POOL, "--neutral-std", "0"], lambda _: asked_of(FEUP, Asked(neutral_std=0.0))),
    ([*POOL, "--free", "K7"], lambda _: asked_of(FEUP, Asked(free=("K7",)))),
    ([*POOL, "--real-time-factor", "0"], lambda _: check_waiting(real_time_factor=0.0)),
    ([*POOL, "--depth-noise=-1 mm"], lambda _: FEUP.with_sensors(depth_noise=-1e-3)),
    (
        ["pool", "feup-em", "--follow", "log.csv", "--timeout", "0 s"],
        lambda _: check_waiting(timeout=0.0),
    ),
]


@pytest.mark.parametrize(
    ("words", "call"), REFUSED, ids=lambda one: " ".join(one[2:]) if isinstance(one, list) else ""
)
def test_what_the_command_refuses_python_refuses(words, call, written, capsys, monkeypatch):
    monkeypatch.chdir(written)
    with pytest.raises(InputError) as refused:
        call(written)
    error = refused.value
    assert main([*words, "--json", "--out", "out"]) == error.exit_code == 2
    answer = json.loads(capsys.readouterr().out)
    assert "`" in error.what or error.what in answer["error"]
    assert "--" not in str(error)
    assert not re.search(r"`\w+=", answer["error"])
    if error.field.isidentifier() and error.field != "cast":
        assert answer["field"] in words or any(w.startswith(answer["field"] + "=") for w in words)
    if error.remedy and "`" not in error.remedy:
        assert error.remedy in answer["error"]
    assert not (written / "out").exists()


@pytest.mark.parametrize("command", sorted({*COMMANDS} - {"vehicle"}))
def test_the_options_that_most_need_come_first(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main([command, "--help"]) == 0
    first, _, advanced = capsys.readouterr().out.partition("─ Advanced ")
    options, later = (re.findall(r"^│ \*? *(--[\w-]+)", text, re.M) for text in (first, advanced))
    assert {"--out", "--full", "--json", "--help"} <= set(options)
    assert len(options) <= 16
    assert later or len(options) <= 8
