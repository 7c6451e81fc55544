"""Figures to hover and zoom: what a picture holds is in plotly's figure, with names and units."""

import json
import math
import os
import re
import shutil
import subprocess

import numpy as np
import pytest

import swimbladder as sb
from swimbladder.design.pool_day import paper_tasks
from swimbladder.design.pool_day.day import asked_of, rules_of
from swimbladder.design.pool_day.verdict import Asked
from swimbladder.show.html import answer_page
from swimbladder.show.interactive import as_plotly
from swimbladder.show.parts import Drawn, Shown
from swimbladder.show.picture import Ink, Picture, grid_of, stacked
from swimbladder.show.static import figure
from tests.pages import figures_of
from tests.vehicles import limited


def drawn(count=1, **given):
    return grid_of((6.0, 4.0), count, count, **given)


def traces(picture):
    made = as_plotly(picture)
    json.dumps(made, allow_nan=False)
    return made["data"], made["layout"]


def test_a_curve_keeps_its_numbers_its_names_and_its_units():
    picture, (panel,) = drawn()
    x, y = np.array([0.0, 1.0, np.nan, 3.0]), np.array([1.5, 2.5, 3.0, 1e-3 / 3.0])
    panel.line(x, y, Ink.BLUE, "height <1>", dash="--", marker="o")
    panel.x, panel.y = "time [s]", "height [m]"
    (trace,), layout = traces(picture)
    assert trace["x"] == [0.0, 1.0, None, 3.0]
    assert trace["y"] == pytest.approx([1.5, 2.5, 3.0, 1e-3 / 3.0], rel=1e-5)
    assert trace["mode"] == "lines+markers"
    assert trace["line"]["dash"] == "dash"
    assert trace["line"]["color"] == "rgba(0,114,178,1)"
    assert trace["name"] == "height &lt;1&gt;"
    assert trace["showlegend"]
    assert "time: %{x:.5~g} s<br>height: %{y:.5~g} m" in trace["hovertemplate"]
    assert layout["xaxis"]["title"]["text"] == "time [s]"
    assert layout["yaxis"]["side"] == "left"


def test_an_axis_is_the_same_in_both_ways_to_draw():
    picture, panels = drawn(3, sharey="all")
    for panel, top in zip(panels, (1.0, 5.0, 2.0), strict=True):
        panel.line([0.0, 2.0], [0.5, top])
    panels[1].bars([1.0, 3.0], [4.0, 2.0])
    panels[2].rule("x", 7.0)
    panels[2].xlim = (-1.0, None)
    _, layout = traces(picture)
    for number, axes in zip(("", "2", "3"), figure(picture).axes, strict=True):
        assert layout[f"xaxis{number}"]["range"] == pytest.approx(axes.get_xlim())
        assert layout[f"yaxis{number}"]["range"] == pytest.approx(axes.get_ylim(), abs=0.06)


def test_depth_goes_down_and_logarithms_are_of_ten():
    picture, (panel,) = drawn()
    panel.line([1.0, 1000.0], [0.1, 10.0])
    panel.xlog, panel.y = True, "depth [m]"
    _, layout = traces(picture)
    low, high = layout["yaxis"]["range"]
    assert low > high
    assert layout["xaxis"]["type"] == "log"
    (axes,) = figure(picture).axes
    assert axes.yaxis_inverted()
    assert layout["xaxis"]["range"] == pytest.approx(np.log10(axes.get_xlim()))


def test_steps_areas_bars_and_spans_are_what_they_were():
    picture, (left, right) = drawn(2)
    left.steps([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], label="held")
    left.band([0.0, 2.0], [1.0, 1.0], [2.0, 3.0], Ink.SKY, "band")
    left.rule("y", 2.0, Ink.BLACK, dash=":")
    left.span("x", 0.5, 1.0, Ink.PALE)
    right.bars([1.0, 2.0], [3.0, 4.0], base=[0.0, 1.0], thick=0.5, label="energy")
    data, layout = traces(picture)
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
    assert (line["layer"], span["layer"]) == ("above", "below")
    assert (span["xref"], span["x0"], span["x1"]) == ("x", 0.5, 1.0)
    assert (span["yref"], span["y0"], span["y1"]) == ("y domain", 0.0, 1.0)


