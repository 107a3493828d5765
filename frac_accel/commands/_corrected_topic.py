"""The corrected topic of `correct`: blocks of a bag through the corrector into another bag."""

import collections

import numpy as np

from ..io.bag import cdr
from ..record.ordering import Reordering
from ..streaming.batches import restamped
from ..streaming.waiting_messages import WaitingMessages


def temperatures_of(reader, topic, model):
    """Log times and temperatures [°C] of the bag, where the model needs them and there are any."""
    if not model.needs_temperature or topic not in reader.topics:
        return []
    reader.topic(topic, [cdr.TEMPERATURE])
    return [pair for block in reader.blocks([topic])
            for pair in zip(block.log_times_ns.tolist(), block.temperatures().celsius.tolist())]


class Sink:
    """Runs raw blocks through the corrector and writes what becomes ready.

    Samples that the recorder has mixed are put in the order of their stamps first. A message's log
    time is then that of the latest that came before it in this order, so that the order stays.
    """

    def __init__(self, corrector, writer, type_name, topic, temperatures, keeps=False):
        self._keeps, self._raw, self._taken, self._ready = keeps, [], [], []
        self._corrector, self._writer = corrector, writer
        self._temperatures = collections.deque(temperatures)
        self._type, self._topic = type_name, topic
        self._waiting = WaitingMessages(type_name)
        self._frame, self._log = "", 0
        self._order = Reordering()

    def add(self, block, messages):
        if self._type == cdr.POINT_CLOUD2:
            for data, log in zip(messages, block.log_times_ns.tolist()):
                samples = cdr.read_point_cloud(data)
                self._frame, self._log = samples.frame_id, log
                self._tell_temperature(log)
                self._keep_raw(samples)
                self._write_cloud(self._corrector.process(samples.stamps_ns, samples.values))
            return
        self._take(*self._order.add(block.samples(), messages, block.log_times_ns.tolist()))

    @property
    def late(self):
        """Samples that came after a later one."""
        return self._order.late

    def _take(self, samples, messages, logs):
        if not logs:
            return
        logs = np.maximum.accumulate([max(logs[0], self._log), *logs[1:]])
        self._log, start = logs[-1], 0
        self._keep_raw(samples)
        self._waiting.add(messages, logs.tolist())
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
        if self._keeps and self._corrector.taken:
            self._taken.append(self._corrector.taken)
        if self._keeps and len(ready):
            self._ready.append(ready)

    def kept(self):
        """Raw samples, those of batches at instants of their own; which of them were corrected, and
        the corrected ones."""
        index = np.concatenate([ready.index for ready in self._ready])
        corrected = cdr.Samples.of(*(np.concatenate([getattr(ready, name) for ready in
                                                     self._ready])
                                     for name in ("stamps_ns", "values", "variance")))
        return restamped(cdr.Samples.concatenate(self._raw), self._taken), index, corrected

    def finish(self):
        held = self._order.rest()
        if held:
            self._take(*held)
        rest = self._corrector.finish()
        (self._write_cloud if self._type == cdr.POINT_CLOUD2 else self._write)(rest)

    def _write(self, ready):
        self._keep(ready)
        if not len(ready):
            return
        messages, logs = self._waiting.given(ready.index.tolist(),
                                             self._corrector.design.sensor_delay_ns)
        patched = cdr.replace_samples(self._type, messages, ready.stamps_ns, ready.values,
                                      ready.variance)
        self._writer.write_many(self._topic, list(zip(patched, logs, logs)))

    def _write_cloud(self, ready):
        self._keep(ready)
        if len(ready):
            block = cdr.Samples.of(ready.stamps_ns, ready.values, np.full(ready.values.shape,
                                                                          np.nan), self._frame)
            self._writer.write(self._topic, cdr.encode_point_cloud(block), self._log)
