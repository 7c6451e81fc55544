"""Ballast: Archimedes for what is added, normal tails and simulated vehicles for how sure it is."""

import gsw
import numpy as np
import pytest
from scipy.stats import norm

from swimbladder.design.ballast import (
    Target,
    Uncertainty,
    ballast_in,
    ballasted,
    drawn_volumes,
    sensitivities,
    uncertainty_of,
)
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.physics.hull import displaced_volume, neutral_volume, weight_mass
from swimbladder.physics.seawater import Cast, Column, cast_column, uniform_column
from swimbladder.vehicle import Hull, HullPart, Identified
from tests.quoted import refused

LEAD = 11340.0
KNOWN = Uncertainty()


def sea(deepest=800.0, warm=20.0, name="summer"):
    p = np.arange(0.0, deepest * 1.02, 2.0)
    SA, CT = 35.0 + 0.5 * np.tanh(p / 200.0), 4.0 + (warm - 4.0) * np.exp(-p / 150.0)
    return cast_column(Cast(pressure=p, SA=SA, CT=CT, latitude=20.0, name=name), deepest)


SEA = sea()
FLOAT = load_vehicle("example-eh")


def with_parts():
    parts = (
        HullPart(
            name="tube",
            volume="43.4 L",
            compressibility=2.6e-10,
            thermal_expansion=7e-5,
            stiffening=1e-17,
        ),
        HullPart(name="oil", volume="0.5 L", compressibility=7e-10, thermal_expansion=7e-4),
    )
    hull = FLOAT.hull.model_dump() | {"parts": parts, "trapped_air": 8e-5}
    return FLOAT.model_copy(update={"hull": Hull.model_validate(hull)})


def force(vehicle, column, depth, volume, added, density, emerged=0.0):
    """Weight less what the water carries [kg], from the parts, without the module's own sums."""
    p, T, rho = (
        np.interp(depth, column.depth, v)
        for v in (column.pressure, column.temperature, column.density)
    )
    displaced = float(displaced_volume(vehicle, p, T)) + volume + added / density - emerged
    return weight_mass(vehicle) + added - rho * displaced


@pytest.mark.parametrize("vehicle", [FLOAT, with_parts()], ids=["psi", "parts"])
@pytest.mark.parametrize("density", [LEAD, 2700.0, float("inf")])
@pytest.mark.parametrize("volume", [0.0, 1e-4])
def test_what_is_added_makes_it_neutral_where_it_is_wished(vehicle, density, volume):
    target = Target(neutral_depth=500.0, neutral_volume=volume)
    found = ballast_in(
        vehicle, [SEA], target=target, uncertainty=KNOWN, material=(density, ""), draws=1
    )
    assert force(vehicle, SEA, 500.0, volume, found.added, density) == pytest.approx(0.0, abs=1e-6)
    # and so says the vehicle that is written for the other commands
    made = neutral_volume(found.vehicle, SEA)
    assert np.interp(500.0, SEA.depth, made) == pytest.approx(volume, abs=1e-10)


def test_what_stands_outside_displaces_and_has_to_be_heavier():
    target = Target(neutral_depth=500.0)
    known = {"target": target, "uncertainty": KNOWN, "draws": 1}
    inside = ballast_in(FLOAT, [SEA], material=(float("inf"), "inside"), **known)
    lead = ballast_in(FLOAT, [SEA], **known)
    rho = float(np.interp(500.0, SEA.depth, SEA.density))
    assert lead.added / inside.added == pytest.approx(1.0 / (1.0 - rho / LEAD), rel=1e-9)


def test_the_hull_stands_out_of_the_water_as_far_as_wished():
    target = Target(freeboard=0.01)
    found = ballast_in(FLOAT, [SEA], target=target, uncertainty=KNOWN, draws=1)
    out = 0.01 * FLOAT.hull.waterplane_area
    rest = force(FLOAT, SEA, 0.0, FLOAT.stroke.maximum, found.added, LEAD, emerged=out)
    assert rest == pytest.approx(0.0, abs=1e-6)
    assert found.freeboard == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("vehicle", [FLOAT, with_parts()], ids=["psi", "parts"])