def test_a_mesh_covers_what_it_covered():
    picture, (panel,) = drawn()
    panel.cells([0.5, 1.5, 2.5], [0.5, 1.5], np.array([[0, 0, 1], [1, 1, 1]]), (Ink.BLUE, Ink.SKY))
    data, _ = traces(picture)
    area = {}
    for trace in data:
        x, y = (np.array([math.nan if v is None else v for v in trace[k]]) for k in "xy")
        for part in np.split(np.arange(len(x)), np.flatnonzero(np.isnan(x))):
            px, py = (v[part][np.isfinite(v[part])] for v in (x, y))
            size = 0.5 * abs(np.dot(px, np.roll(py, -1)) - np.dot(np.roll(px, -1), py))
            area[trace["fillcolor"]] = area.get(trace["fillcolor"], 0.0) + size
    assert sorted(area.values()) == pytest.approx([2.0, 4.0])


def test_a_long_curve_is_thinned_and_keeps_its_extremes():
    picture, (panel,) = drawn()
    y = np.sin(np.linspace(0.0, 300.0, 400_000))
    y[123_456], y[300_001] = 7.0, -8.0
    panel.line(np.arange(len(y)), y)
    (trace,), _ = traces(picture)
    assert len(trace["x"]) < 70_000
    assert trace["x"] == sorted(trace["x"])
    assert (max(trace["y"]), min(trace["y"])) == (7.0, -8.0)
    assert trace["y"][trace["x"].index(123_456.0)] == 7.0


def test_panels_that_share_an_axis_move_together():
    picture, panels = stacked((6.0, 4.0), 1.0, 1.0)
    for panel in panels:
        panel.x = "time [s]"
    _, layout = traces(picture)
    assert layout["xaxis2"]["matches"] == "x"
    assert "matches" not in layout["yaxis2"]
    assert not layout["xaxis"]["showticklabels"]
    low, high = layout["yaxis"]["domain"], layout["yaxis2"]["domain"]
    assert 0.0 <= high[0] < high[1] < low[0] < low[1] <= 1.0


def test_a_second_axis_stands_over_the_first_at_the_right():
    picture, (panel,) = drawn()
    panel.line([0.0, 1.0], [1.0, 2.0])
    other = picture.add(x_of=panel, over=True, y="stroke [m]")
    other.line([0.0, 1.0], [10.0, 30.0])
    _, layout = traces(picture)
    assert (layout["yaxis2"]["overlaying"], layout["yaxis2"]["side"]) == ("y", "right")
    assert layout["xaxis2"]["matches"] == "x"
    first, second = figure(picture).axes
    assert first.get_xlim() == second.get_xlim()
    assert first.get_ylim() != second.get_ylim()


def test_a_legend_names_what_has_no_curve_of_its_own():
    picture, (panel,) = drawn()
    panel.line([0.0, 1.0], [0.0, 1.0])
    panel.span("y", 0.2, 0.4, Ink.GREEN, "settled", alpha=1.0)
    data, layout = traces(picture)
    (key,) = [trace for trace in data if trace.get("showlegend", True)]
    assert key["name"] == "settled"
    assert key["marker"]["color"] == "rgba(0,158,115,1)"
    assert layout["showlegend"]
    (axes,) = figure(picture).axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["settled"]


@pytest.fixture(scope="session")
def chromium():
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        if "browser" in os.environ.get("SWIMBLADDER_REQUIRE", "").split(","):
            pytest.fail("chromium is not installed (make tools), SWIMBLADDER_REQUIRE asks for it")
        pytest.skip("chromium is not installed (make tools)")
    return found


