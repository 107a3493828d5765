"""Node ``corrector``: raw acceleration in, corrected acceleration with a covariance out."""

import gc
import time
from concurrent.futures import ThreadPoolExecutor

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import QoSCompatibility, qos_check_compatible
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from frac_accel import cdr, correction, health
from frac_accel.correction.apart import design_apart
from frac_accel.correction.stream import ON_FAULT
from frac_accel.errors import FracAccelError
from frac_accel.live_messages import BlockMessages, SampleMessages
from frac_accel.live_metrics import Findings, LiveMetrics, Window, evaluate
from frac_accel.model import SensorModel
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._filtered_topic import (
    ON_TWO_PUBLISHERS,
    FilteredTopic,
    declare_latency_budget,
    raw_qos,
    subscribe_temperature,
)
from frac_accel.nodes._intake import OutsideExecutor, RawSubscription
from frac_accel.nodes._runtime import FracAccelNode, import_message_class, normalised, run_node

_PERIOD_S = 1.0
# For so long stamps advance at another rate before the filter is made for that.
_OTHER_RATE_PERIODS = 2
# Parameters that the filter is designed by, which may change while it runs.
_DESIGN_PARAMETERS = ("model_file", "bandwidth_hz", "lowest_hz", "max_delay_s")
_LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


