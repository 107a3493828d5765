"""Zero-acceleration output that jumps."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import OFFSET, Effect
from .fit_starts import finite, jumps


@dataclasses.dataclass(frozen=True)
class OffsetStep(Effect):
    """Adds a step from an instant on, counted from the record's start."""

    cause = "offset_step"
    stage = OFFSET
    adds = ("step",)
    explanation = "The zero of the output jumps at one instant."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Look at cable, supply and mount for what happened at that instant, and record "
                  "at rest before and after handling them.")

    at_s: float = parameter("s", minimum=0, scale=(16, "interval"), step=0.5, jumps=True)
    step: float = parameter("output units", scale="level", null=0.0)

    def simulate(self, values, circumstances):
        return values + self._added(circumstances)

    def invert(self, values, variance, circumstances):
        return values - self._added(circumstances), variance

    def _added(self, circumstances):
        return np.where(circumstances.time_s >= self.at_s, self.step, 0.0)

    @classmethod
    def starts(cls, view):
        return [finite(cls(at_s, step))
                for at_s, step in jumps(view, np.ones(len(view.residual)))]
