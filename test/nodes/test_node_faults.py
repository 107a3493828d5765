"""What goes wrong around a running corrector, over DDS: counted, and valid again in stated time."""

import contextlib
import signal
import time

import numpy as np
import pytest
import rig
import yaml

pytest.importorskip("rclpy")

from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_probe import RELIABLE, Probe, background, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu

from frac_accel.io import cdr
from frac_accel.io.bag import Samples
from frac_accel.model import SensorModel
from frac_accel.streaming import Corrector

pytestmark = pytest.mark.ros

RATE_HZ = 2000.0
# As docs/nodes.md states them.
RESTART_S, RATE_CHANGE_S, REFERENCE_S = 5.0, 8.0, 4.0


@pytest.fixture(scope="module")
def sensor():
    return rig.draw_sensor(np.random.default_rng(31), RATE_HZ, "fractional", ("offset",),
                           natural_frequency=(0.1, 0.2))


@pytest.fixture(scope="module")
def record(sensor):
    rng = np.random.default_rng(32)
    excitation = rig.band_noise(rng, RATE_HZ, 5.0, (5.0, 0.15 * RATE_HZ), amplitude=3.0)
    return rig.simulate_record(sensor, excitation, rng)


@pytest.fixture(scope="module")
def model_file(sensor, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "sensor.yaml"
    document = sensor.to_model()
    document["covariance"] = {"parameters": ["damping_ratio", "damping_order"],
                              "matrix": [[1e-4, 0.0], [0.0, 1e-4]]}
    path.write_text(yaml.safe_dump(document))
    return path


def samples_of(record, start, count, shift_s=0.0):
    part = slice(start, start + count)
    values = record.sensor[part]
    return Samples.of(record.sensor_stamps_ns[part] + int(shift_s * 1e9), values,
                      np.full(values.shape, 1e-4))


def encoded(samples):
    return cdr.encode_samples(cdr.IMU, samples)


@contextlib.contextmanager
def running(model_file, **parameters):
    reliable = {"qos_overrides./imu/data_raw.subscription.reliability": "reliable"}
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment,
                        {"model_file": model_file, **parameters, **reliable}) as node:
        probe.until(lambda: probe.statuses or node.process.poll() is not None, "no diagnostics")
        assert node.process.poll() is None, node.text
        yield probe, node, environment


def counters_of(node):
    """What the node says at its end that it has done."""
    return {name: int(number) for name, number in
            (item.split() for item in node.output[-1].split(": ")[1].split(", "))}


def test_every_fault_of_the_stream_is_counted_and_passes(record, model_file):
    """Silence, old stamps, NaN, clocks set forward and back, a publisher that is restarted."""
    nan = samples_of(record, 4000, 30)
    nan = nan._replace(values=np.full((30, 3), np.nan))
    parts = [
        ("a start", samples_of(record, 0, 1000)),
        ("silence of a second and a half", samples_of(record, 1000, 1000, 1.5)),
        ("a burst of old stamps", samples_of(record, 1500, 8, 1.5)),
        ("as before", samples_of(record, 2000, 2000, 1.5)),
        ("thirty times not a number", nan._replace(stamps_ns=nan.stamps_ns + int(1.5e9))),
        ("as before", samples_of(record, 4030, 970, 1.5)),
        ("clock an hour forward", samples_of(record, 5000, 1000, 3600.0)),
        ("clock two hours back", samples_of(record, 6000, 1000, -3600.0)),
        ("another publisher", samples_of(record, 7000, 1000, -3600.0)),
    ]
    offline = Corrector(SensorModel.load(model_file), RATE_HZ)
    expected = [offline.process(*samples[:3]) for _, samples in parts]
    with running(model_file, sample_rate_hz=RATE_HZ) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        count = 0
        for (name, samples), of_part in zip(parts, expected):
            if name.startswith("silence"):
                time.sleep(1.5)
            if name == "another publisher":
                probe.node.destroy_publisher(publisher)
                publisher = probe.publisher(Imu, "/imu/data_raw")
            publish([(publisher, encoded(samples))], RATE_HZ)
            count += len(of_part)
            probe.until(lambda count=count: len(received) >= count,
                        lambda name=name, count=count: f"{name}: {len(received)} of {count}")
        assert node.stop() == 0
    live = cdr.read_samples(cdr.IMU, received)
    np.testing.assert_array_equal(live.stamps_ns, np.concatenate([p.stamps_ns for p in expected]))
    np.testing.assert_array_equal(live.values, np.concatenate([p.values for p in expected]))
    np.testing.assert_array_equal(live.variance, np.concatenate([p.variance for p in expected]))
    assert all(offline.design.parameter_uncertainty)
    counters = counters_of(node)
    assert counters.pop("published") == count
    counters.pop("late", None)
    assert counters == {name: number for name, number in offline.counters.items() if number}
    # nothing is given out for longer than the filter takes to be full
    warm_up = offline.design.warm_up_samples
    for (name, samples), of_part in zip(parts, expected):
        if "clock" in name:
            assert len(of_part) >= len(samples.stamps_ns) - warm_up - 11, name


