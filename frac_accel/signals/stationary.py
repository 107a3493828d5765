"""A record as a stretch of a stationary process, of which nothing outside is known.

A filter with a long memory takes what it finds beyond a record's ends (nothing, or a constant) for
measured, and rings from there into the record. The best guess of what it makes of the process
(Wiener, 1949) takes the record for what it is: one stretch, whose covariance is a Toeplitz matrix.
"""

import functools
from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import uniform_filter1d
from scipy.sparse.linalg import LinearOperator, cg

# Lines over which the power is averaged, and share of a record beyond its end that lets it forget.
_LINES, _BEYOND = 33, 4
# Samples of all iterations together, how many these are at least, and share of the largest power
# below which rounding makes all of it.
_SAMPLES, _ITERATIONS, _ROUNDING = 10_000_000, 20, 1e-14


class Stationary(NamedTuple):
    """Power of a record by frequency, and what its covariance makes the record of.

    Attributes
    ----------
    power : ndarray, shape (m,)
        At the frequencies of `scipy.fft.rfftfreq` of `length` samples, of one sample's size.
    length : int
    source : ndarray, shape (n,)
        What the covariance makes the record of, but for `rest`.
    rest : ndarray, shape (n,)
    """

    power: np.ndarray
    length: int
    source: np.ndarray
    rest: np.ndarray

    def filtered(self, best, plain):
        """What a filter makes of the process where the record has it.

        Parameters
        ----------
        best, plain : ndarray, shape (m,)
            Response to what is explained, and to the little that is not.

        Returns
        -------
        ndarray, shape (n,)
        """
        lines = best * self.power * rfft(self.source, self.length) \
            + plain * rfft(self.rest, self.length)
        return irfft(lines, self.length)[:len(self.source)]


def stationary(values):
    """`Stationary` of values of shape (n,) with a mean of 0 and a size of about 1.

    The equations are solved by conjugate gradients, with the circulant matrix of the same power
    before them (R. H. Chan and M. K. Ng, SIAM Review 38 (1996) 427): some 20 steps, hundreds where
    tones stand far out of noise.
    """
    return _of_bytes(np.ascontiguousarray(values, float).tobytes())


def mean_of_lines(values):
    """Mean of the value at each frequency with those around it."""
    return uniform_filter1d(values, _LINES, mode="reflect")


# as many as a record has axes: a fit asks for the same ones again and again
@functools.lru_cache(maxsize=3)
def _of_bytes(data):
    values = np.frombuffer(data)
    count = len(values)
    length = next_fast_len(count + count // _BEYOND, real=True)
    window = np.hanning(count)
    power = np.abs(rfft(values * window, length))**2 / np.sum(window**2)
    power = mean_of_lines(power)
    power = np.maximum(power, _ROUNDING * power.max())

    def by(response):
        return LinearOperator((count, count), dtype=float, matvec=lambda v: irfft(
            response * rfft(np.ravel(v), length), length)[:count])
    covariance = by(power)
    # to 1e-5 of the record, as it does by itself; how that is asked for differs by version
    source, _ = cg(covariance, values, atol=0.0, M=by(1 / power),
                   maxiter=max(_SAMPLES // count, _ITERATIONS))
    return Stationary(power, length, source, values - covariance.matvec(source))
