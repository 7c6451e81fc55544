"""Law and supervisor in the loop: the oracle is both of them called in Python, as on the board."""

import math

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.cli import main
from swimbladder.control import supervisor
from swimbladder.control.registry import LAWS, bind
from swimbladder.control.supervisor import Reason, Watched
from swimbladder.control.supervisor_limits import command_limits, supervisor_parameters
from swimbladder.io.config import load_vehicle
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.vehicle import Supervisor
from tests.codegen.laws import example

FEUP, POSITIONER = load_vehicle("feup-em"), load_vehicle("ntnu-bv")
STEPS = {
    "setpoints": [(0.0, 2.0), (100.0, 3.0), (160.0, 1.5)],
    "duration": 260.0,
    "start_depth": 1.5,
}
ON_THE_BOTTOM = {"bottom_depth": 2.5, "checked": False}


def noisy(vehicle):
    sensors = vehicle.sensors.model_copy(update={"depth_noise": 2e-3, "volume_noise": 2e-7})
    return vehicle.model_copy(update={"sensors": sensors})


class Board:
    """A law under the supervisor in Python, as a law that `simulate` asks at every tick."""

    def __init__(self, vehicle):
        self.law, self.p = bind(vehicle.controller)
        self.tick = vehicle.controller.sample_time
        self.limits, self.ends = supervisor_parameters(vehicle, self.tick), command_limits(vehicle)
        nothing = Watched(math.nan, 0.0, 0.0, 0.0, False, 0, 0)
        self.watch = supervisor.initial(self.limits, nothing, 0.0)
        self.state, self.wait, self.wanted, self.alarm = None, 0, 0.0, math.nan

    def __call__(self, seen, reference):
        if self.state is None:
            self.state = self.law.initial(self.p, seen, reference)
        if self.wait <= 0 and self.watch.recovery.reason == 0:
            asked = min(reference, self.watch.proof.allowed)
            u, self.state, later = self.law.step(self.p, self.state, seen, asked)
            self.wanted = min(max(u, self.ends[0]), self.ends[1])
            self.wait = max(math.ceil(later / self.tick - 1e-9), 1)
        self.wait -= 1
        before = self.watch.recovery.reason
        watched = Watched(seen.depth, 0.0, seen.volume, math.nan, False, 0, 0, reference)
        command, self.watch, _ = supervisor.step(self.limits, self.watch, watched, self.wanted)
        if self.watch.recovery.reason and not before:
            self.alarm = seen.time
        return command


@pytest.mark.parametrize("vehicle", [FEUP, POSITIONER], ids=lambda v: v.name)
@pytest.mark.parametrize("where", [{}, ON_THE_BOTTOM], ids=["open water", "unknown bottom"])
def test_the_loop_is_law_and_supervisor_called_in_python(vehicle, where):
    vehicle = noisy(vehicle)
    board = Board(vehicle)
    theirs = sb.simulate(vehicle, law=board, supervised=False, seed=4, **STEPS, **where)
    ours = sb.simulate(vehicle, supervised=True, seed=4, **STEPS, **where)
    assert ours.supervised
    assert not theirs.supervised
    assert ours.depth == pytest.approx(theirs.depth, abs=1e-9)
    assert ours.volume == pytest.approx(theirs.volume, abs=1e-13)
    if not where:
        assert ours.alarm is None
        assert math.isnan(board.alarm)
    else:
        assert ours.alarm == (Reason(board.watch.recovery.reason), pytest.approx(board.alarm))
        took_over = [e for e in ours.events if e.kind.startswith("the supervisor took over")]
        assert [e.time for e in took_over] == [pytest.approx(board.alarm)]
        assert ours.depth[-1] < 1.0  # and brought it up


def flown_by(name, *, supervised, **how):
    """Return runs of a law's example from 1.5 m, in noise."""
    vehicle, parameters, tick = example(name)
    given = {"law": LAWS[name], "parameters": parameters, "sample_time": tick, "seed": 4}
    given |= {"start_depth": 1.5, "supervised": supervised}
    return simulate_ensemble(noisy(vehicle), **given, **how)


