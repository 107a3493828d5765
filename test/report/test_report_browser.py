"""A real browser draws every plot of a report, without a complaint and without a network."""

import html
import json
import re
from types import SimpleNamespace

import browser
import numpy as np
import pytest
from paper_study_sample import sample_study

from frac_accel.cli import main
from frac_accel.paper import PaperResult, reproduce
from frac_accel.report import Page, figures
from frac_accel.report.paper import paper_page

BUTTONS = {"Download plot", "Download plot as a PNG", "Download plot as a png", "Zoom", "Pan",
           "Zoom in", "Zoom out", "Reset axes"}


@pytest.fixture(scope="module", autouse=True)
def _browser():
    browser.require_browser()


def drawn(dom):
    """For each plot of a document: its data, and numbers of traces, lines, points and bars."""
    for name in re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', dom):
        start = dom.index(f'id="{name}"')
        end = dom.index(f'id="{name}-data"')
        # the legend, which has lines and points of its own, is in the layer of information
        plot = dom[start:end].split('class="infolayer"')[0]
        text = dom[dom.index(">", end) + 1:dom.index("</script>", end)]
        yield json.loads(html.unescape(text))["data"], {
            "svg": plot.count('class="main-svg"'),
            "trace": len(re.findall(r'<g class="trace ', plot)),
            # a line with gaps has more paths than the first
            "lines": len(re.findall(r'<g class="lines"><path class="js-line"[^>]* d="M[^"]{5,}',
                                    plot)),
            "fills": len(re.findall(r'class="js-fill" d="M[^"]{5,}', plot)),
            "points": len(re.findall(r'<path class="point"[^>]* d="M', plot)),
            "bars": len(re.findall(r'<g class="point"><path d="M', plot))}


def require_drawn(dom):
    plots = list(drawn(dom))
    for data, found in plots:
        assert found["svg"] > 0
        assert found["trace"] == len(data)
        scatters = [trace for trace in data if trace["type"] == "scatter"]
        assert found["lines"] == sum("lines" in trace["mode"] for trace in scatters)
        assert found["fills"] == sum("fill" in trace for trace in scatters)
        assert (found["points"] > 0) == any("markers" in trace["mode"] for trace in scatters)
        assert (found["bars"] > 0) == any(trace["type"] == "bar" for trace in data)
    return plots


def test_every_kind_of_figure_is_drawn(tmp_path):
    rng = np.random.default_rng(1)
    n, m = 20_000, 200
    time_s, signal = np.arange(n) / 1000.0, rng.standard_normal(n)
    frequency = np.geomspace(1, 400, m)
    model = 1 / (1 + 0.1j * frequency)
    curve = figures.ResponseCurve(frequency, model, (np.full(m, -0.01), np.full(m, 0.01)),
                                  (np.full(m, -0.01), np.full(m, 0.01)))
    modelled = model[::10]
    points = SimpleNamespace(frequency_hz=frequency[::10], response=1.01 * modelled,
                             std_amplitude=np.full(20, 0.005), std_phase_rad=np.full(20, 0.01))
    page = Page("Every kind of figure")
    page.section("All").figure(figures.bode(curve, points, modelled)).figure(
        figures.response_deviation(curve, points, modelled)).figure(
        figures.response_interval(curve)).figure(
        figures.time_signals({"a": (time_s, signal), "b": (time_s, -signal)},
                             (time_s, 0.1 * signal))).figure(
        figures.spectra(frequency, {"a": frequency**-0.5}, level=0.05)).figure(
        figures.correlation(np.arange(50), rng.standard_normal(50) / 10, 0.2)).figure(
        figures.lines(frequency, {"a": frequency}, "x", "y", log="xy"))
    page.write(tmp_path / "page.html")
    dom, console = browser.open_page(tmp_path / "page.html")
    assert not console
    assert len(require_drawn(dom)) == 7
    # no button that would send the data anywhere
    assert set(re.findall(r'data-title="([^"]*)"', dom)) <= BUTTONS


def test_report_of_an_identification_is_drawn(tmp_path):
    bag = browser.ROOT / "bags" / "classical_bench.mcap"
    page = tmp_path / "r.html"
    assert main(["identify", str(bag), "--structure", "oscillator", "-o",
                 str(tmp_path / "m.yaml"), "--report", str(page)]) == 0
    dom, console = browser.open_page(page)
    assert not console
    assert len(require_drawn(dom)) >= 5


def test_report_of_a_diagnosis_is_drawn(tmp_path):
    bag = browser.ROOT / "bags" / "soft_mount.mcap"
    page = tmp_path / "r.html"
    assert main(["diagnose", str(bag), "--model", str(bag.with_suffix(".yaml")), "--report",
                 str(page)]) == 0
    dom, console = browser.open_page(page)
    assert not console
    assert len(require_drawn(dom)) == 5


def test_report_of_the_paper_is_drawn(tmp_path):
    quick = reproduce(study=False)
    study = sample_study(browser.ROOT / "bags")
    page = tmp_path / "r.html"
    paper_page(PaperResult(quick.tables, quick.figures, quick.claims, study)).write(page)
    dom, console = browser.open_page(page)
    assert not console
    assert len(require_drawn(dom)) == 14


def test_a_broken_page_is_noticed(tmp_path):
    """What the tests above rely on: errors and refused loads reach the console."""
    page = Page("Title")
    page.section("Part").figure(figures.lines(np.arange(3.0), {"a": np.arange(3.0)}, "x", "y"))
    text = page.html().replace("Plotly.newPlot", "Plotly.noSuchFunction")
    path = tmp_path / "broken.html"
    path.write_text(text.replace("<main>", '<main><img src="http://127.0.0.1:9/x.png">'))
    dom, console = browser.open_page(path)
    assert any("noSuchFunction" in line for line in console)
    assert any("Content Security Policy" in line for line in console)
    with pytest.raises(AssertionError):
        require_drawn(dom)
