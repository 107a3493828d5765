"""Node ``corrector`` over DDS, in its own process, against `Corrector` offline."""

import contextlib
import time

import numpy as np
import pytest
import rig
import yaml

pytest.importorskip("rclpy")

from geometry_msgs.msg import AccelStamped
from rclpy.serialization import deserialize_message, serialize_message
from ros_probe import BEST_EFFORT, RELIABLE, Probe, background, publish
from ros_processes import ROOT, NodeProcess, ros_domain
from sensor_msgs.msg import Imu, PointCloud2

from frac_accel.io import cdr
from frac_accel.io.bag import CORRECTED_TOPIC, RAW_TOPIC, Samples, read_bag, write_bag
from frac_accel.model import SensorModel
from frac_accel.streaming import Corrector

pytestmark = pytest.mark.ros

RATE_HZ = 2000.0


@pytest.fixture(scope="module")
def sensor():
    return rig.draw_sensor(np.random.default_rng(11), RATE_HZ, "fractional",
                           ("time_delay", "offset"), natural_frequency=(0.1, 0.2))


@pytest.fixture(scope="module")
def record(sensor):
    """Twelve seconds at 2 kHz."""
    rng = np.random.default_rng(12)
    excitation = rig.band_noise(rng, RATE_HZ, 12.0, (5.0, 0.15 * RATE_HZ), amplitude=3.0)
    return rig.simulate_record(sensor, excitation, rng)


@pytest.fixture(scope="module")
def model_file(sensor, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "sensor.yaml"
    path.write_text(yaml.safe_dump(sensor.to_model()))
    return path


@pytest.fixture(scope="module")
def other_model_file(sensor, tmp_path_factory):
    """The same sensor with twice the sensitivity."""
    model = sensor.to_model()
    model["core"]["sensitivity"] *= 2
    path = tmp_path_factory.mktemp("model") / "other.yaml"
    path.write_text(yaml.safe_dump(model))
    return path


@contextlib.contextmanager
def running(parameters, *more):
    """A probe and a corrector that sees it."""
    with ros_domain() as environment, Probe(environment) as probe:
        with NodeProcess("corrector", environment, parameters, *more) as node:
            probe.until(lambda: probe.statuses or node.process.poll() is not None,
                        "no diagnostics")
            assert node.process.poll() is None, node.text
            yield probe, node


def raw_samples(record, count=None, start=0):
    part = slice(start, None if count is None else start + count)
    values = record.sensor[part]
    return Samples.of(record.sensor_stamps_ns[part], values, np.full(values.shape, 1e-4))


def values_of(status):
    return {pair.key: pair.value for pair in status.values}


def counters_of(summary):
    """Counters in the line that the node prints in the end."""
    return {name: int(count) for name, count in
            (item.split() for item in summary.split(": ")[1].split(", "))}


def test_live_is_offline_to_the_last_bit_and_nothing_is_lost(record, model_file, tmp_path):
    stamps, values = record.sensor_stamps_ns.copy(), record.sensor.copy()
    stamps[3000] = stamps[2999]          # a duplicate
    stamps[5000] = stamps[4990]          # one that goes back
    values[7000, 1] = np.nan
    kept = np.ones(len(stamps), bool)
    kept[9000:9005] = False              # a gap that can be bridged
    kept[12000:13000] = False            # and one that cannot
    stamps[13000:] += 10**9
    samples = Samples.of(stamps[kept], values[kept], np.full((kept.sum(), 3), 1e-4), "seat")
    write_bag(tmp_path / "raw.mcap", {RAW_TOPIC: samples})
    with ros_domain() as environment, \
            NodeProcess("recorder", environment, {
                "bag": tmp_path / "live.mcap", "topics": [CORRECTED_TOPIC],
                "idle_timeout_s": 3.0}) as recorder, \
            NodeProcess("corrector", environment, {
                "model_file": model_file, "sample_rate_hz": RATE_HZ}) as corrector:
        # what is played before the recorder has found the corrected topic is not recorded
        recorder.wait_for(f"recording {CORRECTED_TOPIC} ")
        with NodeProcess("player", environment, {
                "bag": tmp_path / "raw.mcap", "wait_for_subscribers": 1,
                "start_delay_s": 1.0}) as player:
            assert player.wait() == 0, player.text
        assert recorder.wait() == 0, recorder.text
        assert corrector.stop() == 0, corrector.text
    live = read_bag(tmp_path / "live.mcap")[CORRECTED_TOPIC]
    offline = Corrector(SensorModel.load(model_file), RATE_HZ)
    expected = offline.process(*samples[:3])
    assert len(expected) > 21_000
    np.testing.assert_array_equal(live.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(live.values, expected.values)
    np.testing.assert_array_equal(live.variance, expected.variance)
    assert live.frame_id == "seat"
    counters = counters_of(corrector.output[-1])
    assert counters.pop("published") == len(expected)
    counters.pop("late", None)  # how long messages waited is the machine's business
    assert counters == {name: count for name, count in offline.counters.items() if count}
    assert {"duplicates", "stamps_back", "not_finite", "gaps", "restarts"} <= set(counters)


def test_a_bench_that_plays_as_fast_as_it_can_loses_nothing(record, model_file, tmp_path):
    samples = raw_samples(record)._replace(frame_id="seat")
    write_bag(tmp_path / "raw.mcap", {RAW_TOPIC: samples})
    bench = "--params-file", str(ROOT / "config" / "bench.yaml")
    with ros_domain() as environment, \
            NodeProcess("recorder", environment, {"bag": tmp_path / "live.mcap",
                                                  "idle_timeout_s": 5.0}, *bench) as recorder, \
            NodeProcess("corrector", environment, {
                "model_file": model_file, "sample_rate_hz": RATE_HZ}, *bench) as corrector:
        recorder.wait_for(f"recording {CORRECTED_TOPIC} ")
        with NodeProcess("player", environment, {
                "bag": tmp_path / "raw.mcap", "rate": 0.0, "wait_for_subscribers": 2},
                *bench) as player:
            assert player.wait() == 0, player.text
        assert recorder.wait() == 0, recorder.text
        assert corrector.stop() == 0, corrector.text
    live = read_bag(tmp_path / "live.mcap")[CORRECTED_TOPIC]
    expected = Corrector(SensorModel.load(model_file), RATE_HZ).process(*samples[:3])
    np.testing.assert_array_equal(live.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(live.values, expected.values)
    assert "lost" not in corrector.output[-1]


def test_everything_else_of_a_message_stays(record, model_file):
    samples = raw_samples(record, 300)
    messages = []
    for i, data in enumerate(cdr.encode_samples(cdr.IMU, samples)):
        message = deserialize_message(data, Imu)
        message.orientation.x, message.angular_velocity.z = 0.1 * i, -1.0 * i
        message.orientation_covariance[4] = 7.0
        message.linear_acceleration_covariance[1] = 1e-5
        messages.append(serialize_message(message))
    with running({"model_file": model_file, "sample_rate_hz": RATE_HZ}) as (probe, node):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, messages)], RATE_HZ)
        expected = Corrector(SensorModel.load(model_file), RATE_HZ).process(*samples[:3])
        probe.until(lambda: len(received) >= len(expected), lambda: f"{len(received)} received")
    assert len(received) == len(expected)
    for index, data, values, variance in zip(expected.index, received, expected.values,
                                             expected.variance):
        after, before = deserialize_message(data, Imu), deserialize_message(messages[index], Imu)
        acceleration = after.linear_acceleration
        assert [acceleration.x, acceleration.y, acceleration.z] == values.tolist()
        assert after.linear_acceleration_covariance.tolist() == np.diag(variance).ravel().tolist()
        after.header.stamp, after.linear_acceleration = (
            before.header.stamp, before.linear_acceleration)
        after.linear_acceleration_covariance = before.linear_acceleration_covariance
        assert after == before


