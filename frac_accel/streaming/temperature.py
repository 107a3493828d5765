"""Temperature of each sample of a stream: the last value that had come in before it."""

import bisect

import numpy as np

# Samples for which a value is remembered; more than a stream ever looks back.
_MEMORY = 200_000


class HeldTemperature:
    """Values in the order of their arrival, each held from one sample on."""

    def __init__(self):
        self._first, self._values = [0], [np.nan]

    @property
    def is_known(self):
        """Whether there has been a value."""
        return not np.isnan(self._values[-1])

    def set(self, index, celsius):
        """From the sample with this running number on, the temperature [°C] is `celsius`."""
        if index == self._first[-1]:
            self._values[-1] = celsius
            return
        self._first.append(index)
        self._values.append(celsius)
        old = bisect.bisect_right(self._first, index - _MEMORY) - 1
        if old > 1000:
            del self._first[:old], self._values[:old]

    def at(self, index):
        """Temperatures [°C] of samples by running number, shape (n,); NaN where none is known."""
        if len(self._first) == 1:
            return np.full(len(index), self._values[0])
        place = np.searchsorted(self._first, index, side="right") - 1
        return np.asarray(self._values)[np.maximum(place, 0)]
