"""What a sensor shows beyond the frequencies up to which it can be compared."""

from typing import NamedTuple

import numpy as np
from scipy.fft import rfft

from .resampling import inner_edge, taken_away

# Lines to both sides over which the window spreads a tone, and the share of the power beyond that
# one must have to be told.
_SPREAD, _MOST = 2, 0.5


class Beyond(NamedTuple):
    """A sensor's signal above a frequency.

    Attributes
    ----------
    band_hz : float
        That frequency, up to which half of the amplitude or more is compared.
    share : float
        RMS there over that of the whole, its mean taken off.
    tone_hz, tone_share : float or None
        Frequency of the tone that has most of the power there, and its share of that power.
    """

    band_hz: float
    share: float
    tone_hz: float | None = None
    tone_share: float | None = None

    @property
    def words(self):
        """In a few words, after what was found below."""
        tone = "" if self.tone_hz is None else \
            f", {self.tone_share:.0%} of it (power) a tone at {self.tone_hz:.5g} Hz"
        return (f"compared up to {self.band_hz:.4g} Hz only: {self.share:.1%} of the sensor's "
                f"output (RMS) lies beyond{tone}")


def beyond(values, rate_hz, band_hz, compared_hz):
    """`Beyond` of a signal on uniform instants.

    Parameters
    ----------
    values : ndarray, shape (n,)
    rate_hz, band_hz, compared_hz : float
        Its rate, the band that is compared, and the rate at which it is.
    """
    power = np.abs(rfft((values - values.mean()) * np.hanning(len(values))))**2
    line_hz, edge_hz = rate_hz / len(values), inner_edge(band_hz)
    total = power[_SPREAD:].sum()
    # what the filter at the band's edge takes away
    above = power * taken_away(compared_hz, band_hz, len(values), line_hz * np.arange(len(power)))
    above[:_SPREAD] = 0.0
    if not total > 0:
        return Beyond(edge_hz, 0.0)
    share = float(np.sqrt(above.sum() / total))
    peak = int(np.argmax(above))
    near = slice(max(peak - _SPREAD, 0), peak + _SPREAD + 1)
    tone = float(above[near].sum() / max(above.sum(), 1e-300))
    if tone < _MOST:
        return Beyond(edge_hz, share)
    centre = float(above[near] @ np.arange(len(above))[near] / above[near].sum())
    return Beyond(edge_hz, share, centre * line_hz, tone)
