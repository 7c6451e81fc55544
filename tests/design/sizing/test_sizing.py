"""Sized drives against the steady drive, the dive's own arithmetic and every other candidate."""

import dataclasses
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

import swimbladder as sb
from swimbladder.design.sizing import (
    Dive,
    Sizing,
    columns,
    load_parts,
    requirements,
    size,
    sized_vehicle,
)
from swimbladder.design.sizing.candidates import combinations
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import read_model
from swimbladder.io.vehicle_file import vehicle_file
from swimbladder.physics.actuator import unified
from swimbladder.physics.buoyancy_engine import drive_map
from swimbladder.physics.electric import steady_drive
from swimbladder.physics.hull import neutral_volume, weight_mass
from swimbladder.physics.seawater import Cast, cast_column, uniform_column
from swimbladder.vehicle import Vehicle

BODY = sb.load_vehicle("example-eh")
DIVE = Dive(max_depth=1000.0, park_time=9 * 86400.0)


def _few(**changes):
    """Return a short list of parts, so that a test takes no time."""
    parts = load_parts()
    kept = {
        "supplies": (24.0,),
        "windings": (1.0, 2.5),
        "motors": parts.motors[1:4],
        "pumps": parts.pumps[:4],
        "amplifiers": parts.amplifiers[:2],
        "gears": parts.gears[2:],
        "screws": parts.screws,
        "pistons": parts.pistons[:3],
        "batteries": parts.batteries,
    }
    return parts.model_copy(update=kept | changes)


@pytest.fixture(scope="module")
def found() -> Sizing:
    return size(BODY, DIVE, parts=_few())


def test_the_stroke_is_the_sum_of_what_the_dive_asks() -> None:
    asked = requirements(BODY, uniform_column(BODY.water, 1001.0), DIVE)
    psi, rho, g = BODY.hull.psi, BODY.water.density, BODY.water.gravity
    k_dt, k_dl, eps = BODY.drag.k_dt, BODY.drag.k_dl, BODY.drag.epsilon
    force = k_dt * (0.1**2 - eps**2) + k_dl * eps  # eq. (16), turbulent above epsilon
    drive = force / (rho * g)
    trim = norm.ppf(0.975) * 20e-6
    wanted = (abs(psi) * 1000.0 + 2 * drive + 2 * trim) * 1.1
    assert asked.stroke == pytest.approx(wanted, rel=1e-9)
    assert sum(asked.shares.values()) == pytest.approx(asked.stroke, rel=1e-12)
    assert asked.rate == pytest.approx(2 * drive / 600.0, rel=1e-9)
    # psi is negative: the neutral volume sinks with depth and is pressed out again on the way up
    assert asked.moved.sum() == pytest.approx(2 * drive + abs(psi) * 1000.0, rel=1e-9)


def test_the_stroke_covers_the_drag_of_each_way() -> None:
    water = uniform_column(BODY.water, 1001.0)
    even = requirements(BODY, water, DIVE)
    drag = BODY.drag.model_copy(update={"rising_ratio": 0.6})
    motion = BODY.motion.model_copy(update={"drag": drag})
    asked = requirements(BODY.model_copy(update={"motion": motion}), water, DIVE)
    # freeboard apart, the upper end comes down by 0.4 of what the drag takes, and the turn with it
    assert even.stroke - asked.stroke == pytest.approx(0.4 * even.drive * 1.1, rel=1e-9)
    assert asked.rate == pytest.approx(0.8 * even.rate, rel=1e-9)
    assert sum(asked.shares.values()) == pytest.approx(asked.stroke, rel=1e-12)


@pytest.mark.parametrize("psi", [4e-6, -4e-6])
def test_what_the_neutral_volume_grows_by_is_pressed_out_on_either_way(psi: float) -> None:
    body = BODY.model_copy(update={"hull": BODY.hull.model_copy(update={"psi": psi})})
    asked = requirements(body, uniform_column(BODY.water, 101.0), Dive(max_depth=100.0))
    assert asked.moved.sum() == pytest.approx(2 * asked.drive + 100.0 * abs(psi), rel=1e-9)
    turn = 2 * asked.drive / 600.0
    assert asked.rate == pytest.approx(max(turn, psi * 0.1), rel=1e-9)
    # down: pressed out against half the bottom's pressure in the mean, as on the way up
    work = np.sum(asked.moved * asked.pressure) - 2 * asked.drive * asked.bottom_pressure
    assert work == pytest.approx(100.0 * abs(psi) * asked.bottom_pressure / 2.0, rel=0.03)