@pytest.mark.promise("test-pushes")
def test_a_push_that_proves_the_motor_is_in_the_loop():
    """Before a vehicle goes deeper, where its law rests while it holds a depth."""
    given = {"setpoints": [(0.0, 1.5), (100.0, 3.0)], "duration": 130.0, "count": 1}
    runs = [
        flown_by("observer", supervised=supervised, keep="trajectory", **given)
        for supervised in (False, True)
    ]
    alone, under = (run["volume"].to_numpy().ravel() for run in runs)
    before = runs[0]["time"].to_numpy() <= 100.0
    assert (under[before] == alone[before]).all()
    soon = ~before & (runs[0]["time"].to_numpy() <= 103.0)
    assert under[soon].max() > alone[soon].max() + 13.6e-6  # what a step of 1.5 m has to show


@pytest.mark.parametrize("name", [pytest.param("planned", marks=pytest.mark.prove), "adrc"])
@pytest.mark.promise("no-cost")
def test_a_law_that_moves_the_volume_anyway_steps_under_it_as_it_does_alone(name):
    """What a step needs was shown while the law held: whenever in the turn of pushes it comes."""
    for at in (120.0, 140.0, 160.0):
        given = {"setpoints": [(0.0, 1.5), (at, 3.0)], "duration": at + 60.0, "count": 20}
        alone, under = (
            flown_by(name, supervised=supervised, **given)["settle2"].to_numpy()
            for supervised in (False, True)
        )
        assert np.median(under) <= np.median(alone) + 0.3 + 1e-9  # a sample


@pytest.mark.promise("no-cost")
def test_what_is_shown_while_a_law_holds_leaves_the_depth_where_it_was():
    held = {"setpoints": [(0.0, 1.5)], "duration": 1200.0, "count": 20}
    alone, under = (flown_by("adrc", supervised=supervised, **held) for supervised in (False, True))
    extra = (under["actuator_travel"] - alone["actuator_travel"]).to_numpy()
    assert (extra > 100e-6).all()  # m3: it was pushed
    assert np.median(extra) * 3.0 < 3e-3  # at most 3 L/h
    assert float(under["rms_error"].max()) < 5e-3
    assert not under["alarm"].any()


def ramp(to, speed):
    """Return set-points from 1.5 m on, after two minutes; at once for an infinite speed."""
    times = np.arange(0.0, (to - 1.5) / speed, 0.3)
    on_the_way = [(120.0 + t, 1.5 + speed * (t + 0.3)) for t in times[:-1]]
    return [(0.0, 1.5), *on_the_way, (120.0 + (times[-1] if len(times) else 0.0), to)]


@pytest.mark.parametrize(
    ("name", "to", "speed"),
    [
        ("planned", 3.0, math.inf),
        ("planned", 20.0, 0.3),
        ("adrc", 20.0, math.inf),
        ("adrc", 20.0, 0.1),
        ("cascade", 20.0, 0.1),
    ],
)
@pytest.mark.promise("test-pushes", faults=["blocked outward"])
def test_no_block_of_the_piston_outward_drowns_the_vehicle(name, to, speed):
    """Wherever it is: it is met before the way down, or stops the vehicle at the end of it."""
    vehicle, parameters, tick = example(name)
    blocks = 1.5 * 4.04e-6 + np.arange(10e-6, 200e-6, 2e-6)
    flown = simulate_ensemble(
        noisy(vehicle),
        count=len(blocks),
        setpoints=ramp(to, speed),
        duration=1100.0,
        start_depth=1.5,
        seed=1,
        law=LAWS[name],
        parameters=parameters,
        sample_time=tick,
        supervised=True,
        vary={"V_max": blocks},
    )
    assert (flown["final_depth"] < to + 0.5).all()
    assert (flown["alarm"] > 0).sum() > 3


