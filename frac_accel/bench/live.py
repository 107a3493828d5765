"""Figures of the corrector over DDS, beside relays; what a passage is, `passage` says."""

import tempfile

import numpy as np

from .figures import Figure
from .passage import (
    corrector_command,
    pass_through,
    relay_command,
    seconds_to_first_output,
    write_model,
)

PEERS = {"typed": "typed callback, default executor",
         "typed_filter": "the same with sosfilt of order 10, one sample at a time",
         "raw": "raw callback, EventsExecutor",
         "raw_drained": "raw callback that drains its queue, default executor"}


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
