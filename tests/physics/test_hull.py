"""The hull: the paper's psi z in its limit, each law against finite differences and SymPy."""

from contextlib import nullcontext

import numpy as np
import pytest
import sympy
from scipy.integrate import quad

from swimbladder.cli import main
from swimbladder.errors import InputError
from swimbladder.io.config import load_vehicle
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.hull import (
    check_mass,
    displaced_volume,
    hull_parts,
    linear_psi,
    mass_mismatch,
    neutral_volume,
    psi_terms,
    weighing,
    weight_mass,
)
from swimbladder.physics.seawater import Cast, cast_column, uniform_column
from swimbladder.sim.closed_loop import simulate
from swimbladder.vehicle import Hull, HullPart

NAMES = ("example-eh", "example-em", "feup-em", "ntnu-bv")
TUBE = HullPart(name="tube", volume="30 L", compressibility=2.5e-10, thermal_expansion=7e-5)
FOAM = HullPart(name="foam", volume="13.5 L", compressibility=4e-10, thermal_expansion=1e-4)


def cast(deepest=1000.0):
    p = np.arange(0.0, deepest + 1.0)
    SA, CT = 35.0 + 0.5 * np.tanh(p / 200.0), 4.0 + 16.0 * np.exp(-p / 150.0)
    return cast_column(Cast(pressure=p, SA=SA, CT=CT, latitude=20.0))


def with_hull(**changes):
    vehicle = load_vehicle("example-eh")
    given = vehicle.hull.model_dump() | changes
    return vehicle.model_copy(update={"hull": Hull.model_validate(given)})


@pytest.mark.parametrize("name", NAMES)
def test_in_the_papers_water_it_rests_at_psi_z_and_the_trim_error(name):
    vehicle = load_vehicle(name)
    column = uniform_column(vehicle.water, 1000.0, step=10.0)
    due = [vehicle.neutral_volume(z) for z in column.depth]
    np.testing.assert_allclose(neutral_volume(vehicle, column), due, rtol=0, atol=1e-15)
    for z in (0.0, 333.0, 1000.0):
        assert linear_psi(vehicle, column, z) == pytest.approx(vehicle.hull.psi, abs=1e-16)


def test_parts_without_the_rest_are_the_paper_again():
    plain = load_vehicle("example-eh")
    (hull,) = hull_parts(plain)
    given = HullPart(name="one", volume=hull.volume, compressibility=hull.compressibility)
    vehicle = with_hull(parts=(given,))
    column = cast()
    np.testing.assert_array_equal(neutral_volume(vehicle, column), neutral_volume(plain, column))


def test_it_weighs_what_it_displaces_at_the_surface_of_its_own_water():
    vehicle = load_vehicle("example-eh")
    assert weight_mass(vehicle) == pytest.approx(1025.0 * 43.98e-3)
    lighter = vehicle.model_copy(update={"trim_error": 50e-6})
    assert weight_mass(lighter) - weight_mass(vehicle) == pytest.approx(1025.0 * 50e-6)


@pytest.mark.parametrize("changes", [{}, {"parts": (TUBE, FOAM), "displaced_volume": 43.5e-3}])
def test_a_mass_on_the_scale_changes_the_trim_and_nothing_else(changes):
    vehicle = with_hull(**changes)
    heavier = weighing(vehicle, weight_mass(vehicle) + 0.2)
    assert weight_mass(heavier) == pytest.approx(weight_mass(vehicle) + 0.2, rel=1e-12)
    column = cast()
    due = neutral_volume(vehicle, column, mass=weight_mass(vehicle) + 0.2)
    np.testing.assert_allclose(neutral_volume(heavier, column), due, rtol=0, atol=1e-12)


def test_the_water_carries_the_weight_wherever_it_rests():
    vehicle = with_hull(parts=(TUBE, FOAM), displaced_volume=43.6e-3, trapped_air=1e-4)
    column = cast()
    volume = neutral_volume(vehicle, column)
    displaced = displaced_volume(vehicle, column.pressure, column.temperature) + volume
    np.testing.assert_allclose(column.density * displaced, weight_mass(vehicle), rtol=1e-13)
    heavier = neutral_volume(vehicle, column, mass=weight_mass(vehicle) + 0.1)
    np.testing.assert_allclose(heavier - volume, 0.1 / column.density, rtol=1e-9)