def test_the_trim_is_covered_as_often_as_it_says() -> None:
    dive = dataclasses.replace(DIVE, stroke_reserve=0.0, probability=0.9)
    asked = requirements(BODY, uniform_column(BODY.water, 1001.0), dive)
    trims = np.random.default_rng(3).normal(0.0, dive.trim_std, 40_000)
    low = trims + asked.neutral.min() - asked.drive
    high = trims + asked.neutral.max() + asked.drive
    stays = (low >= asked.lowest) & (high <= asked.lowest + asked.stroke)
    assert np.mean(stays) == pytest.approx(0.9, abs=4 * math.sqrt(0.09 / 40_000))


@pytest.mark.parametrize("kind", ["pump-valve", "electromechanical"])
def test_a_candidate_is_the_steady_drive(found: Sizing, kind: str) -> None:
    w = found.evaluation
    of_kind = [i for i, c in enumerate(found.batch.of) if c.kind == kind and w.feasible[i]]
    index = min(of_kind, key=lambda i: w.mass[i])
    c = found.batch.of[index]
    drive = unified(c.actuator, BODY.water)
    d = steady_drive(
        drive,
        BODY.water,
        voltage=w.voltage[index],
        depth=found.asked.bottom_pressure / BODY.water.specific_weight,
    )
    assert d.volume_rate == pytest.approx(w.rate[index], rel=1e-9)
    assert d.current == pytest.approx(w.current[index], rel=1e-9)
    # through a driver of 92 % and the battery: E i_b = P/0.92 + R_b i_b^2
    E, R_b, terminals = c.supply, c.supply * c.battery.resistance, d.supply / 0.92
    i_b = float(np.min(np.roots([R_b, -E, terminals]).real))
    assert E * i_b / d.volume_rate == pytest.approx(w.energy_per_volume[index], rel=1e-9)


def test_no_other_drive_is_lighter(found: Sizing) -> None:
    w = found.evaluation
    assert w.feasible[found.best]
    assert w.mass[found.best] <= 1.002 * w.mass[w.feasible].min()
    for index in found.pareto:
        better = w.feasible & (w.mass < w.mass[index]) & (w.cycle_energy < w.cycle_energy[index])
        assert not np.any(better)
    assert np.all(w.feasible == np.all([m >= 1.0 for m in w.margins.values()], axis=0))


def test_least_energy_takes_less_energy(found: Sizing) -> None:
    other = size(BODY, DIVE, parts=_few(), goal="energy", sweeps=False)
    assert other.evaluation.cycle_energy[other.best] <= found.evaluation.cycle_energy[found.best]
    assert other.evaluation.mass[other.best] >= found.evaluation.mass[found.best] / 1.002


def test_each_part_is_shown_with_its_best_or_with_what_is_in_the_way(found: Sizing) -> None:
    w = found.evaluation
    assert {c.what for c in found.choices} >= {"kind", "motor", "pump", "screw", "battery"}
    for choice in found.choices:
        members = [
            i for i, c in enumerate(found.batch.of) if c.choices.get(choice.what) == choice.name
        ]
        if choice.index >= 0:
            assert choice.index in members
            assert w.mass[choice.index] <= w.mass[members][w.feasible[members]].min() * (1 + 1e-12)
        else:
            assert not np.any(w.feasible[members])
            assert choice.margin < 1.0
            assert choice.missing in w.margins


def test_a_rewound_motor_has_the_same_losses() -> None:
    part = load_parts().motors[2]
    a, b = part.wound(12.0), part.wound(48.0)
    torque = 0.05
    heat = [m.resistance * (torque / m.torque_constant) ** 2 for m in (a, b)]
    assert heat[0] == pytest.approx(heat[1], rel=1e-12)
    assert 12.0 / a.torque_constant == pytest.approx(48.0 / b.torque_constant, rel=1e-12)


