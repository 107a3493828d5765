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
from .figures import Figure

_ROOT = Path(__file__).resolve().parents[2]
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
        environment = _environment()
        node = stack.enter_context(_process(command, environment, subprocess.DEVNULL))
        sent_file, seen_file = (str(Path(folder) / name) for name in ("sent.npy", "seen.npy"))
        options = ["--kind", kind, "--rate", str(rate_hz), "--count", str(count), "--block",
                   str(block)]
        sink, source = (stack.enter_context(_traffic(environment, role, file, *options))
                        for role, file in (("receive", seen_file), ("publish", sent_file)))
        for process in (sink, source):
            _await(process, command)
        _tell(sink)
        time.sleep(1.0)
        _tell(source)
        time.sleep(_WARM_UP_S)
        cpu_s = machine.cpu_time_s(node.pid)
        load = machine.Load([node.pid, sink.pid, source.pid])
        while source.poll() is None:
            time.sleep(min(1.0, duration_s / 10))
            load.update()
            if watch:
                watch(machine.memory_mb(node.pid))
        _until_quiet(node.pid)
        cpu_s = machine.cpu_time_s(node.pid) - cpu_s
        elsewhere = load.elsewhere
        _tell(sink)
        sink.wait(60)
        sent, (stamps, arrivals) = np.load(sent_file), np.load(seen_file)
    return _passage(sent, stamps, arrivals, rate_hz, block, design, cpu_s, elsewhere)


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
        environment = _environment()
        node = stack.enter_context(_process(command, environment, subprocess.DEVNULL))
        seen_file, sent_file, counters_file = (str(Path(folder) / name) for name in (
            "seen.npy", "sent.npy", "counters.json"))
        sink = stack.enter_context(_traffic(environment, "receive", seen_file, "--counters",
                                            counters_file))
        _await(sink, command)
        _tell(sink)
        past = contextlib.ExitStack()
        stack.enter_context(past)

        def start_publisher(first, count, not_before):
            past.close()
            source = past.enter_context(_traffic(
                environment, "publish", sent_file, "--rate", str(rate_hz), "--count", str(count),
                "--first", str(first)))
            _await(source, command)
            time.sleep(max(0.0, not_before - time.monotonic()))
            _tell(source)
            return source, sent_file

        def stop_sink():
            # the diagnostics come once a second
            time.sleep(3.0)
            _tell(sink)
            sink.wait(60)
            values = next(iter(json.loads(Path(counters_file).read_text()).values()))
            return *np.load(seen_file), values

        yield node, start_publisher, stop_sink


def _passage(sent, stamps, arrivals, rate_hz, block, design, cpu_s, elsewhere):
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
        environment = _environment()
        seen_file = str(Path(folder) / "seen.npy")
        options = ["--rate", str(rate_hz), "--count", str(int(8 * rate_hz)), "--alone"]
        sink = stack.enter_context(_traffic(environment, "receive", seen_file, *options))
        source = stack.enter_context(
            _traffic(environment, "publish", str(Path(folder) / "sent.npy"), *options))
        for process in (sink, source):
            _await(process, ["publisher and sink"])
            _tell(process)
        time.sleep(1.0)
        start_ns = time.time_ns()
        stack.enter_context(_process(corrector_command(model_file, rate_hz), environment,
                                     subprocess.DEVNULL))
        source.wait(60)
        time.sleep(0.5)
        _tell(sink)
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


def _until_quiet(pid):
    """Wait until a process has no more to do."""
    while True:
        before = machine.cpu_time_s(pid)
        time.sleep(0.3)
        if machine.cpu_time_s(pid) - before < 0.1:
            return


def _traffic(environment, role, file, *options):
    return _process([sys.executable, "-m", "frac_accel.nodes._bench_traffic", role, file, *options],
                    environment, subprocess.PIPE)


def _await(process, command):
    if process.stdout.readline().strip() != "ready":
        raise FracAccelError("the processes of the benchmark did not find each other: "
                             + " ".join(command))


def _tell(process):
    process.stdin.write("\n")
    process.stdin.flush()


@contextlib.contextmanager
def _process(command, environment, pipe):
    process = subprocess.Popen(command, env=environment, cwd=tempfile.gettempdir(), text=True,
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
    path = os.pathsep.join(filter(None, [str(_ROOT), os.environ.get("PYTHONPATH")]))
    profile = _ROOT / "config" / "fastdds_discovery.xml"
    discovery = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)} if profile.is_file() else {}
    # a domain of its own, beyond those that anybody sets by hand and below the ephemeral ports
    # nothing is imported from the folder for temporary files, where anybody may write
    return {**discovery, **os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(80 + os.getpid() % 20)}


