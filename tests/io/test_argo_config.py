"""An Argo float's configuration as a mission."""

import json

import gsw
import numpy as np
import pytest
from scipy.io import netcdf_file

from swimbladder.errors import InputError
from swimbladder.io.config import load_mission

# made up, with the words of a 4000 m float's
CONFIG = {
    "CONFIG_PM01_CyclePeriod": "5",
    "CONFIG_PM08_DriftDepth": "2000",
    "CONFIG_PM09_ProfileDepth": "3500",
    "CONFIG_PT05_PressureTargetToleranceForStabilization": "40",
    "CONFIG_PT06_MaxPressureBeforeEmergencyAscent": "3900",
    "CONFIG_PT18_AverageDescentSpeed": "30",
    "CONFIG_PT23_AverageAscentSpeed": "80",
    "CONFIG_PT24_PressureCheckPeriodDuringAscent": "3",
    "CONFIG_PT25_MinPressureDiffForPumpAction": "12",
    "CONFIG_PT26_PressureCheckPeriodDuringDescent": "6",
    "CONFIG_PT27_MinPressureDiffForEVAction": "5",
    "CONFIG_PG08_MinPressureDiffForPumpAction": "4",
}

BEHAVIOUR = {
    "CONFIG_PT10_GroundingMode": "0",
    "CONFIG_PT11_MinOilVolumeForGroundingDetection": "47",
    "CONFIG_PT12_MinPressureThresholdToSwitchPressureWhenGrounding": "200",
    "CONFIG_PT13_GroundingSwitchPressureAdjustment": "100",
    "CONFIG_PG00_NbDaysWithoutSurfacingAfterIceDetection": "10",
    "CONFIG_PG01_NbDaysWithoutSurfacingBeforeDisablingIceDetection": "90",
    "CONFIG_PG03_IceDetectionStartPressure": "50",
    "CONFIG_PG04_IceDetectionStopPressure": "20",
    "CONFIG_PG05_TemperatureThreshold": "-1790",
    "CONFIG_PG15_OilVolumeMinForGroundingDetection": "900",  # of the way down from the ice
}


def written(folder, names):
    path = folder / "it_config.json"
    path.write_text(json.dumps(names))
    return path


def test_a_cycle_takes_its_period_and_waits_where_it_is_early(tmp_path) -> None:
    park, on, up = load_mission(written(tmp_path, {"missions": [CONFIG]})).phases
    depths = -gsw.z_from_p(np.array([2000.0, 3500.0, 3900.0]), 45.0)
    assert [p.kind for p in (park, on, up)] == ["park", "park", "surface"]
    assert [park.depth, on.depth] == pytest.approx(depths[:2])
    assert on.duration == pytest.approx((depths[1] - depths[0]) / 0.03)
    assert park.duration + on.duration + depths[1] / 0.08 + up.duration == pytest.approx(5 * 86400)
    metres = depths[1] / 3500.0
    assert park.parameters == pytest.approx(
        {
            "ascent_interval": 180.0,
            "ascent_progress": 12.0 * metres,
            "descent_interval": 360.0,
            "descent_progress": 5.0 * metres,
            "tolerance": 40.0 * metres,
            "slow_progress": 4.0 * metres,
            "depth_step": 0.1 * metres,
        }
    )
    assert load_mission(tmp_path / "it_config.json").safety.deepest == pytest.approx(depths[2])


@pytest.mark.parametrize(
    ("ice", "run"),
    [("PG0", "PT03_PumpMaxDurationDuringAscent"), ("IC0", "TC03_PumpActionMaxTimeAscent")],
)
def test_near_the_surface_it_comes_up_slower_in_shorter_runs(tmp_path, ice, run) -> None:
    slow = {
        f"CONFIG_{ice}6_SlowDownPressure": "150",
        f"CONFIG_{ice}9_PumpActionDuration": "500",
        f"CONFIG_{run}": "1120",
    }
    *_, up = load_mission(written(tmp_path, CONFIG | slow)).phases
    metres = float(-gsw.z_from_p(3500.0, 45.0)) / 3500.0
    assert up.parameters["slow_depth"] == pytest.approx(150.0 * metres)
    assert up.parameters["slow_share"] == pytest.approx(500.0 / 1120.0)


def test_a_float_that_profiles_from_its_park_depth_has_one_phase_less(tmp_path) -> None:
    names = CONFIG | {"CONFIG_PM09_ProfileDepth": "2000"}
    assert [p.kind for p in load_mission(written(tmp_path, names)).phases] == ["park", "surface"]


