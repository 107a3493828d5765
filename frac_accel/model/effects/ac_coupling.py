"""First-order high-pass of the conditioner."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import CONDITIONER, Effect
from .fit_starts import grid


@dataclasses.dataclass(frozen=True)
class AcCoupling(Effect):
    r"""First-order high-pass :math:`s / (s + \omega_c)`."""

    cause = "ac_coupling"
    stage = CONDITIONER
    acts_on_slow_motion = True
    explanation = "The conditioner is coupled through a high-pass, so slow motion is lost."
    experiment = ("Hold a constant acceleration, such as gravity after turning the sensor over: "
                  "behind a high-pass the output returns to zero.")

    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 1e3), null=0.0)

    def transfer_function(self, s):
        return s / (s + 2 * np.pi * self.corner_hz)

    def poles(self):
        return np.array([-2 * np.pi * self.corner_hz])

    def zeros(self):
        return np.array([0.0])

    @classmethod
    def starts(cls, view):
        return grid([cls(corner) for corner in view.rate * np.geomspace(5e-2, 2e-6, 18)])
