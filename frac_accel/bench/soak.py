"""The corrector for minutes on end: python -m frac_accel.bench.soak --help.

Nothing may be lost and the memory must not grow; the picture shows both, and the latencies.
"""

import argparse
import json
import sys
import tempfile
import time

import numpy as np

from ..shown import above
from . import machine, passage

# The first part of the run fills windows and queues, and is no growth.
_SETTLED = 0.25
_MOST_GROWTH_MB = 5.0

# Time [s] by the stamps that a publisher is away for: some of it is bridged, some is not.
_AWAY_S = (1e-3, 1.0)
# The rest of the time between two publishers, the second one's process starts.
_SENDING = 0.6
# What a message may have come to by the diagnostics' counters, and a sample.
_FATES = ("samples", "malformed", "lost", "other_publisher", "without_filter")
_TOLD = ("given", "warm_up", "cut_off", "waiting", "gaps", "filled", "restarts", "late")


def main(arguments=None):
    """Run it; exit status 1 where something was lost or the memory has grown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=5000.0, metavar="HZ")
    parser.add_argument("--restart", type=float, metavar="S",
                        help="a new publisher every so many seconds")
    parser.add_argument("--picture", default="soak.png", metavar="FILE")
    parser.add_argument("--json", metavar="FILE")
    chosen = parser.parse_args(arguments)
    memory_mb = []
    with tempfile.TemporaryDirectory() as folder:
        model_file, design = passage.write_model(folder, chosen.rate)
        command = passage.corrector_command(model_file, chosen.rate)
        run = _with_restarts if chosen.restart else _in_one_go
        found, latencies_ms = run(command, chosen, design, memory_mb.append)
    settled = np.array(memory_mb[int(_SETTLED * len(memory_mb)):])
    growth_mb = float(np.median(settled[-len(settled) // 5:])
                      - np.median(settled[:len(settled) // 5 + 1]))
    p50, p99, most = np.percentile(latencies_ms, (50, 99, 100))
    result = {"minutes": chosen.minutes, "rate_hz": chosen.rate, **found,
              "memory_mb": float(settled[-1]), "growth_mb": growth_mb,
              "latency_p50_ms": float(p50), "latency_p99_ms": float(p99),
              "latency_max_ms": float(most)}
    for name, value in result.items():
        print(f"{name:22} {value:.10g}")
    _draw(chosen.picture, result, memory_mb, latencies_ms)
    if chosen.json:
        with open(chosen.json, "w", encoding="utf-8") as stream:
            json.dump(result, stream, indent=1)
    lost = any(result.get(name) for name in ("lost", "uncounted", "undelivered"))
    return 1 if lost or growth_mb > _MOST_GROWTH_MB else 0


def _in_one_go(command, chosen, design, watch):
    found = passage.pass_through(command, chosen.rate, 60 * chosen.minutes, design, watch=watch)
    return {"sent": found.sent, "lost": found.lost, "cpu_us_per_message": found.cpu_us,
            "cores_busy_elsewhere": found.busy_elsewhere}, found.latencies_ms


def _with_restarts(command, chosen, design, watch):
    """What came of messages whose publisher ends again and again.

    Each publisher is a process of its own. The stamps go on where the last one ended, after a
    random time within `_AWAY_S`.
    """
    random = np.random.default_rng(0)
    count, first, sent_at = int(_SENDING * chosen.restart * chosen.rate), 0, []
    begun = [-np.inf]
    with passage.node_and_sink(command, chosen.rate) as (node, start_publisher, stop_sink):
        cpu_s = machine.cpu_time_s(node.pid)
        end = time.monotonic() + 60 * chosen.minutes
        while time.monotonic() < end:
            source, sent_file = start_publisher(first, count, begun[-1] + chosen.restart)
            begun.append(time.monotonic())
            while source.poll() is None:
                time.sleep(1.0)
                watch(machine.memory_mb(node.pid))
            instants = np.load(sent_file)
            sent_at.append(np.stack([np.arange(first, first + count), instants]))
            first += count + int(chosen.rate * np.exp(random.uniform(*np.log(_AWAY_S))))
        cpu_s = machine.cpu_time_s(node.pid) - cpu_s
        stamps, arrivals, counters = stop_sink()
    numbers, instants = np.concatenate(sent_at, axis=1)
    index = np.round((stamps + design.sensor_delay_ns - passage.START_NS) * 1e-9 * chosen.rate)
    at = np.searchsorted(numbers, index.astype(np.int64) + design.delay_samples)
    # those after which a publisher ended were given out when the next one came
    known = at < len(numbers)
    known[known] &= numbers[at[known]] == index[known] + design.delay_samples
    counted = {name: int(counters[name]) for name in (*_FATES, *_TOLD)}
    uncounted = len(numbers) - sum(counted[name] for name in _FATES)
    undelivered = int(counters["published"]) - len(stamps)
    every = np.diff(begun[1:])
    return {"publishers": len(sent_at), "restart_median_s": float(np.median(every)),
            "restart_max_s": float(every.max()), "sent": len(numbers),
            "uncounted": uncounted,
            "undelivered": undelivered, **counted,
            "cpu_us_per_message": 1e6 * cpu_s / len(numbers)}, (
                1e-6 * (arrivals[known] - instants[at[known]]))


def _draw(path, result, memory_mb, latencies_ms):
    from matplotlib.figure import Figure
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    edges = np.geomspace(max(latencies_ms.min(), 1e-2), latencies_ms.max(), 120)
    left.hist(latencies_ms, edges, color="#35618f")
    left.set(xscale="log", yscale="log", xlabel="latency [ms]", ylabel="messages")
    left.set_title(f"{result['sent']:,} sent, {result['lost']} lost", pad=20)
    for name, style in (("p50", "--"), ("p99", ":")):
        left.axvline(result[f"latency_{name}_ms"], color="black", linestyle=style, label=name)
    above(left)
    right.plot(np.arange(len(memory_mb)) / len(memory_mb) * result["minutes"], memory_mb,
               color="#35618f")
    right.set(xlabel="time [min]", ylabel="resident memory [MB]", ylim=(0, 1.2 * max(memory_mb)),
              title=f"{result['rate_hz']:g} Imu/s, memory grew by {result['growth_mb']:.1f} MB")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
