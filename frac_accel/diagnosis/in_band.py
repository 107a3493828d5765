"""What laws make of a motion, as far as a record shows it that was filtered to a band."""

import numpy as np
from scipy.signal import oaconvolve

from ..model.effects.base import DEAD_ZONE
from ..record.resampling import inner_taps
from ..signals.convolution import Convolution
from ..simulation import sampled

# Points in each sampling interval at which a law bends the output of a sensor that was faster than
# the record: what it makes of the motion beyond the band was there, and filtered off.
_FINE = 8


class InBand:
    """Takes from what laws add to a motion what the record's own filter took from the sensor.

    What is linear lies in the band as the reference does. The harmonics that a law makes lie beyond
    it, too: a sensor with instants of its own shows them folded, one that was faster not at all.

    Parameters
    ----------
    record : Record
    """

    def __init__(self, record):
        self._rate, self._band_hz = record.sampling_rate_hz, record.band_hz
        self._fine = _FINE if "sensor" in record.resampled else 1

    def added(self, fine, steps, position=None):
        """What of an addition shows at the record's instants, shape (n,); parameters as those of
        `simulation.sampled`."""
        if self._band_hz is None:
            return sampled(fine, steps, position)
        if self._fine == 1:
            return self._filtered(sampled(fine, steps, position), 1)
        return sampled(self._filtered(fine, steps), steps, position)

    def behind(self, effect, values, circumstances):
        """Samples behind an effect on them; laws bend them between the samples, too."""
        own = effect.live(self._rate)
        if self._band_hz is None or effect.stage != DEAD_ZONE:
            return own.simulate(values, circumstances)
        fine = values
        if self._fine > 1:
            convolution = Convolution(values - values[0], self._rate)
            fine = values[0] + convolution.response_between(
                np.ones(len(convolution.s)), self._fine, self._fine * len(values))
            circumstances = type(circumstances)(*(
                None if each is None else np.repeat(each, self._fine) for each in circumstances))
        return values + self.added(own.simulate(fine, circumstances) - fine, self._fine)

    def _filtered(self, values, steps):
        taps = inner_taps(steps * self._rate, self._band_hz, len(values))
        longer = np.pad(values, len(taps) // 2, mode="reflect", reflect_type="odd")
        return oaconvolve(longer, taps, mode="valid")
