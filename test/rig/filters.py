"""Filters of the second set on the high-rate grid: digital ones in their continuous-time form."""

import numpy as np
import scipy.signal

from . import links
from .oscillator import integrate


def moving_average(values, step_s, length_s, order):
    r"""Mean over the last `length_s`, `order` times: :math:`((1 - e^{-sL}) / (sL))^{order}`.

    The integral is exact for the cubic through four neighbours; the values are from rest.
    """
    points = length_s / step_s
    for _ in range(round(order)):
        total = _integral(values)
        values = (total - links.delayed(total, points)) / points
    return values


def _integral(values):
    """Integral up to each grid point, in units of the spacing."""
    x = np.concatenate([[values[0]] * 2, values, [2 * values[-1] - values[-2]]])
    steps = (-x[:-3] + 13 * x[1:-2] + 13 * x[2:-1] - x[3:]) / 24
    return np.cumsum(steps)


def low_pass_filter(values, step_s, corner_hz, order, family):
    """Analogue Butterworth or Bessel filter, -3 dB at the corner, gain 1 at rest.

    Its poles are taken one after the other, each pair as an oscillator.
    """
    w = 2 * np.pi * corner_hz
    if family == "butterworth":
        poles = scipy.signal.buttap(order)[1] * w
    elif family == "bessel":
        poles = scipy.signal.besselap(order, norm="mag")[1] * w
    else:
        raise ValueError(f"family {family!r}: expected butterworth or bessel")
    for pole in poles[poles.imag >= 0]:
        natural = abs(pole)
        if pole.imag > 1e-9 * natural:
            values = integrate(values, step_s, natural / (2 * np.pi), -pole.real / natural).q
        else:
            values = links.low_pass(values, step_s, natural / (2 * np.pi))
    return values


def second_resonance(values, step_s, frequency_hz, damping_ratio, share):
    r"""Parallel mode, :math:`(1 - b) + b\, \omega^2 / (s^2 + 2 \zeta \omega s + \omega^2)`."""
    mode = integrate(values, step_s, frequency_hz, damping_ratio).q
    return (1 - share) * values + share * mode
