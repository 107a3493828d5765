"""`diagnose --report` tells what `diagnose` found, for every verdict, and invents nothing."""

import dataclasses
import html
import json
import re
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
from rig.hidden import draw_case
from test_report_identification import traces, values

from frac_accel import read_bag
from frac_accel.cli import main
from frac_accel.commands._common import write_json
from frac_accel.diagnosis import Diagnosis, diagnose
from frac_accel.diagnosis.experiments import separating_experiment
from frac_accel.io.bag import RAW_TOPIC
from frac_accel.model.effects import known_effects
from frac_accel.report.diagnosis import diagnosis_page
from frac_accel.report.quantity import written

pytestmark = pytest.mark.long

BAG = Path(__file__).resolve().parents[2] / "bags" / "soft_mount.mcap"
MODEL = BAG.with_suffix(".yaml")


def words(page):
    """Text of a page without its figures' data."""
    page = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", page)))


def again(found):
    """The same diagnosis, written to a result file and read."""
    folder = tempfile.mkdtemp()
    path = Path(folder) / "r.json"
    write_json(path, found.as_dict())
    read = Diagnosis.from_dict(json.loads(path.read_text()))
    shutil.rmtree(folder)
    return read


@pytest.fixture(scope="module")
def explained(tmp_path_factory):
    """Page and result file of the bag with two hidden effects."""
    folder = tmp_path_factory.mktemp("explained")
    assert main(["diagnose", str(BAG), "--model", str(MODEL), "--report", str(folder / "r.html"),
                 "--json", str(folder / "r.json")]) == 0
    # the page again from the result file, without the bag
    assert main(["report", str(folder / "r.json"), "-o", str(folder / "again.html")]) == 0
    assert (folder / "again.html").read_bytes() == (folder / "r.html").read_bytes()
    assert (folder / "r.json").stat().st_size < 300_000
    return (folder / "r.html").read_text(), json.loads((folder / "r.json").read_text())


def test_page_tells_what_was_found(explained):
    page, said = explained
    text = words(page)
    assert {finding["cause"] for finding in said["findings"]} == {"cubic_stiffness", "time_delay"}
    first, = re.findall(r"<h2[^>]*>(.*?)</h2>", page)[:1]
    assert first == "Verdict"
    for finding in said["findings"]:
        cause, gain = finding["cause"], finding["gain"]
        for name, entry in finding["parameters"].items():
            assert written(entry["value"], entry["std"], entry["unit"]) in text
            assert re.search(rf"{cause} {name} [\d.e-]+ [\d.e-]+ ", text)
        assert f"{gain['reduction']:.2%}" in text
        assert f"{gain['ci95'][0]:.2%} to {gain['ci95'][1]:.2%}" in text
        assert finding["explanation"] in text and known_effects()[cause].experiment in text
    for part in (said["reason"], f"{said['baseline']['rmse']:.4g}",
                 f"{said['extended']['rmse']:.4g}", "cubic_stiffness + time_delay", "chosen",
                 "(the model in use)", BAG.name, f"--model {MODEL}",
                 "does not differ from noise", "5500 samples at 1000 Hz"):
        assert part in text, part


def test_figures_show_both_models_against_the_true_noise(explained):
    """The noise that the bag was made with, by its own covariance."""
    page, said = explained
    noise = float(np.sqrt(read_bag(BAG)[RAW_TOPIC].variance[0, 0]))
    lines = {}
    for trace in traces(page):
        lines.setdefault(trace["name"], []).append(values(trace["y"]))
    before, after = lines["residual of the model in use"], lines["residual of the extended model"]
    assert len(before) == len(after) == 2  # whole and close up
    # a close-up is not thinned
    assert np.sqrt(np.nanmean(after[1]**2)) == pytest.approx(noise, rel=0.2)
    assert np.sqrt(np.nanmean(before[1]**2)) > 0.5 * said["baseline"]["rmse"]
    # output in two figures, then RMS by amplitude and by time, with one more noise in each
    for name, level in (("model in use", said["baseline"]["rmse"]), ("extended model", noise)):
        assert len(lines[name]) == 4
        for rms in lines[name][2:]:
            assert np.median(rms) == pytest.approx(level, rel=0.25)
    density, = lines["residual, extended model"]
    assert np.median(density) == pytest.approx(noise * np.sqrt(2 / 1000.0), rel=0.15)


