"""Runs one by one: sums and ratios by hand, and what is no pump's run refused."""

import dataclasses

import numpy as np
import pytest

from swimbladder.design.energy import efficiency_bands, fit_pump, run_columns
from swimbladder.design.energy.fit import check_runs
from swimbladder.design.energy.run import fit_sentences
from swimbladder.errors import InputError
from tests.design.energy.test_fit import TRUTH, runs
from tests.quoted import refused

PER_PRESSURE = 1.5e-6  # W/Pa: 80 % of what pressure takes reaches the water


def exact(dives=8):
    made = runs(np.random.default_rng(1), dives, noise=0.0)
    more = (PER_PRESSURE - TRUTH["power_per_pressure"]) * made.pressure
    return dataclasses.replace(made, power=made.power + more)


def test_without_noise_what_is_told_is_what_was_logged():
    c = run_columns(fit_pump(exact()))
    assert np.allclose(c["fitted_energy_J"], c["energy_J"], rtol=1e-9)
    assert np.allclose(c["fitted_volume_m3"], c["volume_m3"], rtol=1e-9, atol=1e-15)
    assert np.allclose(c["fitted_efficiency"], c["efficiency"], rtol=1e-8, atol=1e-12)


def test_a_row_is_the_runs_own():
    r = dataclasses.replace(exact(), time=np.arange(96.0))
    r.power[5] = np.nan
    c = run_columns(fit_pump(r))
    assert c["time_s"][7] == 7.0
    assert c["energy_J"][7] == r.power[7] * r.duration[7]
    assert c["efficiency"][7] == pytest.approx(r.pressure[7] * r.volume[7] / c["energy_J"][7])
    assert c["counts"][5] == 0.0
    assert np.isnan(c["efficiency"][5])
    assert c["counts"].sum() == 95


def test_bands_are_sums_over_runs_of_neighbouring_pressures():
    r = exact()
    bands = efficiency_bands(fit_pump(r))
    assert sum(band.runs for band in bands) == r.power.size
    assert np.all(np.diff([band.pressure for band in bands]) > 0.0)
    deepest = np.argsort(r.pressure)[-bands[-1].runs :]
    work = np.sum(r.pressure[deepest] * r.volume[deepest])
    energy = np.sum(r.power[deepest] * r.duration[deepest])
    assert bands[-1].efficiency == pytest.approx(work / energy, rel=1e-12)
    assert bands[-1].fitted == pytest.approx(bands[-1].efficiency, rel=1e-9)
    assert bands[-1].volume == pytest.approx(r.volume[deepest].mean())


def test_without_volumes_there_is_no_efficiency():
    r = dataclasses.replace(exact(), volume=None)
    fit = fit_pump(r)
    assert efficiency_bands(fit) == []
    c = run_columns(fit)
    for name in ("volume_m3", "efficiency", "fitted_volume_m3", "fitted_efficiency"):
        assert np.all(np.isnan(c[name]))


def check(r, limit=None):
    check_runs(r, np.ones(r.power.size, bool), depth_limit=limit)


def test_more_work_than_energy_is_a_wrong_unit():
    r = exact()
    check(r)
    work, energy = np.sum(r.pressure * r.volume), np.sum(r.power * r.duration)
    wrong = dataclasses.replace(r, pressure=10.0 * r.pressure)  # bar for dbar
    with refused(InputError, field="pressure_Pa") as e:
        check(wrong)
    assert e.value.field == "pressure_Pa"
    deep = wrong.pressure > 2e5
    told = float(str(e.value).split("from the battery, ")[1].split(" ")[0])
    here = np.sum((wrong.pressure * r.volume)[deep]) / np.sum((r.power * r.duration)[deep])
    assert told == pytest.approx(here, rel=0.01)
    assert work < energy


def test_far_below_the_rating_is_a_wrong_unit():
    r = dataclasses.replace(exact(), volume=None)
    check(r, limit=2000.0)
    with refused(InputError, field="pressure_Pa", holds={100.0}):
        check(r, limit=100.0)


def test_a_pressure_far_too_small_is_said():
    """mbar taken for Pa: of what pressure takes a hundredth would reach the water."""
    r = exact()
    share = TRUTH["delivery"] / PER_PRESSURE
    usual = [line for line in fit_sentences(fit_pump(r)) if "wrong scale" in line]
    assert len(usual) == 1
    assert f"{100.0 * share:.1f} % would reach" in usual[0]
    wrong = dataclasses.replace(r, pressure=0.01 * r.pressure)
    said = [line for line in fit_sentences(fit_pump(wrong)) if "check them" in line]
    assert len(said) == 1
    assert f"{share:.1f} % would reach" in said[0]
