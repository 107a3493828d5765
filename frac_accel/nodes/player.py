"""Node ``player``: publishes a bag's messages, at the pace and with the QoS of the recording."""

from __future__ import annotations

import threading
import time
from typing import NamedTuple

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from frac_accel.io import cdr
from frac_accel.io.bag import BagReader, Message, TopicInfo
from frac_accel.nodes._errors import INVALID_ENDPOINT, NodeError
from frac_accel.nodes._runtime import FracAccelNode, import_message_class, run_node

_ACKNOWLEDGEMENT_TIMEOUT_S = 10.0
_POLL_S = 0.02
# Best-effort messages are still on their way when the last one has been published.
_LINGER_S = 0.2


class _Outlet(NamedTuple):
    publisher: Publisher
    has_header: bool
    is_reliable: bool


class Player(FracAccelNode):
    """Publishes the serialised messages of a bag as they are, whatever their type.

    Message number i goes out at start + (log time i - log time 0) / rate on the monotonic clock,
    so that lateness of one message never shifts the next ones.  Where reliable subscribers fall
    behind by thousands of messages the middleware makes the player wait for them, and with rate 0
    nothing else does; best-effort subscribers cannot slow it down.
    """

    def __init__(self) -> None:
        super().__init__("player")
        bag = self.declare("bag", "", "bag to play: .mcap file or rosbag2 folder")
        topics = self.declare("topics", [""], "topics to play; default: all of the bag")
        self._rate = self.declare(
            "rate",
            1.0,
            "speed: 1.0 as recorded; 0.0 as fast as reliable subscribers acknowledge",
            minimum=0.0,
            maximum=1e6,
        )
        self._loop = self.declare("loop", False, "start again at the end, until stopped")
        self._wait_for_subscribers = self.declare(
            "wait_for_subscribers",
            0,
            "subscriptions that each topic must have before the first message goes out",
            minimum=0,
            maximum=1000,
        )
        self._wait_timeout_s = self.declare(
            "wait_timeout_s", 30.0, "longest wait for subscribers", minimum=0.0, maximum=1e9
        )
        self._start_delay_s = self.declare(
            "start_delay_s",
            0.5,
            "pause before the first message, in which subscriptions are established",
            minimum=0.0,
            maximum=1e9,
        )
        self._restamp = self.declare(
            "restamp",
            False,
            "move header stamps so that the bag's start becomes now, spaced as recorded",
        )
        if not bag:
            raise NodeError("parameter 'bag' is missing: -p bag:=FILE.mcap")
        self._reader = BagReader(bag)
        for warning in self._reader.warnings:
            self.get_logger().warning(warning)
        self._outlets = self._make_outlets([topic for topic in topics if topic])
        self._sent = dict.fromkeys(self._outlets, 0)
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._work, name="playback", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether playback has ended, successfully or not."""
        return not self._thread.is_alive()

    def finish(self) -> None:
        """Stop playback, report what was sent, raise what went wrong."""
        self._stop.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure
        for topic, outlet in self._outlets.items():
            count = self._sent[topic]
            print(f"{outlet.publisher.topic_name}: {count} messages sent", flush=True)

    def destroy_node(self) -> None:
        """End playback also when the node ends by an error."""
        self._stop.set()
        self._thread.join()
        super().destroy_node()

    def _make_outlets(self, topics: list[str]) -> dict[str, _Outlet]:
        outlets = {}
        for name in topics or self._reader.topics:
            info = self._reader.topic(name)
            try:
                outlets[name] = self._make_outlet(info)
            except NodeError as error:
                if topics:
                    raise
                self.get_logger().warning(f"{name} is not played: {error}")
        if not outlets:
            raise NodeError(f"{self._reader.path}: holds nothing that can be played")
        return outlets

    def _make_outlet(self, info: TopicInfo) -> _Outlet:
        if info.message_encoding != "cdr":
            raise NodeError(f"it is encoded as {info.message_encoding}, expected cdr")
        message_class = import_message_class(info.type_name)
        try:
            publisher = self.create_publisher(
                message_class,
                info.name,
                self._qos(info),
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )
        except INVALID_ENDPOINT as error:
            raise NodeError(f"topic {info.name} cannot be published: {error}") from None
        fields = list(message_class.get_fields_and_field_types().values())
        has_header = bool(fields) and fields[0] == "std_msgs/Header"
        reliable = self.get_parameter_or(
            f"qos_overrides.{publisher.topic_name}.publisher.reliability"
        ).value
        return _Outlet(publisher, has_header, reliable == "reliable")

    def _qos(self, info: TopicInfo) -> QoSProfile:
        """The strongest of what the recorded publishers offered: it suits all their subscribers.

        "Keep all", because with "keep last" a reliable subscriber that stalls for a moment has
        lost what was overwritten until the middleware's next heartbeat (Fast DDS: 3 s).  Latched
        topics keep what they kept.
        """
        reliable = not info.qos or any(qos.reliability == "reliable" for qos in info.qos)
        local = any(qos.durability == "transient_local" for qos in info.qos)
        keep_all = reliable and not local
        return QoSProfile(
            history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST,
            depth=max((qos.depth for qos in info.qos), default=10),
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if local else DurabilityPolicy.VOLATILE,
        )

    def _work(self) -> None:
        try:
            self._await_subscribers()
            if not self._stop.wait(self._start_delay_s):
                self._play()
            self._await_acknowledgements()
        except Exception as error:
            self._failure = error

    def _await_subscribers(self) -> None:
        needed = self._wait_for_subscribers
        deadline = time.monotonic() + self._wait_timeout_s
        waiting = list(self._outlets)
        while waiting and not self._stop.wait(_POLL_S):
            waiting = [
                f"{outlet.publisher.topic_name} "
                f"({outlet.publisher.get_subscription_count()} of {needed})"
                for outlet in self._outlets.values()
                if outlet.publisher.get_subscription_count() < needed
            ]
            if waiting and time.monotonic() > deadline:
                raise NodeError(
                    f"no subscribers within {self._wait_timeout_s:g} s on {', '.join(waiting)}"
                )

    def _play(self) -> None:
        outlets, sent, stop = self._outlets, self._sent, self._stop
        first_ns: int | None = None
        start_ns = shift_ns = 0
        while True:
            last_ns, count = first_ns, 0
            for message in self._reader.messages(list(outlets)):
                if first_ns is None:
                    first_ns = message.log_time_ns
                    start_ns = time.monotonic_ns()
                    shift_ns = time.time_ns() - first_ns
                if self._rate > 0.0:
                    due_ns = start_ns + int((message.log_time_ns - first_ns) / self._rate)
                    self._sleep_until(due_ns)
                if stop.is_set():
                    return
                self._publish(message, outlets[message.topic], shift_ns)
                sent[message.topic] += 1
                last_ns = message.log_time_ns
                count += 1
            if not self._loop or count == 0:
                return
            # The next round starts one mean period after the last message.
            round_ns = (last_ns - first_ns) + (last_ns - first_ns) // max(count - 1, 1)
            start_ns += int(round_ns / self._rate) if self._rate > 0.0 else 0
            shift_ns += round_ns

    def _publish(self, message: Message, outlet: _Outlet, shift_ns: int) -> None:
        data = message.data
        if self._restamp and outlet.has_header:
            data = cdr.restamped(data, cdr.read_header(data).stamp_ns + shift_ns)
        deadline = None
        while not self._stop.is_set():
            try:
                return outlet.publisher.publish(data)
            except rclpy_implementation.RCLError as error:
                # A reliable subscriber has fallen behind for longer than the middleware waits.
                deadline = deadline or time.monotonic() + _ACKNOWLEDGEMENT_TIMEOUT_S
                if not outlet.is_reliable or time.monotonic() > deadline:
                    raise NodeError(
                        f"{message.topic}: a message of {len(data)} bytes is not taken: {error}"
                    ) from None

    def _sleep_until(self, due_ns: int) -> None:
        while (left_s := (due_ns - time.monotonic_ns()) * 1e-9) > 0.0:
            if left_s > 2 * _POLL_S:
                if self._stop.wait(left_s - _POLL_S):
                    return
            else:
                time.sleep(left_s)

    def _await_acknowledgements(self) -> None:
        deadline = time.monotonic() + _ACKNOWLEDGEMENT_TIMEOUT_S
        for topic, outlet in self._outlets.items():
            if not outlet.is_reliable:
                continue
            while not outlet.publisher.wait_for_all_acked(Duration(seconds=0.1)):
                if time.monotonic() > deadline:
                    self.get_logger().warning(
                        f"{topic}: a subscriber has not acknowledged all messages within "
                        f"{_ACKNOWLEDGEMENT_TIMEOUT_S:g} s"
                    )
                    return
                if self._stop.is_set():
                    return
        if not all(outlet.is_reliable for outlet in self._outlets.values()):
            self._stop.wait(_LINGER_S)


def main(arguments: list[str] | None = None) -> int:
    """Entry point."""
    return run_node(Player, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
