"""Response of an axis to the acceleration along the others."""

import dataclasses
import functools

import numpy as np

from ...errors import ModelError
from ..parameters import parameter
from .axis_mixing import mix, mixing_matrix
from .axis_turn import turn_of
from .base import CROSS_AXIS, Effect
from .fit_starts import Start


@dataclasses.dataclass(frozen=True)
class CrossAxisSensitivity(Effect):
    """Adds a share of each other axis's output; the coefficient of the axis itself is not used."""

    cause = "cross_axis_sensitivity"
    stage = CROSS_AXIS
    explanation = "The sensor also answers to motion across its axis."
    experiment = ("Move in one direction across the axis at a time, with the axis itself at rest: "
                  "what it still shows came across.")
    describes = "across"

    x: float = parameter("1", minimum=-1, maximum=1, default=0.0, scale=1.0, null=0.0)
    y: float = parameter("1", minimum=-1, maximum=1, default=0.0, scale=1.0, null=0.0)
    z: float = parameter("1", minimum=-1, maximum=1, default=0.0, scale=1.0, null=0.0)

    def share_of_axes(self, axis):
        shares = np.array([self.x, self.y, self.z])
        shares[axis] = 1.0
        return shares

    @classmethod
    def fitted_parameters(cls, axis, excited):
        return [other for other in "xyz" if other != axis and excited[other]]

    @classmethod
    def simulate_axes(cls, values, by_axis, circumstances):
        return mix(values, mixing_matrix(by_axis))

    @classmethod
    def invert_axes(cls, values, variance, by_axis, circumstances):
        inverse = _inverse(tuple(by_axis.items()))
        return mix(values, inverse), mix(variance, inverse**2)

    @classmethod
    def starts(cls, view):
        others = [axis for axis in "xyz" if view.excited[axis] and axis != view.axis]
        if turn_of(view) is not None:
            return []  # what each axis has of the others, these have of it with the other sign
        return [Start(cls(**dict.fromkeys(others, 1e-3)),
                      tuple(cls(**{axis: 1e-3}) for axis in others), "free")] if others else []


@functools.lru_cache
def _inverse(by_axis):
    matrix = mixing_matrix(dict(by_axis))
    if np.linalg.cond(matrix) > 1e3:
        raise ModelError("effects: cross_axis_sensitivity cannot be inverted, its axes are nearly "
                         "the same direction")
    return np.linalg.inv(matrix)
