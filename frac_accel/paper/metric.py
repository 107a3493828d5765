"""The paper's measure of accuracy: the median relative error of sampled sines."""

import numpy as np

from . import published

# Share of the amplitude below which a sample counts as a zero crossing: it has no relative error.
_ZERO = 1e-9
# Phases of the first sample that are tried.
_PHASES, _FEW_PHASES = 200, 45


def sampled_sines(response, frequency_hz, start_phase_rad=0.0, duration_s=1.0):
    """A sine of unit amplitude as the card samples it, and what a system makes of it.

    Parameters
    ----------
    response : complex
        Of the system at this frequency; it has settled.
    frequency_hz, start_phase_rad, duration_s : float

    Returns
    -------
    time_s, reference, output : ndarray, shape (n,)
    """
    rate_hz = published.SAMPLING_RATE_HZ
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    angle = 2 * np.pi * frequency_hz * time_s + start_phase_rad
    return time_s, np.sin(angle), np.abs(response) * np.sin(angle + np.angle(response))


def relative_error_percent(reference, output):
    """Relative error of each sample, shape (n,); NaN where the reference crosses zero."""
    usable = np.abs(reference) > _ZERO
    error = np.full(len(reference), np.nan)
    error[usable] = 100 * np.abs((output[usable] - reference[usable]) / reference[usable])
    return error


def median_error_percent(response, frequency_hz, start_phase_rad=0.0, duration_s=1.0):
    """The paper's measure for a settled system, from sines sampled for a second at 10 kHz."""
    _, reference, output = sampled_sines(response, frequency_hz, start_phase_rad, duration_s)
    return float(np.nanmedian(relative_error_percent(reference, output)))


def start_phase_range_percent(response, frequency_hz):
    """Lowest and highest measure that the phase at the first sample can give."""
    # a tenth of a second holds all phases at which multiples of 100 Hz are sampled
    values = [median_error_percent(response, frequency_hz, phase, 0.1)
              for phase in np.linspace(0, np.pi, _PHASES, endpoint=False)]
    return min(values), max(values)


def least_error_percent(phase_rad, frequency_hz):
    r"""Least measure of any sine that is shifted by a phase, whatever its amplitude.

    Of a sine of relative amplitude g, :math:`|1 - g\cos\varphi - g\sin\varphi\,\cot\theta|` at
    the instants :math:`\theta` that the card samples; minimised on a grid over g and over the phase
    of the first sample.
    """
    count = round(published.SAMPLING_RATE_HZ)
    turns = np.arange(count) * frequency_hz / published.SAMPLING_RATE_HZ % 0.5
    turns = np.unique(np.round(turns, 9))
    starts = np.linspace(0, 0.5, _FEW_PHASES, endpoint=False)
    gain = np.linspace(0, 1.5, 601)[:, None]
    least = np.inf
    for start in starts:
        sine = np.sin(2 * np.pi * (turns + start))
        angle = 2 * np.pi * (turns + start)[np.abs(sine) > _ZERO]
        error = np.abs(1 - gain * np.cos(phase_rad) - gain * np.sin(phase_rad) / np.tan(angle))
        least = min(least, np.min(np.median(error, axis=1)))
    return float(100 * least)
