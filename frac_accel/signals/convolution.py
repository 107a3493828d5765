"""Exact response of linear systems to a sampled, band-limited input, from rest."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

# Fall of the damped kernel over one period of the transform: what wraps around is below 1e-8
# of the response, and undoing the damping over half the period costs four of sixteen digits. A
# shorter period lets what rings ahead of full-band input come back, thirty times larger at 1.5.
_DAMPING = np.log(1e8)
# Records in one period of the transform, so that nothing wraps around.
_PERIOD = 2
# Shares of the frequencies, the highest, over which a response may be turned to be real at the
# last; samples of a record times a share from which it may be smaller than the first, and times
# the first one at least, so that what rings has faded before it comes round; and by how much over
# that product it rings in the middle of the record (the square of it): noise that ends below the
# share, a third of a sample late.
_TURNED = 0.2, 0.1, 0.05, 0.02, 0.01, 0.005
_FADED, _SHORT = 30.0, 12.0
_RINGS = 0.33
_LAGRANGE_POINTS = 8


class Convolution:
    r"""Responses of linear systems to one input, each from rest before the first sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Input.
    rate : float
        Its sampling rate [Hz].
    memory_s : float
        Time [s] by which a response may come before its cause (a negative delay), which needs
        room.
    oversampled : bool
        Whether the input has nothing near its Nyquist frequency.

    Notes
    -----
    The input is taken as band-limited, and the response is the exact convolution with it from
    rest, by the numerical Laplace transform: with damped samples :math:`a_n e^{-\sigma n T}` and
    the transfer function on the line :math:`\sigma + j\omega`, the product of the two transforms
    has no wrap-around and needs no discretisation of the derivative of order :math:`\nu`
    (D. J. Wilcox, *Int. J. Elect. Eng. Educ.* 15 (1978) 247-265). O(n log n).
    """

    def __init__(self, values, rate, memory_s=0.0, oversampled=False):
        self._n = len(values)
        self._length = _fast_length(_PERIOD * self._n + int(np.ceil(memory_s * rate)))
        self._sigma = _DAMPING / self._length
        damping = np.exp(-self._sigma * np.arange(self._n))
        self._spectrum = rfft(values * damping, self._length)
        self._undamping = np.divide(1, damping, out=damping)
        # (sigma + 2j pi k / length) rate, in place
        self._s = 2j * np.pi * np.arange(self._length // 2 + 1)
        self._s /= self._length
        self._s += self._sigma
        self._s *= rate
        turned = _TURNED[0] if oversampled else _turned(values)
        ramp = np.linspace(0, 1, len(self._s) - int((1 - turned) * len(self._s)))
        self._ramp = ramp * ramp * (3 - 2 * ramp)

    @property
    def s(self):
        """Complex frequencies [rad/s] on which a transfer function is needed."""
        return self._s

    def response(self, transfer, consumed=False):
        """Responses of systems, shape (..., n), from their transfer functions (...) at `s`.

        Where these may be `consumed`, they are overwritten, which spares a long record a copy.
        """
        if transfer.ndim > 1:
            # one after the other: of a long record, all transforms at once take most memory
            return np.stack([self.response(each, consumed) for each in transfer])
        last = transfer[-1:].copy()
        spectrum = np.multiply(self._spectrum, transfer, out=transfer if consumed else None)
        self._smooth_at_nyquist(spectrum, last)
        return irfft(spectrum, self._length)[:self._n] * self._undamping

    def response_between(self, transfer, factor, count):
        """Response at `factor` times the rate, shape (count,); `count` may exceed the input's end.

        There is nothing above the input's Nyquist frequency, and no conjugate to jump to.
        """
        spectrum = self._spectrum * transfer
        spectrum[-1] /= 2
        values = irfft(spectrum, factor * self._length)[:count]
        values *= exponentials(0.0, self._sigma / factor, count)
        values *= factor
        return values

    def _smooth_at_nyquist(self, spectrum, last):
        """Turn the phase so that `last`, the response at the Nyquist frequency, becomes real.

        In place, by a turn that grows over the last frequencies below that one (`_turned`).
        Anything else there jumps to its conjugate, and the jump rings through the record from both
        its ends with an amplitude that falls only as 1/n.
        """
        angle = np.angle(last)
        turn = (angle - np.round(angle / np.pi) * np.pi) * self._ramp
        spectrum[..., -len(self._ramp):] *= np.cos(turn) - 1j * np.sin(turn)


def exponentials(first, step, count):
    """exp(first + step k), k = 0 ... count - 1, as products of few exponentials."""
    inner = int(np.sqrt(count)) + 1
    outer = np.exp(first + step * inner * np.arange(-(-count // inner)))
    return np.outer(outer, np.exp(step * np.arange(inner))).ravel()[:count]


def refined(values, factor):
    """Band-limited samples at as many times the rate, shape (factor n,); before the first one it
    stood still there."""
    moved = Convolution(values - values[0], 1.0)
    return values[0] + moved.response_between(1.0, factor, factor * len(values))


def at_positions(values, position):
    """Values between samples, by the polynomial through the eight nearest.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least eight samples, of a signal that changes little from one to the next.
    position : ndarray, shape (m,)
        In samples from the first; those before it give the first value, those after the last
        the last.

    Returns
    -------
    ndarray, shape (m,)
    """
    position = np.clip(position, 0, len(values) - 1)
    half = _LAGRANGE_POINTS // 2
    first = np.clip(np.floor(position).astype(np.int64) - half + 1, 0,
                    len(values) - _LAGRANGE_POINTS)
    place = position - first
    return sum(weight * values[first + i] for i, weight in enumerate(_lagrange(place)))


def every(values, first, step, count):
    """As `at_positions`, at places that are a whole number of samples apart.

    Parameters
    ----------
    values : ndarray, shape (n,)
    first : float
        The first place [samples from the first one].
    step : int
        Samples from one to the next.
    count : int
        How many there are.

    Returns
    -------
    ndarray, shape (count,)
    """
    start = int(np.floor(first)) - _LAGRANGE_POINTS // 2 + 1
    # places with all their neighbours
    low, high = np.clip([-(start // step), (len(values) - _LAGRANGE_POINTS - start) // step + 1],
                        0, count)
    inside = slice(low, max(high, low))
    result = np.empty(count)
    for beyond in (slice(0, inside.start), slice(inside.stop, count)):
        result[beyond] = at_positions(values, first + step * np.arange(beyond.start, beyond.stop))
    begins, ends = start + step * inside.start, start + step * inside.stop
    result[inside] = sum(weight * values[begins + i:ends + i:step][:inside.stop - inside.start]
                         for i, weight in enumerate(_lagrange(first - start)))
    return result


def _lagrange(place):
    """Weights of neighbours at 0, 1, ..., for the value of their polynomial at a place."""
    for i in range(_LAGRANGE_POINTS):
        weight = 1.0
        for j in range(_LAGRANGE_POINTS):
            if j != i:
                weight = weight * ((place - j) / (i - j))
        yield weight


def _turned(values):
    """Share of the frequencies, the highest, over which responses to an input are turned.

    Where it has power, its response is a wrong one; the fewer they are, the farther it rings.
    """
    n = len(values)
    # of a length with a large prime factor, the transform takes four times as long
    power = np.square(np.abs(rfft((values - np.mean(values)) * np.hanning(n),
                                  next_fast_len(n, real=True))))
    above = np.cumsum(power[::-1])

    def error(share):
        return np.sqrt(above[int(share * (len(power) - 1))] / max(above[-1], 1e-300)) \
            + (_RINGS / (share * n))**2
    shares = [max(_TURNED[0], min(_SHORT / n, 1.0)),
              *(share for share in _TURNED[1:] if share * n >= _FADED)]
    return min(shares, key=error)


def _fast_length(n):
    """Even length of at least `n` that the transform is fast at."""
    return 2 * next_fast_len((n + 1) // 2, real=True)
