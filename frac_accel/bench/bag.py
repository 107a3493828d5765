"""`correct` from file to file, beside a program that copies the bag with the mcap library."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

from ..errors import FracAccelError
from ..io import cdr
from ..io.bag import RAW_TOPIC, BagWriter
from ..io.samples import Samples
from . import machine
from .figures import Figure
from .passage import ROOT, model_document

_RATE_HZ = 10_000.0
_MESSAGES = 1_000_000
_PEER = "mcap: iter_messages and add_message, nothing corrected"


def run(rounds):
    """Figures of a bag of a million messages."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_bag_of(folder / "raw.mcap", _MESSAGES)
        (folder / "model.yaml").write_text(yaml.safe_dump(model_document(_RATE_HZ)))
        ours, copies = [], []
        for _ in range(rounds):
            ours.append(_correct(folder))
            start = time.perf_counter()
            _copy(folder / "raw.mcap", folder / "copy.mcap", _MESSAGES // 10)
            copies.append(10 * (time.perf_counter() - start))
        seconds, cpu_s, memory_mb = np.min(ours, axis=0)
    return [
        Figure("bag", "correct, a million Imu, file to file", 1e-3 * _MESSAGES / seconds,
               "thousand/s", least=100),
        Figure("bag", "the same over processor time", 1e-3 * _MESSAGES / cpu_s, "thousand/s"),
        Figure("bag", "largest resident memory", memory_mb, "MB", most=300),
        Figure("bag", "copying it with the mcap library, over correct's time",
               min(copies) / seconds, "", peer=_PEER)]


def write_bag_of(path, count):
    """Bag with so many Imu messages at 10 kHz."""
    rng = np.random.default_rng(0)
    with BagWriter(path) as writer:
        writer.add_topic(RAW_TOPIC, cdr.IMU)
        for first in range(0, count, 10_000):
            stamps = 10**18 + (first + np.arange(10_000)) * 100_000
            samples = Samples.of(stamps, rng.normal(size=(10_000, 3)), np.full((10_000, 3), 1e-4))
            logs = stamps.tolist()
            writer.write_many(RAW_TOPIC,
                              list(zip(cdr.encode_samples(cdr.IMU, samples), logs, logs)))


def _correct(folder):
    """Time, processor time [s] and largest memory [MB] of the command."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "frac_accel.cli", "correct", "raw.mcap", "--model", "model.yaml",
         "-o", "out.mcap"], cwd=folder, env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    # not what wait4 says of the memory: that begins with ours, which the child was forked from
    memory_mb = 0.0
    while (done := os.wait4(process.pid, os.WNOHANG))[0] == 0:
        memory_mb = max(memory_mb, machine.most_memory_mb(process.pid) or 0.0)
        time.sleep(0.02)
    seconds = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(done[1])
    if process.returncode:
        raise FracAccelError(f"correct has ended with status {process.returncode}")
    return seconds, done[2].ru_utime + done[2].ru_stime, memory_mb


def _copy(source, target, count):
    """Copy the first messages, twice each, as `correct` writes raw and corrected."""
    with open(source, "rb") as stream, open(target, "wb") as output:
        writer = Writer(output)
        writer.start()
        channels = {}
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=True):
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number, channel.metadata)
            for _ in range(2):
                writer.add_message(channels[channel.id], message.log_time, message.data,
                                   message.publish_time)
            count -= 1
            if not count:
                break
        writer.finish()
