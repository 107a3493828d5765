"""Sensitivity that changes with temperature."""

import dataclasses

from ..errors import FracAccelError
from ..parameters import parameter
from .base import GAIN, Effect

REFERENCE_C = 25.0


@dataclasses.dataclass(frozen=True)
class TemperatureSensitivity(Effect):
    """Gain 1 + coefficient (T - 25 °C)."""

    cause = "temperature_sensitivity"
    stage = GAIN
    explanation = "The sensitivity changes with temperature."
    experiment = ("Run a temperature cycle at constant excitation, and record the temperature: "
                  "the gain comes back with it, unlike a drift.")

    coefficient_per_k: float = parameter("1/K", minimum=-0.1, maximum=0.1)

    def simulate(self, values, circumstances):
        return values * self._gain(circumstances)

    def invert(self, values, circumstances):
        return values / self._gain(circumstances)

    def _gain(self, circumstances):
        if circumstances.temperature_c is None:
            raise FracAccelError("the model has temperature_sensitivity, but no temperature is "
                                 "given")
        return 1 + self.coefficient_per_k * (circumstances.temperature_c - REFERENCE_C)
