"""Smoothing of the recorded reference."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import beyond_band, matching, of_orders

# Nearly a bell curve.
_MOST = 16
# Share of a motion's size below which it is taken as lost: to undo more would raise noise only.
_LOST = 0.1
# Share of a motion's size of which nothing is seen in a reference's noise, lines at least that tell
# this noise, and the part of them that has no more (some may lie beyond the reference's band).
_NOTHING, _TELL, _NO_MORE = 2e-3, 8, 0.5
# Times this noise that the power of some lines may have by chance, and more the more it would be
# raised; and so many times more from which on it is surely the motion's.
_BY_CHANCE, _RAISED, _RAMP = 1.6, 0.01, 0.4
# Share of a length by which the first starts are apart, and finer ones on either side.
_APART, _FINE = 0.08, 32


@dataclasses.dataclass(frozen=True)
class ReferenceSmoothing(Effect):
    r"""The reference is so many moving averages of one length, each centred on its stamp.

    :math:`\mathrm{sinc}(L f)^n` of the motion is recorded, without a delay: how late a reference
    is besides, `reference_delay` tells. The record is divided by that; a motion of which nothing
    stands out of the reference's noise stays lost, and where nothing tells that noise, one of which
    less than a tenth was left.
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
        # a node that corrects needs none of these
        from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
        level, scale = values.mean(), float(np.std(values))
        if not scale > 0:
            return values
        room = int(np.ceil(self.order * self.length_s * sampling_rate_hz))
        length = next_fast_len(len(values) + 3 * room, real=True)
        kept = self._kept(rfftfreq(length, 1 / sampling_rate_hz))
        if np.sum(np.abs(kept) < _NOTHING) >= _TELL:
            return level + scale * self._best_guess((values - level) / scale, sampling_rate_hz)
        padded = np.pad(values - level, room, mode="edge")
        return level + irfft(_turned_back(kept) * rfft(padded, length),
                             length)[room:room + len(values)]

    def _best_guess(self, values, sampling_rate_hz):
        """The motion by Wiener's filter: the lines of which nothing was left tell the noise."""
        from scipy.fft import rfftfreq

        from ...signals.stationary import mean_of_lines, stationary
        record = stationary(values)
        kept = self._kept(rfftfreq(record.length, 1 / sampling_rate_hz))
        noise = np.quantile(record.power[np.abs(kept) < _NOTHING], _NO_MORE)
        # of the motion, by all lines around
        chance = _BY_CHANCE + _RAISED / np.maximum(np.abs(kept), _NOTHING**2)
        surely = np.clip((record.power / noise - chance) / _RAMP, 0.0, 1.0)
        power = surely * (record.power - noise) / np.maximum(mean_of_lines(kept**2), _NOTHING**4)
        return record.filtered(kept * power / (kept**2 * power + noise), _turned_back(kept))

    def shows(self, frequency_hz):
        return np.abs(self._kept(frequency_hz))

    def transfer_function(self, s):
        # of the frequency axis, as `change_base` does it: it has no phase that damping could bend
        return _turned_back(self._kept(np.imag(s) / (2 * np.pi))).astype(complex)

    def _kept(self, frequency_hz):
        return np.sinc(self.length_s * frequency_hz)**self.order

    def alternatives(self):
        return of_orders(self, (self.order - 1, self.order + 1, 2 * self.order), _MOST)

    @classmethod
    def starts(cls, view):
        coarse = [cls(float(length), order) for length in np.geomspace(0.3, 100, 80) / view.rate
                  for order in (1, 2, 4, 16)]
        # a core that was identified may have its resonance where the motion is lost
        far = beyond_band(view)
        cores = [None] if far is None else [None, far]
        near = [matching(view, coarse, core=core, lost=True, response=_of_motion)
                for core in cores]
        # a notch in the wrong place turns the sign of what is beside it: no fit comes from afar
        return [start for core, found in zip(cores, near) for start in matching(view, [
            dataclasses.replace(other.effect, length_s=other.effect.length_s * (1 + apart))
            for other in found for apart in np.linspace(-_APART, _APART, 2 * _FINE + 1)],
            core=core, lost=True, response=_of_motion)]


def _of_motion(effect, s):
    """What of the motion such a reference holds."""
    return effect._kept(s.imag / (2 * np.pi)).astype(complex)


def _turned_back(kept):
    return kept / np.maximum(kept**2, _LOST**2)
