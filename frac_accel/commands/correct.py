"""Correct raw acceleration with a sensor model; the same kernel as the corrector node.

The output bag holds the corrected samples on /imu/data, and the raw and reference topics as they
are. Samples that cannot be corrected (the filter's warm-up, bad stamps or values) are counted.
"""

import collections

import numpy as np

from ..errors import BagError
from ..io.bag import CORRECTED_TOPIC, BagWriter, cdr
from ..io.motion import MovedMotion
from ..io.outputs import say
from ..model import SensorModel
from ..streaming import Corrector
from ._common import (
    add_bag,
    add_filter,
    add_json,
    add_model,
    add_report,
    add_temperature,
    add_topics,
    filter_wishes,
    open_bag,
    progress,
    require_report,
    write_json,
)

EXAMPLES = """
frac_accel correct drive.mcap --model sensor.yaml -o corrected.mcap
frac_accel correct drive.mcap --model sensor.yaml -o corrected.mcap --bandwidth 80 --max-delay 0.02
"""


def add_arguments(parser):
    """Options of the verb."""
    add_bag(parser)
    add_model(parser)
    parser.add_argument("-o", "--output", required=True, metavar="OUT.mcap", help="bag to write")
    add_topics(parser, axis=False)
    add_temperature(parser)
    parser.add_argument("--corrected", default=CORRECTED_TOPIC, metavar="TOPIC",
                        help="topic of the corrected samples (default: %(default)s)")
    add_filter(parser)
    add_report(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    require_report(arguments.report)
    corrector = Corrector(SensorModel.load(arguments.model), **filter_wishes(arguments))
    reader = open_bag(arguments.bag)
    raw = reader.topic(arguments.sensor, cdr.ACCELERATION_TYPES)
    if not raw.count:
        raise BagError(f"{arguments.bag}: topic {arguments.sensor} has no messages")
    temperatures = _temperatures(reader, arguments.temperature, corrector.model)
    copied = [raw.name] + [arguments.reference] * (arguments.reference in reader.topics)
    with BagWriter(arguments.output) as writer, \
            progress(sum(reader.topics[name].count for name in copied)) as bar:
        for name in copied:
            writer.copy_topic(reader.topics[name])
        writer.copy_topic(raw, arguments.corrected)
        sink = _Sink(corrector, writer, raw.type_name, arguments.corrected, temperatures,
                     bool(arguments.report))
        for block in reader.blocks(copied):
            messages = block.messages
            writer.write_many(block.topic.name, list(zip(
                messages, block.log_times_ns.tolist(), block.publish_times_ns.tolist())))
            if block.topic.name == raw.name:
                sink.add(block, messages)
            bar.update(len(messages))
        sink.finish()
        counters = corrector.counters
        if not counters["given"]:
            raise BagError(f"{arguments.bag}: topic {arguments.sensor}: nothing could be corrected "
                           f"of {counters['samples']} samples: {fates(counters)}")
    notes = [f"the variance is without the model's parameter uncertainty: {note}"
             for note in dict.fromkeys(corrector.design.notes) if note]
    for warning in [*reader.warnings, *notes]:
        print(f"warning: {warning}")
    summary = corrector.design.summary()
    print(f"{arguments.output}: {counters['given']} of {counters['samples']} samples corrected at "
          f"{summary['sampling_rate_hz']:.6g} Hz" + (f"; {fates(counters)}" if fates(counters) else
                                                     ""))
    for axis, design in summary["axes"].items():
        low, high = design["band_hz"]
        print(f"  {axis}: {low:.4g} to {high:.4g} Hz, worst error "
              f"{design['worst_amplitude_error']:.2%} and {design['worst_phase_error_deg']:.3f} "
              f"deg, noise gain {design['noise_gain']:.3g}")
    if corrector.design.extrapolated_below_hz:
        print("  below {:.4g} Hz by extrapolation: the model was identified from {:.4g} to {:.4g} "
              "Hz".format(corrector.design.extrapolated_below_hz, *corrector.model.band_hz))
    print(f"  filter delay {summary['filter_delay_s']:.4g} s; sensor's own delay "
          f"{summary['sensor_delay_s']:.4g} s, taken out of the stamps")
    if arguments.report:
        # whoever wants no page need not wait for what draws it
        from ._correct_page import page
        page(sink.kept(), reader, corrector, arguments).write(arguments.report)
        say(f"{arguments.report}: written")
    write_json(arguments.json, {"output": str(arguments.output), "counters": counters,
                                "filters": summary, "warnings": [*reader.warnings, *notes]})


def _temperatures(reader, topic, model):
    """Log times and temperatures [°C] of the bag, where the model needs them and there are any."""
    if not model.needs_temperature or topic not in reader.topics:
        return []
    reader.topic(topic, [cdr.TEMPERATURE])
    return [pair for block in reader.blocks([topic])
            for pair in zip(block.log_times_ns.tolist(), block.temperatures().celsius.tolist())]


def fates(counters):
    """What happened to samples that were not simply corrected, in words."""
    words = {"warm_up": "at the start (the filter needs earlier samples)",
             "waiting": "at the end (the filter needs later samples)",
             "cut_off": "before a long gap", "duplicates": "with a repeated stamp",
             "stamps_back": "with a stamp that goes back", "early": "too many by their stamps",
             "not_finite": "not finite", "implausible": "that cannot be true",
             "without_rate": "too far apart to tell the rate",
             "distrusted": "with an axis that is dead, stuck, saturated or held",
             "filled": "missing and bridged",
             "clipped": "at the limits of the range",
             "without_temperature": "without a temperature (25 °C assumed)"}
    return ", ".join(f"{counters[name]} {text}" for name, text in words.items()
                     if counters.get(name))


class _Sink:
    """Runs raw blocks through the corrector and writes what becomes ready."""

    def __init__(self, corrector, writer, type_name, topic, temperatures, keeps=False):
        self._keeps, self._raw, self._ready = keeps, [], []
        self._corrector, self._writer = corrector, writer
        self._temperatures = collections.deque(temperatures)
        self._type, self._topic = type_name, topic
        self._motion = MovedMotion(type_name)
        self._waiting = collections.deque()
        self._first = 0
        self._frame = ""

    def add(self, block, messages):
        if self._type == cdr.POINT_CLOUD2:
            for data, log in zip(messages, block.log_times_ns.tolist()):
                samples = cdr.read_point_cloud(data)
                self._frame, self._log = samples.frame_id, log
                self._tell_temperature(log)
                self._keep_raw(samples)
                self._write_cloud(self._corrector.process(samples.stamps_ns, samples.values))
            return
        samples = block.samples()
        self._keep_raw(samples)
        self._waiting.extend(zip(messages, block.log_times_ns.tolist()))
        logs, start = block.log_times_ns, 0
        while start < len(logs):
            self._tell_temperature(logs[start])
            stop = (int(np.searchsorted(logs, self._temperatures[0][0])) if self._temperatures
                    else len(logs))
            part = slice(start, max(stop, start + 1))
            self._write(self._corrector.process(samples.stamps_ns[part], samples.values[part],
                                                samples.variance[part]))
            start = part.stop

    def _tell_temperature(self, log_time_ns):
        """Hand on the temperatures that had come by then, as they come to a node."""
        while self._temperatures and self._temperatures[0][0] <= log_time_ns:
            self._corrector.set_temperature(self._temperatures.popleft()[1])

    def _keep_raw(self, samples):
        if self._keeps:
            self._raw.append(samples)

    def _keep(self, ready):
        if self._keeps and len(ready):
            self._ready.append(ready)

    def kept(self):
        """Raw samples, which of them were corrected, and the corrected ones."""
        index = np.concatenate([ready.index for ready in self._ready])
        corrected = cdr.Samples.of(*(np.concatenate([getattr(ready, name) for ready in
                                                     self._ready])
                                     for name in ("stamps_ns", "values", "variance")))
        return cdr.Samples.concatenate(self._raw), index, corrected

    def finish(self):
        rest = self._corrector.finish()
        (self._write_cloud if self._type == cdr.POINT_CLOUD2 else self._write)(rest)

    def _write(self, ready):
        self._keep(ready)
        if not len(ready):
            return
        # a sample that was never given out is dropped when a later one is
        indices = ready.index.tolist()
        passed = [self._waiting.popleft() for _ in range(indices[-1] + 1 - self._first)]
        messages, logs = zip(*[passed[index - self._first] for index in indices])
        self._first = indices[-1] + 1
        messages = self._motion.moved(messages, self._corrector.design.sensor_delay_ns)
        patched = cdr.replace_samples(self._type, messages, ready.stamps_ns, ready.values,
                                      ready.variance)
        self._writer.write_many(self._topic, list(zip(patched, logs, logs)))

    def _write_cloud(self, ready):
        self._keep(ready)
        if len(ready):
            block = cdr.Samples.of(ready.stamps_ns, ready.values, np.full(ready.values.shape,
                                                                          np.nan), self._frame)
            self._writer.write(self._topic, cdr.encode_point_cloud(block), self._log)
