"""What must not deceive or stop a running corrector, over DDS."""

import os
import time

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")

from ros_probe import Probe, background, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu

from frac_accel.io import cdr
from frac_accel.io.bag import Samples

pytestmark = pytest.mark.ros

RATE_HZ = 500.0
DOCUMENT = {"schema": "frac_accel/sensor_model/1", "noise_std": 0.02,
            "core": {"natural_frequency_hz": 100.0, "damping_ratio": 0.2}}


def messages(seconds, offset=0.0, frame="imu", start=0.0):
    t = start + np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    values = offset + np.sin(2 * np.pi * np.outer(t, [3.0, 4.0, 5.0])) \
        + 0.02 * np.random.default_rng(0).normal(size=(len(t), 3))
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * t).astype(np.int64)
    return cdr.encode_samples(cdr.IMU, Samples.of(stamps, values, frame_id=frame))


def running(tmp_path, environment, **parameters):
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(DOCUMENT))
    return NodeProcess("corrector", environment, {
        "model_file": path, "sample_rate_hz": RATE_HZ,
        "qos_overrides./imu/data_raw.subscription.reliability": "reliable", **parameters})


def test_a_second_publisher_is_dropped_and_named(tmp_path):
    with ros_domain() as environment, Probe(environment) as probe, \
            running(tmp_path, environment) as node:
        received = probe.collect(Imu, "/imu/data")
        first = probe.publisher(Imu, "/imu/data_raw")
        publish([(first, messages(1.0))], RATE_HZ)
        second = probe.node.create_publisher(Imu, "/imu/data_raw", 100)
        time.sleep(1.5)
        publish([(first, messages(2.0, start=1.0)), (second, messages(2.0, 30.0, "imu2", 1.001))],
                RATE_HZ)
        status = probe.status("has another publisher", ever=True)
        assert "imu2" in status.message
        time.sleep(0.5)
        assert node.stop() == 0
    values = cdr.read_samples(cdr.IMU, received).values
    assert len(values) > 1400 and np.abs(values).max() < 3
    assert "other_publisher 1000" in node.text


def test_no_file_stops_or_stalls_the_node(tmp_path):
    """A FIFO, numbers without end, a design that takes for ever: refused while samples go on."""
    bad = {"fifo.yaml": None, "hex.yaml": "noise_std: 0x" + "f" * 6000,
           "sixty.yaml": "noise_std: " + "1:" * 30_000 + "1", "large.yaml": "#" * 10_000_000}
    for name, text in bad.items():
        if text is None:
            os.mkfifo(tmp_path / name)
        else:
            (tmp_path / name).write_text(f"schema: frac_accel/sensor_model/1\n{text}\n")
    with ros_domain() as environment, Probe(environment) as probe, \
            running(tmp_path, environment) as node:
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        with background(publish, [(publisher, messages(14.0))], RATE_HZ):
            for name in bad:
                before, at_s = len(received), time.monotonic()
                result = probe.set_parameter("corrector", "model_file", str(tmp_path / name))
                assert not result.successful and name in result.reason
                took_s = time.monotonic() - at_s
                time.sleep(0.3)
                assert took_s < 10 and len(received) - before > 0.6 * RATE_HZ * took_s
            good = tmp_path / "good.yaml"
            good.write_text(yaml.safe_dump({**DOCUMENT, "noise_std": 0.03}))
            assert probe.set_parameter("corrector", "model_file", str(good)).successful
        time.sleep(0.5)
        assert node.stop() == 0
    stamps = cdr.read_samples(cdr.IMU, received).stamps_ns
    np.testing.assert_array_equal(np.diff(stamps), 2_000_000)


def test_damaged_models_are_taken_or_refused_by_the_node():
    from fuzz import live_node
    seen = []
    assert live_node.run(range(3), None, lambda *told: seen.append(told[2])) == {}
    assert len(seen) == 3


def test_a_model_that_may_not_change_does_not(tmp_path):
    with ros_domain() as environment, Probe(environment) as probe, \
            running(tmp_path, environment, allow_model_changes=False) as node:
        probe.until(lambda: probe.statuses, "no diagnostics")
        result = probe.set_parameter("corrector", "model_file", str(tmp_path / "model.yaml"))
        assert not result.successful and "allow_model_changes is false" in result.reason
        assert not probe.trigger("/corrector/reload_model").success
        assert node.stop() == 0
