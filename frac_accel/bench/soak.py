"""The corrector for minutes on end: python -m frac_accel.bench.soak --help.

Nothing may be lost and the memory must not grow; the picture shows both, and the latencies.
"""

import argparse
import json
import sys
import tempfile

import numpy as np

from .live import corrector_command, pass_through, write_model

# The first part of the run fills windows and queues, and is no growth.
_SETTLED = 0.25
_MOST_GROWTH_MB = 5.0


def main(arguments=None):
    """Run it; exit status 1 where something was lost or the memory has grown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=5000.0, metavar="HZ")
    parser.add_argument("--picture", default="soak.png", metavar="FILE")
    parser.add_argument("--json", metavar="FILE")
    chosen = parser.parse_args(arguments)
    memory_mb = []
    with tempfile.TemporaryDirectory() as folder:
        model_file, design = write_model(folder, chosen.rate)
        passage = pass_through(corrector_command(model_file, chosen.rate), chosen.rate,
                               60 * chosen.minutes, design, watch=memory_mb.append)
    settled = np.array(memory_mb[int(_SETTLED * len(memory_mb)):])
    growth_mb = float(np.median(settled[-len(settled) // 5:])
                      - np.median(settled[:len(settled) // 5 + 1]))
    result = {"minutes": chosen.minutes, "rate_hz": chosen.rate, "sent": passage.sent,
              "lost": passage.lost, "memory_mb": float(settled[-1]), "growth_mb": growth_mb,
              "cpu_us_per_message": passage.cpu_us, "latency_p50_ms": float(passage.p50_ms),
              "latency_p99_ms": float(passage.p99_ms), "latency_max_ms": float(passage.max_ms),
              "cores_busy_elsewhere": passage.busy_elsewhere}
    for name, value in result.items():
        print(f"{name:22} {value:.6g}")
    _draw(chosen.picture, result, memory_mb, passage.latencies_ms)
    if chosen.json:
        with open(chosen.json, "w", encoding="utf-8") as stream:
            json.dump(result, stream, indent=1)
    return 1 if passage.lost or growth_mb > _MOST_GROWTH_MB else 0


def _draw(path, result, memory_mb, latencies_ms):
    from matplotlib.figure import Figure
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    edges = np.geomspace(max(latencies_ms.min(), 1e-2), latencies_ms.max(), 120)
    left.hist(latencies_ms, edges, color="#35618f")
    left.set(xscale="log", yscale="log", xlabel="latency [ms]", ylabel="messages",
             title=f"{result['sent']:,} sent, {result['lost']} lost")
    for name, style in (("p50", "--"), ("p99", ":")):
        left.axvline(result[f"latency_{name}_ms"], color="black", linestyle=style, label=name)
    left.legend()
    right.plot(np.arange(len(memory_mb)) / len(memory_mb) * result["minutes"], memory_mb,
               color="#35618f")
    right.set(xlabel="time [min]", ylabel="resident memory [MB]", ylim=(0, 1.2 * max(memory_mb)),
              title=f"{result['rate_hz']:g} Imu/s, memory grew by {result['growth_mb']:.1f} MB")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
