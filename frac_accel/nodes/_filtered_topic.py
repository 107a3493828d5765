"""One topic through a filter to another: what `corrector` and `virtual_sensor` have in common."""

import bisect
import time

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Temperature

from frac_accel.errors import FracAccelError
from frac_accel.io import cdr
from frac_accel.nodes._errors import INVALID_ENDPOINT, NodeError
from frac_accel.nodes._intake import RawSubscription, publish_serialized
from frac_accel.streaming.publisher_tracks import PublisherTracks

# Messages that wait for longer than this and the budget before what they bring is published count
# as late.
LATE_S = 0.05
# What happens to a topic with two publishers: the one that came first is corrected, or none is.
ON_TWO_PUBLISHERS = ("first", "none")
# Most messages that are held while a filter is being made.
_MOST_HELD = 200_000


def subscribe_temperature(node, filtered_topics, topic="imu/temperature"):
    """Hand what comes on a topic of temperatures to the filters; returns the subscription."""
    def on_message(message):
        for filtered in filtered_topics:
            filtered.set_temperature(message.temperature)

    try:
        return node.create_subscription(Temperature, topic, on_message, qos_profile_sensor_data)
    except INVALID_ENDPOINT as error:
        raise NodeError(f"topic {topic} cannot be subscribed to: {error}") from None


def declare_latency_budget(node):
    """Declare the parameter that says how long messages may wait for each other, and heed it."""
    node.latency_budget_s = 1e-3 * node.declare(
        "latency_budget_ms", 5.0,
        "longest time that a message waits for others to be handled with: costs latency, saves "
        "processor time; 0: each as it comes", minimum=0.0, maximum=100.0)


def raw_qos(depth):
    """QoS for the topic of a sensor."""
    return QoSProfile(depth=depth, reliability=qos_profile_sensor_data.reliability)


