"""Times in another unit than they are read in, told by volume and depth beside them."""

import re
from dataclasses import replace

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.cli import main
from swimbladder.errors import LogError
from swimbladder.estimation.comparison.misread import _UNITS, _fits, refuse_wrong_clock
from swimbladder.estimation.comparison.record import record
from swimbladder.io.log_table import TimeColumn
from swimbladder.io.logs import Log, read_log
from tests.quoted import refused


@pytest.fixture(scope="module")
def pool():
    """A step of the paper's vehicle, as it would be logged."""
    s = sb.simulate(
        sb.load_vehicle("feup-em"), setpoints=[(0.0, 3.0)], duration=120.0, start_depth=1.5
    )
    return Log(
        source="pool",
        time=s.time,
        depth=s.depth,
        volume=s.volume,
        voltage=s.voltage,
        line=np.arange(len(s.time)),
    )


def own(vehicle="feup-em"):
    return sb.load_vehicle(vehicle)


def test_the_closed_form_has_the_vehicles_own_force():
    """Let go with a cm3 too little, z'' + z'/T2 = K2 v/T2: z = K2 v (t - T2 (1 - exp(-t/T2)))."""
    vehicle = own()
    even = vehicle.model_copy(update={"hull": vehicle.hull.model_copy(update={"psi": 0.0})})
    t = np.linspace(0.0, 200.0, 2001)
    K2, T2, v = vehicle.motion.K2, vehicle.motion.T2, 1e-6
    volume = np.where(t < 100.0, -v, v)  # and then as much too much
    sunk = K2 * v * (t - T2 * (1.0 - np.exp(-t / T2)))
    late = np.maximum(t - 100.0, 0.0)
    depth = 3.0 + sunk - 2.0 * K2 * v * (late - T2 * (1.0 - np.exp(-late / T2)))
    found = _fits(t, depth, "volume", volume, even)
    assert found.force == pytest.approx(1.0, abs=2e-3)
    assert found.explained > 0.9999
    assert _fits(t, 2.0 * depth, "volume", volume, even).force == pytest.approx(2.0, abs=4e-3)


SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}


@pytest.mark.parametrize("read", SECONDS)
@pytest.mark.parametrize("true", SECONDS)
def test_the_unit_that_the_numbers_are_in_is_named(pool, tmp_path, true, read):
    """Whatever unit they were read in: 1000 times too short is s read as ms, and ms read as us."""
    path = tmp_path / "log.csv"
    rows = np.column_stack([pool.time / SECONDS[true], pool.depth, pool.volume])
    np.savetxt(path, rows, delimiter=",", header="t,depth_m,volume_m3", comments="", fmt="%.12g")
    log = read_log(path, columns={"time_s": f"t@{read}"})
    if true == read:
        assert record(log, own(), drive="volume").duration == pytest.approx(120.0)
        return
    with pytest.raises(LogError, match=f'`columns={{"time_s": "t@{true}"}}`') as refused:
        record(log, own(), drive="volume")
    assert f"where the times are {_UNITS[true]} only" in refused.value.what


@pytest.mark.parametrize(
    ("factor", "said"), [(1e-3, "1e+03"), (60.0, "0.0167"), (3600.0, "0.000278")]
)
def test_where_no_unit_fits_the_factor_is_told(pool, factor, said):
    wrong = replace(pool, time=factor * pool.time)  # in seconds, as far as the log knows
    with pytest.raises(LogError, match=re.escape(f"{said} times as long only")) as refused:
        record(wrong, own(), drive="volume")
    assert "@" not in refused.value.remedy


def test_times_that_are_texts_have_no_unit_to_be_mapped_in(pool):
    wrong = replace(pool, time=60.0 * pool.time, times=TimeColumn("clock", None))
    with refused(LogError, field="time_s", value=7200.0):
        record(wrong, own(), drive="volume")


def test_a_vehicle_that_is_twice_as_heavy_or_free_is_none_of_another_unit(pool):
    for times in (0.5, 2.0):
        motion = own().motion
        other = own().model_copy(
            update={"motion": motion.model_copy(update={"K2": times * motion.K2})}
        )
        assert record(pool, other, drive="volume").drive == "volume"


