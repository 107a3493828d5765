"""Digital filter with uncertain coefficients and noise at its input, in blocks."""

import numpy as np

from ..errors import FracAccelError
from ..signals.linear_filter import run_filter
from ..signals.parallel_filter import steady_state

# Of the noise's power, what the squared impulse response may leave out.
_TAIL = 1e-12
_LONGEST = 1 << 16
_CHUNK = 4096
_FIR = np.array([1.0, 0.0])


class UncertainFilter:
    r"""Recursive filter whose output comes with a standard uncertainty.

    To first order in the coefficients (A. Link, C. Elster, *Meas. Sci. Technol.* 20 (2009) 055104,
    equation (12)) the variance of the output is

    .. math:: u^2 = \phi^T U \phi + h^2 * u_x^2

    with the derivatives :math:`\phi` of the output by the coefficients and the impulse response h.
    The derivatives are outputs of filters themselves: by :math:`b_k`, the input through 1/A, k
    samples ago; by :math:`a_k`, less the output through 1/A. Here all run over whole blocks.

    Parameters
    ----------
    b, a : array_like
        Numerator and denominator, a[0] = 1.
    covariance : array_like, optional
        Of (a[1:], b).
    level, input_std : float
        Input and its standard uncertainty before the first sample, both steady.

    Raises
    ------
    FracAccelError
        If the shapes do not fit, or the filter is not stable.
    """

    def __init__(self, b, a, covariance=None, level=0.0, input_std=0.0):
        b, a = np.atleast_1d(np.asarray(b, float)), np.atleast_1d(np.asarray(a, float))
        if not a.size or a[0] != 1.0:
            raise FracAccelError(f"a: {a.tolist()} given, expected 1 as its first element")
        poles = np.roots(a)
        if np.max(np.abs(poles), initial=0.0) >= 1:
            raise FracAccelError("a: the filter is not stable")
        count = len(a) - 1 + len(b)
        if covariance is None:
            covariance = np.zeros((count, count))
        covariance = np.asarray(covariance, float)
        if covariance.shape != (count, count):
            raise FracAccelError(f"covariance: shape {covariance.shape} given, expected "
                                 f"{count, count} for a[1:] and b")
        size, vectors = np.linalg.eigh(covariance)
        used = size > 1e-15 * max(size[-1], 0)
        self._roots = (vectors[:, used] * np.sqrt(size[used])).T.copy()
        self._delays = len(a) - 1, len(b)
        a = np.r_[a, 0.0] if len(a) == 1 else a
        level = np.array([float(level)])
        inner = level / a.sum()
        self._main = _link(b, a, level)
        self._inner = _link(np.array([1.0]), a, level)
        self._outer = _link(-b, a, inner)
        self._noise = _link(*_squared_response(b, a), np.array([float(input_std)**2]))
        # the derivatives that the first samples need of those before
        self._before = (np.repeat(-inner * b.sum() / a.sum(), len(a) - 1),
                        np.repeat(inner, len(b) - 1))

    def process(self, values, input_std=0.0):
        """Output and its standard uncertainty for the next samples.

        Parameters
        ----------
        values : array_like, shape (n,)
        input_std : float or array_like, shape (n,)
            Standard uncertainty of their white noise.

        Returns
        -------
        output, std : ndarray, shape (n,)
        """
        values = np.asarray(values, float)
        noise = np.broadcast_to(np.square(np.asarray(input_std, float)), values.shape)
        output, std = np.empty_like(values), np.empty_like(values)
        for start in range(0, len(values), _CHUNK):
            part = slice(start, start + _CHUNK)
            output[part], std[part] = self._process(values[None, part], noise[None, part])
        return output, std

    def _process(self, values, noise):
        variance = _run(self._noise, noise.copy())
        if len(self._roots):
            inner = _run(self._inner, values)
            derivatives = self._delayed(_run(self._outer, inner)[0], inner[0])
            # a sum of squares, which rounding cannot make negative
            parts = self._roots @ derivatives
            variance += np.einsum("kn,kn->n", parts, parts)
        return _run(self._main, values)[0], np.sqrt(variance[0])

    def _delayed(self, by_a, by_b):
        """Derivatives by a[1:] and by b, shape (p, n)."""
        count, (of_a, of_b) = len(by_a), self._delays
        by_a, by_b = (np.concatenate(pair) for pair in zip(self._before, (by_a, by_b)))
        self._before = by_a[count:], by_b[count:]
        starts = range(len(by_a) - count - 1, len(by_a) - count - 1 - of_a, -1)
        return np.stack([by_a[k:k + count] for k in starts]
                        + [by_b[k:k + count] for k in range(of_b - 1, -1, -1)])


def _link(b, a, level):
    return [b, a, np.outer(level, steady_state(b, a))]


def _run(link, values):
    output, link[2] = run_filter(*link[:2], values, link[2])
    return output


def _squared_response(b, a):
    """Filter whose impulse response is the square of another's.

    Its poles are the products of two of the other's. Where rounding spoils that (many poles close
    to each other), the squares themselves are the taps.
    """
    length = 64
    while True:
        power = _impulse(b, a, length)**2
        if length >= _LONGEST or power[length // 2:].sum() <= _TAIL * power.sum():
            break
        length *= 2
    poles = np.roots(a[:np.flatnonzero(a)[-1] + 1])
    products = [poles[i] * poles[j] for i in range(len(poles)) for j in range(i + 1)]
    denominator = np.atleast_1d(np.real(np.poly(products)))
    denominator = np.r_[denominator, np.zeros(max(0, 2 - len(denominator)))]
    head = len(denominator) - 1 + len(b)
    numerator = np.convolve(power[:head], denominator)[:head]
    if np.abs(_impulse(numerator, denominator, length) - power).sum() <= _TAIL * power.sum():
        return numerator, denominator
    last = np.flatnonzero(np.cumsum(power[::-1])[::-1] > _TAIL * power.sum())
    return power[:last[-1] + 1 if len(last) else 1], _FIR


def _impulse(b, a, length):
    impulse = np.zeros((1, length))
    impulse[0, 0] = 1.0
    state = np.zeros((1, max(len(a), len(b)) - 1))
    return run_filter(b, a, impulse, state)[0][0]
