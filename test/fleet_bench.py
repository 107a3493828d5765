"""Figures of a fleet: ``make bench-fleet``, or ``python -m fleet_bench PART`` beside test/.

``pooling``: how often an effect at a quarter of what a bag can show is found in its lot, and what
is found that is not there. ``workers``: bags with workers killed at random, time and memory.
``restart``: a cluster's scheduler that dies and comes back, and a client that is killed.
"""

import argparse
import collections
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import fleet_rig
import numpy as np
from scipy.stats import binomtest

from frac_accel.fleet.estimates import Estimates
from frac_accel.fleet.groups import groups_of
from frac_accel.fleet.peers import odd_vehicles
from frac_accel.fleet.store import Store
from frac_accel.fleet.weak_effects import weak_effects
from frac_accel.model import SensorModel


def pooling(vehicles, weak, draws, seed):
    """A lot of weak ones among as many vehicles, a cause after the other."""
    rng, model = np.random.default_rng(seed), SensorModel.from_dict(fleet_rig.model())
    causes = list(fleet_rig.CAUSES)
    fleet = [fleet_rig.ScreenedVehicle(
        fleet_rig.vehicle(rng, causes if i < weak else (), 3.0), model) for i in range(vehicles)]
    totals = collections.Counter()
    for draw in range(draws):
        cause = causes[draw % len(causes)]
        size = np.sqrt(30) / 4 / np.median([one.own_part(cause) for one in fleet[:weak]])
        groups = groups_of({
            "lot": ["B" if i < weak else f"A{i % 5}" for i in range(vehicles)],
            "firmware": [f"{v}" for v in rng.integers(1, 6, vehicles)],
            "mileage": [f"{v:.0f}" for v in rng.uniform(1e3, 1e5, vehicles)]}, vehicles)
        estimates = Estimates.of([one.drawn(rng, cause, size) if i < weak else one.drawn(rng)
                                  for i, one in enumerate(fleet)])
        effects, rest = weak_effects(estimates, groups)
        right = [e for e in effects if e.group == "lot = B"
                 and (e.cause == cause or cause in e.confusable_with)]
        totals.update(found=bool(right), first=bool(right) and right[0].cause == cause,
                      among=sum(1 + len(e.confusable_with) for e in right),
                      false=len(effects) - len(right), discoveries=len(effects),
                      odd=len(odd_vehicles(rest, list(range(vehicles)))))
        print(f"{cause}: {[(e.group, e.cause, e.confusable_with) for e in effects]}", flush=True)
    exact = binomtest(totals["false"], max(totals["discoveries"], 1)).proportion_ci()
    print(f"{draws} draws, {weak} of {vehicles} vehicles: in {totals['found']} found in its lot, "
          f"among {totals['among']} causes in all, in {totals['first']} as the first; "
          f"{totals['false']} of {totals['discoveries']} discoveries false (95 %: {exact.low:.2%} "
          f"to {exact.high:.2%}); {totals['odd']} vehicles odd")


def _made(folder, count):
    (folder / "model.yaml").write_text(json.dumps(fleet_rig.model()))
    (folder / "bags").mkdir()
    rng = np.random.default_rng(2)
    own = fleet_rig.vehicle(rng, duration_s=2.0)
    for i in range(count):
        fleet_rig.write_bag(folder / "bags" / f"{i:05}.mcap", own, rng, 60.0 * i)


def _told(results, count, words, verb="correct"):
    rows = Store(str(results), verb).read().to_pylist()
    hashes = {row["sha256"] for row in rows}
    own_s = sum(row["cpu_s"] or 0 for row in rows)
    print(f"{words}; {count - len(hashes)} lost, {len(rows) - len(hashes)} double, "
          f"{sum(bool(row['error']) for row in rows)} errors; {own_s:.1f} s of processor time for "
          f"the bags; at most {max(row['memory_mb'] for row in rows):.0f} MB a worker", flush=True)
    return rows


