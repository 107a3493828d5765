"""Identification of a classical sensor: time and error, llsi beside it."""

import contextlib
import io
import time

import llsi
import numpy as np
from llsi.sysiddata import SysIdData

from frac_accel import identify
from frac_accel.record import Record

RATE_HZ, SAMPLES, SNR_DB = 2000.0, 10_000, 20.0
NATURAL_HZ, DAMPING = 180.0, 0.15
BAND_HZ = np.linspace(10, 600, 100)


def records():
    """Reference, clean and noisy output: the exact sampled response to a band-limited reference."""
    rng = np.random.default_rng(0)
    length = SAMPLES + 2000
    frequency = np.fft.rfftfreq(length, 1 / RATE_HZ)
    spectrum = rng.normal(size=(len(frequency), 2)) @ [1, 1j]
    spectrum[(frequency < 5) | (frequency > 700)] = 0
    both = np.fft.irfft([spectrum, spectrum * response(frequency)], length)[:, 2000:]
    reference, clean = both / both[0].std()
    noise = rng.normal(size=SAMPLES) * clean.std() * 10**(-SNR_DB / 20)
    return reference, clean, clean + noise


def response(frequency_hz):
    """Of the true sensor."""
    u = frequency_hz / NATURAL_HZ
    return 1 / (1 - u * u + 2j * DAMPING * u)


def seconds(function, repeats):
    """Shortest of several processor times [s], and the last result."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        result = function()
        times.append(time.process_time() - start)
    return min(times), result


def llsi_output_error(reference, sensor):
    """Second-order state space from the prediction-error method, started from its ARX."""
    data = SysIdData(t_start=0.0, Ts=1 / RATE_HZ, y=sensor, u=reference)
    with contextlib.redirect_stderr(io.StringIO()):
        return llsi.sysid(data, "y", "u", (2, 3, 0), method="pem")


def run():
    """Rows of the table."""
    reference, clean, sensor = records()
    empty = np.zeros((SAMPLES, 2))
    pair = Record(RATE_HZ, np.c_[reference, empty], np.c_[sensor, empty], np.ones(SAMPLES, bool),
                0.0, 0, np.nan)
    ours, result = seconds(lambda: identify(pair, structure="oscillator"), 7)
    theirs, model = seconds(lambda: llsi_output_error(reference, sensor), 1)
    core = result.model.core
    truth = response(BAND_HZ)

    def error(values):
        return np.sqrt(np.mean(np.abs(values - truth)**2) / np.mean(np.abs(truth)**2))

    s = 2j * np.pi * BAND_HZ
    own = core.transfer_function(s) * np.exp(-s * result.parameters["delay_s"]["value"])
    z = np.exp(s / RATE_HZ)
    other = np.polyval(model.b[::-1].ravel(), 1 / z) / np.polyval(model.a[::-1].ravel(), 1 / z)
    return [
        {"figure": "identify, oscillator, 1e4 samples, 20 dB [ms]", "value": 1e3 * ours},
        {"figure": "llsi, output error of the same order, over it", "value": theirs / ours},
        {"figure": "natural frequency, relative error", "value":
         abs(core.natural_frequency_hz / NATURAL_HZ - 1)},
        {"figure": "damping ratio, relative error", "value":
         abs(core.damping_ratio / DAMPING - 1)},
        {"figure": "response, relative error", "value": error(own)},
        {"figure": "response, relative error of llsi", "value": error(other)},
    ]
