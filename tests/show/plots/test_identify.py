"""The pictures of an identification: what they show, with which units, at which numbers."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2, norm

from swimbladder.estimation.motion import Prior, identify
from swimbladder.io.config import load_vehicle
from swimbladder.show import identification_plots as confidence
from swimbladder.show import identification_plots as plots
from tests.estimation.motion.pool import campaign

FEUP_EM = load_vehicle("feup-em")
STEPS = (2e-5, -3e-5, 4.5e-5, -7.5e-5)


@pytest.fixture(scope="module")
def found():
    logs = campaign(51, quantum=5e-3, steps=STEPS)
    spoilt = logs[1].depth.copy()
    spoilt[40] += 0.5
    logs[1] = dataclasses.replace(logs[1], depth=spoilt)
    return identify(logs, FEUP_EM, choices=False, priors={"psi": Prior(4e-6, 4e-7)})


def words(axes):
    return axes.get_title(loc="left"), axes.get_xlabel(), axes.get_ylabel()


def curve(axes, label):
    (line,) = [line for line in axes.get_lines() if line.get_label() == label]
    return line.get_xydata()


def test_each_log_has_a_panel_with_measured_and_fitted_depth(found):
    figure = plots.draw_fits(found)
    assert len(figure.axes) == len(STEPS)
    for axes, e in zip(figure.axes, found.experiments, strict=True):
        assert axes.yaxis_inverted()
        assert np.array_equal(curve(axes, "measured")[:, 1], e.record.depth)
        assert np.array_equal(curve(axes, "fitted")[:, 1], e.predicted)
        assert f"{1e3 * e.rms:.2g} mm rms" in words(axes)[0]
    assert curve(figure.axes[1], "outlier").tolist() == [
        [found.experiments[1].record.time[40], found.experiments[1].record.depth[40]]
    ]
    assert words(figure.axes[0])[2] == "depth [m]"
    assert words(figure.axes[-1])[1] == "time [s]"


def test_residuals_have_their_band_and_an_outlier_stands_at_the_edge(found):
    figure = plots.draw_residuals(found)
    for axes, e in zip(figure.axes, found.experiments, strict=True):
        (band,) = axes.patches
        assert band.get_height() == pytest.approx(2e3 * 1.96 * e.noise)
        shown = curve(axes, "residual")[:, 1]
        assert shown == pytest.approx(1e3 * e.residual[e.weight >= 0.5])
    ((time, off),) = curve(figure.axes[1], "outlier (at the edge: beyond it)")
    assert time == found.experiments[1].record.time[40]
    assert 0.9 < off / figure.axes[1].get_ylim()[1] < 1.0
    assert words(figure.axes[0])[2] == "residual [mm]"


def test_many_logs_go_on_several_pictures(found):
    many = dataclasses.replace(found, experiments=found.experiments * 8)
    assert len(plots.draw_fits(many).axes) == plots.PER_PAGE
    last = plots.draw_fits(many, first=plots.PER_PAGE)
    assert len(last.axes) == 32 - plots.PER_PAGE
    names = plots.labels(many)
    assert len(set(names)) == 32
    assert words(last.axes[0])[0].startswith(names[plots.PER_PAGE])


def test_one_log_and_a_log_with_a_part_that_is_not_used(found):
    e = found.experiments[0]
    cut = e.residual.copy()
    cut[10:20] = np.nan
    alone = dataclasses.replace(found, experiments=(dataclasses.replace(e, residual=cut),))
    (axes,) = plots.draw_fits(alone).axes
    (shade,) = axes.patches
    assert shade.get_x() == e.record.time[10]
    plots.draw_residuals(alone)
    plots.draw_distribution(alone)


def test_the_distribution_is_that_of_the_residuals(found):
    histogram, quantiles, alike = plots.draw_distribution(found).axes
    u = np.concatenate([e.residual / e.noise for e in found.experiments])
    inside = np.abs(u) <= 5.0
    area = sum(bar.get_height() * bar.get_width() for bar in histogram.patches)
    assert area == pytest.approx(inside.mean())
    dots = quantiles.get_lines()[1].get_xydata()
    assert dots[:, 1] == pytest.approx(np.sort(u)[np.abs(np.sort(u)) <= 8.0])
    assert norm.cdf(dots[0, 0]) == pytest.approx(0.5 / len(u))
    mean = curve(alike, "all logs")[:20, 1]  # further lags are not those of all logs
    parts = []
    for e in found.experiments:
        r = np.sqrt(e.weight) * e.residual
        parts.append(np.correlate(r, r, "full")[len(r) :][:20] / (r @ r) * len(r))
    n = sum((e.weight > 0.0).sum() for e in found.experiments)
    assert mean == pytest.approx(np.sum(parts, axis=0) / n, abs=5e-3)
    assert [axes.get_xlabel() for axes in (histogram, quantiles, alike)] == [
        "residual [standard deviations]",
        "normal quantile [-]",
        "lag [samples]",
    ]


def test_the_regions_of_a_pair_are_where_chi_squared_says(found):
    figure = confidence.draw_ellipses(found)
    assert len(figure.axes) == 3
    lower = figure.axes[1]  # psi against K2
    assert lower.get_xlabel() == "K₂ [1/(m² s)]"
    assert lower.get_ylabel() == "ψ [cm³/m]"
    outer = max(
        (line.get_xydata() for line in lower.get_lines() if len(line.get_xdata()) > 100),
        key=lambda xy: np.ptp(xy[:, 0]),
    )
    K2, psi = found.parameters["K2"], found.parameters["psi"]
    i, j = found.names.index("K2"), found.names.index("psi")
    C = found.covariance[np.ix_([i, j], [i, j])] / np.outer([K2.value, 1.0], [K2.value, 1.0])
    off = np.column_stack([np.log(outer[:, 0] / K2.value), 1e-6 * outer[:, 1] - psi.value])
    distance = np.einsum("ki,ij,kj->k", off, np.linalg.inv(C), off)
    assert distance == pytest.approx(np.full(len(off), chi2.ppf(0.95, 2)), rel=1e-6)


def test_a_profile_stands_beside_its_quadratic_approximation(found):
    figure = confidence.draw_profiles(found)
    assert len(figure.axes) == len(found.names)
    for axes, name in zip(figure.axes, found.names, strict=True):
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
        bars = [line.get_xdata() for line in axes.get_lines() if len(line.get_xdata()) == 2]
        assert any(np.allclose(bar, per * np.array(p.ci95)) for bar in bars)


def test_neutral_volumes_stand_against_the_prior(found):
    left, right = plots.draw_neutral(found).axes
    widths = sorted(patch.get_width() for patch in left.patches)
    assert widths == pytest.approx([1.0, 2.0])  # cm3: one and two deviations to either side
    dots = left.containers[0].lines[0].get_xydata()
    errors = [1e6 * e.estimates["neutral_error"].value for e in found.experiments]
    assert dots[:, 0] == pytest.approx(errors)
    assert "[cm³]" in left.get_xlabel()
    assert "[cm³/h]" in right.get_xlabel()
    free = dataclasses.replace(found, neutral_std=float("inf"))
    assert plots.draw_neutral(free).axes[0].patches[:] == []


def test_gains_stand_against_the_size_of_the_step(found):
    singles = {"paper, eq. (27)": [(2e-5, 16000.0), (7.5e-5, 10600.0)]}
    (axes,) = plots.draw_gains(found, singles).axes
    rising, sinking = axes.containers
    assert len(rising.lines[0].get_xdata()) == len(sinking.lines[0].get_xdata()) == 2
    e = found.experiments[0]
    x, y = rising.lines[0].get_xydata()[0]
    assert x == pytest.approx(1e6 * e.step, rel=0.05)
    assert y == pytest.approx(found.parameters["K2"].value * np.exp(e.own_gain[0]))
    assert curve(axes, "paper, eq. (27)")[:, 1].tolist() == [16000.0, 10600.0]
    assert axes.get_ylabel() == "K₂ [1/(m² s)]"
    assert axes.get_xlabel() == "size of the volume change [cm³]"


@pytest.mark.parametrize("ci95", [(0.0, np.inf), (0.0, 9000.0), (7000.0, np.inf)])
def test_an_interval_without_an_end_has_no_band_among_the_gains(found, ci95):
    (axes,) = plots.draw_gains(found).axes
    (band,) = axes.patches
    low, high = found.parameters["K2"].ci95
    assert (band.get_y(), band.get_y() + band.get_height()) == pytest.approx((low, high))
    wide = dataclasses.replace(found.parameters["K2"], ci95=ci95)
    open_ = dataclasses.replace(found, parameters={**found.parameters, "K2": wide})
    (axes,) = plots.draw_gains(open_).axes
    assert axes.patches[:] == []
    assert len(axes.containers) == 2


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
    (axes,) = plots.draw_gains(found).axes
    assert axes.get_ylabel() == "gain over that of all logs [-]"
    names = [axes.get_xlabel() for axes in confidence.draw_ellipses(found).axes]
    assert "mass [kg]" in names


def test_draws_from_the_posterior_lie_beneath_the_regions(found):
    from swimbladder.estimation.motion.posterior import Posterior

    rng = np.random.default_rng(5)
    means = [found.parameters[name].value for name in found.names]
    draws = rng.multivariate_normal(means, found.covariance, 400)
    with_draws = dataclasses.replace(
        found, posterior=Posterior(names=found.names, draws=draws, effective=400.0)
    )
    lower = confidence.draw_ellipses(with_draws).axes[1]  # psi against K2
    dots = curve(lower, "draws from the posterior")
    i, j = found.names.index("K2"), found.names.index("psi")
    assert dots == pytest.approx(draws[:, [i, j]] * [1.0, 1e6])