def run(rounds):
    """Figures of the corrector over DDS; rounds of all nodes in turn, medians of them."""
    passages, starts = {}, []
    cases = [(name, rate_hz) for rate_hz in (10_000.0, 1000.0)
             for name in ("corrector", "raw", "raw_drained", "typed", "typed_filter")]
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(rounds):
            for name, rate_hz in cases:
                model_file, design = write_model(folder, rate_hz)
                if name == "corrector":
                    # the slower one as it comes; `sensors` has it with a latency budget
                    each = ["-p", "latency_budget_ms:=0.0"] * (rate_hz < 10_000)
                    one = pass_through([*corrector_command(model_file, rate_hz), *each], rate_hz,
                                       5.0, design)
                else:
                    one = pass_through(relay_command(name), rate_hz, 3.0)
                passages.setdefault((name, rate_hz), []).append(one)
            # twice, as the middleware may take its time to discover the node
            starts += [seconds_to_first_output(model_file, 1000.0) for _ in range(2)]
            model_file, design = write_model(folder, 300_000.0)
            passages.setdefault("blocks", []).append(pass_through(
                corrector_command(model_file, 300_000.0), 300_000.0, 3.0, design, "blocks", 300))
    return _figures(passages, starts)


def _figures(passages, starts):
    def median(case, field):
        return float(np.median([getattr(one, field) for one in passages[case]]))

    def ratio(case, *others):
        """Median over the rounds of the processor time over the least of the others'."""
        least = np.min([[one.cpu_us for one in passages[other]] for other in others], axis=0)
        return float(np.median([one.cpu_us for one in passages[case]] / least))

    fast, slow = ("corrector", 10_000.0), ("corrector", 1000.0)
    relays = [(name, 10_000.0) for name in ("raw", "raw_drained")]
    typed = [("typed", rate_hz) for rate_hz in (1000.0, 10_000.0)]
    busy = [one.busy_elsewhere for ones in passages.values() for one in ones]
    figures = [Figure("live", "10 000 Imu/s: lost", sum(one.lost for one in passages[fast]), "",
                      most=0),
               Figure("live", "10 000 Imu/s: latency p50", median(fast, "p50_ms"), "ms"),
               Figure("live", "10 000 Imu/s: latency p99", median(fast, "p99_ms"), "ms", most=10),
               Figure("live", "10 000 Imu/s: processor time per message", median(fast, "cpu_us"),
                      "us")]
    figures += [Figure("live", f"{rate_hz:.0f} Imu/s: processor time per message of relay {name}",
                       median((name, rate_hz), "cpu_us"), "us", peer=PEERS[name])
                for name, rate_hz in (*relays, *typed, ("typed_filter", 1000.0))]
    figures += [
        Figure("live", "10 000 Imu/s: processor time over the cheaper raw relay's",
               ratio(fast, *relays), "", most=1.5, peer=f"{PEERS['raw']}; {PEERS['raw_drained']}"),
        *(Figure("live", f"typed relay's processor time at {rate_hz:.0f}/s over ours at 10000/s",
                 1 / ratio(fast, ("typed", rate_hz)), "", least=8, peer=PEERS["typed"])
          for _, rate_hz in typed),
        Figure("live", "filtering typed node's processor time over ours at 10 000/s",
               1 / ratio(fast, ("typed_filter", 1000.0), ("typed_filter", 10_000.0)), "",
               peer=PEERS["typed_filter"]),
        *(Figure("live", f"{name} at 10 000 Imu/s: share lost",
                 float(np.median([one.lost / one.sent for one in passages[name, 10_000.0]])), "",
                 peer=PEERS[name]) for name in ("typed", "typed_filter")),
        Figure("live", "1000 Imu/s: lost", sum(one.lost for one in passages[slow]), "", most=0),
        Figure("live", "1000 Imu/s: latency p50", median(slow, "p50_ms"), "ms", most=0.5),
        Figure("live", "1000 Imu/s: latency p99", median(slow, "p99_ms"), "ms", most=3),
        Figure("live", "1000 Imu/s: processor time per message", median(slow, "cpu_us"), "us"),
        Figure("live", "PointCloud2, 300 000 samples/s in blocks of 300: lost",
               sum(one.lost for one in passages["blocks"]), "", most=0),
        Figure("live", "PointCloud2: latency p99", median("blocks", "p99_ms"), "ms"),
        Figure("live", "PointCloud2: processor time per sample", median("blocks", "cpu_us") / 300,
               "us"),
        Figure("live", "start of the corrector to its first output, median",
               float(np.median(starts)), "s", most=1.5),
        Figure("live", "start of the corrector to its first output, longest", max(starts), "s",
               most=1.5),
        Figure("live", "cores busy with something else, median", float(np.median(busy)), ""),
        Figure("live", "cores busy with something else, most", max(busy), ""),
    ]
    return figures


PEERS = {"typed": "typed callback, default executor",
         "typed_filter": "the same with sosfilt of order 10, one sample at a time",
         "raw": "raw callback, EventsExecutor",
         "raw_drained": "raw callback that drains its queue, default executor"}
