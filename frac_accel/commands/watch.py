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
_TITLE = "frac_accel watch, q quits"
# Time without a report after which a sensor counts as silent.
_SILENT_S = 3.5
# Columns of a terminal that holds the table, bars of a sparkline in it, and columns for each bar of
# a narrower terminal.
_WIDE, _BARS_WIDE, _PER_BAR = 140, 12, 10


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
    """What is known of some sensors for a terminal of that many columns: a table of rich, or where
    that would not fit two lines for each."""
    from rich.text import Text
    if not sensors:
        return Text("waiting for a corrector: nobody publishes /diagnostics or ~/metrics of one "
                    "in this ROS domain; q quits")
    return _wide(sensors, now_s, width) if width >= _WIDE else _narrow(sensors, now_s, width)


def _wide(sensors, now_s, width):
    from rich.table import Table
    drawn = Table(title=_TITLE, title_justify="left", expand=True)
    for heading, right in (("sensor", False), ("raw RMS", True), ("", False),
                           ("corrected RMS", True), ("", False), ("rate [Hz]", True),
                           ("latency 99 %", True), ("verdict", False)):
        drawn.add_column(heading, justify="right" if right else "left",
                         no_wrap=right or not heading, overflow="fold",
                         ratio=2 if heading == "verdict" else None)
    for sensor in sensors:
        figures = sensor.figures
        drawn.add_row(
            sensor.name, _number(_last(sensor.raw)), sparkline(list(sensor.raw)[-_BARS_WIDE:]),
            _number(_last(sensor.corrected)), sparkline(list(sensor.corrected)[-_BARS_WIDE:]),
            _number(figures.get("received_per_s", math.nan)), _latency(figures),
            _verdict(sensor, now_s))
    return drawn


def _narrow(sensors, now_s, width):
    from rich.text import Text
    drawn = Text(_TITLE, style="bold")
    for sensor in sensors:
        drawn.append(f"\n{sensor.name}  ", style="bold")
        drawn.append_text(_verdict(sensor, now_s))
        figures, words = sensor.figures, []
        for name, values in (("raw", sensor.raw), ("corrected", sensor.corrected)):
            words.append(f"{name} {_number(_last(values))} "
                         + sparkline(list(values)[-(width // _PER_BAR):]))
        words.append(f"{_number(figures.get('received_per_s', math.nan))} Hz")
        words.append(f"latency {_latency(figures)}")
        drawn.append("\n  " + "  ".join(words), style="not bold")
    return drawn


def _verdict(sensor, now_s):
    from rich.text import Text
    level, verdict = sensor.level, sensor.verdict or "not yet judged"
    silent_s = now_s - sensor.heard_s
    if silent_s > _SILENT_S:
        level, verdict = 2, f"its corrector has been silent for {silent_s:.0f} s"
    return Text(verdict, style=_COLOURS[min(level, 2)])


def _latency(figures):
    return _number(1e3 * figures.get("latency_p99_s", math.nan), " ms")


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
    if not math.isfinite(value):
        return "–"
    return f"{value:.0f}{unit}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}{unit}"


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