# Argo's standard names, with two units that differ from those of JSON
STANDARD = {
    "CONFIG_PM01_CyclePeriod": "CycleTime_days",
    "CONFIG_PM08_DriftDepth": "ParkPressure_dbar",
    "CONFIG_PM09_ProfileDepth": "ProfilePressure_dbar",
    "CONFIG_PT03_PumpMaxDurationDuringAscent": "PumpActionMaxTimeAscent_csec",
    "CONFIG_PT05_PressureTargetToleranceForStabilization": (
        "PressureTargetToleranceForStabilisation_dbar"
    ),
    "CONFIG_PT06_MaxPressureBeforeEmergencyAscent": "PressureMaxBeforeEmergencyAscent_dbar",
    "CONFIG_PT18_AverageDescentSpeed": "DescentSpeed_mm/s",
    "CONFIG_PT23_AverageAscentSpeed": "AscentSpeed_cm/s",
    "CONFIG_PT24_PressureCheckPeriodDuringAscent": "PressureCheckTimeAscent_minutes",
    "CONFIG_PT25_MinPressureDiffForPumpAction": "AscentVerticalThresholdForBuoyancyAction_dbar",
    "CONFIG_PT26_PressureCheckPeriodDuringDescent": "PressureCheckTimeDescent_seconds",
    "CONFIG_PT27_MinPressureDiffForEVAction": "DescentVerticalThresholdForBuoyancyAction_dbar",
    "CONFIG_PG06_SlowDownPressure": "AscentSpeedStartPressureThresholdForSlowPhase_dbar",
    "CONFIG_PG08_MinPressureDiffForPumpAction": (
        "IceDetectionAscentVerticalThresholdForBuoyancyAction_dbar"
    ),
    "CONFIG_PG09_PumpActionDuration": "IceDetectionPumpActionMaxTimeAscent_csec",
    "CONFIG_PT10_GroundingMode": "GroundingMode_LOGICAL",
    "CONFIG_PT11_MinOilVolumeForGroundingDetection": "OilVolumeMinForGroundingDetection_cm^3",
    "CONFIG_PT12_MinPressureThresholdToSwitchPressureWhenGrounding": (
        "GroundingModeMinPresThreshold_dbar"
    ),
    "CONFIG_PT13_GroundingSwitchPressureAdjustment": "GroundingModePresAdjustment_dbar",
    "CONFIG_PG00_NbDaysWithoutSurfacingAfterIceDetection": (
        "IceDetectionSpringInhibitionDelaySinceLastIceEvasion_days"
    ),
    "CONFIG_PG01_NbDaysWithoutSurfacingBeforeDisablingIceDetection": (
        "IceDetectionMaxDaysNoTransmission_NUMBER"
    ),
    "CONFIG_PG03_IceDetectionStartPressure": "IceDetectionMixedLayerPMax_dbar",
    "CONFIG_PG04_IceDetectionStopPressure": "IceDetectionMixedLayerPMin_dbar",
    "CONFIG_PG05_TemperatureThreshold": "IceDetection_degC",
}
# what they count in is mm/s, min and mdegC in JSON
FACTORS = {"cm/s": 0.1, "seconds": 60.0, "degC": 1e-3}


def meta(folder, names, missions=(), *, kind="Argo meta-data", without=""):
    """Write a meta-data file: names and values at launch, and the first mission's among several."""
    path = folder / "7900001_meta.nc"
    with netcdf_file(path, "w") as file:
        file.createDimension("STRING128", 128)
        file.createDimension("STRING32", 32)
        file.createVariable("DATA_TYPE", "c", ("STRING32",))[:] = list(kind.ljust(32))
        file.createDimension("N_MISSIONS", 2)
        for what, held in (("LAUNCH_CONFIG", dict(names)), ("CONFIG", dict(missions))):
            size = f"N_{what}_PARAM"
            file.createDimension(size, len(held) or 1)
            letters = file.createVariable(f"{what}_PARAMETER_NAME", "c", (size, "STRING128"))
            letters[:] = [list(name.ljust(128)) for name in held or [""]]
            if without == what:
                continue
            shape = (size,) if what == "LAUNCH_CONFIG" else ("N_MISSIONS", size)
            values = file.createVariable(f"{what}_PARAMETER_VALUE", "d", shape)
            values._FillValue = np.array([99999.0])
            row = np.array(list(held.values()) or [99999.0], dtype=float)
            values[:] = row if len(shape) == 1 else [row, np.full(len(row), 77.0)]
    return path