def test_the_sized_vehicle_is_a_vehicle_that_does_it(found: Sizing) -> None:
    vehicle = sized_vehicle(found)
    again = read_model(Vehicle, vehicle_file(vehicle), "sized")
    assert again.model_dump() == vehicle.model_dump()
    w, b = found.evaluation, found.best
    at = drive_map(vehicle, [found.asked.bottom_pressure])
    assert at.rate_out[0] >= found.asked.rate
    # evacuated by 0.2 bar, the pump beats that much more than the sea's pressure
    assert at.rate_out[0] == pytest.approx(w.rate[b], rel=0.02)
    assert at.power_out[0] / at.rate_out[0] == pytest.approx(w.energy_per_volume[b], rel=0.02)
    assert vehicle.stroke.maximum - vehicle.stroke.minimum == pytest.approx(found.asked.stroke)
    assert vehicle.stroke.minimum < vehicle.trim_error < vehicle.stroke.maximum
    surface = drive_map(vehicle, [0.0])
    assert surface.rate_in[0] == pytest.approx(found.asked.rate, rel=1e-9)


def test_the_sized_vehicle_is_ballasted_for_the_sea_it_was_sized_for() -> None:
    cast = Cast(
        pressure=np.array([0.0, 100.0, 1100.0]),
        CT=np.array([25.0, 12.0, 5.0]),
        SA=np.array([36.0, 35.5, 35.0]),
        latitude=30.0,
        longitude=-30.0,
    )
    sea = cast_column(cast)
    done = size(BODY, DIVE, cast=sea, parts=_few(), sweeps=False)
    vehicle, asked = sized_vehicle(done), done.asked
    volume = np.interp(asked.depth, sea.depth, neutral_volume(vehicle, sea))
    inner = vehicle.stroke.minimum
    assert volume[0] - inner == pytest.approx(-asked.lowest, abs=0.1e-6)
    assert np.allclose(volume - volume[0], asked.neutral, atol=0.5e-6)
    assert volume.min() - asked.drive - asked.trim > vehicle.stroke.minimum
    assert volume.max() + asked.drive + asked.trim < vehicle.stroke.maximum


def test_what_no_drive_does_names_the_requirement() -> None:
    weak = load_parts().pumps[1].model_copy(update={"largest_pressure": 5e6})
    parts = _few(pumps=(weak,), amplifiers=(), gears=(), screws=(), pistons=())
    with pytest.raises(
        NoAnswerError, match=r"has 50 % of the pressure that the pump may work"
    ) as e:
        size(BODY, DIVE, parts=parts)
    assert "pump pressure (" in str(e.value)  # left out, there are drives


def test_a_limit_of_mass_is_kept_or_refused(found: Sizing) -> None:
    lightest = float(found.evaluation.mass[found.best])
    tight = size(BODY, DIVE, parts=_few(), max_mass=1.05 * lightest, sweeps=False)
    assert np.all(tight.evaluation.mass[tight.evaluation.feasible] <= 1.05 * lightest)
    with pytest.raises(NoAnswerError, match="mass"):
        size(BODY, DIVE, parts=_few(), max_mass=0.5 * lightest, sweeps=False)


def test_deeper_and_more_cycles_are_heavier(found: Sizing) -> None:
    by = {sweep.what: sweep for sweep in found.sweeps}
    for what in ("max_depth", "cycles"):
        mass = np.array(by[what].mass)
        assert np.all(np.diff(mass[np.isfinite(mass)]) > 0.0)
    assert np.all(np.diff(by["trim_std"].stroke) > 0.0)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"max_depth": -3.0}, "max_depth"),
        ({"speed": 0.0}, "speed"),
        ({"trim_std": -1e-6}, "trim_std"),
        ({"probability": 1.0}, "probability"),
        ({"cycles": 0}, "cycles"),
        ({"turn_time": math.nan}, "turn_time"),
        ({"stroke_reserve": 10.0}, "stroke_reserve"),
        ({"corrections": 20.0}, "corrections"),
        ({"battery_reserve": 1.0}, "battery_reserve"),
    ],
)
def test_wishes_that_cannot_be_are_refused(change: dict, field: str) -> None:
    with pytest.raises(InputError) as error:
        Dive(**({"max_depth": 100.0} | change))
    assert error.value.field == field


def test_a_body_rated_for_less_is_refused() -> None:
    with pytest.raises(InputError, match="rated for 1000 m"):
        size(BODY, Dive(max_depth=1500.0))