def test_another_water_in_the_file_changes_nothing_about_the_vehicle(vehicle):
    made = ballasted(vehicle, 0.0, LEAD, SEA)
    assert made.water.density == SEA.density[0]
    assert weight_mass(made) == pytest.approx(weight_mass(vehicle), rel=1e-12)
    for column in (SEA, sea(warm=10.0)):
        np.testing.assert_allclose(
            neutral_volume(made, column), neutral_volume(vehicle, column), rtol=0, atol=1e-11
        )


def test_ballast_added_outside_neither_gives_way_nor_changes_the_rest():
    vehicle = with_parts()
    made = ballasted(vehicle, 0.5, LEAD, SEA)
    due = neutral_volume(vehicle, SEA) + 0.5 / SEA.density - 0.5 / LEAD
    np.testing.assert_allclose(neutral_volume(made, SEA), due, rtol=0, atol=1e-11)
    assert made.hull.parts[-1].name == "added ballast"
    assert made.motion.dry_mass == vehicle.motion.dry_mass + 0.5
    lighter = ballasted(vehicle, -0.5, LEAD, SEA)
    due = neutral_volume(vehicle, SEA) - 0.5 / SEA.density + 0.5 / LEAD
    np.testing.assert_allclose(neutral_volume(lighter, SEA), due, rtol=0, atol=1e-11)


# How sure: normal tails where one depth decides, and vehicles simulated by another way.


def test_one_unknown_at_one_depth_has_normal_tails():
    column = uniform_column(FLOAT.water, 1000.0, step=10.0)  # neutral at -78 cm3 at 1000 m
    uncertainty = Uncertainty(trim=100e-6)
    target = Target(probability=0.9)
    found = ballast_in(FLOAT, [column], target=target, uncertainty=uncertainty, draws=50_000)
    (need,) = found.needs
    assert (need.least, need.least_depth) == (pytest.approx(-78e-6, abs=1e-8), 1000.0)
    assert (need.most, need.most_depth) == (pytest.approx(0.0, abs=1e-12), 0.0)
    tail = norm.ppf(0.9) * 100e-6
    assert need.margin_in == pytest.approx(172e-6 - tail, abs=3e-6)
    assert need.margin_out == pytest.approx(250e-6 - tail, abs=3e-6)
    due = norm.cdf(2.5) - norm.cdf(-1.72)
    assert need.probability == pytest.approx(due, abs=4e-3)
    assert found.covered == (due >= 0.9)


def test_linearised_spreads_are_those_of_the_drawn_vehicles():
    vehicle = with_parts()
    uncertainty = Uncertainty(
        mass=2e-3, volume=3e-6, trim=1e-6, psi=4e-9, heat=5e-6, air=5e-6, density=0.05
    )
    drawn = drawn_volumes(vehicle, SEA, uncertainty, draws=20_000, seed=3)
    terms = sensitivities(vehicle, SEA, uncertainty)
    spread = np.sqrt(sum(term**2 for term in terms.values()))
    np.testing.assert_allclose(drawn.std(axis=0), spread, rtol=0.02)
    np.testing.assert_allclose(drawn.mean(axis=0), neutral_volume(vehicle, SEA), atol=2e-7)


def as_it_may_be(vehicle, column, uncertainty, rng):
    """One vehicle and sea as they may truly be, by changing their own fields."""
    n = rng.standard_normal(7)
    mass = weight_mass(vehicle) + uncertainty.mass * n[0]
    parts = list(vehicle.hull.parts)
    total = sum(part.volume for part in parts)
    loss = uncertainty.psi * n[3] / vehicle.water.specific_weight
    parts = tuple(
        part.model_copy(
            update={
                "volume": part.volume + uncertainty.volume * n[1] * part.volume / total,
                "compressibility": part.compressibility + loss / total,
                "thermal_expansion": part.thermal_expansion + uncertainty.heat * n[4],
            }
        )
        for part in parts
    )
    air = vehicle.hull.trapped_air + uncertainty.air * n[5]
    hull = vehicle.hull.model_copy(update={"parts": parts, "trapped_air": air})
    truth = vehicle.model_copy(update={"hull": hull})
    dense = Column(
        depth=column.depth,
        pressure=column.pressure,
        temperature=column.temperature,
        density=column.density + uncertainty.density * n[6],
        gravity=column.gravity,
    )
    return neutral_volume(truth, dense, mass=mass) + uncertainty.trim * n[2]


