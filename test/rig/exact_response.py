"""Exact response of a sensor's linear time-invariant part, written out from the equations.

The rig never simulates with it: it is what the rig's error is measured against.
"""

import numpy as np
import scipy.fft

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
    if "ac_coupling" in effects:
        response = response * s / (s + 2 * np.pi * effects["ac_coupling"]["corner_hz"])
    if "low_pass_lag" in effects:
        w = 2 * np.pi * effects["low_pass_lag"]["corner_hz"]
        response = response * w / (s + w)
    if "time_delay" in effects:
        response = response * np.exp(-s * effects["time_delay"]["delay_s"])
    return response * effects.get("sensitivity_error", {"gain": 1.0})["gain"]


def _core_response(core, s):
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
