"""`frac_accel diagnose`: the result file has its fixed form for every verdict, the extended model
can be used, and what no diagnosis can be made of is refused in one line."""

import json
import math

import numpy as np
import pytest
from rig.hidden import draw_case

from frac_accel import SensorModel, read_bag, write_bag
from frac_accel.cli import main
from frac_accel.io import bag
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC

# Seeds of short cases, and the verdict that their hidden causes call for.
CASES = {"consistent": (19, ()), "explained": (24, ("mounting_resonance",)),
         "unexplained": (4, ("duffing_mount",)),
         "undecided": (7, ("gain_modulation",)),
         "partly_explained": (4, ("clipping", "gain_modulation"))}
ERRORS = {"rmse", "nrmse"}
KEYS = {"verdict": str, "baseline": dict, "findings": list, "extended": dict,
        "unexplained_fraction": float}
# What the result file has beyond the fixed form.
FURTHER = {"reason": str, "suspects": list, "integrity": list, "established_noise": dict,
           "budget": list, "data": dict, "sensor_model": dict, "evidence": dict,
           "provenance": dict}
FINDING = {"cause", "parameters", "confidence", "confusable_with", "evidence", "explanation",
           "gain"}
GAIN = {"held_out_rmse_before", "held_out_rmse_after", "reduction", "ci95"}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Bag and model in use of a case, by verdict."""
    folder, made = tmp_path_factory.mktemp("cases"), {}

    def get(verdict):
        if verdict not in made:
            case = draw_case(CASES[verdict][0], CASES[verdict][1])
            paths = folder / f"{verdict}.mcap", folder / f"{verdict}.yaml"
            case.write(paths[0])
            case.model().save(paths[1])
            made[verdict] = (*map(str, paths), case)
        return made[verdict]
    return get


def changed(files, tmp_path, verdict="explained", reference=None, sensor=None):
    """Bag like a case's, with its samples of either topic replaced by a function of them."""
    source, model, _ = files(verdict)
    topics = read_bag(source, [REFERENCE_TOPIC, RAW_TOPIC])
    for topic, change in ((REFERENCE_TOPIC, reference), (RAW_TOPIC, sensor)):
        if change:
            topics[topic] = change(topics[topic])
    path = tmp_path / "changed.mcap"
    write_bag(path, topics)
    return str(path), model


def diagnose(tmp_path, source, model, *options):
    """The result file; the exit status must be 0."""
    result = tmp_path / "r.json"
    assert main(["diagnose", source, "--model", model, "--json", str(result), *options]) == 0
    return json.loads(result.read_text())


def require_form(said):
    """The form that the result file is to have, whatever the verdict."""
    assert set(said) == {*KEYS, *FURTHER, "cut_off"}
    assert set(said["established_noise"]) == {"rms", "by"}
    nothing = said["verdict"] == "insufficient_data"
    for key, kind in {**KEYS, **FURTHER}.items():
        assert isinstance(said[key], kind) or (nothing and said[key] is None)
    assert set(said["baseline"]) == {*ERRORS, "noise_rms"}
    assert set(said["extended"]) == {*ERRORS, "model"}
    for finding in said["findings"]:
        assert set(finding) == FINDING
        assert set(finding["gain"]) == GAIN
        assert len(finding["gain"]["ci95"]) == 2
        assert 0 <= finding["confidence"] <= 1
        for entry in finding["parameters"].values():
            assert set(entry) == {"value", "std", "unit"}
            assert math.isfinite(entry["value"]) and entry["std"] >= 0
    for suspect in said["suspects"]:
        assert set(suspect) == {"causes", "margin", "reason", "experiment"}
        assert suspect["experiment"].endswith(".")


@pytest.mark.parametrize("verdict", CASES)
def test_result_file_has_its_form(files, tmp_path, verdict, capsys):
    source, model, case = files(verdict)
    page = tmp_path / "r.html"
    said = diagnose(tmp_path, source, model, "--report", str(page))
    require_form(said)
    assert said["verdict"] == verdict
    assert f"{said['reason']}." in page.read_text()
    assert {finding["cause"] for finding in said["findings"]} \
        == case.causes - {"gain_modulation", "duffing_mount"}
    assert verdict in capsys.readouterr().out
    # the noise is what was drawn, wherever the diagnosis claims to have got down to it
    if verdict in ("consistent", "explained"):
        assert said["baseline"]["noise_rms"] == pytest.approx(case.noise_std, rel=0.1)
        assert said["unexplained_fraction"] == 0
    elif verdict != "undecided":
        assert said["unexplained_fraction"] > 0.03


