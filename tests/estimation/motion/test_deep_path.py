"""A deep dive as the filter takes it: volumes while runs last, and what a still dive is told as."""

import numpy as np
import pytest

from studies import deep_drawn as study
from swimbladder.estimation.motion.deep_model import (
    Noise,
    body_of,
    deep_dive,
    deep_path,
    drive_volume,
    filtered,
    priors_of,
    run_volumes,
)
from tests.estimation.motion.deep import made_up_column, made_up_log, made_up_vehicle

SHORT = 4.5e-6  # m3


def test_the_volume_while_runs_last(tmp_path) -> None:
    """The mean of each step, against runs that are summed at 10 ms: a pump primes, and then gives.

    Runs overlap steps, each other and the end of the log (7110 s); one is too short to give any.
    """
    plain = made_up_vehicle(tmp_path)
    actuator = plain.actuator.model_copy(update={"start_volume": SHORT})
    vehicle = plain.model_copy(update={"actuator": actuator})
    runs = [
        ("pump", 101.0, 20.0),
        ("valve", 300.0, 1.3),
        ("pump", 305.0, 300.0),
        ("pump", 470.0, 2.0),
        ("pump", 7000.0, 15.0),
        ("valve", 7010.0, 90.0),
        ("pump", 7090.0, 60.0),
    ]
    dive = deep_dive(made_up_log(runs, 2.0), made_up_column(), vehicle)
    priors = priors_of(vehicle, {})
    path = deep_path(dive, body_of(vehicle), priors)
    for beyond in (-2e-6, 0.0, 2e-6):
        values = {name: prior.mean for name, prior in priors.items()}
        values |= {"pump_delivery": 0.8, "pump_start": beyond, "creep": 0.0}
        t = np.arange(0.005, path.track.steps.sum(), 0.01)
        volume = np.zeros(len(t))
        for (device, begin, seconds), given in zip(runs, run_volumes(values, dive), strict=True):
            # 0.8 mL/s, of which the pump gives 0.8, less the seconds in which it makes up for that
            primes = (SHORT + beyond) / (0.8 * 0.8e-6) if device == "pump" else 0.0
            if given != 0.0:
                volume += given * np.clip((t - begin - primes) / (seconds - primes), 0.0, 1.0)
        step = np.searchsorted(np.cumsum(path.track.steps), t)
        mean = np.bincount(step, volume) / np.bincount(step)
        assert np.abs(mean).max() > 1e-4
        assert drive_volume(values, path) == pytest.approx(mean, abs=2e-8)


def test_a_still_dive_is_told_as_the_mission_engine_flies_it(monkeypatch) -> None:
    """No waves, no noise, the true cast and parameters: 1 cm at each look, in minutes of runs.

    Its pump starts fall short by 2.0 mL less than its file says.
    """
    monkeypatch.setattr(study, "LAYERS_MOVE", 1e-9)
    monkeypatch.setattr(study, "NOISE", 1e-3)
    monkeypatch.setattr(study, "RESOLUTION", 1e-3)
    monkeypatch.setattr(study, "OFF", dict.fromkeys(study.OFF, 0.0))
    dived = study.drawn(15, seed=11)
    assert dived.values["pump_start"] < -1.5e-6
    vehicle = study.the_vehicle()
    body, dive = body_of(vehicle), deep_dive(dived.log, dived.column, vehicle)
    path = deep_path(dive, body, study.known())
    quiet = Noise(pressure=30.0, water=1e-5, drift=1e-12, runs=1e-5, lasts=300.0)
    found = filtered(body, dived.values, quiet, path)
    later = path.time[1:] > path.time[0] + 900.0  # the volume at the beginning is found by then
    assert later.sum() > 400
    assert np.sqrt(np.mean(found.innovation[later] ** 2)) < 30.0
    assert np.abs(found.innovation[later]).max() < 150.0
