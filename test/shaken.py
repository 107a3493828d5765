"""Records of a classical sensor from numpy and scipy alone: 16 steps a sample, exact in each.

For motions that `exact_sines` does not give: shocks, and sweeps that pass each frequency once.
"""

import numpy as np
from scipy.signal import cont2discrete, lfilter

OVERSAMPLING = 16


def shocks(rng, rate, n, count, duration_s, peak):
    """Smooth pulses at random times, shape (16 n,) on the fine grid."""
    time = np.arange(n * OVERSAMPLING) / (rate * OVERSAMPLING)
    motion = np.zeros(len(time))
    for place in range(count):
        begin = (place + rng.uniform(0.1, 0.6)) / count * n / rate
        length = duration_s * rng.uniform(0.7, 1.5)
        inside = (time >= begin) & (time < begin + length)
        motion[inside] += (peak * rng.uniform(0.3, 1)
                           * np.sin(np.pi * (time[inside] - begin) / length)**2)
    return motion


def sweep(rate, n, first_hz, last_hz, evenly="octaves"):
    """Sine whose frequency passes a band evenly in octaves or in Hz, faded in and out."""
    time = np.arange(n * OVERSAMPLING) / (rate * OVERSAMPLING)
    share = time * rate / n
    frequency = first_hz * (last_hz / first_hz)**share if evenly == "octaves" \
        else first_hz + (last_hz - first_hz) * share
    fade = np.clip(50 * np.minimum(share, 1 - share), 0, 1)
    return np.sin(2 * np.pi * np.cumsum(frequency) / (rate * OVERSAMPLING)) * fade**2


def measured(rng, motion, rate, frequency_hz, ratio, noise_db, reference_noise_db):
    """Reference and output of unit sensitivity at the record's instants, with white noise.

    The noise is that many decibels below the RMS of either signal.
    """
    omega = 2 * np.pi * frequency_hz
    top, bottom, _ = cont2discrete(([omega**2], [1, 2 * ratio * omega, omega**2]),
                                   1 / (rate * OVERSAMPLING), "foh")
    pair = motion[::OVERSAMPLING], lfilter(top[0], bottom, motion)[::OVERSAMPLING]
    return tuple(values + rng.standard_normal(len(values)) * values.std() * 10**(-level / 20)
                 for values, level in zip(pair, (reference_noise_db, noise_db)))