def test_samples_that_share_stamps_get_their_own_and_that_is_said(record, model_file):
    """As a driver publishes that reads a queue of eight; the rate is not stated."""
    samples = samples_of(record, 0, 10_000)
    last = np.minimum(np.arange(10_000) // 8 * 8 + 7, 9999)
    samples = samples._replace(stamps_ns=samples.stamps_ns[last])
    offline = Corrector(SensorModel.load(model_file))
    expected = offline.process(*samples[:3])
    with running(model_file) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        with background(publish, [(publisher, encoded(samples))], RATE_HZ):
            status = probe.status("8 samples at a time share a stamp")
        probe.until(lambda: len(received) >= len(expected), "too few")
        assert node.stop() == 0
    assert status.level == b"\0"
    live = cdr.read_samples(cdr.IMU, received)
    np.testing.assert_array_equal(live.stamps_ns, expected.stamps_ns)
    np.testing.assert_array_equal(live.values, expected.values)
    assert len(expected) > 9900 and np.ptp(np.diff(live.stamps_ns)) <= 2
    assert "is made again" not in node.text


def test_a_subscriber_that_asks_for_too_much_is_named_and_harms_nobody(record, model_file):
    samples = samples_of(record, 0, 1500)
    with running(model_file, sample_rate_hz=RATE_HZ) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        probe.until(lambda: len(probe.statuses) > 2, "no diagnostics")
        assert not any("not delivered" in status.message for status in probe.statuses)
        probe.node.create_subscription(
            Imu, "/imu/data", print,
            QoSProfile(depth=5, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, encoded(samples))], RATE_HZ)
        status = probe.status("not delivered to a subscriber", ever=True)
        assert "/probe (ERROR: Volatile publisher and transient local subscr" in status.message
        expected = Corrector(SensorModel.load(model_file), RATE_HZ).process(*samples[:3])
        probe.until(lambda: len(received) == len(expected), lambda: f"{len(received)} received")


def test_an_estimated_rate_is_followed_when_the_sensor_changes_it(record, model_file):
    fast = samples_of(record, 0, 3000)
    slow_stamps = fast.stamps_ns[-1] + 1_000_000 * np.arange(1, 9001)
    wave = np.sin(2 * np.pi * 50e-3 * np.arange(9000))
    slow = Samples.of(slow_stamps, np.stack([wave] * 3, axis=1), np.full((9000, 3), 1e-4))
    with running(model_file) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, encoded(fast))], RATE_HZ)
        changed_s = time.monotonic()
        with background(publish, [(publisher, encoded(slow))], 1000.0):
            probe.status("correcting at 1000 Hz")
            assert time.monotonic() - changed_s < RATE_CHANGE_S
        time.sleep(0.5)
        assert node.stop() == 0
    counters = counters_of(node)
    assert counters["samples"] == 12_000
    assert counters["samples"] == sum(counters.get(name, 0) for name in (
        "given", "waiting", "warm_up", "cut_off", "duplicates", "stamps_back", "early",
        "not_finite"))
    assert counters["published"] == counters["given"] == len(received)
    last = cdr.read_samples(cdr.IMU, received[-500:])
    np.testing.assert_array_equal(np.diff(last.stamps_ns), 1_000_000)
    steady = Corrector(SensorModel.load(model_file), 1000.0).process(*slow[:3])
    np.testing.assert_array_equal(last.stamps_ns, steady.stamps_ns[-500:])
    np.testing.assert_allclose(last.values, steady.values[-500:], atol=1e-3)


def test_a_killed_node_is_back_when_it_is_started_again(record, model_file):
    messages = encoded(samples_of(record, 0, 9500))
    with running(model_file, sample_rate_hz=RATE_HZ) as (probe, node, environment):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        with background(publish, [(publisher, messages)], 1000.0):
            probe.until(lambda: len(received) > 1000, "nothing corrected")
            node.process.send_signal(signal.SIGKILL)
            node.process.wait()
            time.sleep(0.2)
            before, killed_s = len(received), time.monotonic()
            with NodeProcess("corrector", environment, {
                    "model_file": model_file, "sample_rate_hz": RATE_HZ}):
                probe.until(lambda: len(received) > before, "nothing after the restart")
                assert time.monotonic() - killed_s < RESTART_S
                time.sleep(1.0)
    after = cdr.read_samples(cdr.IMU, received[before:])
    whole = Corrector(SensorModel.load(model_file), RATE_HZ).process(
        *cdr.read_samples(cdr.IMU, messages)[:3])
    place = np.searchsorted(whole.stamps_ns, after.stamps_ns)
    np.testing.assert_array_equal(whole.stamps_ns[place], after.stamps_ns)
    # the long memory of the first start is missing, and the variance says so
    error = np.abs(after.values - whole.values[place])
    assert (error < 4 * np.sqrt(after.variance)).all()
    assert len(after.values) > 500


