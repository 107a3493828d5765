"""Zero-acceleration output that settles after switching on."""

import dataclasses

import numpy as np

from ..parameters import choice, parameter
from .base import OFFSET, Effect
from .fit_starts import free

_SIZE, _ZERO = "size", "zero"


@dataclasses.dataclass(frozen=True)
class WarmUpDrift(Effect):
    """Adds size (1 - exp(-t / time_constant_s)), t from the record's start; where it settles at
    zero, as of a sensor that was calibrated warm, size exp(-t / time_constant_s).

    As a body warms that is heated evenly from an instant on and loses heat by its difference in
    temperature (Newton's law of cooling), with a zero that is proportional to it.
    """

    cause = "warm_up_drift"
    stage = OFFSET
    adds = ("size",)
    explanation = "The zero of the output settles after switching on."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Switch on and record at rest until the zero no longer moves, twice: it settles "
                  "after each start in the same way.")

    size: float = parameter("output units", scale="level", null=0.0)
    time_constant_s: float = parameter("s", above=0, scale="duration", reach=(0.003, 2.0))
    settles_at: str = choice(_SIZE, _ZERO, default=_SIZE)

    def simulate(self, values, circumstances):
        return values + self._added(circumstances)

    def invert(self, values, variance, circumstances):
        return values - self._added(circumstances), variance

    def _added(self, circumstances):
        time = circumstances.time_s / self.time_constant_s
        return self.size * (-np.expm1(-time) if self.settles_at == _SIZE else np.exp(-time))

    def alternatives(self):
        return [dataclasses.replace(self, settles_at=place) for place in (_SIZE, _ZERO)
                if place != self.settles_at]

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level, share * view.time[-1], place), "size")
                for share in (0.02, 0.06, 0.2, 0.6) for place in (_SIZE, _ZERO)]
