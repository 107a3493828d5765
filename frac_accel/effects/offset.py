"""Constant added to the output."""

import dataclasses

from ..parameters import parameter
from .base import OFFSET, Effect
from .fit_starts import free


@dataclasses.dataclass(frozen=True)
class Offset(Effect):
    """Zero-acceleration output."""

    cause = "offset"
    stage = OFFSET
    explanation = "A constant is added to the output."
    experiment = ("Record at rest, and once more with the sensor turned over: an offset does not "
                  "turn with it.")

    offset: float = parameter("output units")

    def simulate(self, values, circumstances):
        return values + self.offset

    def invert(self, values, variance, circumstances):
        return values - self.offset, variance

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level), "offset")]
