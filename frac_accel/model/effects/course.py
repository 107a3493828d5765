"""Courses in time that follow no law: a curve through values at certain instants."""

import numpy as np

from ...errors import ModelError

# Instants of a course that was found in a record: of 14 half waves its curve misses 6e-3.
KNOTS = 61


def along(drift, time_s):
    """Values of a drift, shape (n,): its line, and its course by a cubic spline, outside of whose
    instants the next one's value holds.

    Parameters
    ----------
    drift : Effect
        With `rate_per_s`, `course_at_s` and `course`, both empty where it has no course.
    time_s : ndarray, shape (n,)
    """
    line, at_s = drift.rate_per_s * time_s, drift.course_at_s
    if not at_s:
        return line
    # imported here, as only a course is worth the time that it takes
    from scipy.interpolate import CubicSpline
    return line + CubicSpline(at_s, drift.course)(np.clip(time_s, at_s[0], at_s[-1]))


def require_course(drift):
    """Raise ModelError where a course has not one value for each of some ascending instants."""
    at_s, values = drift.course_at_s, drift.course
    if len(at_s) != len(values) or len(at_s) == 1 or not np.all(np.diff(at_s) > 0):
        raise ModelError(f"{drift.cause}.course_at_s: {len(at_s)} instants and {len(values)} "
                         "values given, expected as many of each, at least 2 and ascending; "
                         "or none")


def about_line(time_s, values):
    """A course as its straight line, 0 at 0 s, and the rest: rate per second, instants, values."""
    rate, _ = np.polyfit(time_s, values, 1)
    return float(rate), tuple(map(float, time_s)), tuple(map(float, values - rate * time_s))
