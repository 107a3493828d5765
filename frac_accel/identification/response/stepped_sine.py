"""Amplitude and phase of a response from the dwells of a stepped sine, by sine fits."""

import dataclasses

import numpy as np
from scipy.ndimage import uniform_filter1d

METHOD = "sine fit in each dwell"
# A dwell is steady where the moving amplitudes stay this near to that of its middle, or within
# this many robust standard deviations where noise moves them more.
_STEADY = 1e-4
_SCATTER = 5.0
_FEWEST_CYCLES = 3.0
_FEWEST_SAMPLES = 32
_HARMONICS = 5
_FREQUENCY_STEPS = 4
_PASSES = 3
# Lines on either side of the fitted one that its noise is taken from.
_LINES = 10


@dataclasses.dataclass(frozen=True)
class Dwell:
    """Sine fits of one dwell.

    Attributes
    ----------
    start, stop : int
        Steady samples of the dwell.
    frequency_hz : float
        Fitted to the reference.
    response : complex
        Ratio of the sensor's to the reference's complex amplitude.
    std : float
        Relative standard uncertainty of its amplitude, and that of its phase [rad].
    amplitude : float
        Peak of the reference [m/s²].
    harmonics, reference_harmonics : float
        RMS sum of the harmonics from the second to the fifth over the fundamental.
    """

    start: int
    stop: int
    frequency_hz: float
    response: complex
    std: float
    amplitude: float
    harmonics: float
    reference_harmonics: float


def fit_dwell(reference, sensor, valid, sampling_rate_hz, tone):
    r"""Response at the frequency of one dwell.

    The frequency is that of a four-parameter sine fit of the reference (IEEE Std 1057-2017,
    clause 5.2 and annex B); at it, reference and sensor get three-parameter fits over the same
    samples, as in ISO 16063-21:2003, B.6. The harmonics are fitted along, so that they are not
    taken for noise. The standard uncertainties come from the spectral density of the residual
    beside the line, which need not be white (the covariance of `uncertainty.sandwich` for a sine,
    whose smoothed spectrum would see the hole that the fit itself leaves); those of reference and
    sensor are added as independent.

    What counts is the steady part of the dwell: around its middle, as long as the moving complex
    amplitudes of reference and sensor stay within 0.01 % of those in the dwell's central half, or
    within five robust standard deviations of them where noise moves them more.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    sampling_rate_hz : float
    tone : Tone

    Returns
    -------
    Dwell or None
        None where the steady part has fewer than three cycles or 32 samples.
    """
    whole = slice(tone.start, tone.stop)
    used = valid[whole]
    time = np.arange(len(used))
    quarter = len(used) // 4
    middle = used & (time >= quarter) & (time < len(used) - quarter)
    if middle.sum() < _FEWEST_SAMPLES:
        return None
    omega = _frequency(reference[whole][middle], time[middle] - time[middle].mean(),
                       2 * np.pi * tone.frequency_hz / sampling_rate_hz)
    steady = np.logical_and(*(_steady(values[whole], used, middle, time, omega)
                              for values in (reference, sensor)))
    start, stop = _around_middle(steady)
    start, stop = tone.start + start, tone.start + stop
    used = valid[start:stop]
    if used.sum() < max(_FEWEST_SAMPLES, _FEWEST_CYCLES * 2 * np.pi / omega):
        return None
    x, y = reference[start:stop][used], sensor[start:stop][used]
    # centred: amplitude and phase are then hardly correlated with the frequency
    time = (np.arange(stop - start) - (stop - start - 1) / 2)[used]
    omega = _frequency(x, time, omega)
    columns = _columns(time, omega)
    fits = [_sine_fit(columns, values, time, omega) for values in (x, y)]
    (below, below_std, below_harmonics), (above, above_std, above_harmonics) = fits
    std = float(np.hypot(below_std, above_std))
    return Dwell(start, stop, float(omega * sampling_rate_hz / (2 * np.pi)),
                 complex(above / below), std, float(abs(below)), above_harmonics,
                 below_harmonics)


