"""Frequency response and nonlinear distortion from a periodic excitation, averaged over periods."""

import dataclasses

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d

from ...errors import IdentificationError

METHOD = "average over periods"
# Power of a line, of the strongest one's, from which it is excited, and up to which it is not.
_EXCITED = 1e-5
_SILENT = 1e-8
# Noise power of the averaged line by which an excited one must rise above it.
_ABOVE_NOISE = 20.0
# Difference from the mean period, of its power, that is nothing (1e-4 of the amplitude).
_NOTHING = 1e-8
# Degrees of freedom that the variance of a line gets, with its neighbours' where periods are few.
_FREEDOM = 20
# Standard deviations by which silent lines must rise above the noise to be called distorted.
_DISTORTED = 5.0
_FEWEST_LINES = 4
# Harmonics of the highest excited line up to which distortion is looked for.
_REACH = 3


@dataclasses.dataclass(frozen=True)
class PeriodicResponse:
    """Result of `periodic_response`.

    Attributes
    ----------
    frequency_hz : ndarray, shape (m,)
        Excited lines.
    response : ndarray of complex, shape (m,)
    std : ndarray, shape (m,)
        Relative standard uncertainty of the amplitude, and that of the phase [rad].
    distortion : dict or None
        See `distortion_level`.
    start, stop : int
        Samples between which the periods lie.
    periods, transient, holed : int
        Periods averaged, and those left out in the transient and for missing samples.
    """

    frequency_hz: np.ndarray
    response: np.ndarray
    std: np.ndarray
    distortion: dict | None
    start: int
    stop: int
    periods: int
    transient: int
    holed: int


def periodic_response(reference, sensor, valid, sampling_rate_hz, period):
    r"""Response at the excited lines, with the variance over the periods.

    With the spectra :math:`X_p, Y_p` of P periods, :math:`G = \bar Y / \bar X`, and the sample
    variance of :math:`Y_p - G X_p` over the periods gives the variance of G, noise of the
    reference and its correlation with that of the sensor included (R. Pintelon, J. Schoukens,
    *System Identification*, 2nd ed., 2012, section 2.5 and equation (2-32)). Where periods are few
    the variance is averaged over neighbouring lines. Nonlinear distortion repeats with the period
    and is not in it.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    sampling_rate_hz : float
    period : int
        Samples.

    Returns
    -------
    PeriodicResponse

    Raises
    ------
    IdentificationError
        If fewer than two periods are left.
    """
    count = len(reference) // period
    start = len(reference) - count * period
    shape = (count, period)
    x, y = (v[start:].reshape(shape) for v in (reference, sensor))
    whole = valid[start:].reshape(shape).all(axis=1)
    first = max(_transient(x, whole), _transient(y, whole))
    kept = whole & (np.arange(count) >= first)
    periods = int(kept.sum())
    if periods < 2:
        raise IdentificationError(f"{periods} of {count} periods of the multisine is free of the "
                                  "transient and of missing samples, expected at least 2")
    below, above = rfft(x[kept], axis=1), rfft(y[kept], axis=1)
    mean_below, mean_above = below.mean(axis=0), above.mean(axis=0)
    power = np.abs(mean_below)**2
    power[0] = 0.0
    noise = np.var(below, axis=0, ddof=1) / periods
    lines = np.flatnonzero((power > _EXCITED * power.max()) & (power > _ABOVE_NOISE * noise))
    response = mean_above[lines] / mean_below[lines]
    error = above[:, lines] - response * below[:, lines]
    variance, freedom = _pooled(np.sum(np.abs(error)**2, axis=0) / (periods - 1), periods)
    # the spread of a Student distribution (JCGM 101:2008, 6.4.9)
    variance *= freedom / max(freedom - 1, 1)
    # a circular complex variance has half of it on the amplitude and half on the phase
    std = np.sqrt(variance / (2 * periods)) / np.abs(mean_above[lines])
    silent = np.flatnonzero(power <= np.maximum(_SILENT * power.max(), 4 * noise))
    silent = silent[(silent > 0) & (silent < min(_REACH * lines[-1], 0.95 * period / 2))]
    return PeriodicResponse(
        lines * sampling_rate_hz / period, response, std,
        distortion_level(above, lines, silent), start + first * period, len(reference), periods,
        first, int(np.sum(~whole[first:])))


