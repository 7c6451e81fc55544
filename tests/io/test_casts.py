"""Casts from every kind of file, and what is wrong with them, found and said."""

import gzip

import gsw
import h5netcdf
import h5py
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import netcdf_file

from swimbladder.errors import InputError, LogError
from swimbladder.io.cast_columns import CAST_COLUMNS, kind_of
from swimbladder.io.casts import legs, read_cast
from swimbladder.io.columns import plain_unit
from swimbladder.physics.seawater import cast_column
from tests.examples import examples

PLACE = {"latitude": 43.0, "longitude": 8.0}


def sea(deepest=500.0, step=2.0):
    """A summer sea: pressure, temperature, practical salinity."""
    p = np.arange(0.0, deepest + 0.1, step)
    return p, 13.2 + 10.0 * np.exp(-p / 40.0), 38.5 - 0.6 * np.exp(-p / 60.0)


def csv(folder, columns, name="cast.csv", rows=None):
    names, values = list(columns), np.array(list(columns.values()))
    lines = [",".join(names)]
    lines += [",".join(f"{value:.10g}" for value in row) for row in values.T]
    path = folder / name
    path.write_text("\n".join(lines if rows is None else [lines[0], *rows(lines[1:])]) + "\n")
    return path


def plain(folder, deepest=500.0, **changes):
    p, t, s = sea(deepest)
    columns = {"pressure_dbar": p, "temperature_degC": t, "salinity": s}
    return csv(folder, {**columns, **changes})


def refused(path, **options):
    with pytest.raises(InputError) as caught:
        read_cast(path, **options)
    assert str(caught.value.file) == str(path)
    assert caught.value.remedy
    return caught.value


def test_a_cast_is_what_gsw_makes_of_it(tmp_path):
    cast = read_cast(plain(tmp_path), **PLACE)
    p, t, s = sea()
    SA = gsw.SA_from_SP(s, p, 8.0, 43.0)
    np.testing.assert_allclose(cast.pressure, p, atol=1e-9)
    np.testing.assert_allclose(cast.SA, SA, atol=1e-9)
    np.testing.assert_allclose(cast.CT, gsw.CT_from_t(SA, t, p), atol=1e-8)
    assert cast.name == "cast.csv"


def test_without_a_place_it_says_what_that_costs(tmp_path):
    cast = read_cast(plain(tmp_path))
    assert cast.latitude == 45.0
    assert any("latitude is not known" in line for line in cast.report)
    assert any("Reference Salinity" in line for line in cast.report)
    np.testing.assert_allclose(cast.SA, gsw.SR_from_SP(sea()[2]), atol=1e-9)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("pressure_dbar", ("pressure_dbar", "dbar")),
        ("Pressure [bar]", ("pressure_dbar", "bar")),
        ("PRES", ("pressure_dbar", None)),
        ("sci_water_cond_S_m", ("conductivity_S_m", "S/m")),
        ("conductivity_uS_cm", ("conductivity_S_m", "uS/cm")),
        ("SP", ("salinity", None)),
        ("Temp. (deg C)", None),
        ("Temperature (deg C)", ("temperature_degC", "degC")),
        ("salinity_psu", ("salinity", "")),
        ("depth (m)", ("depth_m", "m")),
        ("oxygen", None),
        ("density_kg_m3", ("density_kg_m3", "kg/m3")),
        ("ctd_pressure", ("pressure_dbar", None)),
    ],
)
def test_names_that_are_known(name, meant):
    assert kind_of(name) == meant


@pytest.mark.parametrize("unit", ["decibar", "degrees_Celsius", "psu", "S m-1", "1e-3"])
def test_units_of_oceanographers(unit):
    from swimbladder.units import unit_factor

    wanted = {"decibar": "dbar", "degrees_Celsius": "degC", "S m-1": "S/m"}.get(unit, "")
    assert unit_factor(plain_unit(unit), wanted) == 1.0


def test_other_names_and_units_as_for_logs(tmp_path):
    p, t, s = sea()
    path = csv(tmp_path, {"Druck": p / 10.0, "T": t, "Salz": s})
    columns = {"pressure_dbar": "Druck@bar", "temperature_degC": "T", "salinity": "Salz"}
    np.testing.assert_allclose(read_cast(path, columns=columns).pressure, p, atol=1e-7)
    error = refused(path, columns={"pressure": "Druck"})
    assert "no such column of a cast" in str(error)
    error = refused(path, columns={"pressure_dbar": "Drück"})
    assert "Did you mean Druck?" in str(error)


def test_semicolons_decimal_commas_and_gzip(tmp_path):
    p, t, s = sea()
    lines = ["pressure_dbar;temperature_degC;salinity"]
    lines += [f"{a};{b:.6f};{c:.6f}".replace(".", ",") for a, b, c in zip(p, t, s, strict=True)]
    form = tmp_path / "form.toml"
    form.write_text('[log]\ndecimal = ","\n')
    path = tmp_path / "cast.csv.gz"
    path.write_bytes(gzip.compress("\n".join(lines).encode()))
    np.testing.assert_allclose(read_cast(path, log_format=form, **PLACE).pressure, p)


def test_conductivity_instead_of_salinity(tmp_path):
    p, t, s = sea()
    path = csv(
        tmp_path,
        {"pressure_dbar": p, "temperature_degC": t, "cond_mS_cm": gsw.C_from_SP(s, t, p)},
    )
    cast = read_cast(path, **PLACE)
    np.testing.assert_allclose(cast.SA, gsw.SA_from_SP(s, p, 8.0, 43.0), atol=1e-6)


