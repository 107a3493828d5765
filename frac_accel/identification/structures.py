"""Model structures that can be identified: their response, its slopes and where to start."""

import numpy as np

from ..core import Oscillator

_FREQUENCIES = 24
_DAMPINGS = (0.02, 0.08, 0.25, 0.7, 1.5)
_ORDERS = (0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5, 1.7)


class OscillatorStructure:
    """Classical seismic sensor; unknowns are log f0 and log zeta."""

    names = ("natural_frequency_hz", "damping_ratio")
    held = ()
    starting_points = 8
    searches = 2

    def prepare(self, s):
        """What the response needs of the complex frequencies `s`, once."""
        return s

    def gradient(self, s, theta):
        """Response with unit sensitivity, and its derivatives by the unknowns."""
        u = s * np.exp(-theta[0]) / (2 * np.pi)
        square, damper = u * u, 2 * np.exp(theta[1]) * u
        response = 1 / (square + damper + 1)
        twice = response * response
        return response, [twice * (2 * square + damper), -twice * damper]

    def physical(self, theta):
        """Values of `names`, and their derivatives by the unknowns, shape (k, k)."""
        values = np.exp(theta)
        return values, np.diag(values)

    def bounds(self, rate, n):
        """Lowest and highest unknowns for a record of n samples."""
        return [np.log(rate / n), np.log(1e-4)], [np.log(50 * rate), np.log(20)]

    def grid(self, low_hz, high_hz, peak_hz):
        """Unknowns to start from, shape (m, k); `peak_hz` is where the response is largest."""
        frequency = np.log(np.r_[
            np.geomspace(max(2 * low_hz, high_hz / 100), 3 * high_hz, _FREQUENCIES), peak_hz])
        return np.stack(np.meshgrid(frequency, np.log(_DAMPINGS)), axis=-1).reshape(-1, 2)

    def free_motions(self, theta, time):
        """Motions without excitation: what is left of the time before the record."""
        omega, zeta = 2 * np.pi * np.exp(theta[0]), np.exp(theta[1])
        if zeta < 1:
            decay = np.exp(-zeta * omega * time)
            swing = omega * np.sqrt(1 - zeta**2) * time
            return [decay * np.cos(swing), decay * np.sin(swing)]
        spread = np.sqrt(zeta**2 - 1)
        return [np.exp(-omega * (zeta - spread) * time), np.exp(-omega * (zeta + spread) * time)]

    def core(self, fit):
        """Core of a sensor model."""
        return Oscillator(natural_frequency_hz=fit["natural_frequency_hz"],
                          damping_ratio=fit["damping_ratio"], sensitivity=fit["sensitivity"])


class FractionalStructure(OscillatorStructure):
    """Seismic sensor with a damping of free order; unknowns are log f0, log zeta and the order."""

    names = ("natural_frequency_hz", "damping_ratio", "damping_order")
    held = ("damping_order",)
    starting_points = 3
    searches = 1

    def prepare(self, s):
        return s, np.log(s)

    def gradient(self, prepared, theta):
        s, log_s = prepared
        log_u = log_s - theta[0] - np.log(2 * np.pi)
        square = np.exp(2 * log_u)
        damper = 2 * np.exp(theta[1] + theta[2] * log_u)
        response = 1 / (square + damper + 1)
        twice = response * response
        return response, [twice * (2 * square + theta[2] * damper), -twice * damper,
                          -twice * damper * log_u]

    def physical(self, theta):
        values = np.r_[np.exp(theta[:2]), theta[2]]
        return values, np.diag(np.r_[values[:2], 1.0])

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        return [*low, 0.05], [*high, 1.95]

    def grid(self, low_hz, high_hz, peak_hz):
        classical = super().grid(low_hz, high_hz, peak_hz)
        return np.concatenate([np.c_[classical, np.full(len(classical), order)]
                               for order in _ORDERS])

    def free_motions(self, theta, time):
        core = Oscillator(*np.exp(theta[:2]), theta[2])
        roots = [root for root in core.poles() if root.imag > 0]
        swings = [part for root in roots for part in
                  (np.exp(root.real * time) * np.cos(root.imag * time),
                   np.exp(root.real * time) * np.sin(root.imag * time))]
        # the algebraic tail of the branch cut, as a few decays over the length of the record
        rates = np.geomspace(2 / time[-1], 2 * np.pi * np.exp(theta[0]), 4)
        return swings + [np.exp(-rate * time) for rate in rates]

    def core(self, fit):
        return Oscillator(natural_frequency_hz=fit["natural_frequency_hz"],
                          damping_ratio=fit["damping_ratio"], sensitivity=fit["sensitivity"],
                          damping_order=fit["damping_order"])
