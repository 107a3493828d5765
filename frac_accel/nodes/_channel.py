"""One topic of the corrector: its filter, its metrics, and what is said of its health."""

import math
import re
import time

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import QoSCompatibility, qos_check_compatible

from frac_accel.nodes._filtered_topic import FilteredTopic
from frac_accel.streaming import health
from frac_accel.streaming.live_metrics import Findings, LiveMetrics, evaluate

# For so many periods stamps advance at another rate before the filter is made for that.
_OTHER_RATE_PERIODS = 2
# A change of health that has been told is not told again for so long.
_TELL_AGAIN_S = 30.0
_NOT_YET_KNOWN = "_NODE_NAME_UNKNOWN_"  # what rmw says then
_LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


class Channel:
    """A filtered topic of the corrector with its metrics and its diagnostic status."""

    def __init__(self, node, sensor, message_class, type_name, topics, prefix, make_messages,
                 is_optional=False):
        self._node, self._sensor = node, sensor
        self._type_name = type_name
        self.prefix = prefix
        edges = node.value("metrics_bands_hz")
        self._metrics = LiveMetrics(node.value("metrics_window_s"), edges)
        self._evaluation = None
        self._findings = Findings()
        self._counters = {}
        self._newest_stamp_ns = None
        self._alone = ()
        self._is_well, self._counts, self._known = False, None, ((), ())
        self._zero_stamps, self._summary = False, (None, {})
        self._told, self._told_s = "", {}
        self._other_rate_periods = 0
        self.topic = FilteredTopic(
            node, message_class, topics, node.value("depth"), node.worker, make_messages,
            is_optional, self._on_processed, sensor.value("on_two_publishers"))

    def _on_processed(self, processed, now_ns):
        self._metrics.add(processed.raw, processed.stamps_ns, processed.values,
                          processed.arrivals_ns, now_ns)
        if len(processed.raw.stamps_ns) and not processed.raw.stamps_ns[-1]:
            self._zero_stamps = True
        if len(processed.stamps_ns):
            self._newest_stamp_ns = int(processed.stamps_ns[-1])

    def evaluate(self, worker, reference):
        """Judge the signals of now in another thread; returns figures of those before."""
        figures = {}
        if self._evaluation is not None:
            if not self._evaluation.done():
                return figures
            figures, self._findings = self._evaluation.result()
        self._evaluation = worker.submit(evaluate, self._metrics.snapshot(reference, self._design))
        return figures

    def follow_rate(self):
        """Begin anew where the sensor has changed the rate that was estimated for it."""
        rate_hz, design = self._findings.stamp_rate_hz, self._design
        other = (rate_hz and design and not self._sensor.value("sample_rate_hz")
                 and abs(rate_hz / design.sampling_rate_hz - 1) > health.RATE_SHARE)
        self._other_rate_periods = self._other_rate_periods + 1 if other else 0
        if self._other_rate_periods >= _OTHER_RATE_PERIODS:
            self._other_rate_periods = 0
            self._node.get_logger().warning(
                f"{self.topic.name}: stamps advance at {rate_hz:.6g} Hz, no longer at "
                f"{design.sampling_rate_hz:.6g} Hz: the filter is made again")
            self.topic.begin_anew()

    def is_used(self):
        """Whether anybody has ever published on the raw topic."""
        return (self.topic.last_message_s is not None
                or bool(self._node.count_publishers(self.topic.name)))

    def report(self, period_s, load, reference_silent_s):
        """DiagnosticStatus and figures of the last period."""
        topic = self.topic
        counters = topic.counters
        changes = {name: count - self._counters.get(name, 0) for name, count in counters.items()}
        self._counters = counters
        silent_s = (None if topic.last_message_s is None
                    else time.monotonic() - topic.last_message_s)
        stale_s = (None if topic.last_published_s is None
                   else time.monotonic() - topic.last_published_s)
        design = self._design
        publishers, refused_subscribers = self._others()
        if len(publishers) == 1:
            self._alone = publishers
        level, message = health.judge(health.Situation(
            stale_s=stale_s, stale_after_s=self._sensor.value("stale_after_s"),
            faults=topic.stream.faults if topic.rate_hz else ("",) * 3,
            on_fault=self._sensor.value("on_fault"),
            learns_range=bool(topic.rate_hz) and topic.stream.learns_range,
            other_publishers=tuple(p.node for p in publishers if p not in self._alone),
            frames=(topic.tracks.first_frame, topic.tracks.other_frame),
            takes_first=self._sensor.value("on_two_publishers") == "first",
            topic=topic.name, model_file=self._sensor.value("model_file"), failure=topic.failure,
            designing=topic.designing, publishers=publishers,
            refused_subscribers=refused_subscribers,
            seconds_since_message=silent_s,
            stated_rate_hz=self._sensor.value("sample_rate_hz"),
            sampling_rate_hz=design.sampling_rate_hz if design else None,
            batch_size=topic.stream.batch_size if topic.rate_hz else 0.0,
            warm_up_samples=design.warm_up_samples if design else None,
            counters=counters, changes=changes, load=load, findings=self._findings,
            reference_silent_s=reference_silent_s, zero_stamps=self._zero_stamps,
            without_clock=self._node.is_without_clock))
        if not self._node.is_active:
            level, message = health.OK, "inactive: nothing is published until it is activated"
        self._is_well, self._zero_stamps = level == health.OK, False
        self._tell(level, message)
        figures = {"received_per_s": changes.get("samples", 0) / period_s,
                   "corrected_per_s": changes.get("given", 0) / period_s,
                   "queue_depth": float(topic.take_queue_depth()),
                   **self._metrics.take_latencies()}
        if design:
            figures["sample_rate_hz"] = design.sampling_rate_hz
        if self._newest_stamp_ns is not None:
            figures["stamp_age_s"] = 1e-9 * (self._node.get_clock().now().nanoseconds
                                             - self._newest_stamp_ns)
        values = {"model_file": self._sensor.value("model_file"),
                  "model_sha256": self._sensor.model_hash, **self._in_short(design), **figures,
                  "load": load, **counters}
        status = DiagnosticStatus(
            level=_LEVELS[level], name=f"{self._node.get_name()}: {topic.name}", message=message,
            hardware_id=topic.name,
            values=[KeyValue(key=key, value=f"{value:.6g}" if isinstance(value, float)
                             else str(value)) for key, value in values.items()])
        return status, figures

    def _tell(self, level, message):
        """Log each change of health once in a while."""
        # what differs in numbers only is the same
        kind, now_s = re.sub(r"[0-9.]+", "#", message), time.monotonic()
        if kind == self._told or now_s < self._told_s.get(kind, -math.inf) + _TELL_AGAIN_S:
            self._told = kind
            return
        self._told, self._told_s[kind] = kind, now_s
        logger = self._node.get_logger()
        text = message if self.topic.name in message else f"{self.topic.name}: {message}"
        # three lines, as rclpy allows each of them one severity
        if level == health.OK:
            logger.info(text)
        elif level == health.WARN:
            logger.warning(text)
        else:
            logger.error(text)

    def _in_short(self, design):
        if design is not self._summary[0]:
            self._summary = design, _in_short(design)
        return self._summary[1]

    @property
    def _design(self):
        return self.topic.stream.design if self.topic.stream else None

    def _others(self):
        """`_publishers` and `_refused_subscribers`, looked up where something may be new."""
        counts = (self._node.count_publishers(self.topic.name),
                  self._node.count_subscribers(self.topic.output.topic_name))
        if counts != self._counts or any(counts) and not self._is_well:
            self._counts, self._known = counts, (self._publishers(), self._refused_subscribers())
        return self._known

    def _publishers(self):
        """Who publishes on the raw topic, with why nothing can be received from whom."""
        result = []
        for info in self._node.get_publishers_info_by_topic(self.topic.name):
            compatibility, reason = qos_check_compatible(info.qos_profile, self.topic.qos)
            refusal = ""
            if info.topic_type != self._type_name:
                refusal = f"publishes {info.topic_type}, expected {self._type_name}"
            elif compatibility == QoSCompatibility.ERROR:
                refusal = (f"offers another quality of service ({reason.strip().rstrip(';')}): set "
                           f"qos_overrides.{self.topic.name}.subscription")
            result.append(health.Publisher(_node_of(info), refusal))
        return tuple(result)

    def _refused_subscribers(self):
        """Who asks for the corrected topic with a QoS that it does not offer, and why not."""
        node, topic = self._node, self.topic.output.topic_name
        # as the others see it: the profile that we asked for leaves much to the middleware
        offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)
                   if (info.node_namespace, info.node_name) == (node.get_namespace(),
                                                                node.get_name())]
        result = []
        for info in node.get_subscriptions_info_by_topic(topic) if offered else ():
            compatibility, reason = qos_check_compatible(offered[0], info.qos_profile)
            if compatibility == QoSCompatibility.ERROR:
                result.append(f"{_node_of(info)} ({reason.strip().rstrip(';')})")
        return tuple(result)


def _node_of(info):
    """The node of an endpoint by its name, which discovery tells after the endpoint itself."""
    if info.node_name == _NOT_YET_KNOWN:
        return "a node whose name has not come yet"
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def _in_short(design):
    """What the design of the filter is worth, the worst axis of each."""
    if design is None:
        return {}
    summary = design.summary()
    axes = summary.pop("axes").values()
    return {
        **summary,
        "band_hz": f"{max(axis['band_hz'][0] for axis in axes):.4g} to "
                   f"{min(axis['band_hz'][1] for axis in axes):.4g}",
        **{name: max(axis[name] for axis in axes)
           for name in ("worst_amplitude_error", "worst_phase_error_deg", "noise_gain")},
        "parameter_uncertainty": "; ".join(dict.fromkeys(
            known if isinstance(known, str) else known["method"]
            for known in (axis["parameter_uncertainty"] for axis in axes))),
    }
