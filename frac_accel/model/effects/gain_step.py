"""Sensitivity that jumps."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import GAIN, Effect
from .fit_starts import finite, jumps


@dataclasses.dataclass(frozen=True)
class GainStep(Effect):
    """Another gain from an instant on, counted from the record's start."""

    cause = "gain_step"
    stage = GAIN
    explanation = "The sensitivity jumps at one instant."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Look at cable, supply, range setting and mount for what happened at that "
                  "instant, and repeat before and after handling them.")

    at_s: float = parameter("s", minimum=0, scale=(16, "interval"), step=0.5, jumps=True)
    # a ratio of nothing could not be inverted
    ratio: float = parameter("1", minimum=0.01, maximum=100, scale=1.0, null=1.0)

    def simulate(self, values, circumstances):
        return values * self._gain(circumstances)

    def invert(self, values, variance, circumstances):
        gain = self._gain(circumstances)
        return values / gain, variance / gain**2

    def _gain(self, circumstances):
        return np.where(circumstances.time_s >= self.at_s, self.ratio, 1.0)

    @classmethod
    def starts(cls, view):
        return [finite(cls(at_s, float(np.clip(1 + change, 0.02, 50))))
                for at_s, change in jumps(view, view.simulated - view.offset)]
