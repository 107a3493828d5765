"""Zero-acceleration output that settles after switching on."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import OFFSET, Effect
from .fit_starts import free


@dataclasses.dataclass(frozen=True)
class WarmUpDrift(Effect):
    """Adds size (1 - exp(-t / time_constant_s)), t from the record's start.

    As a body warms that is heated evenly from an instant on and loses heat by its difference in
    temperature (Newton's law of cooling), with a zero that is proportional to it.
    """

    cause = "warm_up_drift"
    stage = OFFSET
    explanation = "The zero of the output settles after switching on."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Switch on and record at rest until the zero no longer moves, twice: it settles "
                  "after each start in the same way.")

    size: float = parameter("output units", scale="level", null=0.0)
    time_constant_s: float = parameter("s", above=0, scale="duration", reach=(0.003, 2.0))

    def simulate(self, values, circumstances):
        return values + self._added(circumstances)

    def invert(self, values, variance, circumstances):
        return values - self._added(circumstances), variance

    def _added(self, circumstances):
        return -self.size * np.expm1(-circumstances.time_s / self.time_constant_s)

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level, share * view.time[-1]), "size")
                for share in (0.02, 0.06, 0.2, 0.6)]
