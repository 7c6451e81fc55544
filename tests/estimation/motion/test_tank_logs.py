"""Single logs of a float in a tank, measured by others: an interval that holds, or a no.

Its constants and a fit of two logs together by others give 8.6 kg; no log by itself was known to a
percent.
"""

import numpy as np
import pandas as pd
import pytest

from swimbladder.estimation.motion import identify
from swimbladder.io.config import load_vehicle
from swimbladder.io.logs import read_log

LOGS = (13, 31, 33, 37, 45, 47, 49, 51, 59, 63)
FEW = (45, 47, 51, 59)
VEHICLE = load_vehicle("ntnu-bv")


@pytest.fixture(scope="module")
def missions(data_dir):
    return pd.read_csv(data_dir / "ntnu_bv" / "missions.csv.gz")


def answer(table, path, **options):
    table.to_csv(path, index=False)
    log = read_log(path, log_format="ntnu-bv")
    return identify([log], VEHICLE, profiles=False, choices=False, **options)


@pytest.mark.parametrize(
    "logs", [FEW, pytest.param(LOGS, marks=pytest.mark.prove)], ids=["few", "all"]
)
def test_single_logs_agree_or_say_no(missions, tmp_path, logs):
    found = [answer(missions[missions["log"] == n], tmp_path / f"{n}.csv") for n in logs]
    known = [f for f in found if f.identified]
    assert known
    drifting = found[logs.index(45)]  # its trapped air leaves: in a tank psi cannot be -5 cm3/m
    assert "stratified" in [f.kind for f in drifting.findings]
    water = VEHICLE.water.density * VEHICLE.hull.displaced_volume
    for f in known:
        low, high = f.derived["mass"].ci95
        assert high > 0.9 * water
        assert low < 2.0 * water
        assert f.parameters["K2"].std > 0.03 * f.parameters["K2"].value
    for name in ("K2", "T2"):
        ends = np.array([f.parameters[name].ci95 for f in known])
        assert ends[:, 0].max() < ends[:, 1].min()  # one value is in all intervals


@pytest.mark.parametrize(
    "spoil",
    [
        lambda t: t.assign(depth_raw_m=3.28084 * t["depth_raw_m"]),  # feet
        lambda t: t.assign(t_s=2.0 * t["t_s"]),
        lambda t: t.assign(piston_position_m=0.0515 - t["piston_position_m"]),
        pytest.param(lambda t: t.assign(piston_position_m=0.02), marks=pytest.mark.prove),
        lambda t: t.assign(
            depth_raw_m=t["depth_raw_m"].sample(frac=1.0, random_state=1).to_numpy()
        ),
        pytest.param(
            lambda t: t.assign(piston_position_m=np.roll(t["piston_position_m"], 60)),
            marks=pytest.mark.prove,
        ),
    ],
    ids=["feet", "time", "backwards", "constant volume", "shuffled depth", "late volume"],
)
def test_a_log_that_is_spoilt_is_no_vehicle(missions, tmp_path, spoil, request):
    found = answer(spoil(missions[missions["log"] == 47]), tmp_path / "spoilt.csv")
    if "feet" in request.node.name:
        assert any("a depth in feet was read as metres" in f.sentence for f in found.findings)
    assert any(f.kind == "still" for f in found.findings) == ("constant" in request.node.name)
    assert not found.identified
    assert found.result_vehicle == VEHICLE
