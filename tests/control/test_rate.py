"""The law of profiling floats: drag's balance, its rules, its closed loop, and logged decisions."""

import csv
import gzip
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from swimbladder.codegen.twin import twin
from swimbladder.control.law import Measurement
from swimbladder.control.rate import (
    RATE,
    Decision,
    RateParameters,
    approach_speed,
    ascend,
    decide,
    initial,
    rounded,
    step,
    volume_change,
    whole,
)
from swimbladder.control.registry import LAWS, law_by_name, law_parameters
from swimbladder.errors import InputError
from tests.quoted import refused

# The settings of the float whose logs were read, one mbar taken as a centimetre of water.
FLOAT = RateParameters(
    coefficient=1.6e-6 / 0.01**2,
    tolerance=5.0,
    near=15.0,
    far=25.0,
    slow_speed=0.02,
    near_speed=0.03,
    far_speed=0.04,
    ascent_speed=0.08,
    speed_band=0.02,
    speed_step=0.01,
    volume_step=2e-6,
    dead=60.0,
    run=26.0,
    window=600.0,
)
SMOOTH = FLOAT._replace(speed_step=0.0, volume_step=0.0)


def test_it_is_a_law_of_volume_changes() -> None:
    assert LAWS["rate"].command == "volume change"
    assert law_by_name("rate") is RATE
    assert set(RATE.units) == set(RATE.parameters._fields)
    said = {**FLOAT._asdict(), "coefficient": "160 cm3 s2/dm2", "near": "1500 cm"}
    assert law_parameters(RATE, said, sample_time=1.0) == pytest.approx(FLOAT)
    with refused(InputError, field="controller.parameters.tolerance"):
        law_parameters(RATE, {"coefficient": 0.016}, sample_time=1.0)


@given(st.floats(-60000.0, 60000.0))
def test_rounding_is_to_the_nearest_halves_away_from_zero(number: float) -> None:
    expected = math.copysign(math.floor(abs(number) + 0.5), number)
    assert whole(number) == expected
    assert rounded(number, 0.0) == number
    assert rounded(number, 4.0) == pytest.approx(4.0 * whole(number / 4.0))


@given(
    c=st.floats(0.001, 0.1),
    w=st.floats(-0.3, 0.3),
    wanted=st.floats(-0.3, 0.3),
    neutral=st.floats(-1e-4, 1e-4),
)
def test_the_change_gives_the_speed_by_drags_balance(c, w, wanted, neutral) -> None:
    """rho g (neutral - V) = k_dt w|w| before and after, whatever the neutral volume is."""
    p = SMOOTH._replace(coefficient=c)
    before = neutral - c * w * abs(w)
    after = before + volume_change(p, w, wanted)
    drag = (neutral - after) / c
    reached = math.copysign(math.sqrt(abs(drag)), drag)
    assert c * reached * abs(reached) == pytest.approx(c * wanted * abs(wanted), abs=1e-12)


def test_the_speed_asked_for_falls_towards_the_target() -> None:
    speeds = [approach_speed(FLOAT, x) for x in (25.1, 25.0, 15.1, 15.0, 5.1)]
    assert speeds == [0.04, 0.03, 0.03, 0.02, 0.02]
    # Zones given the other way round: the middle speed is never asked for, as in the float's log.
    swapped = FLOAT._replace(near=25.0, far=15.0)
    assert [approach_speed(swapped, x) for x in (25.1, 15.1, 15.0)] == [0.04, 0.04, 0.02]


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize(
    ("distance", "idle"),
    [
        (50.0, list(range(3, 21))),  # haste is welcome
        (20.0, [2, 3, 4]),
        (10.0, [1, 2, 3]),
        (4.0, [0, 1, 2]),  # towards the target, slowly; away: at once
    ],
)
def test_what_calls_for_an_action(distance: float, idle: list[int], up: float) -> None:
    """The band is 2 steps; in the tolerance, any speed away from the target."""
    target = 500.0
    for steps in range(-20, 21):
        decision = decide(FLOAT, target - up * distance, up * 0.01 * steps, target)
        acts = decision.change != 0.0
        assert acts == (steps not in idle), steps
        wanted = approach_speed(FLOAT, distance) if distance > 5.0 else 0.0
        if acts:
            assert decision.speed == pytest.approx(up * wanted)
            # Lighter where it sinks too fast, in whole steps of 2 cm3.
            assert decision.change * (up * 0.01 * steps - decision.speed) > 0.0
            assert decision.change / 2e-6 == pytest.approx(round(decision.change / 2e-6))
        else:
            assert decision == Decision(up * 0.01 * steps, 0.0)