def test_a_model_is_exchanged_without_losing_a_sample(record, model_file, other_model_file,
                                                      tmp_path):
    in_use = tmp_path / "in_use.yaml"
    in_use.write_text(model_file.read_text())
    bad = tmp_path / "bad.yaml"
    bad.write_text(model_file.read_text().replace("damping_ratio", "damping"))
    samples = raw_samples(record, 11_000)
    messages = cdr.encode_samples(cdr.IMU, samples)
    with running({"model_file": in_use, "sample_rate_hz": RATE_HZ}) as (probe, node):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        with background(publish, [(publisher, messages[:8000])], RATE_HZ):
            time.sleep(1.0)
            refused = probe.set_parameter("corrector", "model_file", str(bad))
            assert not refused.successful
            assert "damping" in refused.reason and str(bad) in refused.reason
            assert not probe.set_parameter("corrector", "max_delay_s", 1e-6).successful
            assert not probe.set_parameter("corrector", "sample_rate_hz", 100.0).successful
            in_use.write_text(bad.read_text())
            assert not probe.trigger("/corrector/reload_model").success
            in_use.write_text(other_model_file.read_text())
            assert probe.trigger("/corrector/reload_model").success
            assert probe.set_parameter("corrector", "model_file", str(model_file)).successful
            assert probe.set_parameter("corrector", "model_file",
                                       str(other_model_file)).successful
        publish([(publisher, messages[8000:])], RATE_HZ)
        expected = Corrector(SensorModel.load(model_file), RATE_HZ).process(*samples[:3])
        probe.until(lambda: len(received) >= len(expected) - 100,
                    lambda: f"{len(received)} of {len(expected)}")
        time.sleep(0.3)
        assert node.stop() == 0
    live = cdr.read_samples(cdr.IMU, received)
    # all in one piece: no sample is missing or doubled where the filters changed
    np.testing.assert_array_equal(live.stamps_ns, expected.stamps_ns[:len(received)])
    np.testing.assert_array_equal(live.values[:1000], expected.values[:1000])
    last = slice(len(received) - 1000, len(received))
    np.testing.assert_allclose(2 * live.values[last], expected.values[last],
                               atol=5e-3 * np.std(expected.values))


