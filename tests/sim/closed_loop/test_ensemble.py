"""Ensembles: each lane is the run of a single vehicle, and the summaries are those of its run."""

import math
from typing import Any

import numpy as np
import pytest

from swimbladder.control.cascade import CASCADE, CascadeParameters
from swimbladder.errors import InputError
from swimbladder.physics.dynamics import plant
from swimbladder.sim.closed_loop import StopReason, simulate, simulate_ensemble, step_metrics
from swimbladder.sim.engine.chain import base_steps
from swimbladder.vehicle import IdentifiedMotion, Sensors
from tests.cf import cf_problems
from tests.vehicles import BLENDED, SWITCHED, paper, pump

N = 37  # not a multiple of a block's lanes
RNG = np.random.default_rng(7)
STARTS = RNG.uniform(0.6, 3.5, N)
TARGETS = RNG.uniform(0.5, 4.0, N)
MISSION: dict[str, Any] = dict(setpoints=[(0.0, 2.0), (60.0, TARGETS)], duration=180.0)


def alone(vehicle: Any, lane: int, **changes: Any) -> Any:
    mission = [(t, float(np.broadcast_to(z, N)[lane])) for t, z in MISSION["setpoints"]]
    run: dict[str, Any] = dict(
        setpoints=mission, duration=180.0, start_depth=float(STARTS[lane]), bottom_depth=4.5
    )
    return simulate(vehicle, **run | changes)


@pytest.fixture(scope="module")
def plain() -> Any:
    return simulate_ensemble(
        paper(), count=N, start_depth=STARTS, bottom_depth=4.5, keep="trajectory", **MISSION
    )


def test_lanes_are_single_runs(plain: Any) -> None:
    for lane in range(N):
        s = alone(paper(), lane)
        np.testing.assert_array_equal(plain.time, s.time)
        for name, scale in (("depth", 1.0), ("speed", 1.0), ("volume", 1e-4), ("command", 100.0)):
            ours = plain[name].values[:, lane]
            np.testing.assert_allclose(ours, getattr(s, name), rtol=0.0, atol=1e-9 * scale)


def test_an_ensemble_follows_cf(plain: Any) -> None:
    assert cf_problems(plain.transpose("lane", ...)) == []
    assert plain.stop.attrs["flag_meanings"].split()[0] == "finished"
    assert plain.command.attrs["units"] == "V"


