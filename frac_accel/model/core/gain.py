"""Flat core: a sensor far below its resonance."""

import dataclasses
from typing import ClassVar

import numpy as np

from ..parameters import parameter


@dataclasses.dataclass(frozen=True)
class Gain:
    """The output is the sensitivity times the acceleration.

    Attributes
    ----------
    sensitivity : float
        [output units per m/s²].
    """

    type: ClassVar[str] = "gain"

    sensitivity: float = parameter("output units per m/s^2", default=1.0)

    def transfer_function(self, s):
        """Transfer function at complex `s` [rad/s], same shape: a constant."""
        return np.full(np.shape(s), complex(self.sensitivity))

    def poles(self):
        """Poles [rad/s]: none."""
        return np.array([])

    def zeros(self):
        """Zeros [rad/s]: none."""
        return np.array([])

    def reference_gain(self):
        """The sensitivity's size."""
        return abs(self.sensitivity)

    def require_stable(self, where):
        """A gain is stable, whatever its value."""
