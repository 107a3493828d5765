"""Many sensors in one corrector, beside a relay of all their topics; and a vehicle's rates.

Ratios are taken within a round; see `passage` for how each passage is measured.
"""

import contextlib
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from ..errors import FracAccelError
from . import machine
from .figures import Figure
from .live import PEERS
from .passage import (
    await_ready,
    corrector_command,
    pass_through,
    passage_of,
    process_of,
    relay_command,
    tell,
    until_quiet,
    write_model,
)

RATES_HZ = (100.0, 400.0, 1000.0)
BUDGETS_MS = (0.0, 5.0, 10.0)
# Number of sensors, rate [Hz], and the most cores that they may take.
MANY = ((50, 100.0, 0.5), (8, 1000.0, 0.5))
_MOST_MB = 150
# Beyond the budget [ms].
_MOST_LATE_MS = 5.0
_WARM_UP_S, _SECONDS, _IDLE_S = 3.0, 8.0, 10.0


def pass_through_many(command, count, rate_hz, design=None):
    """What came of some seconds of messages of many sensors through one node.

    Parameters
    ----------
    command : list of str
    count : int
        Sensors.
    rate_hz : float
        Of each.
    design : FilterDesign, optional

    Returns
    -------
    dict of str to float
        ``lost`` samples, ``cores``, ``memory_mb``, ``p50_ms``, ``p99_ms`` and ``elsewhere``, the
        cores that were busy with something else.
    """
    samples = int((_WARM_UP_S + _SECONDS) * rate_hz)
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        node = stack.enter_context(process_of(command, subprocess.DEVNULL))
        files = {role: str(Path(folder) / f"{role}.npy") for role in ("receive", "publish")}
        sink, source = (stack.enter_context(process_of(
            [sys.executable, "-m", "frac_accel.nodes._bench_sensors", role, file, "--sensors",
             str(count), "--rate", str(rate_hz), "--count", str(samples)],
            subprocess.PIPE)) for role, file in files.items())
        for process in (sink, source):
            await_ready(process, command)
            tell(process)
        time.sleep(_WARM_UP_S)
        cpu_s, start_s = machine.cpu_time_s(node.pid), time.monotonic()
        load = machine.Load([node.pid, sink.pid, source.pid])
        time.sleep(_SECONDS - 1)
        cores = (machine.cpu_time_s(node.pid) - cpu_s) / (time.monotonic() - start_s)
        load.update()
        memory_mb = machine.most_memory_mb(node.pid)
        source.wait(120)
        until_quiet(node.pid)
        tell(sink)
        sink.wait(60)
        sent, (sensors, stamps, arrivals) = np.load(files["publish"]), np.load(files["receive"])
    passages = [passage_of(sent[i], stamps[sensors == i], arrivals[sensors == i], rate_hz, 1,
                           design, 0.0, 0.0) for i in range(count)]
    latencies = np.concatenate([one.latencies_ms for one in passages])
    return {"lost": sum(one.lost for one in passages), "cores": cores, "memory_mb": memory_mb,
            "p50_ms": float(np.median(latencies)), "p99_ms": float(np.percentile(latencies, 99)),
            "elsewhere": load.elsewhere}


def many_command(folder, model_file, count, rate_hz, budget_ms):
    """Command line of a corrector of many sensors, of which a file in the folder has the list."""
    parameters = {
        "sensors": [f"s{i}" for i in range(count)], "model_file": str(model_file),
        "sample_rate_hz": rate_hz, "latency_budget_ms": budget_ms,
        "qos_overrides": {f"/s{i}/imu/data_raw": {"subscription": {"reliability": "reliable"}}
                          for i in range(count)}}
    file = Path(folder) / "sensors.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
    return [sys.executable, "-m", "frac_accel.nodes.corrector", "--ros-args", "--params-file",
            str(file)]


