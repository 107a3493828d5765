"""Resonance of the mounting between base and sensor."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import MOUNTING, Effect
from .fit_starts import finite, grid, spectral_peaks

# Damping ratio up to which a peak shows.
_RESONANT = 0.7


@dataclasses.dataclass(frozen=True)
class MountingResonance(Effect):
    r"""Transmissibility of a spring and damper under the sensor.

    .. math:: \frac{2 \zeta_m \omega_m s + \omega_m^2}{s^2 + 2 \zeta_m \omega_m s + \omega_m^2}

    S. S. Rao, *Mechanical Vibrations*, 5th ed., equation (3.68).
    """

    cause = "mounting_resonance"
    stage = MOUNTING
    explanation = "The mounting is a spring: it has a resonance of its own below the sensor."
    experiment = ("Remount the sensor, or change the mounting's stiffness: a resonance of the "
                  "mounting moves with it.")

    frequency_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 1e3), null=np.inf)
    # more than 1 is no resonance: it looks like a low-pass
    damping_ratio: float = parameter("1", above=0, maximum=100, scale=1.0, reach=(1e-4, 1.0))

    def transfer_function(self, s):
        u = s / (2 * np.pi * self.frequency_hz)
        damper = 2 * self.damping_ratio * u
        return (damper + 1) / (u * u + damper + 1)

    def poles(self):
        return 2 * np.pi * self.frequency_hz * np.roots([1, 2 * self.damping_ratio, 1])

    def zeros(self):
        return np.array([-np.pi * self.frequency_hz / self.damping_ratio])

    def exchanged(self, other):
        core = getattr(other, "natural_frequency_hz", None), getattr(other, "damping_ratio", None)
        if None in core or max(core[1], self.damping_ratio) > _RESONANT:
            return None
        return MountingResonance(*core), dataclasses.replace(
            other, natural_frequency_hz=self.frequency_hz, damping_ratio=self.damping_ratio)

    @classmethod
    def starts(cls, view):
        frequencies = view.rate * np.geomspace(0.02, 3.0, 18)
        found = [start for ratio in (0.07, 0.2, 0.6)
                 for start in grid([cls(frequency, ratio) for frequency in frequencies])]
        # one that rings shows in the residual, between the points of any grid
        return found + [finite(cls(peak, ratio)) for peak in spectral_peaks(view)
                        for ratio in (0.02, 0.06)]
