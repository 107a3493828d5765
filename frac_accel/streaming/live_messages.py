"""Serialised messages through a `Stream` and back: what the live nodes do between two topics."""

import dataclasses

import numpy as np

from ..errors import BagError, FracAccelError
from ..io import cdr
from ..io.samples import Samples
from .live_simulation import LiveSimulator
from .waiting_messages import WaitingMessages

# What can no longer come out, because its sample was dropped, is forgotten when this many wait.
_FORGET_AT = 1000


class NoisySensor(LiveSimulator):
    """`LiveSimulator` with white noise on what it says.

    Parameters
    ----------
    model, sampling_rate_hz
        As for `LiveSimulator`.
    added_noise_std : float
        Standard deviation of the noise [output units].
    seed : int
        Seed of the noise; it does not depend on how the samples are split into blocks.
    """

    def __init__(self, model, sampling_rate_hz=0.0, added_noise_std=0.0, seed=0):
        super().__init__(model, sampling_rate_hz)
        self._added_noise_std = added_noise_std
        self._random = np.random.default_rng(seed)

    def process(self, stamps_ns, values, variance=None):
        filtered = super().process(stamps_ns, values, variance)
        if not self._added_noise_std:
            return filtered
        noise = self._added_noise_std * self._random.standard_normal(filtered.values.shape)
        variance = np.nan_to_num(filtered.variance) + self._added_noise_std**2
        return dataclasses.replace(filtered, values=filtered.values + noise, variance=variance)


@dataclasses.dataclass(frozen=True)
class Processed:
    """What came of some messages.

    Attributes
    ----------
    messages : list of bytes
        To be published.
    raw : Samples
        What was in the messages that came in; of batches, what the last ones say (`Stream.taken`).
    stamps_ns, values : ndarray, shape (n,) and (n, 3)
        What is in those that go out.
    arrivals_ns : ndarray, shape (n,)
        When the sample that each output belongs to came in.
    """

    messages: list
    raw: Samples
    stamps_ns: np.ndarray
    values: np.ndarray
    arrivals_ns: np.ndarray


class SampleMessages:
    """Messages of one sample each.

    Every output is the input message that it belongs to, with stamp, acceleration and covariance
    replaced, and the rest of the motion taken to the new instant (`WaitingMessages`).

    Parameters
    ----------
    stream : Corrector or NoisySensor
    type_name : str
        One of `cdr.SAMPLE_TYPES`.
    plain : callable
        Turns a message that `cdr` cannot read into one that it can, or raises FracAccelError.
    frame_id : str
        Frame of the outputs; empty: that of the inputs.

    Attributes
    ----------
    malformed : int
        Messages that could not be read at all.
    """

    def __init__(self, stream, type_name, plain, frame_id=""):
        self.stream = stream
        self._frame_id = frame_id
        self.malformed = 0
        self._type_name = type_name
        self._waiting = WaitingMessages(type_name)
        self._plain = plain

    def process(self, messages, arrivals_ns):
        """`Processed` of the next messages; raises as `Stream.process`."""
        messages, arrivals_ns, samples = _read(self._type_name, messages, arrivals_ns, self._plain,
                                               self._count_malformed)
        self._waiting.add(messages, arrivals_ns)
        return self._taken(samples, self.stream.process(*samples[:3]))

    def replace(self, model, wishes):
        """`Processed` with what `Stream.replace` gives out."""
        return self._taken(_nothing(), self.stream.replace(model, **wishes))

    def _taken(self, samples, filtered):
        delay_ns = self.stream.design.sensor_delay_ns if self.stream.design else 0
        messages, arrivals_ns = self._waiting.given(filtered.index.tolist(), delay_ns)
        if len(self._waiting) > _FORGET_AT:
            self._waiting.keep(self.stream.waiting.tolist(), delay_ns)
        if self._frame_id:
            messages = [cdr.with_frame(message, self._frame_id) for message in messages]
        messages = cdr.replace_samples(self._type_name, messages, filtered.stamps_ns,
                                       filtered.values, filtered.variance)
        return Processed(messages, _seen(self.stream, samples), filtered.stamps_ns, filtered.values,
                         np.array(arrivals_ns, np.int64))

    def _count_malformed(self):
        self.malformed += 1


