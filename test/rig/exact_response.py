"""Exact response of a sensor's linear time-invariant part, written out from the equations.

The rig never simulates with it: it is what the rig's error is measured against.
"""

import numpy as np
import scipy.fft
from scipy.optimize import brentq
from scipy.special import factorial

from .excitation import smooth_step


def transfer_function(sensor, axis, s):
    """Response of one axis at complex `s` [rad/s], with delay and constant gain."""
    core, effects = sensor.on_axis(axis)
    response = _core_response({**core, **effects.get("core_parameter_shift", {}),
                               **effects.get("fractional_damping", {})}, s)
    if "mounting_resonance" in effects:
        w = 2 * np.pi * effects["mounting_resonance"]["frequency_hz"]
        ratio = effects["mounting_resonance"]["damping_ratio"]
        response = response * (2 * ratio * w * s + w ** 2) / (s ** 2 + 2 * ratio * w * s + w ** 2)
    if "two_mounts" in effects:
        mounts = effects["two_mounts"]
        for name in ("first_hz", "second_hz"):
            w, ratio = 2 * np.pi * mounts[name], mounts["damping_ratio"]
            passed = 2 * ratio * w * s + w ** 2
            response = response * passed / (s ** 2 + passed)
    if "second_resonance" in effects:
        mode = effects["second_resonance"]
        w = 2 * np.pi * mode["frequency_hz"]
        share = mode["share"]
        response = response * ((1 - share) + share * w ** 2 / (
            s ** 2 + 2 * mode["damping_ratio"] * w * s + w ** 2))
    if "ac_coupling" in effects:
        response = response * s / (s + 2 * np.pi * effects["ac_coupling"]["corner_hz"])
    if "low_pass_lag" in effects:
        w = 2 * np.pi * effects["low_pass_lag"]["corner_hz"]
        response = response * w / (s + w)
    if "low_pass_filter" in effects:
        response = response * _low_pass_filter(s, **effects["low_pass_filter"])
    if "linear_phase_filter" in effects:
        boxcar = effects["linear_phase_filter"]
        x = s * boxcar["length_s"]
        response = response * (-np.expm1(-x) / x) ** boxcar["order"]
    if "time_delay" in effects:
        response = response * np.exp(-s * effects["time_delay"]["delay_s"])
    return response * effects.get("sensitivity_error", {"gain": 1.0})["gain"]


def _low_pass_filter(s, corner_hz, order, family):
    """From the closed forms: Butterworth's poles on a circle, Bessel's reverse polynomial."""
    x = s / (2 * np.pi * corner_hz)
    if family == "butterworth":
        angles = np.pi * (2 * np.arange(order) + order + 1) / (2 * order)
        return 1 / np.prod([x - np.exp(1j * angle) for angle in angles], axis=0)
    k = np.arange(order + 1)
    coefficients = factorial(2 * order - k) / (
        2.0 ** (order - k) * factorial(k) * factorial(order - k))
    bessel = np.polynomial.Polynomial(coefficients)
    # scaled for half the power at the corner
    scale = brentq(lambda w: 2 * coefficients[0] ** 2 - abs(bessel(1j * w)) ** 2, 0.1, 10.0)
    return coefficients[0] / bessel(scale * x)


def _core_response(core, s):
    if core["type"] == "gain":
        return np.full(np.shape(s), core["sensitivity"], complex)
    if core["type"] == "oscillator":
        w, order = 2 * np.pi * core["natural_frequency_hz"], core["damping_order"]
        damping = 2 * core["damping_ratio"] * w ** (2 - order) * s ** order
        return core["sensitivity"] * w ** 2 / (s ** 2 + damping + w ** 2)
    if core["type"] == "arx":
        z = np.exp(s / core["sampling_rate_hz"])
        return np.polyval(core["numerator"], z) / np.polyval(core["denominator"], z)
    return (sum(b * s ** m for b, m in zip(core["numerator_coefficients"],
                                           core["numerator_orders"]))
            / sum(a * s ** n for a, n in zip(core["denominator_coefficients"],
                                             core["denominator_orders"])))


def exact_output(sensor, axis, excitation):
    """Output of one axis at the record's instants, shape (samples,).

    The response is evaluated to the right of the imaginary axis, on the excitation times
    exp(-18 t / T): what a discrete Fourier transform wraps around is then below exp(-18). What
    comes after the record cannot act on it, and is faded out to keep the spectrum narrow. The
    delay must not be negative.
    """
    acceleration = excitation.acceleration["xyz".index(axis)]
    n, step = len(acceleration), excitation.step_s
    stop = excitation.start + excitation.samples * excitation.oversampling
    fade = smooth_step((n - 1 - np.arange(n)) / (n - 1 - stop))
    decay = np.exp(-18 * np.arange(n) / n)
    size = scipy.fft.next_fast_len(n, real=True)
    spectrum = scipy.fft.rfft(acceleration * fade * decay, size)
    s = 18 / (n * step) + 2j * np.pi * np.arange(len(spectrum)) / (size * step)
    y = scipy.fft.irfft(spectrum * transfer_function(sensor, axis, s), size)[:n] / decay
    return y[excitation.start:stop:excitation.oversampling]
