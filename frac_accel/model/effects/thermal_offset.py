"""Zero-acceleration output that changes with temperature."""

import dataclasses

import numpy as np

from ...errors import FracAccelError
from ..parameters import parameter
from .base import OFFSET, Effect
from .fit_starts import free
from .temperature_sensitivity import REFERENCE_C, UNKNOWN_STD_K


@dataclasses.dataclass(frozen=True)
class ThermalOffset(Effect):
    """Adds coefficient (T - 25 °C)."""

    cause = "thermal_offset"
    stage = OFFSET
    adds = ("coefficient_per_k",)
    explanation = "The zero of the output changes with temperature."
    needs_temperature = True
    shows_with_time = True
    experiment = ("Run a temperature cycle at rest, and record the temperature: the zero comes "
                  "back with it, unlike a drift.")

    coefficient_per_k: float = parameter("output units/K", scale=(0.01, "level"), null=0.0)

    def simulate(self, values, circumstances):
        if circumstances.temperature_c is None:
            raise FracAccelError("the model has thermal_offset, but no temperature is given")
        return values + self._offset(circumstances.temperature_c)

    def invert(self, values, variance, circumstances):
        """Where no temperature is known yet, it is taken as 25 °C with a wide uncertainty."""
        temperature = circumstances.temperature_c
        if temperature is None:
            temperature = np.full(len(values), np.nan)
        doubt = np.where(np.isnan(temperature), self.coefficient_per_k * UNKNOWN_STD_K, 0.0)
        return values - self._offset(temperature), variance + doubt**2

    def _offset(self, temperature_c):
        excess = np.where(np.isnan(temperature_c), 0.0, temperature_c - REFERENCE_C)
        return self.coefficient_per_k * excess

    @classmethod
    def starts(cls, view):
        return [free(cls(1e-4 * view.level), "coefficient_per_k")] if view.warms else []