class BlockMessages:
    """``PointCloud2`` messages of many samples; an output holds those that have become ready.

    Parameters and attributes as for `SampleMessages`.
    """

    def __init__(self, stream, plain, frame_id=""):
        self.stream = stream
        self._frame_id = frame_id
        self.malformed = 0
        self._plain = plain
        self._starts, self._arrivals_ns, self._frames = [], [], []

    def process(self, messages, arrivals_ns):
        """`Processed` of the next messages; raises as `Stream.process`."""
        blocks, first = [], len(self._starts)
        count = self.stream.counters["samples"]
        for message, arrival_ns in zip(messages, arrivals_ns):
            _, _, samples = _read(cdr.POINT_CLOUD2, [message], [arrival_ns], self._plain,
                                  self._count_malformed)
            if len(samples.stamps_ns):
                blocks.append(samples)
                self._starts.append(count)
                self._arrivals_ns.append(arrival_ns)
                self._frames.append(self._frame_id or samples.frame_id)
                count += len(samples.stamps_ns)
        if not blocks:
            return _nothing_processed()
        # together, as one block costs as much to filter as some hundred samples
        samples = Samples.concatenate(blocks)
        return self._taken(samples, self.stream.process(*samples[:3]), first)

    def replace(self, model, wishes):
        """`Processed` with what `Stream.replace` gives out."""
        return self._taken(_nothing(), self.stream.replace(model, **wishes),
                           max(len(self._starts) - 1, 0))

    def _taken(self, samples, filtered, first):
        """`Processed`; those that a block has made ready, from the `first` on, are a message."""
        messages = []
        arrivals_ns = np.empty(0, np.int64)
        if len(filtered):
            arrivals_ns = np.array(self._arrivals_ns)[self._block_of(filtered.index)]
            made_ready_by = np.maximum(
                self._block_of(filtered.index + self.stream.design.delay_samples), first)
            edges = np.flatnonzero(np.diff(made_ready_by)) + 1
            for start, stop in zip([0, *edges], [*edges, len(filtered)]):
                messages.append(cdr.encode_point_cloud(Samples(
                    filtered.stamps_ns[start:stop], filtered.values[start:stop],
                    filtered.variance[start:stop], self._frames[made_ready_by[start]])))
        if len(self._starts) > _FORGET_AT:
            kept = np.unique(np.append(self._block_of(self.stream.waiting),
                                       len(self._starts) - 1))
            self._starts = [self._starts[i] for i in kept]
            self._arrivals_ns = [self._arrivals_ns[i] for i in kept]
            self._frames = [self._frames[i] for i in kept]
        return Processed(messages, _seen(self.stream, samples), filtered.stamps_ns,
                         filtered.values, arrivals_ns)

    def _block_of(self, index):
        return np.searchsorted(self._starts, index, "right") - 1

    def _count_malformed(self):
        self.malformed += 1


def _read(type_name, messages, arrivals_ns, plain, count_malformed):
    """Readable messages, their arrivals and their samples."""
    try:
        return messages, arrivals_ns, cdr.read_samples(type_name, messages)
    except BagError:
        pass
    readable = []
    for message, arrival_ns in zip(messages, arrivals_ns):
        for attempt in (lambda data: data, plain):
            try:
                data = attempt(message)
                readable.append((data, arrival_ns, cdr.read_samples(type_name, [data])))
                break
            except FracAccelError:
                pass
        else:
            count_malformed()
    if not readable:
        return [], [], _nothing()
    messages, arrivals_ns, blocks = zip(*readable)
    return messages, arrivals_ns, Samples.concatenate(list(blocks))


def _seen(stream, samples):
    """What a stream has looked at, of samples that have come in or before."""
    return stream.taken[1] if stream.taken else samples


def _nothing():
    return Samples.of([], np.empty((0, 3)))


def _nothing_processed():
    return Processed([], _nothing(), np.empty(0, np.int64), np.empty((0, 3)),
                     np.empty(0, np.int64))