def test_to_the_surface_it_never_rises_too_fast() -> None:
    acts = [steps for steps in range(-15, 16) if ascend(FLOAT, -0.01 * steps).change != 0.0]
    assert acts == [*range(-15, 7), *range(9, 16)]
    assert ascend(FLOAT, -0.06) == Decision(-0.08, pytest.approx(44e-6))


def sink(p: RateParameters, target: float, hours: float, neutral: float, surface: float = math.inf):
    """Fly the law on m w' = -rho g (V - neutral) - k_dt w|w| by SciPy: depths, changes, times."""
    mass, weight = 40.0, 1.03e4
    k_dt = p.coefficient * weight

    def motion(_, y, volume):
        return [y[1], (-weight * (volume - neutral) - k_dt * y[1] * abs(y[1])) / mass]

    t, y, volume = 0.0, [1.0, 0.0], 0.0
    state = initial(p, Measurement(0.0, y[0], 0.0), target)
    seen, changes = [], []
    while t < 3600.0 * hours:
        reference = target if t < surface else 0.0
        change, state, sleep = step(p, state, Measurement(t, y[0], volume), reference)
        seen.append((t, y[0], y[1]))
        if change != 0.0:
            changes.append((t, change))
        volume += change
        y = solve_ivp(motion, (t, t + sleep), y, args=(volume,), rtol=1e-8).y[:, -1].tolist()
        t += sleep
    return np.array(seen), changes


def test_it_finds_a_target_without_knowing_the_neutral_volume() -> None:
    """An exact coefficient and no rounding: one action sets each speed, and it rests at the end."""
    seen, changes = sink(SMOOTH, 200.0, 4.0, neutral=30e-6)
    assert abs(seen[-1, 1] - 200.0) <= SMOOTH.tolerance
    assert abs(seen[-1, 2]) < 1e-3
    assert sum(change for _, change in changes) == pytest.approx(30e-6, abs=1e-7)
    coarse, more = sink(FLOAT, 200.0, 4.0, neutral=30e-6)
    assert np.all(np.abs(coarse[coarse[:, 0] > 9000.0, 1] - 200.0) < FLOAT.tolerance)
    assert len(more) <= 12


def test_a_reference_of_0_brings_it_up() -> None:
    seen, _ = sink(FLOAT, 200.0, 3.0, neutral=30e-6, surface=7200.0)
    rising = seen[seen[:, 0] > 7500.0]
    assert np.all(rising[:, 2] < -0.055)
    assert rising[-1, 1] < 100.0


def test_a_depth_that_is_no_number_calls_for_nothing() -> None:
    state = initial(FLOAT, Measurement(0.0, 100.0, 0.0), 200.0)
    change, state, sleep = step(FLOAT, state, Measurement(0.0, math.nan, 0.0), 200.0)
    assert (change, sleep, state.looking) == (0.0, FLOAT.dead, 0.0)
    assert initial(FLOAT, Measurement(0.0, math.nan, 0.0), 7.0).old_depth == 7.0


def test_it_can_be_translated() -> None:
    """Its twin in float32 decides alike."""
    small = twin(RATE)
    for depth, speed, target in ((10.0, 0.02, 200.0), (183.0, 0.06, 200.0), (198.0, -0.013, 200.0)):
        changes = []
        for law in (RATE, small):
            state = law.initial(FLOAT, Measurement(0.0, depth, 0.0), target)
            change, state, run = law.step(FLOAT, state, Measurement(0.0, depth, 0.0), target)
            assert (change, run) == (0.0, FLOAT.run)
            later = Measurement(26.0, depth + 26.0 * speed, 0.0)
            changes.append(law.step(FLOAT, state, later, target)[0])
        assert changes[1] == pytest.approx(changes[0], rel=1e-6)