def test_depth_instead_of_pressure(tmp_path):
    by_pressure = cast_column(read_cast(plain(tmp_path), **PLACE))
    p, t, s = sea()
    depth = np.interp(p, by_pressure.pressure / 1e4, by_pressure.depth)[:-3]
    path = csv(
        tmp_path, {"depth_m": depth, "temperature_degC": t[:-3], "salinity": s[:-3]}, "d.csv"
    )
    cast = read_cast(path, **PLACE)
    np.testing.assert_allclose(cast.pressure, p[:-3], atol=0.02)
    assert any("pressure follows from depth" in line for line in cast.report)


def test_fresh_water_with_a_stated_salinity(tmp_path):
    p = np.arange(0.0, 30.0)
    path = csv(tmp_path, {"pressure_dbar": p, "temperature_degC": 15.0 - 0.2 * p})
    error = refused(path)
    assert "neither salinity nor conductivity" in str(error)
    assert "`salinity=" in error.remedy
    cast = read_cast(path, salinity=0.0)
    assert cast_column(cast).density[0] == pytest.approx(gsw.rho_t_exact(0.0, 15.0, 0.0), abs=2e-3)
    with pytest.raises(InputError, match="0 or more and 42 at most"):
        read_cast(path, salinity=400.0)


# What is wrong with casts, recognised by the physics.


@pytest.mark.parametrize(("unit", "factor"), [("kPa", 10.0), ("Pa", 1e4), ("psi", 1.4503774)])
def test_a_pressure_beyond_the_deepest_trench(tmp_path, unit, factor):
    p, t, s = sea(9000.0 if unit == "psi" else 2000.0)
    error = refused(csv(tmp_path, {"pressure": factor * p, "temp": t, "psal": s}))
    assert "deeper than any sea" in str(error)
    assert f"{unit} (" in error.remedy
    assert error.line == len(p) + 1
    assert error.unit == "dbar"


@pytest.mark.parametrize(("unit", "factor"), [("bar", 0.1), ("kPa", 10.0), ("MPa", 0.01)])
def test_the_depth_tells_of_the_unit_of_pressure(tmp_path, unit, factor):
    p, t, s = sea()
    depth = -gsw.z_from_p(p, 43.0)
    path = csv(tmp_path, {"pressure": factor * p, "depth": depth, "temp": t, "psal": s})
    error = refused(path)
    assert f"In {unit} it fits" in error.remedy
    mapped = read_cast(path, columns={"pressure_dbar": f"pressure@{unit}"})
    np.testing.assert_allclose(mapped.pressure, p, atol=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("bar", 0.1), ("MPa", 0.01)])
def test_conductivity_beside_salinity_tells_of_the_unit_of_pressure(tmp_path, unit, factor):
    p, t, s = sea(2000.0)
    path = csv(
        tmp_path,
        {"pressure": factor * p, "temp": t, "psal": s, "cond_mS_cm": gsw.C_from_SP(s, t, p)},
    )
    assert f"In {unit} they agree" in refused(path).remedy


@pytest.mark.parametrize(("unit", "factor"), [("bar", 0.1), ("MPa", 0.01)])
def test_density_in_situ_tells_of_the_unit_of_pressure(tmp_path, unit, factor):
    p, t, s = sea(2000.0)
    SA = gsw.SR_from_SP(s)
    columns = {"pressure": factor * p, "temp": t, "psal": s}
    density = {"density": gsw.rho(SA, gsw.CT_from_t(SA, t, p), p)}
    assert f"In {unit} they agree" in refused(csv(tmp_path, columns | density)).remedy
    potential = {"density": gsw.rho(SA, gsw.CT_from_t(SA, t, p), 0.0)}
    cast = read_cast(csv(tmp_path, {**columns, "pressure": p} | potential))
    assert any("is it that in situ?" in line for line in cast.report)


@pytest.mark.parametrize(("unit", "per_dbar"), [("mbar", 100.0), ("kPa", 10.0), ("Pa", 1e4)])
def test_a_logger_that_counts_from_vacuum_is_told_by_the_air(tmp_path, unit, per_dbar):
    p, t, s = sea(20.0, 0.5)
    counted = per_dbar * (p + 10.1325)
    path = csv(tmp_path, {"pressure": counted, "temp": t, "psal": s})
    error = refused(path)
    assert f"in {unit} that is the atmosphere" in str(error)
    assert f"with {10.1325 * per_dbar:g} {unit} of air subtracted" in error.remedy
    column = {"pressure_dbar": f"pressure@{unit}"}
    assert any("of a sensor in air" in line for line in read_cast(path, columns=column).report)
    path = csv(tmp_path, {"pressure": per_dbar * p, "temp": t, "psal": s})
    cast = read_cast(path, columns=column)
    assert cast.pressure[-1] == pytest.approx(p[-1])
    assert not any("air" in line for line in cast.report)


def test_pressures_with_the_atmosphere_in_them(tmp_path):
    p, t, s = sea()
    depth = -gsw.z_from_p(p, 45.0)
    path = csv(tmp_path, {"pressure": p + 10.1325, "depth": depth, "temp": t, "psal": s})
    cast = read_cast(path)
    np.testing.assert_allclose(cast.pressure, p, atol=1e-6)
    assert any("hold the atmosphere" in line for line in cast.report)


