"""Model structures that can be identified: their response, its slopes and where to start."""

import numpy as np

from ...model.core import Gain, Oscillator
from ...model.core.oscillator import tail_rates
from ...model.core.principal_sheet import fractional_root
from ...model.core.sensor_form import from_sensor_parameters

# Where a search begins: frequencies between the lowest and the highest excited one, damping ratios,
# orders of the damping; the general equation's order of inertia, its highest order of damping, and
# the ratio and order of its slope.
_FREQUENCIES = 24
_DAMPINGS = (0.02, 0.08, 0.25, 0.7, 1.5)
_ORDERS = (0.4, 0.7, 1.0, 1.3, 1.6)
_INERTIA_ORDER, _HIGHEST_DAMPING_ORDER = 1.95, 1.45
_SLOPE_RATIO, _SLOPE_ORDER = 0.05, 0.6


class OscillatorStructure:
    """Classical seismic sensor; unknowns are log f0 and log zeta."""

    names = ("natural_frequency_hz", "damping_ratio")
    held = ()
    # per held value from the grid; tried, and pursued, in the time domain
    starting_points = 8
    trials = 2
    searches = 1
    # whether a fit to the points of the frequency response is one more start
    starts_from_points = False

    def prepare(self, s):
        """What the response needs of the complex frequencies `s`, once."""
        return s

    def response(self, s, theta):
        """Response with unit sensitivity; unknowns as in `gradient`."""
        square, damper = self._terms(s, theta)
        return 1 / (square + damper + 1)

    def _terms(self, s, theta):
        u = s * (np.exp(-theta[0]) / (2 * np.pi))
        return u * u, 2 * np.exp(theta[1]) * u

    def gradient(self, s, theta):
        """Response with unit sensitivity, and its derivatives by the unknowns.

        Unknowns of shape (k, ...) broadcast against the frequencies.
        """
        square, damper = self._terms(s, theta)
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

    def mode(self, theta):
        """Resonant pole [rad/s] and its derivatives by the unknowns, (k,); None without one.

        What is left of the time before the record swings with it.
        """
        omega, zeta = 2 * np.pi * np.exp(theta[0]), np.exp(theta[1])
        if zeta >= 1:
            return None, None
        swing = 1j * np.sqrt(1 - zeta**2)
        return omega * (swing - zeta), omega * np.array([swing - zeta, -zeta + zeta**2 / swing])

    def decay_rates(self, theta, duration_s):
        """Rates [1/s] at which what is left of the time before the record may decay."""
        omega, zeta = 2 * np.pi * np.exp(theta[0]), np.exp(theta[1])
        if zeta < 1:
            return np.array([])
        spread = np.sqrt(zeta**2 - 1)
        return omega * np.array([zeta - spread, zeta + spread])

    def simpler(self, unknowns):
        """A structure with two parameters less, and where to start from `unknowns`; or None."""
        return None

    def core(self, fit):
        """Core of a sensor model, from anything that maps `names` and ``sensitivity`` to values."""
        return Oscillator(natural_frequency_hz=fit["natural_frequency_hz"],
                          damping_ratio=fit["damping_ratio"], sensitivity=fit["sensitivity"])


class GainStructure(OscillatorStructure):
    """A sensor far below its resonance: sensitivity, delay and offset alone."""

    names = ()

    def response(self, s, theta):
        return np.ones(np.broadcast_shapes(np.shape(theta)[1:], s.shape), complex)

    def gradient(self, s, theta):
        return self.response(s, theta), []

    def physical(self, theta):
        return np.empty(0), np.empty((0, 0))

    def bounds(self, rate, n):
        return [], []

    def grid(self, low_hz, high_hz, peak_hz):
        return np.empty((1, 0))

    def mode(self, theta):
        return None, None

    def decay_rates(self, theta, duration_s):
        return np.array([])

    def core(self, fit):
        return Gain(sensitivity=fit["sensitivity"])