def idle_cores(command):
    """Share of a core that a node takes without any message."""
    with process_of(command, subprocess.DEVNULL) as node:
        time.sleep(4.0)
        cpu_s, start_s = machine.cpu_time_s(node.pid), time.monotonic()
        time.sleep(_IDLE_S)
        if node.poll() is not None:
            raise FracAccelError("the corrector has ended")
        return (machine.cpu_time_s(node.pid) - cpu_s) / (time.monotonic() - start_s)


def run(rounds):
    """Figures; rounds of all nodes in turn, medians of them."""
    ratios, latencies, costs, many, idle, lost = {}, {}, {}, {}, [], 0
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(rounds):
            for rate_hz in RATES_HZ:
                model_file, design = write_model(folder, rate_hz)
                relays = {name: pass_through(relay_command(name), rate_hz, 4.0)
                          for name in ("typed", "raw")}
                costs.setdefault(("raw", rate_hz), []).append(
                    relays["raw"].cpu_us / relays["typed"].cpu_us)
                for budget_ms in BUDGETS_MS:
                    one = pass_through([*corrector_command(model_file, rate_hz), "-p",
                                        f"latency_budget_ms:={budget_ms}"], rate_hz, 4.0, design)
                    case = rate_hz, budget_ms
                    ratios.setdefault(case, []).append(one.cpu_us / relays["typed"].cpu_us)
                    latencies.setdefault(case, []).append(one.p99_ms)
                    lost += one.lost
            for count, rate_hz, _ in MANY:
                model_file, design = write_model(folder, rate_hz)
                many.setdefault((count, rate_hz), []).append(pass_through_many(
                    many_command(folder, model_file, count, rate_hz, 5.0), count, rate_hz, design))
                many.setdefault((count, rate_hz, "typed"), []).append(pass_through_many(
                    [*relay_command("typed"), str(count)], count, rate_hz))
            idle.append(idle_cores(corrector_command(model_file, 100.0)))
    return _figures(ratios, latencies, costs, many, idle, lost)


def _figures(ratios, latencies, costs, many, idle, lost):
    suite = "sensors"
    figures = [Figure(suite, "one sensor: lost", lost, "", most=0)]
    for (rate_hz, budget_ms), values in ratios.items():
        name = f"{rate_hz:.0f} Imu/s, budget {budget_ms:g} ms"
        figures += [Figure(suite, f"{name}: processor time over the typed relay's",
                           float(np.median(values)), "", most=0.25 if budget_ms else 0.5,
                           peer=PEERS["typed"]),
                    Figure(suite, f"{name}: latency p99",
                           float(np.median(latencies[rate_hz, budget_ms])), "ms")]
    figures += [Figure(suite, f"{rate_hz:.0f} Imu/s: raw relay's processor time over the typed "
                              "relay's", float(np.median(values)), "", peer=PEERS[name])
                for (name, rate_hz), values in costs.items()]
    for count, rate_hz, most in MANY:
        ours, theirs = many[count, rate_hz], many[count, rate_hz, "typed"]

        def median(key, of):
            return float(np.median([one[key] for one in of]))

        name = f"{count} sensors at {rate_hz:.0f} Hz"
        figures += [
            Figure(suite, f"{name}: lost", sum(one["lost"] for one in ours), "", most=0),
            Figure(suite, f"{name}: cores", median("cores", ours), "", most=most),
            Figure(suite, f"{name}: cores of a typed relay of all", median("cores", theirs), "",
                   peer=PEERS["typed"]),
            Figure(suite, f"{name}: largest memory", median("memory_mb", ours), "MB",
                   most=_MOST_MB),
            Figure(suite, f"{name}: latency p50", median("p50_ms", ours), "ms"),
            Figure(suite, f"{name}: latency p99", median("p99_ms", ours), "ms",
                   most=5.0 + _MOST_LATE_MS),
            Figure(suite, f"{name}: latency p99 of a typed relay of all", median("p99_ms", theirs),
                   "ms", peer=PEERS["typed"]),
            Figure(suite, f"{name}: cores busy with something else", median("elsewhere", ours), "")]
    figures.append(Figure(suite, "idle corrector: share of a core", float(np.median(idle)), "",
                          most=0.005))
    return figures
