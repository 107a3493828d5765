"""Spring that becomes stiffer or softer with time."""

import dataclasses

import numpy as np

from ..parameters import choice, parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import free

# The natural frequency never falls below this share of what it was.
_LEAST = 0.05
_FORCE, _DISPLACEMENT = "force", "displacement"


@dataclasses.dataclass(frozen=True)
class StiffnessDrift(Effect):
    r"""Natural frequency f0 (1 + rate t), t from the record's start.

    With :math:`m = 1 + r t`, a core whose output is the spring's force (``reads: force``, as of a
    piezoelectric or a servo sensor) keeps its gain far below the resonance, and its damping ratio:

    .. math:: q'' + 2 \zeta \omega_0 m q' + \omega_0^2 m^2 q = \omega_0^2 m^2 S a

    One whose output is the displacement (``reads: displacement``, as of a capacitive sensor or a
    geophone) keeps its damper, and the gain goes with :math:`1 / m^2`:

    .. math:: q'' + 2 \zeta \omega_0 q' + \omega_0^2 m^2 q = \omega_0^2 S a

    The base's acceleration has the gain :math:`m^2` or 1, and the spring's bracket a further
    :math:`(m^2 - 1) q + 2 \zeta (m - 1) q' / \omega_0`, the second term of a force only. With a
    fractional core, its damping force stays as it was.
    """

    cause = "stiffness_drift"
    stage = CORE
    explanation = "The natural frequency drifts with time, as that of a spring that ages or warms."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Excite around the resonance at the beginning and at the end of a long record: "
                  "its frequency has moved, and the gain far below it has not, or has with its "
                  "square.")

    rate_per_s: float = parameter("1/s", scale="per_duration", null=0.0)
    reads: str = choice(_FORCE, _DISPLACEMENT, default=_FORCE)

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def base_gain(self, time_s):
        if self.reads == _DISPLACEMENT:
            return 1.0
        return np.maximum(1 + self.rate_per_s * time_s, _LEAST)**2

    def add_force(self, force):
        core = force.core
        natural = 2 * np.pi * core.natural_frequency_hz
        is_moved = core.damping_order == 1 and self.reads == _FORCE
        damping = core.damping_ratio if is_moved else 0.0
        return force.with_law(_drifting, self.rate_per_s / natural, damping, timed=True)

    def alternatives(self):
        return [dataclasses.replace(self, reads=reads) for reads in (_FORCE, _DISPLACEMENT)
                if reads != self.reads]

    @classmethod
    def starts(cls, view):
        return [free(cls(0.02 / view.time[-1], reads), "rate_per_s")
                for reads in (_FORCE, _DISPLACEMENT)]


def _drifting(q0, v0, state, q1, v1, duration, parameters):
    now = state + duration
    more = max(parameters[0] * now, -0.95)
    return (2 + more) * more * q1 + 2 * parameters[1] * more * v1, now