def standard(names):
    """Return the names and values of JSON by Argo's standard names."""
    named = {STANDARD[name]: float(value) for name, value in names.items() if name in STANDARD}
    return {f"CONFIG_{n}": FACTORS.get(n.rpartition("_")[2], 1.0) * v for n, v in named.items()}


def same(found, wanted) -> None:
    """Compare the phases of two missions."""
    assert [p.kind for p in found.phases] == [p.kind for p in wanted.phases]
    for one, other in zip(found.phases, wanted.phases, strict=True):
        assert [one.depth, one.duration] == pytest.approx([other.depth, other.duration])
        assert dict(one.parameters) == pytest.approx(dict(other.parameters))


def test_a_meta_data_file_is_the_mission_of_the_json(tmp_path) -> None:
    ice = {"CONFIG_PG06_SlowDownPressure": "150", "CONFIG_PG09_PumpActionDuration": "500"}
    names = CONFIG | ice | {"CONFIG_PT03_PumpMaxDurationDuringAscent": "1120"}
    wanted = load_mission(written(tmp_path, names))
    for path in (meta(tmp_path, standard(names)), written(tmp_path, standard(names))):
        same(load_mission(path), wanted)
    names |= {n: v for n, v in BEHAVIOUR.items() if n in STANDARD}
    wanted = load_mission(written(tmp_path, names))
    assert wanted.grounding is not None
    assert wanted.ice is not None
    for path in (meta(tmp_path, standard(names)), written(tmp_path, standard(names))):
        found = load_mission(path)
        assert found.phases[0].grounding == "shift"
        assert found.grounding.model_dump() == pytest.approx(wanted.grounding.model_dump())
        assert found.ice.model_dump() == pytest.approx(wanted.ice.model_dump())


def test_the_first_mission_is_over_the_launch_and_hours_are_hours(tmp_path) -> None:
    launch = standard(CONFIG) | {"CONFIG_ParkPressure_dbar": 1000.0, "CONFIG_Empty_COUNT": 99999.0}
    first = {"CONFIG_ParkPressure_dbar": 2000.0, "CONFIG_CycleTime_hours": 120.0}
    launch.pop("CONFIG_CycleTime_days")
    park, *_ = load_mission(meta(tmp_path, launch, first)).phases
    wanted, *_ = load_mission(written(tmp_path, CONFIG)).phases
    assert [park.depth, park.duration] == pytest.approx([wanted.depth, wanted.duration])


@pytest.mark.parametrize(
    ("change", "more", "says"),
    [
        ({}, {"kind": "Argo trajectory"}, "none of the type Argo meta-data (got 'Argo trajectory'"),
        ({}, {"without": "LAUNCH_CONFIG"}, "LAUNCH_CONFIG_PARAMETER_VALUE: not a value for each"),
        ({"CONFIG_ParkPressure_dbar": 99999.0}, {}, "CONFIG_ParkPressure_... or CONFIG_..._D"),
        ({"CONFIG_AscentSpeed_cm/s": -9.0}, {}, "AscentSpeed_cm/s: it is no number above 0 (got"),
        ({"CONFIG_CycleTime_days": 1.0}, {}, "the cycle's period is over before"),
        ({"CONFIG_CycleTime_fortnights": 2.0}, {}, "CONFIG_CycleTime_fortnights: unknown unit"),
        (
            {"CONFIG_CycleTime_dbar": 2.0},
            {},
            "CONFIG_CycleTime_dbar: the unit 'dbar' is of another",
        ),
    ],
)
def test_what_is_no_meta_data_is_refused(tmp_path, change, more, says: str) -> None:
    names = change | standard(CONFIG) | change
    with pytest.raises(InputError) as refused:
        load_mission(meta(tmp_path, names, **more))
    assert says in str(refused.value)