def workers(count):
    """Bags corrected on one and two workers, and once more with workers killed at random."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        _made(folder, count)
        for number, kills in ((1, 0), (2, 0), (2, max(count // 50, 2))):
            results = folder / f"results-{number}-{kills}"
            began, before = time.monotonic(), os.times()
            killed, status = _run(folder, results, number, kills)
            took, after = time.monotonic() - began, os.times()
            used = (after.children_user + after.children_system
                    - before.children_user - before.children_system)
            _told(results, count, f"{number} workers, {killed} killed: {took:.1f} s, {used:.1f} s "
                                  f"of processor time, status {status}")


def restart(count):
    """A cluster whose scheduler dies and comes back, and then a client that is killed."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        _made(folder, count)
        results = folder / "results"
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        cluster = _cluster(address)
        try:
            client = _begun(folder, results, "--scheduler", address)
            _until(results, count // 5)
            _end(cluster)
            cluster = _cluster(address)
            _until(results, count // 2)
            client.kill()
            client.wait()
            before = len(list((results / "correct-files").glob("*.mcap")))
            status = _begun(folder, results, "--scheduler", address).wait()
        finally:
            _end(cluster)
        rows = _told(results, count, f"scheduler restarted, client killed at {before} bags: "
                                     f"status {status}")
        for row in rows[::max(count // 20, 1)]:
            alone = folder / Path(row["output"]).name
            subprocess.run([sys.executable, "-m", "frac_accel.cli", "correct", row["bag"],
                            "--model", folder / "model.yaml", "-o", alone], check=True,
                           stdout=subprocess.DEVNULL)
            if alone.read_bytes() != (results / row["output"]).read_bytes():
                print(f"{row['bag']}: not what the single command writes")


def _cluster(address):
    port = address.rsplit(":", 1)[1]
    common = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return [subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_scheduler", "--host",
                              "127.0.0.1", "--port", port, "--no-dashboard"], **common),
            subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_worker", address,
                              "--nthreads", "1", "--no-nanny", "--no-dashboard"], **common)]


def _end(processes):
    for process in processes:
        process.kill()
        process.wait()


def _until(results, count):
    while len(list((results / "correct-files").glob("*.mcap"))) < count:
        time.sleep(0.1)


def _begun(folder, results, *options):
    return subprocess.Popen(
        [sys.executable, "-m", "frac_accel.cli", "fleet", "correct", folder / "bags", "-o", results,
         "--model", folder / "model.yaml", *options],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _run(folder, results, number, kills):
    process = _begun(folder, results, "--workers", str(number))
    killed = 0
    while process.poll() is None:
        time.sleep(random.uniform(0.5, 2.0))
        own = [int(status.parent.name) for status in Path("/proc").glob("[0-9]*/stat")
               if _parent(status) == process.pid]
        if killed < kills and own and (results / "correct-files").exists():
            try:
                os.kill(random.choice(own), signal.SIGKILL)
                killed += 1
            except OSError:
                pass
    return killed, process.returncode


def _parent(status):
    try:
        if "spawn_main" not in (status.parent / "cmdline").read_text():
            return None
        return int(status.read_text().rsplit(")", 1)[1].split()[1])
    except (OSError, ValueError):
        return None


def main():
    """Entry point."""
    parser = argparse.ArgumentParser(prog="fleet_bench", description=__doc__)
    parser.add_argument("part", choices=["pooling", "workers", "restart"])
    parser.add_argument("--vehicles", type=int, default=300)
    parser.add_argument("--weak", type=int, default=30)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--seed", type=int, default=23)
    parser.add_argument("--bags", type=int, default=10_000)
    chosen = parser.parse_args()
    if chosen.part == "pooling":
        pooling(chosen.vehicles, chosen.weak, chosen.draws, chosen.seed)
    else:
        {"workers": workers, "restart": restart}[chosen.part](chosen.bags)


if __name__ == "__main__":
    main()
