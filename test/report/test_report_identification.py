"""`identify --report` tells what `identify` found, and refuses early what it could not write."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest

from frac_accel import SensorModel, identify
from frac_accel.cli import main
from frac_accel.commands._common import write_json
from frac_accel.errors import ModelError
from frac_accel.identification import Identification
from frac_accel.record import Record
from frac_accel.report.identification import identification_page
from frac_accel.report.quantity import fixed, percent, rounded, scaled, short, written
from frac_accel.uncertainty import response_uncertainty

BAG = Path(__file__).resolve().parents[2] / "bags" / "viscoelastic_bench.mcap"


def traces(text):
    """All traces of a page."""
    for content in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text):
        yield from json.loads(content)["data"]


def values(entry):
    """Numbers of a trace, which plotly 6 and newer writes in base64."""
    if isinstance(entry, dict):
        return np.frombuffer(base64.b64decode(entry["bdata"]), entry["dtype"])
    return np.array(entry, float)


@pytest.mark.parametrize("structure", ["fractional", "arx"])
def test_page_tells_what_was_found(tmp_path, structure):
    files = {name: str(tmp_path / name) for name in ("m.yaml", "r.html", "r.json")}
    assert main(["identify", str(BAG), "--axis", "y", "--structure", structure, "-o",
                 files["m.yaml"], "--report", files["r.html"], "--json", files["r.json"]]) == 0
    # the page again from the result file, without the bag
    assert main(["report", files["r.json"], "-o", str(tmp_path / "again.html")]) == 0
    assert (tmp_path / "again.html").read_bytes() == Path(files["r.html"]).read_bytes()
    assert Path(files["r.json"]).stat().st_size < 700_000
    found = json.loads(Path(files["r.json"]).read_text())
    text = Path(files["r.html"]).read_text()
    for name, entry in found["parameters"].items():
        factor, unit = scaled(entry["value"], entry["unit"])
        value, std = rounded(factor * entry["value"], factor * entry["std"])
        assert re.search(rf"<td[^>]*>{name}</td><td[^>]*>{re.escape(value)}</td>"
                         rf"<td[^>]*>{re.escape(std or '–')}</td>.*<td[^>]*>{unit or 1}</td>", text)
    assert found["reason"] in text
    tests, excited = found["validation"]["residual"], found["excitation"]
    assert f"{tests['independence_statistic']:.1f}" in text
    assert f"{excited['crest_factor']:.3g}" in text and f"{excited['loudest_rms']:.4g}" in text
    assert all(f"{band['nrmse']:.2%}" in text for band in found["validation"]["held_out_bands"])
    known = response_uncertainty(SensorModel.load(files["m.yaml"]), [10.0, 200.0], "y")
    band = next(trace for trace in traces(text) if trace["name"] == "95 % interval")
    # the outline: along the upper limit, and back along the lower one
    (x, back), (high, low) = (np.split(values(band[axis]), 2) for axis in "xy")
    shown = np.stack([np.interp([10.0, 200.0], back[::-1], low[::-1]),
                      np.interp([10.0, 200.0], x, high)], axis=1)
    np.testing.assert_allclose(shown, known.amplitude_interval, rtol=1e-3)
    for part in (found["model"]["provenance"]["sha256"], BAG.name, "--axis y",
                 f"{found['nrmse']:.3%}", f"{found['held_out_nrmse']:.3%}"):
        assert part in text


@pytest.mark.parametrize("report, expected", [
    ("nowhere/r.html", "does not exist"), ("bag.mcap", "is the input")])
def test_report_that_cannot_be_written_is_refused_before_the_work(tmp_path, capsys, report,
                                                                  expected):
    (tmp_path / "bag.mcap").write_bytes(BAG.read_bytes())
    assert main(["identify", str(tmp_path / "bag.mcap"), "-o", str(tmp_path / "m.yaml"),
                 "--report", str(tmp_path / report)]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert expected in line
    assert not (tmp_path / "m.yaml").exists()


@pytest.mark.parametrize("value, std, expected", [
    (180.0032658, 0.00941, ("180.0033", "0.0094")),
    (1234567.0, 4321.0, ("1234600", "4300")),
    (1.5, 0.0996, ("1.50", "0.10")),
    (0.00060005847, 2.4e-7, ("6.0006e-04", "0.0024e-04")),
    (0.0, 0.0, ("0", "")), (3.25, float("nan"), ("3.25", "")), (-2.5, 12.0, ("-2", "12"))])
def test_values_end_where_their_uncertainty_begins(value, std, expected):
    assert rounded(value, std) == expected


@pytest.mark.parametrize("value, std, unit, expected", [
    (0.00129994, 1.1e-7, "s", "1.29994 ms ± 0.11 µs"),
    (0.000600059, 2.4e-7, "s", "600.06 ± 0.24 µs"),
    (180.003265, 0.0094, "Hz", "180.0033 Hz ± 9.4 mHz"),
    (0.9999999999, 1e-4, "s", "1.00000 s ± 0.10 ms"), (1500.0, 2.0, "Hz", "1.5000 kHz ± 2.0 Hz"),
    (-0.0021, 0.00005, "s", "-2.100 ms ± 50 µs"), (1e-5, 0.002, "s", "0.0 ± 2.0 ms"),
    (1.02, 0.003, "1", "1.0200 ± 0.0030"), (0.02, 0.0, "s", "20 ms"), (0.0, 0.0, "s", "0 s"),
    (3.25, float("nan"), "s", "3.25 s"), ("bessel", 0.0, "", "bessel"),
    (0.02, 0.003, "1/m^2", "0.0200 ± 0.0030 1/m²")])
def test_values_are_written_with_prefixes(value, std, unit, expected):
    assert written(value, std, unit) == expected


def test_percent():
    assert [percent(share) for share in (0.000213, 0.05, 1.094)] == ["0.021 %", "5 %", "109 %"]


def test_page_without_interval_says_why(tmp_path, monkeypatch):
    """What `response_uncertainty` raises where hardly a draw of the parameters is a sensor."""
    def refuse(*_):
        raise ModelError("covariance: the data have not determined the parameters")

    monkeypatch.setattr("frac_accel.report.identification.response_uncertainty", refuse)
    pair = Record.load(BAG, axis="y")
    result = identify(pair, axis="y", structure="oscillator")
    identification_page(result, {}).write(tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text()
    assert "without an interval: covariance: the data have not determined" in text


def test_several_records_and_what_is_none_come_back(tmp_path):
    """A result of two records has their agreement; a gain has no comparison of domains."""
    pair = Record.load(BAG, axis="y")
    for number, result in enumerate((identify([pair, pair], axis="y"),
                                     identify(pair, axis="y", structure="gain"))):
        path = tmp_path / f"{number}.json"
        write_json(path, result.as_dict())
        again = Identification.from_dict(json.loads(path.read_text()))
        assert same(again.as_dict(), result.as_dict())
        assert repr(again) == repr(result) and again.validation.verdict == result.validation.verdict
        pages = [tmp_path / f"{number}_{name}.html" for name in ("first", "again")]
        for found, page in zip((result, again), pages):
            identification_page(found, {"date": "today"}).write(page)
        assert pages[0].read_bytes() == pages[1].read_bytes()


def same(one, other):
    """Whether nested results are equal; null is NaN."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other or all(value is None or value != value for value in (one, other))