def test_it_says_why_nothing_is_published(record, model_file):
    samples = raw_samples(record, 400)
    messages = cdr.encode_samples(cdr.IMU, samples)
    reliable = {"qos_overrides./imu/data_raw.subscription.reliability": "reliable"}
    with running(reliable) as (probe, node), Probe(probe.environment, "stranger") as stranger:
        probe.status("no model: set the parameter model_file")
        assert not probe.set_parameter("corrector", "model_file", "/nowhere.yaml").successful
        assert probe.set_parameter("corrector", "model_file", str(model_file)).successful
        probe.status("no publisher on /imu/data_raw")
        other = stranger.node.create_publisher(AccelStamped, "/imu/data_raw", RELIABLE)
        probe.status("/stranger publishes geometry_msgs/msg/AccelStamped")
        stranger.node.destroy_publisher(other)
        other = probe.node.create_publisher(Imu, "/imu/data_raw", BEST_EFFORT)
        status = probe.status("/probe offers another quality of service")
        assert "qos_overrides./imu/data_raw.subscription" in status.message
        probe.node.destroy_publisher(other)
        publisher = probe.publisher(Imu, "/imu/data_raw")
        probe.status("no message on /imu/data_raw yet, though /probe publishes there")
        publish([(publisher, messages[:40])])
        probe.status("estimating the sampling rate: 40 of 100 samples")
        publish([(publisher, messages[39:40] * 60)])
        publish([(publisher, [b"\0\1\0\0" + bytes(20)])])
        publish([(publisher, messages[40:])])
        status = probe.status("60 samples had the same stamp as the one before and were dropped; "
                              "1 message could not be read")
        assert float(values_of(status)["sample_rate_hz"]) == pytest.approx(2000)
        assert node.stop() == 0
        assert "malformed 1" in node.output[-1]


def test_it_says_why_samples_are_dropped(record, model_file):
    samples = raw_samples(record, 2000)
    messages = cdr.encode_samples(cdr.IMU, samples)
    broken = cdr.encode_samples(cdr.IMU, samples._replace(values=np.full((2000, 3), np.nan)))
    with running({"model_file": model_file, "sample_rate_hz": RATE_HZ}) as (probe, node):
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, messages[:10])])
        probe.status("the filter is warming up: 10 of ")
        publish([(publisher, [messages[9]] * 30)])
        probe.status("all 30 samples of the last second were dropped: 30 had the same stamp")
        publish([(publisher, broken[10:20])])
        probe.status("10 had a value that is not finite")
        publish([(publisher, messages[5:9])])
        probe.status("4 had a stamp before the one before")
        publish([(publisher, [b"\0\1\0\0" + bytes(20)] * 3)])
        probe.status("all 3 messages of the last second could not be read")
        publish([(publisher, messages[20::50])])
        probe.status("started anew")
        probe.status("no message on /imu/data_raw for")
        probe.node.destroy_publisher(publisher)
        probe.status("no publisher on /imu/data_raw any more")


def test_stamps_that_do_not_advance_are_named(record, model_file):
    message = cdr.encode_samples(cdr.IMU, raw_samples(record, 1))
    with running({"model_file": model_file}) as (probe, node):
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, message * 150)])
        probe.status("the stamps do not advance")


def test_a_filter_that_cannot_be_met_is_named_and_can_be_mended(record, model_file):
    messages = cdr.encode_samples(cdr.IMU, raw_samples(record, 1000))
    with running({"model_file": model_file, "max_delay_s": 1e-6}) as (probe, node):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, messages[:200])])
        assert "max_delay_s" in probe.status("no filter: ").message
        assert probe.set_parameter("corrector", "max_delay_s", 0.0).successful
        publish([(publisher, messages[200:])], RATE_HZ)
        expected = Corrector(SensorModel.load(model_file)).process(
            *raw_samples(record, 800, 200)[:3])
        probe.until(lambda: len(received) == len(expected),
                    lambda: f"{len(received)} of {len(expected)}: {values_of(probe.statuses[-1])}")


