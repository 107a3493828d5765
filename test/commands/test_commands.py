"""The commands: what they write, what they say, and how they refuse bad input."""

import json
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from frac_accel import SensorModel, read_bag, simulate, validate, write_bag
from frac_accel.cli import main
from frac_accel.errors import FracAccelError
from frac_accel.io.bag import CORRECTED_TOPIC, RAW_TOPIC, REFERENCE_TOPIC, BagWriter, Samples, cdr
from frac_accel.model.core import Arx
from frac_accel.streaming import Corrector

BAGS = Path(__file__).parents[2] / "bags"
CLASSICAL, FRACTIONAL = BAGS / "classical_bench", BAGS / "fractional_bench"


def bag(stem):
    return str(stem.with_suffix(".mcap"))


def model(stem):
    return str(stem.with_suffix(".yaml"))


@pytest.fixture
def refuse(capsys):
    """Run a command that must exit with 2 and one line; returns the line."""
    def run(*arguments):
        assert main(list(map(str, arguments))) == 2
        captured = capsys.readouterr()
        line, = captured.err.strip().splitlines()
        assert "Traceback" not in line
        return line
    return run


def test_identify(tmp_path, capsys):
    out, result = tmp_path / "m.yaml", tmp_path / "r.json"
    assert main(["identify", bag(CLASSICAL), "-o", str(out), "--json", str(result)]) == 0
    found, true = SensorModel.load(out), SensorModel.load(model(CLASSICAL))
    said = json.loads(result.read_text())
    for name in ("natural_frequency_hz", "damping_ratio", "sensitivity"):
        entry = said["parameters"][name]
        assert entry["value"] == getattr(found.core, name)
        assert abs(entry["value"] - getattr(true.core, name)) < 4 * entry["std"]
    delay = said["parameters"]["delay_s"]
    assert abs(delay["value"] - true.axis("x").delay_s) < 4 * delay["std"]
    assert said["held_out_nrmse"] < 0.011
    assert len(found.metadata["provenance"]["sha256"]) == 64
    assert found.metadata["provenance"]["bag"] == "classical_bench.mcap"
    assert f"{found.core.natural_frequency_hz:.6g}" in capsys.readouterr().out


