"""What deep dives tell and no vehicle's file may hold; temperatures that a log lacks."""

from dataclasses import replace

import numpy as np
import pytest

from swimbladder.errors import InputError
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion.deep import identified_vehicle, identify_deep, out_of_place
from swimbladder.estimation.motion.deep_model import body_of, deep_dive, priors_of
from swimbladder.io.config import load_vehicle
from swimbladder.io.vehicle_file import vehicle_file
from tests.estimation.motion.deep import dived, made_up_column, made_up_vehicle
from tests.estimation.motion.test_deep import RUNS, TRUTH, begin_of


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return made_up_vehicle(tmp_path_factory.mktemp("place")), made_up_column()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("thermal_expansion", -1.23e-3, "has to be -0.001 or more 1/K"),
        ("thermal_expansion", 0.02, "has to be 0.01 or less 1/K"),
        ("drag_up", 0.02, "rising_ratio has to be 0.1 or more"),
        ("drag_up", 11.0, "10 or less"),
        ("compressibility", -1e-11, "0 or more 1/Pa"),
        ("stiffening", 2e-14, "1e-14 or less"),
        ("trapped_air", -1e-6, "trapped_air has to be 0 or more m3"),
        ("pump_delivery", -0.1, "delivery would be -8e-08 m3/s, and delivery has to be more than"),
        ("valve", 0.0, "flow has to be more than 0"),
        ("creep", 2e-6, "1e-06 or less m3/s"),
    ],
)
def test_a_value_without_a_place_is_one_that_no_file_reads(scene, tmp_path, name, value, says):
    vehicle, _ = scene
    values = TRUTH | {name: value}
    (said,) = out_of_place(vehicle, values, list(TRUTH))
    assert said.startswith(f"{name} comes out {value:.4g}")
    assert says in said
    assert said.endswith(f"`fixed={{'{name}': 'VALUE'}}`.")
    if name == "compressibility":  # it is held at 0 where dives hardly tell it
        return
    with pytest.raises(InputError):
        read_again(vehicle, values, tmp_path / "vehicle.toml")


def read_again(vehicle, values, path):
    path.write_text(vehicle_file(identified_vehicle(vehicle, values)))
    return load_vehicle(path)


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"drag_up": 0.1},
        {"thermal_expansion": -1e-3},
        {"creep": -1e-10},
        {"pump_start": -1e-6},
        {"inertia": 0.5},
        {"trapped_air": 1e-5},
        {"stiffening": -1e-14},
    ],
)
def test_a_value_with_a_place_is_read_again(scene, tmp_path, changed):
    vehicle, _ = scene
    values = TRUTH | changed
    assert out_of_place(vehicle, values, list(TRUTH)) == []
    after = read_again(vehicle, values, tmp_path / "vehicle.toml")
    assert after.drag.rising_ratio == values["drag_up"]


def test_a_fitted_value_without_a_place_is_said(scene) -> None:
    """As logged the hull would shrink by 2e-3 per kelvin: temperatures of something else."""
    vehicle, column = scene
    body = body_of(vehicle)
    log, _ = dived(
        vehicle,
        body,
        column,
        TRUTH,
        np.random.default_rng(5),
        runs=RUNS,
        hours=12.0,
        start=begin_of(body, TRUTH, column, 0.05),
        wave=0.2,
    )
    # A sensor that tells a twentyfifth of the hull's warmth, the other way round.
    share = TRUTH["thermal_expansion"] / -2e-3
    odd = replace(log, temperature=15.0 + share * (log.temperature - 15.0))
    known = {"thermal_expansion": Prior(0.0, 2e-3)}
    found = identify_deep([odd], [column], vehicle, priors=known)
    assert found.parameters["thermal_expansion"].origin == "data"
    assert not found.identified
    assert not found.inconsistent
    assert found.result_vehicle is vehicle
    first = found.sentences[0]
    assert first.startswith("thermal_expansion comes out -0.00")
    assert "which vehicle.toml cannot hold: thermal_expansion has to be -0.001 or more" in first
    assert "Check temperature_degC of the log" in first


def test_a_given_value_without_a_place_is_refused(scene) -> None:
    vehicle, column = scene
    log, _ = dived(
        vehicle,
        body_of(vehicle),
        column,
        TRUTH,
        np.random.default_rng(5),
        runs=RUNS,
        hours=12.0,
        start=begin_of(body_of(vehicle), TRUTH, column, 0.05),
    )
    with pytest.raises(InputError, match=r"^fixed: .*drag_up=0\.05"):
        identify_deep([log], [column], vehicle, fixed={"drag_up": 0.05})
    known = {"thermal_expansion": Prior(1.0, 0.1)}
    with pytest.raises(InputError, match=r"^priors: "):
        identify_deep([log], [column], vehicle, priors=known)


def test_missing_temperatures_are_filled_by_time(scene) -> None:
    vehicle, column = scene
    body = body_of(vehicle)
    log, whole = dived(
        vehicle,
        body,
        column,
        TRUTH,
        np.random.default_rng(5),
        runs=RUNS,
        hours=12.0,
        start=begin_of(body, TRUTH, column, 0.05),
    )
    water = np.interp(whole.pressure, column.pressure, column.temperature)
    # A hull that is warmer than the water by what falls evenly in time.
    warmer = 3.0 - 2.0 * (log.time - log.time[0]) / (log.time[-1] - log.time[0])
    logged = np.interp(log.pressure, column.pressure, column.temperature) + warmer
    full = deep_dive(replace(log, temperature=logged), column, vehicle)
    assert full.unwarmed == 0
    gaps = logged.copy()
    missing = [40, 41, 42, 200]
    gaps[missing] = np.nan
    filled = deep_dive(replace(log, temperature=gaps), column, vehicle)
    assert filled.unwarmed == 4
    assert filled.temperature == pytest.approx(full.temperature, abs=1e-9)
    # At the ends, where one side is all there is, the difference stays.
    gaps[:30] = np.nan
    begun = deep_dive(replace(log, temperature=gaps), column, vehicle)
    at = int(np.flatnonzero(log.time == begun.time[0])[0])
    assert begun.unwarmed == 30 - at + 4
    assert (begun.temperature - water)[: 30 - at] == pytest.approx(warmer[30])
    none = deep_dive(replace(log, temperature=np.full(len(log), np.nan)), column, vehicle)
    assert none.unwarmed == len(none.time)
    assert none.temperature == pytest.approx(water)


def test_missing_temperatures_are_told(scene) -> None:
    vehicle, column = scene
    body = body_of(vehicle)
    log, _ = dived(
        vehicle,
        body,
        column,
        TRUTH,
        np.random.default_rng(5),
        runs=RUNS[:3],
        hours=6.0,
        start=begin_of(body, TRUTH, column, 0.05),
    )
    gaps = log.temperature.copy()
    gaps[50] = np.nan
    none = np.full(len(log), np.nan)
    held = {n: m.mean for n, m in priors_of(vehicle, {}).items() if n in ("drag", "inertia")}
    said = [
        " ".join(
            identify_deep(
                [replace(log, temperature=one)],
                [column],
                vehicle,
                free=["compressibility"],
                fixed=held,
            ).assumptions
        )
        for one in (log.temperature, gaps, none)
    ]
    assert "temperatures of the hull" not in said[0]
    assert f"lacks 1 of {len(log)} temperatures of the hull: they are filled by time" in said[1]
    assert "has no temperatures of the hull: it is as warm as the water" in said[2]
