"""Dry friction on a mass without a spring, compiled; imported when it is simulated."""

import numba
import numpy as np


@numba.njit(cache=True)
def friction_along(force, rate, forward, backward):
    r"""Friction n in :math:`v' = r (f - n - v)`, the set-valued law of A. F. Filippov (1988).

    It is `forward` while v > 0, -`backward` while v < 0, and at rest whatever holds the mass.
    The force is taken as constant around each point, for which the motion is exact; n is its mean
    there. Before the first point, the first force has been there for ever.

    Parameters
    ----------
    force : ndarray, shape (n,)
        [output units], many points in each period.
    rate : float
        r times the spacing of the points.
    forward, backward : float
        [output units]

    Returns
    -------
    ndarray, shape (n,)
    """
    friction = np.empty_like(force)
    v = 0.0
    if force[0] > forward:
        v = force[0] - forward
    elif force[0] < -backward:
        v = force[0] + backward
    for i in range(len(force)):
        left, mean = 1.0, 0.0
        if v != 0:
            level = forward if v > 0 else -backward
            end = force[i] - level
            after = end + (v - end) * np.exp(-rate)
            if v * after >= 0:
                friction[i], v = level, after
                continue
            # the part of the interval after which it stands still
            part = np.log(1 - v / end) / rate
            mean, left, v = part * level, left - part, 0.0
        if force[i] > forward:
            level = forward
        elif force[i] < -backward:
            level = -backward
        else:
            level = force[i]
        v = (force[i] - level) * (1 - np.exp(-rate * left))
        friction[i] = mean + left * level
    return friction