def _transient(values, whole):
    """Number of leading periods that differ from those of the record's second half."""
    count = len(values)
    settled = whole & (np.arange(count) >= count // 2)
    if settled.sum() < 2:
        return 0
    centred = values - values.mean(axis=1, keepdims=True)
    mean = centred[settled].mean(axis=0)
    away = np.mean((centred - mean)**2, axis=1)
    # the mean follows those that it is made of
    usual = np.mean(away[settled]) * settled.sum() / (settled.sum() - 1)
    most = usual * (1.3 + 8 / np.sqrt(values.shape[1])) + _NOTHING * np.mean(mean**2)
    late = np.flatnonzero(whole[:count // 2] & (away[:count // 2] > most))
    return int(late[-1]) + 1 if len(late) else 0


def _pooled(variance, periods):
    """Variance averaged over as many neighbours as it needs, and its degrees of freedom."""
    size = min(-(-_FREEDOM // (periods - 1)), len(variance))
    # its running sum rounds to either side of zero
    return np.abs(uniform_filter1d(variance, size, mode="nearest")), size * (periods - 1)


def distortion_level(spectra, excited, silent):
    """Level of the lines that are not excited: nonlinear distortion, if it is above the noise.

    Parameters
    ----------
    spectra : ndarray of complex, shape (P, lines)
        The sensor's, period by period.
    excited, silent : ndarray of int
        Lines.

    Returns
    -------
    dict or None
        ``found``; ``level_db``, mean power of a silent line over that of an excited one, without
        the noise's part (NaN where nothing was found); ``noise_db``, that of the averaged noise;
        ``above_noise_db``; ``odd_db`` and ``even_db``, where all excited lines are odd: then even
        nonlinearities act on the even lines and odd ones on the odd lines (Pintelon and
        Schoukens, section 4.3); ``lines``; ``words``. None with fewer than four silent lines.
    """
    if len(silent) < _FEWEST_LINES:
        return None
    signal = np.mean(np.abs(spectra[:, excited].mean(axis=0))**2)
    found, level, noise, above = _rise(spectra[:, silent], signal)
    result = {"found": found, "level_db": level, "noise_db": noise, "above_noise_db": above,
              "lines": len(silent)}
    parts = []
    if np.all(excited % 2 == 1):
        for name, rest in (("odd", 1), ("even", 0)):
            lines = silent[silent % 2 == rest]
            if len(lines) >= _FEWEST_LINES:
                there, result[f"{name}_db"], floor, _ = _rise(spectra[:, lines], signal)
                parts.append(f"{name} {result[f'{name}_db']:.1f} dB" if there
                             else f"{name} not above {floor:.1f} dB")
    detail = f" ({', '.join(parts)})" if parts else ""
    result["words"] = (
        f"nonlinear distortion of {level:.1f} dB of the excited lines{detail}, {above:.1f} dB "
        "above the noise" if found else
        f"no nonlinear distortion above the noise on the {len(silent)} lines that are not excited, "
        f"where that is at {noise:.1f} dB of the excited lines")
    return result


def _rise(spectra, signal):
    """Whether the mean of these lines is above the noise over periods, and the levels in dB."""
    periods, count = spectra.shape
    mean = np.abs(spectra.mean(axis=0))**2
    noise, freedom = _pooled(np.var(spectra, axis=0, ddof=1) / periods, periods)
    ratio = mean / np.maximum(noise, 1e-300)
    spread = np.sqrt((1 + 1 / freedom) / count)
    excess = np.mean(mean) - np.mean(noise)
    found = bool(np.mean(ratio) > 1 + _DISTORTED * spread and excess > 0)
    return (found, _db(excess / signal) if found else float("nan"), _db(np.mean(noise) / signal),
            _db(np.mean(ratio)))


def _db(ratio):
    return float(10 * np.log10(max(ratio, 1e-30)))
