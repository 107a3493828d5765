"""Many sensors in one corrector, over DDS: each as if it were alone; what the console says."""

import time

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from ros_probe import Probe, background, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu, PointCloud2

from frac_accel.io import cdr
from frac_accel.io.bag import Samples
from frac_accel.model import SensorModel
from frac_accel.streaming import Corrector

pytestmark = pytest.mark.ros

RATE_HZ = 200.0
SECONDS = 4.0


def samples(seed, frame="imu", seconds=SECONDS):
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    values = np.sin(2 * np.pi * np.outer(t, [3.0, 4.0, 5.0])) \
        + 0.05 * np.random.default_rng(seed).normal(size=(len(t), 3))
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * t).astype(np.int64)
    return Samples.of(stamps, values, np.full(values.shape, 25e-4), frame)


def write_model(path, sensitivity=1.0):
    path.write_text(yaml.safe_dump({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 40.0, "damping_ratio": 0.3, "sensitivity": sensitivity}}))
    return path


@pytest.fixture
def models(tmp_path):
    return write_model(tmp_path / "soft.yaml"), write_model(tmp_path / "loud.yaml", 10.0)


def parameters_file(tmp_path, **parameters):
    path = tmp_path / "sensors.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
    return "--params-file", str(path)


def reliable(*topics):
    return {topic: {"subscription": {"reliability": "reliable"}} for topic in topics}


def request(probe, service, **values):
    client = probe.node.create_client(SetParametersAtomically, f"/corrector/{service}")
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return probe._call(client, SetParametersAtomically.Request(parameters=parameters)).result


def expected(model_file, raw, **wishes):
    return Corrector(SensorModel.load(model_file), RATE_HZ, **wishes).process(*raw[:3])


def wait_for_as_many(probe, received, reference):
    probe.until(lambda: len(received) >= len(reference),
                lambda: f"{len(received)} of {len(reference)}", 60.0)


def assert_same(received, reference, frame):
    live = cdr.read_samples(cdr.IMU, received)
    np.testing.assert_array_equal(live.stamps_ns, reference.stamps_ns)
    np.testing.assert_array_equal(live.values, reference.values)
    np.testing.assert_array_equal(live.variance, reference.variance)
    assert live.frame_id == frame


def test_each_of_many_is_corrected_as_if_it_were_alone(tmp_path, models):
    soft, loud = models
    raw = [samples(1, "one"), samples(2, "two"), samples(3, "three")]
    arguments = parameters_file(
        tmp_path, sensors=["front", "rear", "seat"], sample_rate_hz=RATE_HZ, model_file=str(soft),
        front={"namespace": "axle/front"}, rear={"model_file": str(loud), "frame_id": "rear_axle"},
        seat={"message_type": cdr.POINT_CLOUD2, "bandwidth_hz": 20.0},
        qos_overrides=reliable("/axle/front/imu/data_raw", "/rear/imu/data_raw",
                               "/seat/accel/blocks_raw"))
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, {}, *arguments) as node:
        front, rear = (probe.collect(Imu, f"/{name}/imu/data") for name in ("axle/front", "rear"))
        seat = probe.collect(PointCloud2, "/seat/accel/blocks")
        sources = [probe.publisher(Imu, f"/{name}/imu/data_raw") for name in ("axle/front", "rear")]
        blocks = probe.publisher(PointCloud2, "/seat/accel/blocks_raw")
        publish([(source, cdr.encode_samples(cdr.IMU, one))
                 for source, one in zip(sources, raw)], RATE_HZ)
        edges = range(0, len(raw[2].stamps_ns), 100)
        publish([(blocks, [cdr.encode_point_cloud(Samples(
            *(column[at:at + 100] for column in raw[2][:3]), "three")) for at in edges])], 20.0)
        first, second = expected(soft, raw[0]), expected(loud, raw[1])
        third = expected(soft, raw[2], bandwidth_hz=20.0)
        wait_for_as_many(probe, front, first)
        wait_for_as_many(probe, rear, second)
        probe.until(lambda: len(seat) == len(edges), lambda: f"{len(seat)} blocks")
        names = {"corrector: /axle/front/imu/data_raw", "corrector: /rear/imu/data_raw",
                 "corrector: /seat/accel/blocks_raw"}
        probe.until(lambda: {status.name for status in probe.statuses} == names,
                    lambda: {status.name for status in probe.statuses})
        assert node.stop() == 0
    assert_same(front, first, "one")
    assert_same(rear, second, "rear_axle")
    live = cdr.read_samples(cdr.POINT_CLOUD2, seat)
    # without the variance, which blocks do not carry
    np.testing.assert_array_equal(live.values, third.values)
    assert sum(f"samples {len(one.stamps_ns)}" in node.text for one in raw[:1]) == 1
    assert "lost" not in node.text


