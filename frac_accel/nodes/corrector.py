"""Node ``corrector``: raw acceleration in, corrected acceleration with a covariance out."""

import ctypes
import gc
import re
import time
from concurrent.futures import ThreadPoolExecutor

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from frac_accel.errors import FracAccelError
from frac_accel.io import cdr
from frac_accel.model import SensorModel
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._filtered_topic import declare_latency_budget
from frac_accel.nodes._runtime import FracAccelNode, run_node
from frac_accel.nodes._sensor import Sensor
from frac_accel.nodes._sensor_parameters import (
    DESIGN_PARAMETERS,
    SENSOR_PARAMETERS,
    TOPICS,
    declare_sensor,
    forget_sensor,
)
from frac_accel.streaming.apart import design_apart

_PERIOD_S = 1.0
_SENSOR_NAME = re.compile(r"[A-Za-z]\w*")


class Corrector(FracAccelNode):
    """Corrects ``imu/data_raw`` to ``imu/data``, and ``accel/blocks_raw`` to ``accel/blocks``.

    Or what many sensors say, each below its name: parameter ``sensors``.
    """

    def __init__(self, name="corrector", is_managed=False, **options):
        super().__init__(name, **options)
        self.is_running, self.is_active = False, not is_managed
        self.sensors, self._models, self._figures, self._services_opened = {}, {}, {}, []
        self._declare_parameters()
        names = self._names_at_start()
        for name in names:
            self._check_name(name, names)
            declare_sensor(self, name)
        if not is_managed:
            self.open()

    def open(self):
        """Load the models, design their filters, and take part: topics, services, diagnostics.

        Raises
        ------
        FracAccelError
            If a parameter or a model cannot be used; `close` then leaves what there is.
        """
        self.worker = ThreadPoolExecutor(1, "design")
        self.judge = ThreadPoolExecutor(1, "metrics")
        self._loader = ThreadPoolExecutor(1, "load")
        names = self._names_at_start()
        for name in names or [""]:
            if name and not self.has_parameter(f"{name}.model_file"):
                declare_sensor(self, name)  # it was removed meanwhile
            self.sensors[name] = Sensor(self, name)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._metrics = self.create_publisher(DiagnosticArray, "~/metrics", 10)
        self.add_on_set_parameters_callback(self._on_parameters)
        self._services_opened = [self.create_service(Trigger, "~/reload_model", self._on_reload)]
        if names:
            self._services_opened += [
                self.create_service(SetParametersAtomically, name, callback)
                for name, callback in (("~/add_sensor", self._on_add),
                                       ("~/remove_sensor", self._on_remove))]
        self._load, self._cpu_s, self._load_s = 0.0, time.process_time(), time.monotonic()
        self._spread_reports()
        self.turns.append(self._take_turn)
        self.is_running = True
        for sensor in self.sensors.values():
            self.get_logger().info(sensor.describe())
        # A collection over all that has been imported takes as long as a hundred samples.
        gc.collect()
        gc.freeze()
        _give_back_memory()

    def close(self):
        """Undo `open`, however far it has come."""
        for sensor in self.sensors.values():
            sensor.destroy()
            if sensor.name not in self.value("sensors"):
                forget_sensor(self, sensor.name)
        for service in self._services_opened:
            self.destroy_service(service)
        if self.is_running:
            self.turns.remove(self._take_turn)
            self.remove_on_set_parameters_callback(self._on_parameters)
            for publisher in (self._diagnostics, self._metrics, *self._figures.values()):
                self.destroy_publisher(publisher)
        self.sensors, self._models, self._figures, self._services_opened = {}, {}, {}, []
        self.is_running = False

    def finish(self):
        """Correct what is waiting and say what has been done."""
        for sensor in self.sensors.values():
            sensor.finish()
        if self.sensors:
            for worker in (self.worker, self.judge, self._loader):
                worker.shutdown()

    def _names_at_start(self):
        return [name for name in self.value("sensors") if name]

    def value(self, name):
        """Value of a parameter."""
        return self.get_parameter(name).value

    @property
    def is_without_clock(self):
        """Whether the time is to come from ``/clock`` and does not."""
        return self.value("use_sim_time") and not self.get_clock().now().nanoseconds

    def load(self, model_file):
        """Model and hash of a file; sensors with the same one share it, and its design."""
        model, model_hash = SensorModel.load_with_hash(model_file)
        return self._models.setdefault(model_hash, model), model_hash

    def apart(self, function, *arguments):
        """Result of what takes its time in a process of its own: this one goes on meanwhile."""
        attempt = self._loader.submit(function, *arguments)
        while not attempt.done():
            self.take_in()
            self.take_turn()
        return attempt.result()

    def _declare_parameters(self):
        names = self.declare(
            "sensors", [""], "names of sensors, whose parameters stand below these; none: the one "
                             "on imu/data_raw and accel/blocks_raw")
        is_one = not any(names)
        declare_sensor(self)
        self.declare("allow_model_changes", True,
                     "whether model_file, the wishes for the filter and the sensors may change "
                     "while it runs")
        self.declare("design_deadline_s", 10.0,
                     "longest time that loading another model and designing its filter may take",
                     minimum=0.5, maximum=600.0)
        self.declare("depth", 2000,
                     "queue of each topic: message rate times the longest stall, at least",
                     minimum=1, maximum=10**6)
        declare_latency_budget(self)
        self.declare("metrics_topics", is_one,
                     "whether each metric has a Float64 topic beside ~/metrics, which has all")
        self.declare("metrics_window_s", 2.0, "time over which errors and signals are judged",
                     minimum=0.1, maximum=60.0)
        edges = self.declare("metrics_bands_hz", [0.0],
                             "ascending edges of the bands that errors are published for; fewer "
                             "than two: the filter's band only")
        if sorted(set(edges)) != list(edges) or edges[0] < 0:
            raise NodeError("parameter 'metrics_bands_hz' must be ascending frequencies, got "
                            f"{list(edges)}")

    def _check_changes(self):
        if not self.value("allow_model_changes"):
            raise NodeError("allow_model_changes is false: the sensors stay as at the start")

    @staticmethod
    def _check_name(name, others):
        if not _SENSOR_NAME.fullmatch(name):
            raise NodeError(f"'{name}' cannot be a sensor's name: a letter, then letters, digits "
                            "and underscores")
        if list(others).count(name) > 1:
            raise NodeError(f"two sensors have the name '{name}'")

    def _on_parameters(self, parameters):
        changes = {}
        for parameter in parameters:
            sensor, _, key = parameter.name.rpartition(".")
            if sensor not in self.sensors or key not in {**SENSOR_PARAMETERS, **TOPICS}:
                if not sensor and key in SENSOR_PARAMETERS:
                    return _result(f"{key}: a default at the start; set SENSOR.{key}")
                continue
            if key not in DESIGN_PARAMETERS:
                return _result(f"{parameter.name} stays as it was at the start: remove the sensor "
                               "and add it anew")
            changes.setdefault(sensor, {})[key] = parameter.value
        for sensor, changed in changes.items():
            if reason := self.sensors[sensor].refusal(changed):
                return _result(reason)
        return _result("")

    def _on_reload(self, _, response):
        reasons, files = [], []
        for sensor in self.sensors.values():
            model_file = sensor.value("model_file")
            files.append(model_file)
            reason = (sensor.refusal() if model_file else
                      "no model to reload: set the parameter model_file")
            reasons += [reason] if reason else []
        response.success = not reasons
        response.message = "; ".join(reasons) or f"{', '.join(dict.fromkeys(files))} is in use"
        return response

    def _on_add(self, request, response):
        given = {each.name: parameter_value_to_python(each.value) for each in request.parameters}
        name = given.pop("name", "")
        try:
            self._check_changes()
            self._check_name(name, [name, *self.sensors])
        except NodeError as error:
            response.result = _result(str(error))
            return response
        try:
            declare_sensor(self, name, given)
            # a model can take as long as it likes: it is tried where it harms nobody
            self.apart(design_apart, self.value(f"{name}.model_file"),
                       {self.value(f"{name}.sample_rate_hz")} - {0.0},
                       {key: self.value(f"{name}.{key}") or None for key in DESIGN_PARAMETERS[1:]},
                       self.value("design_deadline_s"))
            self.sensors[name] = Sensor(self, name)
            self.get_logger().info(self.sensors[name].describe())
            self._spread_reports()
        except FracAccelError as error:
            forget_sensor(self, name)
            response.result = _result(str(error))
            return response
        response.result = _result("")
        return response

    def _on_remove(self, request, response):
        names = [parameter_value_to_python(each.value) for each in request.parameters
                 if each.name == "name"]
        try:
            self._check_changes()
            if len(names) != 1 or names[0] not in self.sensors:
                raise NodeError(f"name: {names} given, expected one of "
                                f"{', '.join(self.sensors) or 'none'}")
        except NodeError as error:
            response.result = _result(str(error))
            return response
        sensor = self.sensors.pop(names[0])
        sensor.finish()
        sensor.destroy()
        forget_sensor(self, sensor.name)
        for figure in [key for key in self._figures if key.startswith(f"{sensor.name}/")]:
            self.destroy_publisher(self._figures.pop(figure))
        self.get_logger().info(f"{sensor.name} is removed")
        self._spread_reports()
        response.result = _result("")
        return response

    def _spread_reports(self):
        """Let each sensor report once in a period, and not all at once."""
        step_s = _PERIOD_S / max(len(self.sensors), 1)
        now_s = time.monotonic()
        for i, sensor in enumerate(self.sensors.values()):
            sensor.reported_s = sensor.reported_s or now_s
            sensor.next_report_s = now_s + _PERIOD_S + i * step_s
        self.turn_s = min(self.turn_s, step_s)

    def _take_turn(self):
        """Publish the diagnostics and metrics of the sensors that are due.

        By the steady clock: a simulated one may never come.
        """
        now_s = time.monotonic()
        if now_s - self._load_s >= _PERIOD_S:
            cpu_s = time.process_time()
            self._load = (cpu_s - self._cpu_s) / (now_s - self._load_s)
            self._load_s, self._cpu_s = now_s, cpu_s
        for sensor in list(self.sensors.values()):
            sensor.take_reference()
            if now_s >= sensor.next_report_s:
                period_s, sensor.reported_s = now_s - sensor.reported_s, now_s
                # those that a stall has brought together part again
                missed = (now_s - sensor.next_report_s) // _PERIOD_S
                sensor.next_report_s += (missed + 1) * _PERIOD_S
                self._report(sensor, period_s)

    def _report(self, sensor, period_s):
        statuses, figures = sensor.report(period_s, self._load)
        array = DiagnosticArray(status=statuses)
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)
        if not self.is_active:
            return
        figures["load"] = self._load
        # what nobody takes would be a third of a report's cost
        if self._metrics.get_subscription_count():
            first = statuses[0]
            array.status = [DiagnosticStatus(
                level=first.level, name=first.name, hardware_id=first.hardware_id,
                values=[KeyValue(key=name, value=f"{value:.9g}")
                        for name, value in figures.items()])]
            self._metrics.publish(array)
        if not self.value("metrics_topics"):
            return
        for name, value in figures.items():
            name = f"{sensor.name}/{name}" if sensor.name else name
            if name not in self._figures:
                # without handlers of QoS events, which the executor would wait for in every cycle
                self._figures[name] = self.create_publisher(
                    Float64, f"~/metrics/{name}", 10,
                    event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
            self._figures[name].publish(cdr.encode_float64(value))


def _give_back_memory():
    """Give the system what the design has freed, where the C library (glibc) can."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim:
        trim(0)


def _result(reason):
    return SetParametersResult(successful=not reason, reason=reason)


def main(arguments=None):
    """Entry point."""
    return run_node(Corrector, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
