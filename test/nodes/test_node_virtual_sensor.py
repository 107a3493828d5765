"""Node ``virtual_sensor`` over DDS, in its own process, against `LiveSimulator` offline."""

import numpy as np
import pytest
import rig
import yaml
from ros_processes import NodeProcess, ros_domain

pytest.importorskip("rclpy")

from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, Samples, read_bag, write_bag
from frac_accel.model import SensorModel
from frac_accel.streaming.live_simulation import LiveSimulator

pytestmark = pytest.mark.ros

RATE_HZ = 2000.0


@pytest.fixture(scope="module")
def model_file(tmp_path_factory):
    sensor = rig.draw_sensor(np.random.default_rng(21), RATE_HZ, "fractional",
                             ("time_delay", "cross_axis_sensitivity"))
    path = tmp_path_factory.mktemp("model") / "sensor.yaml"
    path.write_text(yaml.safe_dump(sensor.to_model()))
    return path


@pytest.fixture(scope="module")
def reference():
    excitation = rig.band_noise(np.random.default_rng(22), RATE_HZ, 2.0, (5.0, 500.0))
    values = excitation.reference
    stamps = rig.record.START_NS + np.arange(len(values)) * 500_000
    return Samples.of(stamps, values, frame_id="table")


def played(reference, parameters, folder):
    """What the node makes of a reference, and the node."""
    write_bag(folder / "reference.mcap", {REFERENCE_TOPIC: reference})
    with ros_domain() as environment, \
            NodeProcess("recorder", environment, {
                "bag": folder / "raw.mcap", "topics": [RAW_TOPIC],
                "idle_timeout_s": 2.0}) as recorder, \
            NodeProcess("virtual_sensor", environment, parameters) as node:
        # what is played before the recorder has found the raw topic is not recorded
        recorder.wait_for(f"recording {RAW_TOPIC} ")
        with NodeProcess("player", environment, {
                "bag": folder / "reference.mcap", "wait_for_subscribers": 1,
                "start_delay_s": 1.0}) as player:
            assert player.wait() == 0, player.text
        assert recorder.wait() == 0, recorder.text
        assert node.stop() == 0, node.text
    return read_bag(folder / "raw.mcap")[RAW_TOPIC]


def test_output_is_the_simulation_with_noise_and_its_covariance(reference, model_file, tmp_path):
    live = played(reference, {"model_file": model_file, "sample_rate_hz": RATE_HZ,
                              "noise_std": 0.02, "seed": 5}, tmp_path)
    clean = LiveSimulator(SensorModel.load(model_file), RATE_HZ).process(*reference[:3])
    assert len(clean) > 3900
    np.testing.assert_array_equal(live.stamps_ns, clean.stamps_ns)
    noise = 0.02 * np.random.default_rng(5).standard_normal(clean.values.shape)
    np.testing.assert_array_equal(live.values, clean.values + noise)
    np.testing.assert_allclose(live.variance, 0.02**2, rtol=1e-12)
    assert live.frame_id == "table"


def test_without_noise_it_is_the_simulation(reference, model_file, tmp_path):
    short = Samples(*(column[:400] for column in reference[:3]), reference.frame_id)
    live = played(short, {"model_file": model_file}, tmp_path)
    clean = LiveSimulator(SensorModel.load(model_file)).process(*short[:3])
    np.testing.assert_array_equal(live.values, clean.values)
    np.testing.assert_array_equal(live.variance, clean.variance)


@pytest.mark.parametrize("parameters, words", [
    ({}, "model_file"),
    ({"model_file": "/nowhere/model.yaml"}, "/nowhere/model.yaml"),
    ({"model_file": None, "noise_std": -1.0}, "noise_std"),
])
def test_bad_parameters_are_one_line_and_status_2(parameters, words, model_file):
    parameters = {name: value or model_file for name, value in parameters.items()}
    with ros_domain() as environment, \
            NodeProcess("virtual_sensor", environment, parameters) as node:
        assert node.wait(20) == 2
    assert len(node.errors) == 1, node.errors
    assert words in node.errors[0]
