"""What a node tells systemd: that it is ready, that it still turns, that it ends.

The protocol of ``sd_notify(3)``: lines in a datagram to the socket that the environment names. A
library for these few lines would be one more package on every machine.
"""

import os
import socket
import time


class ServiceManager:
    """Tells the service manager how it is; without one, nothing happens.

    Parameters
    ----------
    environment : mapping of str to str, optional
        Default: that of the process.
    """

    def __init__(self, environment=os.environ):
        self._address = environment.get("NOTIFY_SOCKET", "")
        is_watched = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        limit_us = environment.get("WATCHDOG_USEC", "") if is_watched and self._address else ""
        # twice within the limit
        self._period_s = int(limit_us) / 2e6 if limit_us.isdigit() else None
        self._next_s = 0.0

    def ready(self):
        """Say that the node does its work."""
        self._say("READY=1")

    def alive(self):
        """Say that it still does, as often as is asked for; called in every turn."""
        if self._period_s is not None and time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + self._period_s
            self._say("WATCHDOG=1")

    def stopping(self):
        """Say that it ends."""
        self._say("STOPPING=1")

    def _say(self, words):
        if not self._address:
            return
        # "@": a name that is in no file system
        address = "\0" + self._address[1:] if self._address[0] == "@" else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
                out.sendto(words.encode(), address)
        except OSError:
            pass  # it has gone, or is busy: no reason to end
