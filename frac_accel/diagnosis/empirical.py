"""A filter that describes what no known cause explains."""

import dataclasses
import itertools

import numpy as np
from scipy.fft import rfft, rfftfreq

from ..errors import FracAccelError
from ..model.effects import effect_of
from ..signals.convolution import Convolution
from .gain import Gain, gain

_ORDERS = (1, 2, 3, 4, 6)
_LONGEST_SEGMENT, _SHORTEST_SEGMENT = 4096, 32
_FEWEST_SEGMENTS = 8
# Reweighted linear fits, which converge within a few.
_PASSES = 12
# A larger order must bring the error on the other segments below this share.
_CLEARLY = 0.9
# Held-out error that a description must take away to be worth having.
_WORTH = 0.02


@dataclasses.dataclass(frozen=True)
class EmpiricalFit:
    """A fitted description.

    Attributes
    ----------
    effect : EmpiricalLink or EmpiricalMap
    order : int
        Of its denominator, or the number of its knots.
    band_hz : tuple of float or None
        Where the simulated output has power; None of a map.
    gain : Gain
        On held-out samples, against the simulation as it is.
    """

    effect: object
    order: int
    band_hz: tuple | None
    gain: Gain

    @property
    def is_worth_it(self):
        """Whether it predicts held-out samples better for certain."""
        return self.gain.reduction > _WORTH and self.gain.ci95[0] > 0


def fit_empirical_link(measured, simulated, used, held_out, sampling_rate_hz):
    r"""Stable rational filter from simulated to measured output.

    The ratio of averaged spectra, :math:`H = S_{xy} / S_{xx}` with the variance
    :math:`|H|^2 (1 - \gamma^2) / (2 K \gamma^2)`, is fitted by reweighted linear least squares
    (C. K. Sanathanan, J. Koerner, *IEEE Trans. Automatic Control* 8 (1963) 56-58); unstable poles
    are mirrored. Where there is no power the filter is drawn to one. The order is the smallest that
    predicts every other segment about as well as any; only then are the held-out samples asked.

    Parameters
    ----------
    measured, simulated : ndarray, shape (n,)
        Outputs [output units].
    used, held_out : ndarray of bool, shape (n,)
        Samples that count, and those that the fit may not see.
    sampling_rate_hz : float

    Returns
    -------
    EmpiricalFit

    Raises
    ------
    FracAccelError
        If too few samples are left to learn from.
    """
    rate, learn = sampling_rate_hz, used & ~held_out
    mean = float(np.mean((measured - simulated)[learn])) if learn.any() else 0.0
    x, y = _segments(simulated, learn), _segments(measured, learn)
    if len(x) < _FEWEST_SEGMENTS:
        raise FracAccelError(f"{int(learn.sum())} samples to learn a filter from, expected "
                             f"{_FEWEST_SEGMENTS} stretches without a gap")
    every = _Response(x, y, rate)
    halves = [(_Response(x[a::2], y[a::2], rate), _Response(x[1 - a::2], y[1 - a::2], rate))
              for a in (0, 1)]
    delays = sorted({0.0, every.delay_s()}, key=abs)
    best, chosen = np.inf, None
    for how in itertools.product(_ORDERS, delays, every.weights):
        error = sum(other.error(one.fit(*how)) for one, other in halves)
        if error < (_CLEARLY if chosen else 1.0) * best:
            best, chosen = error, how
    effect = every.fit(*chosen)
    convolution = Convolution(simulated - simulated[0], rate, abs(effect.delay_s))
    s = convolution.s
    level = float(effect.transfer_function(np.zeros(1))[0].real)
    described = convolution.response(effect.transfer_function(s) * np.exp(-s * effect.delay_s)) \
        + level * simulated[0]
    again = float(np.mean((measured - described)[learn]))
    rows = used & held_out
    return EmpiricalFit(effect, chosen[0], every.band_hz,
                        gain((measured - simulated - mean)[rows],
                             (measured - described - again)[rows]))