class FractionalStructure(OscillatorStructure):
    r"""Seismic sensor with a damping of free order.

    At its resonance, :math:`s = j \omega_0`, the damping term :math:`2 \zeta j^\nu` acts as a
    viscous damping ratio :math:`d = \zeta \sin(\nu \pi/2)` and as a spring of
    :math:`k = 2 \zeta \cos(\nu \pi/2)` times the sensor's own. Data fix d and the frequency that
    the spring leads to long before they fix the order; so the unknowns are the logarithms of
    :math:`f_0 \sqrt[4]{1 + 2k + 2k^2}` (for small k :math:`f_0 \sqrt{1 + k}`) and of d, and the
    order. In :math:`f_0`, :math:`\zeta` and the order the search would follow a curved valley.
    """

    names = ("natural_frequency_hz", "damping_ratio", "damping_order")
    held = ("damping_order",)
    starting_points = 3
    trials = 4
    searches = 2

    def prepare(self, s):
        return s, np.log(s)

    def response(self, prepared, theta):
        return self.gradient(prepared, theta)[0]

    def gradient(self, prepared, theta):
        (log_f0, log_zeta, order), factors = _natural(theta)
        log_u = prepared[1] - log_f0 - np.log(2 * np.pi)
        # not from the logarithm: an exponential of complex numbers costs as much as all else
        u = prepared[0] * (np.exp(-log_f0) / (2 * np.pi))
        square = u * u
        damper = 2 * np.exp(log_zeta + order * log_u)
        response = 1 / (square + damper + 1)
        twice = response * response
        return response, _chain([twice * (2 * square + order * damper), -twice * damper,
                                 -twice * damper * log_u], factors)

    def physical(self, theta):
        natural, factors = _natural(theta)
        slopes = np.eye(len(theta))
        slopes[:3, :3] = _matrix(factors)
        values = np.r_[np.exp(natural[:2]), theta[2:]]
        slopes[:2] *= values[:2, None]
        return values, slopes

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        return [*low, 0.05], [high[0], np.log(7), 1.95]

    def grid(self, low_hz, high_hz, peak_hz):
        log_f0, log_zeta = super().grid(low_hz, high_hz, peak_hz).T
        return np.concatenate([_unknowns(log_f0, log_zeta, order) for order in _ORDERS])

    def mode(self, theta):
        return self._mode(theta, 2.0)

    def _mode(self, theta, inertia_order):
        (log_f0, log_zeta, order), factors = _natural(theta)
        damping = 2 * np.exp(log_zeta)
        root = fractional_root([1.0, damping, 1.0], [inertia_order, order, 0.0])
        if root is None:
            return None, None
        pole = root * 2 * np.pi * np.exp(log_f0)
        inertia, damper = root**inertia_order, damping * root**order
        # the response is one over a sum that vanishes here: the ratio of the sum's slopes
        by_log_root = inertia_order * inertia + order * damper
        log_slopes = np.array([1.0, -damper / by_log_root, -damper / by_log_root * np.log(root)])
        own = pole * _matrix(factors).T @ log_slopes
        return pole, np.r_[own, -pole * inertia / by_log_root * np.log(root),
                           np.zeros(len(self.names))][:len(self.names)]

    def decay_rates(self, theta, duration_s):
        return tail_rates(np.exp(theta[0]), duration_s)

    def core(self, fit):
        return Oscillator(natural_frequency_hz=fit["natural_frequency_hz"],
                          damping_ratio=fit["damping_ratio"], sensitivity=fit["sensitivity"],
                          damping_order=fit["damping_order"])


