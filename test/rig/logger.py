"""When the two topics of a record are sampled: rates of their own, as on phones and CAN."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Logger:
    """Rates and losses; the stamps are right, so none of this is a fault of the sensor.

    Attributes
    ----------
    reference_rate_hz, sensor_rate_hz : float or None
        None for the excitation's.
    sensor_start_s : float
        Instant of the sensor's first sample.
    reference_lost : float
        Share of the reference's messages that are lost.
    """

    reference_rate_hz: float | None = None
    sensor_rate_hz: float | None = None
    sensor_start_s: float = 0.0
    reference_lost: float = 0.0

    def reference_times(self, excitation):
        """Instants of the reference's samples [s]."""
        return _times(excitation, self.reference_rate_hz, 0.0)

    def sensor_times(self, excitation):
        """Stamps of the sensor's samples [s], before its clock's faults."""
        return _times(excitation, self.sensor_rate_hz, self.sensor_start_s)


def _times(excitation, rate_hz, start_s):
    if rate_hz is None or rate_hz == excitation.rate_hz:
        return start_s + np.arange(excitation.samples) / excitation.rate_hz
    duration_s = (excitation.samples - 1) / excitation.rate_hz
    return start_s + np.arange(int((duration_s - start_s) * rate_hz) + 1) / rate_hz