@pytest.mark.parametrize(
    ("column", "change", "remedy"),
    [
        ("temperature_degC", lambda t: t + 273.15, "as kelvin"),
        ("temperature_degC", lambda t: 32.0 + 1.8 * t, "As Fahrenheit"),
        ("salinity", lambda s: 1000.0 * s, "mapped as conductivity_S_m"),
    ],
)
def test_numbers_that_no_sea_has(tmp_path, column, change, remedy):
    _, t, s = sea()
    values = {"temperature_degC": t, "salinity": s}
    error = refused(plain(tmp_path, **{column: change(values[column])}))
    assert error.field == column
    assert remedy in error.remedy


def test_temperature_and_salinity_that_have_changed_places(tmp_path):
    _, t, s = sea()
    error = refused(plain(tmp_path, temperature_degC=s, salinity=t))
    assert "may have changed places" in error.remedy


def test_a_conductivity_in_the_wrong_unit(tmp_path):
    p, t, s = sea()
    C = gsw.C_from_SP(s, t, p)
    error = refused(csv(tmp_path, {"pressure_dbar": p, "temp": t, "conductivity": C}))
    assert "In mS/cm it fits" in error.remedy


def test_small_inversions_are_averaged_and_large_ones_refused(tmp_path):
    p, _, s = sea()
    noise = np.zeros_like(p)
    noise[100] = 0.01  # about 0.008 kg/m3
    cast = read_cast(plain(tmp_path, salinity=s + noise), **PLACE)
    assert any("1 density inversion averaged" in line for line in cast.report)
    between = 0.5 * (cast.pressure[1:] + cast.pressure[:-1])
    lower = gsw.rho(cast.SA[1:], cast.CT[1:], between)
    assert (lower - gsw.rho(cast.SA[:-1], cast.CT[:-1], between)).min() > -1e-8

    noise[100:110] = 0.2
    path = plain(tmp_path, salinity=s + noise)
    error = refused(path)
    assert error.field == "density"
    assert error.line == 112  # row 110, below the header
    assert error.value == pytest.approx(0.15, abs=0.02)  # 0.2 x 0.77 kg/m3
    kept = read_cast(path, inversions="keep", **PLACE)
    assert any("kept, the largest 0.15 kg/m3 at 220.0 dbar" in line for line in kept.report)
    mixed = read_cast(path, inversions="average", **PLACE)
    # salt is kept: the same is there after mixing
    assert np.trapezoid(mixed.SA, mixed.pressure) == pytest.approx(
        np.trapezoid(kept.SA, kept.pressure), rel=1e-6
    )


def test_water_that_gets_lighter_little_by_little_is_refused_too(tmp_path):
    p = sea(1000.0)[0]
    SP, t = 38.5 - 2e-4 * p, np.full_like(p, 13.0)
    SA = gsw.SR_from_SP(SP)
    CT = gsw.CT_from_t(SA, t, p)
    due = gsw.rho(SA[0], CT[0], 0.0) - gsw.rho(SA.mean(), CT.mean(), 0.0)  # mixed all the way down
    assert due > 0.05
    path = csv(tmp_path, {"pressure_dbar": p, "temp": t, "psal": SP})
    error = refused(path)
    assert "little from row to row" in str(error)
    assert error.value == pytest.approx(due, abs=2e-4)
    mixed = read_cast(path, inversions="average", **PLACE)
    assert np.ptp(mixed.SA) < 1e-6
    assert any("density changes by 0.06" in line for line in mixed.report)


def test_spikes_are_left_out_and_said(tmp_path):
    p, t, s = sea()
    s, t = s.copy(), t.copy()
    s[150] = 30.0
    s[0] = 0.02
    t[200] = 25.0
    cast = read_cast(plain(tmp_path, salinity=s, temperature_degC=t), **PLACE)
    assert len(cast.pressure) == len(p) - 3
    assert {0.0, 300.0, 400.0}.isdisjoint(cast.pressure)
    said = " ".join(cast.report)
    assert "the first on line 2" in said
    assert "1 row with salinity far off those around (30 at 300.0 dbar)" in said
    assert "1 row with temperature far off those around (25 at 400.0 dbar)" in said


def test_a_cast_down_and_up_takes_the_way_down(tmp_path):
    p, t, s = sea()
    both = {
        "pressure_dbar": np.append(p, p[::-1]),
        "temperature_degC": np.append(t, t[::-1] + 0.5),
        "salinity": np.append(s, s[::-1]),
    }
    path = csv(tmp_path, both, "both.csv")
    down = read_cast(path, **PLACE)
    np.testing.assert_allclose(down.CT, read_cast(plain(tmp_path), **PLACE).CT, atol=0.01)
    assert any("the way down is taken, line 2 to line 252" in line for line in down.report)
    up = read_cast(path, profile=2, **PLACE)
    assert np.mean(up.CT - down.CT) == pytest.approx(0.5, abs=0.02)
    assert "2 profiles" in str(refused(path, profile=3))


def test_several_casts_in_a_file_have_to_be_chosen_from(tmp_path):
    p, t, s = sea()
    path = csv(
        tmp_path,
        {
            "dive": np.repeat([1.0, 2.0, 3.0], len(p)),
            "pressure_dbar": np.tile(p, 3),
            "temperature_degC": np.tile(t, 3),
            "salinity": np.tile(s, 3),
        },
    )
    error = refused(path)
    assert "profiles in it (1: 0 to 500 dbar" in str(error)
    assert "`where=" in error.remedy
    np.testing.assert_allclose(read_cast(path, where={"dive": 2}, **PLACE).pressure, p)


