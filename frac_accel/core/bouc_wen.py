r"""Bouc-Wen variable of a hysteretic spring, compiled.

:math:`z' = q' - \beta |q'| z - \gamma q' |z|` does not depend on how fast q moves: while q goes one
way (sign s) and z keeps its sign,

.. math:: dz/dq = 1 - k z, \qquad k = s \beta + \mathrm{sgn}(z) \gamma

has the solution :math:`z + (1 - k z)(1 - e^{-k \Delta q}) / k`.
"""

import math

import numba


@numba.njit(cache=True, error_model="numpy")
def follow(z, q0, v0, q1, v1, duration, beta, gamma):
    """Variable after q has gone from q0 to q1, with velocities v0 and v1 at the ends.

    If the velocity turns on the way, it is taken as linear in time.
    """
    if v0 * v1 < 0:
        turn = q0 + 0.5 * duration * v0 * v0 / (v0 - v1)
        return _one_way(_one_way(z, turn - q0, beta, gamma), q1 - turn, beta, gamma)
    return _one_way(z, q1 - q0, beta, gamma)


@numba.njit(cache=True, error_model="numpy")
def _one_way(z, change, beta, gamma):
    if change == 0.0:
        return z
    way = beta if change > 0 else -beta
    if z * change < 0:  # on the way to zero
        k = way + (gamma if z > 0 else -gamma)
        end = z + (1 - k * z) * _saturation(k, change)
        if end * z > 0:
            return end
        change -= math.log1p(-k * z) / k if k != 0 else -z
        z = 0.0
    k = way + (gamma if change > 0 else -gamma)
    return z + (1 - k * z) * _saturation(k, change)


@numba.njit(cache=True, error_model="numpy")
def _saturation(k, change):
    """(1 - exp(-k change)) / k."""
    x = -k * change
    if abs(x) > 0.05:
        return -math.expm1(x) / k
    # the series, far faster than the function
    return change * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))))
