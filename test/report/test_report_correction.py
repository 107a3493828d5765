"""Pages of `validate` and `correct`: before and after, with the band that the samples state."""

import json
import re
from pathlib import Path

import browser
import numpy as np
import pytest

from frac_accel import Samples, SensorModel, read_bag, write_bag
from frac_accel.cli import main
from frac_accel.io.bag import CORRECTED_TOPIC, RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.report import figures, panels
from frac_accel.report.page import Page

BAG = Path(__file__).resolve().parents[2] / "bags" / "viscoelastic_bench"


def plots(page):
    """Figures of a page, as dicts."""
    return [json.loads(content) for content in
            re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', page)]


def values(trace, letter):
    """Numbers of a trace, whichever way plotly has written them."""
    data = trace[letter]
    if isinstance(data, dict):
        import base64
        return np.frombuffer(base64.b64decode(data["bdata"]), data["dtype"])
    return np.array([np.nan if value is None else value for value in data], float)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Texts of the pages of `validate` and `correct`, and the corrected bag."""
    folder = tmp_path_factory.mktemp("reports")
    bag, model = f"{BAG}.mcap", f"{BAG}.yaml"
    assert main(["validate", bag, "--model", model, "--axis", "y",
                 "--report", str(folder / "v.html"), "--json", str(folder / "v.json")]) == 0
    assert main(["correct", bag, "--model", model, "-o", str(folder / "c.mcap"),
                 "--report", str(folder / "c.html")]) == 0
    return folder


def names(page):
    """Names of all traces."""
    return {trace["name"] for plot in plots(page) for trace in plot["data"]}


def close_up(page):
    """Traces of the second figure, by name."""
    return {trace["name"]: trace for trace in plots(page)[1]["data"]}


def test_validate_draws_the_stated_interval_about_the_corrected_samples(made):
    page, said = (made / "v.html").read_text(), json.loads((made / "v.json").read_text())
    assert f"{100 * said['corrected']['total']['nrmse']:.2g} % after correction" in page
    drawn = close_up(page)
    after, both = values(drawn["corrected"], "y"), values(drawn["± 2u"], "y")
    half = (both[:len(after)] - both[len(after):][::-1]) / 2
    corrected = read_bag(made / "c.mcap")[CORRECTED_TOPIC]
    # the messages of the corrected bag state the same
    place = np.searchsorted(corrected.values[:, 1], after[0], sorter=np.argsort(
        corrected.values[:, 1]))
    place = np.argsort(corrected.values[:, 1])[place]
    rows = slice(place, place + len(after))
    np.testing.assert_allclose(corrected.values[rows, 1], after, atol=1e-6)
    np.testing.assert_allclose(half, 2 * np.sqrt(corrected.variance[rows, 1]), rtol=0.02)
    inside = float(re.search(r"([\d.]+)% of them are within 2u", page)[1])
    assert 90 < inside < 99


def test_correct_shows_errors_where_the_bag_has_a_reference(made, tmp_path):
    page = (made / "c.html").read_text()
    assert all(f"Axis {axis} in frequency" in page for axis in "xyz")
    assert "error, corrected" in names(page) and "Response of raw and corrected" in page
    raw = read_bag(f"{BAG}.mcap")[RAW_TOPIC]
    write_bag(tmp_path / "b.mcap", {RAW_TOPIC: raw})
    assert main(["correct", str(tmp_path / "b.mcap"), "--model", f"{BAG}.yaml", "-o",
                 str(tmp_path / "c.mcap"), "--report", str(tmp_path / "c.html")]) == 0
    alone = (tmp_path / "c.html").read_text()
    assert "error, corrected" not in names(alone) and "± 2u" in names(alone)
    assert "Axis z in time" in alone


def test_without_a_covariance_there_is_no_interval_and_the_page_says_so(tmp_path):
    topics = read_bag(f"{BAG}.mcap")
    write_bag(tmp_path / "b.mcap", {name: Samples.of(*topics[name][:2])
                                    for name in (RAW_TOPIC, REFERENCE_TOPIC)})
    model = SensorModel.load(f"{BAG}.yaml").to_dict()
    model.pop("noise_std", None)
    SensorModel.from_dict(model).save(tmp_path / "m.yaml")
    assert main(["validate", str(tmp_path / "b.mcap"), "--model", str(tmp_path / "m.yaml"),
                 "--report", str(tmp_path / "r.html")]) == 0
    page = (tmp_path / "r.html").read_text()
    assert "do not say how uncertain they are" in page
    assert "± 2u" not in close_up(page)


@pytest.mark.parametrize("name", ["v.html", "c.html"])
def test_a_browser_draws_them_without_complaint(name, made):
    dom, console = browser.open_page(made / name)
    assert not console
    assert dom.count('class="main-svg"') >= 2 * len(plots((made / name).read_text()))


def test_long_signals_are_drawn_by_their_ends():
    """Each column of pixels has its smallest and largest value, and gaps stay gaps."""
    rng = np.random.default_rng(5)
    signal = rng.standard_normal(100_000)
    signal[60_000:62_000] = np.nan
    x, low, high = panels.ends(np.arange(100_000.0), signal)
    assert len(x) <= 400 and np.nanmin(low) == np.nanmin(signal)
    size = int(x[1] - x[0])
    for i in rng.integers(0, len(x) - 1, 50):
        part = signal[int(x[i]):int(x[i]) + size]
        if not np.isnan(part).all():
            assert (low[i], high[i]) == (np.nanmin(part), np.nanmax(part))
    assert np.isnan(low).any() and np.isnan(low).mean() < 0.03


@pytest.mark.parametrize("low, high, dtick", [
    (0.1, 1.0, "D2"), (0.02, 20.0, "D2"), (2e-4, 1.0, 1), (1e-7, 1.0, 1), (2.5, 4.0, None)])
def test_logarithmic_axes_label_whole_numbers(low, high, dtick):
    """With this format the labels of 2 and 5 are 0.2 and 0.5, not lone small digits.

    Without it those of many decades are powers: 0.000001 stood beside 1e-7.
    """
    frequency = np.geomspace(1.0, 100.0, 50)
    figure = figures.spectra(frequency, {"a": np.geomspace(low, high, 50)})
    assert (figure.layout.yaxis.dtick, figure.layout.yaxis.tickformat) == (
        dtick, "" if low < 1e-4 else "~g")
    assert figure.layout.xaxis.dtick == "D2"


def labels(path):
    """Labels that a browser writes beside the y axes of a page."""
    dom, console = browser.open_page(path)
    assert not console
    return re.findall(r'class="ytick"><text[^>]*>([^<]*)</text>', dom)


def test_a_browser_writes_those_labels(tmp_path):
    page = Page("Labels")
    for low, high in ((0.1, 1.0), (2.5, 4.0)):
        page.section("One").figure(figures.spectra(
            np.geomspace(1.0, 100.0, 50), {"a": np.geomspace(low, high, 50)}))
    page.write(tmp_path / "p.html")
    found = labels(tmp_path / "p.html")
    assert {"0.1", "0.2", "0.5", "1"} <= set(found)
    assert sum(2.4 < float(label) < 4.2 for label in found) >= 3


def test_what_is_zoomed_into_has_labels(tmp_path):
    """Where no 1, 2 or 5 is in the range that somebody has chosen."""
    page = Page("Labels")
    page.section("One").figure(figures.spectra(
        np.geomspace(1.0, 100.0, 50), {"a": np.geomspace(0.1, 1.0, 50)}))
    zoom = ("<script>setTimeout(() => Plotly.relayout('figure-1', "
            "{'yaxis.range': [Math.log10(0.22), Math.log10(0.45)]}), 2000)</script></body>")
    (tmp_path / "p.html").write_text(page.html().replace("</body>", zoom))
    found = labels(tmp_path / "p.html")
    assert len(found) >= 3 and all(0.2 < float(label) < 0.5 for label in found)


def test_titles_of_axes_are_broken_where_a_phone_ends():
    figure = figures.lines(np.arange(9.0), {"a": np.ones(9)},
                           "output's distance from its mean [output units]",
                           "residual's RMS [output units]")
    for axis, width in ((figure.layout.xaxis, 34), (figure.layout.yaxis, 24)):
        lines = axis.title.text.split("<br>")
        assert len(lines) == 2 and max(map(len, lines)) <= width
