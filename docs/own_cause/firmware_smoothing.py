"""Exponential smoothing in a sensor's firmware."""

import dataclasses

import numpy as np
from scipy.signal import lfilter

from frac_accel.effects.base import DEAD_ZONE, Effect
from frac_accel.effects.fit_starts import grid
from frac_accel.parameters import parameter


@dataclasses.dataclass(frozen=True)
class FirmwareSmoothing(Effect):
    r"""Each sample is :math:`y_n = y_{n-1} + k (x_n - y_{n-1})`, the first as it is."""

    cause = "firmware_smoothing"
    stage = DEAD_ZONE
    explanation = "The firmware smooths the samples, so fast motion is smaller and later."
    experiment = "Read the sensor once without its firmware's filter, or at another output rate."

    share: float = parameter("1", above=0, maximum=1, scale=1.0, reach=(0.01, 1.0), null=1.0)

    @classmethod
    def starts(cls, view):
        return grid([cls(share) for share in (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)])

    def live(self, sampling_rate_hz):
        return _Memory(self.share)


class _Memory:
    """The smoothing on one stream: it remembers the last output."""

    def __init__(self, share):
        self._share, self._last = share, None

    def simulate(self, values, circumstances):
        if self._last is None and len(values):
            self._last = values[0]
        before = [(1 - self._share) * (self._last or 0.0)]
        smooth, _ = lfilter([self._share], [1.0, self._share - 1], values, zi=before)
        self._last = smooth[-1] if len(smooth) else self._last
        return smooth

    def invert(self, values, variance, circumstances):
        if not len(values):
            return values, variance
        before = np.r_[values[0] if self._last is None else self._last, values[:-1]]
        self._last = values[-1]
        # noise of the sample itself and of the one before, taken to be as large
        gain = (1 + (1 - self._share)**2) / self._share**2
        return before + (values - before) / self._share, gain * variance
