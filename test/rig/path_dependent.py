"""What depends on the path of a signal and not on its equation of motion, along the fine grid."""

import numba
import numpy as np


@numba.njit(cache=True)
def play(values, gap):
    """Play (backlash) of the whole width `gap`: the output is moved at either end of it.

    It starts in its middle. M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis, 1989.
    """
    moved = np.empty_like(values)
    y = 0.0
    for i in range(len(values)):
        y = min(max(y, values[i] - gap / 2), values[i] + gap / 2)
        moved[i] = y
    return moved


@numba.njit(cache=True)
def slew_limited(values, most):
    """Output that follows by no more than `most` a grid step."""
    limited = np.empty_like(values)
    y = 0.0
    for i in range(len(values)):
        y += min(max(values[i] - y, -most), most)
        limited[i] = y
    return limited
