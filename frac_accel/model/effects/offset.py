"""Constant added to the output."""

import dataclasses

from ..parameters import parameter
from .base import OFFSET, Effect, Open
from .fit_starts import free


@dataclasses.dataclass(frozen=True)
class Offset(Effect):
    """Zero-acceleration output."""

    cause = "offset"
    stage = OFFSET
    adds = ("offset",)
    explanation = "A constant is added to the output."
    everyday = True
    shows_with_time = True
    experiment = ("Record at rest, and once more with the sensor turned over: an offset does not "
                  "turn with it.")

    offset: float = parameter("output units", scale="level", null=0.0)

    identified_as = "offset"

    @classmethod
    def left_open(cls, axis_model, stds, stamps_std_s):
        if "offset" not in stds:
            return None
        own = next((effect for effect in axis_model.effects if isinstance(effect, cls)), cls(0.0))
        return Open(own, {"offset": stds["offset"]})

    def simulate(self, values, circumstances):
        return values + self.offset

    def invert(self, values, variance, circumstances):
        return values - self.offset, variance

    @classmethod
    def starts(cls, view):
        return [free(cls(0.01 * view.level), "offset")]