def test_too_short_a_record_is_insufficient(files, tmp_path, capsys):
    def short(samples):
        return cut(samples, slice(0, 400))
    source, model = changed(files, tmp_path, reference=short, sensor=short)
    said = diagnose(tmp_path, source, model)
    require_form(said)
    assert said["verdict"] == "insufficient_data" and said["baseline"]["rmse"] is None
    assert "400 samples" in capsys.readouterr().out


@pytest.mark.thorough
def test_extended_model_simulates_the_record(files, tmp_path):
    source, model, case = files("explained")
    extended, simulated = str(tmp_path / "e.yaml"), str(tmp_path / "s.mcap")
    said = diagnose(tmp_path, source, model, "--extended-model", extended)
    assert said["extended"]["model"] == extended
    assert main(["validate", source, "--model", extended, "--json", str(tmp_path / "v.json")]) == 0
    judged = json.loads((tmp_path / "v.json").read_text())
    assert said["extended"]["validated_nrmse"] == pytest.approx(judged["whole_nrmse"], rel=1e-9)
    effect, = SensorModel.load(extended).axis("x").effects
    found = said["findings"][0]["parameters"]
    assert effect.frequency_hz == found["frequency_hz"]["value"]
    assert main(["simulate", source, "--model", extended, "-o", simulated]) == 0
    error = read_bag(simulated)[RAW_TOPIC].values[:, 0] - read_bag(source)[RAW_TOPIC].values[:, 0]
    inside = error[len(error) // 4:-64]
    assert np.sqrt(np.mean(inside**2)) == pytest.approx(case.noise_std, rel=0.1)


@pytest.mark.parametrize("what, expected", [
    ("unrelated", "do not belong together"), ("topic", "/nothing"), ("model", "natural_frequency"),
    ("file", "no such file"), ("temperature", "/imu/reference"), ("output", "is the input"),
    ("folder", "does not exist")])
def test_refusals(files, tmp_path, capsys, what, expected):
    source, model, _ = files("explained")
    options = []
    if what == "unrelated":
        noise = np.random.default_rng(1).standard_normal

        def other(samples):
            return samples._replace(values=noise(samples.values.shape))
        source, model = changed(files, tmp_path, sensor=other)
    elif what == "model":
        model = str(tmp_path / "bad.yaml")
        (tmp_path / "bad.yaml").write_text(
            "schema: frac_accel/sensor_model/1\ncore: {natural_frequency_hz: -3}\n")
    else:
        options = {"topic": ["--sensor", "/nothing"], "file": ["--model", "nowhere.yaml"],
                   "temperature": ["--temperature", REFERENCE_TOPIC],
                   "output": ["--extended-model", model],
                   "folder": ["--report", str(tmp_path / "nowhere" / "r.html")]}[what]
    capsys.readouterr()
    assert main(["diagnose", source, "--model", model, *options]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert expected.lower() in line.lower()


@pytest.mark.thorough
def test_without_temperature_it_says_what_cannot_be_found(files, tmp_path, capsys):
    source, model = changed(files, tmp_path)
    said = diagnose(tmp_path, source, model, "--temperature", "/cabin")
    captured = capsys.readouterr()
    assert said["verdict"] == "explained"
    assert "no topic /cabin" in captured.err
    assert "no temperature was recorded" in captured.out


def test_temperature_that_is_no_number(files, tmp_path, capsys):
    source, model, _ = files("explained")
    topics = read_bag(source, [REFERENCE_TOPIC, RAW_TOPIC])
    stamps = topics[RAW_TOPIC].stamps_ns[::100]
    path, nothing = str(tmp_path / "nan.mcap"), np.full(len(stamps), np.nan)
    topics[TEMPERATURE_TOPIC] = bag.Temperatures(stamps, nothing, nothing, "accel_link")
    write_bag(path, topics)
    assert main(["diagnose", path, "--model", model]) == 2
    assert f"none of {len(stamps)} values is finite" in capsys.readouterr().err


@pytest.mark.thorough
def test_temperature_of_part_of_the_record(files, tmp_path):
    """Held at its ends, as slowly as temperatures change."""
    source, model, case = files("explained")
    topics = read_bag(source, [REFERENCE_TOPIC, RAW_TOPIC])
    stamps = topics[RAW_TOPIC].stamps_ns[2000:6000:100]
    topics[TEMPERATURE_TOPIC] = bag.Temperatures(stamps, np.linspace(20, 30, len(stamps)),
                                                 np.full(len(stamps), np.nan), "accel_link")
    write_bag(tmp_path / "part.mcap", topics)
    said = diagnose(tmp_path, str(tmp_path / "part.mcap"), model)
    assert [finding["cause"] for finding in said["findings"]] == ["mounting_resonance"]


def cut(samples, rows):
    return samples._replace(stamps_ns=samples.stamps_ns[rows], values=samples.values[rows],
                            variance=samples.variance[rows])


def holed(samples):
    values = samples.values.copy()
    values[3000:3300] = np.nan
    return samples._replace(values=values)


@pytest.mark.thorough
def test_values_that_are_not_finite_are_left_out(files, tmp_path):
    said = diagnose(tmp_path, *changed(files, tmp_path, sensor=holed))
    assert any("300 samples with values that are not finite" in words
               for words in said["integrity"])
    # a value that is no number is no message that was lost
    assert [finding["cause"] for finding in said["findings"]] == ["mounting_resonance"]


def test_reference_that_ends_half_way(files, tmp_path):
    source, model = changed(files, tmp_path, reference=lambda samples: cut(
        samples, slice(0, len(samples.stamps_ns) // 2)))
    said = diagnose(tmp_path, source, model)
    assert [finding["cause"] for finding in said["findings"]] == ["mounting_resonance"]


@pytest.mark.parametrize("lost", [(0.4, 0.8), (0.004, 0.9), (0.5, 0.998)])
def test_sensor_that_is_lost_for_a_long_time(files, tmp_path, lost):
    """It is judged by what is there, whether that is at one end or at both."""
    def part(samples):
        places = np.arange(len(samples.stamps_ns))
        return cut(samples, places[(places < lost[0] * len(places))
                                   | (places >= lost[1] * len(places))])
    said = diagnose(tmp_path, *changed(files, tmp_path, sensor=part))
    require_form(said)
    assert said["verdict"] == "explained"
    named = {finding["cause"] for finding in said["findings"]}
    assert named - {"dropped_samples"} == {"mounting_resonance"}


def test_stuck_values_are_no_cause(files, tmp_path):
    """What a sensor repeats while the reference moves does not count, and the result says so."""
    def stuck(samples):
        values = samples.values.copy()
        values[3000:3600] = values[3000]
        return samples._replace(values=values)
    said = diagnose(tmp_path, *changed(files, tmp_path, sensor=stuck))
    require_form(said)
    assert any("stands still" in words for words in said["integrity"])
    assert [finding["cause"] for finding in said["findings"]] == ["mounting_resonance"]


def test_unrelated_reference_is_refused_without_a_model_too(files, tmp_path, capsys):
    noise = np.random.default_rng(1).standard_normal
    source, _ = changed(files, tmp_path, reference=lambda samples: samples._replace(
        values=noise(samples.values.shape)))
    assert main(["diagnose", source]) == 2
    assert "nothing to do with the reference" in capsys.readouterr().err


def test_a_refusal_names_the_bag(tmp_path, capsys):
    from frac_accel import Samples
    stamps = 10**18 + np.arange(3000) * 10**6
    stamps[2000:] += 3600 * 10**9
    values = np.random.default_rng(0).normal(size=(3000, 3))
    bag = tmp_path / "jumps.mcap"
    write_bag(bag, {"/imu/reference": Samples.of(stamps, values),
                    "/imu/data_raw": Samples.of(stamps, values)})
    assert main(["diagnose", str(bag)]) == 2
    assert capsys.readouterr().err.startswith(f"frac_accel diagnose: {bag}: reference: ")


def test_an_extended_model_that_does_worse_is_not_written(files, tmp_path, monkeypatch, capsys):
    """Its claim is of held-out samples, beside free motions that no file has."""
    source, model, _ = files("explained")
    monkeypatch.setattr("frac_accel.validation.whole_nrmse", lambda *arguments: 26.9)
    extended, result = tmp_path / "e.yaml", tmp_path / "r.json"
    assert main(["diagnose", source, "--model", model, "--extended-model", str(extended),
                 "--json", str(result)]) == 0
    said = capsys.readouterr().out
    assert not extended.exists()
    assert "e.yaml: not written: validate finds that the extended model leaves 2690.000%" in said
    told = json.loads(result.read_text())["extended"]
    assert told["validated_nrmse"] == 26.9 and told["model"] is None