@pytest.mark.parametrize("vehicle", ["feup-em", "example-em", "example-eh"])
def test_a_voltage_tells_too(vehicle):
    v = own(vehicle)
    s = sb.simulate(v, setpoints=[(0.0, 3.0), (60.0, 2.0)], duration=120.0, start_depth=1.5)
    log = Log(source="", time=s.time, depth=s.depth, voltage=s.voltage, line=np.arange(len(s.time)))
    assert record(log, v, drive="voltage").drive == "voltage"
    with pytest.raises(LogError, match=r'\{"time_s": "NAME@ms"\}'):
        record(replace(log, time=1e3 * log.time), v, drive="voltage")


def test_what_tells_nothing_is_not_refused(pool):
    still = replace(pool, depth=np.full_like(pool.depth, 2.0), time=1e3 * pool.time)
    under = np.ones(len(pool), dtype=bool)
    refuse_wrong_clock(still, own(), under, "volume", still.volume)
    refuse_wrong_clock(still, own(), ~under, "volume", still.volume)
    quiet = np.zeros(len(pool))
    refuse_wrong_clock(still, own(), under, "voltage", quiet)


def test_a_log_whose_volume_does_not_move_is_not_refused():
    """Current and trapped air make it rise and sink; its last sample begins a move."""
    vehicle, time = own("ntnu-bv"), np.arange(0.0, 76.0, 0.5)
    volume = np.full(len(time), vehicle.stroke.minimum)
    volume[-1] += 0.7e-6
    depth = 3.0 + 0.06 * time + 0.1 * np.sin(time / 20.0 + 5.0)
    assert _fits(60.0 * time, depth, "volume", volume, vehicle).explained > 0.8  # psi, and chance
    log = Log(source="", time=time, depth=depth, volume=volume, line=np.arange(len(time)))
    refuse_wrong_clock(log, vehicle, np.ones(len(time), dtype=bool), "volume", volume)


@pytest.mark.parametrize("command", ["compare", "identify"])
def test_the_commands_refuse_it_at_once(capsys, tmp_path, pool, command):
    table = np.column_stack([1e3 * pool.time, pool.depth, pool.volume])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, delimiter=",", header="time_s,depth_m,volume_m3", comments="")
    words = [command, str(path), "--vehicle", "feup-em", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "the samples are 300 s apart" in said
    assert "are milliseconds only" in said
    assert not (tmp_path / "out").exists()


def test_times_in_milliseconds_are_compared_when_mapped(capsys, tmp_path, pool):
    path = tmp_path / "log.csv"
    table = np.column_stack([1e3 * pool.time, pool.depth, pool.volume])
    np.savetxt(path, table, delimiter=",", header="when,depth_m,volume_m3", comments="")
    words = ["compare", str(path), "--vehicle", "feup-em", "--out", str(tmp_path / "out")]
    assert main([*words, "--column", "time_s=when@ms"]) == 0
    assert "100.00 %" in capsys.readouterr().out


@pytest.mark.data
def test_a_real_float_is_told_too(data_dir):
    """Missions of a float whose neutral volume drifts: none is refused as it is."""
    path, told = data_dir / "ntnu_bv" / "missions.csv.gz", 0
    for number in (47, 65, 43, 51, 45, 33, 35, 59, 29, 61, 37, 39, 31, 49, 63, 13):
        log = read_log(path, log_format="ntnu-bv", where={"log": number})
        record(log, own("ntnu-bv"), drive="volume")
        try:
            record(replace(log, time=1e3 * log.time), own("ntnu-bv"), drive="volume")
        except LogError as error:
            told += "@ms" in str(error)
    assert told >= 11


def test_depths_that_count_upward_are_told(pool):
    turned = replace(pool, depth=-pool.depth)
    with pytest.raises(LogError, match='say depth_positive = "up" in the \\[log\\] table'):
        record(turned, own(), drive="volume")