def test_parts_have_their_volume_at_the_reference_temperature_and_grow_in_the_heat():
    vehicle = with_hull(parts=(TUBE,), displaced_volume=30e-3, reference_temperature=12.0)
    for T in (2.0, 12.0, 32.0):
        due = 30e-3 * (1.0 + 7e-5 * (T - 12.0))
        assert float(displaced_volume(vehicle, 0.0, T)) == pytest.approx(due, rel=1e-12)


def test_a_mass_that_no_water_carries_is_refused():
    """From half of what is displaced to four times that, water that moves along included."""
    vehicle = load_vehicle("ntnu-bv")
    weighs = weight_mass(vehicle)
    for share, well in ((0.49, False), (0.51, True), (3.9, True), (4.1, False)):
        motion = vehicle.motion.model_copy(update={"dry_mass": share * weighs})
        heavy = vehicle.model_copy(update={"motion": motion})
        said = "sinks in any water" if share > 1.0 else "floats in any water"
        with nullcontext() if well else pytest.raises(InputError, match=said):
            check_mass(heavy)


@pytest.mark.parametrize(
    ("share", "said"), [(1.0, ""), (1.2, "wrong by 20 %"), (0.8, "wrong by 20 %")]
)
def test_a_dry_mass_that_contradicts_the_trim_is_said(share, said):
    vehicle = load_vehicle("ntnu-bv")
    motion = vehicle.motion.model_copy(update={"dry_mass": share * weight_mass(vehicle)})
    found = mass_mismatch(vehicle.model_copy(update={"motion": motion}))
    assert (found == "") == (said == "")
    assert said in found


def test_boyle_and_gay_lussac():
    vehicle = with_hull(trapped_air=1e-4)
    solid = with_hull(displaced_volume=43.98e-3 - 1e-4, psi=vehicle.hull.psi)
    (part,) = hull_parts(vehicle)
    for p, T in ((0.0, 15.0), (101325.0, 15.0), (9.0 * 101325.0, 4.0)):
        rest = part.volume * (1.0 - part.compressibility * p)
        air = float(displaced_volume(vehicle, p, T)) - rest
        # p V/T is the same everywhere
        constant = air * (p + 101325.0) / (T + 273.15)
        assert constant == pytest.approx(1e-4 * 101325.0 / 288.15, rel=1e-6)
    assert solid.hull.trapped_air == 0.0


def test_the_terms_of_psi_are_the_derivatives_by_sympy():
    z, V, beta, alpha, air, rho0, a, g, T0, c, p_a, T_r, m = sympy.symbols(
        "z V beta alpha air rho0 a g T0 c p_a T_r m", positive=True
    )
    # a water whose density, pressure and temperature are linear in depth
    rho, p, T = rho0 + a * z, g * z, T0 - c * z
    hull = V * (1 - beta * p + alpha * (T - T_r))
    trapped = (
        air * p_a / (p_a + p) * (T + sympy.Rational("273.15")) / (T_r + sympy.Rational("273.15"))
    )
    slope = sympy.diff(m / rho - hull - trapped, z)

    vehicle = with_hull(
        displaced_volume=30.1e-3, trapped_air=1e-4, parts=(TUBE,), reference_temperature=10.0
    )
    column = uniform_column(vehicle.water, 500.0)
    depth = column.depth
    column = type(column)(
        depth=depth,
        pressure=1.005e4 * depth,
        density=1024.0 + 0.006 * depth,
        temperature=20.0 - 0.02 * depth,
        gravity=9.81,
    )
    for at in (0.0, 37.5, 400.0):
        due = float(
            slope.subs(
                {
                    z: at,
                    V: 0.03,
                    beta: 2.5e-10,
                    alpha: 7e-5,
                    air: 1e-4,
                    rho0: 1024.0,
                    a: 0.006,
                    g: 1.005e4,
                    T0: 20.0,
                    c: 0.02,
                    p_a: 101325.0,
                    T_r: 10.0,
                    m: weight_mass(vehicle),
                }
            )
        )
        assert linear_psi(vehicle, column, at) == pytest.approx(due, rel=1e-9)
        assert all(term != 0.0 for term in psi_terms(vehicle, column, at))


