"""Node ``diagnoser``: whether a sensor still is what its model says; since when; what now."""

import json
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from frac_accel.errors import FracAccelError
from frac_accel.io import cdr
from frac_accel.model import AXES, SensorModel
from frac_accel.monitoring.keeper import APPLY, Keeper
from frac_accel.monitoring.mutual import NOBODY, SENSOR
from frac_accel.monitoring.observations import Observer
from frac_accel.monitoring.watch import WINDOW_S
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._filtered_topic import raw_qos
from frac_accel.nodes._intake import RawSubscription
from frac_accel.nodes._runtime import FracAccelNode, import_message_class, run_node

_PERIOD_S = 1.0
# Time [s] without a reference after which the sensor is watched alone.
_ALONE_S = 5.0
_OK, _WARN, _STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.STALE


class Diagnoser(FracAccelNode):
    """Watches ``imu/data_raw`` against ``imu/reference``, and the corrector's model with it."""

    def __init__(self):
        super().__init__("diagnoser")
        model_file = self.declare("model_file", "", "sensor model (YAML) that the corrector uses")
        results = self.declare("results", "diagnoser_results", "folder for what is found")
        axis = self.declare("axis", "x", "axis that is watched: x, y or z")
        apply = self.declare(
            "apply", "never", "confirmed: an extended model goes to the corrector once it has won "
                              "on data recorded after its diagnosis; never: ~/apply does it")
        self._corrector = self.declare("corrector", "corrector", "name of the corrector's node")
        self._parameter = self.declare(
            "corrector_parameter", "model_file", "its parameter: SENSOR.model_file of one of many")
        self._type = self.declare("message_type", cdr.IMU, "type of both topics")
        depth = self.declare("depth", 2000, "queue of each topic", minimum=1, maximum=10**6)
        wishes = self._declared_wishes()
        if not model_file:
            raise NodeError("parameter 'model_file' is missing: -p model_file:=SENSOR.yaml")
        if axis not in tuple(AXES):
            raise NodeError(f"parameter 'axis' must be x, y or z, got {axis!r}")
        if apply not in APPLY:
            raise NodeError(f"parameter 'apply' must be {' or '.join(APPLY)}, got {apply!r}")
        self._keeper = Keeper(model_file, results, axis, apply, self._give, **wishes)
        core = SensorModel.load(model_file).axis(axis).core
        self._observer = Observer(getattr(core, "sensitivity", 1.0))
        self._alone, self._alone_from_s, self._observations = [], time.monotonic(), []
        self._reference_s = None
        self._connect(depth, wishes["mutual"])
        self.latency_budget_s = 0.05
        self._next_s = time.monotonic() + _PERIOD_S
        self.turns.append(self._take_turn)
        self.get_logger().info(f"watches axis {axis} with {model_file}; results go to {results}")

    def _declared_wishes(self):
        """What `Keeper` is told besides, by its names."""
        return {
            "limit_mb": self.declare(
                "results_limit_mb", 500.0, "size of the folder: the oldest results go first",
                minimum=10.0, maximum=1e6),
            "budget": self.declare(
                "budget", 0.05, "share of one core that a diagnosis may use", minimum=0.001,
                maximum=1.0),
            "time_limit_s": self.declare(
                "time_limit_s", 60.0, "processor time after which a diagnosis ends",
                minimum=1.0, maximum=3600.0),
            "niceness": self.declare(
                "niceness", 19, "of the process of a diagnosis: 19 steps back behind all others",
                minimum=0, maximum=19),
            "every_s": self.declare(
                "every_s", 0.0, "time between diagnoses without an alarm; 0: none", minimum=0.0,
                maximum=1e7),
            "false_alarm_h": self.declare(
                "false_alarm_h", 1000.0, "mean time between false alarms [h]", minimum=0.01,
                maximum=1e6),
            "mutual": self.declare(
                "mutual", False, "whether the reference is no better than the sensor: who has "
                                 "changed is said once imu/third agrees with one of them")}

    def _connect(self, depth, has_third):
        """Topics and services."""
        message_class = import_message_class(self._type)
        topics = {"imu/reference": self._on_reference, "imu/data_raw": self._on_raw,
                  **({"imu/third": self._on_third} if has_third else {})}
        self._subscriptions_ = [
            RawSubscription(self, message_class, topic, take, raw_qos(depth), is_direct=True)
            for topic, take in topics.items()]
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._result = self.create_publisher(DiagnosticArray, "~/result", 10)
        self._client = self.create_client(SetParameters, f"{self._corrector}/set_parameters")
        for name, act in (("diagnose", lambda: self._keeper.diagnose("a service")),
                          ("apply", self._keeper.apply_now),
                          ("roll_back", self._keeper.roll_back)):
            self.create_service(Trigger, f"~/{name}", _answering(act))

    def finish(self):
        """End what is running."""
        self._keeper.end()

    def destroy_node(self):
        """The same where the node ends by an error."""
        if hasattr(self, "_keeper"):
            self._keeper.end()
        super().destroy_node()

    def _on_reference(self, batch):
        self._reference_s = time.monotonic()
        samples = self._read(batch)
        if samples is not None:
            self._keeper.add(samples, None)

    def _on_third(self, batch):
        samples = self._read(batch)
        if samples is not None:
            self._keeper.add(None, None, samples)

    def _on_raw(self, batch):
        samples = self._read(batch)
        if samples is None:
            return
        silent = self._reference_s is None \
            or time.monotonic() - self._reference_s > _ALONE_S
        if silent and time.monotonic() - self._alone_from_s > _ALONE_S:
            self._look_alone(samples)
        else:
            self._keeper.add(None, samples)

    def _read(self, batch):
        """Samples of messages; None where they cannot be read."""
        try:
            return cdr.read_samples(self._type, [message.data for message in batch])
        except FracAccelError as error:
            self.get_logger().warning(f"{error}", throttle_duration_sec=10.0)
            return None

    def _look_alone(self, samples):
        """Without a reference: observations of windows of the sensor alone."""
        self._alone.append(samples)
        if samples.stamps_ns[-1] - self._alone[0].stamps_ns[0] >= WINDOW_S * 1e9:
            window, self._alone = type(samples).concatenate(self._alone), []
            self._observations = self._observer.add(window)

    def _take_turn(self):
        self._keeper.turn()
        for line in self._keeper.notes:
            # so that a bag of the vehicle explains later what was done, and why
            self.get_logger().info(json.dumps(line))
            if line["step"] == "diagnosed":
                self._result.publish(self._array([self._of_result(self._keeper.latest)]))
        self._keeper.notes.clear()
        if time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + _PERIOD_S
            self._diagnostics.publish(self._array([self._status()]))

    def _array(self, statuses):
        array = DiagnosticArray(status=statuses)
        array.header.stamp = self.get_clock().now().to_msg()
        return array

    def _status(self):
        keeper = self._keeper
        if keeper.latest:
            status = self._of_result(keeper.latest)
        elif keeper.blamed not in (NOBODY, SENSOR):
            status = DiagnosticStatus(level=_WARN, message="sensor and reference no longer agree; "
                                      f"of sensor, reference and third, {keeper.blamed} has "
                                      "changed")
        elif keeper.watch.changed is not None:
            status = DiagnosticStatus(level=_WARN, message="the sensor has changed; a diagnosis "
                                      "waits for motion, or is under way")
        elif self._observations:
            status = DiagnosticStatus(level=_WARN, message="observed without a reference: "
                                      + "; ".join(entry.words for entry in self._observations))
        elif self._reference_s is None:
            status = DiagnosticStatus(level=_STALE, message="no reference: the sensor is watched "
                                      "alone, and only observations can be made")
        else:
            status = DiagnosticStatus(level=_OK, message="no change since it has learnt"
                                      if not keeper.watch.learning else "it is learning what is "
                                      "usual")
        status.name = f"{self.get_name()}: model"
        change = keeper.watch.changed
        status.values = [*status.values, *_values(
            state=keeper.state, model_file=keeper.model_file, windows=keeper.watch.windows,
            statistic=f"{keeper.watch.detector.statistic:.3g}",
            threshold=f"{keeper.watch.detector.threshold:.3g}",
            **({"since_ns": change.ns, "since_low_ns": change.low_ns,
                "since_high_ns": change.high_ns, "gradual": change.is_gradual} if change else {}),
            **({"trial": keeper.trial.verdict, "trial_gain": f"{keeper.trial.gain:.3g}"}
               if keeper.trial else {}))]
        return status

    def _of_result(self, result):
        """A diagnosis as a status: verdict, causes, parameters with intervals, gain."""
        good = result["verdict"] == "consistent"
        status = DiagnosticStatus(
            level=_OK if good else _WARN, name=f"{self.get_name()}: diagnosis",
            hardware_id=self._keeper.model_file,
            message=f"{result['verdict']}: {result.get('reason')}")
        values = _values(verdict=result["verdict"], trigger=result["trigger"],
                         folder=result["folder"], cpu_s=f"{result['cpu_s']:.3g}",
                         causes=", ".join(entry["cause"] for entry in result["findings"]))
        for entry in result["findings"]:
            values += _values(**{f"{entry['cause']}/gain": f"{entry['gain']['reduction']:.3g}"})
            for name, own in entry["parameters"].items():
                value, std = own["value"], own["std"]
                words = f"{value:.6g} ± {2 * std:.2g} {own['unit']}" \
                    if isinstance(value, float) and std else str(value)
                values += _values(**{f"{entry['cause']}/{name}": words})
        if result["onset"]:
            values += _values(**{f"since_{key}": value for key, value in result["onset"].items()})
        status.values = values
        return status

    def _give(self, model_file):
        """Ask the corrector to use a model; the answer comes to `Keeper.given`."""
        if not self._client.service_is_ready():
            self._keeper.given(f"no node {self._corrector} answers")
            return
        parameter = Parameter(self._parameter, value=model_file).to_parameter_msg()
        future = self._client.call_async(SetParameters.Request(parameters=[parameter]))
        future.add_done_callback(self._on_answer)

    def _on_answer(self, future):
        result = future.result().results[0]
        self._keeper.given("" if result.successful else result.reason or "no reason given")


def _values(**pairs):
    return [KeyValue(key=key, value=str(value)) for key, value in pairs.items()]


def _answering(act):
    def answer(_, response):
        reason = act()
        response.success, response.message = not reason, reason or "it is under way"
        return response
    return answer


def main(arguments=None):
    """Entry point."""
    return run_node(Diagnoser, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
