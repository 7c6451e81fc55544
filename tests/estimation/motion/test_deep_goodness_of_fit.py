"""Deep dives held against the noise: those that belong together, and those that do not."""

from dataclasses import replace

import gsw
import numpy as np
import pytest
from scipy.stats import norm

from studies.deep_drawn import drawn, known, the_vehicle
from swimbladder.errors import NoAnswerError
from swimbladder.estimation.estimates import Prior
from swimbladder.estimation.motion import deep_fit
from swimbladder.estimation.motion.deep import (
    Misfit,
    identify_deep,
    inconsistent,
    messages,
    misfit_of,
    water_messages,
)
from swimbladder.estimation.motion.deep_fit import NOISES, balance
from swimbladder.estimation.motion.deep_model import Noise, body_of, filtered
from swimbladder.physics.seawater import Cast, cast_column
from tests.estimation.motion.deep import made_up_column, made_up_vehicle
from tests.estimation.motion.test_deep import TRUTH, two_dives
from tests.quoted import numbers

HELD = {
    name: TRUTH[name]
    for name in ("drag", "stiffening", "inertia", "pump_start", "pump_slip", "valve_laminar")
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    vehicle, column = made_up_vehicle(tmp_path_factory.mktemp("doubt")), made_up_column()
    return vehicle, column, two_dives(vehicle, column, TRUTH)


@pytest.fixture(scope="module")
def agreed(scene):
    vehicle, column, (logs, _) = scene
    return identify_deep(logs, [column], vehicle, fixed=HELD)


def test_dives_that_belong_together_are_not_doubted(agreed) -> None:
    assert agreed.identified
    assert not agreed.inconsistent
    assert all(0.5 < told.misfit.most < 1.5 for told in agreed.dives)
    assert not any("times the noise" in said for said in agreed.sentences)
    for told, said in zip(agreed.dives, agreed.to_dict()["dives"], strict=True):
        assert (
            said["imbalance_over_noise"],
            said["speed_over_noise"],
            said["distance"],
        ) == told.misfit
        assert told.misfit.distance < 2.0


FREE = ("compressibility", "thermal_expansion", "pump_delivery")


def test_dives_in_reverse_order_are_no_dives(scene) -> None:
    """Buoyancy and drag of the other sign: a hull softer than water explains that."""
    vehicle, column, (logs, _) = scene
    log = logs[0]
    last = float(log.time[-1])
    back = {name: getattr(log, name)[::-1] for name in ("pressure", "temperature")}
    runs = [replace(a, time=last - a.time - a.seconds) for a in log.actions if a.time < last]
    turned = replace(log, time=last - log.time[::-1], actions=tuple(runs[::-1]), **back)
    found = identify_deep([turned], [column], vehicle, free=FREE)
    assert not found.identified
    assert "more compressible than water" in found.sentences[0]


def test_dives_that_no_filter_follows_are_no_warning_of_numpy(scene, monkeypatch) -> None:
    """A variance of the filter below 0, as rounding makes it of absurd columns."""
    vehicle, column, (logs, _) = scene

    def below(*given):
        found = filtered(*given)
        return found._replace(variance=-found.variance)

    monkeypatch.setattr(deep_fit, "filtered", below)
    with pytest.raises(NoAnswerError, match="cannot follow these dives"):
        identify_deep([logs[0]], [column], vehicle, free=FREE)


def test_pressures_for_temperatures_are_a_no_without_a_warning_of_numpy(scene) -> None:
    """Rounding, which differs between processors, decides which gate it ends at."""
    vehicle, column, (logs, _) = scene
    log = logs[0]
    swapped = replace(log, pressure=1e5 * log.temperature, temperature=1e-4 * log.pressure)
    try:
        found = identify_deep([swapped], [column], vehicle, free=FREE)
        said = found.sentences[0] if not found.identified else ""
    except NoAnswerError as no:
        said = str(no)
    nos = ("cannot follow these dives", "one set of parameters cannot describe these dives")
    assert any(no in said for no in nos)


def test_the_noise_of_a_book_is_that_of_drag_in_moving_water(scene, agreed) -> None:
    """With nothing else off: d(k w|w|/(rho g)) = 2 k |w| u/(rho g), and the median of a normal."""
    vehicle, _, (_, dives) = scene
    tiny = {name: Prior(0.0, 0.0) for name in ("cast_density", "cast_heave")}
    fit = replace(
        agreed.fit,
        priors={**agreed.fit.priors, **tiny},
        noise=Noise(pressure=0.0, water=2e-3, drift=0.0, runs=0.0, lasts=1e-3),
    )
    dive, body = dives[0], body_of(vehicle)
    k = np.where(dive.pieces.speed >= 0.0, 1.0, fit.values["drag_up"]) * fit.values["drag"]
    sigma = 2.0 * k * np.abs(dive.pieces.speed) * 2e-3 / (dive.pieces.density * dive.gravity)
    imbalance = balance(body, fit.values, float(fit.starts[0]), dive)
    told = misfit_of(body, fit, 0, dive)
    assert told.imbalance == pytest.approx(
        np.median(np.abs(imbalance / sigma)) / norm.ppf(0.75), rel=1e-3
    )
    z = np.median(np.abs(fit.innovations[0])) / norm.ppf(0.75)
    assert told.speeds == pytest.approx(z)
    # What a fit takes for noise where nothing else tells a dive does not count: 3 times at most.
    wild = replace(fit, noise=fit.noise._replace(water=1.0))
    assert misfit_of(body, wild, 0, dive).imbalance == pytest.approx(
        told.imbalance * 2e-3 / 9e-3, rel=1e-3
    )


@pytest.mark.prove
def test_logs_of_two_floats_are_not_identified(scene) -> None:
    """The valve of one dive lets in 0.9 of the file's, that of another 1.5."""
    vehicle, column, (logs, _) = scene
    others, _ = two_dives(vehicle, column, TRUTH | {"valve": 1.5})
    named = [replace(log, source=f"dive-{k}.csv") for k, log in enumerate([logs[0], others[1]])]
    found = identify_deep(named, [column], vehicle, fixed=HELD)
    assert found.inconsistent
    assert not found.identified
    assert found.result_vehicle is vehicle
    first = found.sentences[0]
    off = {told.dive.name for told in found.dives if told.misfit.distance > 4.0}
    said = {log.source for log in named if log.source in first}
    assert said
    assert off <= said
    answer = found.to_dict()
    assert not answer["identified"]
    assert all(e["std"] is e["ci95"] is None for e in answer["parameters"].values())
    assert all(dive["start_volume"]["ci95"] is None for dive in answer["dives"])
    # no ratio by which intervals are wider: there are none
    assert float(f"{found.fit.tempering**-0.5:.2g}") not in numbers(" ".join(found.sentences[1:]))


def test_bounds_and_words() -> None:
    names, imbalances = ["a.csv", "b.csv"], [1e-6, 12e-6]
    fine, odd, wrong = Misfit(1.0, 1.1, 1.0), Misfit(2.9, 1.0, 1.0), Misfit(1.0, 7.5, 1.0)
    assert messages(names, [fine, fine], imbalances, 1.0) == []
    (said,) = messages(names, [fine, odd], imbalances, 0.3)
    assert "b.csv" in said
    assert "a.csv" not in said
    assert {12.0, 2.9} <= numbers(said)  # mL rms, times the noise
    assert not inconsistent([fine, odd], 0.3)
    assert inconsistent([fine, wrong], 1.0)
    (said,) = messages(names, [odd, wrong], imbalances, 1.0)
    assert "a.csv" in said
    assert {12.0, 2.9, 7.5} <= numbers(said)
    # Dives that are told, each by what the others are not: 5 times farther apart than they say.
    far = [fine._replace(distance=3.0), fine._replace(distance=5.5)]
    assert inconsistent(far, 0.04)
    (said,) = messages(names, far, imbalances, 0.04)
    assert "b.csv" in said
    assert 5.5 in numbers(said)
    assert "a.csv" not in said
    assert water_messages(NOISES) == []
    assert water_messages(NOISES._replace(water=8.9e-3)) == []
    (said,) = water_messages(NOISES._replace(water=0.02))
    assert {20.0, 3.0} <= numbers(said)  # mm/s


@pytest.mark.prove
def test_a_wrong_cast_passes_for_another_hull_unless_the_hull_is_known() -> None:
    """3 K and 0.5 in salinity more around 600 dbar: one dive is told all the same, and it is said.

    Water and hull are one function of pressure, so that only what is known of the hull shows it.
    """
    dived, vehicle = drawn(0, seed=5), the_vehicle()
    p = np.arange(0.0, 1201.0, 5.0)
    bump = np.exp(-(((p - 600.0) / 200.0) ** 2))
    salt = 35.0 + 0.3 * np.exp(-p / 300.0) + 0.5 * bump
    warm = 4.5 + 12.0 * np.exp(-p / 150.0) + 3.0 * bump
    SA = gsw.SA_from_SP(salt, p, -30.0, 43.0)
    cast = Cast(pressure=p, SA=SA, CT=gsw.CT_from_t(SA, warm, p), latitude=43.0)
    column = cast_column(cast)
    blind = identify_deep([dived.log], [column], vehicle)
    assert not blind.inconsistent
    hull = blind.parameters["stiffening"]
    assert abs(hull.value - dived.values["stiffening"]) > 5.0 * hull.std
    about = known()
    told = identify_deep(
        [dived.log],
        [column],
        vehicle,
        priors={n: about[n] for n in ("compressibility", "stiffening", "thermal_expansion")},
    )
    assert any("deviations from what was known before" in x for x in told.sentences)
    right = identify_deep(
        [dived.log],
        [dived.column],
        vehicle,
        priors={n: about[n] for n in ("compressibility", "stiffening", "thermal_expansion")},
    )
    assert not any("deviations from what was known before" in x for x in right.sentences)
