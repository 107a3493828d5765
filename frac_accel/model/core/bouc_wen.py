r"""Bouc-Wen variable of a hysteretic spring.

:math:`z' = q' - \beta |q'| z - \gamma q' |z|` does not depend on how fast q moves: while q goes one
way (sign s) and z keeps its sign,

.. math:: dz/dq = 1 - k z, \qquad k = s \beta + \mathrm{sgn}(z) \gamma

has the solution :math:`z + (1 - k z)(1 - e^{-k \Delta q}) / k`.
"""

import math


def follow_one_way(z, change, beta, gamma):
    """Variable after q has gone by `change` without turning.

    Plain enough to be compiled by numba as it stands.
    """
    way = beta if change > 0 else -beta
    for _ in range(2):  # up to z = 0, and on from there
        if change == 0.0:
            break
        side = z if z != 0.0 else change
        k = way + (gamma if side > 0 else -gamma)
        # e^300 takes any variable through zero, and e^710 is none
        x = min(-k * change, 300.0)
        if abs(x) > 0.05:
            saturation = -math.expm1(x) / k
        else:  # its series, far faster
            square = x * x
            saturation = change * (1 + x * (1 / 2) + square * (
                1 / 6 + x * (1 / 24) + square * (1 / 120 + x * (1 / 720))))
        end = z + (1 - k * z) * saturation
        if z * change >= 0 or end * z > 0:
            return end
        change -= math.log1p(-k * z) / k if k != 0 else -z
        z = 0.0
    return z
