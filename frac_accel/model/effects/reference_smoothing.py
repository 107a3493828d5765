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


@dataclasses.dataclass(frozen=True)
class ReferenceSmoothing(Effect):
    r"""The reference is so many moving averages of one length, each centred on its stamp.

    :math:`\mathrm{sinc}(L f)^n` of the motion is recorded, without a delay: how late a reference
    is besides, `reference_delay` tells. The record is divided by that; where less than a tenth was
    left of a motion, it stays lost.
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
        turned_back = self._turned_back(rfftfreq(length, 1 / sampling_rate_hz))
        level = values.mean()
        return level + irfft(turned_back * rfft(padded - level, length), length)[
            room:room + len(values)]

    def transfer_function(self, s):
        # of the frequency axis, as `change_base` does it: it has no phase that damping could bend
        return self._turned_back(np.imag(s) / (2 * np.pi)).astype(complex)

    def _turned_back(self, frequency_hz):
        kept = np.sinc(self.length_s * frequency_hz)**self.order
        return kept / np.maximum(kept**2, _LOST**2)

    def alternatives(self):
        return of_orders(self, (self.order - 1, self.order + 1, 2 * self.order), _MOST)

    @classmethod
    def starts(cls, view):
        return matching(view, [
            cls(float(length), order) for length in np.geomspace(0.3, 100, 80) / view.rate
            for order in (1, 2, 4, 16)])