def test_sensors_come_and_go_at_run_time(tmp_path, models):
    soft, loud = models
    raw, later = samples(1, "imu"), samples(2, "imu", 2.0)
    arguments = parameters_file(
        tmp_path, sensors=["front"], sample_rate_hz=RATE_HZ, model_file=str(soft),
        qos_overrides=reliable("/front/imu/data_raw", "/rear/imu/data_raw"))
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, {}, *arguments) as node:
        front, rear = (probe.collect(Imu, f"/{name}/imu/data") for name in ("front", "rear"))
        source = probe.publisher(Imu, "/front/imu/data_raw")
        with background(publish, [(source, cdr.encode_samples(cdr.IMU, raw))], RATE_HZ):
            for wrong, words in (({"name": "front"}, "two sensors"), ({}, "cannot be a sensor's"),
                                 ({"name": "a/b"}, "cannot be a sensor's"),
                                 ({"name": "rear", "model_file": "/nowhere"}, "/nowhere"),
                                 ({"name": "rear", "bandwith_hz": 5.0},
                                  "'bandwith_hz' is no parameter of a sensor: did you mean "
                                  "'bandwidth_hz'?"),
                                 ({"name": "rear", "qqq": 5.0}, "of a sensor: model_file, "),
                                 ({"name": "rear", "bandwidth_hz": "5"}, "bandwidth_hz"),
                                 ({"name": "rear", "bandwidth_hz": -5.0}, "bandwidth_hz"),
                                 ({"name": "rear", "on_fault": "shout"}, "on_fault")):
                result = request(probe, "add_sensor", **wrong)
                assert not result.successful and words in result.reason, result
            result = request(probe, "add_sensor", name="rear", model_file=str(loud))
            assert result.successful, result
        other = probe.publisher(Imu, "/rear/imu/data_raw")
        publish([(other, cdr.encode_samples(cdr.IMU, later))], RATE_HZ)
        first, second = expected(soft, raw), expected(loud, later)
        wait_for_as_many(probe, front, first)
        wait_for_as_many(probe, rear, second)
        assert probe.set_parameter("corrector", "rear.model_file", str(soft)).successful
        refused = probe.set_parameter("corrector", "rear.sample_rate_hz", 7.0)
        assert not refused.successful and "add it anew" in refused.reason
        assert not probe.set_parameter("corrector", "model_file", str(loud)).successful
        assert not request(probe, "remove_sensor", name="roof").successful
        assert request(probe, "remove_sensor", name="rear").successful
        assert f"/rear/imu/data_raw: samples {len(later.stamps_ns)}" in node.wait_for(
            "/rear/imu/data_raw: samples")
        probe.until(lambda: not other.get_subscription_count(), "still subscribed")
        # and again, with what it had before
        assert request(probe, "add_sensor", name="rear", model_file=str(loud)).successful
        assert node.stop() == 0
    assert_same(front, first, "imu")
    assert_same(rear, second, "imu")


def test_where_nothing_may_change_no_sensor_comes_or_goes(tmp_path, models):
    arguments = parameters_file(tmp_path, sensors=["front"], model_file=str(models[0]),
                                allow_model_changes=False)
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, {}, *arguments):
        for service, name in (("add_sensor", "rear"), ("remove_sensor", "front")):
            result = request(probe, service, name=name)
            assert not result.successful and "allow_model_changes" in result.reason


