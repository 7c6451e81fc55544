"""How logs differ: found where they do, not where they do not, and used by what predicts."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.ahead import Tuning, unknowns
from swimbladder.estimation.comparison.record import Record
from swimbladder.estimation.motion.result import FEWEST, between_logs
from swimbladder.io.config import load_vehicle, read_model
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.vehicle import Vehicle
from tests.quoted import refused

WEIGHT = 1000.0 * 9.80665
MASS, K_DL, PSI = 40.0, 1.2, 3e-6
NOISE = 4e-3


def vehicle():
    base = load_vehicle("feup-em").model_dump()
    base["motion"] = {"kind": "identified", "K2": WEIGHT / K_DL, "T2": MASS / K_DL}
    base["hull"]["psi"] = PSI
    base["identified"] = {
        "names": ("K2", "T2", "psi"),
        "values": (WEIGHT / K_DL, MASS / K_DL, PSI),
        "covariance": ((1e4, 0.0, 0.0), (0.0, 0.04, 0.0), (0.0, 0.0, 1e-16)),
        "depth_noise": NOISE,
        "random_walk": 1e-7,
        "acceleration_noise": 1e-4,
    }
    return Vehicle.model_validate(base)


def made(seed, *, psi=PSI, share=1.0, drift=0.0, n=240, h=0.5):
    """A dive from 30 m under volumes that are stepped about, by matrix exponentials."""
    rng = np.random.default_rng(seed)
    a = WEIGHT / MASS
    A = np.zeros((5, 5))  # z, w, V0, V, dV/dt
    A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[1, 3] = 1.0, a * psi, -share * K_DL / MASS, a, -a
    A[3, 4] = 1.0
    F = expm(A * h)
    steps = rng.normal(0.0, 15e-6, 1 + n // 20).repeat(20)[:n]
    volume = psi * 30.0 + steps - steps.mean()
    x = np.array([30.0, 0.0, 0.0])
    depth = np.empty(n)
    for k in range(n):
        depth[k] = x[0]
        if k < n - 1:
            ramp = [volume[k], (volume[k + 1] - volume[k]) / h]
            x = (F @ np.append(x, ramp))[:3]
            x[2] += drift * h
    return Record(
        drive="volume",
        time=np.arange(n) * h,
        depth=depth + rng.normal(0.0, NOISE, n),
        volume=volume,
        volume_absolute=True,
        compared=np.ones(n, bool),
        bottom_depth=math.inf,
    )


@pytest.fixture(scope="module")
def alike():
    return between_logs([made(seed) for seed in range(8)], vehicle())


@pytest.fixture(scope="module")
def different():
    rng = np.random.default_rng(1)
    spread = {"psi": 6e-6, "share": 0.35, "drift": 3e-8}
    logs = [
        made(
            seed,
            psi=PSI + spread["psi"] * rng.normal(),
            share=math.exp(spread["share"] * rng.normal()),
            drift=spread["drift"] * rng.normal(),
        )
        for seed in range(10)
    ]
    return between_logs(logs, vehicle()), spread


def test_logs_that_differ_are_found_to_differ(different, alike):
    found, spread = different
    between, same = found.identified.between, alike.identified.between
    assert between.psi == pytest.approx(spread["psi"], rel=0.5)
    assert between.drag == pytest.approx(spread["share"], rel=0.5)
    assert between.neutral_drift_std == pytest.approx(spread["drift"], rel=0.6)
    assert same.psi < 0.6 * between.psi
    assert same.drag < 0.5 * between.drag
    assert same.neutral_drift_std < 0.7 * between.neutral_drift_std


def test_the_means_stay_where_all_logs_agree(alike):
    before = vehicle()
    assert alike.hull.psi == pytest.approx(before.hull.psi, abs=1.5e-6)
    assert alike.drag.k_dl == pytest.approx(before.drag.k_dl, rel=0.1)
    assert alike.mass == pytest.approx(before.mass, rel=1e-12)
    assert alike.identified.depth_noise == pytest.approx(NOISE, rel=0.2)


def test_the_table_and_the_vehicle_say_the_same(different):
    found, _ = different
    log_likelihood = dict(zip(found.identified.names, found.identified.values, strict=True))
    assert log_likelihood["K2"] == pytest.approx(WEIGHT / found.drag.k_dl, rel=1e-12)
    assert log_likelihood["T2"] == pytest.approx(found.mass / found.drag.k_dl, rel=1e-12)
    assert log_likelihood["psi"] == found.hull.psi
    # means of ten logs are known no better than a tenth of the variance between them
    C = np.array(found.identified.covariance)
    between = found.identified.between
    assert C[2, 2] == pytest.approx(1e-16 + between.psi**2 / 10, rel=1e-9)
    assert C[0, 0] > (between.drag * log_likelihood["K2"]) ** 2 / 10
    assert np.linalg.eigvalsh(C / np.sqrt(np.outer(np.diag(C), np.diag(C)))).min() > 0.0
    assert read_model(Vehicle, vehicle_file(found), "written.toml") == found


def test_what_predicts_takes_it_from_the_table(different):
    found, _ = different
    between = found.identified.between
    u, origins = unknowns(found, Tuning(random_walk=2e-7))
    assert (u.psi.mean, u.psi.std) == (found.hull.psi, between.psi)
    assert u.drag.std == between.drag
    assert u.drift == (between.neutral_drift, between.neutral_drift_std)
    assert u.random_walk == (math.log(2e-7), 0.0)
    assert u.acceleration_noise.std == between.acceleration_noise
    assert origins["random_walk"] == "given"


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match=f"Give {FEWEST} or more"):
        between_logs([made(1)] * 3, vehicle())
    with refused(InputError, field="identified"):
        between_logs([made(1)] * 4, load_vehicle("feup-em"))
