"""Range that the output cannot leave."""

import dataclasses

import numpy as np

from ..errors import ModelError
from ..parameters import parameter
from .base import CLIPPING, Effect


@dataclasses.dataclass(frozen=True)
class Clipping(Effect):
    """Values beyond the limits come out as the limits."""

    cause = "clipping"
    read_off = True
    stage = CLIPPING
    explanation = "Values beyond the sensor's range are cut off."
    experiment = "Repeat at half the level: nothing is cut then, and the output follows again."

    lower: float = parameter("output units")
    upper: float = parameter("output units")

    def __post_init__(self):
        if not self.lower < self.upper:
            raise ModelError(f"effects: clipping from {self.lower:g} to {self.upper:g} given, "
                             "expected lower below upper")

    def simulate(self, values, circumstances):
        return np.clip(values, self.lower, self.upper)

    def limits(self):
        return self.lower, self.upper
