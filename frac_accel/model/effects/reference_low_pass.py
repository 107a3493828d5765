"""Low-pass of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import grid, matching


@dataclasses.dataclass(frozen=True)
class ReferenceLowPass(Effect):
    r"""The reference was recorded behind :math:`\omega_c / (s + \omega_c)`.

    Its link turns the record back into the motion, :math:`1 + s / \omega_c`, up to the Nyquist
    frequency.
    """

    cause = "reference_low_pass"
    stage = REFERENCE
    of_reference = True
    explanation = ("The reference was smoothed by a first-order low-pass, so the sensor seems to "
                   "answer fast motion too strongly and too early.")
    experiment = ("Compare both with a third, faster accelerometer: the one that falls behind at "
                  "high frequencies is the one that was smoothed.")

    # further below the Nyquist frequency, little but noise would be left of the fast motion
    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-3, 10.0), null=np.inf)

    def transfer_function(self, s):
        return 1 + s / (2 * np.pi * self.corner_hz)

    def zeros(self):
        return np.array([-2 * np.pi * self.corner_hz])

    @classmethod
    def starts(cls, view):
        links = [cls(corner) for corner in view.rate * np.geomspace(2e-3, 20, 20)]
        return [*grid(links), *matching(view, links)]