def test_margins_and_probability_hold_for_simulated_vehicles():
    vehicle = with_parts()
    uncertainty = Uncertainty(
        mass=0.03, volume=20e-6, trim=30e-6, psi=3e-8, heat=1e-5, air=1e-5, density=0.3
    )
    found = ballast_in(
        vehicle,
        [SEA],
        target=Target(neutral_depth=300.0, neutral_volume=120e-6, probability=0.9),
        uncertainty=uncertainty,
    )
    (need,) = found.needs
    rng = np.random.default_rng(11)
    runs = 3000
    truths = np.array([as_it_may_be(found.vehicle, SEA, uncertainty, rng) for _ in range(runs)])
    inward = truths.min(axis=1) - vehicle.stroke.minimum
    outward = vehicle.stroke.maximum - truths.max(axis=1)
    noise = 4.0 * np.sqrt(0.9 * 0.1 / runs)
    assert np.mean(inward >= need.margin_in) == pytest.approx(0.9, abs=noise)
    assert np.mean(outward >= need.margin_out) == pytest.approx(0.9, abs=noise)
    holds = np.mean((inward >= 0.0) & (outward >= 0.0))
    assert 0.05 < need.probability < 0.98  # so that the next line can fail
    assert holds == pytest.approx(need.probability, abs=4.0 * np.sqrt(0.25 / runs))
    curve = found.curves[0]
    low, high = (np.interp(SEA.depth, curve.depth, v) for v in (curve.low, curve.high))
    within = (truths >= low) & (truths <= high)
    np.testing.assert_allclose(within.mean(axis=0), 0.9, atol=noise)


def test_the_best_trim_leaves_both_ends_the_same():
    uncertainty = Uncertainty(psi=5e-9, density=0.1)
    found = ballast_in(FLOAT, [SEA], uncertainty=uncertainty)
    again = ballast_in(ballasted(FLOAT, found.best, LEAD, SEA), [SEA], uncertainty=uncertainty)
    assert again.worst.margin_in == pytest.approx(again.worst.margin_out, abs=2e-6)
    assert again.worst.margin == pytest.approx(found.best_margin, abs=2e-6)
    assert abs(again.best) < 0.003


def test_a_speed_takes_volume_at_both_ends():
    still = ballast_in(FLOAT, [SEA], uncertainty=KNOWN, draws=1).worst
    moving = ballast_in(FLOAT, [SEA], target=Target(speed=0.2), uncertainty=KNOWN, draws=1).worst
    # switched drag above epsilon: k_dl eps + k_dt (w^2 - eps^2)
    drag = 0.8 * 0.05 + 16.0 * (0.2**2 - 0.05**2)
    deep = drag / (SEA.density[-1] * SEA.gravity)
    assert still.margin_in - moving.margin_in == pytest.approx(deep, rel=1e-6)
    top = drag / (SEA.density[0] * SEA.gravity)
    assert still.margin_out - moving.margin_out == pytest.approx(top, rel=1e-6)


def test_rising_takes_the_volume_of_its_own_drag():
    drag = FLOAT.drag.model_copy(update={"rising_ratio": 0.6})
    motion = FLOAT.motion.model_copy(update={"drag": drag})
    light = FLOAT.model_copy(update={"motion": motion})
    even, uneven = (
        ballast_in(v, [SEA], target=Target(speed=0.2), uncertainty=KNOWN, draws=1).worst
        for v in (FLOAT, light)
    )
    force = 0.8 * 0.05 + 16.0 * (0.2**2 - 0.05**2)
    spared = 0.4 * force / (SEA.density[0] * SEA.gravity)
    assert uneven.margin_in == pytest.approx(even.margin_in, abs=1e-12)
    assert uneven.margin_out - even.margin_out == pytest.approx(spared, rel=1e-6)