def test_a_look_in_the_band_takes_one_measurement() -> None:
    state = initial(FLOAT, Measurement(0.0, 201.0, 0.0), 200.0)
    sleeps, time = [], 0.0
    for _ in range(30):
        depth = 201.0 - 0.002 * time
        change, state, sleep = step(FLOAT, state, Measurement(time, depth, 0.0), 200.0)
        assert change == 0.0
        sleeps.append(sleep)
        time += sleep
    assert sleeps == [26.0] + [60.0] * 29
    assert state.speed == pytest.approx(-0.002)
    # Carried off: noticed, and stopped.
    change = 0.0
    while change == 0.0:
        depth += 0.006 * sleep
        change, state, sleep = step(FLOAT, state, Measurement(time, depth, 0.0), 200.0)
        time += sleep
    assert change == pytest.approx(2e-6)
    assert depth < 205.0


# -- the logged float ----------------------------------------------------------------------------


def rows(path: Path) -> list[dict[str, str]]:
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as text:
        return list(csv.DictReader(text))


@pytest.mark.data
def test_the_volumes_are_those_that_the_float_wanted(data_dir: Path) -> None:
    """c = 1.6 mL per (mbar/s)^2, 'coeff 16/10', whole 2 mL: every decision but a few misprints."""
    p = FLOAT._replace(coefficient=1.6e-6, speed_step=1.0)  # speeds in mbar/s
    found = []
    for row in rows(data_dir / "mermaid_p0051" / "actions.csv.gz"):
        if row["want_mL"] and abs(float(row["v_from_mbar_s"])) < 100.0:
            change = volume_change(p, float(row["v_from_mbar_s"]), float(row["v_to_mbar_s"]))
            found.append(abs(1e6 * change - float(row["want_mL"])))
    off = np.array(found)
    print(f"{len(off)} decisions, the very volume in {np.mean(off < 1e-6):.2%}")
    assert len(off) > 2900
    assert np.mean(off < 1e-6) > 0.995


@pytest.mark.data
def test_it_acts_when_the_float_acted(data_dir: Path) -> None:
    """At each look of 26 s at a target, with the settings of its dive, in mbar and mbar/s."""
    folder = data_dir / "mermaid_p0051"
    dives = {row["dive"]: row for row in rows(folder / "dives.csv")}
    pressures: dict[str, list[tuple[float, float, str]]] = {}
    for row in rows(folder / "pressure.csv.gz"):
        pressures.setdefault(row["dive"], []).append(
            (float(row["t_s"] or "nan"), float(row["P_mbar"]), row["stage"])
        )
    acted: dict[str, list[tuple[float, float, float]]] = {}
    for row in rows(folder / "actions.csv.gz"):
        if row["want_mL"] and row["t_s"] and abs(float(row["v_from_mbar_s"])) < 100.0:
            acted.setdefault(row["dive"], []).append(
                (float(row["t_s"]), float(row["v_to_mbar_s"]), float(row["want_mL"]))
            )
    agreed, speeds, count, actions = 0, 0, 0, 0
    for name, samples in pressures.items():
        p = settings(dives.get(name, {}))
        if p is None:
            continue
        for look in runs(samples):
            stage = look[-1][2]
            said = re.match(
                r"(\d+)\+/-(\d+)mbar", dives[name].get(f"stage{float(stage or 9):.0f}") or ""
            )
            if not said:
                continue
            time, depth = look[-1][0], look[-1][1]
            held = p._replace(tolerance=float(said[2]))
            speed = float(np.polyfit(*np.array([x[:2] for x in look]).T, 1)[0])
            decision = decide(held, depth, speed, float(said[1]))
            did = [a for a in acted.get(name, []) if -1.0 <= a[0] - time <= 12.0]
            count += 1
            actions += bool(did)
            agreed += bool(did) == (decision.change != 0.0)
            speeds += bool(did) and decision.speed == did[0][1]
    print(f"{count} looks, {agreed / count:.2%} agree; {actions} act, {speeds / actions:.2%} alike")
    assert count > 800
    assert actions > 400
    assert agreed / count > 0.98
    assert speeds / actions > 0.98


