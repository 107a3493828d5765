"""Play of a mechanism along a motion, compiled; imported when it is simulated."""

import numba
import numpy as np


@numba.njit(cache=True)
def follow(motion, gap):
    """Output that is moved at either end of a play of this whole width.

    M. A. Krasnosel'skii, A. V. Pokrovskii, *Systems with Hysteresis* (1989), section 2. It begins
    in the middle. Where the motion turns between two points, the parabola through three tells how
    far it went.

    Parameters
    ----------
    motion : ndarray, shape (n,)
        Many points in each period.
    gap : float

    Returns
    -------
    ndarray, shape (n,)
    """
    moved = np.empty_like(motion)
    half, y = gap / 2, motion[0]
    for i in range(len(motion)):
        x = motion[i]
        if 0 < i < len(motion) - 1:
            before, after = x - motion[i - 1], motion[i + 1] - x
            if before * after < 0:
                peak = x - (before + after)**2 / (8 * (after - before))
                y = min(max(y, peak - half), peak + half)
        y = min(max(y, x - half), x + half)
        moved[i] = y
    return moved
