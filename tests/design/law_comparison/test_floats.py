"""Laws of volume changes compared: scenarios of floats, what is measured, what is drawn."""

import numpy as np
import pytest

from swimbladder.control.rate import RATE
from swimbladder.control.registry import bind
from swimbladder.design.law_comparison import compare_laws
from swimbladder.design.law_comparison.contenders import (
    FLOAT_SCENARIOS,
    Contender,
    place,
    scenarios_of,
)
from swimbladder.design.law_comparison.run import fly_scenario, no_energy
from swimbladder.design.tuning.region import region
from swimbladder.design.tuning.run import BAND, places
from swimbladder.design.tuning.trial import ALONE, BOARD, Drawn
from swimbladder.errors import InputError, NoAnswerError
from swimbladder.io.config import load_vehicle
from swimbladder.io.vehicle_file import vehicle_template
from swimbladder.show.law_comparison import draw_pareto
from swimbladder.show.static import save
from swimbladder.sim.closed_loop import simulate_ensemble
from swimbladder.vehicle import Supervisor
from tests.quoted import refused

FLOAT = load_vehicle("example-float")
SOME = [s for s in FLOAT_SCENARIOS if s.name in ("step-small", "step-uncertain")]


def test_a_float_steps_by_its_bands_and_not_near_the_surface():
    assert scenarios_of(FLOAT) is FLOAT_SCENARIOS
    assert scenarios_of(load_vehicle("feup-em")) is not FLOAT_SCENARIOS
    where = places(FLOAT)
    assert where.least >= BAND
    assert where.most == pytest.approx(0.8 * 1800.0)  # where the supervisor turns it round
    assert places(FLOAT, supervised=False).most == pytest.approx(0.8 * 2000.0)
    placed = [place(one, FLOAT, where) for one in FLOAT_SCENARIOS]
    assert all(where.least <= z <= where.most for p in placed for z in (p.start, p.target))
    assert all(abs(p.target - p.start) > 2.0 * BAND for p in placed if p.is_step)
    with refused(NoAnswerError):
        places(FLOAT, (50.0, 3000.0), supervised=False)


@pytest.mark.parametrize("supervised", [False, True])
def test_what_is_measured_is_that_of_the_flights(supervised):
    numbers = bind(FLOAT.controller)[1]
    who = Contender(law=RATE, tuning="as in the file", parameters=numbers, sample_time=1.0)
    placed = place(SOME[0], FLOAT, places(FLOAT, (50.0, 400.0)))
    drawn = Drawn(2, region(FLOAT), supervised=supervised)
    flown, time, _ = fly_scenario(FLOAT, who, placed, drawn)
    same = simulate_ensemble(
        FLOAT,
        count=2,
        setpoints=[(0.0, placed.target)],
        duration=placed.duration,
        start_depth=placed.start,
        keep="trajectory",
        balance=True,
        seed=1,
        supervised=supervised,
    )
    error = np.abs(same["depth"].to_numpy() - placed.target)
    settled = float(flown.settle[0])
    assert np.all(error[int(settled) + 1 :] <= BAND)
    assert error[int(settled), 0] > BAND
    power = same["energy"].to_numpy() / placed.duration
    assert flown.power == pytest.approx(power)
    assert no_energy(FLOAT) is None
    assert time[-1] <= placed.duration


def test_as_flashed_seconds_of_the_pump_are_flown_and_the_supervisor_s_depth_ends_the_range():
    told = {}
    for supervised in (False, True):
        found = compare_laws(
            FLOAT,
            laws=["cascade"],
            runs=2,
            depth_range=(50.0, 400.0),
            scenarios=SOME[:1],
            supervised=supervised,
        )
        told[supervised] = found.rows[0].results["step-small"]
        assert (ALONE in found.assumptions) is not supervised
        assert (BOARD in found.assumptions) is supervised
    assert told[True].energy != told[False].energy
    assert told[True].energy == pytest.approx(told[False].energy, rel=0.05)
    assert told[True].alarms == 0.0
    low = FLOAT.model_copy(update={"supervisor": Supervisor(depth_limit=300.0)})
    assert places(low).most == pytest.approx(0.8 * 300.0)
    assert places(low, supervised=False).most > 300.0
    with refused(InputError, field="depth_range", value=400.0):
        places(low, (50.0, 400.0))


@pytest.mark.prove
def test_a_float_whose_pump_has_a_supply_of_its_own_is_tuned(tmp_path):
    path = tmp_path / "pv.toml"
    path.write_text(vehicle_template("pump-valve", name="pv"), encoding="utf-8")
    vehicle = load_vehicle(path)
    assert vehicle.supply is not None
    found = compare_laws(vehicle, laws=["rate"], runs=2, tune_for=["fast"], scenarios=SOME[:1])
    assert found.not_compared == {}
    assert [row.who.name for row in found.rows] == ["rate, as in the file", "rate, fast"]


def test_a_comparison_draws_floats_and_says_what_it_leaves_out(tmp_path):
    found = compare_laws(FLOAT, laws=["cascade"], runs=2, depth_range=(50.0, 400.0), scenarios=SOME)
    assert [row.who.law.name for row in found.rows] == ["rate"]
    assert "volume change" in found.not_compared["cascade"]
    assert any("pump" in words for words in found.assumptions)
    results = found.rows[0].results
    assert results["step-small"].settled == 1.0
    assert results["step-uncertain"].lost == 0.0
    assert not found.bounds
    assert set(found.no_bound) == {"step-small", "step-uncertain"}
    # costs that no law has: a logarithmic axis without a value had no ticks to find
    save(draw_pareto(found), tmp_path / "pareto.png")
    assert (tmp_path / "pareto.png").stat().st_size > 0
