"""The report: whole, self-contained, valid, and no wider than the screen it is read on."""

import dataclasses
import functools
import html.parser
import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import tyro
import worlds
import xarray as xr
from browser import CHROMIUM, Browser

from paper_figs import pipeline, report
from paper_figs.__main__ import Options
from paper_figs.claims.delta import Delta
from paper_figs.figures import FIGURES
from sweeps.options import FLAGS
from sweeps.sweep import SMOKE, Size, size_of

REFERENCE = Path(report.__file__).parents[1] / "published" / "figures"
VOID = {"img", "meta", "link", "br", "hr", "input"}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@functools.cache
def judgements():
    return pipeline.judgements_of(worlds.opposite(seeds=6, episodes=700))


def sweep_data(x_values):
    variables = {f"optimum_{name}": (("point",), np.array(x_values) + 1.0) for name in report._OPTIMUM}
    coords = {"point": range(len(x_values)), "favourable_probability": ("point", x_values), "seed": [0]}
    return xr.Dataset(variables, coords)


@pytest.fixture(scope="module")
def page():
    claims = [*judgements()]
    claims[0] = dataclasses.replace(claims[0], value=float("nan"), ci_low=float("nan"), ci_high=float("nan"))
    return report.render(
        Size(),
        {figure.title: REFERENCE / f"{figure.name}.png" for figure in FIGURES},
        claims,
        report.optimum_rows("fig7", sweep_data([0.25, 0.75])) + report.optimum_rows("fig5a", sweep_data([0.0])),
        [{"sweep": "fig6", "algorithm": "dpr", "point": 3, "seed": 41, "episode": 17}],
        {figure.name: (REFERENCE / f"{figure.name}.manifest.json").read_text() for figure in FIGURES},
    )


