"""Which of two topics is the reference and which the sensor."""

import dataclasses

import numpy as np

from ...errors import IdentificationError
from ...signals.averaged_spectra import coherence_of, power_of, segment_spectra
from ..fit.output_error import Fit, fit_output_error
from ..fit.structures import OscillatorStructure
from ..fit.uncertainty import SIGNIFICANT
from ..response.excitation import strongest_stretch

# The strongest stretch of a long record [samples] tells the direction.
_LENGTH = 16384
# RMS of the residual over its white part from which on the model lacks something.
_LACKING = 2.0
# Residual of the exchanged pair, of that of the pair, from which on its shape alone is decisive;
# the same where the delays are on its side too; and its residual, of its output, that a sensor
# may have there.
_SHAPE = 0.25
_SHAPE_AND_DELAY = 0.4
_SENSOR = 0.15
# Largest damping ratio of a resonance that shows as a peak, with a margin: the inverse of a
# well damped sensor may also be a link with a lead.
_PEAK = 0.6
# Samples by which a delay must be negative beyond its uncertainty, and by which it is worth
# telling; relative standard uncertainty of what is known.
_SAMPLES = 0.1
_NOTED = 0.5
_KNOWN = 0.2
# Segments of a stretch by which coherence is judged.
_SEGMENTS = 16


@dataclasses.dataclass(frozen=True)
class _Way:
    """A classical sensor fitted in one direction.

    What it leaves of the output (RMS) is `unexplained`; `unrelated`, what no linear sensor takes.
    """

    fit: Fit
    unexplained: float
    unrelated: float
    sample_s: float

    @classmethod
    def of(cls, reference, sensor, pair, lag_s):
        """None where no sensor answers like this."""
        part = strongest_stretch(reference, _LENGTH, pair.valid)
        valid = pair.valid[part]
        try:
            fit = fit_output_error(OscillatorStructure(), reference[part], sensor[part],
                                   pair.sampling_rate_hz, valid, lag_s)
        except IdentificationError:
            return None
        return cls(fit, fit.rmse / float(np.std(sensor[part][valid])),
                   _unrelated(reference[part], sensor[part]), 1 / pair.sampling_rate_hz)

    @property
    def lacking(self):
        """What another linear sensor might take of what this one leaves (RMS, of the output)."""
        return np.sqrt(max(self.unexplained**2 - self.unrelated**2, 0.0))

    @property
    def lead_s(self):
        """Time by which slow motion shows in the sensor before the reference."""
        _, frequency, ratio, delay, _ = self.fit.values
        return -(delay + ratio / (np.pi * frequency))

    @property
    def early(self):
        """Whether it does."""
        _, frequency, ratio, _, _ = self.fit.values
        slopes = np.r_[0, -ratio / (np.pi * frequency**2), 1 / (np.pi * frequency), 1, 0]
        # rounding may leave a variance below 0 where the data tell nothing
        variance = slopes @ self.fit.covariance @ slopes
        return variance > 0 and \
            self.lead_s > SIGNIFICANT * np.sqrt(variance) + _SAMPLES * self.sample_s

    @property
    def causal(self):
        """Whether the sensor needs no negative delay."""
        std = self.fit.std[self.fit.names.index("delay_s")]
        return self.fit["delay_s"] > -SIGNIFICANT * std - _SAMPLES * self.sample_s

    @property
    def is_sensor(self):
        """Whether it is a seismic sensor with a resonance, and little else."""
        return self.determined and self.unexplained < _SENSOR \
            and self.fit["damping_ratio"] < _PEAK

    @property
    def determined(self):
        """Whether the parameters are those of a sensor, not of anything with a slope."""
        return np.all(self.fit.std[:3] < _KNOWN * np.abs(self.fit.values[:3]))


def _unrelated(reference, sensor):
    """Share of the sensor's signal (RMS) that is not coherent with the reference."""
    own, answer = (segment_spectra(values, "hann", max(len(values) // (_SEGMENTS // 2), 1))
                   for values in (reference, sensor))
    power = power_of(answer)
    alone = np.sum((1 - coherence_of(own, answer)) * power)
    return float(np.sqrt(alone / max(power.sum(), 1e-300)))


def exchanged_instead(reference, sensor, pair):
    """Error of two topics that are exchanged, or None.

    Classical sensors are fitted in both directions. A sensor answers later than the reference, and
    has a resonance; the other way round it would answer before it and have an antiresonance, which
    no delay and no damping makes up for. Below the resonance both directions look alike.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    pair : Record

    Returns
    -------
    IdentificationError or None
    """
    return _exchanged(_Way.of(reference, sensor, pair, pair.lag_s), reference, sensor, pair)


def judge_direction(fit, reference, sensor, pair):
    """Refuse exchanged topics (`exchanged_instead`); where that is open, there is a note at most.

    Parameters
    ----------
    fit : Fit
        Of any structure; only if it lacks something or answers too early are the directions
        compared.
    reference, sensor : ndarray, shape (n,)
    pair : Record

    Returns
    -------
    list of str
        Notes.

    Raises
    ------
    IdentificationError
        If they are exchanged.
    """
    std = fit.std[fit.names.index("delay_s")]
    early = fit["delay_s"] < -SIGNIFICANT * std - _SAMPLES / pair.sampling_rate_hz
    if not early and fit.rmse < _LACKING * fit.noise_std:
        return []
    forward = _Way.of(reference, sensor, pair, pair.lag_s)
    error = _exchanged(forward, reference, sensor, pair)
    if error is not None:
        raise error
    if forward is not None and forward.early and forward.lead_s > _NOTED * forward.sample_s:
        return [f"the sensor answers {forward.lead_s:.3g} s before the reference moves: its stamps "
                "are early by that much, it is AC-coupled, or reference and sensor are exchanged"]
    return []


def _exchanged(forward, reference, sensor, pair):
    if forward is not None and forward.fit.rmse < _LACKING * forward.fit.noise_std:
        return None
    backward = _Way.of(sensor, reference, pair, -pair.lag_s)
    if backward is None or not backward.determined:
        return None
    if forward is None:
        return _error("no sensor answers like this", backward) if backward.is_sensor else None
    # a filter would take noise and tones from the sensor, were that the reference
    ratio = backward.unexplained / max(forward.lacking, 1e-300)
    decisive = ratio < _SHAPE or (ratio < _SHAPE_AND_DELAY and forward.early and backward.causal)
    if not backward.is_sensor or not decisive:
        return None
    return _error(f"the best sensor leaves {forward.unexplained:.2%} of the output unexplained",
                  backward)


def _error(words, backward):
    return IdentificationError(
        f"reference and sensor are exchanged: {words}, while taken for the sensor the reference is "
        f"one with a resonance at {backward.fit['natural_frequency_hz']:.4g} Hz and "
        f"{backward.unexplained:.2%} unexplained; exchange the topics of --reference and --sensor, "
        "or see whether the reference itself resonates on its mount")
