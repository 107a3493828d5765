"""Demonstration: a sensor is identified from a bag, which is then played, corrected live with the
identified model and recorded, over DDS, in separate processes.

``make demo``, or ``python -m frac_accel.demo``. Writes the report, table and picture that it shows.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from .commands._common import provenance
from .errors import FracAccelError
from .identification import identify
from .io.bag import CORRECTED_TOPIC, RAW_TOPIC, REFERENCE_TOPIC, read_bag
from .io.shared_files import shared_folder
from .model import AXES, SensorModel
from .model.parameters import as_mapping
from .record import Record
from .report.identification import identification_page
from .report.quantity import scaled, written
from .shown import above, plain_logarithms
from .streaming import Corrector
from .validation import compare

# The axis that the model comes from; it then corrects all three.
AXIS = "x"
BAGS = shared_folder("bags")
_PATIENCE_S = 90
# Of the record, in the picture.
_SHOWN_S = 0.3
_LEAST_ERROR = 1e-4


def main(arguments=None):
    """Run the demonstration; exit status 0, or 2 with one line that says what went wrong."""
    parser = argparse.ArgumentParser(prog="python -m frac_accel.demo", description=__doc__)
    parser.add_argument("--bag", default=BAGS / "viscoelastic_bench.mcap", type=Path,
                        help="reference and raw samples; a model file beside it with the same name "
                             "holds the true parameters, if they are known")
    parser.add_argument("--output-dir", default="demo_output", type=Path)
    chosen = parser.parse_args(arguments)
    try:
        run(chosen.bag, chosen.output_dir)
    except FracAccelError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 2
    return 0


def run(bag, folder):
    """Identify, play, correct, record, compare."""
    folder.mkdir(parents=True, exist_ok=True)
    recorded, model_file = folder / "demo.mcap", folder / "model.yaml"
    recorded.unlink(missing_ok=True)
    measured = read_bag(bag, [REFERENCE_TOPIC, RAW_TOPIC])
    print(f"identifying the sensor from {bag.name}, axis {AXIS}", flush=True)
    found = _identify(bag, measured, model_file, folder / "identification.html")
    print(found, flush=True)
    print(f"playing {bag.name} ({np.ptp(measured[RAW_TOPIC].stamps_ns) * 1e-9:.1f} s) -> corrector "
          f"with {model_file.name} -> recorder", flush=True)
    _live(bag, model_file, recorded)
    live = read_bag(recorded, [CORRECTED_TOPIC])[CORRECTED_TOPIC]

    model = SensorModel.load(model_file)
    corrector = Corrector(model)
    raw = measured[RAW_TOPIC]
    offline = corrector.process(raw.stamps_ns, raw.values, raw.variance)
    same = (np.array_equal(live.stamps_ns, offline.stamps_ns)
            and np.array_equal(live.values, offline.values))
    results = {axis: compare(measured[REFERENCE_TOPIC], raw, live, corrector.design, axis)
               for axis in AXES}
    text = table(results, len(live.stamps_ns), len(raw.stamps_ns), same)
    print(text)
    (folder / "demo.txt").write_text(f"{found}\n\n{text}\n", encoding="utf-8")
    picture(results, folder / "demo.png")
    written = ("identification.html", model_file.name, recorded.name, "demo.txt", "demo.png")
    print(f"written to {folder}: {', '.join(written)}")
    if not same:
        raise FracAccelError("the live output is not the offline output")


def parameters(result, truth):
    """Identified parameters beside the true ones, as far as these are known, as text."""
    known = {}
    if truth is not None:
        axis = truth.axis(AXIS)
        for part in (axis.core, *axis.effects):
            known.update(as_mapping(part))
    lines = ["parameter              identified ± standard uncertainty"]
    for name, entry in result.parameters.items():
        true = ""
        if name in known:
            unit = scaled(known[name], entry["unit"])
            true = f"  true: {known[name] * unit.factor:g} {unit.unit}"
        found = written(entry["value"], entry["std"], entry["unit"])
        lines.append(f"  {name:21} {found:40}{true}".rstrip())
    lines.append(f"residual {result.nrmse:.2%} of the output, {result.held_out_nrmse:.2%} on "
                 "held-out data")
    return "\n".join(lines + [f"note: {note}" for note in result.notes])


def table(results, live, raw, same):
    """Errors before and after, as text."""
    lines = [f"{live} of {raw} samples corrected live; "
             + ("bit-identical to the offline correction" if same else
                "DIFFERENT from the offline correction"),
             "",
             "axis  band [Hz]        NRMSE [%]            peak error [%]        phase error [deg]",
             "                    before      after      before      after      before      after"]
    for axis, result in results.items():
        before, after = result.scaled.total, result.corrected.total
        low, high = after.band_hz
        lines.append(
            f"  {axis}   {low:4.3g}-{high:<5.4g} {100 * before.nrmse:12.2f}"
            f" {100 * after.nrmse:10.2f}"
            f" {100 * before.peak_error:11.2f} {100 * after.peak_error:10.2f}"
            f" {before.phase_error_deg:11.2f} {after.phase_error_deg:10.2f}")
    lines.append("before: raw samples divided by the sensitivity; against the reference")
    return "\n".join(lines)


def picture(results, path):
    """The first moments: reference, raw and corrected, and what is left."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, rows = plt.subplots(len(results), 2, figsize=(12, 8), sharex=True,
                                width_ratios=(3, 2), layout="constrained")
    for (axis, result), (signals, errors) in zip(results.items(), rows):
        time_s = (result.stamps_ns - result.stamps_ns[0]) * 1e-9
        first = time_s <= _SHOWN_S
        time_s = time_s[first]
        signals.plot(time_s, result.before[first], color="#d98c5f", lw=1, label="raw / sensitivity")
        signals.plot(time_s, result.reference[first], color="black", lw=2.2, label="reference")
        signals.plot(time_s, result.after[first], color="#3f9bd8", lw=1, label="corrected")
        signals.set_ylabel(f"{axis} [m/s²]")
        errors.semilogy(time_s, np.abs(result.before - result.reference)[first], color="#d98c5f",
                        lw=0.8)
        errors.semilogy(time_s, np.abs(result.after - result.reference)[first], color="#3f9bd8",
                        lw=0.8)
        errors.set_ylabel("|error| [m/s²]")
        # where an error changes its sign, it goes down without end
        errors.set_ylim(bottom=_LEAST_ERROR)
        plain_logarithms(errors)
    above(rows[0][0])
    rows[0][0].set_title(f"acceleration, first {_SHOWN_S} s", pad=20)
    rows[0][1].set_title("error before and after correction")
    for row in rows[-1]:
        row.set_xlabel("time [s]")
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _identify(bag, measured, model_file, report):
    """Write the model of a bag's sensor and its report; what was found, as text."""
    source = provenance(bag, "python -m frac_accel.demo")
    pair = Record.of(measured[REFERENCE_TOPIC], measured[RAW_TOPIC], AXIS)
    result = identify(pair, AXIS, provenance=source)
    result.model.save(model_file)
    identification_page(result, source).write(report)
    truth = bag.with_suffix(".yaml")
    return parameters(result, SensorModel.load(truth) if truth.is_file() else None)


