"""Gaps and spikes: found where they are, and nowhere else."""

from pathlib import Path

import numpy as np
import pytest

from swimbladder.io.log_format import LogFormat
from swimbladder.io.logs import read_log, spikes
from tests.log_files import write

TIME = 0.5 * np.arange(600)
DIVE = 1.5 + 0.7 * np.sin(2.0 * np.pi * TIME / 40.0)


def column(name: str, values, time=TIME, gaps=()):
    return np.flatnonzero(spikes(name, np.asarray(values), np.asarray(time), gaps)).tolist()


def spiked(values, at, by):
    values = np.array(values)
    values[at] += by
    return values


@pytest.mark.parametrize(
    "signal",
    [
        DIVE,
        np.round(DIVE / 0.005) * 0.005,
        DIVE + 0.002 * np.random.default_rng(1).standard_normal(600),
        np.full(600, 1.5),
        np.where(TIME < 100.0, 0.5, 1.35),
        np.clip(0.1 * (TIME - 100.0), 0.0, 3.0),
    ],
    ids=["smooth", "quantised", "noisy", "still", "a step", "a ramp"],
)
@pytest.mark.parametrize("by", [0.5, -0.5, 5.0])
def test_a_spike_is_found_in_any_signal_and_nothing_else(signal, by) -> None:
    assert column("depth_m", signal) == []
    assert column("depth_m", spiked(signal, [50, 333], by)) == [50, 333]


@pytest.mark.parametrize("seed", range(10))
def test_a_tenth_of_gross_outliers_is_mostly_found(seed) -> None:
    rng = np.random.default_rng(seed)
    bad = rng.random(600) < 0.1
    values = DIVE + 0.002 * rng.standard_normal(600)
    values[bad] += rng.choice([-1.0, 1.0], bad.sum()) * rng.uniform(0.5, 3.0, bad.sum())
    found = spikes("depth_m", values, TIME, ())
    alone = bad & ~np.roll(bad, 1) & ~np.roll(bad, -1)
    assert (found & alone).sum() > 0.75 * alone.sum()
    assert (found & ~bad).sum() < 0.02 * 600


def test_noise_alone_is_no_spike() -> None:
    rng = np.random.default_rng(2)
    found = 0
    for _ in range(40):
        for values in (
            rng.standard_normal(2000),
            np.cumsum(rng.standard_normal(2000)),
            np.round(rng.standard_normal(2000)),
            rng.laplace(size=2000),
        ):
            found += len(column("depth_m", values, np.arange(2000.0)))
    assert found <= 8  # of 320,000, most of them of the heavy tails of Laplace


@pytest.mark.parametrize("period", [2, 3, 4, 5, 8])
def test_an_oscillation_is_no_spike(period: int) -> None:
    k = np.arange(400)
    wave = np.sin(2.0 * np.pi * (k + 0.25) / period)
    assert column("piston_m", wave, k * 1.0) == []
    burst = np.where((k > 150) & (k < 190), wave, 0.0)
    assert column("piston_m", burst, k * 1.0) == []


def test_a_piston_that_moves_at_its_full_rate_and_turns_is_no_spike() -> None:
    rate, still = 2.44e-3 * 0.5, np.zeros(100)
    out = rate * np.arange(6)
    moves = np.concatenate([still, out, out[::-1], still, out, out[::-1], still])
    assert column("piston_m", moves, 0.5 * np.arange(len(moves))) == []


def test_flicker_of_one_quantum_is_no_spike() -> None:
    still = np.full(600, 1.5)
    for at in ([300], [100, 300], list(range(10, 590, 7))):
        assert column("depth_m", spiked(still, at, 0.0048)) == []


@pytest.mark.parametrize("pulse", [[100], [100, 101], list(range(50, 500, 30))])
def test_pulses_of_voltage_are_no_spikes(pulse) -> None:
    assert column("voltage_V", spiked(np.zeros(600), pulse, 12.0)) == []
    assert column("voltage_V", spiked(12.0 * np.sign(np.sin(TIME)), pulse, -8.0)) == []
    wild = spiked(spiked(np.zeros(600), pulse, 12.0), [300], 500.0)
    assert column("voltage_V", spiked(wild, 420, 4.0)) == [300]


