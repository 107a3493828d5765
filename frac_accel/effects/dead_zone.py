"""Output that does not answer to small signals."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DEAD_ZONE, Effect


@dataclasses.dataclass(frozen=True)
class DeadZone(Effect):
    r""":math:`y \to \mathrm{sgn}(y) \max(|y| - w, 0)`."""

    cause = "dead_zone"
    stage = DEAD_ZONE
    explanation = "Small signals give no output, and larger ones lose the same amount."
    experiment = ("Repeat at a tenth of the level: a dead zone takes the same amount from every "
                  "swing, and all of a small one.")

    half_width: float = parameter("output units", minimum=0)

    def simulate(self, values, circumstances):
        return values - np.clip(values, -self.half_width, self.half_width)

    def invert(self, values, circumstances):
        """Inside the zone, its middle."""
        return values + np.sign(values) * self.half_width
