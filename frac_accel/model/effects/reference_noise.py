"""Noise of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import coefficients, parameter
from .base import REFERENCE, Effect, Reading
from .whole_record import filtered


@dataclasses.dataclass(frozen=True)
class ReferenceNoise(Effect):
    """White noise on the reference.

    The motion is best guessed by the filter with the least error (`budget.reference_noise`):
    `share` of what is recorded at some frequencies, without a delay.
    """

    cause = "reference_noise"
    stage = REFERENCE
    of_reference = True
    # the motion of another axis has another spectrum
    of_own_axis = True
    read_off = True
    explanation = ("The reference has noise of its own, which the sensor does not have: a fit to "
                   "it as it is finds less gain and other motion than there is.")
    experiment = ("Put a second reference beside the first: what the two do not share is noise of "
                  "theirs.")

    std: float = parameter("m/s^2", above=0)
    frequency_hz: tuple = coefficients()
    share: tuple = coefficients()

    def change_base(self, values, sampling_rate_hz):
        return filtered(values, sampling_rate_hz, self.frequency_hz[1], lambda frequency_hz:
                             np.interp(frequency_hz, self.frequency_hz, self.share))

    def unknown_density(self, frequency_hz):
        white = self.std**2 / self.frequency_hz[-1]
        return white * np.interp(frequency_hz, self.frequency_hz, self.share)

    @classmethod
    def of_record(cls, found, measured):
        noise = found.reference_noise
        return cls(noise.std, noise.frequency_hz, noise.share) \
            if noise and noise.bends else None

    def reading(self, seen):
        """What it explains, a fit without it tells: here the error is what that with it leaves."""
        noise, error = seen.found.reference_noise, (seen.measured - seen.output)[seen.used]
        # as little as every instrument has is no fault
        return Reading({"std": noise.uncertainty}, error, error, noise.words) \
            if noise.is_much else None
