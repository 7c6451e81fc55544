"""Predictions ahead: causal, as good as they say, and better than what knows less."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from swimbladder.cli import main
from swimbladder.errors import InputError, LogError
from swimbladder.estimation.comparison.ahead import Tuning, predict_ahead
from swimbladder.io.config import load_vehicle
from swimbladder.io.files import write_csv
from swimbladder.io.logs import Log
from swimbladder.sim.closed_loop import drive
from tests.quoted import refused

VEHICLE = load_vehicle("ntnu-bv")
NOISE, WALK = 4e-3, 0.05e-6


def made(seed, *, span=240.0, depth=12.0):
    """A log of the vehicle itself under water, its neutral volume walking; volumes stepped about.

    A volume that follows minus the walk moves the vehicle as the walk itself would.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, span, 0.5)
    walk = np.cumsum(rng.normal(0.0, WALK * math.sqrt(0.5), len(time)))
    push = 2e-6 * np.repeat(rng.normal(0.0, 1.0, 1 + len(time) // 20), 20)[: len(time)]
    push = push - push.mean()
    volume = VEHICLE.neutral_volume(depth) + push
    truth = drive(VEHICLE, time=time, volume=volume - walk, start_depth=depth)
    assert truth.depth.min() > 0.5
    measured = truth.depth + rng.normal(0.0, NOISE, len(time))
    return Log(
        source="made.csv",
        time=time,
        depth=measured,
        volume=volume,
        volume_absolute=True,
        line=np.arange(len(time)),
    ), truth.depth


@pytest.fixture(scope="module")
def outcome():
    log, _ = made(3)
    return predict_ahead(log, VEHICLE, horizons=(10.0, 60.0)), log


def test_the_numbers_are_those_of_the_arrays(outcome):
    ahead, log = outcome
    for h, seconds in zip(ahead.horizons, (10.0, 60.0), strict=True):
        assert h.seconds == seconds
        np.testing.assert_allclose(log.time[h.target] - log.time[h.origin], seconds)
        off = h.predicted - log.depth[h.target]
        stay = log.depth[h.origin] - log.depth[h.target]
        assert h.n == len(off) == (log.time <= log.time[-1] - seconds).sum()
        assert h.rms == pytest.approx(np.sqrt(np.mean(off**2)))
        assert h.bias == pytest.approx(off.mean())
        assert h.persistence_rms == pytest.approx(np.sqrt(np.mean(stay**2)))
        assert h.skill["persistence"] == pytest.approx(1.0 - h.rms / h.persistence_rms)
        assert h.coverage == pytest.approx(np.mean(np.abs(off) < 1.959964 * h.std))


def test_the_model_that_made_the_log_predicts_it_better_than_what_knows_less(outcome):
    ahead, _ = outcome
    for h in ahead.horizons:
        assert h.skill["persistence"] > 0.4
        assert h.skill["integrator"] > 0.3


def test_the_band_holds_what_it_promises():
    """Over several logs; the errors within one are alike."""
    runs = [predict_ahead(made(seed)[0], VEHICLE, horizons=(10.0,)) for seed in range(20, 26)]
    held = np.mean([run.horizons[0].coverage for run in runs])
    assert 0.90 < held <= 1.0
    told = [run.noise["depth_noise"] for run in runs]
    assert np.mean(told) == pytest.approx(math.hypot(NOISE, 4.83e-3 / math.sqrt(12)), rel=0.3)


def test_what_comes_after_an_instant_changes_no_prediction_from_it(outcome):
    """Only the volume is known ahead: other depths later on leave the prediction as it is."""
    ahead, log = outcome
    h = ahead.horizons[0]
    cut = int(h.origin[len(h.origin) // 2])
    depth = log.depth.copy()
    depth[cut + 1 :] += np.random.default_rng(0).normal(0.0, 0.2, len(depth) - cut - 1)
    other = predict_ahead(replace(log, depth=depth), VEHICLE, horizons=(10.0,)).horizons[0]
    past = h.origin <= cut
    np.testing.assert_array_equal(other.origin[past], h.origin[past])
    np.testing.assert_allclose(other.predicted[past], h.predicted[past], rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.std[past], h.std[past], rtol=1e-9)
    assert np.abs(other.predicted[~past] - h.predicted[~past]).max() > 1e-3


def test_noise_that_is_given_is_used():
    log, _ = made(5, span=60.0)
    given = Tuning(depth_noise=5e-3, random_walk=0.1e-6, acceleration_noise=1e-4)
    ahead = predict_ahead(log, VEHICLE, horizons=(10.0,), tuning=given)
    assert ahead.noise == pytest.approx(given._asdict())
    assert set(ahead.origins.values()) == {"given"}


def test_noise_that_was_identified_is_used():
    log, _ = made(5, span=60.0)
    table = {
        "names": ("psi",),
        "values": (VEHICLE.hull.psi,),
        "covariance": ((1e-16,),),
        "depth_noise": 5e-3,
        "random_walk": 0.1e-6,
        "acceleration_noise": 1e-4,
    }
    vehicle = type(VEHICLE).model_validate(VEHICLE.model_dump() | {"identified": table})
    ahead = predict_ahead(log, vehicle, horizons=(10.0,))
    assert ahead.noise["depth_noise"] == pytest.approx(5e-3, rel=0.5)
    assert "[identified]" in ahead.origins["random_walk"]
    assert ahead.noise["random_walk"] == pytest.approx(0.1e-6, rel=1.0)


def test_what_cannot_be_is_refused():
    log, _ = made(5, span=60.0)
    with refused(InputError, field="horizons", value=100.0) as caught:
        predict_ahead(log, VEHICLE, horizons=(100.0,))
    assert caught.value.field == "horizons"
    with refused(InputError, field="horizons", value=0.1):
        predict_ahead(log, VEHICLE, horizons=(0.1,))
    with refused(InputError, field="random_walk", value=-1.0):
        predict_ahead(log, VEHICLE, horizons=(10.0,), tuning=Tuning(random_walk=-1.0))
    with refused(LogError, field="volume"):
        predict_ahead(replace(log, volume=None), VEHICLE)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    log, _ = made(6, span=80.0)
    path = tmp_path_factory.mktemp("made") / "made.csv"
    write_csv(path, {"time_s": log.time, "depth_m": log.depth, "volume_m3": log.volume})
    return path


def test_the_command_tells_and_writes_it(written, tmp_path, capsys):
    arguments = ["compare", str(written), "--vehicle", "ntnu-bv", "--horizons", "5 s,20 s"]
    assert main([*arguments, "--out", str(tmp_path), "--plot", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["ahead"]
    assert [h["seconds"] for h in told["horizons"]] == [5.0, 20.0]
    assert set(told["noise"]) == {"depth_noise", "random_walk", "acceleration_noise"}
    header, *lines = (tmp_path / "compare-ahead.csv").read_text().splitlines()
    assert "depth_predicted_5s_m" in header
    columns = dict(
        zip(header.split(","), np.array([x.split(",") for x in lines], float).T, strict=True)
    )
    off = (columns["depth_predicted_20s_m"] - columns["depth_m"])[40:]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(told["horizons"][1]["rms_m"])
    assert (tmp_path / "compare-ahead.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"

    assert main([*arguments, "--out", str(tmp_path), "--random-walk", "0.1 cm3/s^0.5"]) == 0
    shown = capsys.readouterr().out
    assert "0.1 cm3/s^0.5" in shown
    assert (
        main([*arguments, "--out", str(tmp_path), "--random-walk", "0.1 cm3/s^0.5", "--json"]) == 0
    )
    given = json.loads(capsys.readouterr().out)["ahead"]["noise"]["random_walk"]
    assert given["value"] == pytest.approx(1e-7)
    assert given["origin"] == "given"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--horizons", "soon"], "--horizons"),
        (["--horizons", "-5 s"], "times ahead"),
        (["--horizons", "5 s,5 s"], "times ahead"),
        (["--horizons", "5 m"], "another kind"),
        (["--random-walk", "1 cm3/s^0.5"], "belongs to --horizons"),
        (["--horizons", "5 s", "--random-walk", "1 cm3"], "--random-walk"),
        (["--horizons", "5 s", "--depth-noise", "-1 mm"], "--depth-noise"),
    ],
)
def test_the_command_refuses(written, tmp_path, capsys, options, words):
    out = tmp_path / "none"
    assert main(["compare", str(written), "--vehicle", "ntnu-bv", "--out", str(out), *options]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not out.exists()
