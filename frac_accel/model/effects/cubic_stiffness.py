"""Spring that hardens or softens with displacement, the same both ways."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect
from .fit_starts import by_equation, free


@dataclasses.dataclass(frozen=True)
class CubicStiffness(Effect):
    r"""Restoring force :math:`\omega_0^2 (q + \alpha_3 q^3)`, the spring of G. Duffing (1918)."""

    cause = "cubic_stiffness"
    stage = CORE
    bends_at_once = True
    explanation = "The spring hardens (or softens) at large displacement, the same both ways."
    experiment = ("Repeat at half and at twice the level: the deviation grows with the cube of "
                  "the level.")

    alpha3: float = parameter("1/(output units)^2", scale=(0.1, "per_level_squared"), null=0.0)

    def add_force(self, force):
        return force.with_power(3, self.alpha3)

    @classmethod
    def starts(cls, view):
        return [free(cls(1e-3 / view.level**2), "alpha3"), *by_equation(view, cls, 3)]
