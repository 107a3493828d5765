"""PyDynamic's published accelerometer example, its sensor played exactly in continuous time.

From `deconv_FIR.py` of PTB-M4D/PyDynamic: a second-order sensor, white noise, a Gaussian shock. The
example itself plays the sensor through the same bilinear transform that it then inverts; a real
sensor is continuous, and so is this one.
"""

import numpy as np

from frac_accel import Corrector, SensorModel

STATIC_GAIN = 0.124
DAMPING = 0.0055
NATURAL_HZ = 36e3
RATE_HZ = 500e3
NOISE_STD = 1e-3
SIGMA_S = 1e-5
PEAK = 0.8
SHOCK_AT_S = 2e-3
SAMPLES = 2000

# The shock's spectrum falls to 3 % of its largest value there.
BANDWIDTH_HZ = 42e3
MAX_DELAY_S = 80e-6


def shock(time_s):
    """Base acceleration at any instants."""
    return PEAK * np.exp(-0.5 * ((time_s - SHOCK_AT_S) / SIGMA_S)**2)


def sensor_output(core=None):
    """The sensor's response at its sampling instants, without noise, shape (SAMPLES,).

    `core` may give it other parameters, by the names of the model file.

    The shock is a Gaussian, so its spectrum is known in closed form; the response is that spectrum
    times the sensor's, transformed back over a period of 64 times the ringing's time constant.
    """
    core = core or {"natural_frequency_hz": NATURAL_HZ, "damping_ratio": DAMPING,
                    "sensitivity": STATIC_GAIN}
    natural, damping = 2 * np.pi * core["natural_frequency_hz"], core["damping_ratio"]
    period_s = 64 / (damping * natural)
    points = int(np.ceil(period_s * RATE_HZ))
    omega = 2 * np.pi * np.fft.rfftfreq(points, 1 / RATE_HZ)
    spectrum = (PEAK * SIGMA_S * np.sqrt(2 * np.pi) * np.exp(-0.5 * (omega * SIGMA_S)**2)
                * np.exp(-1j * omega * SHOCK_AT_S))
    response = core["sensitivity"] * natural**2 / (
        natural**2 - omega**2 + 2j * damping * natural * omega)
    return np.fft.irfft(spectrum * response, points)[:SAMPLES] * RATE_HZ


def corrector():
    """Our filter for this sensor and this shock."""
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": NATURAL_HZ, "damping_ratio": DAMPING,
                 "sensitivity": STATIC_GAIN}})
    return Corrector(model, RATE_HZ, bandwidth_hz=BANDWIDTH_HZ, max_delay_s=MAX_DELAY_S,
                     noise_std=NOISE_STD)


def our_estimate(noisy):
    """Corrected record and its delay: instants, values and delay [s]."""
    kernel = corrector()
    stamps_ns = np.round(np.arange(len(noisy)) * 1e9 / RATE_HZ).astype(np.int64)
    result = kernel.process(stamps_ns, np.stack([noisy] * 3, axis=1))
    return (result.stamps_ns * 1e-9, result.values[:, 0],
            kernel.design.delay_samples / RATE_HZ)