def test_a_freeboard_beside_a_neutral_depth_is_asked_of_the_stroke():
    target = Target(neutral_depth=700.0, freeboard=0.02)
    found = ballast_in(FLOAT, [SEA], target=target, uncertainty=KNOWN, draws=1)
    (need,) = found.needs
    out = 0.02 * FLOAT.hull.waterplane_area
    assert need.most == pytest.approx(found.curves[0].nominal[0] + out)
    assert not found.covered
    assert "too heavy to float with 2 cm of freeboard" in " ".join(found.sentences)
    assert need.margin_out == pytest.approx(FLOAT.stroke.maximum - need.most)


def test_of_several_seas_the_worst_counts():
    cold = sea(warm=6.0, name="winter")
    target = Target(neutral_depth=500.0)
    found = ballast_in(FLOAT, [SEA, cold], target=target, uncertainty=Uncertainty(psi=1e-8))
    alone = ballast_in(FLOAT, [SEA], target=target, uncertainty=Uncertainty(psi=1e-8))
    assert found.worst.margin <= alone.worst.margin
    assert [need.source for need in found.needs] == ["summer", "winter"]


def test_it_says_what_is_short_and_by_how_much():
    made = ballasted(FLOAT, 0.6, LEAD, SEA)
    found = ballast_in(made, [SEA], uncertainty=KNOWN, draws=1)
    assert not found.covered
    words = " ".join(found.sentences)
    assert "does NOT cover it" in words
    assert f"Short by {-1e6 * found.worst.margin_out:.0f} cm3 at the extended end" in words
    assert "take away" in words


def test_what_is_not_known_by_default_and_as_identified():
    uncertainty = uncertainty_of(FLOAT, {})
    assert uncertainty.trim == 0.5e-6
    assert uncertainty.density == 0.1
    assert uncertainty.psi == pytest.approx(0.05 * 1.166e-7, rel=0.01)  # of V_p beta rho g
    assert len(uncertainty.said) == 3
    identified = Identified(
        names=("psi", "mass"),
        values=(1e-8, 50.0),
        covariance=((4e-18, 0.0), (0.0, 1.0)),
        neutral_std=2e-6,
    )
    vehicle = FLOAT.model_copy(update={"identified": identified})
    uncertainty = uncertainty_of(vehicle, {"density": 0.0})
    assert (uncertainty.psi, uncertainty.trim, uncertainty.density) == (
        pytest.approx(2e-9),
        2e-6,
        0.0,
    )
    assert uncertainty_of(vehicle, {"mass": 0.01}).trim == 0.0  # weighed instead
    with refused(InputError, field="psi", value=-1.0, holds={0.0}):
        Uncertainty(psi=-1.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"target": Target(neutral_depth=900.0)}, "not between the surface and 800 m"),
        ({"target": Target(freeboard=2.0)}, "no more than the height of the hull"),
        ({"target": Target(neutral_depth=1.0, neutral_volume=1.0)}, "outside the stroke"),
        ({"target": Target(probability=1.0)}, "probability"),
        ({"target": Target(probability=0.0095)}, "probability"),
        ({"target": Target(speed=10.0)}, "speed: it must be 0 or more and 2 at most"),
        ({"material": (1000.0, "water")}, "not denser than the water"),
    ],
)
def test_wishes_that_make_no_sense_are_refused(options, words):
    with pytest.raises(InputError, match=words) as caught:
        ballast_in(FLOAT, [SEA], uncertainty=KNOWN, draws=1, **options)
    assert caught.value.field in (
        "neutral_depth",
        "freeboard",
        "neutral_volume",
        "probability",
        "speed",
        "material",
    )


def test_a_mass_that_nothing_has():
    light = FLOAT.model_copy(update={"stroke": FLOAT.stroke.model_copy(update={"minimum": -0.04})})
    with pytest.raises(NoAnswerError, match="more than half of the vehicle"):
        ballast_in(
            light,
            [SEA],
            target=Target(neutral_depth=5.0, neutral_volume=-0.04),
            uncertainty=KNOWN,
            draws=1,
            material=(float("inf"), "inside"),
        )


def test_the_surface_of_the_cast_is_the_water_of_gsw():
    assert SEA.density[0] == pytest.approx(gsw.rho(35.0, 20.0, 0.0), abs=1e-9)
