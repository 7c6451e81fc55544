"""The pictures of an identification: what they show, with which units, at which numbers."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2, norm

from swimbladder.estimation.motion import Prior, identify
from swimbladder.io.config import load_vehicle
from swimbladder.show import identification_plots as confidence
from swimbladder.show import identification_plots as plots
from swimbladder.show.interactive import as_plotly
from swimbladder.show.picture import Bars, Curve, Span
from swimbladder.show.static import figure
from tests.estimation.motion.pool import campaign
from tests.pictures import curve, marks

FEUP_EM = load_vehicle("feup-em")
STEPS = (2e-5, -3e-5, 4.5e-5, -7.5e-5)


@pytest.fixture(scope="module")
def found():
    logs = campaign(51, quantum=5e-3, steps=STEPS)
    spoilt = logs[1].depth.copy()
    spoilt[40] += 0.5
    logs[1] = dataclasses.replace(logs[1], depth=spoilt)
    return identify(logs, FEUP_EM, choices=False, priors={"psi": Prior(4e-6, 4e-7)})


def words(panel):
    return panel.title, panel.x, panel.y


def test_each_log_has_a_panel_with_measured_and_fitted_depth(found):
    picture = plots.draw_fits(found)
    assert len(picture.panels) == len(STEPS)
    assert all(axes.yaxis_inverted() for axes in figure(picture).axes)
    low, high = as_plotly(picture)["layout"]["yaxis2"]["range"]
    assert low > high
    for axes, e in zip(picture.panels, found.experiments, strict=True):
        assert np.array_equal(curve(axes, "measured")[:, 1], e.record.depth)
        assert np.array_equal(curve(axes, "fitted")[:, 1], e.predicted)
        assert f"{1e3 * e.rms:.2g} mm rms" in words(axes)[0]
    assert curve(picture.panels[1], "outlier").tolist() == [
        [found.experiments[1].record.time[40], found.experiments[1].record.depth[40]]
    ]
    assert words(picture.panels[0])[2] == "depth [m]"
    assert words(picture.panels[-1])[1] == "time [s]"


def test_residuals_have_their_band_and_an_outlier_stands_at_the_edge(found):
    panels = plots.draw_residuals(found).panels
    for axes, e in zip(panels, found.experiments, strict=True):
        (band,) = marks(axes, Span)
        assert band.high - band.low == pytest.approx(2e3 * 1.96 * e.noise)
        shown = curve(axes, "residual")[:, 1]
        assert shown == pytest.approx(1e3 * e.residual[e.weight >= 0.5])
    ((time, off),) = curve(panels[1], "outlier (at the edge: beyond it)")
    assert time == found.experiments[1].record.time[40]
    assert 0.9 < off / panels[1].ylim[1] < 1.0
    assert words(panels[0])[2] == "residual [mm]"


def test_many_logs_go_on_several_pictures(found):
    many = dataclasses.replace(found, experiments=found.experiments * 8)
    assert len(plots.draw_fits(many).panels) == plots.PER_PAGE
    last = plots.draw_fits(many, first=plots.PER_PAGE)
    assert len(last.panels) == 32 - plots.PER_PAGE
    names = plots.labels(many)
    assert len(set(names)) == 32
    assert words(last.panels[0])[0].startswith(names[plots.PER_PAGE])


def test_one_log_and_a_log_with_a_part_that_is_not_used(found):
    e = found.experiments[0]
    cut = e.residual.copy()
    cut[10:20] = np.nan
    alone = dataclasses.replace(found, experiments=(dataclasses.replace(e, residual=cut),))
    (axes,) = plots.draw_fits(alone).panels
    (shade,) = marks(axes, Span)
    assert shade.low == e.record.time[10]
    figure(plots.draw_residuals(alone))
    figure(plots.draw_distribution(alone))


def test_the_distribution_is_that_of_the_residuals(found):
    histogram, quantiles, alike = plots.draw_distribution(found).panels
    u = np.concatenate([e.residual / e.noise for e in found.experiments])
    inside = np.abs(u) <= 5.0
    (bars,) = marks(histogram, Bars)
    area = bars.length.sum() * bars.thick
    assert area == pytest.approx(inside.mean())
    (dots,) = (m for m in marks(quantiles, Curve) if m.marker == ".")
    dots = np.column_stack([dots.x, dots.y])
    assert dots[:, 1] == pytest.approx(np.sort(u)[np.abs(np.sort(u)) <= 8.0])
    assert norm.cdf(dots[0, 0]) == pytest.approx(0.5 / len(u))
    mean = curve(alike, "all logs")[:20, 1]  # further lags are not those of all logs
    parts = []
    for e in found.experiments:
        r = np.sqrt(e.weight) * e.residual
        parts.append(np.correlate(r, r, "full")[len(r) :][:20] / (r @ r) * len(r))
    n = sum((e.weight > 0.0).sum() for e in found.experiments)
    assert mean == pytest.approx(np.sum(parts, axis=0) / n, abs=5e-3)
    assert [axes.x for axes in (histogram, quantiles, alike)] == [
        "residual [standard deviations]",
        "normal quantile [-]",
        "lag [samples]",
    ]


def test_the_regions_of_a_pair_are_where_chi_squared_says(found):
    panels = confidence.draw_ellipses(found).panels
    assert len(panels) == 3
    lower = panels[1]  # psi against K2
    assert lower.x == "K₂ [1/(m² s)]"
    assert lower.y == "ψ [cm³/m]"
    rings = [np.column_stack([m.x, m.y]) for m in marks(lower, Curve) if len(m.x) > 100]
    outer = max(rings, key=lambda xy: np.ptp(xy[:, 0]))
    K2, psi = found.parameters["K2"], found.parameters["psi"]
    i, j = found.names.index("K2"), found.names.index("psi")
    C = found.covariance[np.ix_([i, j], [i, j])] / np.outer([K2.value, 1.0], [K2.value, 1.0])
    off = np.column_stack([np.log(outer[:, 0] / K2.value), 1e-6 * outer[:, 1] - psi.value])
    distance = np.einsum("ki,ij,kj->k", off, np.linalg.inv(C), off)
    assert distance == pytest.approx(np.full(len(off), chi2.ppf(0.95, 2)), rel=1e-6)


def test_a_profile_stands_beside_its_quadratic_approximation(found):
    panels = confidence.draw_profiles(found).panels
    assert len(panels) == len(found.names)
    for axes, name in zip(panels, found.names, strict=True):
        e, p = found.parameters[name], found.profiles[name]
        per = 1e6 if name == "psi" else 1.0
        quadratic = curve(axes, "quadratic approximation")
        if name == "psi":
            expected = ((quadratic[:, 0] / per - e.value) / e.std) ** 2
        else:
            expected = (np.log(quadratic[:, 0] / e.value) * e.value / e.std) ** 2
        assert quadratic[:, 1] == pytest.approx(expected, abs=1e-9)
        drawn = curve(axes, "profile")
        crossing = np.interp(
            3.8415,
            drawn[:, 1][drawn[:, 0] > per * e.value],
            drawn[:, 0][drawn[:, 0] > per * e.value],
        )
        assert crossing == pytest.approx(per * p.ci95[1], rel=1e-3)
        bars = [m.x for m in marks(axes, Curve) if len(m.x) == 2]
        assert any(np.allclose(bar, per * np.array(p.ci95)) for bar in bars)


def test_neutral_volumes_stand_against_the_prior(found):
    left, right = plots.draw_neutral(found).panels
    widths = sorted(span.high - span.low for span in marks(left, Span))
    assert widths == pytest.approx([1.0, 2.0])  # cm3: one and two deviations to either side
    dots = curve(left, "estimate, 95 %")
    errors = [1e6 * e.estimates["neutral_error"].value for e in found.experiments]
    assert dots[:, 0] == pytest.approx(errors)
    assert "[cm³]" in left.x
    assert "[cm³/h]" in right.x
    free = dataclasses.replace(found, neutral_std=float("inf"))
    assert marks(plots.draw_neutral(free).panels[0], Span) == []


def test_gains_stand_against_the_size_of_the_step(found):
    singles = {"paper, eq. (27)": [(2e-5, 16000.0), (7.5e-5, 10600.0)]}
    (axes,) = plots.draw_gains(found, singles).panels
    rising, sinking = (curve(axes, f"each log alone, {w}, 95 %") for w in ("rising", "sinking"))
    assert len(rising) == len(sinking) == 2
    e = found.experiments[0]
    x, y = rising[0]
    assert x == pytest.approx(1e6 * e.step, rel=0.05)
    assert y == pytest.approx(found.parameters["K2"].value * np.exp(e.own_gain[0]))
    assert curve(axes, "paper, eq. (27)")[:, 1].tolist() == [16000.0, 10600.0]
    assert axes.y == "K₂ [1/(m² s)]"
    assert axes.x == "size of the volume change [cm³]"


@pytest.mark.parametrize("ci95", [(0.0, np.inf), (0.0, 9000.0), (7000.0, np.inf)])
def test_an_interval_without_an_end_has_no_band_among_the_gains(found, ci95):
    (axes,) = plots.draw_gains(found).panels
    (band,) = marks(axes, Span)
    low, high = found.parameters["K2"].ci95
    assert (band.low, band.high) == pytest.approx((low, high))
    wide = dataclasses.replace(found.parameters["K2"], ci95=ci95)
    open_ = dataclasses.replace(found, parameters={**found.parameters, "K2": wide})
    (axes,) = plots.draw_gains(open_).panels
    assert marks(axes, Span) == []
    assert len([m for m in marks(axes, Curve) if m.label]) == 2


def test_what_is_not_there_cannot_be_drawn(found):
    with pytest.raises(ValueError, match="no pair"):
        confidence.draw_ellipses(dataclasses.replace(found, names=("K2",)))
    with pytest.raises(ValueError, match="no profile"):
        confidence.draw_profiles(dataclasses.replace(found, profiles={}))
    nothing = tuple(dataclasses.replace(e, own_gain=None) for e in found.experiments)
    with pytest.raises(ValueError, match="no log has a gain"):
        plots.draw_gains(dataclasses.replace(found, experiments=nothing))


def test_a_quadratic_drag_has_a_relative_gain():
    truth = {"m": 44.0, "k_dt": 14.0, "psi": 1e-6}
    logs = campaign(52, steps=(6e-5, -9e-5, 12e-5, -15e-5), **truth)
    found = identify(logs, FEUP_EM, drag="quadratic", choices=False, profiles=False)
    (axes,) = plots.draw_gains(found).panels
    assert axes.y == "gain over that of all logs [-]"
    names = [axes.x for axes in confidence.draw_ellipses(found).panels]
    assert "mass [kg]" in names


def test_draws_from_the_posterior_lie_beneath_the_regions(found):
    from swimbladder.estimation.motion.posterior import Posterior

    rng = np.random.default_rng(5)
    means = [found.parameters[name].value for name in found.names]
    draws = rng.multivariate_normal(means, found.covariance, 400)
    with_draws = dataclasses.replace(
        found, posterior=Posterior(names=found.names, draws=draws, effective=400.0)
    )
    lower = confidence.draw_ellipses(with_draws).panels[1]  # psi against K2
    dots = curve(lower, "draws from the posterior")
    i, j = found.names.index("K2"), found.names.index("psi")
    assert dots == pytest.approx(draws[:, [i, j]] * [1.0, 1e6])