def test_summaries_are_those_of_the_trajectories(plain: Any) -> None:
    summary = simulate_ensemble(paper(), count=N, start_depth=STARTS, bottom_depth=4.5, **MISSION)
    assert "depth" not in summary
    z, V = plain.depth.values, plain.volume.values
    for data in (plain, summary):
        near = dict(rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(data.final_depth, z[-1], **near)
        np.testing.assert_allclose(data.final_volume, V[-1], **near)
        np.testing.assert_allclose(data.least_depth, z.min(axis=0), **near)
        np.testing.assert_allclose(data.greatest_depth, z.max(axis=0), **near)
        np.testing.assert_allclose(data.least_volume, V.min(axis=0), **near)
        np.testing.assert_allclose(data.greatest_volume, V.max(axis=0), **near)
        travel = np.abs(np.diff(V, axis=0)).sum(axis=0)
        assert np.all(data.actuator_travel >= travel * (1 - 1e-12))
        np.testing.assert_allclose(data.actuator_travel, travel, rtol=2e-3)
        np.testing.assert_array_equal(data.stop, 0)
        np.testing.assert_allclose(data.stop_time, 180.0)
        rms = np.sqrt(np.mean((z[200:] - TARGETS) ** 2, axis=0))
        np.testing.assert_allclose(data.rms_error, rms, rtol=1e-9)
        for lane in range(N):
            m = step_metrics(
                plain.time[200:], z[200:, lane], start=z[200, lane], target=TARGETS[lane]
            )
            assert data.overshoot.values[lane] == pytest.approx(m.overshoot_pct, abs=1e-6)
            for name, expected in (("rise90", m.rise90_s), ("settle2", m.settle2_s)):
                value = data[name].values[lane]
                assert (math.isnan(value) and expected is None) or value == pytest.approx(expected)
    assert 0 < np.isnan(summary.settle2).sum() < N  # both kinds are among them


def test_summaries_of_lanes_that_meet_an_end_are_those_of_single_runs() -> None:
    """Ends of the stroke, the surface and the bottom, each met by some lanes within a sample."""
    stroke = paper().stroke.model_copy(update={"minimum": -4e-5, "maximum": 4e-5})
    vehicle = paper(stroke=stroke)
    far = np.linspace(2.0, 7.0, N)
    asked: dict[str, Any] = dict(duration=120.0, bottom_depth=7.0, seed=None)
    summary = simulate_ensemble(
        vehicle, count=N, start_depth=STARTS, setpoints=[(0.0, far), (60.0, 0.0)], **asked
    )
    met = np.zeros(4, int)
    for lane in range(N):
        s = simulate(
            vehicle,
            start_depth=float(STARTS[lane]),
            setpoints=[(0.0, far[lane]), (60.0, 0.0)],
            **asked,
        )
        met += [
            s.volume.min() <= -4e-5,
            s.volume.max() >= 4e-5,
            s.depth.min() < 0.3,
            s.depth.max() >= 7.0,
        ]
        near = dict(rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(summary.final_depth[lane], s.depth[-1], **near)
        np.testing.assert_allclose(summary.final_volume[lane], s.volume[-1], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(summary.greatest_depth[lane], s.depth.max(), **near)
        rms = np.sqrt(np.mean(s.depth[200:] ** 2))  # from 60 s on, about a set-point of 0
        np.testing.assert_allclose(summary.rms_error[lane], rms, **near)
    assert np.all(met > 0), met


@pytest.mark.parametrize("workers", [1, 3])
def test_neither_workers_nor_neighbours_change_a_lane(plain: Any, workers: int) -> None:
    few = simulate_ensemble(
        paper(),
        count=3,
        start_depth=STARTS[:3],
        bottom_depth=4.5,
        workers=workers,
        setpoints=[(0.0, 2.0), (60.0, TARGETS[:3])],
        duration=180.0,
    )
    np.testing.assert_array_equal(few.final_depth, plain.final_depth[:3])


def test_any_parameter_of_vehicle_and_law() -> None:
    K2 = RNG.uniform(6000.0, 9000.0, N)
    T2 = RNG.uniform(25.0, 45.0, N)
    psi = RNG.uniform(-4e-6, 6e-6, N)
    k_pz = RNG.uniform(-0.15e-3, -0.05e-3, N)
    T1 = RNG.uniform(0.01, 0.3, N)
    data = simulate_ensemble(
        paper(),
        count=N,
        start_depth=STARTS,
        bottom_depth=4.5,
        keep="trajectory",
        vary=dict(a_b=K2 / T2, d_l=1.0 / T2, psi=psi, k_pz=k_pz, T1=T1),
        **MISSION,
    )
    base = paper()
    for lane in range(0, N, 4):
        vehicle = paper(
            motion=IdentifiedMotion(K2=K2[lane], T2=T2[lane]),
            hull=base.hull.model_copy(update={"psi": psi[lane]}),
            actuator=base.actuator.model_copy(update={"T1": T1[lane]}),
        )
        gains = CascadeParameters(1002e3, k_pz[lane], -7.486e-7, -2.341e-3, 0.3)
        s = alone(vehicle, lane, law=CASCADE, parameters=gains, sample_time=0.3)
        np.testing.assert_allclose(data.depth.values[:, lane], s.depth, rtol=0.0, atol=1e-9)


LOSSES: dict[str, Any] = dict(R_b=0.3)
NONE: dict[str, Any] = dict(leak=0.0, friction=0.0, efficiency=1.0)  # all lanes go together


@pytest.mark.parametrize("losses", [LOSSES, NONE], ids=["losses", "none"])
@pytest.mark.parametrize("drag", [BLENDED, SWITCHED], ids=lambda d: d.law)
def test_nonlinear_drag_leaks_friction_and_a_sagging_supply(drag: Any, losses: Any) -> None:
    vehicle = pump(drag=drag, **losses)
    gains = CascadeParameters(k_pV=3e5, k_pz=-1e-4, k_iz=-1e-6, k_dz=-2e-3, S_p=0.5)
    run = dict(law=CASCADE, parameters=gains, sample_time=0.5, bottom_depth=9.0)
    starts = 2.0 + STARTS
    setpoints = [(0.0, 9.5), (80.0, 0.2)]
    data = simulate_ensemble(
        vehicle,
        count=N,
        start_depth=starts,
        setpoints=setpoints,
        duration=160.0,
        keep="trajectory",
        **run,
    )
    parts = base_steps(plant(vehicle), 0.5, 0.0)
    for lane in range(0, N, 6):
        s = simulate(
            vehicle,
            setpoints=setpoints,
            duration=160.0,
            start_depth=float(starts[lane]),
            parts=parts,
            checked=False,
            **run,
        )
        assert s.events
        assert np.abs(data.depth.values[:, lane] - s.depth).max() < 1e-9
        assert np.abs(data.volume.values[:, lane] - s.volume).max() < 1e-13


def test_a_trajectory_that_is_kept_changes_no_summary() -> None:
    """Without it all lanes take whole ticks together, over the switch of the drag's law too."""
    vehicle = pump(drag=SWITCHED, **NONE)
    run: dict[str, Any] = dict(
        law=CASCADE,
        parameters=CascadeParameters(k_pV=3e5, k_pz=-1e-4, k_iz=-1e-6, k_dz=-2e-3, S_p=0.1),
        sample_time=0.1,
        count=N,
        start_depth=2.0 + STARTS,
        setpoints=[(0.0, 3.0), (80.0, 6.0)],
        duration=160.0,
    )
    alone, kept = (
        simulate_ensemble(vehicle, keep=keep, **run) for keep in ("summary", "trajectory")
    )
    assert alone.attrs["steps_per_sample"] == 1
    assert np.abs(kept.speed).max() > 2.0 * plant(vehicle).epsilon
    for name in alone.data_vars:
        np.testing.assert_array_equal(alone[name], kept[name], err_msg=str(name))


def test_each_lane_has_noise_of_its_own() -> None:
    vehicle = paper(sensors=Sensors(depth_noise=2e-3))
    run: dict[str, Any] = dict(setpoints=[(0.0, 2.0)], duration=60.0, start_depth=2.0)
    data = simulate_ensemble(vehicle, count=N, seed=3, keep="trajectory", **run)
    again = simulate_ensemble(vehicle, count=5, seed=3, keep="trajectory", **run)
    other = simulate_ensemble(vehicle, count=5, seed=4, keep="trajectory", **run)
    np.testing.assert_array_equal(again.depth, data.depth[:, :5])
    assert not np.any(np.isclose(other.final_depth, again.final_depth, rtol=0.0, atol=1e-9))
    assert len(set(data.final_depth.values)) == N
    # lane 0 draws the same noise as a single run of that seed
    s = simulate(vehicle, seed=3, **run)
    np.testing.assert_allclose(data.depth.values[:, 0], s.depth, rtol=0.0, atol=1e-9)


def test_lanes_that_stop_do_not_stop_the_others() -> None:
    """Of three lanes one sinks below all seas, one rises out of the water, one arrives."""
    data = simulate_ensemble(
        paper(),
        count=3,
        start_depth=[90.0, 1.0, 2.0],
        start_volume=[-350e-6, 350e-6, 8e-6],
        setpoints=[(0.0, [90.0, 1.0, 2.0])],
        duration=1500.0,
        keep="trajectory",
        vary=dict(
            k_pV=[0.0, 0.0, 1002e3],
            load_drive=0.0,
            load_back=0.0,
            a_s=[1.0, 1e-3, 7.0],
        ),
    )
    codes = [StopReason.TOO_DEEP.code, StopReason.LEFT_WATER.code, StopReason.FINISHED.code]
    assert data.stop.values.tolist() == codes
    assert data.stop_time.values[2] == pytest.approx(1500.0)
    assert np.all(data.stop_time.values[:2] < 1500.0)
    assert abs(data.final_depth.values[2] - 2.0) < 1e-3
    assert np.all(np.isfinite(data.final_depth))


@pytest.mark.parametrize(
    ("field", "says", "given"),
    [
        ("count", "at least 1", dict(count=0)),
        ("vary['psy']", "Did you mean psi", dict(vary={"psy": 1.0})),
        ("vary['psi']", r"shape \(2,\)", dict(vary={"psi": [1.0, 2.0]})),
        ("vary['psi']", "not a number", dict(vary={"psi": math.nan})),
        ("start_depth", r"shape \(4,\)", dict(start_depth=[1.0] * 4)),
        ("start_depth", "lane 1 of 3 is below the bottom", dict(start_depth=[1.0, 6.0, 2.0])),
        ("start_depth", "lane 0 of 3 is outside the water", dict(start_depth=-2.0)),
        ("start_volume", "lane 2 of 3", dict(start_volume=[0.0, 0.0, 1.0])),
        ("start_volume", "lane 0 of 3", dict(start_volume=-1.0)),
        ("setpoints", "must grow", dict(setpoints=[(0.0, 1.0), (0.0, 2.0)])),
        ("setpoints", r"shape \(2,\)", dict(setpoints=[(0.0, [1.0, 2.0])])),
        ("duration", "above 0", dict(duration=0.0)),
        ("seed", "whole number", dict(seed=-4)),
        ("keep", "not a choice", dict(keep="everything")),
    ],
)
def test_what_is_refused(field: str, says: str, given: dict[str, Any]) -> None:
    run: dict[str, Any] = dict(
        count=3, start_depth=1.5, setpoints=[(0.0, 2.0)], duration=3.0, bottom_depth=5.0
    )
    with pytest.raises(InputError, match=says) as caught:
        simulate_ensemble(paper(), **run | given)
    assert caught.value.field == field


def test_the_shares_of_its_progress_make_the_whole() -> None:
    shares: list[float] = []
    simulate_ensemble(
        paper(),
        count=N,
        start_depth=2.0,
        setpoints=[(0.0, 2.0)],
        duration=3.0,
        advance=shares.append,
    )
    assert min(shares) > 0.0
    assert sum(shares) == pytest.approx(1.0, rel=1e-12)
