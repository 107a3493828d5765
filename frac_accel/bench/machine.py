"""What a process uses of the machine, and what others use at the same time."""

import contextlib
import os
from pathlib import Path

from ..monitoring.errand import TICKS, cpu_time_s


def memory_mb(pid):
    """Resident memory [MB] of a process."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def most_memory_mb(pid):
    """Largest resident memory [MB] that a process has had; None once it has ended."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024e-6
    return None


class Load:
    """How many cores were busy with anything but some processes, from the start to the last update.

    Parameters
    ----------
    pids : list of int
    """

    def __init__(self, pids):
        self._pids = pids
        self._start = self._last = self._now()

    def update(self):
        """Look again; where a process has ended, the last look counts."""
        with contextlib.suppress(OSError):
            self._last = self._now()

    @property
    def elsewhere(self):
        """Cores."""
        busy, total, own = (last - start for last, start in zip(self._last, self._start))
        return max(busy - own, 0.0) / max(total, 1e-9) * os.cpu_count()

    def _now(self):
        return *_machine_s(), sum(map(cpu_time_s, self._pids))


def _machine_s():
    """Busy and whole processor time [s] of all cores since the machine was started."""
    fields = [int(field) for field in Path("/proc/stat").read_text().split("\n")[0].split()[1:9]]
    idle = fields[3] + fields[4]
    return (sum(fields) - idle) / TICKS, sum(fields) / TICKS
