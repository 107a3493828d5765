"""The measured record as the diagnosis sees it."""

import dataclasses

import numpy as np

from ..pair import make_pair


@dataclasses.dataclass(frozen=True)
class Record:
    """A measured pair with its temperature.

    Attributes
    ----------
    sampling_rate_hz, reference, sensor, valid, lag_s
        As in `Pair`.
    temperature_c : ndarray, shape (n,), or None
        Temperature [°C] at the instants.
    """

    sampling_rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    valid: np.ndarray
    lag_s: float
    temperature_c: np.ndarray | None = None
    start_ns: int = 0

    def __len__(self):
        return len(self.valid)

    def part(self, rows):
        """The record's samples of a slice."""
        celsius = None if self.temperature_c is None else self.temperature_c[rows]
        return Record(self.sampling_rate_hz, self.reference[rows], self.sensor[rows],
                      self.valid[rows], self.lag_s, celsius,
                      self.start_ns + int(rows.start * 1e9 / self.sampling_rate_hz))

    @classmethod
    def of(cls, reference, sensor, axis="x", temperature=None):
        """Record of two runs of samples, and (stamps_ns, celsius) where known."""
        pair = make_pair(reference, sensor, axis)
        celsius = None
        if temperature is not None:
            stamps, values = temperature
            instants = pair.start_ns + np.arange(len(pair)) * 1e9 / pair.sampling_rate_hz
            celsius = np.interp(instants - pair.start_ns,
                                np.asarray(stamps, float) - pair.start_ns, values)
        return cls(pair.sampling_rate_hz, pair.reference, pair.sensor, pair.valid, pair.lag_s,
                   celsius, pair.start_ns)
