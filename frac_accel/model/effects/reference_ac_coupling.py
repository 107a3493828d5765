"""High-pass of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import coherent_from_hz, grid
from .whole_record import filtered

# Power of the frequency with which what is left falls below `known_from_hz`.
_STEEP = 8


@dataclasses.dataclass(frozen=True)
class ReferenceAcCoupling(Effect):
    r"""The reference was recorded behind :math:`s / (s + \omega_c)`.

    Its link turns the record back into the motion, :math:`(s + \omega_c) / s`: all but a constant
    and a slow drift, which the reference has lost. What it has at the lowest frequencies is its
    own noise, and this link would make a slow wandering of that: below `known_from_hz` nothing is
    taken from it.
    """

    cause = "reference_ac_coupling"
    stage = REFERENCE
    of_reference = True
    acts_on_slow_motion = True
    explanation = ("The reference was recorded through a high-pass, so its slow motion is too "
                   "small and too early; the sensor's is not.")
    experiment = ("Hold a constant acceleration, such as gravity after turning both over: the "
                  "reference behind a high-pass returns to zero, the sensor does not.")

    corner_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 1e-1), null=0.0)
    known_from_hz: float = parameter("Hz", minimum=0, default=0.0, fixed=True)

    def changes_base(self):
        return self.known_from_hz > 0

    def change_base(self, values, sampling_rate_hz):
        if not self.known_from_hz:
            return values
        return filtered(values, sampling_rate_hz, self.known_from_hz, self._turned_back)

    def _turned_back(self, frequency_hz):
        """What is known of the motion, over the record; the phase is that of the link."""
        known = frequency_hz**_STEEP / (frequency_hz**_STEEP + self.known_from_hz**_STEEP)
        return known * (1 - 1j * self.corner_hz / np.maximum(frequency_hz, 1e-300))

    def transfer_function(self, s):
        if self.known_from_hz:
            return self._turned_back(np.imag(s) / (2 * np.pi))
        return 1 + 2 * np.pi * self.corner_hz / s

    def poles(self):
        # whatever is known of slow motion, the constant is not
        return np.array([0.0])

    def zeros(self):
        return np.array([-2 * np.pi * self.corner_hz])

    @classmethod
    def starts(cls, view):
        known_from_hz = coherent_from_hz(view)
        return grid([cls(corner, known_from_hz)
                     for corner in view.rate * np.geomspace(5e-2, 2e-6, 18)])