def test_beside_a_gap_or_a_hole_nothing_is_judged() -> None:
    time = np.where(TIME > 100.0, TIME + 60.0, TIME)
    at = int(np.flatnonzero(TIME > 100.0)[0])
    gap = [(float(time[at - 1]), float(time[at]))]
    for k in (at - 1, at):
        assert column("depth_m", spiked(DIVE, k, 2.0), time) == [k]
        assert column("depth_m", spiked(DIVE, k, 2.0), time, gap) == []
    assert column("depth_m", spiked(DIVE, at + 2, 2.0), time, gap) == [at + 2]
    holes = spiked(DIVE, [200, 300], 2.0)
    holes[199] = np.nan
    assert column("depth_m", holes) == [300]


@pytest.mark.parametrize("count", range(12))
def test_a_short_log_is_judged_by_nine_samples_or_not_at_all(count: int) -> None:
    values = np.zeros(count)
    if count:
        values[count // 2] = 3.0
    assert column("depth_m", values, np.arange(count)) == ([count // 2] if count >= 9 else [])


def lines(depth, time=TIME, extra=""):
    rows = "".join(f"{t!r},{z!r},{z!r}\n" for t, z in zip(time.tolist(), depth, strict=True))
    return f"time_s,depth_m,piston_m\n{rows}{extra}"


def test_spikes_are_reported_and_kept_or_dropped(tmp_path: Path) -> None:
    path = write(tmp_path, lines(spiked(DIVE, [50, 60, 70, 80], 2.0).tolist()))
    log = read_log(path)
    assert np.flatnonzero(log.suspect).tolist() == [50, 60, 70, 80]
    for name in ("depth_m", "piston_m"):
        assert (
            f"4 single samples of {name} far off the others, on line 52, 62, 72, ...: kept; "
            'spikes = "drop" would leave them out'
        ) in log.report
    dropped = read_log(path, log_format=LogFormat(spikes="drop"))
    assert len(dropped) == 596
    assert not dropped.suspect.any()
    assert dropped.depth == pytest.approx(np.delete(DIVE, [50, 60, 70, 80]))
    assert any(note.endswith("72, ...: dropped") for note in dropped.report)


def test_gaps_are_listed_and_reported(tmp_path: Path) -> None:
    kept = np.ones(600, dtype=bool)
    kept[100:120] = kept[300:340] = kept[500] = False
    path = write(tmp_path, lines(DIVE[kept].tolist(), TIME[kept]))
    log = read_log(path)
    assert log.gaps == ((49.5, 60.0), (149.5, 170.0))
    assert (
        "2 gaps of more than 2.5 s, 31 s in all: 10.5 s after 49.5 s (line 101), 20.5 s after "
        "149.5 s (line 281)"
    ) in log.report
    assert read_log(path, log_format=LogFormat(gap=0.8)).gaps == (
        (49.5, 60.0),
        (149.5, 170.0),
        (249.5, 250.5),
    )
    assert read_log(path, log_format=LogFormat(gap=30.0)).gaps == ()


def test_a_log_that_says_nothing_of_suspects_has_none(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, "time_s,depth_m\n0,1\n1,2\n"))
    assert log.suspect.tolist() == [False, False]
    assert log.gaps == ()


@pytest.mark.data
def test_measured_logs_have_next_to_no_spikes(data_dir: Path) -> None:
    """A float at 2 Hz with a quantum of 4.8 mm, whose one spike is a splash at the surface."""
    import pandas as pd

    frame = pd.read_csv(data_dir / "ntnu_bv" / "missions.csv.gz")
    found = {}
    for number, log in frame.groupby("log"):
        time = log["t_s"].to_numpy(float)
        for name, source in (("depth_m", "depth_raw_m"), ("piston_m", "piston_position_m")):
            at = column(name, log[source].to_numpy(float), time)
            found |= {(number, name): at} if at else {}
    assert found == {(57, "depth_m"): [3]}


@pytest.mark.data
def test_a_motor_bench_at_full_speed_has_no_spikes(data_dir: Path) -> None:
    import pandas as pd

    frame = pd.read_parquet(data_dir / "ufloat_motor" / "cycles.parquet", engine="pyarrow")
    for _, log in frame.groupby("log"):
        inch = log["position_in"].to_numpy(float)
        assert column("piston_m", 0.0254 * inch, log["t_s"].to_numpy(float)) == []