class FilteredTopic:
    """Subscription, filter and publisher.

    Whatever takes long (the design of a filter) runs in the worker thread, while messages go on
    being taken and, where there is a filter already, filtered.

    Parameters
    ----------
    node : FracAccelNode
    message_class : type
        Of both topics.
    topics : tuple of str
        Input and output.
    depth : int
        Queue of both topics; the QoS can be overridden by parameters.
    worker : concurrent.futures.ThreadPoolExecutor
        With one thread.
    make : callable
        Returns new `SampleMessages` or `BlockMessages` for a model and the wishes for its filter;
        raises FracAccelError.
    is_optional : bool
        Whether a filter is only made once there are messages.
    on_processed : callable, optional
        Called with each `Processed` after it has been published, and the time of that [ns].
    on_two_publishers : str
        One of `ON_TWO_PUBLISHERS`.

    Attributes
    ----------
    messages : SampleMessages, BlockMessages or None
        None while there is no model.
    failure : str
        Why the last design failed; empty if it did not.
    unfiltered : int
        Messages that came while there was no filter to be had.
    published, unpublished : int
        Outputs that the middleware has taken, and those that it has not.
    withheld : int
        Outputs that came while the node was not active.
    late : int
        Messages that waited for `LATE_S` longer than the node's latency budget.
    overflowed : int
        Messages that were given up because too many were waiting for a filter.
    other_publisher : int
        Messages that were dropped since they came from another publisher, or may have.
    tracks : PublisherTracks
    last_message_s, last_published_s : float or None
        Monotonic time of the last message, and of the last output.
    """

    def __init__(self, node, message_class, topics, depth, worker, make, is_optional=False,
                 on_processed=None, on_two_publishers="first"):
        self.messages = None
        self.failure = ""
        self.unfiltered = self.published = self.unpublished = self.withheld = 0
        self.late = self.overflowed = self._deepest = 0
        self.last_message_s = self.last_published_s = None
        self.other_publisher = 0
        self.tracks = PublisherTracks()
        self._takes_first = on_two_publishers == "first"
        self._node = node
        self._worker = worker
        self._make = make
        self._is_optional = is_optional
        self._offered = self._candidate = self._celsius = None
        self._on_processed = on_processed
        self._intake, self._last_alone = [], None
        self._task = None
        self._hold = False
        self._stream_counters, self._past_counters = {}, {}
        try:
            self._publisher = node.create_publisher(
                message_class, topics[1],
                QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE),
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
                # whoever asks for another QoS is named by the diagnostics
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
        except INVALID_ENDPOINT as error:
            raise NodeError(f"topic {topics[1]} cannot be published: {error}") from None
        self._subscription = RawSubscription(
            node, message_class, topics[0], self._on_messages, raw_qos(depth), is_direct=True)
        node.turns.append(self._advance)

    @property
    def name(self):
        """Resolved name of the input topic."""
        return self._subscription.subscription.topic_name

    @property
    def qos(self):
        """QoS of the input topic."""
        return self._subscription.subscription.qos_profile

    @property
    def output(self):
        """The publisher."""
        return self._publisher

    @property
    def stream(self):
        """The `Stream`, or None."""
        return self.messages.stream if self.messages else None

    @property
    def designing(self):
        """Whether a filter is being made that nothing can be filtered without."""
        return self._task is not None and self.messages is None

    @property
    def counters(self):
        """Counters of the stream and of the messages, as a new dict of str to int."""
        if self._settled:
            current = {**self.stream.counters, "malformed": self.messages.malformed}
            self._stream_counters = {name: count + self._past_counters.get(name, 0)
                                     for name, count in current.items()}
        return {**self._stream_counters, "lost": self._subscription.lost + self.overflowed,
                "other_publisher": self.other_publisher,
                "late": self.late, "without_filter": self.unfiltered, "published": self.published,
                "unpublished": self.unpublished,
                **({"withheld": self.withheld} if self.withheld else {})}

    def take_queue_depth(self):
        """Most messages that were waiting at once since the last call."""
        depth, self._deepest = max(self._deepest, len(self._intake)), 0
        return depth

    @property
    def _settled(self):
        return self.messages is not None and self._task is None

    def offer(self, model, wishes):
        """Filter with this model as soon as there are messages."""
        self._offered = model, wishes

    def set_temperature(self, celsius):
        """Temperature [°C] of the sensor from now on."""
        self._celsius = celsius
        if self.messages is not None:
            self.stream.set_temperature(celsius)

    def start(self):
        """Make the filter for what has been offered now; raises FracAccelError."""
        self._use(self._make(*self._offered))

    def _use(self, messages):
        self.messages = messages
        if self._celsius is not None:
            self.stream.set_temperature(self._celsius)

    def begin_anew(self):
        """Estimate the rate again, from the next messages; what waits in the filter is given up."""
        if not self._settled:
            return
        past = self.counters
        past["cut_off"] += past.pop("waiting")
        self._past_counters, self._stream_counters = past, {**past, "waiting": 0}
        self.messages = None

    @property
    def rate_hz(self):
        """Sampling rate [Hz] that a filter is needed for now; None where it is not known."""
        return self.stream.sampling_rate_hz if self._settled else None

    def prepare(self, model, wishes, design=None):
        """Make another model's filter, of this design if there is one; raises FracAccelError."""
        self._finish_task()
        self._candidate = None
        if self.messages is None and self._is_optional:
            return
        # the thread that designs has the stream for itself while its rate is still unknown
        self._hold = self.messages is None or self.stream.sampling_rate_hz is None
        try:
            if self.messages is None:
                design = self._worker.submit(self._make, model, wishes)
            else:
                design = self._worker.submit(self.stream.prepare, model, design, **wishes)
            while not design.done():
                self._node.take_in()
            self._candidate = design.result()
        finally:
            self._hold = False

    def replace(self, model, wishes):
        """Go on with the model that has been prepared."""
        self._offered, self.failure = (model, wishes), ""
        if self.messages is None:
            self._use(self._candidate)
        else:
            self._publish(self.messages.replace(model, wishes))
        self._advance()

    def drain(self):
        """Filter what is waiting."""
        self._subscription.drain()
        self._finish_task()

    def destroy(self):
        """Leave both topics."""
        self._node.turns.remove(self._advance)
        self._subscription.destroy()
        self._node.destroy_publisher(self._publisher)

    def _finish_task(self):
        while self._task is not None:
            if self._task.done():
                self._collect()
            else:
                self._node.take_in()

    def _of_first(self, batch):
        """Messages of the one publisher that is corrected."""
        count, now_s = self._subscription.subscription.get_publisher_count(), time.monotonic()
        if count <= 1:
            self._last_alone = batch[-1], now_s
            return batch
        if self._last_alone:
            (last, at_s), self._last_alone = self._last_alone, None
            self.tracks.alone(_frame_of(last.data), last.sequence, at_s)
        kept = [message for message in batch
                if self.tracks.is_first(_frame_of(message.data), message.sequence, now_s)]
        if not self._takes_first:
            kept = []
        self.other_publisher += len(batch) - len(kept)
        return kept

    def _on_messages(self, batch):
        self._intake += self._of_first(batch)
        if len(self._intake) > _MOST_HELD:
            self.overflowed += len(self._intake) - _MOST_HELD
            del self._intake[:-_MOST_HELD]
        self.last_message_s = time.monotonic()
        self._advance()

    def _advance(self):
        """Filter what has been taken in, unless the filter is being made."""
        if self._task is not None and self._task.done():
            self._collect()
        if self._task is not None or self._hold or not self._intake:
            return
        if self.messages is None and self._offered and not self.failure:
            self._submit(self._make, *self._offered)
            return
        batch, self._intake = self._intake, []
        self._deepest = max(self._deepest, len(batch))
        if self.messages is None:
            self.unfiltered += len(batch)
            return
        messages = [message.data for message in batch]
        arrivals_ns = [message.received_time_ns for message in batch]
        if self.stream.sampling_rate_hz is None:
            self._submit(self.messages.process, messages, arrivals_ns)
        else:
            self._publish(self.messages.process(messages, arrivals_ns))
        # they came in one after the other
        since_ns = time.time_ns() - int(1e9 * (LATE_S + self._node.latency_budget_s))
        self.late += bisect.bisect_left(arrivals_ns, since_ns)

    def _submit(self, function, *arguments):
        self._task = self._worker.submit(function, *arguments)

    def _collect(self):
        task, self._task = self._task, None
        try:
            result = task.result()
        except Exception as error:  # a model must not end the node
            self.failure = (str(error) if isinstance(error, FracAccelError)
                            else f"{type(error).__name__} in the design")
            if self.messages is not None:
                self.unfiltered += self.stream.counters["waiting"]
                self.messages = None
            self._node.get_logger().error(f"{self.name}: {self.failure}")
            return
        if self.messages is None:
            self._use(result)
        else:
            self._publish(result)
        self._advance()

    def _publish(self, processed):
        messages = processed.messages
        if not self._node.is_active:
            self.withheld += len(messages)
            messages = []
        published = publish_serialized(self._publisher, messages)
        self.published += published
        self.unpublished += len(messages) - published
        if messages:
            self.last_published_s = time.monotonic()
        if self._on_processed:
            self._on_processed(processed, time.time_ns())


def _frame_of(message):
    """Frame of a serialised message; empty where it cannot be read."""
    try:
        return cdr.read_header(message).frame_id
    except FracAccelError:
        return ""