def test_correct_is_the_kernel(tmp_path):
    out, result = tmp_path / "c.mcap", tmp_path / "r.json"
    assert main(["correct", bag(FRACTIONAL), "--model", model(FRACTIONAL), "-o", str(out),
                 "--json", str(result)]) == 0
    topics, measured = read_bag(out), read_bag(bag(FRACTIONAL))
    assert set(topics) == {REFERENCE_TOPIC, RAW_TOPIC, CORRECTED_TOPIC}
    for name in (REFERENCE_TOPIC, RAW_TOPIC):
        np.testing.assert_array_equal(topics[name].values, measured[name].values)
    corrector = Corrector(SensorModel.load(model(FRACTIONAL)))
    raw, corrected = measured[RAW_TOPIC], topics[CORRECTED_TOPIC]
    expected = corrector.process(raw.stamps_ns, raw.values, raw.variance)
    np.testing.assert_array_equal(corrected.values, expected.values)
    np.testing.assert_array_equal(corrected.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(corrected.variance, expected.variance)
    assert json.loads(result.read_text())["counters"] == corrector.counters


@pytest.mark.parametrize("seed", range(3))
def test_samples_that_a_recorder_has_mixed_are_corrected_in_the_order_of_their_stamps(
        seed, tmp_path, capsys):
    rng = np.random.default_rng(seed)
    raw = read_bag(bag(CLASSICAL))[RAW_TOPIC]
    logs = raw.stamps_ns + np.round(rng.uniform(0, 5e6, len(raw.stamps_ns))).astype(np.int64)
    with BagWriter(tmp_path / "mixed.mcap") as writer:
        writer.add_topic(RAW_TOPIC, cdr.IMU)
        writer.write_many(RAW_TOPIC, sorted(zip(
            cdr.encode_samples(cdr.IMU, raw), logs.tolist(), logs.tolist()),
            key=lambda entry: entry[1]))
    assert main(["correct", str(tmp_path / "mixed.mcap"), "--model", model(CLASSICAL), "-o",
                 str(tmp_path / "c.mcap")]) == 0
    corrected = read_bag(tmp_path / "c.mcap")[CORRECTED_TOPIC]
    expected = Corrector(SensorModel.load(model(CLASSICAL))).process(
        raw.stamps_ns, raw.values, raw.variance)
    np.testing.assert_array_equal(corrected.values, expected.values)
    np.testing.assert_array_equal(corrected.stamps_ns, expected.stamps_ns)
    assert "came after a later one: all are put in the order" in capsys.readouterr().out


def test_validate(tmp_path, capsys):
    result = tmp_path / "r.json"
    for axis in "xyz":
        assert main(["validate", bag(FRACTIONAL), "--model", model(FRACTIONAL), "--axis", axis,
                     "--json", str(result)]) == 0
        said = json.loads(result.read_text())
        assert said["corrected"]["total"]["nrmse"] < 0.01
        assert said["scaled"]["total"]["nrmse"] > 10 * said["corrected"]["total"]["nrmse"]
        assert said["simulation"]["total"]["nrmse"] < 0.01
        assert len(said["corrected"]["bands"]) > 2
    assert "corrected against reference, axis z" in capsys.readouterr().out


@pytest.fixture
def without_inverse(tmp_path):
    """Bag and model of a sensor with a zero next to 0 Hz, as identified in z: nothing inverts it
    down to 0 Hz."""
    found = SensorModel(Arx((-0.999, 1.0), (1.0, -0.5), 200.0))
    motion = np.random.default_rng(1).normal(size=(4000, 3))
    stamps = np.arange(len(motion)) * 5_000_000
    write_bag(tmp_path / "b.mcap", {REFERENCE_TOPIC: Samples.of(stamps, motion), RAW_TOPIC:
                                    Samples.of(stamps, simulate(found, motion, 200.0))})
    found.save(tmp_path / "m.yaml")
    return [str(tmp_path / "b.mcap"), "--model", str(tmp_path / "m.yaml")]


def test_a_model_without_a_correction_is_validated(without_inverse, tmp_path, capsys):
    result, page = tmp_path / "r.json", tmp_path / "r.html"
    command = ["validate", *without_inverse, "--json", str(result), "--report", str(page)]
    assert main(command) == 0
    said, shown = json.loads(result.read_text()), capsys.readouterr()
    assert said["simulation"]["total"]["nrmse"] < 1e-6 and said["corrected"] is None
    assert "simulated against measured" in shown.out and "filter:" not in shown.out
    warning, = shown.err.strip().splitlines()
    why = warning.removeprefix("warning: there is no correction: ")
    offer = re.search("; it can with (--lowest) (.+)", why)
    assert why != warning and why in page.read_text()
    assert main([*command, *offer.groups()]) == 0
    assert json.loads(result.read_text())["corrected"]["total"]["nrmse"] < 0.01
    judged = validate(without_inverse[0], SensorModel.load(without_inverse[2]))
    assert judged.comparison is None and "lowest_hz=" in judged.no_correction
    assert "no correction" in repr(judged) and len(judged.plot().axes) == 2
    with pytest.raises(FracAccelError, match="bandwidth_hz: -1"):
        validate(without_inverse[0], SensorModel.load(without_inverse[2]), bandwidth_hz=-1)


def test_a_refusal_offers_options_that_exist(without_inverse, tmp_path, refuse):
    """Of a sensor that hides a frequency behind a zero outside the unit circle, at 2 Hz."""
    radius = 1.08
    zeros = 1.0, -2 * radius * np.cos(2 * np.pi * 2.0 / 200.0), radius**2
    SensorModel(Arx(zeros, (1.0, -0.5, 0.0), 200.0)).save(without_inverse[2])
    command = ["correct", *without_inverse, "-o", str(tmp_path / "c.mcap"), "--bandwidth", "60"]
    line = refuse(*command)
    offers = re.findall(r"(--\S+) ([\d.e-]+)", line)
    assert {name for name, _ in offers} == {"--bandwidth", "--lowest", "--tolerance"}
    assert "=" not in line
    for offer in offers:
        assert main([*command, *offer]) == 0


def test_unknown_figures_are_told_in_words(tmp_path, capsys):
    """As of a short record, of a sensor that can be corrected up to 4.4 Hz only."""
    found = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 2.0, "damping_ratio": 0.7}})
    motion = np.random.default_rng(1).normal(size=(444, 3))
    stamps = np.arange(len(motion)) * 10_000_000
    noise = 1e-3 * np.random.default_rng(2).normal(size=motion.shape)
    write_bag(tmp_path / "b.mcap", {
        REFERENCE_TOPIC: Samples.of(stamps, motion),
        RAW_TOPIC: Samples.of(stamps, simulate(found, motion, 100.0) + noise)})
    assert main(["identify", str(tmp_path / "b.mcap"), "-o", str(tmp_path / "m.yaml")]) == 0
    shown = capsys.readouterr().out
    assert "% of the output, too short to hold data out\n" in shown
    assert main(["validate", str(tmp_path / "b.mcap"), "--model", str(tmp_path / "m.yaml")]) == 0
    shown += capsys.readouterr().out
    assert "nan" not in shown and "  -: the record is too short" in shown
    assert "where the sensor has lost 80 % of its gain; the sensor follows" in shown


