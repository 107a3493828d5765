"""Resolution of the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import QUANTIZATION, Effect


@dataclasses.dataclass(frozen=True)
class Quantization(Effect):
    """Values are rounded to whole steps."""

    cause = "quantization"
    read_off = True
    stage = QUANTIZATION
    explanation = "The output has a coarse resolution."
    experiment = "Repeat at a tenth of the level: the steps between the values stay as large."

    step: float = parameter("output units", above=0)

    def simulate(self, values, circumstances):
        return self.step * np.round(values / self.step)

    def invert(self, values, variance, circumstances):
        """The values as they are, with the variance of a uniform error of one step's width."""
        return values, variance + self.step**2 / 12