def in_browser(chromium, html, folder):
    """The body of a page as a browser without a network has it once its scripts have run."""
    (folder / "page.html").write_text(html, encoding="utf-8")
    quiet = "--disable-background-networking --disable-component-update --disable-sync"
    quiet += " --no-first-run --disable-gpu --disable-quic --proxy-server=127.0.0.1:9"
    command = [chromium, "--headless", "--no-sandbox", *quiet.split()]
    command += [f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=10000"]
    command += ["--dump-dom", (folder / "page.html").as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return ran.stdout[ran.stdout.index("<body") :]


def test_a_browser_draws_every_figure_of_a_page_without_a_network(chromium, tmp_path):
    picture, (top, low) = stacked((6.0, 4.0), 1.0, 1.0)
    top.line([0.0, 1.0, 2.0], [1.0, 3.0, 2.0], label="depth")
    top.rule("y", 2.0)
    top.y = "depth [m]"
    low.bars([0.5, 1.5], [1.0, 2.0])
    low.x, low.y = "time [s]", "energy [J]"
    other, (panel,) = drawn()
    panel.cells([0.5, 1.5], [0.5, 1.5], np.array([[0, 1], [0, 0]]), (Ink.BLUE, Ink.SKY))
    panel.text(0.5, 0.5, "a note", share="xy", boxed=True)
    pictures = {"one": picture, "two": other}

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
    body = in_browser(chromium, html, tmp_path)
    assert len(re.findall(r'class="plot js-plotly-plot"', body)) == 2
    assert 'class="trace bars"' in body
    assert "depth [m]" in body
    assert "It &lt;settles&gt;." in body
    assert re.search(r'class="legendtext"[^>]*>depth<', body)


@pytest.mark.prove
@pytest.mark.parametrize("name", ["vehicle", "firmware", "pool"])
def test_a_browser_draws_the_page(chromium, name, tmp_path):
    v = limited(sb.load_vehicle("feup-em"))
    day = {"rules": rules_of(v, bottom_depth=4.5), "tasks": paper_tasks(v, bottom_depth=4.5)}
    answer = {
        "vehicle": lambda: v,
        "firmware": lambda: sb.firmware(v, duration=30.0),
        "pool": lambda: sb.PoolDay(v, tmp_path, **day, asked=asked_of(v, Asked()), mode="followed"),
    }[name]()
    html = answer.report(tmp_path / "report.html").read_text("utf-8")
    body = in_browser(chromium, html, tmp_path)
    figures = figures_of(html)
    assert len(re.findall(r'class="plot js-plotly-plot"', body)) == len(figures) > 0
    assert body.count('class="ytitle"') >= len(figures)


def test_an_axis_of_counts_has_no_ticks_between_them():
    picture, (panel,) = drawn()
    panel.bars([1.0, 2.0, 3.0], [1.0, 2.0, 2.0])
    panel.counts = "x"
    _, layout = traces(picture)
    assert (layout["xaxis"]["tick0"], layout["xaxis"]["dtick"]) == (0, 1)


def test_a_text_on_a_logarithmic_axis_stands_where_its_point_is():
    picture, (panel,) = drawn()
    panel.dots([1.0, 1000.0], [2.0, 3.0])
    panel.xlog = True
    panel.text(100.0, 2.5, "here")
    panel.text(0.5, 2.5, "in the middle", share="x")
    _, layout = traces(picture)
    here, middle = layout["annotations"]
    assert (here["x"], here["y"], middle["x"]) == (2.0, 2.5, 0.5)
    assert layout["xaxis"]["ticktext"] == ["1", "10", "100", "1000"]


def test_an_empty_figure_is_no_error():
    data, _ = traces(Picture((4.0, 3.0)))
    assert data == []
    assert figure(Picture((4.0, 3.0))).axes == []
    picture, _ = drawn()
    assert traces(picture)[0] == []
    assert len(figure(picture).axes) == 1


def test_ticks_with_names_keep_them():
    picture, (panel,) = drawn()
    panel.bars([0, 1], [3.0, 4.0], flat=True)
    panel.yticks, panel.xticks = {0.0: "drag", 1.0: "psi"}, {0.0: "0.0", 2.5: "2.5"}
    layout = as_plotly(picture)["layout"]
    assert layout["yaxis"]["tickmode"] == layout["xaxis"]["tickmode"] == "array"
    assert layout["yaxis"]["tickvals"] == [0.0, 1.0]
    assert layout["yaxis"]["ticktext"] == ["drag", "psi"]
    assert layout["xaxis"]["ticktext"] == ["0.0", "2.5"]
    (axes,) = figure(picture).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["drag", "psi"]