def test_depths_that_count_upward_are_turned_and_said(tmp_path):
    p, t, s = sea()
    depth = -gsw.z_from_p(p, 43.0)
    table = {"temperature_degC": t, "salinity": s}
    down = read_cast(csv(tmp_path, {"depth_m": depth, **table}), **PLACE)
    up = read_cast(csv(tmp_path, {"depth_m": -depth, **table}), **PLACE)
    np.testing.assert_allclose(up.pressure, down.pressure, atol=1e-9)
    assert any("depths are negative in the file" in line for line in up.report)
    assert not any("negative" in line for line in down.report)
    beside = read_cast(csv(tmp_path, {"pressure_dbar": p, "depth_m": -depth, **table}), **PLACE)
    np.testing.assert_allclose(beside.pressure, p, atol=1e-9)


@pytest.mark.parametrize(("above", "taken"), [(3.0, True), (6.0, False), (100.0, False)])
def test_rows_above_the_surface_are_a_sensor_on_deck_or_an_offset(tmp_path, above, taken):
    p, t, s = sea()
    path = csv(tmp_path, {"depth_m": p - above, "temperature_degC": t, "salinity": s})
    if taken:
        cast = read_cast(path, **PLACE)
        assert cast.pressure[0] >= 0.0
        assert any("above the surface left out" in line for line in cast.report)
    else:
        error = refused(path)
        assert (error.line, error.value) == (2, -above)


def test_depths_of_both_signs_are_refused_with_the_line(tmp_path):
    p, t, s = sea()
    depth = np.where(p == 400.0, -400.0, p)
    error = refused(csv(tmp_path, {"depth_m": depth, "temperature_degC": t, "salinity": s}))
    assert error.line == 202
    assert "neither downward nor upward" in str(error)


def test_salinity_as_a_share_of_mass_is_refused_and_a_soft_lake_is_not_shut_out(tmp_path):
    error = refused(plain(tmp_path, salinity=sea()[2] / 1000.0))
    assert "As kg/kg or g/g it is 38.5 g/kg: multiply the column by 1000" in error.remedy
    assert "`salinity=" in error.remedy
    fresh = plain(tmp_path, salinity=np.zeros(251))
    assert np.all(read_cast(fresh, **PLACE).SA == 0.0)
    soft = plain(tmp_path, salinity=np.full(251, 0.06))
    np.testing.assert_allclose(read_cast(soft, **PLACE).SA, gsw.SR_from_SP(0.06), rtol=0.5)


@pytest.mark.parametrize(("unit", "factor"), [("mS/cm", 10.0), ("mS/m", 1e3), ("uS/cm", 1e4)])
@pytest.mark.parametrize("constant", [False, True])
def test_conductivity_in_another_unit_names_the_option_that_reads_it(
    tmp_path, unit, factor, constant
):
    p, t, s = sea()
    C = 0.1 * gsw.C_from_SP(s, t, p)  # S/m
    if constant:  # too much salt for cold water in any unit, and still told by its size
        C = np.full(len(p), 5.0)
        t = t - 12.0
    path = csv(tmp_path, {"pressure_dbar": p, "temperature_degC": t, "cond": C * factor})
    error = refused(path)
    assert f'`columns={{"conductivity_S_m": "cond@{unit}"}}`' in error.remedy
    if not constant:
        again = read_cast(path, columns={"conductivity_S_m": f"cond@{unit}"}, **PLACE)
        np.testing.assert_allclose(again.SA, gsw.SA_from_SP(s, p, 8.0, 43.0), atol=1e-4)


def test_a_single_row_is_told_how_many_are_needed(tmp_path):
    path = csv(tmp_path, {"pres": [1.0], "temp": [5.0], "psal": [35.0]})
    error = refused(path)
    assert "one row is no cast" in str(error)
    assert "two rows at least" in error.remedy


@pytest.mark.parametrize("order", ["up", "shuffled"])
def test_rows_in_another_order_make_the_same_cast(tmp_path, order):
    p, t, s = sea()
    to = np.arange(len(p))[::-1] if order == "up" else np.random.default_rng(1).permutation(len(p))
    path = csv(tmp_path, {"pressure_dbar": p[to], "temperature_degC": t[to], "salinity": s[to]})
    cast = read_cast(path, **PLACE)
    np.testing.assert_allclose(cast.pressure, p)
    assert any("in no order" in line for line in cast.report) == (order == "shuffled")


def test_a_winch_that_heaves_makes_one_leg():
    p = np.linspace(0.0, 100.0, 400) + 0.8 * np.sin(np.arange(400))
    ((first, last),) = legs(p)
    assert first == 0
    assert last > 395
    assert len(legs(np.concatenate([p, p[::-1], p]))) == 3
    assert legs(np.array([0.9, 0.5, 0.2])) == [(0, 2)]


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"temp": [1.0, 2.0], "psal": [35.0, 35.0]}, "neither pressure nor depth"),
        ({"pres": [1.0, 2.0], "psal": [35.0, 35.0]}, "no temperature"),
        ({"pres": [1.0, np.nan], "temp": [5.0, 5.0], "psal": [35.0, 35.0]}, "of 2 rows 1 hold"),
        ({"pres": [5.0, 5.0, 5.0], "temp": [5.0] * 3, "psal": [35.0] * 3}, "one pressure"),
        (
            {"pres": [1.0, 2.0], "prdm": [1.0, 2.0], "temp": [5.0] * 2, "psal": [35.0] * 2},
            "several columns may be the pressure",
        ),
    ],
)
def test_what_is_no_cast_is_refused(tmp_path, columns, words):
    assert words in str(refused(csv(tmp_path, columns)))


def test_files_that_are_none(tmp_path):
    assert "no such file" in str(refused(tmp_path / "none.csv"))
    path = tmp_path / "cut.nc"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(50))
    assert "cannot be read" in str(refused(path))
    path.write_bytes(b"CDF\x01" + bytes(20))
    assert "variable" in str(refused(path)) or "cannot be read" in str(refused(path))


