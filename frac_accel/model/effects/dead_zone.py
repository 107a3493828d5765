"""Output that does not answer to small signals."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DEAD_ZONE, Effect
from .fit_starts import positive

# Shares of the samples that must lie below zero, and above.
_BOTH_SIDES = 0.01, 0.99


@dataclasses.dataclass(frozen=True)
class DeadZone(Effect):
    r""":math:`y \to \mathrm{sgn}(y) \max(|y| - w, 0)`."""

    cause = "dead_zone"
    stage = DEAD_ZONE
    explanation = "Small signals give no output, and larger ones lose the same amount."
    experiment = ("Repeat at a tenth of the level: a dead zone takes the same amount from every "
                  "swing, and all of a small one.")

    half_width: float = parameter("output units", minimum=0, scale=(0.1, "level"),
                                  null=0.0)

    def simulate(self, values, circumstances):
        return values - np.clip(values, -self.half_width, self.half_width)

    def invert(self, values, variance, circumstances):
        """Inside the zone, where only noise is seen, its middle with the zone's variance."""
        from scipy.special import erf
        with np.errstate(divide="ignore", invalid="ignore"):
            sign = erf(values / np.sqrt(2 * variance))  # mean of the sign behind the noise
        sign = np.where(variance > 0, sign, np.sign(values))
        doubt = self.half_width**2 / 3 * (1 - sign**2)
        return values + sign * self.half_width, variance + doubt

    @classmethod
    def starts(cls, view):
        low, high = np.quantile(view.simulated[view.used], _BOTH_SIDES)
        if not low < 0 < high:
            return []  # of a signal that stays on one side it takes a constant, as an offset does
        return [positive(cls(share * view.level), "half_width") for share in (0.01, 0.05, 0.2)]
