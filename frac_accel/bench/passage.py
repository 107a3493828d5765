"""Messages through a node over DDS: lost, latency and processor time, beside relays.

Publisher, node and sink are three processes. Latency is from the sending of the message that lets
an output be made (for a filter with a delay of d samples, d after the one that it belongs to) to
its arrival in the sink: what the node adds, since the filter's own delay is stated by its design.
"""

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from ..errors import FracAccelError
from ..model import SensorModel
from ..nodes._bench_stamps import START_NS
from ..streaming import Corrector
from . import machine

ROOT = Path(__file__).resolve().parents[2]
_WARM_UP_S = 1.0


@dataclasses.dataclass(frozen=True)
class Passage:
    """What came of messages sent through a node.

    Attributes
    ----------
    sent, lost : int
        Samples; those of the filter's warm-up and delay count as neither.
    cpu_us : float
        Processor time of the node per message handled [µs].
    p50_ms, p99_ms, max_ms : float
        Latency [ms].
    busy_elsewhere : float
        Processor time of everything else on the machine, in cores.
    latencies_ms : ndarray, shape (sent - lost,)
    """

    sent: int
    lost: int
    cpu_us: float
    p50_ms: float
    p99_ms: float
    max_ms: float
    busy_elsewhere: float
    latencies_ms: np.ndarray


def model_document(rate_hz, share=0.15):
    """A sensor whose inverse has a long fractional memory, with uncertain parameters.

    Its natural frequency is a share of the sampling rate.
    """
    core = {"natural_frequency_hz": share * rate_hz, "damping_ratio": 0.2, "damping_order": 0.6,
            "sensitivity": 1.0}
    std = {"natural_frequency_hz": 0.01, "damping_ratio": 0.05, "damping_order": 0.02,
           "sensitivity": 0.002}
    return {"schema": "frac_accel/sensor_model/1", "core": core,
            "covariance": {"parameters": list(core),
                           "matrix": np.diag([(std[name] * value)**2
                                              for name, value in core.items()]).tolist()}}


def corrector_command(model_file, rate_hz):
    """Command line of the corrector."""
    return [sys.executable, "-m", "frac_accel.nodes.corrector", "--ros-args",
            "-p", f"model_file:={model_file}", "-p", f"sample_rate_hz:={float(rate_hz)}",
            "-p", "depth:=20000",
            "-p", "qos_overrides./imu/data_raw.subscription.reliability:=reliable",
            "-p", "qos_overrides./accel/blocks_raw.subscription.reliability:=reliable"]


def relay_command(name):
    """Command line of a relay."""
    return [sys.executable, "-m", "frac_accel.nodes._bench_relays", name]


def pass_through(command, rate_hz, duration_s, design=None, kind="imu", block=1, watch=None):
    """`Passage` of samples at a rate through the node of a command.

    Parameters
    ----------
    command : list of str
    rate_hz : float
        Samples per second.
    duration_s : float
    design : FilterDesign, optional
        Of the filter in the node; none for a relay.
    kind : str
        ``imu`` or ``blocks``.
    block : int
        Samples in each message.
    watch : callable, optional
        Called about every second with the resident memory [MB] of the node.
    """
    count = int(round((duration_s + _WARM_UP_S) * rate_hz / block)) * block
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        node = stack.enter_context(process_of(command, subprocess.DEVNULL))
        sent_file, seen_file = (str(Path(folder) / name) for name in ("sent.npy", "seen.npy"))
        options = ["--kind", kind, "--rate", str(rate_hz), "--count", str(count), "--block",
                   str(block)]
        sink, source = (stack.enter_context(_traffic(role, file, *options))
                        for role, file in (("receive", seen_file), ("publish", sent_file)))
        for process in (sink, source):
            await_ready(process, command)
        tell(sink)
        time.sleep(1.0)
        tell(source)
        time.sleep(_WARM_UP_S)
        cpu_s = machine.cpu_time_s(node.pid)
        load = machine.Load([node.pid, sink.pid, source.pid])
        while source.poll() is None:
            time.sleep(min(1.0, duration_s / 10))
            load.update()
            if watch:
                watch(machine.memory_mb(node.pid))
        until_quiet(node.pid)
        cpu_s = machine.cpu_time_s(node.pid) - cpu_s
        elsewhere = load.elsewhere
        tell(sink)
        sink.wait(60)
        sent, (stamps, arrivals) = np.load(sent_file), np.load(seen_file)
    return passage_of(sent, stamps, arrivals, rate_hz, block, design, cpu_s, elsewhere)


