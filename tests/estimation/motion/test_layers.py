"""Parameters from logs in layered water: the truth is found with the cast, not without it."""

from dataclasses import replace

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.estimation.comparison.record import record
from swimbladder.estimation.motion import identify
from swimbladder.estimation.motion.problem import Assumed, posed
from swimbladder.estimation.motion.process_noise import fit_process_noise
from tests.layered import SEA, G, column, sailed, vehicle
from tests.quoted import refused

VEHICLE, COLUMN = vehicle(), column()
TRUTH = {
    "K2": SEA * G / VEHICLE.drag.k_dl,
    "T2": VEHICLE.mass / VEHICLE.drag.k_dl,
    "psi": VEHICLE.hull.psi,
}


@pytest.fixture(scope="module")
def logs():
    return [
        sailed(VEHICLE, seed=5, error=0.4e-6),
        sailed(VEHICLE, seed=6, error=-0.3e-6, pushes=(10.0, 22.0, 30.0, -3.0, 12.0, -6.0, 3.0)),
    ]


def test_the_parameters_are_found_with_their_intervals(logs):
    found = identify(logs, VEHICLE, casts=[COLUMN], profiles=False, choices=False)
    assert found.identified
    for name, truth in TRUTH.items():
        e = found.parameters[name]
        assert e.value == pytest.approx(truth, abs=3.5 * e.std)
        assert e.std < 0.02 * truth or name == "psi"
    assert found.depth_noise == pytest.approx(3e-3, rel=0.2)
    assert any("follows the density of the cast" in said for said in found.assumptions)
    for e, error in zip(found.experiments, (0.4e-6, -0.3e-6), strict=True):
        assert e.estimates["neutral_error"].value == pytest.approx(error, abs=0.15e-6)


def test_a_hole_in_the_cast_is_in_the_intervals(logs):
    """Its straight line is off by the end of the halocline: psi was six deviations off."""
    rows = (COLUMN.depth <= 1.8) | (COLUMN.depth >= 3.5)
    straight = np.interp(COLUMN.depth, COLUMN.depth[rows], COLUMN.density[rows])
    unsure = np.where(rows, 0.0, 0.02)
    holed = replace(COLUMN, density=straight, density_std=unsure)
    found = identify(logs, VEHICLE, casts=[holed], profiles=False, choices=False)
    assert "holes" in [f.kind for f in found.findings]
    for name, truth in TRUTH.items():
        e = found.parameters[name]
        assert e.value == pytest.approx(truth, abs=3.5 * e.std)
    deeper = replace(COLUMN, density_std=np.where(COLUMN.depth > 5.0, 1.0, 0.0))
    known = identify(logs[:1], VEHICLE, casts=[deeper], profiles=False, choices=False)
    assert "holes" not in [f.kind for f in known.findings]


def test_without_the_cast_drag_takes_the_blame(logs):
    # on the way the search tries models that leave the water
    plain = identify(logs[:1], VEHICLE, profiles=False, choices=False, neutral_std=50e-6)
    assert plain.parameters["K2"].value < 1e-3 * TRUTH["K2"]
    assert plain.process_noise is not None  # nor does it move as the model has it
    assert not plain.identified


def test_the_innovations_say_so_too(logs):
    """One likelihood of all depths, with the cast and without: e^100 of evidence."""
    fits = [
        fit_process_noise(
            posed(
                [record(log, VEHICLE, drive="volume", column=water) for log in logs],
                VEHICLE,
                Assumed(),
            ),
            VEHICLE,
        )
        for water in (COLUMN, None)
    ]
    assert fits[0].log_likelihood > fits[1].log_likelihood + 100.0
    for name in ("K2", "T2"):
        e = fits[0].estimates[name]
        assert e.value == pytest.approx(TRUTH[name], abs=3.5 * e.std)
    assert not fits[0].drifts


def test_one_cast_or_one_for_each_log(logs):
    with refused(InputError, field="cast", holds={2.0, 3.0}):
        identify(logs, VEHICLE, casts=[COLUMN] * 3)
