"""Messages per second through the corrector node, beside a node as everyone writes it.

Both run the same kernel on the same ``sensor_msgs/Imu`` messages over DDS, in a process of their
own. The other node has a typed callback on the default executor that corrects one sample at a
time. ``python benchmarks/node_throughput.py`` prints a row for each rate up to
the first that is not sustained.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import Imu

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from frac_accel import cdr  # noqa: E402
from frac_accel.correction import Corrector  # noqa: E402
from frac_accel.model import SensorModel  # noqa: E402
from frac_accel.nodes._runtime import RawSubscription  # noqa: E402
from frac_accel.samples import Samples  # noqa: E402

MODEL = ROOT / "config" / "models" / "classical.yaml"
RATES_HZ = (500, 1000, 2000, 5000, 10_000, 20_000)
DURATION_S = 4.0
DEPTH = 20_000
QOS = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
_DOMAIN = {"ROS_DOMAIN_ID": "93", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--typed-node", type=float, help=argparse.SUPPRESS)
    rate_hz = parser.parse_args().typed_node
    if rate_hz:
        run_typed_node(rate_hz)
        return
    os.environ.update(_DOMAIN)
    rclpy.init()
    print("rate [1/s]  node       lost [%]  CPU per message [us]  latency p50 / p99 [ms]")
    results = {}
    for name in ("typed", "frac_accel"):
        for rate_hz in RATES_HZ:
            results[name, rate_hz] = lost, cpu_us, latency_ms = measure(name, rate_hz)
            print(f"{rate_hz:10d}  {name:10s} {100 * lost:8.2f}  {cpu_us:20.0f}  "
                  f"{latency_ms[0]:10.1f} / {latency_ms[1]:.1f}", flush=True)
            if not sustained(lost, latency_ms):
                break
    rclpy.shutdown()
    best = {name: max((rate for (who, rate), (lost, _, latency_ms) in results.items()
                       if who == name and sustained(lost, latency_ms)), default=0)
            for name in ("typed", "frac_accel")}
    common = max((rate for rate in RATES_HZ
                  if all((name, rate) in results for name in best)), default=None)
    print(f"sustained: typed {best['typed']}/s, frac_accel {best['frac_accel']}/s")
    print(f"CPU at {common}/s, typed over frac_accel: "
          f"{results['typed', common][1] / results['frac_accel', common][1]:.1f}")


def sustained(lost, latency_ms):
    """Whether hardly a message was lost and no queue grew."""
    return lost <= 1e-3 and latency_ms[1] < 250


def measure(name, rate_hz):
    """Share of messages lost, CPU per message [us], latency percentiles (50, 99) [ms]."""
    count = int(rate_hz * DURATION_S)
    stamps = 1_700_000_000 * 10**9 + np.round(np.arange(count) / rate_hz * 1e9).astype(np.int64)
    values = np.random.default_rng(0).standard_normal((count, 3))
    messages = cdr.encode_samples(cdr.IMU, Samples.of(stamps, values, np.full((count, 3), 1e-4)))
    corrector = Corrector(SensorModel.load(MODEL), float(rate_hz))
    expected = corrector.process(stamps, values)
    node = Node("driver")
    received, arrivals, sent = [], [], np.zeros(count)

    def on_batch(batch):
        received.extend(message.data for message in batch)
        arrivals.extend(message.received_time_ns for message in batch)

    RawSubscription(node, Imu, "imu/data", on_batch, QOS)
    publisher = node.create_publisher(Imu, "imu/data_raw", QOS)
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    stop = threading.Event()
    thread = threading.Thread(target=lambda: [executor.spin_once(timeout_sec=0.05)
                                              for _ in iter(stop.is_set, True)])
    thread.start()
    process = start(name, rate_hz)
    try:
        while not (publisher.get_subscription_count() and node.count_publishers("imu/data")):
            time.sleep(0.05)
        time.sleep(1.5)
        cpu_s = cpu_time_s(process.pid)
        begin = time.monotonic()
        for i, message in enumerate(messages):
            left = begin + i / rate_hz - time.monotonic()
            if left > 5e-4:
                time.sleep(left)
            sent[i] = time.time_ns()
            publisher.publish(message)
        last = -1
        while len(received) < len(expected) and last != len(received):
            last = len(received)
            time.sleep(1.0)
        cpu_us = 1e6 * (cpu_time_s(process.pid) - cpu_s) / count
    finally:
        process.kill()
        process.wait()
        stop.set()
        thread.join()
        executor.shutdown()
        node.destroy_node()
    if not received:
        return 1.0, cpu_us, (np.nan, np.nan)
    found = cdr.read_samples(cdr.IMU, received).stamps_ns + corrector.design.sensor_delay_ns
    index = np.searchsorted(stamps, found)
    # from the sending of the sample that an output belongs to: the filter's delay is included
    latency_ms = 1e-6 * (np.array(arrivals) - sent[np.minimum(index, count - 1)])
    lost = 1 - len(np.intersect1d(found, stamps)) / len(expected)
    return lost, cpu_us, np.percentile(latency_ms, (50, 99))


def start(name, rate_hz):
    """Process of one of the two nodes."""
    if name == "typed":
        command = [sys.executable, __file__, "--typed-node", str(rate_hz)]
    else:
        command = [sys.executable, "-m", "frac_accel.nodes.corrector", "--ros-args",
                   "-p", f"model_file:={MODEL}", "-p", f"sample_rate_hz:={float(rate_hz)}",
                   "-p", f"depth:={DEPTH}"]
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path, **_DOMAIN},
                            cwd=tempfile.gettempdir(), stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def cpu_time_s(pid):
    """CPU time that a process has used so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run_typed_node(rate_hz):
    """The node to compare with."""
    rclpy.init()
    node = Node("typed")
    corrector = Corrector(SensorModel.load(MODEL), rate_hz)
    publisher = node.create_publisher(Imu, "imu/data", QOS)
    waiting = {}

    def on_message(message):
        stamp = message.header.stamp
        a = message.linear_acceleration
        waiting[len(waiting)] = message
        out = corrector.process(
            [stamp.sec * 10**9 + stamp.nanosec], [[a.x, a.y, a.z]],
            [[message.linear_acceleration_covariance[i] for i in (0, 4, 8)]])
        for index, stamp_ns, values, variance in zip(out.index.tolist(), out.stamps_ns.tolist(),
                                                     out.values, out.variance):
            message = waiting[index]
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
            message.linear_acceleration.x, message.linear_acceleration.y = values[:2].tolist()
            message.linear_acceleration.z = float(values[2])
            message.linear_acceleration_covariance = np.diag(variance).ravel()
            publisher.publish(message)

    node.create_subscription(
        Imu, "imu/data_raw", on_message,
        QoSProfile(depth=DEPTH, reliability=qos_profile_sensor_data.reliability))
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
