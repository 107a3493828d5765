"""Watch the correctors of this ROS domain in the terminal: RMS, rate, latency, verdict. q quits.

A sensor is a line: what its corrector publishes about it once a second, and the last minute as
sparklines. RMS is about the mean, of the three axes together.
"""

import contextlib
import importlib.util
import math
import os
import select
import sys
import time

from ..errors import FracAccelError

EXAMPLES = """
frac_accel watch
frac_accel watch front/imu rear/imu
"""
_BARS = "▁▂▃▄▅▆▇█"
_COLOURS = ("green", "yellow", "red")
_PERIOD_S = 0.25
# Time without a report after which a sensor counts as silent, and widths of sparklines by that of
# the terminal.
_SILENT_S = 3.5
_WIDE, _WIDTHS = 130, (8, 20)


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("sensors", nargs="*", metavar="TOPIC",
                        help="part of the raw topic of sensors to be shown (default: all)")


def run(arguments):
    """Do it."""
    for name, way in (("rclpy", "pip install ros-jazzy-rclpy[fastrtps] "
                       "ros-jazzy-common-interfaces, or source a ROS 2"),
                      ("rich", "pip install rich")):
        if importlib.util.find_spec(name) is None:
            raise FracAccelError(f"watch needs the Python library {name}: {way}")
    if not sys.stdout.isatty():
        raise FracAccelError("watch draws in a terminal, and the output is none; "
                             "ros2 topic echo /diagnostics gives the same as text")
    from ..nodes._watcher import Watcher
    with contextlib.suppress(KeyboardInterrupt), Watcher() as watcher, _keys() as pressed:
        _show(watcher, arguments.sensors, pressed)


def _show(watcher, wanted, pressed):
    """Draw until somebody quits."""
    from rich.console import Console
    from rich.live import Live
    console = Console(file=sys.__stdout__)
    with Live(console=console, screen=True, auto_refresh=False) as live:
        while pressed() not in ("q", "Q", "\x1b"):
            sensors = [sensor for name, sensor in sorted(watcher.sensors.items())
                       if not wanted or any(part in name for part in wanted)]
            live.update(table(sensors, time.monotonic(), console.width), refresh=True)
            watcher.listen(_PERIOD_S)


def table(sensors, now_s, width=_WIDE):
    """What is known of some sensors, as a table of rich."""
    from rich.table import Table
    from rich.text import Text
    if not sensors:
        return Text("waiting for a corrector: nobody publishes /diagnostics or ~/metrics of one "
                    "in this ROS domain; q quits")
    drawn = Table(title="frac_accel watch, q quits", title_justify="left", expand=True)
    for heading, right in (("sensor", False), ("raw RMS", True), ("", False),
                           ("corrected RMS", True), ("", False), ("rate [Hz]", True),
                           ("latency 99 %", True), ("verdict", False)):
        drawn.add_column(heading, justify="right" if right else "left",
                         no_wrap=right or not heading, overflow="fold",
                         ratio=2 if heading == "verdict" else None)
    length = _WIDTHS[width >= _WIDE]
    for sensor in sensors:
        figures, silent_s = sensor.figures, now_s - sensor.heard_s
        level, verdict = sensor.level, sensor.verdict or "not yet judged"
        if silent_s > _SILENT_S:
            level, verdict = 2, f"its corrector has been silent for {silent_s:.0f} s"
        drawn.add_row(
            sensor.name, _number(_last(sensor.raw)), sparkline(list(sensor.raw)[-length:]),
            _number(_last(sensor.corrected)), sparkline(list(sensor.corrected)[-length:]),
            _number(figures.get("received_per_s", math.nan)),
            _number(1e3 * figures.get("latency_p99_s", math.nan), " ms"),
            Text(verdict, style=_COLOURS[min(level, 2)]))
    return drawn


def sparkline(values):
    """Values as bars between 0 and the largest; a space where there is none.

    Examples
    --------
    >>> sparkline([0.0, 1.0, float("nan"), 2.0])
    '▁▅ █'
    """
    known = [value for value in values if math.isfinite(value)]
    top = max(known, default=0.0)
    return "".join(" " if not math.isfinite(value) else
                   _BARS[round((len(_BARS) - 1) * value / top) if top > 0 else 0]
                   for value in values)


def _last(values):
    return values[-1] if values else math.nan


def _number(value, unit=""):
    return f"{value:.3g}{unit}" if math.isfinite(value) else "–"


@contextlib.contextmanager
def _keys():
    """A function that gives the key that was pressed, or nothing; the terminal is as it was after.
    """
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    import termios
    import tty
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def pressed():
        ready, _, _ = select.select([descriptor], [], [], 0)
        # a closed terminal, as of an ssh that has gone, ends it as well
        return (os.read(descriptor, 1).decode("ascii", "replace") or "q") if ready else ""
    try:
        tty.setcbreak(descriptor)
        yield pressed
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
