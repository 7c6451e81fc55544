"""Tables of pump runs: named, mapped, with units, and what is wrong said with its line."""

import numpy as np
import pytest

from swimbladder.errors import LogError
from swimbladder.io.pump_runs import read_pump_runs

HEAD = "duration_s,pressure_Pa,power_W,volume_m3,temperature_degC,dive\n"


def table(folder, text):
    path = folder / "runs.csv"
    path.write_text(text)
    return path


def test_the_columns_by_their_own_names(tmp_path):
    rows = "10,1e5,7,1e-5,20,1\n20,5e6,11,,14,2\n30,1e7,15,3e-5,,3\n"
    found = read_pump_runs(table(tmp_path, HEAD + rows))
    assert list(found.duration) == [10.0, 20.0, 30.0]
    assert list(found.pressure) == [1e5, 5e6, 1e7]
    assert list(found.power) == [7.0, 11.0, 15.0]
    assert np.isnan(found.volume[1])
    assert np.isnan(found.temperature[2])
    assert list(found.dive) == [1.0, 2.0, 3.0]


def test_dives_may_have_names(tmp_path):
    rows = "10,1e5,7,1e-5,20,2020-07-B\n20,5e6,11,,14,\n30,1e7,15,3e-5,,2020-07-A\n"
    again = "30,1e7,15,3e-5,,2020-07-B\n"
    found = read_pump_runs(table(tmp_path, HEAD + rows + again))
    np.testing.assert_array_equal(found.dive, [1.0, np.nan, 2.0, 1.0])
    one = read_pump_runs(table(tmp_path, HEAD + rows), where={"dive": "2020-07-A"})
    assert list(one.duration) == [30.0]


def test_other_names_units_and_rows(tmp_path):
    text = "device,ms,P [dbar],V,I [mA],ml\npump,10000,10,15,500,8\nvalve,500,20,15,600,0\n"
    found = read_pump_runs(
        table(tmp_path, text + "pump,60000,1000,14.5,1000,70\n"),
        columns={
            "duration_s": "ms@ms",
            "pressure_Pa": "P [dbar]",
            "voltage_V": "V@V",
            "current_A": "I [mA]",
            "volume_m3": "ml@mL",
        },
        where={"device": "pump"},
    )
    assert list(found.duration) == [10.0, 60.0]
    assert found.pressure == pytest.approx([1e5, 1e7])
    assert found.power == pytest.approx([7.5, 14.5])
    assert found.volume == pytest.approx([8e-6, 7e-5])
    assert found.voltage == pytest.approx([15.0, 14.5])
    assert found.dive is None
    assert any("2 of 3 rows" in line for line in found.report)


def test_a_format_says_which_rows_count_as_for_logs(tmp_path):
    form = tmp_path / "form.toml"
    form.write_text('[log]\n[log.where]\ndevice = "pump"\n')
    text = "device,duration_s,pressure_Pa,power_W\npump,10,1e5,7\nvalve,20,2e5,8\n"
    path = table(tmp_path, text)
    assert list(read_pump_runs(path, form=form).duration) == [10.0]
    assert list(read_pump_runs(path, form=form, where={"device": "valve"}).duration) == [20.0]


def test_a_voltage_beside_the_power(tmp_path):
    text = "duration_s,pressure_Pa,power_W,mV\n10,1e5,7,14500\n20,1e7,15,\n"
    found = read_pump_runs(table(tmp_path, text), columns={"voltage_V": "mV@mV"})
    assert list(found.power) == [7.0, 15.0]
    assert found.voltage == pytest.approx([14.5, np.nan], nan_ok=True)
    assert read_pump_runs(table(tmp_path, text)).voltage is None
    own = text.replace("mV", "voltage_V,current_A").replace(",\n", ",14.2,1\n")
    both = read_pump_runs(table(tmp_path, own.replace("14500", "14.5,9")))
    assert list(both.power) == [7.0, 15.0]  # what was drawn is stated, not V I
    assert list(both.voltage) == [14.5, 14.2]


@pytest.mark.parametrize(
    ("text", "columns", "words"),
    [
        ("duration_s,pressure_Pa\n10,1e5\n", {}, "no column voltage_V, or power_W"),
        ("duration_s,pressure_Pa,power_W\n10,1000,7\n10,2000,8\n", {}, "likely in dbar or bar"),
        ("duration_s,pressure_Pa,power_W\n10,1e5,7\n1e6,1e7,8\n", {}, "line 3, duration_s"),
        ("duration_s,pressure_Pa,power_W\n10,1e5,7\n-9,1e7,8\n", {}, "Mend the row, or leave"),
        ("duration_s,pressure_Pa,power_W\n10,1e5,7\n10,2e9,8\n", {}, "line 3, pressure_Pa"),
        (HEAD + "10,1e5,7,12,20,1\n", {}, "line 2, volume_m3"),
        (HEAD + "10,1e5,-7,1e-5,20,1\n", {}, "Give what is drawn as positive numbers"),
        (HEAD + "10,1e5,7e6,1e-5,20,1\n", {}, 'State its unit: `columns={"power_W": "NAME@mW"}`'),
        (HEAD + "10,1e5,7,1e-5,20,1\n", {"depth_m": "d"}, "no such column of a table of runs"),
        (HEAD + "10,1e5,7,1e-5,20,1\n", {"power_W": "watts"}, "watts"),
        (
            "duration_s,pressure_Pa,power_W,voltage_V\n10,1e5,7,14500\n",
            {},
            '"voltage_V": "voltage_V@mV"',
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path, text, columns, words):
    with pytest.raises(LogError) as caught:
        read_pump_runs(table(tmp_path, text), columns=columns)
    assert words in str(caught.value)