@pytest.mark.parametrize(
    "kind", ["electrohydraulic", pytest.param("positioner", marks=pytest.mark.prove)]
)
@pytest.mark.promise("depth-limit")
def test_a_law_that_goes_down_too_fast_to_turn_is_stopped_in_time(kind, tmp_path, capsys):
    """The cascade of a new vehicle file goes past the depth from which a slow pump comes up."""
    path = tmp_path / "new.toml"
    assert main(["vehicle", "new", str(path), "--kind", kind]) == 0
    capsys.readouterr()
    vehicle = load_vehicle(path)
    deepest = supervisor_parameters(vehicle, vehicle.controller.sample_time).deep.deepest
    run = {"setpoints": [(0.0, 1.5), (120.0, np.array([5.0, 25.0, 35.0, 49.0]))]}
    run |= {"count": 4, "duration": 900.0, "start_depth": 1.5}
    alone = simulate_ensemble(vehicle, supervised=False, **run)
    under = simulate_ensemble(vehicle, supervised=True, **run)
    assert (alone["greatest_depth"] > deepest).to_numpy().tolist()[-2:] == [True, True]
    assert (under["greatest_depth"] < deepest).all()
    assert under["alarm"].to_numpy().tolist()[0] == 0
    assert under["alarm"].to_numpy().tolist()[-2:] == [Reason.DEPTH_LIMIT] * 2


def test_a_vehicle_with_a_table_of_it_flies_under_its_supervisor():
    assert not sb.simulate(FEUP, **STEPS).supervised
    vehicle = FEUP.model_copy(update={"supervisor": Supervisor(depth_limit=20.0)})
    under = sb.simulate(vehicle, **STEPS)
    assert under.supervised
    assert not sb.simulate(vehicle, supervised=False, **STEPS).supervised
    data = simulate_ensemble(vehicle, count=1, **STEPS)
    assert data["alarm"].to_numpy().tolist() == [0]
    assert float(data["final_depth"][0]) == pytest.approx(under.depth[-1], abs=1e-9)


def test_the_lanes_of_an_ensemble_are_single_runs_under_the_same_supervisor():
    vary = {"V_0": np.linspace(-60e-6, 60e-6, 43)}
    vehicle = FEUP.model_copy(update={"supervisor": Supervisor(neutral_range=40e-6)})
    data = simulate_ensemble(vehicle, count=43, vary=vary, start_volume=0.0, **STEPS)
    alarms, times = data["alarm"].to_numpy(), data["alarm_time"].to_numpy()
    trim = np.abs(vary["V_0"])
    assert (alarms[trim > 50e-6] == Reason.NOT_MOVING_AS_MODELLED).all()
    assert not alarms[trim < 40e-6].any()
    assert (np.isfinite(times) == (alarms > 0)).all()
    for lane in (0, 21, 42):  # the last one in a block that is filled up
        board = Board(vehicle)  # which knows of no trim
        trimmed = vehicle.model_copy(update={"trim_error": float(vary["V_0"][lane])})
        theirs = sb.simulate(trimmed, law=board, supervised=False, start_volume=0.0, **STEPS)
        assert data["final_depth"].to_numpy()[lane] == pytest.approx(theirs.depth[-1], abs=1e-9)
        assert times[lane] == pytest.approx(board.alarm, nan_ok=True)


def test_what_the_battery_shows_is_that_of_a_source_with_a_resistance():
    from swimbladder.sim.closed_loop.supervision import battery_voltage

    resistance, inside, kappa, q, u, emf = 2.0, 0.3, 1.5e5, 2e-5, 9.0, 12.0
    current = (emf - kappa * q) / (resistance + inside)
    full = battery_voltage(emf, inside / resistance, kappa, emf, q)
    assert full == pytest.approx(emf - inside * current, rel=1e-12)
    assert battery_voltage(emf, inside / resistance, kappa, -emf, -q) == pytest.approx(full)
    assert battery_voltage(emf, inside / resistance, kappa, u, u / kappa) == emf  # no current
