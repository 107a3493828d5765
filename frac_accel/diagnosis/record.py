"""The measured record as the diagnosis sees it."""

import dataclasses

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..errors import FracAccelError
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
    since_start_s : float
        Time [s] from the start of the whole record, of which this may be a part.
    """

    sampling_rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    valid: np.ndarray
    lag_s: float
    temperature_c: np.ndarray | None = None
    start_ns: int = 0
    since_start_s: float = 0.0

    def __len__(self):
        return len(self.valid)

    def part(self, rows):
        """The record's samples of a slice."""
        celsius = None if self.temperature_c is None else self.temperature_c[rows]
        return Record(self.sampling_rate_hz, self.reference[rows], self.sensor[rows],
                      self.valid[rows], self.lag_s, celsius,
                      self.start_ns + int(rows.start * 1e9 / self.sampling_rate_hz),
                      self.since_start_s + rows.start / self.sampling_rate_hz)

    @classmethod
    def of(cls, reference, sensor, axis="x", temperature=None):
        """Record of two runs of samples, and (stamps_ns, celsius) where known.

        It ends with the last sample of the sensor.

        Raises
        ------
        FracAccelError
            If no pair can be made of the samples, or no temperature is finite.
        """
        pair = make_pair(reference, sensor, axis)
        celsius = None
        if temperature is not None:
            instants = np.arange(len(pair)) * 1e9 / pair.sampling_rate_hz
            celsius = _interpolated(instants, pair.start_ns, *temperature)
        whole = cls(pair.sampling_rate_hz, pair.reference, pair.sensor, pair.valid, pair.lag_s,
                    celsius, pair.start_ns)
        return whole.part(slice(0, int(np.flatnonzero(pair.valid)[-1]) + 1))


def _interpolated(instants_ns, start_ns, stamps_ns, celsius):
    """Temperature at instants after a start, held before its first and after its last value."""
    stamps_ns, celsius = np.asarray(stamps_ns, np.int64), np.asarray(celsius, float)
    good = np.isfinite(celsius)
    if not good.any():
        raise FracAccelError(f"temperature: none of {len(celsius)} values is finite")
    stamps_ns, celsius = stamps_ns[good], celsius[good]
    stamps_ns, first = np.unique(stamps_ns, return_index=True)
    celsius = celsius[first]
    if len(celsius) == 1:
        return np.full(len(instants_ns), celsius[0])
    seconds = (stamps_ns - start_ns).astype(float)
    # straight lines would cut the corners of a course: by 2 mK in twelve seconds at 20 Hz
    course = PchipInterpolator(seconds, celsius)
    return course(np.clip(instants_ns, seconds[0], seconds[-1]))
