"""Zero-acceleration output that changes steadily with time."""

import dataclasses

from ..parameters import parameter
from .base import OFFSET, Effect
from .fit_starts import free


@dataclasses.dataclass(frozen=True)
class OffsetDrift(Effect):
    """Adds rate t, t from the record's start."""

    cause = "offset_drift"
    stage = OFFSET
    explanation = "The zero of the output drifts with time."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Record at rest and at constant temperature for longer: a drifting zero goes on "
                  "with time.")

    rate_per_s: float = parameter("output units/s", scale="level_per_duration", null=0.0)

    def simulate(self, values, circumstances):
        return values + self.rate_per_s * circumstances.time_s

    def invert(self, values, variance, circumstances):
        return values - self.rate_per_s * circumstances.time_s, variance

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level / view.time[-1]), "rate_per_s")]