def _steady(values, used, middle, time, omega):
    """Where the moving complex amplitude is that of the middle."""
    n = len(values)
    columns = np.stack([np.cos(omega * time), np.sin(omega * time), np.ones(n)], axis=1)
    found = _least_squares(columns[middle], values[middle])
    # a missing sample must not look like a change
    filled = np.where(used, values, columns @ found) - found[2]
    turned = filled * np.exp(-1j * omega * time)
    # over periods the mean and the mirrored frequency average out; they are no whole numbers of
    # samples, and each further pass takes more of what is left
    periods = max(1, round(n * omega / (2 * np.pi) / 80))
    size = min(max(round(periods * 2 * np.pi / omega), 3), n)
    moving = turned
    for _ in range(_PASSES):
        moving = uniform_filter1d(moving.real, size) + 1j * uniform_filter1d(moving.imag, size)
    middle = moving[n // 4:n - n // 4]
    centre = np.median(middle.real) + 1j * np.median(middle.imag)
    away = np.abs(moving - centre)
    scatter = np.median(away[n // 4:n - n // 4]) / 1.18  # median of a Rayleigh distribution
    return away <= max(_STEADY * abs(centre), _SCATTER * scatter)


def _around_middle(steady):
    """Run of true values around the middle."""
    n = len(steady)
    before = np.flatnonzero(~steady[:n // 2])
    after = np.flatnonzero(~steady[n // 2:])
    return (before[-1] + 1 if len(before) else 0), n // 2 + (after[0] if len(after) else n - n // 2)


def _frequency(values, time, omega):
    """Gauss-Newton on the frequency of the four-parameter sine fit."""
    size = np.ptp(time)
    for _ in range(_FREQUENCY_STEPS):
        cosine, sine, one = np.cos(omega * time), np.sin(omega * time), np.ones(len(time))
        a, b, _ = _least_squares(np.stack([cosine, sine, one], 1), values)
        slope = time / size * (b * cosine - a * sine)
        *_, step = _least_squares(np.stack([cosine, sine, one, slope], 1), values)
        omega += np.clip(step, -1, 1) / size
    return omega


def _columns(time, omega):
    """Cosine and sine of the fundamental and its harmonics below the Nyquist frequency, and one."""
    orders = [k for k in range(1, _HARMONICS + 1) if k == 1 or k * omega < 0.95 * np.pi]
    return np.stack([*(part(k * omega * time) for k in orders for part in (np.cos, np.sin)),
                     np.ones(len(time))], axis=1)


def _sine_fit(columns, values, time, omega):
    """Complex amplitude, its relative standard uncertainty, and the harmonics' share."""
    found = _least_squares(columns, values)
    power = found[0]**2 + found[1]**2
    noise = _noise_at(omega, values - columns @ found, time)
    # the two coefficients have a variance of 2 noise / n each (Cramer-Rao bound of a sine)
    std = np.sqrt(2 * noise / (len(values) * power))
    return found[0] - 1j * found[1], std, float(np.sqrt(np.sum(found[2:-1]**2) / power))


def _noise_at(omega, residual, time):
    """Spectral density of the residual around a frequency: the variance of white noise like it."""
    spacing = 2 * np.pi / (np.ptp(time) + 1)
    # the fit has emptied the line itself, and the mean the one at zero
    beside = omega + spacing * np.r_[-_LINES - 1:-1, 2:_LINES + 2]
    beside = beside[(beside > 1.5 * spacing) & (beside < np.pi)]
    angle = np.outer(beside, time)
    power = (np.cos(angle) @ residual)**2 + (np.sin(angle) @ residual)**2
    # one less in the mean: the spread of a Student distribution (JCGM 101:2008, 6.4.9)
    return np.sum(power) / max(len(beside) - 1, 1) / len(residual)


def _least_squares(columns, values):
    return np.linalg.solve(columns.T @ columns, columns.T @ values)
