"""Watch the correctors of this ROS domain in the terminal: RMS, rate, latency, verdict. q quits.

A sensor is a line: what its corrector publishes about it once a second, and its past as sparklines
where the terminal has room for them. RMS is about the mean, of the three axes together, in m/s^2
(raw: in the units of the raw messages). Of more sensors than fit, the worst are shown.
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
# Time without a report after which a sensor counts as silent.
_SILENT_S = 3.5
# Widths of a terminal from which sparklines are long, from which there is room for frames, for
# sparklines and the latency, and for the raw RMS; and lengths of the sparklines.
_WIDE, _MIDDLE, _NARROW, _TINY = 140, 116, 80, 60
_LENGTHS = {_WIDE: 20, _MIDDLE: 8, _NARROW: 6}
# Lines that title, heading and frame take.
_FRAME_LINES = 6


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("sensors", nargs="*", metavar="TOPIC",
                        help="part of the raw topic of sensors to be shown (default: all)")


def run(arguments):
    """Do it."""
    for name, way in (("rclpy", "pip install 'frac_accel[ros]', or source a ROS 2"),
                      ("rich", "pip install rich")):
        if importlib.util.find_spec(name) is None:
            raise FracAccelError(f"watch needs the Python library {name}: {way}")
    if not sys.stdout.isatty():
        raise FracAccelError("watch draws in a terminal, and the output is none; "
                             "ros2 topic echo /diagnostics gives the same as text")
    if os.environ.get("TERM") in ("dumb", "unknown"):
        # rich would show nothing at all
        raise FracAccelError(f"watch draws in a terminal, and TERM={os.environ['TERM']} says that "
                             "this one cannot; ros2 topic echo /diagnostics gives the same as text")
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
            live.update(picture(watcher.sensors, wanted, console.width, console.height),
                        refresh=True)
            watcher.listen(_PERIOD_S)


def picture(known, wanted, width, height):
    """The table of the sensors that are wanted, or why there is none."""
    from rich.text import Text
    sensors = [sensor for name, sensor in sorted(known.items())
               if not wanted or any(part in name for part in wanted)]
    if sensors:
        return table(sensors, time.monotonic(), width, height)
    if known:
        return Text(f"waiting for {' or '.join(wanted)}: the raw topics of this ROS domain's "
                    f"sensors are {', '.join(sorted(known))}; q quits")
    return Text("waiting for a corrector: nobody publishes /diagnostics or ~/metrics of one "
                "in this ROS domain; q quits")


def table(sensors, now_s, width=_WIDE, height=None):
    """What is known of some sensors, as a table of rich; of more than fit, the worst."""
    from rich.console import Console
    drawn = _table(sensors, now_s, width, height)
    # verdicts have further lines where there is room
    if height and len(Console(width=width).render_lines(drawn)) > height:
        drawn = _table(sensors, now_s, width, height, is_tight=True)
    return drawn


def _table(sensors, now_s, width, height, is_tight=False):
    from rich import box
    from rich.table import Table
    from rich.text import Text
    lines = max(1, (height or math.inf) - _FRAME_LINES)
    judged = {sensor.name: _verdict(sensor, now_s) for sensor in sensors}
    shown, of = sensors, ""
    if len(sensors) > lines:
        worst = sorted(sensors, key=lambda sensor: -judged[sensor.name][0])[:lines]
        shown = [sensor for sensor in sensors if sensor in worst]
        of = f", the worst {lines} of {len(sensors)} sensors"
    names = _short([sensor.name for sensor in shown])
    drawn = Table(title=f"frac_accel watch, q quits{of}", title_justify="left", expand=True,
                  box=box.HEAVY_HEAD if width >= _MIDDLE else box.SIMPLE_HEAD,
                  padding=(0, width >= _MIDDLE))
    length = next((bars for least, bars in _LENGTHS.items() if width >= least), 0)
    headings = [("sensor", min(max(map(len, names)), width // (3 if width >= _MIDDLE else 4) - 1)),
                ("raw RMS", 7), ("", None), ("corrected RMS", 9), ("", None),
                ("rate [Hz]", 6), ("latency 99 %", 7), ("verdict", 11)]
    hidden = {number for number, least in ((2, _NARROW), (4, _NARROW), (6, _NARROW), (1, _TINY))
              if width < least}
    for number, (heading, least) in enumerate(headings):
        if number not in hidden:
            is_text, is_verdict = heading in ("sensor", "verdict", ""), heading == "verdict"
            drawn.add_column(heading, justify="left" if is_text else "right", min_width=least,
                             width=least if not is_text and width < _MIDDLE else None,
                             no_wrap=is_text and (is_tight or not is_verdict),
                             overflow="fold" if is_verdict and not is_tight else "ellipsis",
                             ratio=1 if is_verdict else None)
    for name, sensor in zip(names, shown):
        level, verdict = judged[sensor.name]
        figures = sensor.figures
        cells = [
            name, _number(_last(sensor.raw)), sparkline(list(sensor.raw)[-length:]),
            _number(_last(sensor.corrected)), sparkline(list(sensor.corrected)[-length:]),
            _number(figures.get("received_per_s", math.nan)),
            _number(1e3 * figures.get("latency_p99_s", math.nan), " ms"),
            Text(verdict, style=_COLOURS[min(level, 2)])]
        drawn.add_row(*(cell for number, cell in enumerate(cells) if number not in hidden))
    return drawn


def _short(names):
    """Names without the part that says nothing beside a namespace."""
    short = [name.removesuffix("/imu/data_raw") or name for name in names]
    return short if len(set(short)) == len(names) else names


def _verdict(sensor, now_s):
    """Level and words of a sensor's health; one that says nothing any more is not well."""
    silent_s = now_s - sensor.heard_s
    if silent_s > _SILENT_S:
        return 2, f"its corrector has been silent for {silent_s:.0f} s"
    return sensor.level, sensor.verdict or "not yet judged"


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
    return f"{value:.0f}{unit}" if 100 <= abs(value) < 1e6 else f"{value:.3g}{unit}"


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