def test_a_cast_too_short_is_refused() -> None:
    with pytest.raises(InputError, match="known down to 500 m"):
        size(BODY, DIVE, cast=uniform_column(BODY.water, 500.0))


def test_parts_files_say_what_is_wrong(tmp_path) -> None:
    file = tmp_path / "parts.toml"
    file.write_text('schema_version = 1\nsupplies = ["12 kg"]\n')
    with pytest.raises(InputError) as error:
        load_parts(file)
    assert error.value.line == 2
    whole = load_parts()
    assert len(combinations(whole, BODY.water).of) == (
        len(whole.motors)
        * len(whole.windings)
        * len(whole.supplies)
        * len(whole.batteries)
        * (
            len(whole.pumps) * len(whole.amplifiers)
            + len(whole.gears) * len(whole.screws) * len(whole.pistons)
        )
    )


def test_water_of_one_density_is_said_to_be_none_of_the_sea(found: Sizing) -> None:
    assert any("(`cast=`)" in sentence for sentence in found.sentences)
    column = found.column
    denser = dataclasses.replace(column, density=column.density + 1e-3 * column.depth)
    assert not any("cast=" in s for s in dataclasses.replace(found, column=denser).sentences)


def test_the_answer_is_whole(found: Sizing) -> None:
    answer = found.to_dict()
    assert answer["chosen"]["mass_kg"] == pytest.approx(answer["pareto"][0]["mass_kg"], rel=2e-3)
    assert len(columns(found)["mass_kg"]) == answer["feasible"]
    text = " ".join(found.sentences)
    assert "1000 m" in text
    assert "cm3" in text


SHARES = {"probability", "stroke_reserve", "corrections", "battery_reserve", "battery_low"}
SHARES |= {"stall_reserve", "margin", "values"}


def numbers_of(value: Any, key: str = "") -> Iterator[str]:
    """Yield what each number of an answer is called, margins left out: they have no unit."""
    if isinstance(value, dict):
        for name, held in value.items():
            if name != "margins":
                yield from numbers_of(held, key if key.endswith("_m3") else name)
    elif isinstance(value, list):
        for held in value:
            yield from numbers_of(held, key)
    elif isinstance(value, float):
        yield key


def test_a_number_of_the_answer_has_its_unit_in_its_name(found: Sizing) -> None:
    called = set(numbers_of(found.to_dict())) - SHARES
    assert len(called) > 25
    unit = r".*_(m|m3|m3_s|m3_per_s|s|m_s|J|J_per_m3|W|V|A|Pa|kg|degC)"
    assert {name for name in called if not re.fullmatch(unit, name)} == set()


def test_the_parts_of_the_battery_are_all_of_it_and_the_reserve_is_of_what_the_cold_leaves(
    found: Sizing,
) -> None:
    said = next(sentence for sentence in found.sentences if sentence.startswith("Of the battery"))
    drawn, _, cold, lost, kept, stated, unusable = map(float, re.findall(r"([\d.]+) %", said))
    assert drawn + cold + lost + kept + unusable == pytest.approx(100.0, abs=0.3)  # rounded
    assert stated == 100.0 * DIVE.battery_reserve
    assert kept == pytest.approx(stated / 100.0 * (100.0 - unusable - cold), abs=0.1)


def test_a_battery_heavier_than_the_body_is_none(found: Sizing) -> None:
    """1 kW at all times is two megawatt-hours: no limit was asked for, and the body has one."""
    dive = dataclasses.replace(DIVE, hotel=1000.0)
    with pytest.raises(NoAnswerError, match=r" has \d % of the mass .* that of the body at most"):
        size(BODY, dive, parts=_few(), sweeps=False)
    assert weight_mass(BODY) / found.evaluation.mass[found.best] == pytest.approx(
        found.evaluation.margins["mass"][found.best], rel=1e-12
    )


def test_a_stroke_that_the_body_has_no_room_for_is_none() -> None:
    trim = BODY.hull.displaced_volume / 8.0  # 1.96 sigma to both sides, and a tenth: over half
    with pytest.raises(NoAnswerError, match=r" has \d+ % of the room that the body has for the"):
        size(BODY, dataclasses.replace(DIVE, trim_std=trim), parts=_few(), sweeps=False)
    assert size(BODY, dataclasses.replace(DIVE, trim_std=0.8 * trim), parts=_few(), sweeps=False)
