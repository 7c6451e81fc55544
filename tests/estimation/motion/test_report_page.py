"""The page of an identification: plain words first, nothing fetched, no number that is not told."""

import dataclasses
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from swimbladder.estimation.motion import Estimate, Prior, identify
from swimbladder.estimation.motion.paper_method import paper_fits
from swimbladder.io.config import load_vehicle
from swimbladder.show import estimates as text
from swimbladder.show.answers import write
from swimbladder.show.html import answer_page
from swimbladder.show.identification import IdentificationShown, residuals
from swimbladder.show.picture import Picture
from tests.estimation.motion.pool import campaign, pool_log
from tests.pages import without_scripts
from tests.quoted import numbers

FEUP_EM = load_vehicle("feup-em")


@pytest.fixture(scope="module")
def found():
    return identify(campaign(71, quantum=5e-3, steps=(2e-5, -3e-5, 4.5e-5, -7.5e-5)), FEUP_EM)


@pytest.fixture(scope="module")
def untold():
    log = pool_log(7.5e-5, travel=0.35, rng=np.random.default_rng(7))
    return identify([log], FEUP_EM, neutral_std=float("inf"), profiles=False)


class Page(HTMLParser):
    """The texts, sources and links of a page, and whether its tags are closed."""

    def __init__(self, html):
        super().__init__()
        self.texts, self.sources, self.links, self.open = [], [], [], []
        self.ids, self.tables = [], []
        self.feed(html)
        self.text = " ".join(" ".join(self.texts).split())

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.sources += [value for name, value in attributes if name in ("src", "srcset")]
        self.links += [given["href"]] if "href" in given else []
        self.ids += [given["id"]] if "id" in given else []
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        if tag == "img":
            assert given["alt"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "title", "script"):
            self.texts.append(data)


def page_of(identification, *, paper=None, files=("identify.json",)):
    shown = IdentificationShown(identification, paper=paper, seconds=1.23)
    figures = {p.name: Picture((4.0, 3.0)) for p in shown.drawn()}
    html = answer_page(shown, list(shown.parts()), figures, files, "swimbladder identify a b")
    return Page(html), html


def test_the_page_needs_nothing_but_itself(found):
    read, html = page_of(found, paper=paper_fits(found))
    assert read.open == []
    assert read.sources == []
    assert not [link for link in read.links if "://" in link]
    assert not re.search(r"url\(|@import", without_scripts(html))
    assert len(read.ids) == len(set(read.ids))


def test_plain_words_come_first_and_hold_the_numbers(found):
    read, _ = page_of(found)
    K2 = found.parameters["K2"]
    sentence = text.headlines(found)[0]
    value, share = re.match(r"K2 is (\S+) 1/m2/s, known to (\S+) %", sentence).groups()
    assert float(value) == pytest.approx(K2.value, rel=0.01)
    half = (K2.ci95[1] - K2.ci95[0]) / 2.0 / K2.value
    assert float(share) == pytest.approx(100.0 * half, rel=0.06)
    assert f"{1e-3 * K2.value:.3g} mm/s" in sentence
    first = read.text.index("known to")
    for later in ("95 % interval", "Assumptions", "Measured and fitted depth", "Likelihood"):
        assert first < read.text.index(later)
    assert "swimbladder identify a b" in read.text
    assert "mm of noise, 1.2 s" in read.text


def test_every_part_of_the_evidence_is_there(found):
    read, _ = page_of(found, paper=paper_fits(found))
    for name in ("fits", "residuals", "distribution", "ellipses", "profiles", "neutral", "gains"):
        assert name in read.ids
    for heading in ("Assumptions", "Model comparison", "The paper's way"):
        assert heading in read.text
    assert "(reported)" in read.text
    for said in ("known to 0.5 cm 3 (1 sigma)", "drag law: linear", "neutral at the first sample"):
        assert said in read.text
    assert read.text.count("quadratic") >= 2  # of the models that were tried


def test_a_page_of_what_is_not_told_has_no_number_for_it(untold):
    read, _ = page_of(untold)
    assert "not identified from 1 log" in read.text
    for finding in untold.findings:
        if finding.severity == "no":
            assert finding.sentence.split(".")[0].split(":")[0][-20:] in re.sub(
                " ([0-9]) ", r"\1 ", read.text
            ).replace("ψ", "psi")
    assert {"ellipses", "profiles", "gains"}.isdisjoint(read.ids)
    rows = text.rows(untold)
    assert len({r.value for r in rows}) == 1  # the same words instead of each number
    assert all(not numbers(r.value) for r in rows)
    for e in untold.parameters.values():
        assert f"{e.value:.4g}" not in read.text


def test_texts_are_escaped(found):
    first = dataclasses.replace(found.experiments[0], source='<b>"&.csv')
    odd = dataclasses.replace(found, experiments=(first, *found.experiments[1:]))
    read, html = page_of(odd, files=("a<b>.png",))
    assert "<b>" not in without_scripts(html)
    assert '<b>"&.csv' in read.text


