"""What the data say against a fitted model: residual, held-out data by octaves, in words."""

import dataclasses

import numpy as np

from ...errors import FracAccelError
from ...model import AxisModel
from ...model.effects import identified_effect
from ...model.parameters import rebuilt
from ...signals.averaged_spectra import coherence_of, power_of, segment_spectra
from ...signals.convolution import Convolution
from ...uncertainty import UncertainAxis
from .records import RecordAgreement
from .residual_tests import ResidualTests, p_words, residual_tests

# Held-out residual over the noise floor, and over the output, above which an octave lacks more.
_ABOVE_FLOOR = 2.0
_WORTH_SAYING = 1e-3
# Least share of the output that the sentences show.
_SHOWN = 1e-4
# Segments of the coherence, and the share of them that Hann windows overlapping by half leave
# independent (P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70-73).
_SEGMENTS = 16
_INDEPENDENT = 0.95


@dataclasses.dataclass(frozen=True)
class BandFit:
    """Held-out residual within one band.

    Attributes
    ----------
    band_hz : tuple of float
    nrmse : float
        RMS of the held-out residual over that of the measured output, both within the band.
    floor : float
        The same of the part of the output that is not coherent with its prediction, which no linear
        model explains; NaN where the data are too short to tell.
    """

    band_hz: tuple
    nrmse: float
    floor: float


@dataclasses.dataclass(frozen=True, eq=False)
class FitValidation:
    """What the data say against a fitted model.

    Attributes
    ----------
    residual : ResidualTests or None
        Of the fitted data, of several records the first; None where they are too few, or fitted
        without any residual.
    held_out_bands : tuple of BandFit
        By octaves; none where nothing could be held out. Of several records, those of the worst
        prediction of one by another's model.
    records : RecordAgreement or None
        Where the model comes from several records.
    verdict : list of str
        All this in sentences.
    """

    residual: ResidualTests | None
    held_out_bands: tuple
    records: RecordAgreement | None
    verdict: list

    def as_dict(self):
        """Plain numbers and lists."""
        return {"residual": self.residual and self.residual.as_dict(),
                "held_out_bands": [dataclasses.asdict(band) for band in self.held_out_bands],
                "records": self.records and self.records.as_dict(), "verdict": self.verdict}

    @classmethod
    def from_dict(cls, data):
        """The same from the plain lists of a result file."""
        return cls(data["residual"] and rebuilt(ResidualTests, data["residual"]),
                   tuple(rebuilt(BandFit, band) for band in data["held_out_bands"]),
                   data["records"] and rebuilt(RecordAgreement, data["records"]), data["verdict"])

    def essentials(self):
        """What a model file keeps of it."""
        kept = {"verdict": self.verdict,
                "held_out_bands": [dataclasses.asdict(band) for band in self.held_out_bands]}
        if self.residual:
            kept.update(independence_p_value=self.residual.independence_p_value,
                        whiteness_p_value=self.residual.whiteness_p_value)
        if self.records:
            kept["records"] = self.records.as_dict()
        return kept


def fit_validation(tests, nrmse, bands, records=None):
    """FitValidation from its parts, with the verdict.

    Parameters
    ----------
    tests : ResidualTests or None
    nrmse : float
        RMS of the tested residual over the output's standard deviation.
    bands : tuple of BandFit
    records : RecordAgreement, optional
    """
    verdict = [*([] if tests is None else _residual_words(tests, nrmse)), *_band_words(bands),
               *([records.words()] if records else [])]
    return FitValidation(tests, tuple(bands), records, verdict)


def judge_residual(core, fit, reference, pair):
    """ResidualTests of a fit to a pair, or None where there is too little to test.

    Parameters
    ----------
    core : Oscillator, Arx or FractionalTransferFunction
        That of the fit.
    fit : Fit
    reference : ndarray, shape (n,)
    pair : Record
    """
    gradient = fit.gradient
    if gradient is None:
        gradient = _gradient(core, fit, reference, pair)
    try:
        return residual_tests(fit.residual, reference, pair.valid, gradient)
    except FracAccelError:
        return None


