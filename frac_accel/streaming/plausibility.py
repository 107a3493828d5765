"""Which samples can be true: a range on every axis, and what stands alone beyond what was seen.

A filter with a long memory remembers one absurd sample for minutes, so such a sample must not reach
it. Two rules, in this order:

* the *range*: a value outside it is implausible. It is the parameter ``plausible_range``, else the
  model's key of that name, else the limits of its ``clipping``, widened by `MARGIN` of their span;
  and always `CEILING` times the sensor's gain;
* where nothing states a range, the record does: a value is *suspect* if it is beyond `WIDER` times
  the largest that has been accepted so far, beyond `FLOOR`, and further from the sample before it
  than `FASTER` times the largest step of the last `TAIL` samples. The samples from a suspect on are
  held until `LOOK` more have come. If `ALONE` or fewer of them are beyond `RESTLESS` times that
  largest, those beyond the range are implausible; if there are more, or three in a row, the sensor
  has met a shock or is shaken harder: all are true, and the range is wider from there on.

The range grows by accepted samples only. What is decided depends on the samples and their order,
not on the blocks in which they come. The first `LEARN` samples are held, too: their own robust
spread is the first range.
"""

import collections

import numpy as np

# Highest acceleration [m/s²] of any use: fifty times that of the hardest shock sensor.
CEILING = 1e8
# Share of the span by which values may be beyond the limits of the model.
MARGIN = 0.25
WIDER, RESTLESS, FASTER, TAIL = 12.0, 2.0, 4.0, 128
# A smaller value [m/s²] is never suspect: no spike of a tenth of gravity is absurd.
FLOOR = 1.0
LOOK, ALONE = 8, 4
LEARN = 32
# Samples among which these are looked for, as there may be bad ones between them.
HOLD = 256
# Of the first samples, those that do not count for the first range: the largest of each axis.
_LEFT_OUT = 6
# The range and the steps that are first believed in are so many times those of what is left.
_FIRST = 2.0