class PlainTransferFunctionStructure(FractionalStructure):
    r"""Equation (5) of the seed paper with three terms against one,

    .. math:: D^{\nu_2} y / \omega_0^{\nu_2} + 2 \zeta D^{\nu_1} y / \omega_0^{\nu_1} + y = S a.

    Positive terms whose orders do not exceed 2 are stable, whatever their sizes.
    """

    names = (*FractionalStructure.names, "inertia_order")
    held = ("damping_order", "inertia_order")
    starts_from_points = True

    def gradient(self, prepared, theta):
        natural, factors = _natural(theta)
        log_u, denominator, slopes = self._denominator(prepared, natural, theta[3])
        response = 1 / denominator
        twice = response * response
        return response, _chain([-twice * slope for slope in slopes], factors)

    def _denominator(self, prepared, natural, inertia_order):
        """Its value and slopes by the logarithms of f0 and zeta and by the two orders."""
        log_f0, log_zeta, order = natural
        log_u = prepared[1] - log_f0 - np.log(2 * np.pi)
        inertia = np.exp(inertia_order * log_u)
        damper = 2 * np.exp(log_zeta + order * log_u)
        return log_u, inertia + damper + 1, [-inertia_order * inertia - order * damper, damper,
                                             damper * log_u, inertia * log_u]

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        # two terms of nearly equal order are one, and could change places
        return [*low, _HIGHEST_DAMPING_ORDER + 0.05], [*high[:2], _HIGHEST_DAMPING_ORDER, 2.0]

    def grid(self, low_hz, high_hz, peak_hz):
        grid = super().grid(low_hz, high_hz, peak_hz)
        grid = grid[grid[:, 2] < _HIGHEST_DAMPING_ORDER]
        return np.c_[grid, np.full(len(grid), _INERTIA_ORDER)]

    def mode(self, theta):
        return self._mode(theta, theta[3])

    def core(self, fit):
        return from_sensor_parameters({name: fit[name] for name in ("sensitivity", *self.names)})


class FractionalTransferFunctionStructure(PlainTransferFunctionStructure):
    r"""The same with a slope term, :math:`S (\beta D^\mu a / \omega_0^\mu + a)`, on the right."""

    names = (*PlainTransferFunctionStructure.names, "slope_ratio", "slope_order")
    held = (*PlainTransferFunctionStructure.held, "slope_ratio", "slope_order")

    def simpler(self, unknowns):
        return PlainTransferFunctionStructure(), np.delete(unknowns, [4, 5])

    def gradient(self, prepared, theta):
        natural, factors = _natural(theta)
        log_u, denominator, slopes = self._denominator(prepared, natural, theta[3])
        power = np.exp(theta[5] * log_u)
        response = (1 + theta[4] * power) / denominator
        own = [-response * slope / denominator for slope in slopes]
        own[0] = own[0] - theta[4] * theta[5] * power / denominator
        own += [power / denominator, theta[4] * power * log_u / denominator]
        return response, _chain(own, factors)

    def bounds(self, rate, n):
        low, high = super().bounds(rate, n)
        return [*low, -0.5, 0.05], [*high, 5.0, 1.5]

    def grid(self, low_hz, high_hz, peak_hz):
        grid = super().grid(low_hz, high_hz, peak_hz)
        return np.c_[grid, np.full(len(grid), _SLOPE_RATIO), np.full(len(grid), _SLOPE_ORDER)]


def _natural(theta):
    """Logarithms of f0 and zeta, and the order, from the unknowns; and what `_chain` needs."""
    order = theta[2]
    sine, cosine = np.sin(order * np.pi / 2), np.cos(order * np.pi / 2)
    spring = 2 * np.exp(theta[1]) * cosine / sine
    shift, by_spring = _spring_shift(spring)
    factors = (-by_spring * spring, by_spring * np.pi * np.exp(theta[1]) / sine**2,
               -np.pi / 2 * cosine / sine)
    return (theta[0] - shift, theta[1] - np.log(sine), order), factors


def _unknowns(log_f0, log_zeta, order):
    """Inverse of `_natural`, shape (m, 3)."""
    angle = order * np.pi / 2
    shift, _ = _spring_shift(2 * np.exp(log_zeta) * np.cos(angle))
    return np.c_[log_f0 + shift, log_zeta + np.log(np.sin(angle)), np.full(len(log_f0), order)]


def _spring_shift(spring):
    """Shift of the logarithm of the frequency, and its slope.

    Half the logarithm of 1 + k where k is small, and without its end at k = -1.
    """
    square = 1 + 2 * spring * (1 + spring)
    return 0.25 * np.log(square), (0.5 + spring) / square


def _chain(slopes, factors):
    """Slopes by the unknowns from those by the natural parameters."""
    f0, zeta, order, *others = slopes
    return [f0, zeta + factors[0] * f0, order + factors[1] * f0 + factors[2] * zeta, *others]


def _matrix(factors):
    """Derivatives of the natural parameters by the unknowns."""
    return np.array([[1.0, factors[0], factors[1]], [0.0, 1.0, factors[2]], [0.0, 0.0, 1.0]])
