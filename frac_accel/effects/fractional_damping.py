"""Damping of fractional order instead of the core's."""

import dataclasses

from ..core import Oscillator
from ..errors import ModelError
from ..parameters import parameter
from .base import CORE, Effect


@dataclasses.dataclass(frozen=True)
class FractionalDamping(Effect):
    """The oscillator's damping term has another order, as viscoelastic material gives it."""

    cause = "fractional_damping"
    stage = CORE
    explanation = "The damping force follows a fractional derivative of the displacement."

    damping_order: float = parameter("1", above=0, below=2)
    damping_ratio: float = parameter("1", above=0, maximum=100)

    def change_core(self, core):
        """Raise ModelError where the core is not an oscillator."""
        if not isinstance(core, Oscillator):
            raise ModelError(f"effects: fractional_damping given with a core of type {core.type}, "
                             "expected an oscillator")
        return dataclasses.replace(core, damping_order=self.damping_order,
                                   damping_ratio=self.damping_ratio)
