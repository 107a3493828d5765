"""Structural mode beside the sensor's own."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import MOUNTING, Effect
from .fit_starts import free, spectral_peaks


@dataclasses.dataclass(frozen=True)
class SecondResonance(Effect):
    r"""A mode in parallel with the rigid path, which makes a resonance and an antiresonance.

    .. math:: 1 - p + p \frac{\omega^2}{s^2 + 2 \zeta \omega s + \omega^2}

    with the mode's share `p` of the static gain; the antiresonance lies at
    :math:`\omega / \sqrt{1 - p}`. D. J. Ewins, *Modal Testing*, 2nd ed., section 2.2 (modal sum).
    """

    cause = "second_resonance"
    stage = MOUNTING
    explanation = ("A part of the sensor or its fixture swings by itself and adds its motion: a "
                   "second resonance beside an antiresonance.")
    experiment = ("Sweep slowly across the second peak: it has a notch beside it. Fix or load "
                  "parts of the fixture one by one: the peak moves with one of them.")

    frequency_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 10.0))
    damping_ratio: float = parameter("1", above=0, maximum=100, scale=1.0, reach=(1e-4, 1.0))
    # at 1 nothing of the rigid path is left; from a half on it is no second path, and would only
    # imitate a low-pass
    share: float = parameter("1", above=-1, below=1, scale=0.1, reach=(-0.5, 0.5), null=0.0)

    def transfer_function(self, s):
        u = np.asarray(s, complex) / (2 * np.pi * self.frequency_hz)
        return 1 - self.share + self.share / (u * u + 2 * self.damping_ratio * u + 1)

    def poles(self):
        return 2 * np.pi * self.frequency_hz * np.roots([1, 2 * self.damping_ratio, 1])

    def zeros(self):
        rigid = 1 - self.share
        return 2 * np.pi * self.frequency_hz * np.roots([rigid, 2 * self.damping_ratio * rigid, 1])

    @classmethod
    def starts(cls, view):
        # the output is linear in the share
        frequencies = [*(view.rate * np.geomspace(0.01, 0.49, 14)), *spectral_peaks(view)]
        return [free(cls(frequency, ratio, 0.01), "share")
                for frequency in frequencies for ratio in (0.01, 0.04, 0.15)]
