"""Models, damaged or not, as ``model_file`` of one corrector node at work, over DDS."""

import tempfile
import time
from pathlib import Path

import numpy as np
from ros_probe import Probe, background, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu

from frac_accel.io import cdr
from frac_accel.io.bag import Samples

from . import seeds
from .case import model_file
from .live import DAMAGES, DEADLINE_S

RATE_HZ = 200.0
# What a node may be late by on a machine that does other work, too.
_MARGIN_S = 5.0


def run(numbers, keep=None, told=lambda number, what, status, wrong: None):
    """Set them one after the other while samples come; as `runner.run`."""
    found = {}
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name, ros_domain() as environment:
        folder = Path(name)
        (folder / "first.yaml").write_text(seeds.text_of(seeds.PLAIN))
        with Probe(environment) as probe, NodeProcess("corrector", environment, {
                "model_file": folder / "first.yaml", "sample_rate_hz": RATE_HZ,
                "design_deadline_s": float(DEADLINE_S), "metrics_topics": False,
                "qos_overrides./imu/data_raw.subscription.reliability": "reliable"}) as node:
            source = _Source(probe)
            with background(source.run):
                for number in numbers:
                    what, status, wrong = _set(number, folder, probe, source)
                    if node.process.poll() is not None:
                        wrong.append(f"the node has ended: {node.text[-500:]}")
                    told(number, what, status, wrong)
                    if wrong:
                        found[number] = [what, *wrong]
                        _keep(keep, number, folder / f"{number}.yaml", wrong)
                    if node.process.poll() is not None:
                        break
                source.stop = True
            time.sleep(1.0)
            status = node.stop()
            if status or f"samples {source.sent}," not in node.text:
                found["end"] = [f"status {status}, {source.sent} sent", node.text[-1000:]]
    return found


class _Source:
    """Publishes samples until it is told to stop, and looks at what comes back."""

    def __init__(self, probe):
        self.stop, self.sent, self._read = False, 0, 0
        self.received = probe.collect(Imu, "/imu/data")
        self._publisher = probe.publisher(Imu, "/imu/data_raw")

    def run(self):
        """Publish."""
        rng = np.random.default_rng(0)
        while not self.stop:
            stamps = seeds.START_NS + (self.sent + np.arange(int(RATE_HZ / 10))) * int(
                1e9 / RATE_HZ)
            values = rng.normal(size=(len(stamps), 3))
            publish([(self._publisher, cdr.encode_samples(cdr.IMU, Samples.of(stamps, values)))],
                    RATE_HZ)
            self.sent += len(stamps)

    def troubles(self):
        """What is wrong with the corrected samples since the last time."""
        new = self.received[self._read:]
        self._read += len(new)
        if new:
            samples = cdr.read_samples(cdr.IMU, new)
            if not np.isfinite(samples.values).all():
                return ["gives out what is no number"]
        return []


def _set(number, folder, probe, source):
    rng = np.random.default_rng([number, 1])
    what = str(rng.choice(list(DAMAGES), p=list(DAMAGES.values())))
    path = folder / f"{number}.yaml"
    path.write_bytes(model_file(what, rng))
    wrong, start = [], time.monotonic()
    try:
        result = probe.set_parameter("corrector", "model_file", str(path))
    except AssertionError as error:
        return f"node, {what}", "?", [f"no answer: {error}"]
    seconds = time.monotonic() - start
    if seconds > DEADLINE_S + _MARGIN_S:
        wrong.append(f"answers after {seconds:.0f} s")
    if not result.successful and not 20 < len(result.reason) < 3000:
        wrong.append(f"refused by {result.reason[:300]!r}")
    return (f"node, {what}", "accepted" if result.successful else "refused",
            wrong + source.troubles())


def _keep(keep, number, path, wrong):
    if keep:
        folder = Path(keep) / str(number)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / path.name).write_bytes(path.read_bytes())
        (folder / "wrong.txt").write_text("\n".join(map(str, wrong)))
