"""Samples that come several at a time with one stamp, as drivers that read a queue send them.

The stated policy:

* Where at least `FEWEST` of the last `WINDOW` samples repeat the stamp of the one before with other
  values, and about as many samples come as the rate asks for, all that share a stamp are a batch.
* A batch is given on when the next stamp comes. Where that takes as many samples as `LONGEST`
  batches have, the stamps no longer advance, and are taken as they are.
* Its last sample, which waited least, belongs to the stamp; the others are one interval apart. How
  stamps scatter is not passed on: the instants are counted on, and follow the stamps slowly.
* A stamp that is further from the count than the scatter explains says that samples were lost (or
  are too many): the batch is put where its stamp says, and `timing` does the rest. Losses that are
  smaller than the scatter cannot be seen.
"""

import collections

import numpy as np

from ..io.samples import Samples

# How batches are told from samples that repeat a stamp; by how much [ratio] they may come at
# another rate; batches that tell a rate that is not stated, and the fewest where these are all.
WINDOW, FEWEST = 100, 10
_OTHER_RATE = 1.3
TELL_RATE, _AT_LEAST = 32, 3
# Samples with one stamp, in usual batches, that are none.
LONGEST = 100
# How fast the instants follow the stamps, and their rate that of the stamps, once a line through
# those so far would be slower; by how much [intervals per sample] at most.
_FOLLOW, _FOLLOW_RATE, _MOST = 0.2, 0.02, 0.05
# How fast mean size and scatter are learnt, and the scatter at first [batches]; deviations that are
# too large for the scatter, and those that are or are not whatever it is [intervals, batches].
_LEARNS, _SCATTER_AT_FIRST = 0.1, 0.05
_TOO_FAR, _LOST, _BATCH_LOST = 8.0, 0.75, 0.75


def share_stamps(stamps_ns, values):
    """Whether samples, at least `WINDOW` of them, share stamps as batches do."""
    repeats = (np.diff(stamps_ns) == 0) & (np.diff(values, axis=0) != 0).any(axis=1)
    return bool(np.sum(repeats) * WINDOW >= FEWEST * len(stamps_ns))


def rate_of_batches(stamps_ns, is_end=False):
    """What batches say of the sampling rate.

    Parameters
    ----------
    stamps_ns : ndarray of int64, shape (n,)
    is_end : bool
        Whether no more will come.

    Returns
    -------
    rate_hz : float or None
        None until there are `TELL_RATE` batches between which nothing is lost.
    unusable : int
        Number of samples before a loss: no rate will be told with them.
    """
    starts = np.flatnonzero(np.r_[True, np.diff(stamps_ns) != 0])
    edges = np.r_[starts, len(stamps_ns)] if is_end else starts
    edges = edges[:TELL_RATE + 1]
    if len(edges) <= (_AT_LEAST if is_end else TELL_RATE):
        return None, 0
    seconds = 1e-9 * (stamps_ns[edges[:-1]] - stamps_ns[0])
    sizes, steps = np.diff(edges)[1:], np.diff(seconds)
    interval = np.median(steps / sizes)
    lost = np.abs(steps - sizes * interval) > _BATCH_LOST * sizes.mean() * interval
    if lost.any() or interval <= 0:
        return None, int(edges[1 + int(np.argmax(lost))])
    return float(1 / np.polyfit(np.cumsum(sizes), seconds[1:], 1)[0]), 0


def restamped(samples, taken):
    """`Samples` with the instants that they were taken for: `taken` is a list of `Stream.taken`."""
    stamps = samples.stamps_ns.copy()
    for index, own in taken:
        stamps[index] = own.stamps_ns
    return Samples(stamps, *samples[1:]) if taken else samples


