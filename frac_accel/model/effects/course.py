"""Courses in time that follow no law: a curve through values at certain instants."""

import numpy as np

from ...errors import ModelError

# Instants of a course that was found in a record: of 14 half waves its curve misses 6e-3.
KNOTS = 61


def along(time_s, at_s, values):
    """Values of a course, shape (n,), by a cubic spline; outside of its instants the next one's.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
    at_s, values : tuple of float
        None for a course that is 0 throughout.
    """
    if not at_s:
        return 0.0
    # imported here, as only a course is worth the time that it takes
    from scipy.interpolate import CubicSpline
    return CubicSpline(at_s, values)(np.clip(time_s, at_s[0], at_s[-1]))


def require_course(cause, at_s, values):
    """Raise ModelError where a course has not one value for each of some ascending instants."""
    if len(at_s) != len(values) or len(at_s) == 1 or not np.all(np.diff(at_s) > 0):
        raise ModelError(f"{cause}.course_at_s: {len(at_s)} instants and {len(values)} values "
                         "given, expected as many of each, at least 2 and ascending; or none")


def about_line(time_s, values):
    """A course as its straight line, 0 at 0 s, and the rest: rate per second, instants, values."""
    rate, _ = np.polyfit(time_s, values, 1)
    return float(rate), tuple(map(float, time_s)), tuple(map(float, values - rate * time_s))
