"""Shock deconvolution side by side with PyDynamic, on its own published example."""

import numpy as np
import published_shock as example
from scipy.signal import lfilter

SEEDS = 100


def pydynamic_filter():
    """Coefficients of the deconvolution filter and low-pass as the example designs them."""
    from PyDynamic.misc.filterstuff import kaiser_lowpass
    from PyDynamic.model_estimation.fit_filter import LSFIR

    rng = np.random.RandomState(10)
    rng.randn(example.SAMPLES - 1)  # the example draws its noise first
    runs, order, tau = 10_000, 12, 6
    natural_hz = example.NATURAL_HZ * (1 + 0.01 * rng.randn(runs))
    gain = example.STATIC_GAIN * (1 + 0.001 * rng.randn(runs))
    damping = example.DAMPING * (1 + 0.1 * rng.randn(runs))
    frequency = np.linspace(0, 120e3, 200)
    # the bilinear transform's frequency response, for all draws at once
    s = 2j * example.RATE_HZ * np.tan(np.pi * frequency / example.RATE_HZ)
    natural = 2 * np.pi * natural_hz[:, None]
    draws = (gain[:, None] * natural**2
             / (s**2 + 2 * damping[:, None] * natural * s + natural**2))
    mean = draws.mean(axis=0)
    # of the draws only the mean goes into the coefficients
    coefficients, _ = LSFIR(H=np.r_[mean.real, mean.imag], N=order, f=frequency,
                            Fs=example.RATE_HZ, tau=tau, inv=True, verbose=False)
    low_pass, shift = kaiser_lowpass(100, example.NATURAL_HZ + 20e3, example.RATE_HZ)
    return np.convolve(coefficients, low_pass), tau + shift


def measured_delay_s(instants_s, values):
    """Delay for which the largest error is smallest."""
    delays = np.arange(-30e-6, 150e-6, 0.25e-6)
    errors = [np.max(np.abs(values - example.shock(instants_s - delay))) for delay in delays]
    return delays[int(np.argmin(errors))]


def run():
    """Rows of the table: method, largest error in % of the peak (mean and worst), delay."""
    clean = example.sensor_output()
    instants = np.arange(example.SAMPLES) / example.RATE_HZ
    taps, stated_shift = pydynamic_filter()
    settled = len(taps)
    theirs_delay = measured_delay_s(instants[settled:], lfilter(taps, 1.0, clean)[settled:])
    at_ns, values, filter_delay = example.our_estimate(clean)
    ours_delay = filter_delay + measured_delay_s(at_ns, values)
    theirs, ours = [], []
    for seed in range(SEEDS):
        noisy = clean + example.NOISE_STD * np.random.default_rng(seed).normal(size=len(clean))
        estimate = lfilter(taps, 1.0, noisy)[settled:]
        theirs.append(np.max(np.abs(estimate - example.shock(instants[settled:] - theirs_delay))))
        at, values, _ = example.our_estimate(noisy)
        ours.append(np.max(np.abs(values - example.shock(at))))
    rows = [("PyDynamic, shifted by its measured delay", theirs, theirs_delay),
            ("frac_accel, at its own stamps", ours, ours_delay)]
    return [{"method": name, "largest error, mean of seeds [% of peak]":
             100 * np.mean(errors) / example.PEAK,
             "largest error, worst seed [% of peak]": 100 * np.max(errors) / example.PEAK,
             "delay [us]": 1e6 * delay} for name, errors, delay in rows]