@examples(60)
@given(st.integers(0, 4000), st.binary(min_size=1, max_size=20), st.sampled_from(range(5)))
def test_damaged_bytes_end_in_a_cast_or_a_refusal(tmp_path_factory, at, by, kind):
    folder = tmp_path_factory.mktemp("fuzz")
    makers = (
        lambda: plain(folder, deepest=100.0),
        lambda: cf_file(folder / "3.nc", engine="3"),
        lambda: cf_file(folder / "4.nc", engine="4"),
        lambda: argo_file(folder / "argo.nc"),
        lambda: cnv_file(folder / "cast.cnv"),
    )
    path = makers[kind]()
    data = bytearray(path.read_bytes())
    at %= len(data)
    data[at : at + len(by)] = by
    path.write_bytes(bytes(data))
    try:
        cast = read_cast(path)
    except InputError:
        pass  # a refusal is an answer; anything else fails the test
    else:
        assert (np.diff(cast.pressure) > 0.0).all()
        assert np.isfinite(cast.SA).all()


# netCDF


def cf_file(path, *, engine, names=("PRES", "TEMP", "PSAL"), kelvin=False, bad=()):
    p, t, s = sea()
    flags = np.ones(len(p), dtype="i1")
    flags[list(bad)] = 4
    standard = ("sea_water_pressure", "sea_water_temperature", "sea_water_practical_salinity")
    units = ("decibar", "K" if kelvin else "degree_Celsius", "1")
    values = (p, t + 273.15 * kelvin, s)
    if engine == "3":
        with netcdf_file(path, "w") as file:
            file.createDimension("N", len(p))
            for name, meant, unit, v in zip(names, standard, units, values, strict=True):
                variable = file.createVariable(name, "d", ("N",))
                variable[:] = v
                variable.standard_name, variable.units = meant, unit
                file.createVariable(f"{name}_QC", "b", ("N",))[:] = flags
            for name, v in (("LATITUDE", 43.0), ("LONGITUDE", 8.0)):
                file.createVariable(name, "d", ())[...] = v
        return path
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"N_MEASUREMENTS": len(p)}
        for name, meant, unit, v in zip(names, standard, units, values, strict=True):
            variable = file.create_variable(name, ("N_MEASUREMENTS",), "f8", data=v)
            variable.attrs["standard_name"], variable.attrs["units"] = meant, unit
            file.create_variable(f"{name}_QC", ("N_MEASUREMENTS",), "i1", data=flags)
        for name, v in (("LATITUDE", 43.0), ("LONGITUDE", 8.0)):
            file.create_variable(name, ("N_MEASUREMENTS",), "f8", data=np.full(len(p), v))
    return path


def test_pressures_that_are_texts_are_refused(tmp_path):
    path = tmp_path / "texts.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"N": 3}
        texts = np.array(["a", "b", "c"], dtype=object)
        file.create_variable("PRES", ("N",), h5py.string_dtype(), data=texts)
        file.create_variable("TEMP", ("N",), "f8", data=np.ones(3))
    with pytest.raises(InputError) as caught:
        read_cast(path)
    assert caught.value.file == path


@pytest.mark.parametrize("engine", ["3", "4"])
def test_variables_by_standard_name(tmp_path, engine):
    path = cf_file(tmp_path / "cast.nc", engine=engine, names=("a", "b", "c"), kelvin=True)
    cast, due = read_cast(path), read_cast(plain(tmp_path), **PLACE)
    np.testing.assert_allclose(cast.CT, due.CT, atol=1e-6)
    np.testing.assert_allclose(cast.SA, due.SA, atol=1e-6)
    assert (cast.latitude, cast.longitude) == (43.0, 8.0)


@pytest.mark.parametrize("engine", ["3", "4"])
def test_what_is_flagged_as_bad_is_left_out(tmp_path, engine):
    cast = read_cast(cf_file(tmp_path / "cast.nc", engine=engine, bad=(5, 6)))
    assert len(cast.pressure) == len(sea()[0]) - 2
    assert any("2 values of PSAL flagged as bad" in line for line in cast.report)


def test_netcdf_may_be_gzipped_and_mapped(tmp_path):
    path = cf_file(tmp_path / "cast.nc", engine="4")
    packed = tmp_path / "cast.nc.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    np.testing.assert_array_equal(read_cast(packed).SA, read_cast(path).SA)
    shallow = read_cast(path, columns={"pressure_dbar": "PRES@kPa"})
    np.testing.assert_allclose(shallow.pressure[-1], 50.0)
    error = refused(path, columns={"salinity": "SALT"})
    assert "no such column" in str(error)
    assert "Did you mean PSAL?" in error.remedy
    assert "CSV and Parquet only" in str(refused(path, where={"N": 1}))


def test_a_netcdf_without_a_profile(tmp_path):
    path = tmp_path / "cast.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"x": 3}
        file.create_variable("elevation", ("x",), "f8", data=np.zeros(3))
    error = refused(path)
    assert "elevation" in error.remedy