class Page(html.parser.HTMLParser):
    """Elements that are opened and closed in order, ids, links, loaded files, and the text of table rows."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.links, self.loaded, self.rows, self.images = [], [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.ids += [attributes["id"]] if "id" in attributes else []
        if tag == "a":
            self.links.append(attributes["href"])
        elif {"src", "href"} & attributes.keys():
            self.loaded.append(attributes.get("src") or attributes.get("href"))
        self.images += [attributes] if tag == "img" else []
        self.rows += [""] if tag == "tr" else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "tr" in self.open:
            self.rows[-1] += f"{data}|"


@pytest.fixture(scope="module")
def parsed(page):
    return Page(page)


def test_elements_are_closed_and_links_lead_somewhere(parsed):
    assert parsed.open == []
    assert len(set(parsed.ids)) == len(parsed.ids)
    assert {link.removeprefix("#") for link in parsed.links if link.startswith("#")} <= set(parsed.ids)
    beside = {f"{figure.name}{suffix}" for figure in FIGURES for suffix in (".png", ".pdf", ".csv")}
    beside |= {"claims.json"}
    others = {link for link in parsed.links if not link.startswith("#")} - {"seeds_needed.csv"}  # if some are undecided
    assert others == beside | {"https://arxiv.org/abs/2105.13670"}
    assert all((REFERENCE / name).is_file() for name in beside)


def test_nothing_is_loaded_from_elsewhere(page, parsed):
    assert all(address.startswith("data:image/png;base64,") for address in parsed.loaded)
    assert not re.search(r"url\(|@import|<script [^>]*src|<link|fetch\(|https?:(?!//arxiv.org/abs/)", page)


def test_every_figure_is_there_with_a_text_in_its_place(parsed):
    assert [figure.name in parsed.ids for figure in FIGURES] == [True] * len(FIGURES)
    assert [figure.title in image["alt"] for figure, image in zip(FIGURES, parsed.images, strict=True)] == [True] * 6
    for figure, image in zip(FIGURES, parsed.images, strict=True):
        assert len(image["src"]) > (REFERENCE / f"{figure.name}.png").stat().st_size
        assert int(image["width"]) > int(image["height"]) > 500


def test_every_claim_is_there_with_its_verdict_in_words_and_a_link_to_its_figure(parsed):
    for claim in judgements():
        row = next(row for row in parsed.rows if row.startswith(f"{claim.claim}|"))
        assert f"{report.SIGNS[claim.verdict]} {claim.verdict}" in row
        assert claim.statement in row
        anchor = report._anchor(claim)
        assert parsed.ids.count(anchor) == 1
        assert parsed.links.count(f"#{anchor}") == 1  # from its figure
    links = [link for link in parsed.links if link in {f"#{figure.name}" for figure in FIGURES}]
    assert len(links) == len(FIGURES) + len(judgements())  # back from the large figures, and from each claim
    assert links[len(FIGURES)] == "#fig5a"
    assert links[-1] == "#fig9"
    assert len(set(report.SIGNS.values())) == 3


def test_numbers_have_four_digits_and_what_is_missing_is_a_dash(parsed):
    assert [report._number(value) for value in (-257.8123, 0.03, 4.0, float("nan"))] == [
        "−257.8",
        "0.03000",
        "4.000",
        "–",
    ]
    row = next(row for row in parsed.rows if row.startswith("C1 (reached)|"))
    assert "|–|– to –|" in row
    never = next(row for row in parsed.rows if row.startswith("C1 (about 200)|"))
    assert "|never|700 to never|" in never


def test_the_optimum_is_told_with_the_value_of_each_point(parsed):
    assert any("fig7|1|" in row.replace("\n|", "") and "favourable probability = 0.75" in row for row in parsed.rows)
    assert not any("fig5a" in row and "favourable" in row for row in parsed.rows)


def test_settings_and_origin_are_there(page, parsed):
    text = "\n".join(parsed.rows)
    assert "speed.event_probability|0.005, 0.1|0.005, 0.4|" in text
    assert "miss_bank" not in text
    assert "learning_rate|0.001|" in text
    assert "priority_exponent|0.4 (fig5a, fig5b, fig6, fig7, fig8); 0.4, 0.0 (fig9)|" in text
    assert re.search(r"fig6\|\s*\|?dpr\|3\|41\|", text.replace("\n", ""))
    manifest = json.loads((REFERENCE / "fig6.manifest.json").read_text())
    assert manifest["git_commit"][:12] in page
    assert f"jax {manifest['versions']['jax']}" in page


@pytest.mark.parametrize(
    ("size", "only", "delta", "command"),
    [
        (Size(), (), Delta(), "--seeds 10 --episodes 1000 --preset paper"),
        (SMOKE, (), Delta(), "--smoke --seeds 2 --episodes 20 --preset paper"),
        (
            Size(),
            (5, 9),
            Delta(reward=0.02, miss_detection=0.05),
            "--seeds 10 --episodes 1000 --preset paper --only 5 9 --delta.reward 0.02 --delta.miss-detection 0.05",
        ),
    ],
)
def test_the_command_makes_the_page_anew(size, only, delta, command):
    page = report.render(size, {}, [], [], [], {}, only, delta)
    assert f"<pre>make figures ARGS=&#39;{command}&#39;</pre>" in page
    options = tyro.cli(Options, args=command.split(), config=FLAGS)
    assert (options.only, options.delta) == (only, delta)
    assert size_of(options.seeds, options.episodes, options.preset, options.smoke) == size


def test_what_to_do_next_is_about_the_run_that_the_page_shows():
    size, manifest = Size(seeds=4, episodes=450, preset="paper_table"), (REFERENCE / "fig9.manifest.json").read_text()
    claims = [dataclasses.replace(judgements()[0], verdict="undecided")]
    page = report.render(size, {}, claims, [], [], {"fig9": manifest}, (9,))
    # Of another preset or length no seeds are there.
    assert "Decide more: 1 statement is undecided" in page
    assert "make figures ARGS=&#39;--seeds 12 --episodes 450 --preset paper_table --only 9&#39;" in page
    assert "sweeps verify OUT/results/paper_table-450-episodes/fig9 --parts 1" in page


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs a Chromium")
def test_claims_are_sorted_and_figures_enlarged(page, tmp_path):
    (tmp_path / "report.html").write_text(page)
    browser = Browser(tmp_path / "profile")
    try:
        browser.call("Page.navigate", url=(tmp_path / "report.html").as_uri())
        browser.wait("document.querySelector('th button') !== null")
        heads = "[...document.querySelectorAll('.sortable th button')].find(b => b.textContent === 'measured')"
        cells = "[...document.querySelectorAll('.sortable tbody tr')].map(row => +row.cells[5].dataset.value)"
        for sign in (1, -1):
            browser.run(f"{heads}.click()")
            values = [sign * value for value in browser.run(cells) if value is not None and math.isfinite(value)]
            assert values == sorted(values)
            assert len(values) > 30
        browser.run("document.querySelector('#fig6-large > a:not(.close)').click()")
        shown = "getComputedStyle(document.getElementById('fig6-large')).position"
        assert browser.run(shown) == "fixed"
        browser.run("document.querySelector('#fig6-large .close').click()")
        assert browser.run(shown) == "static"
        assert browser.run("document.querySelector('#fig6 a.png').href").startswith("data:image/png")
    finally:
        browser.close()


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_screen(page, width, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("needs Chromium")
    (tmp_path / "report.html").write_text(page)
    # A browser's window has a least width, a frame has none.
    frame = f'<iframe src="report.html" style="width:{width}px;height:800px;border:0"></iframe>'
    measure = "const d=document.querySelector('iframe').contentDocument.documentElement;"
    report_it = "document.title=`${d.clientWidth} ${d.scrollWidth}`"
    (tmp_path / "frame.html").write_text(f"{frame}<script>onload=()=>{{{measure}{report_it}}}</script>")
    offline = ("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", *offline]
    command += ["--allow-file-access-from-files", f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1400,900"]
    command += ["--dump-dom", (tmp_path / "frame.html").as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    found = re.search(r"<title>(\d+) (\d+)</title>", done.stdout)
    assert found, done.stderr[-500:]
    assert [int(number) for number in found.groups()] == [width, width]
