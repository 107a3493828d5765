"""Nodes as separate processes for tests, each test on a ROS domain of its own."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


@contextlib.contextmanager
def ros_domain() -> Iterator[dict[str, str]]:
    """Environment with a domain that no other test on this machine uses at the same time."""
    for domain in range(1, 100):
        lock = open(Path(tempfile.gettempdir()) / f"frac_accel_test_domain_{domain}.lock", "w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        with lock:
            yield {
                "FASTRTPS_DEFAULT_PROFILES_FILE": str(ROOT / "config" / "fastdds_discovery.xml"),
                "ROS_DOMAIN_ID": str(domain),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                "PYTHONUNBUFFERED": "1",
            }
        return
    raise RuntimeError("all ROS domains are in use")


def ros_arguments(parameters: dict[str, object], *more: str) -> list[str]:
    """Command line that sets parameters of a node."""
    arguments = ["--ros-args"]
    for name, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        if isinstance(value, (list, tuple)):
            text = "[" + ", ".join(map(str, value)) + "]"
        arguments += ["-p", f"{name}:={text}"]
    return arguments + list(more)


class NodeProcess:
    """``python -m frac_accel.nodes.NAME`` (or another command) in the background.

    A context manager that kills the process at the end, whatever has happened.

    Attributes
    ----------
    output, errors : list of str
        Lines of stdout and stderr so far.
    """

    def __init__(
        self,
        node: str,
        environment: dict[str, str],
        parameters: dict[str, object] | None = None,
        *more: str,
        command: list[str] | None = None,
    ) -> None:
        command = command or [
            sys.executable,
            "-m",
            f"frac_accel.nodes.{node}",
            *ros_arguments(parameters or {}, *more),
        ]
        path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        self.process = subprocess.Popen(
            command,
            env={**os.environ, "PYTHONPATH": path, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.output: list[str] = []
        self.errors: list[str] = []
        self._readers = [
            threading.Thread(target=self._collect, args=pair, daemon=True)
            for pair in ((self.process.stdout, self.output), (self.process.stderr, self.errors))
        ]
        for reader in self._readers:
            reader.start()

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for reader in self._readers:
            reader.join()

    def wait(self, timeout_s: float = 60.0) -> int:
        """Exit status; fails with the output if the process does not end."""
        try:
            status = self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {timeout_s} s\n{self.text}") from None
        for reader in self._readers:
            reader.join()
        return status

    def stop(self, number: int = signal.SIGINT, timeout_s: float = 30.0) -> int:
        """Send a signal and wait for the exit status."""
        self.process.send_signal(number)
        return self.wait(timeout_s)

    def wait_for(self, part: str, timeout_s: float = 30.0) -> str:
        """The first line of output that contains a text; waits for it."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            ended = self.process.poll() is not None
            for line in [*self.output, *self.errors]:
                if part in line:
                    return line
            if ended:
                break
            time.sleep(0.02)
        raise AssertionError(f"no line with {part!r} within {timeout_s} s\n{self.text}")

    @property
    def text(self) -> str:
        """Everything printed so far."""
        return "\n".join([*self.output, *self.errors])

    @staticmethod
    def _collect(stream, lines: list[str]) -> None:
        for line in stream:
            lines.append(line.rstrip("\n"))
        stream.close()
