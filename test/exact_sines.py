"""Records whose exact answer is known: many sines of any frequencies through any response.

No part of the package has a hand in it: each sine comes out with the size and phase that the
response has at its frequency. The record begins in mid-motion.
"""

import numpy as np

from frac_accel.io.samples import Samples

RATE = 1000.0


def record(rng, of_sensor, of_reference=lambda s: np.ones_like(s), band=(1.0, 400.0), n=12_000,
           rate=RATE, noise=1e-3, reference_noise=0.0, sines=600):
    """Recorded reference and sensor, shape (n,), from responses to the base at s [rad/s].

    The base's acceleration has an RMS of 1 m/s²; `noise` and `reference_noise` are those of the
    recorded signals [their units].
    """
    frequency = np.sort(rng.uniform(*band, sines))
    size = np.sqrt(2 / sines) * rng.uniform(0.3, 1.4, sines) * np.exp(
        2j * np.pi * rng.random(sines))
    s = 2j * np.pi * frequency
    time = np.arange(n) / rate
    outputs = np.zeros((2, n))
    for lines in np.array_split(np.arange(sines), 12):
        waves = np.exp(np.outer(s[lines], time))
        for output, response in zip(outputs, (of_reference(s), of_sensor(s))):
            output += np.real((size * response)[lines] @ waves)
    reference, sensor = outputs
    return (reference + reference_noise * rng.standard_normal(n),
            sensor + noise * rng.standard_normal(n))


def samples(reference, sensor, rate=RATE):
    """The same as `Samples` of three axes, the signal on x."""
    stamps = np.round(1e9 * np.arange(len(reference)) / rate).astype(np.int64)
    return tuple(Samples.of(stamps, np.c_[values, np.zeros((len(values), 2))])
                 for values in (reference, sensor))


def oscillator(s, frequency_hz, ratio):
    """Classical seismic sensor with unit sensitivity."""
    w = 2 * np.pi * frequency_hz
    return w**2 / (s**2 + 2 * ratio * w * s + w**2)
