"""First-order low-pass of the conditioner."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import CONDITIONER, Effect
from .fit_starts import grid, matching


@dataclasses.dataclass(frozen=True)
class LowPassLag(Effect):
    r"""First-order low-pass :math:`\omega_c / (s + \omega_c)`."""

    cause = "low_pass_lag"
    stage = CONDITIONER
    explanation = "A first-order low-pass in the conditioner makes fast motion smaller and later."
    experiment = ("Excite up to several times the corner frequency: a low-pass takes amplitude "
                  "away there, a delay does not.")

    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 10.0), null=np.inf)

    def transfer_function(self, s):
        corner = 2 * np.pi * self.corner_hz
        return corner / (s + corner)

    def poles(self):
        return np.array([-2 * np.pi * self.corner_hz])

    @classmethod
    def starts(cls, view):
        links = [cls(corner) for corner in view.rate * np.geomspace(0.002, 9, 16)]
        return [*grid(links), *matching(view, links)]
