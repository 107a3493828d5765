"""Constant added to the output."""

import dataclasses

from ..parameters import parameter
from .base import OFFSET, Effect


@dataclasses.dataclass(frozen=True)
class Offset(Effect):
    """Zero-acceleration output."""

    cause = "offset"
    stage = OFFSET
    explanation = "A constant is added to the output."

    offset: float = parameter("output units")

    @classmethod
    def simulate(cls, values, by_axis):
        result = values.copy()
        for axis, effect in by_axis.items():
            result[:, axis] += effect.offset
        return result

    @classmethod
    def invert(cls, values, by_axis):
        result = values.copy()
        for axis, effect in by_axis.items():
            result[:, axis] -= effect.offset
        return result