def test_a_damaged_meta_data_file_is_refused(tmp_path) -> None:
    path = meta(tmp_path, standard(CONFIG))
    for size in range(8, path.stat().st_size, 397):
        (tmp_path / "cut.nc").write_bytes(path.read_bytes()[:size])
        with pytest.raises(InputError):
            load_mission(tmp_path / "cut.nc")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"CONFIG_PM08_DriftDepth": "deep"}, "DriftDepth: it is no number above 0 (got 'deep')"),
        ({"CONFIG_PT23_AverageAscentSpeed": "0"}, "AscentSpeed: it is no number above 0 (got '0')"),
        ({"CONFIG_PT11_MinOilVolumeForGroundingDetection": "-1"}, "no number of at least 0"),
        ({"CONFIG_PG05_TemperatureThreshold": "-9000"}, "no number of at least -3000"),
        (BEHAVIOUR | {"CONFIG_PG04_IceDetectionStopPressure": "60"}, "it is not above the start"),
        (BEHAVIOUR | {"CONFIG_PT13_GroundingSwitchPressureAdjustment": "0"}, "grounding.shift"),
        ({"CONFIG_PM01_CyclePeriod": "x"}, "CyclePeriod: it is no number above 0"),
        ({"CONFIG_PM01_CyclePeriod": "1"}, "the cycle's period is over before"),
        (BEHAVIOUR | {"CONFIG_PT10_GroundingMode": "5"}, "PT10_GroundingMode: it is no mode of"),
        (
            {
                "CONFIG_PT24_PressureCheckPeriodDuringAscent": None,
                "CONFIG_PT24_PressureCheckPeriodDuringAcsent": "2",
            },
            "Acsent: it is no known name. Write PressureCheckPeriodDuringAscent",
        ),
        ({"CONFIG_PM08_DriftDepth": None}, "DriftDepth: it is missing"),
        ({"CONFIG_PM01_CyclePeriod": None}, "CyclePeriod: it is missing"),
    ],
)
def test_what_is_no_configuration_is_refused(tmp_path, change, says: str) -> None:
    names = {n: v for n, v in (CONFIG | change).items() if v is not None}
    with pytest.raises(InputError) as refused:
        load_mission(written(tmp_path, names))
    assert says in str(refused.value)


def test_grounding_and_ice_are_those_of_the_configuration(tmp_path) -> None:
    task = load_mission(written(tmp_path, CONFIG | BEHAVIOUR))
    metres = float(-gsw.z_from_p(3500.0, 45.0)) / 3500.0
    assert task.grounding is not None
    assert task.grounding.volume == pytest.approx(47e-6)
    assert task.grounding.shift == pytest.approx(100.0 * metres)
    assert task.grounding.least_depth == pytest.approx(200.0 * metres)
    assert [p.grounding for p in task.phases] == ["shift", None, None]
    assert task.ice is not None
    assert task.ice.model_dump() == pytest.approx(
        {
            "temperature": -1.79,
            "start_depth": 50.0 * metres,
            "stop_depth": 20.0 * metres,
            "wait": 10 * 86400.0,
            "longest": 90 * 86400.0,
        }
    )
    stays = load_mission(written(tmp_path, CONFIG | BEHAVIOUR | {"CONFIG_PT10_GroundingMode": "1"}))
    assert stays.phases[0].grounding is None
    off = BEHAVIOUR | {"CONFIG_PG00_NbDaysWithoutSurfacingAfterIceDetection": "0"}
    assert load_mission(written(tmp_path, CONFIG | off)).ice is None, "0 days: it seeks none"
    plain = load_mission(written(tmp_path, CONFIG))
    assert plain.grounding is plain.ice is None


@pytest.mark.parametrize(
    "text", ['{"missions": []}', '{"missions": {"a": 1}}', "{}", "[{}]", '[{"a']
)
def test_a_file_without_names_is_refused(tmp_path, text: str) -> None:
    (tmp_path / "it.json").write_text(text)
    with pytest.raises(InputError, match=r"no names of a configuration|no JSON"):
        load_mission(tmp_path / "it.json")


def test_a_broken_file_is_refused(tmp_path) -> None:
    (tmp_path / "it.json").write_text('{"CONFIG_PM01_CyclePeriod": ')
    with pytest.raises(InputError, match="no JSON"):
        load_mission(tmp_path / "it.json")


def test_a_real_configuration_by_standard_names(data_dir, tmp_path) -> None:
    path = data_dir / "argo_arvor" / "deep_4000_config.json"
    names = standard(json.loads(path.read_text())["missions"][0])
    assert len(names) == len(STANDARD)
    same(load_mission(meta(tmp_path, names)), load_mission(path))


def test_a_real_configuration_of_each_kind(data_dir) -> None:
    for name, deepest, phases in (("deep_4000", 4000.0, 3), ("shallow_2000", 800.0, 2)):
        task = load_mission(data_dir / "argo_arvor" / f"{name}_config.json")
        assert len(task.phases) == phases
        assert task.phases[-2].depth == pytest.approx(-gsw.z_from_p(deepest, 45.0))
        assert task.phases[0].parameters["ascent_interval"] == 120.0
        assert task.phases[0].grounding == "shift"
        assert (task.ice is None) == (name == "shallow_2000"), "its IC00 is 0"
