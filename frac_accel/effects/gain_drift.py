"""Sensitivity that changes steadily with time."""

import dataclasses

from ..parameters import parameter
from .base import GAIN, Effect


@dataclasses.dataclass(frozen=True)
class GainDrift(Effect):
    """Gain 1 + rate t, t from the record's start."""

    cause = "gain_drift"
    stage = GAIN
    explanation = "The sensitivity drifts with time."
    experiment = "Keep level and temperature constant for longer: a drift goes on with time."

    rate_per_s: float = parameter("1/s")

    def simulate(self, values, circumstances):
        return values * (1 + self.rate_per_s * circumstances.time_s)

    def invert(self, values, circumstances):
        return values / (1 + self.rate_per_s * circumstances.time_s)
