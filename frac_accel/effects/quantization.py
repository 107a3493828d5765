"""Resolution of the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import QUANTIZATION, Effect


@dataclasses.dataclass(frozen=True)
class Quantization(Effect):
    """Values are rounded to whole steps."""

    cause = "quantization"
    stage = QUANTIZATION
    explanation = "The output has a coarse resolution."
    experiment = "Repeat at a tenth of the level: the steps between the values stay as large."

    step: float = parameter("output units", above=0)

    def simulate(self, values, circumstances):
        return self.step * np.round(values / self.step)