def _segments(values, learn):
    """Stretches without a gap, shape (k, m), each without its mean, half of it overlapping: as
    long as leaves enough of them."""
    size = min(_LONGEST_SEGMENT, len(values) // (2 * _FEWEST_SEGMENTS))
    place = np.empty((0, 1), int)
    while len(place) < _FEWEST_SEGMENTS and size >= _SHORTEST_SEGMENT:
        place = np.arange(0, len(values) - size + 1, size // 2)[:, None] + np.arange(size)
        place = place[learn[place].all(axis=1)]
        size //= 2
    return values[place] - values[place].mean(axis=1, keepdims=True)


class _Response:
    """Averaged response of some segments, and fits to it."""

    def __init__(self, x, y, rate):
        size = x.shape[1]
        window = np.hanning(size)
        x, y = rfft(x * window, axis=1)[:, 1:], rfft(y * window, axis=1)[:, 1:]
        own, other = (np.mean(np.abs(v)**2, axis=0) for v in (x, y))
        shared = np.mean(np.conj(x) * y, axis=0)
        self.frequency = rfftfreq(size, 1 / rate)[1:]
        self.ratio = shared / np.maximum(own, 1e-300)
        coherence = np.clip(np.abs(shared)**2 / np.maximum(own * other, 1e-300), 1e-6, 1 - 1e-9)
        variance = np.abs(self.ratio)**2 * (1 - coherence) / (2 * len(x) * coherence)
        self.strong = own > 1e-6 * own.max()
        # what a filter of too low an order does best: what is known best, or is most of the output;
        # no better known than in a hundredth of its spread: leakage is as large
        self.weights = {"known": 1 / np.sqrt(variance + 1e-8),
                        "loud": np.sqrt(own / own.max()) * 1e4}
        self.power = own
        self.band_hz = tuple(self.frequency[self.strong][[0, -1]].tolist())

    def delay_s(self):
        """Slope of the phase over frequency, where there is power."""
        share = np.sqrt(self.power) * self.strong
        phase, wave = np.unwrap(np.angle(self.ratio)), 2 * np.pi * self.frequency
        return float(-np.sum(share * phase * wave) / np.sum(share * wave**2))

    def error(self, effect):
        """Power of what a filter leaves, over that of the output."""
        s = 2j * np.pi * self.frequency
        left = self.ratio - effect.transfer_function(s) * np.exp(-s * effect.delay_s)
        counted = self.power * self.strong
        return float(np.sum(counted * np.abs(left)**2) / np.sum(counted * np.abs(self.ratio)**2))

    def fit(self, order, delay_s, weight):
        """EmpiricalLink of an order, best where the response is `known` best, or where the motion
        is `loud`."""
        scale = self.band_hz[1]
        u = 1j * self.frequency / scale
        wanted = self.ratio * np.exp(2j * np.pi * self.frequency * delay_s)
        # where nothing is known: about one
        weight = np.where(self.strong, self.weights[weight], 1.0)
        wanted = np.where(self.strong, wanted, 1.0)
        powers = u[:, None]**np.arange(order, -1, -1)
        denominator = np.r_[1.0, np.zeros(order)]
        old = np.ones(len(u))
        for _ in range(_PASSES):
            rows = (weight / old)[:, None]
            # numerator - wanted (denominator without its leading power) = wanted u^order
            matrix = np.c_[rows * powers, -rows * wanted[:, None] * powers[:, 1:]]
            right = rows[:, 0] * wanted * powers[:, 0]
            found = _least_squares(matrix, right)
            denominator = _stable(np.r_[1.0, found[order + 1:]], self.band_hz[0] / scale)
            old = np.abs(powers @ denominator)
        rows = (weight / old)[:, None] * (old / (powers @ denominator))[:, None]
        numerator = _least_squares(rows * powers, weight * wanted)
        return effect_of("empirical_link")(tuple(numerator.tolist()), tuple(denominator.tolist()),
                                           float(scale), delay_s)


def _least_squares(matrix, right):
    """Real solution of complex equations."""
    matrix, right = np.r_[matrix.real, matrix.imag], np.r_[right.real, right.imag]
    size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return np.linalg.lstsq(matrix / size, right, rcond=1e-10)[0] / size


def _stable(polynomial, slowest):
    """The polynomial with roots right of the imaginary axis mirrored to the left, none slower than
    what was seen: a level that only such a one has is reached long after the record has begun."""
    roots = np.roots(polynomial)
    roots = roots * np.maximum(slowest / np.maximum(np.abs(roots), 1e-300), 1.0)
    roots = -np.maximum(np.abs(roots.real), 1e-4) + 1j * roots.imag
    return np.real(np.poly(roots)) if len(roots) else polynomial