class Plausibility:
    """Says of the samples of a stream whether they can be true, a few samples late where it must.

    Parameters
    ----------
    low, high : ndarray, shape (3,)
        Range of each axis [output units].
    floor : ndarray, shape (3,) or None
        `FLOOR` in output units; None: the range is stated, nothing is suspect within it.

    Attributes
    ----------
    held : tuple of ndarray
        Index, stamps, values and variance of the samples that are not yet decided on.
    """

    def __init__(self, low, high, floor):
        self.held = ()
        self._tail = collections.deque()
        self._tail_length = 0
        self._peak = None
        self.set_range(low, high, floor)

    def set_range(self, low, high, floor):
        """Go on with the range of another model."""
        self._low, self._high = low, high
        # sizes below it are within the range on every axis: quick to see
        self._symmetric = min(-low.max(), high.min())
        self._learns = floor is not None
        self._floor = floor

    @property
    def waiting(self):
        """Number of samples held."""
        return len(self.held[0]) if self.held else 0

    def judge(self, index, stamps, values, variance, is_end=False):
        """Samples that are decided on, and which of them can be true.

        Parameters
        ----------
        index, stamps, values, variance
            The next samples.
        is_end : bool
            Whether no more will come.

        Returns
        -------
        index, stamps, values, variance
            Those that were held included.
        plausible, finite : ndarray of bool, shape (n,), or None
            None: all are.
        """
        samples = index, stamps, values, variance
        if self.held:
            samples = tuple(np.concatenate(pair) for pair in zip(self.held, samples))
            self.held = ()
            index, stamps, values, variance = samples
        if not len(index):
            return *samples, None, None
        size = np.abs(values)
        largest = size.max(axis=0)
        plausible = finite = None
        if not largest.max() < self._symmetric:
            finite = np.isfinite(size).all(axis=1)
            plausible = finite & ((values >= self._low) & (values <= self._high)).all(axis=1)
        if not self._learns:
            return *samples, plausible, finite
        if self._peak is None:
            good = values[:HOLD] if plausible is None else values[:HOLD][plausible[:HOLD]]
            if len(good) < LEARN and len(index) < HOLD and not is_end:
                self.held = samples
                return *(part[:0] for part in samples), None, None
            self._learn(good[:LEARN])
        if plausible is None and not (largest > self._range()).any():
            self._accept(values, largest)
            return *samples, None, None
        if plausible is None:
            plausible = np.ones(len(index), bool)
        decided = self._look(values, size, plausible, is_end)
        if decided < len(index):
            self.held = tuple(part[decided:] for part in samples)
        return (*(part[:decided] for part in samples), plausible[:decided],
                None if finite is None else finite[:decided])

    def _range(self, wider=WIDER):
        return np.maximum(wider * self._peak, self._floor)

    def _learn(self, first):
        """First range, from the first samples but for their largest."""
        self._peak = self._first_step = np.zeros(3)
        if len(first) > 3 * _LEFT_OUT:
            self._peak = _FIRST * np.sort(np.abs(first), axis=0)[-_LEFT_OUT - 1]
            # each sample that stands alone makes two steps
            steps = np.sort(np.abs(np.diff(first, axis=0)), axis=0)
            self._first_step = _FIRST * steps[-2 * _LEFT_OUT - 1]

    def _accept(self, values, largest):
        self._peak = np.maximum(self._peak, largest)
        self._tail.append(values[-TAIL - 1:])
        self._tail_length += len(self._tail[-1])
        while self._tail_length - len(self._tail[0]) > TAIL:
            self._tail_length -= len(self._tail.popleft())

    def _tail_step(self):
        """Largest step of the last `TAIL` accepted samples, and the last of them or None."""
        if not self._tail_length:
            return self._first_step, None
        tail = np.concatenate(self._tail)[-TAIL - 1:]
        steps = np.abs(np.diff(tail, axis=0)).max(axis=0, initial=0.0)
        return (np.maximum(steps, self._first_step) if len(tail) <= TAIL else steps), tail[-1]

    def _look(self, values, size, plausible, is_end):
        """Go through the samples and clear `plausible` of some; the number of those decided on."""
        start = 0
        while start < len(values):
            beyond = plausible[start:] & (size[start:] > self._range()).any(axis=1)
            at = start + int(np.argmax(beyond)) if beyond.any() else len(values)
            self._accept_plausible(values, plausible, start, at)
            if at == len(values):
                break
            step, last = self._tail_step()
            far = size[at] > self._range()
            if last is not None:
                far &= np.abs(values[at] - last) > FASTER * step
            if not far.any():
                self._accept_plausible(values, plausible, at, at + 1)
                start = at + 1
                continue
            window = at + np.flatnonzero(plausible[at:at + HOLD])[:LOOK + 1]
            if len(window) <= LOOK and len(values) - at < HOLD and not is_end:
                return at
            far = (size[window] > self._range(RESTLESS)).any(axis=1)
            if far.sum() <= ALONE and not (far[2:] & far[1:-1] & far[:-2]).any():
                plausible[window[(size[window] > self._range()).any(axis=1)]] = False
                start = at
            else:
                start = int(window[-1]) + 1
                self._accept_plausible(values, plausible, at, start)
        return len(values)

    def _accept_plausible(self, values, plausible, start, stop):
        found = values[start:stop][plausible[start:stop]]
        if len(found):
            self._accept(found, np.abs(found).max(axis=0))


def stated_range(plausible_range, limits, gain):
    """Range of each axis, and from where on a value within it can be suspect.

    Parameters
    ----------
    plausible_range : sequence of two floats or None
        What a parameter or a model's file says [output units].
    limits : tuple of ndarray, shape (3,) each
        Lowest and highest value that the model can say; infinite where it does not state any.
    gain : ndarray, shape (3,)
        Output units per m/s².

    Returns
    -------
    low, high, floor
        As `Plausibility` takes them.
    """
    gain = np.where(np.isfinite(gain) & (gain > 0), gain, 1.0)
    low, high = -CEILING * gain, CEILING * gain
    if plausible_range is not None:
        lower, upper = plausible_range
        return np.maximum(low, lower), np.minimum(high, upper), None
    with np.errstate(invalid="ignore"):
        margin = MARGIN * (limits[1] - limits[0])
    stated = np.isfinite(limits[0]) & np.isfinite(limits[1])
    low = np.where(stated, np.maximum(low, limits[0] - margin), low)
    high = np.where(stated, np.minimum(high, limits[1] + margin), high)
    return low, high, None if stated.all() else np.where(stated, np.inf, FLOOR * gain)
