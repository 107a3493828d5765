"""Sensitivity that changes slowly with time."""

import dataclasses

import numpy as np

from ..parameters import coefficients, parameter
from .base import GAIN, Effect
from .course import about_line, along, require_course
from .fit_starts import free

_LEAST = 1e-3


@dataclasses.dataclass(frozen=True)
class GainDrift(Effect):
    """Gain 1 + rate t, t from the record's start, and a course of its own, where it has one."""

    cause = "gain_drift"
    stage = GAIN
    explanation = "The sensitivity drifts with time."
    shows_with_time = True
    counts_from_start = True
    # with four periods it is a modulation
    half_waves = (1, 2, 3, 5, 7)
    experiment = "Keep level and temperature constant for longer: a drift goes on with time."

    rate_per_s: float = parameter("1/s", scale="per_duration", null=0.0)
    course_at_s: tuple = coefficients("s", ())
    course: tuple = coefficients("1", ())

    def __post_init__(self):
        require_course(self)

    def simulate(self, values, circumstances):
        return values * self._gain(circumstances)

    def invert(self, values, variance, circumstances):
        gain = self._gain(circumstances)
        # a line that has reached zero says nothing any more
        gain = np.where(np.abs(gain) < _LEAST, np.copysign(_LEAST, gain), gain)
        return values / gain, variance / gain**2

    def _gain(self, circumstances):
        return 1 + along(self, circumstances.time_s)

    @classmethod
    def column(cls, values):
        return values

    @classmethod
    def in_course(cls, time_s, values):
        return cls(*about_line(time_s, values))

    @classmethod
    def starts(cls, view):
        return [free(cls(1e-3), "rate_per_s")]