def test_errors_against_a_reference_and_its_loss(record, model_file):
    reference = Samples.of(record.stamps_ns, record.reference)
    raw = raw_samples(record)
    names = [f"/corrector/metrics/{axis}/{name}/nrmse" for axis in "xyz"
             for name in ("raw", "corrected")]
    with running({"model_file": model_file, "metrics_bands_hz": [10.0, 100.0, 200.0]}) \
            as (probe, node):
        probe.watch(*names, "/corrector/metrics/x/corrected/from_100_to_200_hz/phase_error_deg",
                    "/corrector/metrics/latency_p99_s", "/corrector/metrics/sample_rate_hz")
        first = probe.publisher(Imu, "/imu/reference")
        second = probe.publisher(Imu, "/imu/data_raw")
        messages = cdr.encode_samples(cdr.IMU, raw)
        publish([(first, cdr.encode_samples(cdr.IMU, reference)[:12_000]),
                 (second, messages[:12_000])], RATE_HZ)
        with background(publish, [(second, messages[12_000:20_000])], RATE_HZ):
            probe.status("the reference is lost: no message for")
    assert all(probe.figures.values()), probe.figures
    for axis in "xyz":
        before, after = (np.median(probe.figures[f"/corrector/metrics/{axis}/{name}/nrmse"])
                         for name in ("raw", "corrected"))
        assert after < 0.01
        assert after < before / 10
    band, = (values for name, values in probe.figures.items() if "from_100" in name)
    assert np.median(np.abs(band)) < 0.1  # the first window sees the motion begin
    assert probe.figures["/corrector/metrics/sample_rate_hz"][-1] == pytest.approx(2000, 1e-6)
    assert 0 < np.median(probe.figures["/corrector/metrics/latency_p99_s"]) < 0.2


def test_blocks(record, model_file):
    samples = raw_samples(record, 4000)
    sizes = [1, 7, 100, 100, 250, 42] * 8
    edges = np.r_[0, np.cumsum(sizes)]
    blocks = [Samples(*(column[a:b] for column in samples[:3]), "block")
              for a, b in zip(edges[:-1], edges[1:])]
    with running({"model_file": model_file}) as (probe, node):
        received = probe.collect(PointCloud2, "/accel/blocks")
        publisher = probe.publisher(PointCloud2, "/accel/blocks_raw")
        publish([(publisher, [cdr.encode_point_cloud(block) for block in blocks])], 20.0)
        offline = Corrector(SensorModel.load(model_file))
        parts = [offline.process(*block[:2]) for block in blocks]
        expected = sum(len(part) > 0 for part in parts)
        probe.until(lambda: len(received) >= expected, lambda: f"{len(received)} of {expected}")
        assert probe.status("correcting", ever=True).name == "corrector: /accel/blocks_raw"
    live = cdr.read_samples(cdr.POINT_CLOUD2, received)
    assert live.frame_id == "block"
    np.testing.assert_array_equal(live.values, np.concatenate([part.values for part in parts]))
    np.testing.assert_array_equal(live.stamps_ns, np.concatenate([p.stamps_ns for p in parts]))


def test_accel_stamped(record, model_file):
    samples = raw_samples(record, 500)
    with running({"model_file": model_file, "sample_rate_hz": RATE_HZ, "noise_std": 0.1,
                  "message_type": cdr.ACCEL_STAMPED}) as (probe, node):
        received = probe.collect(AccelStamped, "/imu/data")
        publisher = probe.publisher(AccelStamped, "/imu/data_raw")
        publish([(publisher, cdr.encode_samples(cdr.ACCEL_STAMPED, samples))], RATE_HZ)
        expected = Corrector(SensorModel.load(model_file), RATE_HZ).process(*samples[:2])
        probe.until(lambda: len(received) >= len(expected), lambda: f"{len(received)} received")
    live = cdr.read_samples(cdr.ACCEL_STAMPED, received)
    np.testing.assert_array_equal(live.values, expected.values)
    np.testing.assert_array_equal(live.stamps_ns, expected.stamps_ns)


@pytest.mark.parametrize("parameters, words", [
    ({"model_file": "/nowhere/model.yaml"}, "/nowhere/model.yaml"),
    ({"sample_rate_hz": -5.0}, "sample_rate_hz"),
    ({"depth": "many"}, "depth"),
    ({"metrics_bands_hz": [100.0, 10.0]}, "metrics_bands_hz"),
    ({"message_type": "std_msgs/msg/String"}, "message_type"),
    ({"model_file": None, "sample_rate_hz": 2000.0, "max_delay_s": 1e-6}, "max_delay_s"),
])
def test_bad_parameters_are_one_line_and_status_2(parameters, words, model_file):
    parameters = {name: value or model_file for name, value in parameters.items()}
    with ros_domain() as environment, NodeProcess("corrector", environment, parameters) as node:
        assert node.wait(20) == 2
    assert len(node.errors) == 1, node.errors
    assert words in node.errors[0]
