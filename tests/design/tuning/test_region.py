"""The region of vehicles, against the covariance that it comes from."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from swimbladder.design.tuning.region import NEUTRAL, region
from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import plant
from swimbladder.vehicle import Identified

FEUP = load_vehicle("feup-em")
COVARIANCE = (
    (80.0**2, 0.9 * 80.0 * 0.5, 0.0),
    (0.9 * 80.0 * 0.5, 0.5**2, 0.0),
    (0.0, 0.0, 1e-14),
)


def identified(**changes):
    known = Identified(
        names=("K2", "T2", "psi"),
        values=(7935.54, 36.3, 4.04e-6),
        covariance=COVARIANCE,
        neutral_std=0.5e-6,
        logs=("a", "b"),
    )
    return FEUP.model_copy(update={"identified": known.model_copy(update=changes)})


def test_points_of_the_boundary_are_at_the_distance_that_holds_95_percent():
    found = region(identified())
    C = np.linalg.inv(np.array(COVARIANCE) * np.outer([1, 1, 1e6], [1, 1, 1e6]))
    nominal = plant(FEUP)
    assert found.plants[0] == nominal
    for p in found.plants[1:]:
        # Back from the plant: 1/T2 = d_l, K2 = a_b T2.
        K2, T2 = p.a_b / p.d_l, 1.0 / p.d_l
        off = np.array([K2 - 7935.54, T2 - 36.3, 1e6 * (p.psi - 4.04e-6)])
        assert off @ C @ off == pytest.approx(chi2.ppf(0.95, 3), rel=1e-6)
        assert p.a_s / p.a_b == pytest.approx(nominal.a_s / nominal.a_b)
    assert found.neutral == max(NEUTRAL, 1e-6)
    assert "95 % region" in found.words[0]


def test_without_an_identification_K2_and_T2_are_within_5_percent():
    found = region(FEUP)
    K2 = np.array([p.a_b / p.d_l for p in found.plants]) / 7935.54
    T2 = np.array([1.0 / p.d_l for p in found.plants]) / 36.3
    for share in (K2, T2):
        assert share.min() == pytest.approx(0.95)
        assert share.max() == pytest.approx(1.05)
    corners = {(round(k, 6), round(t, 6)) for k, t in zip(K2, T2, strict=True)}
    assert {(0.95, 0.95), (0.95, 1.05), (1.05, 0.95), (1.05, 1.05)} <= corners


def test_mass_and_drag_of_a_turbulent_vehicle_move_as_identified():
    base = load_vehicle("ntnu-bv")
    mass, k_dt = base.mass, base.drag.k_dt
    known = Identified(
        names=("mass", "drag_quadratic"),
        values=(mass, k_dt),
        covariance=((0.01 * mass**2, 0.0), (0.0, 0.04 * k_dt**2)),
        logs=("a",),
    )
    found = region(base.model_copy(update={"identified": known}), drawn=0)
    radius = math.sqrt(chi2.ppf(0.95, 2))
    heavy = [p.a_b for p in found.plants]
    assert min(heavy) == pytest.approx(heavy[0] / (1.0 + 0.1 * radius), rel=1e-9)
    turbulent = [p.d_t / p.a_b for p in found.plants]
    assert max(turbulent) == pytest.approx(turbulent[0] * (1.0 + 0.2 * radius), rel=1e-9)
