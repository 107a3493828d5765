"""Temperature along a record."""

import functools

import numpy as np

from ..errors import FracAccelError


class Temperature:
    """Temperature that was measured now and then.

    Parameters
    ----------
    stamps_ns : array_like of int, shape (n,)
        In any order; of equal ones the first counts.
    celsius : array_like, shape (n,)
        Values that are not finite do not count.

    Raises
    ------
    FracAccelError
        If no value is finite.
    """

    def __init__(self, stamps_ns, celsius):
        stamps_ns, celsius = np.asarray(stamps_ns, np.int64), np.asarray(celsius, float)
        good = np.isfinite(celsius)
        if not good.any():
            raise FracAccelError(f"temperature: none of {len(celsius)} values is finite")
        self.stamps_ns, first = np.unique(stamps_ns[good], return_index=True)
        self.celsius = celsius[good][first]

    @classmethod
    def of(cls, given):
        """Temperature from another one, or from stamps and values."""
        return given if isinstance(given, cls) else cls(*given[:2])

    @functools.cached_property
    def _course(self):
        from scipy.interpolate import PchipInterpolator
        # straight lines would cut the corners of a course: by 2 mK in twelve seconds at 20 Hz
        return PchipInterpolator(self._seconds(self.stamps_ns), self.celsius)

    def _seconds(self, stamps_ns):
        return (np.asarray(stamps_ns) - self.stamps_ns[0]) * 1e-9

    def __call__(self, stamps_ns):
        """Temperature [°C] at stamps [ns]; held before its first and after its last value."""
        seconds = self._seconds(stamps_ns)
        if len(self.celsius) == 1:
            return np.full(np.shape(seconds), self.celsius[0])
        return self._course(np.clip(seconds, 0.0, self._seconds(self.stamps_ns[-1])))