def test_psi_is_the_slope_of_the_neutral_volume_in_a_real_sea():
    vehicle = with_hull(parts=(TUBE, FOAM), displaced_volume=43.51e-3, trapped_air=1e-5)
    column = cast()
    volume = neutral_volume(vehicle, column)
    for k in (50, 200, 800):
        slope = (volume[k + 1] - volume[k - 1]) / 2.0
        assert linear_psi(vehicle, column, float(k)) == pytest.approx(slope, rel=2e-2, abs=1e-10)


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"parts": (TUBE,)}, "parts", "not the displaced volume of 43980 cm3"),
        ({"parts": (TUBE, TUBE)}, "parts", "two parts have the name 'tube'"),
        ({"trapped_air": 0.05}, "trapped_air", "not less than the displaced volume"),
        ({"parts": ({"name": "x", "volume": 0.0, "compressibility": 0.0},)}, "volume", "greater"),
        ({"reference_temperature": "15 K"}, "reference_temperature", "another kind"),
    ],
)
def test_a_hull_that_cannot_be_is_refused(changes, field, words):
    given = load_vehicle("example-eh").hull.model_dump() | changes
    with pytest.raises(InputError, match=words) as caught:
        Hull(**given)
    assert field in str(caught.value.field)


def test_a_part_that_stiffens_gives_way_by_what_its_compressibility_is_there():
    """dV = -V beta(p) dp with beta(p) = beta - s p down to 0, integrated by SciPy."""
    beta, s = 3.4e-10, 5.2e-18
    part = HullPart(name="hull", volume="34 L", compressibility=beta, stiffening=s)
    vehicle = with_hull(displaced_volume=34e-3, parts=(part,))
    for pressure in (0.0, 1e7, 2e7, 9e7):  # the last beyond beta/s, 65 MPa
        lost, _ = quad(lambda p: 34e-3 * max(beta - s * p, 0.0), 0.0, pressure, points=[beta / s])
        displaced = float(displaced_volume(vehicle, pressure, vehicle.hull.reference_temperature))
        assert 34e-3 - displaced == pytest.approx(lost, rel=1e-9, abs=1e-15)
    column = uniform_column(vehicle.water, 9000.0, step=10.0)
    for z in (0.0, 1000.0, 8000.0):
        gives = 34e-3 * max(beta - s * vehicle.water.specific_weight * z, 0.0)
        due = gives * vehicle.water.specific_weight
        assert psi_terms(vehicle, column, z).hull == pytest.approx(due, rel=1e-9, abs=1e-18)
    neutral = neutral_volume(vehicle, column)
    slope = (neutral[101] - neutral[99]) / 20.0
    assert linear_psi(vehicle, column, 1000.0) == pytest.approx(slope, rel=1e-9)


def test_what_stiffens_by_nothing_is_as_before():
    column = cast()
    (hull,) = hull_parts(load_vehicle("example-eh"))
    given = HullPart(
        name="one", volume=hull.volume, compressibility=hull.compressibility, stiffening=0.0
    )
    plain = displaced_volume(load_vehicle("example-eh"), column.pressure, column.temperature)
    same = displaced_volume(with_hull(parts=(given,)), column.pressure, column.temperature)
    np.testing.assert_array_equal(same, plain)


@pytest.mark.parametrize(("K2", "T2"), [(1e-3, 36.3), (8e6, 36.3), (7935.54, 3.63e4)])
def test_an_identified_motion_that_implies_an_absurd_mass_is_refused(tmp_path, capsys, K2, T2):
    """m = rho g T2/K2 against what the hull displaces: in Python, from a file, by a command."""
    feup = load_vehicle("feup-em")
    motion = feup.motion.model_copy(update={"K2": K2, "T2": T2})
    vehicle = feup.model_copy(update={"motion": motion})
    step = {"setpoints": [(0.0, 3.0)], "duration": 30.0, "start_depth": 1.5}
    with pytest.raises(InputError, match="implies a mass of") as caught:
        simulate(vehicle, **step)
    said = caught.value
    assert (said.field, said.value, said.unit) == ("motion.K2", K2, "1/m2/s")
    mass = feup.water.density * feup.water.gravity * T2 / K2
    assert f"{mass:.3g} kg" in said.what
    path = tmp_path / "vehicle.toml"
    path.write_text(vehicle_file(vehicle))
    with pytest.raises(InputError) as located:
        load_vehicle(path)
    assert located.value.what == said.what
    assert located.value.line is not None
    assert main(["analyse", str(path), "--out", str(tmp_path / "out")]) == 2
    assert said.what in " ".join(capsys.readouterr().err.split())
