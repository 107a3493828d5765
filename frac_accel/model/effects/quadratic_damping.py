"""Damping that grows with the speed, as that of turbulent flow."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import positive


@dataclasses.dataclass(frozen=True)
class QuadraticDamping(Effect):
    r"""Adds :math:`d\, q' |q'| / \omega_0^2` to the spring's bracket."""

    cause = "quadratic_damping"
    stage = CORE
    explanation = "The damping grows with the speed, as where a fluid is pressed through a gap."
    experiment = ("Excite around the resonance at half and at twice the level: its peak becomes "
                  "lower with the level, and its frequency stays.")

    coefficient: float = parameter("1/(output units)", minimum=0, scale=(0.1, "per_level"),
                                   null=0.0)

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def add_force(self, force):
        return force.with_law(_drag, self.coefficient)

    @classmethod
    def starts(cls, view):
        return [positive(cls(0.01 / view.level), "coefficient")]


def _drag(q0, v0, state, q1, v1, duration, parameters):
    # v is the derivative by tau = omega_0 t
    return parameters[0] * v1 * abs(v1), 0.0
