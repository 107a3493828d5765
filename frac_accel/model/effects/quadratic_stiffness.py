"""Spring that is harder one way than the other."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect
from .fit_starts import by_equation, free


@dataclasses.dataclass(frozen=True)
class QuadraticStiffness(Effect):
    r"""Restoring force :math:`\omega_0^2 (q + \alpha_2 q^2)`."""

    cause = "quadratic_stiffness"
    stage = CORE
    bends_at_once = True
    explanation = "The spring is harder in one direction than in the other."
    experiment = ("Repeat at half and at twice the level: the deviation grows with the square of "
                  "the level, with a second harmonic and a shift of the mean.")

    alpha2: float = parameter("1/(output units)", scale=(0.1, "per_level"), null=0.0)

    def add_force(self, force):
        return force.with_power(2, self.alpha2)

    @classmethod
    def starts(cls, view):
        return [free(cls(1e-3 / view.level), "alpha2"), *by_equation(view, cls, 2)]