@pytest.mark.parametrize("damage", ["evidence", "points", "validation", "parameters",
                                    "excitation", "nrmse", "frequency_domain"])
def test_damaged_result_is_refused_in_one_line(tmp_path, capsys, result_file, damage):
    data = json.loads(result_file)
    data[damage] = {"nothing": "of it"}
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    assert main(["report", str(path), "-o", str(tmp_path / "r.html")]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert str(path) in line and "result" in line
    assert not (tmp_path / "r.html").exists()


@pytest.fixture(scope="module")
def result_file(tmp_path_factory):
    """Text of a result file."""
    path = tmp_path_factory.mktemp("result") / "r.json"
    write_json(path, identify(Record.load(BAG, axis="y"), "y", "oscillator").as_dict())
    return path.read_text()


@pytest.mark.parametrize("value, words", [
    (0.0006001, "600.1 µs"), (0.018, "18 ms"), (-2.666e-6, "-2.666 µs"), (0.0, "0 s")])
def test_delays_have_prefixes(value, words):
    assert short(value, "s") == words


@pytest.mark.parametrize("value, words", [
    (-0.0004, "0.000"), (-0.0006, "-0.001"), (12.3456, "12.346"), (float("nan"), "-")])
def test_a_zero_has_no_sign(value, words):
    assert fixed(value) == words