class Batches:
    """Gives the samples of batches instants of their own, in blocks of any length.

    Parameters
    ----------
    sampling_rate_hz : float

    Attributes
    ----------
    size : float
        Samples of a batch, as they are now; 0: the samples do not come in batches.
    """

    def __init__(self, sampling_rate_hz):
        self._interval = 1e9 / sampling_rate_hz
        self._look_anew()

    def _look_anew(self):
        self.size, self.held = 0.0, None
        self._count, self._last = 0, None
        self._repeats = collections.deque()
        self._starts = collections.deque(maxlen=WINDOW)

    def begin(self, size):
        """From the next sample on there are batches of about this size."""
        self.size = float(size)
        self._end = None

    @property
    def waiting(self):
        """Running numbers of the samples held."""
        return np.empty(0, np.int64) if self.held is None else self.held[0]

    def take(self, index, stamps_ns, values, variance, is_end=False):
        """The samples that are known now, with the instants that they are taken for.

        Returns
        -------
        list of ndarray
            As the parameters, whole batches of them.
        began_at : int or None
            Running number of the first sample that has an instant of its own, where there were no
            batches before.
        """
        samples = [index, stamps_ns, values, variance]
        if not self.size and self._is_simple(stamps_ns, values):
            return samples, None
        if self.held is not None:
            samples = [np.concatenate(pair) for pair in zip(self.held, samples)]
            self.held = None
        ready, began_at, start = [], None, 0
        while start < len(samples[0]):
            rest = [part[start:] for part in samples]
            if self.size:
                known, instants = self._spread(rest[1], is_end)
                rest[1] = np.concatenate([*instants, rest[1][sum(map(len, instants)):]])
                if self.size and known < len(rest[0]):
                    self.held = [part[known:] for part in rest]
                    self.held[1] = samples[1][start + known:]
            else:
                known = self._looked_through(rest[1], rest[2])
                if self.size:
                    began_at = int(samples[0][start + known])
            ready.append([part[:known] for part in rest])
            if self.held is not None:
                break
            start += known
        if len(ready) == 1:
            return ready[0], began_at
        return [np.concatenate(parts) for parts in zip(*ready)] if ready else samples, began_at

    def _looked_through(self, stamps, values):
        """Number of samples before batches begin; all where they do not."""
        for i, stamp in enumerate(stamps.tolist()):
            if self._last is None or stamp != self._last[0]:
                if self._is_batched(stamp):
                    self.begin((self._count - self._starts[0][0]) / len(self._starts))
                    return i
                self._starts.append((self._count, stamp))
            elif (values[i] != self._last[1]).any():
                self._repeats.append(self._count)
            self._last = stamp, values[i]
            self._count += 1
        return len(stamps)

    def _is_simple(self, stamps, values):
        """Whether no sample repeats a stamp, now or shortly before; they are then noted."""
        if self._repeats or not len(stamps) or (self._last and self._last[0] == stamps[0]) or (
                len(stamps) > 1 and (stamps[1:] == stamps[:-1]).any()):
            return False
        self._count += len(stamps)
        tail = stamps[-WINDOW:].tolist()
        self._starts.extend(zip(range(self._count - len(tail), self._count), tail))
        self._last = tail[-1], values[-1]
        return True

    def _is_batched(self, stamp):
        """Whether a sample with this stamp is the first one of a batch."""
        while self._repeats and self._repeats[0] < self._count - WINDOW:
            self._repeats.popleft()
        while len(self._starts) > 1 and self._starts[1][0] <= self._count - WINDOW:
            self._starts.popleft()
        if len(self._repeats) < FEWEST:
            return False
        number, first = self._starts[0]
        ratio = (stamp - first) / ((self._count - number) * self._interval)
        return 1 / _OTHER_RATE < ratio < _OTHER_RATE

    def _spread(self, stamps, is_end):
        """Number of samples that are known, and their instants, a list of arrays."""
        edges = np.r_[0, np.flatnonzero(np.diff(stamps)) + 1, len(stamps)].tolist()
        instants = []
        for start, stop in zip(edges[:-1], edges[1:]):
            longest = int(LONGEST * self.size)
            if stop - start > longest:
                # the stamps no longer advance
                self._look_anew()
                return start + longest, instants
            if stop == len(stamps) and not is_end:
                return start, instants
            instants.append(self._of_batch(int(stamps[start]), stop - start))
        return len(stamps), instants

    def _of_batch(self, stamp, count):
        """Instants of the samples of one batch."""
        steps = np.arange(1 - count, 1)
        self.size += _LEARNS * (count - self.size)
        if self._end is not None and stamp > self._end[0]:
            expected = count * self._interval * (1 + self._drift)
            off = stamp - self._end[0] - self._end[1] - expected
            limit = min(_TOO_FAR * self._scatter, _BATCH_LOST * self.size * self._interval)
            if abs(off) <= max(limit, _LOST * self._interval):
                length = self._followed(off, expected, count * self._interval)
                # by how much the last sample is after its stamp
                late = length - expected - off
                self._end = stamp, late
                return stamp + np.round(late + steps * length / count).astype(np.int64)
        if self._end is None:
            self._scatter = _SCATTER_AT_FIRST * self.size * self._interval
        self._end, self._seen, self._drift = (stamp, 0.0), 1, 0.0
        return stamp + np.round(steps * self._interval).astype(np.int64)

    def _followed(self, off, expected, nominal):
        """Time [ns] from the last sample of one batch to that of the next."""
        self._seen += 1
        self._scatter += _LEARNS * (abs(off) - self._scatter)
        k = self._seen
        along, faster = max(_FOLLOW, 2 * (2 * k - 1) / (k * (k + 1))), max(_FOLLOW_RATE,
                                                                         6 / (k * (k + 1)))
        self._drift = float(np.clip(self._drift + faster * off / nominal, -_MOST, _MOST))
        return float(np.clip(expected + along * off, (1 - _MOST) * nominal, (1 + _MOST) * nominal))