def _gradient(core, fit, reference, pair):
    """Derivatives of the model's output by its parameters, shape (p, n)."""
    # the pair's lag belongs to the stamps, not to the sensor
    delay = fit["delay_s"] - pair.lag_s
    uncertain = UncertainAxis.given(AxisModel(core, (identified_effect("delay_s", delay),)),
                                    fit.names, fit.covariance)
    convolution = Convolution(reference - reference[0], pair.sampling_rate_hz, abs(delay))
    s = convolution.s
    response = core.transfer_function(s) * np.exp(-s * delay)
    return np.stack([convolution.response(response * slope)
                     for slope in uncertain.slopes(s) if slope.any()])


def band_fits(measured, simulated, sampling_rate_hz, bands):
    """Held-out residual by bands.

    Parameters
    ----------
    measured, simulated : ndarray, shape (n,)
        Held-out output and its prediction; equal where they do not count.
    sampling_rate_hz : float
    bands : sequence of (float, float)
        Adjoining bands [Hz].

    Returns
    -------
    list of BandFit
    """
    # a tenth at either end, where leakage would count
    taper = _tapered(len(measured))
    error, moving = measured - simulated, measured - measured.mean()
    # a mean error belongs to the band that begins at zero
    error = error - (bands[0][0] > 0) * error.mean()
    left, answer = (np.abs(np.fft.rfft(taper * values))**2 for values in (error, moving))
    line = np.fft.rfftfreq(len(measured), 1 / sampling_rate_hz)
    nrmse = [np.sqrt(left[inside].sum() / answer[inside].sum()) if answer[inside].any() else np.nan
             for low, high in bands for inside in [(line >= low) & (line <= high)]]
    length = max(64, len(measured) // _SEGMENTS)
    floors = [np.nan] * len(bands)
    if len(measured) >= 4 * length:
        predicted, output = (segment_spectra(values, "hann", length)
                             for values in (simulated, measured))
        # with the prediction, not the reference: what the sensor rings on beyond a segment's end
        # would count as incoherent, and both have it
        frequency = np.fft.rfftfreq(length, 1 / sampling_rate_hz)
        shared, power = coherence_of(predicted, output), power_of(output)
        count = _INDEPENDENT * (2 * len(measured) / length - 1)
        # the coherence of unrelated signals is one over the number of segments
        alone = np.minimum((1 - shared) * count / (count - 1), 1)
        for i, (low, high) in enumerate(bands):
            inside = (frequency >= max(low, frequency[1])) & (frequency <= high)
            if inside.any() and power[inside].any():
                floors[i] = float(np.sqrt(np.sum((alone * power)[inside])
                                          / np.sum(power[inside])))
    return [BandFit(tuple(map(float, band)), float(ratio), floor)
            for band, ratio, floor in zip(bands, nrmse, floors)]


def _tapered(count):
    """Taper that rises and falls as half a cosine over a tenth at either end, shape (count,)."""
    place = np.arange(count) / (0.1 * (count - 1))
    return 0.5 - 0.5 * np.cos(np.pi * np.minimum(np.minimum(place, place[::-1]), 1))


def _residual_words(tests, nrmse):
    if not tests.independent:
        further = tests.dependent_share * nrmse
        share = f"{further:.2%}" if further >= _SHOWN else f"less than {_SHOWN:.2%}"
        return ["the residual depends on the reference "
                f"({p_words(tests.independence_p_value)}): a better model could explain a further "
                f"{share} of the output"]
    words = ["the residual does not depend linearly on the reference "
             f"({p_words(tests.independence_p_value)})"]
    if tests.white:
        return [f"{words[0]} and is white ({p_words(tests.whiteness_p_value)})"]
    return [f"{words[0]}; its spectrum is not white ({p_words(tests.whiteness_p_value)}), which "
            "the uncertainties allow for"]


def _band_words(bands):
    judged = [band for band in bands if np.isfinite(band.nrmse)]
    if not judged:
        return []
    lacking = [band for band in judged
               if band.nrmse > max(_ABOVE_FLOOR * band.floor, _WORTH_SAYING)]
    worst = max(lacking or judged, key=lambda band: band.nrmse)
    low, high = worst.band_hz
    words = (f"held-out data are predicted worst from {low:.4g} to {high:.4g} Hz: "
             f"{worst.nrmse:.2%} of the output there")
    if worst.floor >= worst.nrmse:
        # estimated apart, by coherence: it may come out larger than the whole
        words += ", all of which no linear model explains"
    elif np.isfinite(worst.floor):
        words += f", of which {worst.floor:.2%} no linear model explains"
    return [words]
