"""Smoothing of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import matching, of_orders

# Nearly a bell curve.
_MOST = 16
# Share of a motion's size below which it is taken as lost: to undo more would raise noise only.
_LOST = 0.1
# Share of a motion's size of which nothing is seen in a reference's noise, lines at least that tell
# this noise; and what is still turned back of a motion whose power, over some lines, is so many
# times that of the noise.
_NOTHING, _TELL = 2e-3, 32
_LEAST, _LINES, _STANDS_OUT = 0.01, 9, 10.0


@dataclasses.dataclass(frozen=True)
class ReferenceSmoothing(Effect):
    r"""The reference is so many moving averages of one length, each centred on its stamp.

    :math:`\mathrm{sinc}(L f)^n` of the motion is recorded, without a delay: how late a reference
    is besides, `reference_delay` tells. The record is divided by that; where less than a tenth was
    left of a motion, it stays lost, but for what stands far out of the reference's noise there,
    such as an engine's tone.
    """

    cause = "reference_smoothing"
    stage = REFERENCE
    of_reference = True
    explanation = ("The reference was averaged over a stretch of time, so the sensor seems to "
                   "answer fast motion too strongly, but not too early.")
    experiment = ("Compare both with a third accelerometer that nothing smooths: the one that has "
                  "less of the fast motion than the other two was averaged.")

    length_s: float = parameter("s", above=0, scale="interval", reach=(1e-3, 1e4), null=0.0)
    order: int = parameter("1", minimum=1, maximum=_MOST, whole=True)

    def change_base(self, values, sampling_rate_hz):
        from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
        room = int(np.ceil(self.order * self.length_s * sampling_rate_hz))
        padded = np.pad(values, room, mode="edge")
        length = next_fast_len(len(padded) + room, real=True)
        frequency_hz = rfftfreq(length, 1 / sampling_rate_hz)
        level = values.mean()
        lines = rfft(padded - level, length)
        kept = self._kept(frequency_hz)
        turned_back = _turned_back(kept)
        if np.sum(np.abs(kept) < _NOTHING) >= _TELL:
            # without what the ends leave everywhere
            power = np.abs(rfft((padded - level) * np.hanning(len(padded)), length))**2
            there = _stands_out(power, kept)
            turned_back[there] = 1 / kept[there]
        return level + irfft(turned_back * lines, length)[room:room + len(values)]

    def transfer_function(self, s):
        # of the frequency axis, as `change_base` does it: it has no phase that damping could bend
        return _turned_back(self._kept(np.imag(s) / (2 * np.pi))).astype(complex)

    def _kept(self, frequency_hz):
        return np.sinc(self.length_s * frequency_hz)**self.order

    def alternatives(self):
        return of_orders(self, (self.order - 1, self.order + 1, 2 * self.order), _MOST)

    @classmethod
    def starts(cls, view):
        return matching(view, [
            cls(float(length), order) for length in np.geomspace(0.3, 100, 80) / view.rate
            for order in (1, 2, 4, 16)])


def _turned_back(kept):
    return kept / np.maximum(kept**2, _LOST**2)


def _stands_out(power, kept):
    """Which lines of a power spectrum show motion although little of it was left: they stand far
    out of those where nothing was left."""
    from scipy.ndimage import uniform_filter1d
    noise = power[np.abs(kept) < _NOTHING].mean()
    return (np.abs(kept) < _LOST) & (np.abs(kept) > _LEAST) \
        & (uniform_filter1d(power, _LINES) > _STANDS_OUT * noise)
