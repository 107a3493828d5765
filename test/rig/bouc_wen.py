r"""Bouc-Wen variable, :math:`z' = q' - \beta |q'| z - \gamma q' |z|`, along the path of q.

It does not depend on how fast the path is run through: dz/dq = 1 - k z, with k constant between the
sign changes of q' and z, so that each stretch has an exact solution (R. Bouc, 1967; Y.-K. Wen,
J. Eng. Mech. Div. ASCE 102, 1976).
"""

import numba
import numpy as np


@numba.njit(cache=True)
def along(z, dq, beta, gamma):
    """Bouc-Wen variable after q has moved by dq in one direction."""
    if not (np.isfinite(dq) and np.isfinite(z)):  # the motion grows without bound
        return np.nan
    direction = np.sign(dq)
    while dq != 0:
        side = direction if z == 0 else np.sign(z)
        k = gamma * side + beta * direction
        new = z + dq if k == 0 else z * np.exp(-k * dq) - np.expm1(-k * dq) / k
        if new * side >= 0:
            return new
        dq -= -z if k == 0 else np.log1p(-k * z) / k  # as far as z = 0
        if dq * direction <= 0:
            return 0.0
        z = 0.0
    return z


@numba.njit(cache=True)
def advance(z, q0, v0, q1, v1, duration, beta, gamma):
    """Bouc-Wen variable after a short motion with at most one turning point."""
    if v0 * v1 < 0:
        turning = q0 + 0.5 * v0 * duration * v0 / (v0 - v1)
        z = along(z, turning - q0, beta, gamma)
        q0 = turning
    return along(z, q1 - q0, beta, gamma)