def test_a_glider_logs_on_several_clocks(tmp_path):
    p, t, s = sea()
    path = tmp_path / "p1670001.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"sg_data_point": 2 * len(p), "ctd_data_point": len(p)}
        file.create_variable("pressure", ("sg_data_point",), "f8", data=np.repeat(p, 2))
        file.create_variable("depth", ("sg_data_point",), "f8", data=np.repeat(p, 2))
        for name, v in (("ctd_pressure", p), ("temperature", t), ("salinity", s)):
            file.create_variable(name, ("ctd_data_point",), "f8", data=v)
        flags = np.array([b"1"] * (len(p) - 1) + [b"4"])
        file.create_variable("salinity_qc", ("ctd_data_point",), "S1", data=flags)
    cast, due = read_cast(path, **PLACE), read_cast(plain(tmp_path), **PLACE)
    np.testing.assert_allclose(cast.SA, due.SA[:-1], atol=1e-9)
    assert any("1 value of salinity flagged as bad" in line for line in cast.report)


def test_profiles_side_by_side_in_a_grid(tmp_path):
    p, t, s = sea()
    path = tmp_path / "grid.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"depth": len(p), "profile": 3}
        file.create_variable("depth", ("depth",), "f8", data=p)
        for name, v in (("temperature", t), ("salinity", s)):
            grid = np.repeat(v[:, None], 3, axis=1)
            file.create_variable(name, ("depth", "profile"), "f8", data=grid)
    assert f"a grid of {len(p)} x 3 values over {len(p)} of depth" in str(refused(path))


def argo_file(path, *, adjusted=True, mode="", schemes=None):
    """A profile file as Argo writes it: characters for flags and texts, float32, two profiles."""
    p, t, s = sea()
    n = len(p)
    with netcdf_file(path, "w") as file:
        for name, size in (("N_PROF", 2), ("N_LEVELS", n), ("STRING8", 8), ("STRING256", 256)):
            file.createDimension(name, size)
        for name, v in (("PRES", p), ("TEMP", t), ("PSAL", s)):
            for suffix, shift in (("", 0.5 if name == "PSAL" else 0.0), ("_ADJUSTED", 0.0)):
                variable = file.createVariable(name + suffix, "f", ("N_PROF", "N_LEVELS"))
                values = np.full((2, n), 99999.0, dtype=np.float32)
                if suffix == "" or adjusted:
                    values[1] = v + shift
                if suffix == "":
                    values[0, :5] = v[:5]
                variable[:] = values
                variable._FillValue = np.float32(99999.0)
                variable.units = {"PRES": "decibar", "TEMP": "degree_Celsius", "PSAL": "psu"}[name]
                flags = np.full((2, n), b"1", dtype="S1")
                flags[1, 7] = b"4"
                file.createVariable(f"{name}{suffix}_QC", "c", ("N_PROF", "N_LEVELS"))[:] = flags
        for name, v in (("LATITUDE", 43.0), ("LONGITUDE", 8.0), ("CYCLE_NUMBER", 12)):
            file.createVariable(name, "d", ("N_PROF",))[:] = np.full(2, v)
        number = file.createVariable("PLATFORM_NUMBER", "c", ("N_PROF", "STRING8"))
        number[:] = np.array([list("6901234 ")] * 2, dtype="S1")
        scheme = file.createVariable("VERTICAL_SAMPLING_SCHEME", "c", ("N_PROF", "STRING256"))
        texts = schemes or ["Near-surface sampling: averaged", "Primary sampling: averaged"]
        scheme[:] = np.array([list(text.ljust(256)) for text in texts], dtype="S1")
        if mode:
            file.createVariable("DATA_MODE", "c", ("N_PROF",))[:] = np.array(list(mode), "S1")
    return path


def test_an_argo_profile_adjusted_primary_and_flagged(tmp_path):
    cast = read_cast(argo_file(tmp_path / "R6901234_012.nc"))
    p, _, s = sea()
    assert len(cast.pressure) == len(p) - 1  # what is flagged 4 is left out
    rows = np.delete(np.arange(len(p)), 7)
    np.testing.assert_allclose(
        cast.SA, gsw.SA_from_SP(s, p, 8.0, 43.0)[rows], atol=1e-4
    )  # adjusted: without the 0.5
    assert cast.name == "R6901234_012.nc float 6901234 cycle 12"
    assert any("profile 2 of 2 taken, the primary sampling" in line for line in cast.report)
    assert "2 profiles" in str(refused(tmp_path / "R6901234_012.nc", profile=3))


def test_an_argo_profile_in_real_time_has_no_adjusted_values(tmp_path):
    cast = read_cast(argo_file(tmp_path / "R.nc", adjusted=False))
    assert np.median(cast.SA) == pytest.approx(np.median(sea()[2]) + 0.5 + 0.18, abs=0.1)


def test_a_profile_given_up_in_delayed_mode_is_not_read_raw(tmp_path):
    raw = argo_file(tmp_path / "D.nc", adjusted=False, mode="RD")
    error = refused(raw)
    assert error.field == "PRES_ADJUSTED"
    assert "in mode D" in str(error)
    for mode, adjusted in (("RD", True), ("DR", False)):
        read_cast(argo_file(tmp_path / "fine.nc", adjusted=adjusted, mode=mode))


def test_several_primary_profiles_are_not_chosen_from(tmp_path):
    path = argo_file(tmp_path / "prof.nc", schemes=["Primary sampling: a", "Primary sampling: b"])
    error = refused(path)
    assert "there are 2 profiles" in str(error)
    assert "2: float 6901234 cycle 12 to 500 dbar" in str(error)
    assert "`profile=1`" in error.remedy
    assert read_cast(path, profile=2).pressure[-1] == pytest.approx(500.0)


