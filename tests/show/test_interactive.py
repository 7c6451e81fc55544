"""Figures to hover and zoom: what matplotlib draws is in plotly's figure, with names and units."""

import json
import math
import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from swimbladder.show import style
from swimbladder.show.html import answer_page
from swimbladder.show.interactive import as_plotly
from swimbladder.show.parts import Drawn, Shown
from tests.pages import figures_of


def drawn(*, rows=1, columns=1, **given):
    figure, axes = style.new_figure((6.0, 4.0), rows, columns, **given)
    return figure, axes


def traces(figure):
    made = as_plotly(figure)
    json.dumps(made, allow_nan=False)
    return made["data"], made["layout"]


def test_a_curve_keeps_its_numbers_its_names_and_its_units():
    figure, (axes,) = drawn()
    x, y = np.array([0.0, 1.0, np.nan, 3.0]), np.array([1.5, 2.5, 3.0, 1e-3 / 3.0])
    axes.plot(x, y, "--o", color=style.Ink.BLUE, label="depth <1>")
    axes.set(xlabel="time [s]", ylabel="depth [m]")
    axes.legend()
    (trace,), layout = traces(figure)
    assert trace["x"] == [0.0, 1.0, None, 3.0]
    assert trace["y"] == pytest.approx([1.5, 2.5, 3.0, 1e-3 / 3.0], rel=1e-5)
    assert trace["mode"] == "lines+markers"
    assert trace["line"]["dash"] == "dash"
    assert trace["line"]["color"] == "rgba(0,114,178,1)"
    assert trace["name"] == "depth &lt;1&gt;"
    assert trace["showlegend"]
    assert "time: %{x:.5~g} s<br>depth: %{y:.5~g} m" in trace["hovertemplate"]
    assert layout["xaxis"]["title"]["text"] == "time [s]"
    assert layout["yaxis"]["range"] == pytest.approx(axes.get_ylim())
    assert layout["yaxis"]["type" if "type" in layout["yaxis"] else "side"] == "left"


def test_depth_goes_down_and_logarithms_are_of_ten():
    figure, (axes,) = drawn()
    axes.loglog([1.0, 1000.0], [0.1, 10.0])
    style.depth_axis(axes)
    _, layout = traces(figure)
    low, high = layout["yaxis"]["range"]
    assert low > high
    assert layout["xaxis"]["type"] == "log"
    assert layout["xaxis"]["range"] == pytest.approx(np.log10(axes.get_xlim()))


def test_steps_areas_bars_and_spans_are_what_they_were():
    figure, (left, right) = drawn(columns=2)
    left.step([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], where="post", label="held")
    left.fill_between([0.0, 2.0], [1.0, 1.0], [2.0, 3.0], label="band")
    left.axhline(2.0, color="black", ls=":")
    left.axvspan(0.5, 1.0, color="#E8E8E8")
    right.bar([1.0, 2.0], [3.0, 4.0], bottom=[0.0, 1.0], width=0.5, label="energy")
    data, layout = traces(figure)
    band, held, bars = (next(t for t in data if t["name"] == n) for n in ("band", "held", "energy"))
    assert held["line"]["shape"] == "hv"
    assert band["fill"] == "toself"
    corners = set(zip(band["x"], band["y"], strict=True))
    assert {(0.0, 1.0), (2.0, 1.0), (0.0, 2.0), (2.0, 3.0)} <= corners
    assert (bars["x"], bars["y"], bars["base"]) == ([1.0, 2.0], [3.0, 4.0], [0.0, 1.0])
    assert bars["width"] == [0.5, 0.5]
    assert (bars["xaxis"], bars["yaxis"]) == ("x2", "y2")
    line = next(s for s in layout["shapes"] if s["type"] == "line")
    assert (line["xref"], line["x0"], line["x1"]) == ("x domain", 0.0, 1.0)
    assert (line["yref"], line["y0"], line["y1"]) == ("y", 2.0, 2.0)
    span = next(s for s in layout["shapes"] if s["type"] == "rect")
    assert (line.get("layer", "above"), span["layer"]) == ("above", "below")
    assert (span["xref"], span["x0"], span["x1"]) == ("x", 0.5, 1.0)
    assert (span["yref"], span["y0"], span["y1"]) == ("y domain", 0.0, 1.0)


def test_a_mesh_covers_what_it_covered():
    figure, (axes,) = drawn()
    values = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    axes.pcolormesh([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0], values)
    data, _ = traces(figure)
    area = {}
    for trace in data:
        x, y = (np.array([math.nan if v is None else v for v in trace[k]]) for k in "xy")
        for part in np.split(np.arange(len(x)), np.flatnonzero(np.isnan(x))):
            px, py = (v[part][np.isfinite(v[part])] for v in (x, y))
            size = 0.5 * abs(np.dot(px[:-1], py[1:]) - np.dot(px[1:], py[:-1]))
            area[trace["fillcolor"]] = area.get(trace["fillcolor"], 0.0) + size
    assert sorted(area.values()) == pytest.approx([2.0, 4.0])