def test_simulate(tmp_path):
    out = tmp_path / "s.mcap"
    assert main(["simulate", bag(FRACTIONAL), "--model", model(FRACTIONAL), "-o", str(out)]) == 0
    topics = read_bag(out)
    reference, raw = topics[REFERENCE_TOPIC], topics[RAW_TOPIC]
    np.testing.assert_array_equal(raw.stamps_ns, reference.stamps_ns)
    np.testing.assert_allclose(
        raw.values, simulate(SensorModel.load(model(FRACTIONAL)), reference.values, 1000.0),
        atol=1e-9)


def test_rosbag2_folder_and_other_topics(tmp_path):
    samples = read_bag(bag(CLASSICAL))
    write_bag(tmp_path / "folder", {"/ref": samples[REFERENCE_TOPIC], "/raw": samples[RAW_TOPIC]})
    topics = ["--reference", "/ref", "--sensor", "/raw"]
    model_file = str(tmp_path / "m.yaml")
    assert main(["identify", str(tmp_path / "folder"), "-o", model_file, *topics]) == 0
    assert main(["correct", str(tmp_path / "folder"), "--model", model_file, "-o",
                 str(tmp_path / "out"), *topics, "--corrected", "/better"]) == 0
    assert len(read_bag(tmp_path / "out")["/better"].stamps_ns) > 3900


def test_blocks_of_samples_are_corrected(tmp_path):
    """PointCloud2 blocks in, blocks of those samples out that are ready."""
    raw = read_bag(bag(FRACTIONAL))[RAW_TOPIC]
    with BagWriter(tmp_path / "b.mcap") as writer:
        writer.add_topic("/accel/blocks_raw", cdr.POINT_CLOUD2)
        for start in range(0, len(raw.stamps_ns), 100):
            part = slice(start, start + 100)
            block = Samples.of(raw.stamps_ns[part], raw.values[part])
            writer.write("/accel/blocks_raw", cdr.encode_point_cloud(block),
                         int(raw.stamps_ns[start]))
    assert main(["correct", str(tmp_path / "b.mcap"), "--model", model(FRACTIONAL), "-o",
                 str(tmp_path / "c.mcap"), "--sensor", "/accel/blocks_raw", "--corrected",
                 "/accel/blocks"]) == 0
    found = read_bag(tmp_path / "c.mcap")["/accel/blocks"]
    corrector = Corrector(SensorModel.load(model(FRACTIONAL)))
    expected = corrector.process(raw.stamps_ns, raw.values)
    np.testing.assert_array_equal(found.values, expected.values)
    # the block format holds times relative to its stamp in float64 seconds
    assert np.max(np.abs(found.stamps_ns - expected.stamps_ns)) <= 1


@pytest.mark.thorough
def test_memory_does_not_grow_with_the_bag(tmp_path):
    raw = read_bag(bag(FRACTIONAL))[RAW_TOPIC]
    peaks = []
    for copies in (10, 40):
        count = copies * len(raw.stamps_ns)
        stamps = raw.stamps_ns[0] + np.arange(count) * 1_000_000
        write_bag(tmp_path / "b.mcap", {RAW_TOPIC: Samples.of(stamps, np.tile(raw.values,
                                                                             (copies, 1)))})
        tracemalloc.start()
        assert main(["correct", str(tmp_path / "b.mcap"), "--model", model(FRACTIONAL), "-o",
                     str(tmp_path / "c.mcap")]) == 0
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the index of chunks grows, the samples (96 bytes each in arrays alone) do not
    assert peaks[1] - peaks[0] < 30 * 4000 * 20


def test_only_the_asked_for_verb_is_loaded():
    code = ("import sys; from frac_accel.cli import main; main(['identify', 'none', '-o', 'x'])"
            "; print('rclpy' in sys.modules, 'matplotlib' in sys.modules)")
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.stdout.split() == ["False", "False"]


