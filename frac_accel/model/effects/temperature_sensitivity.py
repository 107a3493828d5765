"""Sensitivity that changes with temperature."""

import dataclasses

import numpy as np

from ...errors import FracAccelError
from ..parameters import parameter
from .base import GAIN, Effect
from .fit_starts import free

REFERENCE_C = 25.0
# Standard deviation of a temperature that nobody tells: that of anything from -35 to 85 °C.
UNKNOWN_STD_K = 35.0


@dataclasses.dataclass(frozen=True)
class TemperatureSensitivity(Effect):
    """Gain 1 + coefficient (T - 25 °C)."""

    cause = "temperature_sensitivity"
    stage = GAIN
    explanation = "The sensitivity changes with temperature."
    needs_temperature = True
    shows_with_time = True
    experiment = ("Run a temperature cycle at constant excitation, and record the temperature: "
                  "the gain comes back with it, unlike a drift.")

    coefficient_per_k: float = parameter("1/K", minimum=-0.1, maximum=0.1, scale=0.01,
                                         null=0.0)

    def simulate(self, values, circumstances):
        if circumstances.temperature_c is None:
            raise FracAccelError("the model has temperature_sensitivity, but no temperature is "
                                 "given")
        return values * self._gain(circumstances.temperature_c)

    def invert(self, values, variance, circumstances):
        """Where no temperature is known yet, it is taken as 25 °C with a wide uncertainty."""
        temperature = circumstances.temperature_c
        if temperature is None:
            temperature = np.full(len(values), np.nan)
        gain = self._gain(temperature)
        unknown = np.isnan(temperature)
        doubt = self.coefficient_per_k * UNKNOWN_STD_K * values
        return values / gain, (variance + np.where(unknown, doubt**2, 0.0)) / gain**2

    def _gain(self, temperature_c):
        excess = np.where(np.isnan(temperature_c), 0.0, temperature_c - REFERENCE_C)
        # beyond this the line has long ceased to hold
        return np.clip(1 + self.coefficient_per_k * excess, 0.1, 10.0)

    @classmethod
    def starts(cls, view):
        return [free(cls(1e-4), "coefficient_per_k")] if view.warms else []