@pytest.mark.prove
def test_writing_it_again_takes_away_what_is_stale(found, untold, tmp_path):
    told = []
    out = tmp_path / "out"
    files = write(IdentificationShown(found), out, advance=told.append)
    assert all(path.is_file() for path in files)
    assert sum(told) == pytest.approx(1.0)
    mine = out / "figures" / "mine.png"
    mine.write_bytes(b"a picture")
    again = write(IdentificationShown(untold), out)
    left = {path for path in out.rglob("*") if path.is_file()}
    assert left == {*again, mine}
    assert out / "vehicle.toml" not in left
    assert json.loads((out / "identify.json").read_text(encoding="utf-8"))["identified"] is False


def test_the_vehicle_file_is_the_vehicle(found, tmp_path):
    write(IdentificationShown(found), tmp_path / "o")
    assert load_vehicle(tmp_path / "o" / "vehicle.toml") == found.vehicle


def test_residuals_as_columns(found):
    columns = residuals(found)
    assert len({len(values) for values in columns.values()}) == 1
    assert set(columns["log"]) == {1.0, 2.0, 3.0, 4.0}
    assert "voltage_V" not in columns


@pytest.mark.parametrize(
    ("estimate", "texts"),
    [
        (Estimate(7935.5, 96.4, (7750.0, 8127.0), "1/m2/s"), ("7936", "96", "7750 to 8127")),
        (
            Estimate(4.04e-6, 8.8e-8, (3.87e-6, 4.21e-6), "m3/m"),
            ("4.040", "0.088", "3.870 to 4.210"),
        ),
        (Estimate(0.0, 0.11, (0.0, 0.1013), "N s2/m2"), ("0.00", "0.11", "0.00 to 0.10")),
        (Estimate(5.0, 2.0, (2.0, float("inf")), "s"), ("5.0", "2.0", "2.0 or more")),
        (Estimate(5.0, 2.0, (float("-inf"), 9.0), "s"), ("5.0", "2.0", "9.0 or less")),
        (Estimate(2e-6, 0.0, (2e-6, 2e-6), "m3/m", "set"), ("2", "", "")),
        (Estimate(123456.0, 7654.0, (1e5, 1.4e5), "s"), ("123500", "7700", "100000 to 140000")),
    ],
)
def test_numbers_have_the_digits_that_their_errors_leave(estimate, texts):
    r = text.row("x", estimate)
    assert (r.value, r.std, r.ci95) == texts


def test_what_may_be_zero_is_said_so(found):
    e = Estimate(1e-7, 2e-7, (-3e-7, 5e-7), "m3/m")
    odd = dataclasses.replace(found, parameters={**found.parameters, "psi": e})
    last = text.headlines(odd)[-1]
    assert last.startswith("psi ")
    assert {0.0, -0.3, 0.5, 95.0} <= numbers(last)  # cm3/m, %
    e = dataclasses.replace(e, ci95=(0.0, np.inf))
    odd = dataclasses.replace(found, parameters={**found.parameters, "psi": e})
    said = "psi is not distinguishable from 0 (95 %: 0.00 or more cm3/m)."
    assert text.headlines(odd)[-1] == said


def test_a_prior_is_named_where_it_makes_the_value():
    log = campaign(72, steps=(4.5e-5,))
    found = identify(
        log, FEUP_EM, priors={"psi": Prior(4.04e-6, 1e-9)}, choices=False, profiles=False
    )
    assert "mostly by its prior" in text.headlines(found)[-1]
    assert text.row("psi", found.parameters["psi"]).origin == "prior"


def test_notes_of_reading_name_their_logs(found):
    def noted(e, *notes):
        return dataclasses.replace(e, record=dataclasses.replace(e.record, notes=notes))

    first, second, *rest = found.experiments
    odd = dataclasses.replace(
        found,
        experiments=(
            noted(first, "all", "12 of 40 rows chosen"),
            noted(second, "all", "spikes"),
            *(noted(e, "all") for e in rest),
        ),
    )
    assert text.reading(odd, ["a", "b", "c", "d"]) == ["all", "b: spikes"]


def test_a_walk_is_told_with_how_far_it_went():
    logs = campaign(73, steps=(3e-5, -4.5e-5, 7.5e-5))
    found = identify(logs, FEUP_EM, fixed={"psi": 4.04e-6}, process_noise="always")
    read, _ = page_of(found)
    assert "Process noise" in read.text
    after_a_minute = 1e6 * found.process_noise.noises["random_walk"].value * 60.0**0.5  # cm3
    shown = re.search(r"random walk.*?, 1 sigma (\S+) cm", read.text).group(1)
    assert float(shown) == pytest.approx(after_a_minute, rel=0.06, abs=1e-4)
    for went in found.process_noise.travelled:
        assert f"{1e6 * went:.2g}" in read.text or went < 1e-9