@pytest.mark.parametrize("verdict, seed, causes, present, absent", [
    ("consistent", 19, (), ["does not differ from noise", "Model in use"],
     ["Extended model", "extended model", "Suspected"]),
    ("undecided", 7, ("gain_modulation",),
     ["comes and goes with the motion", "repeat the same motion"],
     ["Extended model", "does not differ from noise"]),
    ("unexplained", 7, ("duffing_mount",),
     ["no known cause", "a fitted filter, which describes a part of it"],
     ["does not differ from noise"]),
    ("partly_explained", 4, ("clipping",),
     ["clipping lower", "clipping upper", "stays unexplained", "experiment that tells",
      "Suspected, not named: offset or time_delay: too weak to tell.",
      "For offset: Record at rest"], []),
])
def test_page_of_other_verdicts(verdict, seed, causes, present, absent):
    case = draw_case(seed, causes)
    reference, sensor, temperature = case.samples()
    found = diagnose((reference, sensor), case.model(), "x", temperature)
    if verdict == "partly_explained":
        found = doubtful(found)
    assert found.verdict == verdict
    source = {"bag": "case", "date": "2020-02-02"}
    page = diagnosis_page(found, source).html()
    assert diagnosis_page(again(found), source).html() == page
    text = words(page)
    for part in present:
        assert part in text, part
    for part in absent:
        assert part not in text, part
    assert not re.search(r"\b(nan|None|inf)\b", text)


def doubtful(found):
    """A diagnosis that is less sure, as a smaller effect would have left it."""
    suspects = [{"causes": ["offset", "time_delay"], "margin": 3.2, "reason": "too weak to tell",
                 "experiment": separating_experiment(["time_delay", "offset"])}]
    return dataclasses.replace(found, verdict="partly_explained", suspects=suspects,
                               reason="the named causes leave a part unexplained",
                               unexplained_fraction=0.2)


def test_page_of_too_little_data():
    reference, sensor, _ = draw_case(19).samples()
    short = [samples._replace(stamps_ns=samples.stamps_ns[:400], values=samples.values[:400],
                              variance=samples.variance[:400]) for samples in (reference, sensor)]
    found = diagnose(tuple(short), None)
    assert found.verdict == "insufficient_data"
    source = {"date": "2020-02-02"}
    page = diagnosis_page(found, source).html()
    assert diagnosis_page(again(found), source).html() == page
    text = words(page)
    assert "Insufficient data" in text and "400 samples" in text and "Nothing was fitted" in text
    assert not re.search(r"\b(nan|None)\b", text)


def test_page_of_a_model_that_was_identified_first():
    case = draw_case(24)
    reference, sensor, temperature = case.samples()
    found = diagnose((reference, sensor), None, "x", temperature)
    source = {"date": "2020-02-02"}
    page = diagnosis_page(found, source).html()
    assert diagnosis_page(again(found), source).html() == page
    text = words(page)
    assert "In every set: core_parameter_shift" in text


@pytest.mark.parametrize("cause", known_effects())
def test_every_cause_names_an_experiment(cause):
    sentence = known_effects()[cause].experiment
    assert sentence.endswith(".") and sentence[0].isupper()
    assert separating_experiment([cause]) == sentence
    other = "offset" if cause != "offset" else "time_delay"
    both = separating_experiment([other, cause])
    assert f"For {cause}: {sentence}" in both and f"For {other}: " in both


@pytest.mark.parametrize("content, words", [
    ("", "not valid JSON"), ("[1", "not valid JSON"), ("[]", "no result of a diagnosis"),
    ('{"verdict": "explained"}', "no result of a diagnosis"),
    ('{"verdict": "explained", "evidence": {"axis": "x"}, "data": {}}', "no complete result"),
])
def test_what_is_no_result_is_refused_in_one_line(tmp_path, capsys, content, words):
    path = tmp_path / "r.json"
    path.write_text(content)
    assert main(["report", str(path), "-o", str(tmp_path / "r.html")]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert str(path) in line and words in line
    assert not (tmp_path / "r.html").exists()


def test_a_result_with_a_cause_that_is_not_installed_names_it(explained, tmp_path, capsys):
    path = tmp_path / "r.json"
    text = json.dumps(explained[1]).replace("cubic_stiffness", "stiffness_of_another")
    path.write_text(text)
    assert main(["report", str(path), "-o", str(tmp_path / "r.html")]) == 2
    assert "stiffness_of_another" in capsys.readouterr().err
