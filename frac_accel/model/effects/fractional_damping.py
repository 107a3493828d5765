"""Damping of fractional order instead of the core's."""

import dataclasses

from ..parameters import parameter
from .base import CORE, Effect, require_oscillator
from .fit_starts import Start


@dataclasses.dataclass(frozen=True)
class FractionalDamping(Effect):
    """The oscillator's damping term has another order, as viscoelastic material gives it."""

    cause = "fractional_damping"
    stage = CORE
    explanation = "The damping force follows a fractional derivative of the displacement."
    experiment = ("Sweep from far below to far above the resonance: damping of another order "
                  "turns the phase over decades, not at the resonance alone.")

    damping_order: float = parameter("1", above=0, below=2, scale=1.0, null="core")
    damping_ratio: float = parameter("1", above=0, maximum=100, scale=1.0, reach=(1e-4, 100.0),
                                     null="core")

    restates_core = True
    nested = ("damping_order",)

    def change_core(self, core):
        """Raise ModelError where the core is not an oscillator."""
        return dataclasses.replace(require_oscillator(core, self.cause),
                                   damping_order=self.damping_order,
                                   damping_ratio=self.damping_ratio)

    @classmethod
    def starts(cls, view):
        ratio = view.core.damping_ratio
        orders = [view.core.damping_order + shift
                  for shift in (-0.8, -0.5, -0.25, -0.05, 0.05, 0.25, 0.5, 0.8)]
        return [Start(cls(order, ratio), (cls(order, ratio), cls(order, 1.05 * ratio)), "free")
                for order in orders if 0.05 < order < 1.95]
