"""What laws make of a motion, as far as a record shows it that was filtered to a band."""

import numpy as np

from ..record.resampling import inner_filter
from ..signals.convolution import refined
from ..simulation import sampled

# Points in each sampling interval at which a law bends the output of a sensor that was faster than
# the record: what it makes of the motion beyond the band was there, and filtered off.
_FINE = 8


class InBand:
    """Takes from what laws add to a motion what the record's own filter took from the sensor.

    A law bends all of a motion, and the filter came after it. What it makes beyond half the rate a
    sensor with instants of its own shows folded, one that was faster not at all.

    Parameters
    ----------
    record : Record
        With a `band_hz`.
    """

    def __init__(self, record):
        self._rate, self._band_hz = record.sampling_rate_hz, record.band_hz
        self._fine = _FINE if "sensor" in record.resampled else 1

    def added(self, fine, steps, count, late=0.0):
        """What of an addition shows at the record's instants, shape (count,); parameters as those
        of `simulation.sampled`."""
        if self._fine == 1:
            return self.filtered(sampled(fine, steps, count, late))
        whole = int(np.floor(late))
        later = np.r_[np.full(whole, fine[0]), fine] if whole > 0 else fine[-whole:]
        return self.filtered(later[:steps * count], steps, late - whole)

    def behind(self, effect, values, whole, circumstances):
        """Samples behind a law of the output, and those before any filter.

        Parameters
        ----------
        effect : Effect
        values, whole : ndarray, shape (n,)
            Samples before it as the record's filter leaves them, and before that.
        circumstances : Circumstances

        Returns
        -------
        list of ndarray, shape (n,)
        """
        fine = whole
        if self._fine > 1:
            # of a sensor that was faster, a law bends what is between the samples, too
            fine = refined(whole, self._fine)
            circumstances = type(circumstances)(*(
                None if each is None else np.repeat(each, self._fine) for each in circumstances))
        change = effect.live(self._fine * self._rate).simulate(fine, circumstances) - fine
        return [values + self.added(change, self._fine, len(whole)), whole + change[::self._fine]]

    def filtered(self, values, steps=1, late=0.0):
        """What of values, shape (steps n,), with as many in each interval, the record's filter
        leaves at its instants, shape (n,), or `late`, by a part of such a value."""
        return inner_filter(steps * self._rate, self._band_hz, len(values), steps)(values, late)