@pytest.mark.parametrize("parameters, words", [
    ({"sensors": ["front", "front"]}, "two sensors"),
    ({"sensors": ["front axle"]}, "front axle"),
    ({"sensors": ["front"], "model_file": ""}, "front.model_file"),
    ({"sensors": ["front"], "front": {"bandwidth_hz": -1.0}}, "front.bandwidth_hz"),
    ({"sensors": ["front"], "front": {"raw_topic": "a b"}}, "a b"),
    ({"sensors": ["front", "rear"], "rear": {"bandwidth_hz": 600.0, "sample_rate_hz": 1000.0}},
     "sensor 'rear': bandwidth_hz"),
    ({"sensors": ["front", "rear"], "front": {"namespace": "a"}, "rear": {"namespace": "a"}},
     "sensor 'rear': /a/imu/data is the corrected topic of sensor 'front', too"),
    ({"sensors": ["front"], "front": {"raw_topic": "/a", "corrected_topic": "/a"}},
     "/a is the raw and the corrected topic"),
])
def test_what_cannot_be_is_one_line_and_status_2(parameters, words, tmp_path, models):
    arguments = parameters_file(tmp_path, **{"model_file": str(models[0]), **parameters})
    with ros_domain() as environment, \
            NodeProcess("corrector", environment, {}, *arguments) as node:
        assert node.wait(60) == 2
    assert len(node.errors) == 1 and words in node.errors[0], node.errors


def test_the_console_says_what_is_done_and_what_is_wrong(models):
    parameters = {"model_file": models[0], "modle_file": "x", "sample_rate_hz": RATE_HZ,
                  "qos_overrides./imu/data_raw.subscription.reliability": "reliable"}
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, parameters) as node:
        line = node.wait_for("corrects /imu/data_raw (sensor_msgs/msg/Imu) to /imu/data with")
        assert str(models[0]) in line
        node.wait_for("parameter 'modle_file' is not known here: did you mean 'model_file'?")
        node.wait_for("no publisher on /imu/data_raw")
        time.sleep(2.5)
        assert node.text.count("no publisher on /imu/data_raw") == 1
        source = probe.publisher(Imu, "/imu/data_raw")
        metrics = probe.metrics("/corrector/metrics")
        with background(publish, [(source, cdr.encode_samples(cdr.IMU, samples(1)))], RATE_HZ):
            probe.until(lambda: any("x/raw/std" in values for _, values in metrics),
                        lambda: metrics)
        assert node.stop() == 0
    assert "/imu/data_raw: samples" in node.output[-1]
    stamp_ns, values = metrics[-1]
    assert abs(stamp_ns - time.time_ns()) < 60e9
    assert all(np.isfinite(float(value)) for value in values.values())
    assert {"load", "received_per_s", "latency_p99_s"} <= values.keys()


def test_a_model_of_one_record_is_named_as_such(models):
    file = models[0]
    file.write_text(file.read_text() + "effects: [{cause: gain_step, at_s: 36.9, ratio: 1.2}]\n")
    with ros_domain() as environment, \
            NodeProcess("corrector", environment, {"model_file": file}) as node:
        assert "[WARN]" in node.wait_for(f"{file}: gain_step: the time counts from the first")
        node.wait_for("corrects /imu/data_raw")
        assert node.stop() == 0


def test_without_a_model_it_says_so():
    with ros_domain() as environment, NodeProcess("corrector", environment) as node:
        assert "[ERROR]" in node.wait_for("no model: set the parameter model_file")


def test_a_missing_clock_and_stamps_of_zero_are_named_soon(models):
    parameters = {"model_file": models[0], "use_sim_time": True,
                  "qos_overrides./imu/data_raw.subscription.reliability": "reliable"}
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, parameters):
        probe.status("nothing has come on /clock", ever=True)
        source = probe.publisher(Imu, "/imu/data_raw")
        raw = samples(1)
        zeros = cdr.encode_samples(cdr.IMU, raw._replace(stamps_ns=np.zeros_like(raw.stamps_ns)))
        before = len(probe.statuses)
        with background(publish, [(source, zeros[:40])], 10.0):
            probe.status("the stamps on /imu/data_raw are zero")
        named = ["are zero" in status.message for status in probe.statuses[before:]]
        # there is one each second
        assert named.index(True) <= 1
