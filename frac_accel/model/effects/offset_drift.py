"""Zero-acceleration output that changes slowly with time."""

import dataclasses

import numpy as np

from ..parameters import coefficients, parameter
from .base import OFFSET, Effect
from .course import about_line, along, require_course
from .fit_starts import free


@dataclasses.dataclass(frozen=True)
class OffsetDrift(Effect):
    """Adds rate t, t from the record's start, and a course of its own, where it has one."""

    cause = "offset_drift"
    stage = OFFSET
    adds = ("rate_per_s", "course")
    explanation = ("The zero of the output drifts with time: the sensor's own, the reference's, or "
                   "gravity along a slow tilt.")
    shows_with_time = True
    counts_from_start = True
    half_waves = (1, 2, 3, 5, 7, 10, 14)
    experiment = ("Record at rest and at constant temperature for longer: a drifting zero goes on "
                  "with time.")

    rate_per_s: float = parameter("output units/s", scale="level_per_duration", null=0.0)
    course_at_s: tuple = coefficients("s", ())
    course: tuple = coefficients("output units", ())

    def __post_init__(self):
        require_course(self)

    def simulate(self, values, circumstances):
        return values + along(self, circumstances.time_s)

    def invert(self, values, variance, circumstances):
        return values - along(self, circumstances.time_s), variance

    @classmethod
    def column(cls, values):
        return np.ones(len(values))

    @classmethod
    def in_course(cls, time_s, values):
        return cls(*about_line(time_s, values))

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level / view.time[-1]), "rate_per_s")]
