"""Node ``virtual_sensor``: the acceleration of a base in, what a sensor on it would say out."""

from concurrent.futures import ThreadPoolExecutor

from frac_accel.io import cdr
from frac_accel.model import SensorModel
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._filtered_topic import (
    FilteredTopic,
    declare_latency_budget,
    subscribe_temperature,
)
from frac_accel.nodes._runtime import FracAccelNode, import_message_class, normalised, run_node
from frac_accel.streaming.live_messages import NoisySensor, SampleMessages


class VirtualSensor(FracAccelNode):
    """Plays ``imu/reference`` through a sensor model to ``imu/data_raw``."""

    def __init__(self):
        super().__init__("virtual_sensor")
        model_file = self.declare("model_file", "", "sensor model (YAML) to play")
        sample_rate_hz = self.declare(
            "sample_rate_hz", 0.0,
            "sampling rate of the reference; 0: estimated from the first hundred stamps",
            minimum=0.0, maximum=1e8)
        noise_std = self.declare(
            "noise_std", 0.0, "standard deviation of white noise added to the output",
            minimum=0.0, maximum=1e12)
        seed = self.declare("seed", 0, "seed of the noise", minimum=0, maximum=2**53)
        depth = self.declare(
            "depth", 2000, "queue of each topic: message rate times the longest stall, at least",
            minimum=1, maximum=10**6)
        declare_latency_budget(self)
        if not model_file:
            raise NodeError("parameter 'model_file' is missing: -p model_file:=SENSOR.yaml")
        message_class = import_message_class(cdr.IMU)
        self._worker = ThreadPoolExecutor(1, "design")
        self._topic = FilteredTopic(
            self, message_class, ("imu/reference", "imu/data_raw"), depth, self._worker,
            lambda model, wishes: SampleMessages(
                NoisySensor(model, sample_rate_hz, noise_std, seed), cdr.IMU,
                lambda data: normalised(data, message_class)))
        self._topic.offer(SensorModel.load(model_file), {})
        self._topic.start()
        self._temperature_subscription = subscribe_temperature(self, [self._topic])

    def finish(self):
        """Play what is waiting and say what has been done."""
        self._topic.drain()
        counts = ", ".join(f"{name} {count}" for name, count in self._topic.counters.items()
                           if count)
        print(f"{self._topic.name}: {counts or 'nothing received'}", flush=True)
        self._worker.shutdown()


def main(arguments=None):
    """Entry point."""
    return run_node(VirtualSensor, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