@pytest.mark.parametrize("verb", ["simulate", "identify", "validate", "correct"])
def test_help(verb, capsys):
    with pytest.raises(SystemExit) as stop:
        main([verb, "--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    assert "BAG" in text and "--json FILE" in text


def test_unknown_option_exits_with_2():
    with pytest.raises(SystemExit) as stop:
        main(["correct", bag(CLASSICAL), "--bandwith", "3"])
    assert stop.value.code == 2


# bad input

STAMPS = 10**18 + np.arange(2000) * 1_000_000
RNG = np.random.default_rng(1)
NOISE = RNG.standard_normal((2000, 3))


def samples(stamps=STAMPS, values=NOISE):
    return Samples.of(stamps, values)


BAD_PAIRS = {
    "missing topic": ({REFERENCE_TOPIC: samples()}, "has no topic /imu/data_raw; it has"),
    "one sample": ({REFERENCE_TOPIC: samples(), RAW_TOPIC: samples(STAMPS[:1], NOISE[:1])},
                   "1 usable sample"),
    "all zeros": ({REFERENCE_TOPIC: samples(), RAW_TOPIC: samples(values=0 * NOISE)},
                  "sensor: axis x is constant at 0"),
    "axis without signal": ({REFERENCE_TOPIC: samples(values=NOISE * [0, 0, 1]),
                             RAW_TOPIC: samples(values=NOISE * [0, 0, 1])},
                            "axis x is constant at 0; there is signal on z"),
    "all NaN": ({REFERENCE_TOPIC: samples(), RAW_TOPIC: samples(values=NOISE * np.nan)},
                "whose values are finite"),
    "constant stamps": ({REFERENCE_TOPIC: samples(), RAW_TOPIC: samples(STAMPS * 0 + 10**18)},
                        "whose stamps advance"),
}


@pytest.mark.parametrize("case", BAD_PAIRS)
@pytest.mark.parametrize("verb", ["identify", "validate"])
def test_bad_pair(case, verb, tmp_path, refuse):
    topics, words = BAD_PAIRS[case]
    write_bag(tmp_path / "b.mcap", topics)
    options = ["-o", tmp_path / "m.yaml"] if verb == "identify" else ["--model", model(CLASSICAL)]
    assert words in refuse(verb, tmp_path / "b.mcap", *options)
    assert not (tmp_path / "m.yaml").exists()


BAD_RAW = {
    "missing topic": ({REFERENCE_TOPIC: samples()}, "has no topic /imu/data_raw"),
    "one sample": ({RAW_TOPIC: samples(STAMPS[:1], NOISE[:1])}, "be estimated from 1 sample"),
    "two samples": ({RAW_TOPIC: samples(STAMPS[:2], NOISE[:2])}, "nothing could be corrected of 2"),
    "constant stamps": ({RAW_TOPIC: samples(STAMPS * 0 + 10**18)}, "stamps do not advance"),
    "all NaN": ({RAW_TOPIC: samples(values=NOISE * np.nan)}, "2000 not finite"),
    "stamps go back": ({RAW_TOPIC: samples(STAMPS[::-1].copy())}, "stamps do not advance"),
}


@pytest.mark.parametrize("case", BAD_RAW)
def test_bad_raw_samples(case, tmp_path, refuse):
    topics, words = BAD_RAW[case]
    write_bag(tmp_path / "b.mcap", topics)
    assert words in refuse("correct", tmp_path / "b.mcap", "--model", model(CLASSICAL), "-o",
                           tmp_path / "c.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["b.mcap"]


def test_zeros_are_corrected_to_the_offset(tmp_path):
    write_bag(tmp_path / "b.mcap", {RAW_TOPIC: samples(values=0 * NOISE)})
    assert main(["correct", str(tmp_path / "b.mcap"), "--model", model(CLASSICAL), "-o",
                 str(tmp_path / "c.mcap")]) == 0
    assert not read_bag(tmp_path / "c.mcap")[CORRECTED_TOPIC].values.any()


def test_single_bad_samples_are_counted(tmp_path, capsys):
    values, stamps = NOISE.copy(), STAMPS.copy()
    values[700, 1] = np.nan
    stamps[900] = stamps[899]
    stamps[1100] = stamps[1090]
    keep = np.r_[0:1300, 1303:2000]
    write_bag(tmp_path / "b.mcap", {RAW_TOPIC: samples(stamps[keep], values[keep])})
    assert main(["correct", str(tmp_path / "b.mcap"), "--model", model(CLASSICAL), "-o",
                 str(tmp_path / "c.mcap"), "--json", str(tmp_path / "r.json")]) == 0
    counters = json.loads((tmp_path / "r.json").read_text())["counters"]
    assert (counters["not_finite"], counters["duplicates"], counters["stamps_back"]) == (1, 1, 1)
    assert (counters["gaps"], counters["filled"]) == (4, 6)
    assert "1 with a stamp that goes back" in capsys.readouterr().out


def test_wrong_type(tmp_path, refuse):
    with BagWriter(tmp_path / "b.mcap") as writer:
        writer.add_topic(RAW_TOPIC, cdr.TEMPERATURE)
        writer.write(RAW_TOPIC, cdr.encode_temperature(10**18, 20.0, 0.0, "t"), 10**18)
    line = refuse("correct", tmp_path / "b.mcap", "--model", model(CLASSICAL), "-o",
                  tmp_path / "c.mcap")
    assert "has type sensor_msgs/msg/Temperature, expected" in line


@pytest.mark.parametrize("verb", ["simulate", "identify", "validate", "correct"])
def test_damaged_or_missing_files(verb, tmp_path, refuse):
    def options(bag_path):
        output = ["-o", tmp_path / "out.yaml"] if verb != "validate" else []
        return [verb, bag_path, *output, *(["--model", model(CLASSICAL)] if verb != "identify"
                                           else [])]
    assert "no such bag" in refuse(*options(tmp_path / "none.mcap"))
    (tmp_path / "empty.mcap").touch()
    assert "empty.mcap" in refuse(*options(tmp_path / "empty.mcap"))
    (tmp_path / "text.mcap").write_text("hello")
    assert "text.mcap" in refuse(*options(tmp_path / "text.mcap"))
    write_bag(tmp_path / "nothing.mcap", {})
    assert "has no topic" in refuse(*options(tmp_path / "nothing.mcap"))


def test_truncated_bag_is_used_up_to_the_damage(tmp_path, capsys):
    data = Path(bag(CLASSICAL)).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:int(0.7 * len(data))])
    assert main(["identify", str(tmp_path / "cut.mcap"), "-o", str(tmp_path / "m.yaml")]) == 0
    captured = capsys.readouterr()
    assert "warning:" in captured.err and "cut.mcap" in captured.err
    found = SensorModel.load(tmp_path / "m.yaml").core.natural_frequency_hz
    assert found == pytest.approx(180, rel=2e-3)


BAD_MODELS = {
    "core: {natural_frequency_hz: -180, damping_ratio: 0.1}": "core.natural_frequency_hz: -180",
    "core: {natural_frequency_hz: 180, damping_ratio: 0.1}\neffects: [{cause: gremlins}]":
        "effects[0].cause: unknown cause 'gremlins'",
    "core: {type: arx, numerator: [1, 0], denominator: [1, -1.2], sampling_rate_hz: 1000}":
        "core.denominator: unstable",
    "core: {natural_frequency_hz: 180 Hz, damping_ratio: 0.1}": "'180 Hz' given, expected a number",
    "core: [": "not valid YAML",
}


@pytest.mark.parametrize("text", BAD_MODELS)
def test_bad_model(text, tmp_path, refuse):
    (tmp_path / "m.yaml").write_text(f"schema: frac_accel/sensor_model/1\n{text}\n")
    line = refuse("correct", bag(CLASSICAL), "--model", tmp_path / "m.yaml", "-o",
                  tmp_path / "c.mcap")
    assert "m.yaml" in line and BAD_MODELS[text] in line
    assert not (tmp_path / "c.mcap").exists()


def test_impossible_wishes(tmp_path, refuse):
    line = refuse("correct", bag(CLASSICAL), "--model", model(CLASSICAL), "-o",
                  tmp_path / "c.mcap", "--max-delay", "1e-6")
    assert "needs a delay of" in line


def test_outputs_are_guarded(tmp_path, refuse):
    line = refuse("correct", bag(CLASSICAL), "--model", model(CLASSICAL), "-o", bag(CLASSICAL))
    assert "is the input" in line
    line = refuse("identify", bag(CLASSICAL), "-o", tmp_path / "no" / "m.yaml")
    assert "does not exist" in line