def test_a_long_curve_is_thinned_and_keeps_its_extremes():
    figure, (axes,) = drawn()
    y = np.sin(np.linspace(0.0, 300.0, 400_000))
    y[123_456], y[300_001] = 7.0, -8.0
    axes.plot(y)
    (trace,), _ = traces(figure)
    assert len(trace["x"]) < 70_000
    assert trace["x"] == sorted(trace["x"])
    assert (max(trace["y"]), min(trace["y"])) == (7.0, -8.0)
    assert trace["y"][trace["x"].index(123_456.0)] == 7.0


def test_panels_that_share_an_axis_move_together():
    figure, _ = drawn(rows=2, sharex=True)
    _, layout = traces(figure)
    assert layout["xaxis2"]["matches"] == "x"
    assert "matches" not in layout["yaxis2"]
    assert not layout["xaxis"]["showticklabels"]
    low, high = layout["yaxis"]["domain"], layout["yaxis2"]["domain"]
    assert high[1] < low[0]


def test_a_legend_names_what_has_no_curve_of_its_own():
    figure, (axes,) = drawn()
    axes.plot([0.0, 1.0], [0.0, 1.0], label="_hidden")
    patch = Patch(color=style.Ink.GREEN)
    figure.legend([patch], ["settled"], loc="outside lower center")
    data, layout = traces(figure)
    (key,) = [trace for trace in data if trace.get("showlegend", True)]
    assert key["name"] == "settled"
    assert key["marker"]["color"] == "rgba(0,158,115,1)"
    assert layout["showlegend"]


@pytest.fixture(scope="session")
def chromium():
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        if "browser" in os.environ.get("SWIMBLADDER_REQUIRE", "").split(","):
            pytest.fail("chromium is not installed (make tools), SWIMBLADDER_REQUIRE asks for it")
        pytest.skip("chromium is not installed (make tools)")
    return found


def test_a_browser_draws_every_figure_of_a_page_without_a_network(chromium, tmp_path):
    figure, (top, low) = drawn(rows=2, sharex=True)
    top.plot([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], label="depth")
    top.axhline(2.0)
    top.set(ylabel="depth [m]")
    top.legend()
    low.bar([0.5, 1.5], [1.0, 2.0])
    low.set(xlabel="time [s]", ylabel="energy [J]")
    other, (axes,) = drawn()
    axes.pcolormesh([0.0, 1.0, 2.0], [0.0, 1.0], [[0.0, 1.0]])
    pictures = {"one": figure, "two": other}

    class Settling(Shown[None]):
        title = "A page"

        def parts(self):
            return ["It <settles>.", *(Drawn(name, None) for name in pictures)]

        def numbers(self):
            return {"rms_m": 0.001}

    shown = Settling(None)
    html = answer_page(shown, shown.parts(), pictures)
    assert set(figures_of(html)) == {"one", "two"}
    assert len(html) < 3_000_000
    (tmp_path / "page.html").write_text(html, encoding="utf-8")
    quiet = "--disable-background-networking --disable-component-update --disable-sync"
    quiet += " --no-first-run --disable-gpu --disable-quic --proxy-server=127.0.0.1:9"
    command = [chromium, "--headless", "--no-sandbox", *quiet.split()]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000"]
    command += ["--dump-dom", (tmp_path / "page.html").as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    shown = ran.stdout[ran.stdout.index("<body") :]
    assert len(re.findall(r'class="plot js-plotly-plot"', shown)) == 2
    assert 'class="trace bars"' in shown
    assert "depth [m]" in shown
    assert "It &lt;settles&gt;." in shown
    assert re.search(r'class="legendtext"[^>]*>depth<', shown)


def test_an_axis_of_counts_has_no_ticks_between_them():
    figure, (axes,) = drawn()
    axes.bar([1.0, 2.0, 3.0], [1.0, 2.0, 2.0])
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_yticks([])
    _, layout = traces(figure)
    assert (layout["xaxis"]["tick0"], layout["xaxis"]["dtick"]) == (0, 1)
    assert layout["yaxis"]["ticks"] == ""
    assert not layout["yaxis"]["showticklabels"]


def test_an_empty_figure_is_no_error():
    data, _ = traces(Figure())
    assert data == []


def test_ticks_with_names_keep_them():
    figure = Figure()
    axes = figure.subplots()
    axes.barh([0, 1], [3.0, 4.0])
    axes.set_yticks([0, 1], ["drag", "psi"])
    axes.set_xticks([0.0, 2.5])
    layout = as_plotly(figure)["layout"]
    assert layout["yaxis"]["tickmode"] == layout["xaxis"]["tickmode"] == "array"
    assert layout["yaxis"]["tickvals"] == [0.0, 1.0]
    assert layout["yaxis"]["ticktext"] == ["drag", "psi"]
    assert layout["xaxis"]["ticktext"] == ["0.0", "2.5"]