def settings(dive: dict[str, str]) -> RateParameters | None:
    """Return the settings of a dive in mbar, mbar/s and m3; None where they were not logged."""
    if not all(dive.get(name) for name in ("cmd_near", "cmd_far", "cmd_rate")):
        return None
    near, near_speed = (float(x) for x in re.findall(r"\d+", dive["cmd_near"]))
    far, far_speed = (float(x) for x in re.findall(r"\d+", dive["cmd_far"]))
    (rate,) = (float(x) for x in re.findall(r"\d+", dive["cmd_rate"]))
    return FLOAT._replace(
        coefficient=1.6e-6,
        near=near,
        near_speed=near_speed,
        far=far,
        far_speed=far_speed,
        slow_speed=rate,
        speed_band=rate,
        speed_step=1.0,
    )


def runs(samples: list[tuple[float, float, str]]):
    """Yield the looks of 12 samples or more in which no two are 8 s apart."""
    times = np.array([s[0] for s in samples])
    ends = [*(np.flatnonzero(~(np.diff(times) < 8.0)) + 1), len(samples)]
    first = 0
    for last in ends:
        if last - first >= 12:
            yield samples[first:last]
        first = last


@pytest.mark.parametrize(("slope", "dead"), [(5e-6, 60.0), (4e-6, 60.0), (8e-6, 30.0)])
def test_a_steep_thermocline_is_passed_at_the_excess_of_each_look(slope: float, dead: float):
    """Where drag carries the excess at once, w' = -N'/(2c): c w^2/N' metres from look to look."""
    law = FLOAT._replace(
        coefficient=1e-3,
        tolerance=5.0,
        near=10.0,
        far=20.0,
        far_speed=0.1,
        near_speed=0.1,
        slow_speed=0.1,
        speed_band=0.02,
        speed_step=0.0,
        volume_step=0.0,
        dead=dead,
        run=10.0,
        window=60.0,
    )
    target, time, depth, excess = 3000.0, 0.0, 100.0, 0.0
    state = initial(law, Measurement(time=time, depth=depth, volume=math.nan), target)
    marks = []
    for _ in range(60):
        change, state, wait = step(
            law, state, Measurement(time=time, depth=depth, volume=math.nan), target
        )
        if change < 0.0:
            marks.append((time, depth))
        excess -= change
        # exact: excess = c w^2, d(excess)/dz = -N'
        speed = math.sqrt(excess / law.coefficient)
        rests = min(wait, 2.0 * law.coefficient * speed / slope)
        left = speed - 0.5 * slope / law.coefficient * rests
        depth += 0.5 * (speed + left) * rests
        excess = law.coefficient * left * left
        time += wait
    passes = np.diff(np.array(marks), axis=0)
    assert len(passes) > 20
    per_look = law.coefficient * law.far_speed**2 / slope
    assert passes[1:, 1] == pytest.approx(per_look)
    assert passes[1:, 0] == pytest.approx(law.dead + law.run)


def test_it_rests_once_a_look_in_the_band_called_for_nothing() -> None:
    """At half a window and after: what it remembers of depths may move on, that it rests stays."""
    p, seen = FLOAT, Measurement(0.0, 100.0, 0.0)
    state = initial(p, seen, 100.0)
    rests = []
    for now in np.arange(0.0, 2.0 * p.window, p.dead):
        _, state, _ = step(p, state, Measurement(float(now), 100.0, 0.0), 100.0)
        rests.append(state.resting)
    assert set(rests[2:]) == {1.0}
