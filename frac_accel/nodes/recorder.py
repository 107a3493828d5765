"""Node ``recorder``: topics to MCAP, byte for byte, safe against being killed."""

from __future__ import annotations

import time
from functools import partial

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from frac_accel.io.bag import BagWriter, Qos
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._intake import RawMessage, RawSubscription
from frac_accel.nodes._runtime import FracAccelNode, import_message_class, run_node

_DISCOVERY_PERIOD_S = 0.1
_NEVER_BY_DEFAULT = ("/rosout", "/parameter_events")


class Recorder(FracAccelNode):
    """Writes serialised messages as they come, with the times of sending and receiving.

    Every ``flush_period_s`` the chunk is ended and the disk has confirmed it: whatever happens
    to the process then, all messages up to there are readable.  A topic is subscribed to as soon
    as it has a publisher, with a QoS that all of its publishers offer.
    """

    def __init__(self) -> None:
        super().__init__("recorder")
        bag = self.declare("bag", "", "bag to write: .mcap file, else a new rosbag2 folder")
        topics = self.declare("topics", [""], "topics to record; default: all")
        self._depth = self.declare(
            "depth",
            10_000,
            "queue of each subscription: message rate times the longest stall, at least",
            minimum=1,
            maximum=10**7,
        )
        flush_period_s = self.declare(
            "flush_period_s",
            1.0,
            "longest time that a received message is not yet safe on the disk",
            minimum=0.01,
            maximum=3600.0,
        )
        self._max_messages = self.declare(
            "max_messages", 0, "stop after so many messages; 0: never", minimum=0, maximum=2**53
        )
        self._idle_timeout_s = self.declare(
            "idle_timeout_s",
            0.0,
            "stop when nothing has come for so long, counted from the first message; 0: never",
            minimum=0.0,
            maximum=1e9,
        )
        if not bag:
            raise NodeError("parameter 'bag' is missing: -p bag:=FILE.mcap")
        self._topics = [self.resolve_topic_name(topic) for topic in topics if topic]
        self._subscriptions_by_topic: dict[str, RawSubscription] = {}
        self._refused: set[str] = set()
        self._count = self._flushed = 0
        self._last_message_s: float | None = None
        self._writer = BagWriter(bag, in_place=True)
        self.create_timer(flush_period_s, self._flush)
        self.create_timer(_DISCOVERY_PERIOD_S, self._look_for_topics)
        self._look_for_topics()

    @property
    def done(self) -> bool:
        """Whether a stop condition is met."""
        if self._max_messages and self._count >= self._max_messages:
            return True
        if not self._idle_timeout_s or self._last_message_s is None:
            return False
        return time.monotonic() - self._last_message_s > self._idle_timeout_s

    def finish(self) -> None:
        """Take what is still waiting, close the bag and report."""
        for subscription in self._subscriptions_by_topic.values():
            subscription.drain()
        self._writer.close()
        for topic, subscription in self._subscriptions_by_topic.items():
            lost = f", {subscription.lost} lost" if subscription.lost else ""
            print(f"{topic}: {self._writer.counts[topic]} messages recorded{lost}", flush=True)
        for topic in self._topics:
            if topic not in self._subscriptions_by_topic:
                print(f"{topic}: never had a publisher, nothing recorded", flush=True)

    def destroy_node(self) -> None:
        """Close the bag also when the node ends by an error."""
        self._writer.close()
        super().destroy_node()

    def _look_for_topics(self) -> None:
        for topic, types in self.get_topic_names_and_types():
            wanted = topic in self._topics if self._topics else topic not in _NEVER_BY_DEFAULT
            if not wanted or topic in self._subscriptions_by_topic or topic in self._refused:
                continue
            publishers = self.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            try:
                if len(types) > 1:
                    raise NodeError(f"it has {len(types)} types: {', '.join(types)}")
                message_class = import_message_class(types[0])
            except NodeError as error:
                self._refused.add(topic)
                self.get_logger().error(f"{topic} is not recorded: {error}")
                continue
            self._subscribe(topic, types[0], message_class, publishers)

    def _subscribe(self, topic: str, type_name: str, message_class: type, publishers) -> None:
        offered = [publisher.qos_profile for publisher in publishers]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        local = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        qos = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=self._depth,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if local else DurabilityPolicy.VOLATILE,
        )
        type_hash = str(publishers[0].topic_type_hash)
        has_definition = self._writer.add_topic(
            topic,
            type_name,
            tuple(dict.fromkeys(_stored_qos(one) for one in offered)),
            type_hash if type_hash.startswith("RIHS") else "",
        )
        if not has_definition:
            self.get_logger().warning(
                f"{topic}: no definition of {type_name} found (AMENT_PREFIX_PATH); "
                "viewers cannot decode the messages"
            )
        self._subscriptions_by_topic[topic] = RawSubscription(
            self, message_class, topic, partial(self._record, topic), qos
        )
        self.get_logger().info(f"recording {topic} ({type_name})")

    def _record(self, topic: str, messages: list[RawMessage]) -> None:
        if self._max_messages:
            messages = messages[: self._max_messages - self._count]
        for message in messages:
            self._writer.write(
                topic, message.data, message.received_time_ns, message.source_time_ns
            )
        self._count += len(messages)
        self._last_message_s = time.monotonic()

    def _flush(self) -> None:
        if self._flushed == self._count:
            return
        self._writer.flush()
        self._flushed = self._count
        self.get_logger().debug(f"{self._flushed} messages are safe")


def _stored_qos(offered: QoSProfile) -> Qos:
    """A publisher's QoS as a bag stores it; discovery does not tell history and depth."""
    reliable = offered.reliability == ReliabilityPolicy.RELIABLE
    local = offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return Qos(
        "reliable" if reliable else "best_effort", "transient_local" if local else "volatile"
    )


def main(arguments: list[str] | None = None) -> int:
    """Entry point."""
    return run_node(Recorder, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