@pytest.mark.parametrize("dims", [2, 3])
def test_flags_as_xarray_writes_them(tmp_path, dims):
    p, t, s = sea()
    flags = np.full((1, len(p), 1)[:dims], b"1", dtype="S1")
    flags[0, 7] = b"4"

    def saved(flags):
        names = ("N_PROF", "N_LEVELS", "string1")
        with h5netcdf.File(tmp_path / "saved.nc", "w") as file:
            file.dimensions = dict(zip(names, (1, len(p), 1), strict=True))
            for name, v in (("PRES", p), ("TEMP", t), ("PSAL", s)):
                file.create_variable(name, names[:2], "f8", data=v[None, :])
                shape = names[:1] if flags.ndim == 1 else names[: flags.ndim]
                file.create_variable(f"{name}_QC", shape, flags.dtype, data=flags)
        return tmp_path / "saved.nc"

    assert len(read_cast(saved(flags)).pressure) == len(p) - 1
    error = refused(saved(np.ones(1, "i1")))  # one for the whole profile
    assert "not one flag for each value of PRES" in str(error)


def test_all_flagged_as_bad_is_said(tmp_path):
    path = cf_file(tmp_path / "cast.nc", engine="4", bad=range(len(sea()[0])))
    assert f"{len(sea()[0])} values of PRES flagged as bad" in str(refused(path))


@pytest.mark.parametrize("filled", [99999.0, -999.0])
def test_a_position_where_there_was_no_fix(tmp_path, filled):
    p, t, s = sea()
    columns = {"pressure_dbar": p, "temperature_degC": t, "salinity": s}
    latitude, longitude = np.full(len(p), 43.0), np.where(np.arange(len(p)) % 2, 179.9, -179.9)
    latitude[:9] = longitude[:9] = filled
    place = {"latitude": latitude, "longitude": longitude}
    cast = read_cast(csv(tmp_path, columns | place))
    assert cast.latitude == pytest.approx(43.0)
    assert abs(abs(cast.longitude) - 180.0) < 0.2  # and not 0, the mean of the numbers
    assert any("9 latitudes beyond 90 degrees" in line for line in cast.report)
    cast_column(cast)
    gone = read_cast(csv(tmp_path, columns | {"latitude": np.full(len(p), filled)}))
    assert gone.latitude == 45.0
    assert any("latitude is not known" in line for line in gone.report)


def test_the_deep_is_warm_in_fahrenheit_only(tmp_path):
    p, t, s = sea(1000.0)
    ocean = 4.0 + (t - 13.2)
    error = refused(
        csv(tmp_path, {"pressure_dbar": p, "temperature_degC": 32 + 1.8 * ocean, "salinity": s})
    )
    assert "warmer than any sea" in str(error)
    assert "As Fahrenheit it is 4" in error.remedy
    red = np.maximum(t + 8.5, 21.7)  # the Red Sea
    read_cast(csv(tmp_path, {"pressure_dbar": p, "temperature_degC": red, "salinity": s}))


def test_the_abyss_is_warm_in_kilopascals_only(tmp_path):
    p, t, s = sea(600.0)
    columns = {"pressure": 10.0 * p, "temperature": 8.0 + (t - 13.2), "salinity": s - 3.5}
    error = refused(csv(tmp_path, columns))
    assert "warmer than any sea" in str(error)
    assert '`columns={"pressure_dbar": "pressure@kPa"}`' in error.remedy
    read_cast(csv(tmp_path, columns), columns={"pressure_dbar": "pressure@kPa"})


@pytest.mark.parametrize(
    ("deepest", "potential", "salinity"),
    [
        (5350.0, 13.9, 38.7),  # Calypso Deep, the Mediterranean's deepest
        (5650.0, 9.85, 34.45),  # the Sulu Sea
        (7800.0, 3.95, 34.99),  # the Cayman Trough
        (11000.0, 1.05, 34.7),  # Challenger Deep
    ],
)
def test_the_warmest_deeps_are_not_refused(tmp_path, deepest, potential, salinity):
    """Water of one potential temperature and salinity; in situ it gets warmer downwards."""
    p = np.arange(0.0, deepest, 50.0)
    t = gsw.t_from_CT(gsw.SR_from_SP(salinity), potential, p)
    columns = {"pressure_dbar": p, "temperature_degC": t, "salinity": np.full_like(p, salinity)}
    assert read_cast(csv(tmp_path, columns), inversions="keep").pressure[-1] == p[-1]


def test_names_of_the_hydrographers(tmp_path):
    p, t, s = sea()
    cast = read_cast(csv(tmp_path, {"CTDPRS": p, "CTDTMP": t, "CTDSAL": s}), **PLACE)
    np.testing.assert_array_equal(cast.SA, read_cast(plain(tmp_path), **PLACE).SA)
    path = csv(tmp_path, {"CTDPRS": p, "CTDTMP": t, "absolute_salinity": s})
    assert "absolute_salinity is not practical" in refused(path).remedy


# Sea-Bird


