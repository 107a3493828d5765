"""Tone that is added to the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import INTERFERENCE, Effect
from .fit_starts import positive, strongest_line

# A tone that wanders by less than about a third of this share of its frequency is followed.
_RELATIVE_WIDTH = 3e-4
# Lines on either side beside which it is seen.
_LINES = 10
# Times as strong as the lines beside it, and share of it that a tone must be at most, where another
# axis' motion may make it.
_LINE, _CROSSED = 10.0, 1.0
# The highest harmonic that is taken for a part of the tone.
_HARMONICS = 10


@dataclasses.dataclass(frozen=True)
class ToneInterference(Effect):
    """Adds a sine that has nothing to do with the motion, such as mains hum."""

    cause = "tone_interference"
    stage = INTERFERENCE
    explanation = "A tone from elsewhere, such as mains hum, is added to the output."
    shows_with_time = True
    experiment = "Record at rest: a tone from elsewhere is still there."

    # the phase at a record's end must change by little: hence the step
    frequency_hz: float = parameter("Hz", above=0, scale="rate", reach=(1e-6, 1e3), step=1e-8)
    amplitude: float = parameter("output units", minimum=0, scale="level", null=0.0)
    # of the sine at the record's start
    phase_rad: float = parameter("rad", default=0.0, scale=1.0)

    def simulate(self, values, circumstances):
        return values + self._tone(circumstances)

    def invert(self, values, variance, circumstances):
        return values - self._tone(circumstances), variance

    @classmethod
    def starts(cls, view):
        line = strongest_line(view)
        # as strong as it is before what filters the record
        return [positive(cls(*line), "amplitude")] if line else []

    def live(self, sampling_rate_hz):
        """In a stream the phase is not known: it is found."""
        return _Tracker(self, sampling_rate_hz)

    def kindred(self, residual, time_s):
        # harmonics
        turns = 2j * np.pi * self.frequency_hz * time_s
        lines = [np.mean(residual * np.exp(-number * turns))
                 for number in range(2, _HARMONICS + 1)]
        return float(np.sqrt(2) * np.linalg.norm(lines))

    def beside(self, residual, time_s):
        # the lines next to its own
        return float(np.sqrt(2) * np.linalg.norm(self._lines_around(residual, time_s)))

    def may_be_of(self, motion, time_s):
        # a line of its own at this frequency; the window keeps strong ones from spreading to it
        lines = np.abs(self._lines_around(np.hanning(len(motion)) * motion, time_s))
        away = np.abs(np.arange(-_LINES, _LINES + 1))
        beside = np.sqrt(np.mean(lines[away > 2]**2))
        # of the window, half the mean is lost
        return lines[_LINES] > _LINE * beside and self.amplitude < _CROSSED * 4 * lines[_LINES]

    def _lines_around(self, values, time_s):
        """Lines of values, shape (n,), at the tone's frequency and on either side."""
        turns = 2j * np.pi * time_s
        apart = np.arange(-_LINES, _LINES + 1) / (time_s[-1] - time_s[0])
        return [np.mean(values * np.exp(-(self.frequency_hz + off) * turns)) for off in apart]

    def _tone(self, circumstances):
        phase = 2 * np.pi * self.frequency_hz * circumstances.time_s + self.phase_rad
        return self.amplitude * np.sin(phase)


class _Tracker:
    r"""Finds the phase of the tone in a stream and takes the tone out.

    The samples are turned back by the tone's own angle and averaged, first over all that there
    are, then over a fading memory; the mean is that of the tone and, with a variance that falls
    with the number of samples, of all else. As the amplitude is known, the mean is shrunk by what
    it is worth: the tone's power over that and the variance (N. Wiener, 1949). What is left of
    the tone, or lost of the motion, counts as variance.
    """

    def __init__(self, effect, sampling_rate_hz):
        self._effect = effect
        self._turns = effect.frequency_hz / sampling_rate_hz
        self._keep = np.exp(-np.pi * _RELATIVE_WIDTH * self._turns)
        self._power = effect.amplitude**2
        self._sum, self._squares = np.zeros(1, complex), np.zeros(1)
        self._first, self._count = None, 0

    def simulate(self, values, circumstances):
        return self._effect.simulate(values, circumstances)

    def invert(self, values, variance, circumstances):
        if not len(values):
            return values, variance
        if self._first is None:
            self._first = values[0]  # most of a steady part, such as gravity
        number = self._count + np.arange(1, len(values) + 1)
        self._count += len(values)
        angle = 2 * np.pi * np.mod(self._turns * number, 1.0)
        tone = np.cos(angle) + 1j * np.sin(angle)
        moving = values - self._first
        feedback = [1.0, -self._keep]
        # imported here, as only this cause is worth the time that it takes
        from scipy.signal import lfilter
        sums, self._sum = lfilter([1.0], feedback, moving * tone.conj(), zi=self._sum)
        squares, self._squares = lfilter([1.0], feedback, moving**2, zi=self._squares)
        weight = (1 - self._keep**number) / (1 - self._keep)
        squared_weight = (1 - self._keep**(2 * number)) / (1 - self._keep**2)
        doubt = 4 * squares * squared_weight / weight**3
        worth = self._power / np.maximum(self._power + doubt, 1e-300)
        found = 2 * sums / weight * worth
        return (values - (found.real * tone.real - found.imag * tone.imag),
                variance + worth * doubt / 2)
