"""A diagnosis in a process of its own: at the lowest priority, with a budget of processor time."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from ..io.bag import RAW_TOPIC, REFERENCE_TOPIC, write_bag

# Processor time [s] that may be used before the budget's share has come.
_HEAD_START_S = 1.0
# Units of processor time in a second, as the kernel counts it.
TICKS = os.sysconf("SC_CLK_TCK")


# What the new process does first: it steps back, and ends with its parent (prctl 1), be it stopped
# or not. Not in a preexec_fn, which is not safe beside threads; and not with SCHED_IDLE, by which
# it would never end on a busy machine.
_HUMBLE = """
import ctypes, os, signal, sys
os.nice(int(sys.argv[2]))
try:
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
except (AttributeError, OSError):
    pass
if os.getppid() == int(sys.argv[1]):
    os.execv(sys.argv[3], sys.argv[3:])
"""


class Errand:
    """``frac_accel diagnose`` on a stretch, that is stopped and let go on as its budget allows.

    Parameters
    ----------
    folder : Path
        For the bag, the result, the page and the extended model.
    pair : tuple of Samples
    model_file : str
    axis : {"x", "y", "z"}
    budget : float
        Share of one core.
    time_limit_s : float
        Processor time after which the search ends [s].
    niceness : int
        Of the process: 19 steps back behind everything else.

    Attributes
    ----------
    folder : Path
    cpu_s : float
        Processor time so far [s].
    """

    def __init__(self, folder, pair, model_file, axis, budget, time_limit_s, niceness=19):
        self.folder, self._budget = folder, budget
        self.cpu_s, self._is_stopped, self._begin_s = 0.0, False, time.monotonic()
        bag = folder / "stretch.mcap"
        write_bag(bag, dict(zip((REFERENCE_TOPIC, RAW_TOPIC), pair)))
        command = [sys.executable, "-m", "frac_accel.cli", "diagnose", str(bag), "--model",
                   str(model_file), "--axis", axis, "--json", str(folder / "result.json"),
                   "--report", str(folder / "report.html"), "--extended-model",
                   str(folder / "model.yaml"), "--time-limit", str(time_limit_s)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                       "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        with open(folder / "errors.txt", "wb") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-S", "-c", _HUMBLE, str(os.getpid()), str(niceness),
                 *command], env=environment, stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=errors)

    def turn(self):
        """Stop it or let it go on, several times a second; the result once there is one.

        Returns
        -------
        dict or None
            As ``diagnose --json``; with ``verdict`` ``failed`` and ``reason`` where it failed.
        """
        status = self._process.poll()
        if status is None:
            with contextlib.suppress(OSError):
                self.cpu_s = cpu_time_s(self._process.pid)
            allowed = _HEAD_START_S + self._budget * (time.monotonic() - self._begin_s)
            if (self.cpu_s > allowed) != self._is_stopped:
                self._is_stopped = not self._is_stopped
                self._process.send_signal(signal.SIGSTOP if self._is_stopped else signal.SIGCONT)
            return None
        if status == 0:
            return json.loads((self.folder / "result.json").read_text(encoding="utf-8"))
        words = (self.folder / "errors.txt").read_text(encoding="utf-8", errors="replace").strip()
        return {"verdict": "failed", "findings": [],
                "reason": words.splitlines()[-1] if words else f"it ended with status {status}"}

    def end(self):
        """End it, finished or not."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()


def cpu_time_s(pid):
    """Processor time [s] that a process has used so far, that of the kernel for it included."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS
