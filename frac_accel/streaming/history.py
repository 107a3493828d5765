r"""What a filter's memory would make of the motion before its start, which nobody has seen.

The recursion starts as if the input had always been at the level of the first samples. With the
impulse response :math:`h_m` of the recursion and :math:`T_m = \sum_{k \ge m} h_k`, a history at
another level :math:`\mu` would make the output differ by :math:`(\mu - level)\,T_m` after `m`
samples. The samples that come tell the level better and better: a mean weighted by a parabola,
:math:`6 k (m - k) / m^3`, in which a motion of frequency `f` is left by :math:`1/(f m)^2` only.
This part is taken out of the output. What is left is random:

* the level, by the spread of the means of the four quarters of what has been seen;
* a motion about it, which a slowly falling memory sees by its sum only,
  :math:`h_m \sum_k (x_{-k} - \mu)`: its variance is that of the sums of what has been seen.

Behind a high-pass the level is known to be nothing, and the part is bounded by the motion's size.
"""

import bisect

import numpy as np

# Samples after which the level and the spreads are no longer looked for.
LONGEST = 4096
# Samples over which the weights are looked up once from then on; how many are at a time.
_STEP, _PIECE = 8, 128
# Numbers of samples at which the spreads are found anew.
_LOOKS = sorted({start << k for start in (2, 3) for k in range(12)} & {*range(LONGEST + 1)})
# By how much the variance of the history's level exceeds that of the mean of four quarters, and
# the variance of its sums that of the sums since the start (both seen on simulated records).
_LEVELS, _SUMS = 4.0, 2.0
# Samples up to which the motion's whole power counts as unknown level: quarters say little then.
_FEW = 16


class UnknownHistory:
    """Correction and variance for the history of some axes, in blocks of any length.

    Parameters
    ----------
    parallel_filter : ParallelFilter
        Has poles.
    level : ndarray, shape (k,)
        Input of each axis that the filter took for that before its start.
    is_known : bool
        Whether that level is known, as behind a high-pass.
    """

    def __init__(self, parallel_filter, level, is_known):
        self._filter, self._level, self._is_known = parallel_filter, level[:, None], is_known
        self._count = 0
        self._sums = np.zeros((2, len(level), 1))
        self._seen = np.empty((len(level), LONGEST))
        self._power = self._levels = self._summed = np.zeros((len(level), 1))
        self._mean = np.zeros((len(level), 1))
        self._next, self._weighed = 1, np.empty((2, 0))

    def process(self, values):
        """What is to be added for the next inputs, and its variance; shapes (k, n)."""
        if self._count + values.shape[1] <= self._next_look():
            return self._advance(values)
        added, variance = np.empty(values.shape), np.empty(values.shape)
        start = 0
        while start < values.shape[1]:
            stop = min(values.shape[1], start + self._next_look() - self._count)
            piece = slice(start, stop)
            added[:, piece], variance[:, piece] = self._advance(values[:, piece])
            start = stop
        return added, variance

    def _next_look(self):
        """Number of samples up to which nothing is found anew."""
        at = bisect.bisect_right(_LOOKS, self._count)
        return _LOOKS[at] if at < len(_LOOKS) else self._count + LONGEST

    def _advance(self, values):
        number = np.arange(self._count + 1.0, self._count + 1.0 + values.shape[1])
        self._count += values.shape[1]
        mean = (self._means(values - self._level, number) if self._count <= LONGEST
                else self._mean)
        total, single = self._weights(len(number))
        if self._is_known:
            added, variance = np.zeros(values.shape), self._power * total**2
        else:
            unknown = self._levels + self._power * (_FEW / number)**2
            added = mean * total
            variance = unknown * total**2 + self._summed * single**2
        if self._count <= LONGEST and self._count in _LOOKS:
            self._look()
        return added, variance

    def _means(self, apart, number):
        """Weighted means (k, n) of the distances from the level up to each sample."""
        self._seen[:, self._count - len(number):self._count] = apart
        at = number - 0.5
        weighted = np.stack([apart * at, apart * at**2])
        # one after the other, so that the sum does not depend on the block's length
        sums = np.add.accumulate(np.concatenate([self._sums, weighted], axis=2), axis=2)[:, :, 1:]
        self._sums = sums[:, :, -1:]
        mean = 6 / (number * number * number) * (number * sums[0] - sums[1])
        self._mean = mean[:, -1:]
        return mean

    def _look(self):
        seen = self._seen[:, :self._count]
        self._power = np.mean(seen**2, axis=1, keepdims=True)
        quarters = [part.mean(axis=1) for part in np.array_split(seen, min(4, seen.shape[1]), 1)]
        self._levels = _LEVELS * (np.var(quarters, axis=0, ddof=1) / len(quarters))[:, None]
        about = np.cumsum(seen - seen.mean(axis=1, keepdims=True), axis=1)
        self._summed = _SUMS * np.mean(about**2, axis=1, keepdims=True)
        if self._count == _LOOKS[-1]:
            self._seen = None

    def _weights(self, count):
        """T and h of the next samples, or their bounds, shape (2, count).

        In pieces that do not depend on how the samples are split.
        """
        while self._weighed.shape[1] < count:
            step = 1 if self._next <= LONGEST else _STEP
            at = self._next + step * np.arange(_PIECE)
            self._next += step * _PIECE
            self._weighed = np.concatenate([self._weighed, np.repeat(
                self._memory(at), step, axis=1)], axis=1)
        result, self._weighed = self._weighed[:, :count], self._weighed[:, count:]
        return result

    def _memory(self, number):
        """T and h at these numbers of samples since the start, or their bounds."""
        poles, residues = self._filter.poles, self._filter.residues
        if self._is_known:
            poles, residues = np.abs(poles), np.abs(residues)
            distance = np.abs(1 - self._filter.poles)
        else:
            distance = 1 - poles
        left = residues * poles ** np.maximum(number - self._filter.lead, 0)[:, None]
        return np.stack([(left / distance).sum(axis=1).real, left.sum(axis=1).real])