def test_a_reference_that_stops_is_missed_and_taken_up_again(record, model_file):
    reference = encoded(Samples.of(record.stamps_ns, record.reference))
    raw = encoded(samples_of(record, 0, len(record.sensor_stamps_ns)))
    name = "/corrector/metrics/x/corrected/nrmse"
    with running(model_file, sample_rate_hz=RATE_HZ) as (probe, node, _):
        probe.watch(name)
        first = probe.publisher(Imu, "/imu/reference", RELIABLE)
        second = probe.publisher(Imu, "/imu/data_raw")
        publish([(first, reference[:2000]), (second, raw[:2000])], 1000.0)
        publish([(second, raw[2000:6000])], 1000.0)
        probe.status("the reference is lost", ever=True)
        probe.figures[name].clear()
        returned_s = time.monotonic()
        with background(publish, [(first, reference[6000:10_000]), (second, raw[6000:10_000])],
                        1000.0):
            probe.until(lambda: probe.figures[name], "no error after the reference was back")
            assert time.monotonic() - returned_s < REFERENCE_S
    assert np.median(probe.figures[name]) < 0.02


def test_a_rate_other_than_the_stated_one_is_said_and_bridged(record, model_file):
    fast = samples_of(record, 0, 1000)
    wave = np.sin(2 * np.pi * 50e-3 * np.arange(8000))
    slow = Samples.of(fast.stamps_ns[-1] + 1_000_000 * np.arange(1, 8001),
                      np.stack([wave] * 3, axis=1), np.full((8000, 3), 1e-4))
    offline = Corrector(SensorModel.load(model_file), RATE_HZ)
    expected = [offline.process(*samples[:3]) for samples in (fast, slow)]
    with running(model_file, sample_rate_hz=RATE_HZ) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, encoded(fast))], RATE_HZ)
        with background(publish, [(publisher, encoded(slow))], 1000.0):
            probe.status("sample_rate_hz is 2000")
        probe.until(lambda: len(received) == sum(map(len, expected)), "not all came")
        assert node.stop() == 0
    counters = counters_of(node)
    assert counters["gaps"] == offline.counters["gaps"] > 7900
    np.testing.assert_array_equal(cdr.read_samples(cdr.IMU, received).values,
                                  np.concatenate([part.values for part in expected]))


def test_overload_is_counted_message_by_message(record, model_file):
    """The node stands still for a second, with a queue for a tenth of that."""
    sent = samples_of(record, 0, 9000)
    with running(model_file, sample_rate_hz=RATE_HZ, depth=200) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        with background(publish, [(publisher, encoded(sent))], RATE_HZ):
            probe.until(lambda: len(received) > 2000, "nothing corrected")
            node.process.send_signal(signal.SIGSTOP)
            time.sleep(1.0)
            node.process.send_signal(signal.SIGCONT)
            status = probe.status("lost")
        last_ns = sent.stamps_ns[-1] - 10_000_000
        probe.until(lambda: cdr.read_header(received[-1]).stamp_ns > last_ns, "no end")
        time.sleep(0.3)
        assert node.stop() == 0
    counters = counters_of(node)
    assert counters["lost"] > 500, status.message
    assert counters["samples"] + counters["lost"] == 9000
    assert counters["published"] == counters["given"] == len(received)
    # valid again: the last second is that of a stream without a fault
    last = cdr.read_samples(cdr.IMU, received[-1000:])
    whole = Corrector(SensorModel.load(model_file), RATE_HZ).process(*sent[:3])
    np.testing.assert_array_equal(last.stamps_ns, whole.stamps_ns[-1000:])
    error = np.abs(last.values - whole.values[-1000:])
    assert (error < 4 * np.sqrt(last.variance)).all()


def test_what_waits_for_its_filter_is_late_and_not_lost(record, model_file, tmp_path):
    """A design with hundreds of draws of the parameters, at a rate that had to be estimated."""
    document = yaml.safe_load(model_file.read_text())
    std = 0.08 * document["core"]["natural_frequency_hz"]
    document["covariance"] = {"parameters": ["natural_frequency_hz"], "matrix": [[std**2]]}
    slow_file = tmp_path / "slow.yaml"
    slow_file.write_text(yaml.safe_dump(document))
    samples = samples_of(record, 0, 3000)
    offline = Corrector(SensorModel.load(slow_file))
    expected = offline.process(*samples[:3])
    assert offline.design.parameter_uncertainty[0].method == "Monte Carlo"
    with running(slow_file) as (probe, node, _):
        received = probe.collect(Imu, "/imu/data")
        publisher = probe.publisher(Imu, "/imu/data_raw")
        publish([(publisher, encoded(samples))], RATE_HZ)
        probe.until(lambda: len(received) == len(expected), lambda: f"{len(received)} received")
        assert node.stop() == 0
    counters = counters_of(node)
    assert 0 < counters["late"] < 3000
    assert "lost" not in counters
    np.testing.assert_array_equal(cdr.read_samples(cdr.IMU, received).values, expected.values)
