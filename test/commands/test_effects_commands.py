"""The commands handle temperature, skew and nonlinear springs like the kernel."""

import json

import numpy as np
import pytest

from frac_accel import read_bag, simulate
from frac_accel.cli import main
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC, BagWriter, Samples, cdr
from frac_accel.model import SensorModel
from frac_accel.streaming import Corrector

RATE = 500.0
COUNT = 3000
START_NS = 1_700_000_000 * 10**9


def sensor(effects):
    return SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "effects": effects,
        "core": {"natural_frequency_hz": 80.0, "damping_ratio": 0.3}})


@pytest.fixture
def bench(tmp_path):
    """Bag with a reference and a temperature that rises by 5 K/s; model file; the model."""
    stamps = START_NS + np.arange(COUNT) * 2_000_000
    t = (stamps - START_NS) * 1e-9
    motion = np.stack([np.sin(2 * np.pi * f * t) * np.minimum(1, 4 * t)**3 for f in (11, 17, 23)],
                      axis=1)
    samples = Samples.of(stamps, motion)
    bag, file = tmp_path / "in.mcap", tmp_path / "m.yaml"
    with BagWriter(bag) as writer:
        writer.add_topic(REFERENCE_TOPIC, cdr.IMU)
        writer.add_topic(TEMPERATURE_TOPIC, cdr.TEMPERATURE)
        for i, message in enumerate(cdr.encode_samples(cdr.IMU, samples)):
            if i % 250 == 0:
                writer.write(TEMPERATURE_TOPIC, cdr.encode_temperature(
                    int(stamps[i]), 20 + 5 * t[i], 0.0, "accel_link"), int(stamps[i]))
            writer.write(REFERENCE_TOPIC, message, int(stamps[i]))
    model = sensor([{"cause": "temperature_sensitivity", "coefficient_per_k": 2e-3},
                    {"cause": "clock_skew", "skew_ppm": 100.0},
                    {"cause": "cubic_stiffness", "alpha3": 0.02}])
    model.save(file)
    return bag, file, model, samples, 20 + 5 * np.minimum(t, t[COUNT - 250])


def test_simulate_correct_validate(bench, tmp_path, capsys):
    bag, file, model, samples, temperature = bench
    raw, corrected, result = tmp_path / "raw.mcap", tmp_path / "c.mcap", tmp_path / "r.json"
    assert main(["simulate", str(bag), "--model", str(file), "-o", str(raw)]) == 0
    simulated = read_bag(raw)[RAW_TOPIC]
    expected = simulate(model, samples.values, RATE, temperature_c=temperature)
    np.testing.assert_allclose(simulated.values, expected, atol=1e-9)

    # the simulated bag has no temperature of its own: taken as 25 degrees, and said
    assert main(["correct", str(raw), "--model", str(file), "-o", str(corrected),
                 "--json", str(result)]) == 0
    assert json.loads(result.read_text())["counters"]["without_temperature"] == COUNT
    assert "without a temperature" in capsys.readouterr().out

    both = tmp_path / "both.mcap"
    with BagWriter(both) as writer:
        for name, kind in ((REFERENCE_TOPIC, cdr.IMU), (RAW_TOPIC, cdr.IMU),
                           (TEMPERATURE_TOPIC, cdr.TEMPERATURE)):
            writer.add_topic(name, kind)
        references, raws = (cdr.encode_samples(cdr.IMU, one) for one in (samples, simulated))
        for i, stamp in enumerate(samples.stamps_ns.tolist()):
            if i % 250 == 0:
                writer.write(TEMPERATURE_TOPIC, cdr.encode_temperature(
                    stamp, temperature[i], 0.0, "accel_link"), stamp)
            writer.write(REFERENCE_TOPIC, references[i], stamp)
            writer.write(RAW_TOPIC, raws[i], stamp)
    assert main(["correct", str(both), "--model", str(file), "-o", str(corrected)]) == 0
    out = read_bag(corrected)["/imu/data"]
    kernel = Corrector(model)
    parts = []
    for start in range(0, COUNT, 250):
        kernel.set_temperature(temperature[start])
        parts.append(kernel.process(simulated.stamps_ns[start:start + 250],
                                    simulated.values[start:start + 250]))
    np.testing.assert_array_equal(out.values, np.concatenate([part.values for part in parts]))
    np.testing.assert_array_equal(out.stamps_ns, np.concatenate([part.stamps_ns for part in parts]))

    assert main(["validate", str(both), "--model", str(file), "--json", str(result)]) == 0
    said = json.loads(result.read_text())
    assert said["simulation"]["total"]["nrmse"] < 1e-3
    # the correction holds a temperature for half a second, within which it rises by 2.5 K
    assert said["corrected"]["total"]["nrmse"] < 0.01 < said["scaled"]["total"]["nrmse"]


@pytest.mark.parametrize("command", ["simulate", "validate"])
def test_missing_temperature_is_one_line(bench, tmp_path, capsys, command):
    bag, file, *_ = bench
    out = ["-o", str(tmp_path / "o.mcap")] if command == "simulate" else ["--sensor",
                                                                         REFERENCE_TOPIC]
    assert main([command, str(bag), "--model", str(file), "--temperature", "/none", *out]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert "/none" in line


def test_correct_says_that_a_step_is_of_another_record(bench, tmp_path, capsys):
    bag, file, _, _, _ = bench
    raw, out = tmp_path / "raw.mcap", tmp_path / "c.mcap"
    steps = [{"cause": "gain_step", "at_s": 2.0, "ratio": 1.1},
             {"cause": "offset_drift", "rate_per_s": 0.1}]

    def warning_with(effects, provenance=None):
        model = sensor(effects)
        if provenance:
            model.metadata["provenance"] = {"bag": provenance}
        model.save(file)
        assert main(["correct", str(raw), "--model", str(file), "-o", str(out)]) == 0
        return "take them out of the model" in capsys.readouterr().out

    assert main(["simulate", str(bag), "--model", str(file), "-o", str(raw)]) == 0
    assert warning_with(steps)
    assert warning_with(steps, provenance="another.mcap")
    assert not warning_with(steps, provenance="raw.mcap")
    assert not warning_with([{"cause": "offset", "offset": 0.1}])
