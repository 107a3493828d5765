"""Node ``corrector`` takes the temperature from its topic, and says when there is none."""

import time

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")

from ros_probe import BEST_EFFORT, Probe, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu, Temperature

from frac_accel.io import cdr
from frac_accel.io.bag import Samples

pytestmark = pytest.mark.ros

MODEL = {"schema": "frac_accel/sensor_model/1", "noise_std": 1e-3,
         "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.3},
         "effects": [{"cause": "temperature_sensitivity", "coefficient_per_k": 2e-3},
                     {"cause": "clipping", "lower": -20.0, "upper": 20.0}]}


def messages(start, count, value):
    stamps = 10**18 + (start + np.arange(count)) * 1_000_000
    return cdr.encode_samples(cdr.IMU, Samples.of(stamps, np.full((count, 3), value)))


def test_temperature_is_held_and_its_absence_said(tmp_path):
    file = tmp_path / "sensor.yaml"
    file.write_text(yaml.safe_dump(MODEL))
    parameters = {"model_file": file, "sample_rate_hz": 1000.0,
                  "qos_overrides./imu/data_raw.subscription.reliability": "reliable"}
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, parameters):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        thermometer = probe.node.create_publisher(Temperature, "/imu/temperature", BEST_EFFORT)
        probe.until(lambda: thermometer.get_subscription_count(), "nobody takes the temperature")
        publish([(publisher, messages(0, 400, 5.0))], 1000.0)
        status = probe.status("no temperature has come, so 25", ever=True)
        assert "without_temperature" in {value.key for value in status.values}
        probe.until(lambda: len(received) > 300, "nothing corrected")
        before = cdr.read_samples(cdr.IMU, received[:])
        np.testing.assert_allclose(before.values, 5.0, rtol=3e-3)
        assert np.sqrt(before.variance).min() > 0.3

        thermometer.publish(Temperature(temperature=45.0))
        time.sleep(0.5)
        count = len(received)
        publish([(publisher, messages(400, 400, 5.0))], 1000.0)
        probe.until(lambda: len(received) >= count + 390, "nothing corrected")
        after = cdr.read_samples(cdr.IMU, received[-300:])
        np.testing.assert_allclose(after.values, 5.0 / 1.04, rtol=3e-3)
        assert np.sqrt(after.variance).max() < 0.01
        publish([(publisher, messages(800, 100, 20.0))], 1000.0)
        probe.status("samples are at the limits of the model's range", ever=True)
