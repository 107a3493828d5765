"""High-pass of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import grid


@dataclasses.dataclass(frozen=True)
class ReferenceAcCoupling(Effect):
    r"""The reference was recorded behind :math:`s / (s + \omega_c)`.

    Its link turns the record back into the motion, :math:`(s + \omega_c) / s`: all but a constant
    and a slow drift, which the reference has lost.
    """

    cause = "reference_ac_coupling"
    stage = REFERENCE
    of_reference = True
    explanation = ("The reference was recorded through a high-pass, so its slow motion is too "
                   "small and too early; the sensor's is not.")
    experiment = ("Hold a constant acceleration, such as gravity after turning both over: the "
                  "reference behind a high-pass returns to zero, the sensor does not.")

    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 1e-1), null=0.0)

    def transfer_function(self, s):
        return 1 + 2 * np.pi * self.corner_hz / s

    def poles(self):
        return np.array([0.0])

    def zeros(self):
        return np.array([-2 * np.pi * self.corner_hz])

    @classmethod
    def starts(cls, view):
        return grid([cls(corner) for corner in view.rate * np.geomspace(5e-2, 2e-6, 18)])