def cnv_file(path, *, temperature="t090C", flags=(), binary=False):
    p, t, s = sea()
    head = [
        "* Sea-Bird SBE 9 Data File:",
        "* NMEA Latitude = 43 00.00 N",
        "* NMEA Longitude = 008 00.00 E",
        "# nquan = 5",
        "# name 0 = scan: Scan Count",
        "# name 1 = prDM: Pressure, Digiquartz [db]",
        f"# name 2 = {temperature}: Temperature [ITS-90, deg C]",
        "# name 3 = c0mS/cm: Conductivity [mS/cm]",
        "# name 4 = flag: flag",
        "# bad_flag = -9.990e-29",
        f"# file_type = {'binary' if binary else 'ascii'}",
        "*END*",
    ]
    C = gsw.C_from_SP(s, t, p)
    rows = [
        f"{k:11d}{a:11.3f}{b:11.5f}{c:11.6f} {'-9.990e-29' if k in flags else '0.0000e+00'}"
        for k, (a, b, c) in enumerate(zip(p, t, C, strict=True))
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def test_a_cnv_file_of_sea_bird(tmp_path):
    cast, due = read_cast(cnv_file(tmp_path / "cast.cnv")), read_cast(plain(tmp_path), **PLACE)
    np.testing.assert_allclose(cast.SA, due.SA, atol=2e-4)
    np.testing.assert_allclose(cast.CT, due.CT, atol=2e-5)
    assert (cast.latitude, cast.longitude) == (43.0, 8.0)
    flagged = read_cast(cnv_file(tmp_path / "cast.cnv", flags=(10, 11)))
    assert len(flagged.pressure) == len(due.pressure) - 2
    assert any("2 rows flagged as bad" in line for line in flagged.report)


def test_temperatures_on_the_scale_of_1968(tmp_path):
    old = read_cast(cnv_file(tmp_path / "old.cnv", temperature="t068C"))
    new = read_cast(cnv_file(tmp_path / "new.cnv"))
    # by definition T68 = 1.00024 T90: 5 mK at 20 degC
    np.testing.assert_allclose(new.CT - old.CT, 0.00024 * new.CT, atol=2e-4)
    assert any("scale of 1968" in line for line in old.report)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("*END*", "*"), "no end"),
        (lambda text: text.replace("file_type = ascii", "file_type = binary"), "binary"),
        (lambda text: text.replace("prDM: Pressure", "oxML: Oxygen"), "neither pressure nor depth"),
        (lambda text: text.replace("[db]", "[ml/l]"), "of another kind"),
        (lambda text: text.rsplit("\n", 40)[0] + "\n 1 2 x\n", "without the header's 5 fields"),
        (lambda text: text.replace("# name 3", "# name 7"), "not numbered"),
        (lambda text: text.split("*END*")[0] + "*END*\n", "no rows"),
    ],
)
def test_a_cnv_file_that_cannot_be_read(tmp_path, change, words):
    path = cnv_file(tmp_path / "cast.cnv")
    path.write_text(change(path.read_text()))
    assert words in str(refused(path))


def test_columns_of_a_cnv_file_may_be_chosen(tmp_path):
    path = cnv_file(tmp_path / "cast.cnv")
    assert "no such column of a cast" in str(refused(path, columns={"pres": "prDM"}))
    assert "scan, prDM" in refused(path, columns={"pressure_dbar": "pr"}).remedy
    chosen = read_cast(path, columns={"pressure_dbar": "prDM@kPa"})
    assert chosen.pressure[-1] == pytest.approx(50.0)


# Measured casts


@pytest.mark.data
def test_fjord_casts(data_dir):
    folder = data_dir / "ntnu_bv"
    cast = read_cast(folder / "ctd_CTD_probe.csv")
    column = cast_column(cast)
    theirs = pd.read_csv(folder / "ctd_CTD_probe.csv")
    density = np.interp(theirs.depth_m, column.depth, column.density)
    below = (theirs.depth_m > 5.0) & (theirs.depth_m < 87.0)
    # the instrument's own density, by EOS-80
    assert np.abs(density - theirs.density_kg_m3)[below].median() < 0.03
    error = refused(folder / "ctd_borsa14.04.2023.csv")
    assert (error.line, error.field) == (37, "density")
    assert read_cast(folder / "ctd_borsa14.04.2023.csv", inversions="average").pressure[-1] > 11.0
    bottom = read_cast(folder / "ctd_borsa15.06.2023.csv")
    assert any("salinity far off" in line for line in bottom.report)


@pytest.mark.data
def test_a_deep_cast_of_a_float(data_dir):
    path = data_dir / "mermaid_p0051" / "ctd_profiles.csv.gz"
    assert "profiles in it" in str(refused(path))
    cast = read_cast(path, where={"profile_time": "2020-07-03 21:54:40"}, **PLACE)
    column = cast_column(cast)
    assert column.deepest > 1480.0
    assert (np.diff(column.density) > 0.0).all()
    assert cast.SA.min() > 37.0


@pytest.mark.data
def test_gliders(data_dir):
    slocum = data_dir / "slocum_comet" / "ctd.csv.gz"
    assert "36 profiles" in str(refused(slocum))
    cast = read_cast(slocum, profile=3, inversions="average", latitude=54.5, longitude=10.0)
    assert cast.pressure[-1] == pytest.approx(41.0, abs=1.0)
    # their density, by gsw from the same numbers: at the surface of the Baltic
    assert cast_column(cast).density[0] == pytest.approx(1004.55, abs=0.1)
    glider = data_dir / "seaglider" / "ctd.parquet"
    options = {"where": {"dive": 1670093}, "profile": 2, "inversions": "average"}
    column = cast_column(read_cast(glider, latitude=20.0, **options))
    table = pd.read_parquet(glider).query("dive == 1670093 and rho_gsw_kg_m3 > 0")
    up = table.iloc[table.ctd_pressure.argmax() :]
    theirs = np.interp(500.0, up.ctd_pressure[::-1], up.rho_gsw_kg_m3[::-1])
    ours = np.interp(500.0, column.pressure / 1e4, column.density)
    assert ours == pytest.approx(theirs, abs=0.03)
    with pytest.raises(LogError):
        read_cast(glider, where={"dive": 1670093}, profile=9)


def test_every_column_has_names():
    assert set(CAST_COLUMNS) == {kind_of(name)[0] for name in CAST_COLUMNS}
