"""Spring that becomes stiffer or softer with time."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import free

# The natural frequency never falls below this share of what it was.
_LEAST = 0.05


@dataclasses.dataclass(frozen=True)
class StiffnessDrift(Effect):
    r"""Natural frequency f0 (1 + rate t) in every place of f0, t from the record's start.

    With :math:`m = 1 + r t` the equation of a classical core is

    .. math:: q'' + 2 \zeta \omega_0 m q' + \omega_0^2 m^2 q = \omega_0^2 m^2 S a

    that is, the base's acceleration has the gain :math:`m^2`, and the spring's bracket a further
    :math:`(m^2 - 1) q + 2 \zeta (m - 1) q' / \omega_0`. With a fractional core, its damping force
    stays as it was.
    """

    cause = "stiffness_drift"
    stage = CORE
    explanation = "The natural frequency drifts with time, as that of a spring that ages or warms."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Excite around the resonance at the beginning and at the end of a long record: "
                  "its frequency has moved, and the gain far below it has not.")

    rate_per_s: float = parameter("1/s", scale="per_duration", null=0.0)

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def base_gain(self, time_s):
        return np.maximum(1 + self.rate_per_s * time_s, _LEAST)**2

    def add_force(self, force):
        core = force.core
        natural = 2 * np.pi * core.natural_frequency_hz
        damping = core.damping_ratio if core.damping_order == 1 else 0.0
        return force.with_law(_drifting, self.rate_per_s / natural, damping, timed=True)

    @classmethod
    def starts(cls, view):
        return [free(cls(0.02 / view.time[-1]), "rate_per_s")]


def _drifting(q0, v0, state, q1, v1, duration, parameters):
    now = state + duration
    more = max(parameters[0] * now, -0.95)
    return (2 + more) * more * q1 + 2 * parameters[1] * more * v1, now