def _live(bag, model_file, recorded):
    """Player, corrector and recorder as processes on a ROS domain of their own."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(random.randint(1, 100)),
                   "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    reliable = [f"qos_overrides.{topic}.subscription.reliability:=reliable"
                for topic in (RAW_TOPIC, REFERENCE_TOPIC)]
    topics = f"[{REFERENCE_TOPIC},{RAW_TOPIC},{CORRECTED_TOPIC}]"
    commands = {
        "recorder": [f"bag:={recorded}", f"topics:={topics}", "idle_timeout_s:=3.0"],
        "corrector": [f"model_file:={model_file}", "depth:=10000", *reliable],
        "player": [f"bag:={bag}", "wait_for_subscribers:=2"],
    }
    processes, logs = {}, {node: recorded.parent / f"{node}.log" for node in commands}
    deadline = time.monotonic() + _PATIENCE_S
    try:
        for node, parameters in commands.items():
            arguments = [part for parameter in parameters for part in ("-p", parameter)]
            with open(logs[node], "w", encoding="utf-8") as log:
                processes[node] = subprocess.Popen(
                    [sys.executable, "-m", f"frac_accel.nodes.{node}", "--ros-args", *arguments],
                    env=environment, stdout=log, stderr=log)
            if node == "corrector":
                # what is played before the recorder has found the corrected topic is not recorded
                _wait_for(lambda: f"recording {CORRECTED_TOPIC} " in logs["recorder"].read_text(),
                          processes, logs, deadline)
        for node in ("player", "recorder"):
            _wait_for(lambda node=node: processes[node].poll() is not None, processes, logs,
                      deadline)
    finally:
        for process in processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in processes.values():
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def _wait_for(condition, processes, logs, deadline):
    """Wait, while no process has failed."""
    while True:
        done = condition()
        for node, process in processes.items():
            if process.poll():
                words = logs[node].read_text(encoding="utf-8").strip().splitlines() or ["no word"]
                raise FracAccelError(f"the {node} failed: {words[-1]}")
        if done:
            return
        if time.monotonic() > deadline:
            raise FracAccelError(f"not finished within {_PATIENCE_S} s; see {logs['recorder']}")
        time.sleep(0.05)


if __name__ == "__main__":
    sys.exit(main())
