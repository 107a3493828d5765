"""Linear links around the seismic system, and sampling, all on the high-rate grid."""

import numpy as np
import scipy.signal

from .oscillator import integrate

LAGRANGE_POINTS = 8


def mounting(acceleration, step_s, frequency_hz, damping_ratio):
    r"""Acceleration behind a spring and damper.

    :math:`(2\zeta\omega s + \omega^2) / (s^2 + 2\zeta\omega s + \omega^2)`: with q the response of
    the oscillator, the output is :math:`q + (2 \zeta / \omega) q'`.
    """
    motion = integrate(acceleration, step_s, frequency_hz, damping_ratio)
    return motion.q + 2 * damping_ratio / (2 * np.pi * frequency_hz) * motion.v


def low_pass(values, step_s, corner_hz):
    r"""First order, :math:`y' = \omega_c (x - y)`, exact for the cubic through four neighbours."""
    rate = 2 * np.pi * corner_hz * step_s
    # Weights of x[n-2], x[n-1], x[n], x[n+1] in the integral from n-1 to n.
    nodes, node_weights = np.polynomial.legendre.leggauss(30)
    place = (nodes + 1) / 2
    kernel = node_weights / 2 * rate * np.exp(-rate * (1 - place))
    offsets = np.array([-1, 0, 1, 2])
    taps = [np.sum(kernel * np.prod([(place - j) / (i - j) for j in offsets if j != i], axis=0))
            for i in offsets]
    ahead = np.append(values[1:], 2 * values[-1] - values[-2])
    return scipy.signal.lfilter(taps[::-1], [1, -np.exp(-rate)], ahead)


def high_pass(values, step_s, corner_hz):
    r"""First order, :math:`s / (s + \omega_c)`."""
    return values - low_pass(values, step_s, corner_hz)


def difference_equation(values, points_per_sample, numerator, denominator):
    """ARX core: y(t) from x and y at t, t - T, t - 2 T, ... at every grid point t.

    `numerator` and `denominator` are in descending powers of z down to z**0; T is
    `points_per_sample` grid points. Each of the interleaved sequences runs by itself, from rest.
    """
    padded = np.append(values, np.zeros(-len(values) % points_per_sample))
    delayed = np.append(np.zeros(len(denominator) - len(numerator)), numerator)
    y = scipy.signal.lfilter(delayed, denominator, padded.reshape(-1, points_per_sample), axis=0)
    return y.ravel()[:len(values)]


def delayed(values, points):
    """Values of `points` grid steps ago, not necessarily whole, by the polynomial as in `sample`.

    Rest before the grid; its last four values hold on where they would be of later.
    """
    whole = int(np.floor(points))
    place = whole + 1 - points
    nodes = np.arange(1 - LAGRANGE_POINTS // 2, LAGRANGE_POINTS // 2 + 1)
    weights = [np.prod([(place - k) / (j - k) for k in nodes if k != j]) for j in nodes]
    ahead = nodes[-1]
    padded = np.concatenate([np.zeros(whole + LAGRANGE_POINTS), values,
                             np.full(ahead, values[-1])])
    first = LAGRANGE_POINTS - 1 + nodes[0]  # where the first value's first node is
    return np.correlate(padded, weights, mode="valid")[first:first + len(values)]


def sample(values, index):
    """Values at real-valued grid positions, by the polynomial through the eight nearest points.

    Positions before the grid give 0 (rest); positions after it are an error.
    """
    index = np.asarray(index, float)
    if index.max() > len(values) - 1:
        raise ValueError("sampled after the excitation's end: give it a longer tail")
    before = index < 0
    first = np.clip(np.floor(index).astype(np.int64) - LAGRANGE_POINTS // 2 + 1,
                    0, len(values) - LAGRANGE_POINTS)
    place = index - first
    result = np.zeros(len(index))
    for i in range(LAGRANGE_POINTS):
        others = [j for j in range(LAGRANGE_POINTS) if j != i]
        weight = np.prod([(place - j) / (i - j) for j in others], axis=0)
        result += weight * values[first + i]
    result[before] = 0.0
    return result
