"""`frac_accel watch` in a pseudo-terminal: what it shows of a live corrector, and how it ends."""

import contextlib
import fcntl
import math
import os
import pty
import re
import select
import shutil
import struct
import subprocess
import sys
import termios
import threading
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("rich")

from ros_probe import Probe, background, publish
from ros_processes import ROOT, NodeProcess, ros_domain
from sensor_msgs.msg import Imu
from test_node_sensors import (
    RATE_HZ,
    expected,
    parameters_file,
    reliable,
    samples,
    write_model,
)

from frac_accel.commands.watch import picture, sparkline, table
from frac_accel.io import cdr
from frac_accel.nodes._watcher import Seen

pytestmark = pytest.mark.ros

LEAVES_SCREEN = "\x1b[?1049l"


class Terminal:
    """The command in a terminal of its own, 150 columns wide."""

    def __init__(self, environment, *arguments):
        self.ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", 30, 150, 0, 0))
        self.theirs, self.before, self.text = theirs, termios.tcgetattr(theirs), ""
        # so that Ctrl-C reaches it as from a keyboard
        session = ["setsid", "--ctty", "--wait"] if shutil.which("setsid") else []
        self.process = subprocess.Popen(
            [*session, sys.executable, "-m", "frac_accel.cli", "watch", *arguments],
            stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=not session,
            # what pytest was started in says nothing of this terminal
            env={**{name: value for name, value in os.environ.items()
                    if name not in ("COLUMNS", "LINES")},
                 "PYTHONPATH": str(ROOT), "TERM": "xterm-256color", **environment})

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self.ours)
        os.close(self.theirs)

    def read(self, seconds):
        """Take in what has been drawn."""
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0:
            if select.select([self.ours], [], [], left_s)[0]:
                with contextlib.suppress(OSError):
                    self.text += os.read(self.ours, 65536).decode(errors="replace")

    def until(self, pattern, seconds=30.0):
        """Match of a pattern in the newest picture that is whole; waits for it."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.read(0.2)
            pictures = [re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", picture)
                        for picture in self.text.split("\x1b[H")[-2:]]
            for plain in reversed(pictures):
                if found := re.search(pattern, plain):
                    return found
        raise AssertionError(f"no {pattern!r} in {self.text[-60_000:]}")

    def end(self, key):
        """Press a key; exit status, and whether the terminal is as it was."""
        os.write(self.ours, key)
        for _ in range(50):
            self.read(0.1)
            if self.process.poll() is not None:
                break
        return self.process.poll(), (LEAVES_SCREEN in self.text
                                     and termios.tcgetattr(self.theirs) == self.before)


def test_it_shows_what_the_corrector_says_and_quits_cleanly(tmp_path):
    model, raw = write_model(tmp_path / "soft.yaml", 10.0), samples(3, seconds=90.0)
    messages = cdr.encode_samples(cdr.IMU, raw)
    with ros_domain() as environment, Probe(environment) as probe, NodeProcess(
            "corrector", environment, {}, *parameters_file(
                tmp_path, model_file=str(model), sample_rate_hz=RATE_HZ,
                qos_overrides=reliable("/imu/data_raw"))), \
            Terminal(environment) as shown, Terminal(environment, "rear") as other:
        publisher = probe.publisher(Imu, "/imu/data_raw")
        said = probe.metrics("/corrector/metrics")
        # it may take long to start
        shown.until("/imu/data_raw")
        enough = threading.Event()
        with background(publish, [(publisher, messages)], RATE_HZ, enough):
            # once two seconds of it are in the window
            probe.until(lambda: probe.statuses, "no status")
            shown.read(6.0)
            row = shown.until(r"/imu/data_raw *│ *([\d.]+) │ ([▁-█]+) *│ *([\d.]+) │ [▁-█]+ *│"
                              r" *([\d.]+) │ *([\d.]+) ms │ *(\w+)")
            # the vector's RMS, before and after a sensitivity of 10
            size = math.hypot(*np.std(raw.values, axis=0))
            after = math.hypot(*np.std(expected(model, raw).values, axis=0))
            assert float(row[1]) == pytest.approx(size, rel=0.15)
            assert float(row[3]) == pytest.approx(after, rel=0.15)
            assert len(row[2]) >= 3
            # on a busy machine messages come late, or have all come
            probe.until(lambda: any(
                float(row[4]) == pytest.approx(float(values["received_per_s"]), rel=0.01)
                and float(row[5]) == pytest.approx(1e3 * float(values["latency_p99_s"]), rel=0.01)
                for _, values in said), lambda: (row[0], said))
            assert row[6] in {status.message.split()[0] for status in probe.statuses}
            other.until("waiting for rear: the raw topics .* are /imu/data_raw")
            assert other.end(b"\x03") == (0, True)
            enough.set()
        assert shown.end(b"q") == (0, True)
        assert "Traceback" not in shown.text + other.text


def test_without_a_terminal_it_says_what_to_do():
    result = subprocess.run([sys.executable, "-m", "frac_accel.cli", "watch"], cwd=ROOT,
                            capture_output=True, text=True)
    line, = result.stderr.splitlines()
    assert result.returncode == 2 and "draws in a terminal" in line


def test_where_nothing_can_be_drawn_it_says_what_to_do():
    with Terminal({"TERM": "dumb"}) as shown:
        assert shown.process.wait(30) == 2
        shown.read(0.5)
    assert "TERM=dumb" in shown.text and "ros2 topic echo" in shown.text


def test_a_silent_corrector_and_missing_figures_are_said():
    from rich.console import Console
    sensor = Seen("/front/imu/data_raw", 60)
    sensor.verdict, sensor.heard_s = "all is well", 100.0
    sensor.take({"x/raw/std": 3.0, "y/raw/std": 4.0, "received_per_s": 99.6})
    for now_s, words in ((101.0, "all is well"), (160.0, "silent for 60 s")):
        console = Console(width=140, record=True, file=open(os.devnull, "w"))
        console.print(table([sensor], now_s, 140))
        text = console.export_text()
        assert words in text and " 5 " in text and "99.6" in text and "–" in text


@pytest.mark.parametrize("width", [50, 60, 71, 77, 78, 80, 100, 115, 116, 120, 139, 140, 200])
def test_name_rate_and_verdict_stand_in_terminals_of_any_width(width):
    """At 60 columns sensors had no names and no verdicts, and rates read 1e+03."""
    sensor = Seen("/vehicle/front_axle/imu/data_raw", 60)
    sensor.verdict = "correcting at 1000 Hz"
    sensor.take({"x/raw/std": 3.0, "x/corrected/std": 2.0, "received_per_s": 999.7})
    lines = drawn([sensor], width)
    row = next(line for line in lines if "1000" in line)
    assert "/vehicle/fr" in row and "correcting" in row
    assert all(len(line) <= width for line in lines)


def test_of_more_sensors_than_fit_the_worst_are_shown():
    sensors = [Seen(f"/seat_{number}/imu/data_raw", 60) for number in range(50)]
    for sensor in sensors:
        sensor.level, sensor.verdict = 0, "correcting at 400 Hz"
    sensors[47].level, sensors[47].verdict = 2, "no message"
    lines = drawn(sensors, 80, 24)
    assert len(lines) <= 24 and "the worst 18 of 50 sensors" in lines[0]
    assert any("/seat_47" in line and "no message" in line for line in lines)


@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_long_verdicts_drive_no_sensor_out_of_the_terminal(width):
    sensors = [Seen(f"/seat_{number}/imu/data_raw", 60) for number in range(9)]
    for sensor in sensors:
        sensor.verdict = f"no publisher on {sensor.name}: start the sensor's driver, or remap it"
    lines = drawn(sensors, width, 24)
    assert len(lines) <= 24
    assert all(any(f"/seat_{number}" in line for line in lines) for number in range(9))
    # with room for them they are whole
    assert "remap" in "".join(drawn(sensors[:2], width, 24))


@pytest.mark.parametrize("width, least", [(80, 6), (100, 6), (116, 8), (140, 20)])
def test_from_eighty_columns_both_rms_have_a_sparkline(width, least):
    sensor = Seen("/axle/front/imu/data_raw", 60)
    sensor.verdict = "correcting at 1000 Hz"
    for number in range(20):
        sensor.take({"x/raw/std": 3.0 + number, "x/corrected/std": 2.0, "received_per_s": 999.7,
                     "latency_p99_s": 0.0264})
    row = next(line for line in drawn([sensor], width) if "front" in line)
    bars = re.findall("[▁-█]+", row)
    assert len(bars) == 2 and all(len(each) >= least for each in bars)
    assert "/axle/front" in row and "1000" in row and "26.4 ms" in row and "correcting" in row


def test_sensors_that_are_not_the_wanted_ones_are_named():
    known = {"/rear/imu/data_raw": Seen("/rear/imu/data_raw", 60)}
    assert "waiting for a corrector" in str(picture({}, ["front"], 80, 24))
    said = str(picture(known, ["front"], 80, 24))
    assert "waiting for front" in said and "/rear/imu/data_raw" in said


def drawn(sensors, width, height=None):
    """Lines of a table."""
    from rich.console import Console
    console = Console(width=width, record=True, file=open(os.devnull, "w"))
    console.print(table(sensors, 0.0, width, height))
    return console.export_text().splitlines()


@pytest.mark.parametrize("values, bars", [
    ([], ""), ([0.0, 0.0], "▁▁"), ([1.0, 1.0], "██"), ([math.nan, 2.0, 1.0], " █▅")])
def test_sparkline(values, bars):
    assert sparkline(values) == bars
