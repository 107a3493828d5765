"""One accelerometer of the corrector: its parameters, its model, its topics."""

import time

from frac_accel import streaming
from frac_accel.errors import FracAccelError, naming
from frac_accel.io import cdr
from frac_accel.nodes._channel import Channel
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._filtered_topic import raw_qos, subscribe_temperature
from frac_accel.nodes._intake import OutsideExecutor, RawSubscription
from frac_accel.nodes._runtime import import_message_class, normalised
from frac_accel.nodes._sensor_parameters import DESIGN_PARAMETERS
from frac_accel.streaming import health
from frac_accel.streaming.apart import design_apart
from frac_accel.streaming.live_messages import BlockMessages, SampleMessages
from frac_accel.streaming.live_metrics import Window

_SAMPLES, _BLOCKS = ("imu/data_raw", "imu/data"), ("accel/blocks_raw", "accel/blocks")


class Sensor:
    """Corrects what one sensor says.

    Parameters
    ----------
    node : Corrector
        With the parameters of this sensor declared (`declare_sensor`).
    name : str
        Empty for the only one, whose topics are those of the node.

    Attributes
    ----------
    model_hash : str
        SHA-256 of the model's file; empty without a model.
    reported_s, next_report_s : float
        Monotonic time of its last report, and from which on it is to report again.

    Raises
    ------
    FracAccelError
        If a parameter or the model cannot be used.
    """

    def __init__(self, node, name=""):
        self.name, self._node = name, node
        self.model_hash = ""
        self.reported_s = self.next_report_s = 0.0
        self.channels, self._reference_s = [], None
        self._reference_subscription = self._temperature_subscription = None
        try:
            with naming(f"sensor '{name}'" if name else ""):
                self._open()
        except BaseException:
            self.destroy()
            raise

    def _open(self):
        name, node, model = self.name, self._node, None
        if self.value("model_file"):
            model, self.model_hash = node.load(self.value("model_file"))
            self._warn(model, self.value("model_file"))
        elif name:
            raise NodeError(f"parameter '{name}.model_file' is missing")
        type_name = self.value("message_type")
        if name:
            topics = self._own_topics(_BLOCKS if type_name == cdr.POINT_CLOUD2 else _SAMPLES)
            self.channels.append(self._channel(type_name, topics))
        else:
            self.channels.append(self._channel(type_name, _SAMPLES))
            self.channels.append(self._channel(cdr.POINT_CLOUD2, _BLOCKS, "blocks/", True))
        self._check_outputs()
        if model:
            for channel in self.channels:
                channel.topic.offer(model, self._wishes())
            if not node.is_running:
                self.channels[0].topic.start()
        self._reference = Window(self.value("metrics_window_s"))
        if topic := (self.value("reference_topic") if name else "imu/reference"):
            self._reference_subscription = RawSubscription(
                node, import_message_class(type_name), topic, self._on_reference,
                raw_qos(self.value("depth")), callback_group=OutsideExecutor())
        if topic := self._temperature_topic(model):
            self._temperature_subscription = subscribe_temperature(
                node, [channel.topic for channel in self.channels], topic)

    def _check_outputs(self):
        """Refuse what would correct its own output, or mix it with that of another sensor."""
        for channel in self.channels:
            raw, corrected = channel.topic.name, channel.topic.output.topic_name
            if raw == corrected:
                raise NodeError(f"{raw} is the raw and the corrected topic, expected two")
            for other in self._node.sensors.values():
                if corrected in (each.topic.output.topic_name for each in other.channels):
                    raise NodeError(f"{corrected} is the corrected topic of sensor "
                                    f"'{other.name}', too")

    def value(self, name):
        """Value of a parameter: the sensor's own, or the node's where it has none."""
        own = f"{self.name}.{name}"
        return self._node.value(own if self._node.has_parameter(own) else name)

    def describe(self):
        """What is corrected with which model, for the log."""
        topic, model = self.channels[0].topic, self.value("model_file")
        with_what = f"{model} (sha256 {self.model_hash[:12]})" if model else "no model yet"
        return (f"corrects {topic.name} ({self.value('message_type')}) to "
                f"{topic.output.topic_name} with {with_what}")

    def report(self, period_s, load):
        """Statuses and figures of the last period."""
        silent_s = None if self._reference_s is None else time.monotonic() - self._reference_s
        lost = silent_s is None or silent_s > health.SILENT_AFTER_S
        used = [channel for channel in self.channels if channel.is_used()] or self.channels[:1]
        statuses, figures = [], {}
        for channel in used:
            status, own = channel.report(period_s, load, silent_s)
            own.update(channel.evaluate(self._node.judge, None if lost else self._reference))
            channel.follow_rate()
            statuses.append(status)
            figures.update({channel.prefix + name: value for name, value in own.items()})
        return statuses, figures

    def take_reference(self):
        """Take in the reference, which nothing waits for."""
        if self._reference_subscription:
            self._reference_subscription.drain()

    def finish(self):
        """Correct what is waiting and say what has been done."""
        for channel in self.channels:
            channel.topic.drain()
            counters = channel.topic.counters
            if channel is self.channels[0] or counters.get("samples"):
                counts = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
                print(f"{channel.topic.name}: {counts or 'nothing received'}", flush=True)

    def destroy(self):
        """Leave its topics."""
        for channel in self.channels:
            channel.topic.destroy()
        if self._reference_subscription:
            self._reference_subscription.destroy()
        if self._temperature_subscription:
            self._node.destroy_subscription(self._temperature_subscription)

    def refusal(self, changed=None):
        """Go on with other values of `DESIGN_PARAMETERS`; or why not, with nothing changed."""
        values = dict(changed or {})
        model_file = values.pop("model_file", self.value("model_file"))
        if not model_file:
            return "model_file: empty, expected the name of a sensor model"
        if not self._node.value("allow_model_changes"):
            return "allow_model_changes is false: the model stays as it was at the start"
        try:
            self._exchange(model_file, self._wishes(values))
        except FracAccelError as error:
            return str(error)
        except Exception as error:  # a model must not end the node
            self._node.get_logger().error(f"{model_file}: {type(error).__name__}: {error}")
            return f"{model_file}: cannot be used: {type(error).__name__}"
        return ""

    def _exchange(self, model_file, wishes):
        """Go on with a model and wishes; where they are bad, raise and change nothing."""
        topics = [channel.topic for channel in self.channels]
        rates = {topic.rate_hz or self.value("sample_rate_hz") or None for topic in topics} - {None}
        model, model_hash, designs = self._node.apart(
            design_apart, model_file, rates, wishes, self.value("design_deadline_s"))
        for topic in topics:
            topic.prepare(model, wishes, designs.get(topic.rate_hz))
        self.model_hash = model_hash
        for topic in topics:
            topic.replace(model, wishes)
        self._node.get_logger().info(
            f"{topics[0].name}: {model_file} (sha256 {model_hash}) is in use")
        self._warn(model, model_file)

    def _warn(self, model, model_file):
        if model.of_one_record:
            self._node.get_logger().warning(f"{model_file}: {model.of_one_record}")

    def _wishes(self, changed=None):
        """What `design_inverse` is asked for, with parameters that are about to change."""
        values = {name: self.value(name) for name in DESIGN_PARAMETERS[1:]}
        values.update(changed or {})
        return {name: value or None for name, value in values.items()}

    def _own_topics(self, defaults):
        namespace = self.value("namespace") or self.name
        return tuple(self.value(key) or f"{namespace}/{default}"
                     for key, default in zip(("raw_topic", "corrected_topic"), defaults))

    def _temperature_topic(self, model):
        if not self.name:
            return "imu/temperature"
        if not self.value("temperature_topic") and model.needs_temperature:
            return f"{self.value('namespace') or self.name}/imu/temperature"
        return self.value("temperature_topic")

    def _channel(self, type_name, topics, prefix="", is_optional=False):
        message_class = import_message_class(type_name)
        frame_id = self.value("frame_id")

        def plain(data):
            return normalised(data, message_class)

        def make(model, wishes):
            stream = self._make_stream(model, wishes)
            return (BlockMessages(stream, plain, frame_id) if type_name == cdr.POINT_CLOUD2
                    else SampleMessages(stream, type_name, plain, frame_id))

        return Channel(self._node, self, message_class, type_name, topics, prefix, make,
                       is_optional)

    def _make_stream(self, model, wishes):
        stated = tuple(self.value("plausible_range"))
        return streaming.Corrector(
            model, self.value("sample_rate_hz"), noise_std=self.value("noise_std") or None,
            plausible_range=stated if any(stated) else None, on_fault=self.value("on_fault"),
            largest_rate=self.value("largest_rate"), **wishes)

    def _on_reference(self, batch):
        try:
            samples = cdr.read_samples(self.value("message_type"),
                                       [message.data for message in batch])
        except FracAccelError as error:
            self._node.get_logger().warning(f"reference: {error}", throttle_duration_sec=10.0)
            return
        self._reference.add(samples.stamps_ns, samples.values)
        self._reference_s = time.monotonic()
