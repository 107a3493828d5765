"""Tone that is added to the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import INTERFERENCE, Effect


@dataclasses.dataclass(frozen=True)
class ToneInterference(Effect):
    """Adds a sine that has nothing to do with the motion, such as mains hum."""

    cause = "tone_interference"
    stage = INTERFERENCE
    explanation = "A tone from elsewhere, such as mains hum, is added to the output."
    experiment = "Record at rest: a tone from elsewhere is still there."

    frequency_hz: float = parameter("Hz", above=0)
    amplitude: float = parameter("output units", minimum=0)
    # of the sine at the record's start
    phase_rad: float = parameter("rad", default=0.0)

    def simulate(self, values, circumstances):
        return values + self.tone(circumstances.time_s)

    def tone(self, time_s):
        """What is added, at times [s] since the record's start."""
        return self.amplitude * np.sin(2 * np.pi * self.frequency_hz * time_s + self.phase_rad)