class Corrector(FracAccelNode):
    """Corrects ``imu/data_raw`` to ``imu/data``, and ``accel/blocks_raw`` to ``accel/blocks``."""

    def __init__(self):
        super().__init__("corrector")
        self._declare_parameters()
        self.worker = ThreadPoolExecutor(1, "design")
        self._judge = ThreadPoolExecutor(1, "metrics")
        self._loader = ThreadPoolExecutor(1, "load")
        model, self.model_hash = None, ""
        if self.value("model_file"):
            model, self.model_hash = SensorModel.load_with_hash(self.value("model_file"))
        depth = self.value("depth")
        type_name = self.value("message_type")
        sample_class = import_message_class(type_name)
        block_class = import_message_class(cdr.POINT_CLOUD2)
        self._samples = _Channel(
            self, sample_class, type_name, ("imu/data_raw", "imu/data"), "",
            lambda stream: SampleMessages(stream, type_name,
                                          lambda data: normalised(data, sample_class)))
        self._blocks = _Channel(
            self, block_class, cdr.POINT_CLOUD2, ("accel/blocks_raw", "accel/blocks"), "blocks/",
            lambda stream: BlockMessages(stream, lambda data: normalised(data, block_class)),
            is_optional=True)
        self._channels = (self._samples, self._blocks)
        if model:
            for channel in self._channels:
                channel.topic.offer(model, self._wishes())
            self._samples.topic.start()
        self._reference = Window(self.value("metrics_window_s"))
        self._reference_type = type_name
        self._reference_s = None
        self._reference_subscription = RawSubscription(
            self, sample_class, "imu/reference", self._on_reference, raw_qos(depth),
            callback_group=OutsideExecutor())
        self._temperature_subscription = subscribe_temperature(
            self, [channel.topic for channel in self._channels])
        self._figures = {}
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.add_on_set_parameters_callback(self._on_parameters)
        self.create_service(Trigger, "~/reload_model", self._on_reload)
        self._cpu_s, self._tick_s = time.process_time(), time.monotonic()
        self.create_timer(_PERIOD_S, self._tick)
        # A collection over all that has been imported takes as long as a hundred samples.
        gc.collect()
        gc.freeze()

    def take_turn(self):
        """Take the reference, which nothing waits for."""
        self._reference_subscription.drain()

    def finish(self):
        """Correct what is waiting and say what has been done."""
        for channel in self._channels:
            channel.topic.drain()
            counters = channel.topic.counters
            if channel is self._samples or counters.get("samples"):
                counts = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
                print(f"{channel.topic.name}: {counts or 'nothing received'}", flush=True)
        for worker in (self.worker, self._judge, self._loader):
            worker.shutdown()

    def _declare_parameters(self):
        self.declare("model_file", "", "sensor model (YAML) to correct with", read_only=False)
        self.declare("allow_model_changes", True,
                     "whether model_file and the wishes for the filter may change while it runs")
        self.declare("design_deadline_s", 10.0,
                     "longest time that loading another model and designing its filter may take",
                     minimum=0.5, maximum=600.0)
        self.declare("plausible_range", [0.0, 0.0],
                     "lowest and highest raw value that can be true; both 0: the model's range, "
                     "or what the record itself says")
        on_fault = self.declare("on_fault", "covariance",
                                "output while an axis is dead, stuck, saturated or held: "
                                "covariance (one that nothing trusts), drop (none) or report (as "
                                "ever)")
        others = self.declare("on_two_publishers", "first",
                              "raw topic with two publishers: first (the other is dropped) or none")
        for name, value, words in (("on_fault", on_fault, ON_FAULT),
                                   ("on_two_publishers", others, ON_TWO_PUBLISHERS)):
            if value not in words:
                raise NodeError(f"parameter '{name}' must be {' or '.join(words)}, got {value!r}")
        if len(self.value("plausible_range")) != 2:
            raise NodeError("parameter 'plausible_range' must be two numbers, got "
                            f"{list(self.value('plausible_range'))}")
        self.declare("largest_rate", 0.0,
                     "largest rate of change of the raw signal that is no fault [1/s]; 0: any",
                     minimum=0.0, maximum=1e15)
        self.declare("stale_after_s", 0.5,
                     "time without a corrected sample after which the output counts as stale",
                     minimum=0.01, maximum=3600.0)
        self.declare("sample_rate_hz", 0.0,
                     "sampling rate of the sensor; 0: estimated from the first hundred stamps",
                     minimum=0.0, maximum=1e8)
        self.declare("bandwidth_hz", 0.0,
                     "highest frequency to correct; 0: where the sensor's gain has fallen to a "
                     "fifth, at most 0.6 of the Nyquist frequency",
                     read_only=False, minimum=0.0, maximum=1e8)
        self.declare("lowest_hz", 0.0,
                     "lowest frequency to correct; 0: none, or where a high-pass leaves a fifth",
                     read_only=False, minimum=0.0, maximum=1e8)
        self.declare("max_delay_s", 0.0,
                     "permitted delay of the filter; 0: the shortest with noise within 30 % of "
                     "an ideal band limit", read_only=False, minimum=0.0, maximum=3600.0)
        self.declare("noise_std", 0.0,
                     "standard deviation of the raw noise where messages come without a "
                     "covariance; 0: the model's", minimum=0.0, maximum=1e12)
        types = " or ".join(cdr.SAMPLE_TYPES)
        type_name = self.declare("message_type", cdr.IMU,
                                 f"type of raw, corrected and reference: {types}")
        if type_name not in cdr.SAMPLE_TYPES:
            raise NodeError(f"parameter 'message_type' must be {types}, got {type_name!r}")
        self.declare("depth", 2000,
                     "queue of each topic: message rate times the longest stall, at least",
                     minimum=1, maximum=10**6)
        declare_latency_budget(self)
        self.declare("metrics_window_s", 2.0, "time over which errors and signals are judged",
                     minimum=0.1, maximum=60.0)
        edges = self.declare("metrics_bands_hz", [0.0],
                             "ascending edges of the bands that errors are published for; fewer "
                             "than two: the filter's band only")
        if sorted(set(edges)) != list(edges) or edges[0] < 0:
            raise NodeError("parameter 'metrics_bands_hz' must be ascending frequencies, got "
                            f"{list(edges)}")

    def value(self, name):
        return self.get_parameter(name).value

    def _wishes(self, changed=None):
        """What `design_inverse` is asked for, with parameters that are about to change."""
        values = {name: self.value(name) for name in _DESIGN_PARAMETERS[1:]}
        values.update(changed or {})
        return {name: value or None for name, value in values.items()}

    def make_stream(self, model, wishes):
        """Stream of one topic."""
        stated = tuple(self.value("plausible_range"))
        return correction.Corrector(
            model, self.value("sample_rate_hz"), noise_std=self.value("noise_std") or None,
            plausible_range=stated if any(stated) else None, on_fault=self.value("on_fault"),
            largest_rate=self.value("largest_rate"), **wishes)

    def _on_parameters(self, parameters):
        changed = {p.name: p.value for p in parameters if p.name in _DESIGN_PARAMETERS}
        if not changed:
            return SetParametersResult(successful=True)
        model_file = changed.pop("model_file", self.value("model_file"))
        if not model_file:
            return SetParametersResult(successful=False, reason="model_file: empty, expected the "
                                                                "name of a sensor model")
        reason = self._refusal(model_file, self._wishes(changed))
        return SetParametersResult(successful=not reason, reason=reason)

    def _on_reload(self, _, response):
        model_file = self.value("model_file")
        reason = (self._refusal(model_file, self._wishes()) if model_file else
                  "no model to reload: set the parameter model_file")
        response.success, response.message = not reason, reason or f"{model_file} is in use"
        return response

    def _refusal(self, model_file, wishes):
        """Go on with a model and wishes; or why not, with nothing changed."""
        if not self.value("allow_model_changes"):
            return "allow_model_changes is false: the model stays as it was at the start"
        try:
            self._exchange(model_file, wishes)
        except FracAccelError as error:
            return str(error)
        except Exception as error:  # a model must not end the node
            self.get_logger().error(f"{model_file}: {type(error).__name__}: {error}")
            return f"{model_file}: cannot be used: {type(error).__name__}"
        return ""

    def _exchange(self, model_file, wishes):
        """Go on with a model and wishes; where they are bad, raise and change nothing."""
        topics = [channel.topic for channel in self._channels]
        rates = {topic.rate_hz or self.value("sample_rate_hz") or None for topic in topics} - {None}
        # in a process of its own: this one must not wait for it
        attempt = self._loader.submit(design_apart, model_file, rates, wishes,
                                      self.value("design_deadline_s"))
        while not attempt.done():
            for topic in topics:
                topic.take_in()
            if time.monotonic() - self._tick_s > _PERIOD_S:
                self._tick()
        model, model_hash, designs = attempt.result()
        for topic in topics:
            topic.prepare(model, wishes, designs.get(topic.rate_hz))
        self.model_hash = model_hash
        for topic in topics:
            topic.replace(model, wishes)
        self.get_logger().info(f"{model_file} (sha256 {model_hash}) is in use")

    def _on_reference(self, batch):
        try:
            samples = cdr.read_samples(self._reference_type, [message.data for message in batch])
        except FracAccelError as error:
            self.get_logger().warning(f"reference: {error}", throttle_duration_sec=10.0)
            return
        self._reference.add(samples.stamps_ns, samples.values)
        self._reference_s = time.monotonic()

    def _tick(self):
        """Publish diagnostics and metrics."""
        now_s = time.monotonic()
        cpu_s = time.process_time()
        period_s = now_s - self._tick_s
        load = (cpu_s - self._cpu_s) / period_s
        self._tick_s, self._cpu_s = now_s, cpu_s
        self.publish_figure("load", load)
        silent_s = None if self._reference_s is None else now_s - self._reference_s
        lost = silent_s is None or silent_s > health.SILENT_AFTER_S
        used = [channel for channel in self._channels if channel.is_used()] or [self._samples]
        statuses = []
        for channel in used:
            statuses.append(channel.report(period_s, load, silent_s))
            channel.evaluate(self._judge, None if lost else self._reference)
            channel.follow_rate()
        array = DiagnosticArray(status=statuses)
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    def publish_figure(self, name, value):
        if name not in self._figures:
            # without handlers of QoS events, which the executor would wait for in every cycle
            self._figures[name] = self.create_publisher(
                Float64, f"~/metrics/{name}", 10,
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
        self._figures[name].publish(Float64(data=float(value)))


class _Channel:
    """A filtered topic of the corrector with its metrics and its diagnostic status."""

    def __init__(self, node, message_class, type_name, topics, prefix, make_messages,
                 is_optional=False):
        self._node = node
        self._type_name = type_name
        self._prefix = prefix
        edges = node.value("metrics_bands_hz")
        self._metrics = LiveMetrics(node.value("metrics_window_s"), edges)
        self._evaluation = None
        self._findings = Findings()
        self._counters = {}
        self._newest_stamp_ns = None
        self._alone = ()
        self._other_rate_periods = 0
        self.topic = FilteredTopic(
            node, message_class, topics, node.value("depth"), node.worker,
            lambda model, wishes: make_messages(node.make_stream(model, wishes)), is_optional,
            self._on_processed, node.value("on_two_publishers"))

    def _on_processed(self, processed, now_ns):
        self._metrics.add(processed.raw, processed.stamps_ns, processed.values,
                          1e-9 * (now_ns - processed.arrivals_ns))
        if len(processed.stamps_ns):
            self._newest_stamp_ns = int(processed.stamps_ns[-1])

    def evaluate(self, worker, reference):
        """Judge the signals of now in another thread; publish what was found in those before."""
        if self._evaluation is not None:
            if not self._evaluation.done():
                return
            figures, self._findings = self._evaluation.result()
            self._publish(figures)
        self._evaluation = worker.submit(evaluate, self._metrics.snapshot(reference, self._design))

    def follow_rate(self):
        """Begin anew where the sensor has changed the rate that was estimated for it."""
        rate_hz, design = self._findings.stamp_rate_hz, self._design
        other = (rate_hz and design and not self._node.value("sample_rate_hz")
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
        return self.topic.last_message_s is not None or bool(self._publishers())

    def report(self, period_s, load, reference_silent_s):
        """Publish the figures of the last period; returns the DiagnosticStatus."""
        topic = self.topic
        counters = topic.counters
        changes = {name: count - self._counters.get(name, 0) for name, count in counters.items()}
        self._counters = counters
        silent_s = (None if topic.last_message_s is None
                    else time.monotonic() - topic.last_message_s)
        stale_s = (None if topic.last_published_s is None
                   else time.monotonic() - topic.last_published_s)
        design, publishers = self._design, self._publishers()
        if len(publishers) == 1:
            self._alone = publishers
        level, message = health.judge(health.Situation(
            stale_s=stale_s, stale_after_s=self._node.value("stale_after_s"),
            faults=topic.stream.faults if topic.rate_hz else ("",) * 3,
            on_fault=self._node.value("on_fault"),
            other_publishers=tuple(p.node for p in publishers if p not in self._alone),
            frames=(topic.tracks.first_frame, topic.tracks.other_frame),
            takes_first=self._node.value("on_two_publishers") == "first",
            topic=topic.name, model_file=self._node.value("model_file"), failure=topic.failure,
            designing=topic.designing, publishers=publishers,
            refused_subscribers=self._refused_subscribers(),
            seconds_since_message=silent_s,
            stated_rate_hz=self._node.value("sample_rate_hz"),
            sample_rate_hz=design.sampling_rate_hz if design else None,
            warm_up_samples=design.warm_up_samples if design else None,
            counters=counters, changes=changes, load=load, findings=self._findings,
            reference_silent_s=reference_silent_s))
        figures = {"received_per_s": changes.get("samples", 0) / period_s,
                   "corrected_per_s": changes.get("given", 0) / period_s,
                   "queue_depth": float(topic.take_queue_depth()),
                   **self._metrics.take_latencies()}
        if design:
            figures["sample_rate_hz"] = design.sampling_rate_hz
        if self._newest_stamp_ns is not None:
            figures["stamp_age_s"] = 1e-9 * (self._node.get_clock().now().nanoseconds
                                             - self._newest_stamp_ns)
        self._publish(figures)
        values = {"model_file": self._node.value("model_file"),
                  "model_sha256": self._node.model_hash, **_in_short(design), **figures,
                  "load": load, **counters}
        return DiagnosticStatus(
            level=_LEVELS[level], name=f"{self._node.get_name()}: {topic.name}", message=message,
            hardware_id=topic.name,
            values=[KeyValue(key=key, value=f"{value:.6g}" if isinstance(value, float)
                             else str(value)) for key, value in values.items()])

    @property
    def _design(self):
        return self.topic.stream.design if self.topic.stream else None

    def _publish(self, figures):
        for name, value in figures.items():
            self._node.publish_figure(self._prefix + name, value)

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
            name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            result.append(health.Publisher(name, refusal))
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
                name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                result.append(f"{name} ({reason.strip().rstrip(';')})")
        return tuple(result)


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


def main(arguments=None):
    """Entry point."""
    return run_node(Corrector, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
