"""Judgement of a fitted model on stepped sines that it has not seen."""

import dataclasses

import numpy as np
from scipy.stats import chi2

from ...errors import IdentificationError
from ...identification import response_points
from ...identification.response.points import ResponsePoints
from ...simulation import simulate

# The paper's frequencies.
PAPER_BAND_HZ = (100.0, 500.0)
# Frequencies that are fitted to a record come close to those, not to the digit.
_NEAR_HZ = 1.0
_BLOCKS, _DRAWS = 40, 1000
# A reference this small counts as its zero crossing: it has no relative error.
_ZERO = 1e-9


@dataclasses.dataclass(frozen=True)
class Sines:
    """A stepped-sine record, prepared for judging.

    Attributes
    ----------
    rate_hz : float
    reference, sensor : ndarray, shape (n,)
    points : ResponsePoints
        Response measured at each sine.
    parts : tuple of slice
        Where each sine is steady.
    """

    rate_hz: float
    reference: np.ndarray
    sensor: np.ndarray
    points: ResponsePoints
    parts: tuple

    @classmethod
    def of(cls, pair):
        """Sines of the x axis of a measured pair.

        Raises
        ------
        IdentificationError
            If it holds anything else.
        """
        points = response_points(pair)
        if points.excitation.kind != "stepped_sine":
            raise IdentificationError("the record to judge on holds "
                                      f"{points.excitation.words}, expected a stepped sine")
        rate = pair.sampling_rate_hz
        parts = tuple(slice(round(segment["start_s"] * rate), round(segment["stop_s"] * rate))
                      for segment in points.segments)
        return cls(rate, pair.reference[:, 0], pair.sensor[:, 0], points, parts)

    @property
    def inside(self):
        """Which of the sines lie in the paper's band, shape (m,)."""
        return in_paper_band(self.points.frequency_hz)


@dataclasses.dataclass(frozen=True)
class Judged:
    """A fitted model on the sines.

    Attributes
    ----------
    error : ndarray of complex, shape (m,)
        Relative error: the model's response over the measured one, less one. Its real part is
        the amplitude's, its imaginary part the phase's [rad].
    std : ndarray, shape (m,)
        Combined standard uncertainty of each part: noise of the sines, and uncertainty of the
        model's parameters.
    rms, beyond : float
        RMS of abs(error) within the paper's band, and above it.
    rms_interval : tuple of float
        95 % interval of `rms`, by the combined uncertainty.
    floor : float
        What `rms` would be by the combined uncertainty alone: the noise floor.
    p_value : float
        Of chi-squared of the errors in the paper's band with their full covariance: the
        probability that uncertainty alone gives as much.
    noise_ratio : float
        RMS of measured less simulated samples, over that of what sines at the same frequencies
        leave of the measured ones; in the paper's band. One for a model that lacks nothing.
    noise_ratio_interval : tuple of float
        95 % interval, by a bootstrap over blocks.
    measure_percent : float
        The paper's measure, against the sensor: median of abs(simulated - measured) over
        abs(measured).
    measure_against_reference_percent : float
        As the paper has it, against the reference.
    """

    error: np.ndarray
    std: np.ndarray
    rms: float
    rms_interval: tuple
    beyond: float
    floor: float
    p_value: float
    noise_ratio: float
    noise_ratio_interval: tuple
    measure_percent: float
    measure_against_reference_percent: float

    def as_dict(self):
        """Plain numbers and lists."""
        result = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)
                  if field.name not in ("error", "std")}
        return {"amplitude_error_percent": (100 * self.error.real).tolist(),
                "phase_error_deg": np.degrees(self.error.imag).tolist(),
                "std_percent": (100 * self.std).tolist(), **result}


def in_paper_band(frequency_hz):
    """Which frequencies lie in the paper's band."""
    low, high = PAPER_BAND_HZ
    return (frequency_hz >= low - _NEAR_HZ) & (frequency_hz <= high + _NEAR_HZ)


def judge(fitted, sines):
    """Judge a `Fitted` on `Sines`.

    Returns
    -------
    Judged
    """
    points, inside = sines.points, sines.inside
    error = fitted.response(points.frequency_hz) / points.response - 1
    own = np.diag(np.r_[points.std_amplitude, points.std_phase_rad]**2)
    covariance = fitted.relative_covariance(points.frequency_hz) + own
    both = np.tile(inside, 2)
    parts, used = np.r_[error.real, error.imag][both], covariance[np.ix_(both, both)]
    p_value = float(chi2.sf(parts @ np.linalg.solve(used, parts), len(parts)))
    std = np.sqrt(np.diag(covariance).reshape(2, -1).mean(axis=0))
    simulated = simulate(fitted.sensor_model(), sines.reference, sines.rate_hz, axis="x")
    kept = [part for part, one in zip(sines.parts, inside) if one]
    left = np.concatenate([_centred(sines.sensor[part] - simulated[part]) for part in kept])
    ratio, interval = _over_noise(left, np.concatenate([
        _without_sine(sines.sensor[part], frequency / sines.rate_hz)
        for part, frequency in zip(kept, points.frequency_hz[inside])]))
    measured, output, reference = (np.concatenate([_centred(values[part]) for part in kept])
                                   for values in (sines.sensor, simulated, sines.reference))
    return Judged(error, std, rms(error[inside]), _rms_interval(parts, used), rms(error[~inside]),
                  float(np.sqrt(np.trace(used) / inside.sum())), p_value, ratio, interval,
                  _median_percent(output - measured, measured),
                  _median_percent(output - reference, reference))


def rms(values):
    """Root of the mean square of absolute values."""
    return float(np.sqrt(np.mean(np.abs(values)**2)))


def _rms_interval(parts, covariance):
    """95 % interval of the RMS error, by draws of the errors about those that were measured.

    The draws carry the uncertainty a second time, which is taken off in the mean square.
    """
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(parts, covariance, _DRAWS)
    count = len(parts) / 2
    square = np.sum(drawn**2, axis=1) / count - np.trace(covariance) / count
    low, high = np.sqrt(np.maximum(np.quantile(square, [0.025, 0.975]), 0))
    return float(low), float(high)


def _without_sine(values, cycles_per_sample):
    """What a sine of that frequency leaves of a stretch; its three parameters are accounted for."""
    angle = 2 * np.pi * cycles_per_sample * np.arange(len(values))
    columns = np.stack([np.cos(angle), np.sin(angle), np.ones(len(values))], axis=1)
    left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return left * np.sqrt(len(values) / (len(values) - 3))


def _over_noise(left, noise):
    """Ratio of two RMS values, and its interval."""
    blocks = np.array([[np.mean(part**2) for part in np.array_split(values, _BLOCKS)]
                       for values in (left, noise)])
    rng = np.random.default_rng(0)
    drawn = blocks[:, rng.integers(_BLOCKS, size=(_DRAWS, _BLOCKS))].mean(axis=2)
    low, high = np.quantile(np.sqrt(drawn[0] / drawn[1]), [0.025, 0.975])
    mean = blocks.mean(axis=1)
    return float(np.sqrt(mean[0] / mean[1])), (float(low), float(high))


def _median_percent(error, over):
    usable = np.abs(over) > _ZERO
    return float(100 * np.median(np.abs(error[usable] / over[usable])))


def _centred(values):
    return values - values.mean()
