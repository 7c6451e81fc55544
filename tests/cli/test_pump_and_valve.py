"""Commands about loops of voltages and positions refuse a pump and valve in one sentence."""

import pytest

from swimbladder.cli import main

COMMANDS = {
    "compare": ["LOG", "--vehicle"],
    "identify-actuator": ["LOG", "--vehicle"],
    "design-experiment": ["--bottom-depth", "4 m"],
    "plan": ["--step", "1:3"],
    "pool": ["--simulate"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_pump_and_valve_is_refused_and_told_where_to_go(command, tmp_path, capsys):
    log = tmp_path / "log.csv"
    rows = [f"{t / 2},{1 + t % 3 / 100},{t % 5 * 1e-6},{t % 7}" for t in range(60)]
    log.write_text("time_s,depth_m,volume_m3,voltage_V\n" + "\n".join(rows) + "\n")
    words = [str(log) if word == "LOG" else word for word in COMMANDS[command]]
    vehicle = ["example-float"]
    given = [*words, *vehicle] if "--vehicle" in words else [*vehicle, *words]
    assert main([command, *given]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "actuator.kind: a pump that runs or not and a valve have no loop of voltages" in told
    assert "`mission`" in told
    assert told.count("error:") == 1


def test_a_new_vehicle_of_the_kind_says_what_takes_it(tmp_path, capsys):
    path = tmp_path / "float.toml"
    assert main(["vehicle", "new", str(path), "--kind", "pump-valve"]) == 0
    assert "swimbladder simulate" in capsys.readouterr().out
    assert main(["energy", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "J/mL" in capsys.readouterr().out
