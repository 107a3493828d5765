"""What correctors say of their sensors, gathered from their topics for whoever shows it."""

from __future__ import annotations

import collections
import dataclasses
import math
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
# How often new topics of metrics are looked for.
_LOOK_S = 1.0


@dataclasses.dataclass
class Seen:
    """What is known of one sensor.

    Attributes
    ----------
    name : str
        Its raw topic.
    level : int
        0 well, 1 a warning, 2 an error.
    verdict : str
        What the corrector says of its health.
    figures : dict of str to float
        Its newest metrics.
    raw, corrected : collections.deque of float
        RMS about the mean over the axes, of the last reports.
    heard_s : float
        Monotonic time of the last report.
    """

    name: str
    history: dataclasses.InitVar[int]
    level: int = 0
    verdict: str = ""
    figures: dict = dataclasses.field(default_factory=dict)
    heard_s: float = 0.0

    def __post_init__(self, history):
        self.raw, self.corrected = (collections.deque(maxlen=history) for _ in range(2))

    def take(self, figures: dict) -> None:
        """Take in the metrics of one report."""
        self.figures = figures
        for kind, values in (("raw", self.raw), ("corrected", self.corrected)):
            stds = [figures[f"{prefix}{axis}/{kind}/std"] for axis in "xyz"
                    for prefix in ("", "blocks/") if f"{prefix}{axis}/{kind}/std" in figures]
            values.append(math.hypot(*stds) if stds else math.nan)


class Watcher:
    """Listens to all correctors of the ROS domain; a context manager.

    Parameters
    ----------
    history : int
        Reports of which the RMS is kept.

    Attributes
    ----------
    sensors : dict of str to Seen
    """

    def __init__(self, history: int = 60) -> None:
        self.sensors: dict[str, Seen] = {}
        self._history, self._looked_s, self._topics = history, 0.0, set()

    def __enter__(self) -> Watcher:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("frac_accel_watch", context=self._context,
                          enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, 100)
        return self

    def __exit__(self, *_) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def listen(self, seconds: float) -> None:
        """Take in what comes within this time."""
        end_s = time.monotonic() + seconds
        if time.monotonic() - self._looked_s > _LOOK_S:
            self._looked_s = time.monotonic()
            self._look()
        while (left_s := end_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def _look(self) -> None:
        for topic, types in self._node.get_topic_names_and_types():
            if topic.endswith("/metrics") and _TYPE in types and topic not in self._topics:
                self._topics.add(topic)
                self._node.create_subscription(DiagnosticArray, topic, self._on_metrics, 100)

    def _sensor(self, status) -> Seen:
        name = status.hardware_id
        if name not in self.sensors:
            self.sensors[name] = Seen(name, self._history)
        self.sensors[name].heard_s = time.monotonic()
        return self.sensors[name]

    def _on_health(self, array) -> None:
        for status in array.status:
            # others publish there, too
            if {"model_file", "samples"} & {pair.key for pair in status.values} \
                    and status.name.endswith(f": {status.hardware_id}"):
                sensor = self._sensor(status)
                sensor.level, sensor.verdict = ord(status.level), status.message

    def _on_metrics(self, array) -> None:
        for status in array.status:
            figures = {}
            for pair in status.values:
                try:
                    figures[pair.key] = float(pair.value)
                except ValueError:
                    continue
            if status.name.endswith(f": {status.hardware_id}"):
                self._sensor(status).take(figures)