@contextlib.contextmanager
def node_and_sink(command, rate_hz):
    """A corrector and its sink, for publishers that come and go.

    Yields
    ------
    node : subprocess.Popen
    start_publisher : callable
        Starts a publisher of so many samples from a number on, not before an instant [s] of the
        monotonic clock; returns its process and the file that will hold the instants [ns] of
        sending.
    stop_sink : callable
        Stamps and instants [ns] of arrival of all that came, and the last values of its
        diagnostics, dict of str to str.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        node = stack.enter_context(process_of(command, subprocess.DEVNULL))
        seen_file, sent_file, counters_file = (str(Path(folder) / name) for name in (
            "seen.npy", "sent.npy", "counters.json"))
        sink = stack.enter_context(_traffic("receive", seen_file, "--counters", counters_file))
        await_ready(sink, command)
        tell(sink)
        past = contextlib.ExitStack()
        stack.enter_context(past)

        def start_publisher(first, count, not_before):
            past.close()
            source = past.enter_context(_traffic(
                "publish", sent_file, "--rate", str(rate_hz), "--count", str(count), "--first",
                str(first)))
            await_ready(source, command)
            time.sleep(max(0.0, not_before - time.monotonic()))
            tell(source)
            return source, sent_file

        def stop_sink():
            # the diagnostics come once a second
            time.sleep(3.0)
            tell(sink)
            sink.wait(60)
            values = next(iter(json.loads(Path(counters_file).read_text()).values()))
            return *np.load(seen_file), values

        yield node, start_publisher, stop_sink


def passage_of(sent, stamps, arrivals, rate_hz, block, design, cpu_s, elsewhere):
    """`Passage` by the instants [ns] of sending and of arrival, these with the stamps of outputs.
    """
    delay, warm_up = (design.delay_samples, design.warm_up_samples) if design else (0, 0)
    sensor_delay_ns = design.sensor_delay_ns if design else 0
    count = len(sent) * block
    index = np.round((stamps + sensor_delay_ns - START_NS) * 1e-9 * rate_hz).astype(np.int64)
    index, first = np.unique(index, return_index=True)
    # the first second is left out: the processes are still finding each other
    settled = int(_WARM_UP_S * rate_hz)
    judged = (index >= settled) & (index < count - delay)
    trigger = (index[judged] + delay) // block
    latency_ms = 1e-6 * (arrivals[first][judged] - sent[trigger])
    should = count - delay - max(settled, warm_up - delay)
    lost = should - len(latency_ms)
    handled = max(len(latency_ms) // block, 1)
    p50, p99, most = np.percentile(latency_ms, (50, 99, 100)) if len(latency_ms) else [np.nan] * 3
    return Passage(should, lost, 1e6 * cpu_s / handled, p50, p99, most, elsewhere, latency_ms)


def seconds_to_first_output(model_file, rate_hz):
    """From the start of the corrector's process to its first output [s].

    The messages are coming already, as those of a sensor are.
    """
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        seen_file = str(Path(folder) / "seen.npy")
        options = ["--rate", str(rate_hz), "--count", str(int(8 * rate_hz)), "--alone"]
        sink = stack.enter_context(_traffic("receive", seen_file, *options))
        source = stack.enter_context(
            _traffic("publish", str(Path(folder) / "sent.npy"), *options))
        for process in (sink, source):
            await_ready(process, ["publisher and sink"])
            tell(process)
        time.sleep(1.0)
        start_ns = time.time_ns()
        stack.enter_context(process_of(corrector_command(model_file, rate_hz),
                                       subprocess.DEVNULL))
        source.wait(60)
        time.sleep(0.5)
        tell(sink)
        sink.wait(60)
        arrivals = np.load(seen_file)[1]
    if not len(arrivals):
        raise FracAccelError("the corrector has given nothing out within 7 s")
    return 1e-9 * (arrivals.min() - start_ns)


def write_model(folder, rate_hz):
    """File with `model_document`, and the corrector's design for it."""
    path = Path(folder) / "model.yaml"
    path.write_text(yaml.safe_dump(model_document(rate_hz)))
    return path, Corrector(SensorModel.load(path), rate_hz).design


def until_quiet(pid):
    """Wait until a process has no more to do."""
    while True:
        before = machine.cpu_time_s(pid)
        time.sleep(0.3)
        if machine.cpu_time_s(pid) - before < 0.1:
            return


def _traffic(role, file, *options):
    return process_of([sys.executable, "-m", "frac_accel.nodes._bench_traffic", role, file,
                       *options], subprocess.PIPE)


def await_ready(process, command):
    """Wait until a publisher or a sink has found the node of a command."""
    if process.stdout.readline().strip() != "ready":
        raise FracAccelError("the processes of the benchmark did not find each other: "
                             + " ".join(command))


def tell(process):
    """Let a publisher or a sink begin, or the latter end."""
    process.stdin.write("\n")
    process.stdin.flush()


@contextlib.contextmanager
def process_of(command, pipe):
    """A process of a benchmark, as long as it is entered."""
    process = subprocess.Popen(command, env=_environment(), cwd=tempfile.gettempdir(), text=True,
                               stdin=pipe, stdout=pipe)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream:
                stream.close()


def _environment():
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    profile = ROOT / "config" / "fastdds_discovery.xml"
    discovery = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)} if profile.is_file() else {}
    # a domain of its own, beyond those that anybody sets by hand and below the ephemeral ports
    # nothing is imported from the folder for temporary files, where anybody may write
    return {**discovery, **os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(80 + os.getpid() % 20)}
