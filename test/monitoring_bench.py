"""Figures of the diagnoser: ``python -m monitoring_bench PART`` beside test/.

``drives``: ten causes that begin on the way, at once and slowly: noticed, dated, named.
``healthy``: hours of driving in which nothing happens.
``beside``: latency of a corrector while the diagnoser only watches, and while it diagnoses.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from monitoring_rig import MODEL, ChangingDrive, chunks

from frac_accel import diagnose
from frac_accel.model import SensorModel
from frac_accel.monitoring.watch import ENOUGH_S, Watch

EFFECTS = [
    {"sensitivity_error": {"gain": 1.05}}, {"offset": {"offset": 0.1}},
    {"time_delay": {"delay_s": 1e-3}}, {"low_pass_lag": {"corner_hz": 150.0}},
    {"cross_axis_sensitivity": {"y": 0.05, "z": 0.03}},
    {"mounting_resonance": {"frequency_hz": 80.0, "damping_ratio": 0.1}},
    {"core_parameter_shift": {"natural_frequency_hz": 40.0, "damping_ratio": 0.4}},
    {"quadratic_stiffness": {"alpha2": 3e-3}}, {"dead_zone": {"half_width": 0.05}},
    {"tone_interference": {"frequency_hz": 31.0, "amplitude": 0.1}}]


def watched(drive, model):
    """Watch after a drive, and when it noticed [s]."""
    watch, noticed = Watch(model), None
    for parts in zip(*map(chunks, drive.samples())):
        for window in watch.add(*parts):
            if watch.changed is not None and noticed is None:
                noticed = drive.since_start_s(window.stop_ns)
        if watch.changed is not None and watch.excited_since_s() >= ENOUGH_S:
            break
    return watch, noticed


def drives(count, first=0):
    """As many drives, the causes in turn; every other time ten slowly."""
    model = SensorModel.from_dict(MODEL)
    totals = dict.fromkeys(("noticed", "dated", "covered", "named", "wrong"), 0)
    for number in range(first, first + count):
        effects = EFFECTS[number % len(EFFECTS)]
        ramp_s = 60.0 * (number // len(EFFECTS) % 2)
        at_s = 450.0 + np.random.default_rng(number).uniform(0, 60)
        drive = ChangingDrive(1000 + number, effects, at_s, ramp_s, duration_s=720.0)
        watch, noticed = watched(drive, model)
        line = f"{number} {next(iter(effects))} ramp {ramp_s:g} s: "
        if noticed is None or noticed < at_s:
            print(line + ("nothing" if noticed is None else "false alarm"), flush=True)
            continue
        change = watch.changed
        low, here, high = (drive.since_start_s(ns) - at_s
                           for ns in (change.low_ns, change.ns, change.high_ns))
        pair = watch.to_diagnose()
        found = diagnose(pair, model, time_limit_s=60) if pair else None
        causes = [finding.cause for finding in found.findings] if found else []
        totals["noticed"] += 1
        totals["dated"] += abs(here) < 2
        totals["covered"] += low <= 0 <= high
        totals["named"] += set(causes) == set(effects)
        totals["wrong"] += bool(set(causes) - set(effects))
        print(line + f"noticed after {noticed - at_s:.0f} s, onset {here:+.2f} ({low:+.2f} to "
              f"{high:+.2f}) s, {'gradual' if change.is_gradual else 'sudden'}; "
              f"{found.verdict if found else 'no stretch'}: {causes}", flush=True)
    print(f"of {count} drives: {totals}")


def healthy(hours):
    """Six drives of ten minutes, again and again with new noise, with half a minute between."""
    model = SensorModel.from_dict(MODEL)
    # one sensor, whatever it is driven over
    parts = [ChangingDrive(2000 + i, {}, noise_std=5e-3) for i in range(6)]
    watch, alarms, largest = Watch(model), 0, 0.0
    for number in range(round(hours * 6)):
        drive = parts[number % len(parts)]
        for one in zip(*map(chunks, drive.samples())):
            watch.add(*(part._replace(stamps_ns=part.stamps_ns + number * 630 * 10**9)
                        for part in one))
        largest = max(largest, watch.detector.statistic)
        if watch.changed is not None:
            alarms += 1
            watch.use(model)
    print(f"{hours:g} h: {alarms} alarms; the statistic came to {largest:.3g} of "
          f"{watch.detector.threshold:.3g}")


def beside(turns, seconds=60.0, most_s=420.0):
    """A healthy drive as it comes; in each turn first without a diagnosis, then with one."""
    from ros_probe import Probe
    from ros_processes import NodeProcess, ros_domain

    from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, write_bag

    figures = {f"/corrector/metrics/latency_{name}_s": [] for name in ("p50", "p99")}
    with tempfile.TemporaryDirectory() as folder, ros_domain() as environment, \
            Probe(environment) as probe:
        model, bag = Path(folder) / "model.yaml", Path(folder) / "drive.mcap"
        model.write_text(json.dumps(MODEL))
        drive = ChangingDrive(3000, {}, duration_s=turns * (seconds + most_s), noise_std=5e-3)
        write_bag(bag, dict(zip((REFERENCE_TOPIC, RAW_TOPIC), drive.samples())))
        probe.watch(*figures)
        with NodeProcess("corrector", environment, {"model_file": model}), \
                NodeProcess("diagnoser", environment, {
                    "model_file": model, "results": Path(folder) / "results"}) as node, \
                NodeProcess("player", environment, {
                    "bag": bag, "wait_for_subscribers": 2, "start_delay_s": 1.0}):
            node.wait_for("watches axis x", 60)
            time.sleep(90)
            # what the filter waits for later samples is no load's doing
            delay_s = next(float(pair.value) for status in probe.statuses for pair in status.values
                           if pair.key == "filter_delay_s")
            for turn in range(turns):
                line = f"turn {turn}:"
                for diagnoses in (False, True):
                    if diagnoses:
                        assert probe.trigger("/diagnoser/diagnose").success
                    before = {topic: len(probe.figures[topic]) for topic in figures}
                    time.sleep(seconds)
                    ended = node.text.count('"step": "diagnosed"') > turn
                    for topic, values in figures.items():
                        values.append(np.median(probe.figures[topic][before[topic]:]) - delay_s)
                        line += f" {1e3 * values[-1]:.2f} ms"
                    line += " (ended before its time)" if ended and diagnoses else ";"
                print(line, flush=True)
                probe.until(lambda so_far=turn: node.text.count('"step": "diagnosed"') > so_far,
                            "the diagnosis does not end", most_s)
    for topic, values in figures.items():
        alone, with_one = np.array(values).reshape(turns, 2).T
        ratios = with_one / alone
        print(f"{topic} beyond the filter's delay: {1e3 * np.median(alone):.2f} ms alone, "
              f"{1e3 * np.median(with_one):.2f} ms beside a diagnosis, {np.median(ratios):.3f} "
              f"times as much ({ratios.min():.3f} to {ratios.max():.3f} in {turns} turns)")


def main():
    """Entry point."""
    parser = argparse.ArgumentParser(prog="monitoring_bench", description=__doc__)
    parser.add_argument("part", choices=["drives", "healthy", "beside"])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--hours", type=float, default=100.0)
    parser.add_argument("--turns", type=int, default=5)
    chosen = parser.parse_args()
    if chosen.part == "drives":
        drives(chosen.count, chosen.first)
    elif chosen.part == "healthy":
        healthy(chosen.hours)
    else:
        beside(chosen.turns)


if __name__ == "__main__":
    main()
