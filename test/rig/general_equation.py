r"""Integration of the general linear equation with real orders, from rest.

Equation (5) of the seed paper, :math:`\sum A_i D^{\nu_i} y = \sum B_i D^{\mu_i} a`, stepped by the
fourth-order backward differentiation formula: every D^ν becomes a sum over the past whose weights
are the power series of

.. math:: (\delta(\zeta) / h)^\nu, \qquad \delta(\zeta) = \sum_{k=1}^{4} (1 - \zeta)^k / k

(C. Lubich, Discretized fractional calculus, SIAM J. Math. Anal. 17, 1986; one term of the sum would
be Grünwald-Letnikov). Its frequency error is (w h)**4 / 5. The weights of the solved equation are
the series of the whole quotient; they are summed over the past by fast convolution, which gives the
numbers that the recursion would give step by step, without its quadratic cost.
"""

import functools

import numpy as np
import scipy.fft
import scipy.signal


def integrate_general(acceleration, step_s, denominator, numerator):
    """Output y [output units] on the grid.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        Base acceleration [m/s²] on the grid, zero and smooth at its start.
    denominator, numerator : sequence of (coefficient, order)
        (A_i, ν_i) and (B_i, μ_i), in seconds**order.
    """
    n = len(acceleration)
    weights = _weights(n, step_s, tuple(denominator), tuple(numerator))
    return scipy.signal.fftconvolve(acceleration, weights)[:n]


@functools.lru_cache(maxsize=1)  # three axes of one sensor
def _weights(n, step_s, denominator, numerator):
    """First n coefficients of the series, by the trapezoidal rule on a circle inside its disk."""
    size = scipy.fft.next_fast_len(2 * n, real=True)
    radius = 1e-10 ** (1 / size)  # aliasing 1e-10, rounding 1e-16 / 1e-5
    zeta = radius * np.exp(-2j * np.pi * np.arange(size // 2 + 1) / size)
    delta = _delta(zeta) / step_s
    quotient = _sum(numerator, delta) / _sum(denominator, delta)
    return scipy.fft.irfft(quotient, size)[:n] * radius ** -np.arange(n)


def _delta(zeta):
    d = 1 - zeta
    return d * (1 + d * (1 / 2 + d * (1 / 3 + d / 4)))


def _sum(terms, s):
    return sum(coefficient * s ** order for coefficient, order in terms)
