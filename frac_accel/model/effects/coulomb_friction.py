"""Dry friction on the seismic mass."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import positive


@dataclasses.dataclass(frozen=True)
class CoulombFriction(Effect):
    r"""Friction :math:`\omega_0^2 c\,\mathrm{sgn}\,q'`, which also holds the mass at rest."""

    cause = "coulomb_friction"
    stage = CORE
    explanation = "Dry friction holds the seismic mass until the force on it exceeds a level."
    experiment = ("Repeat at a tenth of the level: friction does not shrink with the motion, and "
                  "in the end holds the mass altogether.")

    level: float = parameter("output units", minimum=0, scale=(0.1, "level"), null=0.0)

    def change_core(self, core):
        return require_oscillator(core, self.cause)

    def add_force(self, force):
        return dataclasses.replace(force, friction_level=force.friction_level + self.level)

    @classmethod
    def starts(cls, view):
        return [positive(cls(0.01 * view.level), "level")]
