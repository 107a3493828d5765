"""A filter that describes what no known cause explains."""

import dataclasses
import itertools

import numpy as np
from scipy.fft import rfft, rfftfreq

from ..budget.blocks import Blocks
from ..budget.filters import Filters, can_be_judged, lag_step
from ..errors import FracAccelError
from ..model.effects import effect_of
from ..signals.convolution import Convolution
from .gain import Gain, gain
from .rational import fit_rational

_ORDERS = (1, 2, 3, 4, 6, 8, 12, 16)
# Lags of the filters, the first and the last; where the power of both signals ends, and lags in a
# cycle there.
_LAGS = ((-4, 8), (-16, 32), (-48, 96), (-96, 192))
_HIGHEST, _FASTER = 0.999, 4
# Shares of their energy at which weights begin, and a response's power over the largest from which
# it is known.
_BEGINS = (1e-4, 1e-2)
_STRONG = 1e-6
# Size of a pole over the highest frequency, and its least damping over the highest of the band.
_FASTEST, _LEAST_DAMPING = 4.0, 1e-4
_LONGEST_SEGMENT, _SHORTEST_SEGMENT = 4096, 32
_FEWEST_SEGMENTS = 8
# A larger order must bring the error on the other segments below this share.
_CLEARLY = 0.9
# And so must weights over more samples than those that are known.
_LONGER = 0.95
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

    Two responses are fitted: the ratio of averaged spectra, :math:`H = S_{xy} / S_{xx}` with the
    variance :math:`|H|^2 (1 - \gamma^2) / (2 K \gamma^2)`, which resolves what rings for long, and
    that of the weights of a filter of so many samples before and after, by least squares, which
    needs no stretches without a gap. A filter that looks ahead becomes a lead and a rational filter
    that is as late. Where there is no power both are drawn to one. The order is the smallest that
    does about as well on what it was not fitted to; only then are the held-out samples asked.

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
    found = [fit for fit in (_by_spectra(measured, simulated, learn, rate),
                             _by_lags(measured, simulated, learn, rate)) if fit is not None]
    if not found:
        raise FracAccelError(f"{int(learn.sum())} samples to learn a filter from, expected "
                             f"{_FEWEST_SEGMENTS} stretches without a gap")
    best, least = None, np.inf
    for order, effect, band_hz in found:
        described = _described(effect, simulated, rate)
        errors = measured - described - float(np.mean((measured - described)[learn]))
        left = float(np.std(errors[learn]))
        if left < (_LONGER if best else 1.0) * least:
            least, best = left, (effect, order, band_hz, errors)
    rows = used & held_out
    mean = float(np.mean((measured - simulated)[learn]))
    return EmpiricalFit(*best[:3], gain((measured - simulated - mean)[rows], best[3][rows]))


def _described(effect, simulated, rate):
    """Simulated output through a filter; before the first sample it stood still there."""
    convolution = Convolution(simulated - simulated[0], rate, abs(effect.delay_s))
    s = convolution.s
    level = float(effect.transfer_function(np.zeros(1))[0].real)
    return convolution.response(effect.transfer_function(s) * np.exp(-s * effect.delay_s)) \
        + level * simulated[0]


def _by_spectra(measured, simulated, learn, rate):
    """Order, effect and band by averaged spectra; None without enough segments."""
    x, y = _segments(simulated, learn), _segments(measured, learn)
    if len(x) < _FEWEST_SEGMENTS:
        return None
    every = _Response(x, y, rate)
    halves = [(_Response(x[a::2], y[a::2], rate), _Response(x[1 - a::2], y[1 - a::2], rate))
              for a in (0, 1)]
    delays = sorted({0.0, every.delay_s()}, key=abs)
    best, chosen = np.inf, None
    for how in itertools.product(_ORDERS, delays, every.weights):
        error = sum(other.apart(one.fit(*how)) for one, other in halves)
        if error < (_CLEARLY if chosen else 1.0) * best:
            best, chosen = error, how
    return chosen[0], every.fit(*chosen), every.band_hz


def _by_lags(measured, simulated, learn, rate):
    """Order, effect and band by least squares over lags; None where no length has enough samples,
    or none predicts what it was not fitted to."""
    x, y = (values - float(np.mean(values[learn])) for values in (simulated, measured))
    blocks, step = Blocks.of(np.where(learn, x, 0.0)), lag_step((x, y), learn, _HIGHEST, _FASTER)
    best, chosen = 1.0, None
    for span in _LAGS:
        size = span[1] - span[0] + 1
        if not can_be_judged(blocks, learn, size, size, step):
            break
        weights, left = Filters([x], [span], blocks, learn, step).learnt(y)
        if left < (_LONGER**2 if chosen else 1.0) * best:
            best, chosen = left, (span, weights)
    if chosen is None:
        return None
    return _Lags(x, *chosen, step / rate, 1 / rate).fit(best)


class _Known:
    """A response by frequency, with the power of what it answers to."""

    def __init__(self, frequency, ratio, power):
        self.frequency, self.ratio, self.power = frequency, ratio, power
        self.strong = power > _STRONG * power.max()
        self.band_hz = tuple(frequency[self.strong][[0, -1]].tolist())

    def apart(self, effect):
        """Power by which a filter's output is another one, over that of the output."""
        s = 2j * np.pi * self.frequency
        left = self.ratio - effect.transfer_function(s) * np.exp(-s * effect.delay_s)
        counted = self.power * self.strong
        return float(np.sum(counted * np.abs(left)**2) / np.sum(counted * np.abs(self.ratio)**2))

    def nearest(self, order, delay_s, weight, least_damping_hz, slowest_hz):
        """EmpiricalLink of an order and a delay that comes nearest; where nothing is known, it is
        drawn to one."""
        scale, wanted = self.band_hz[1], np.where(self.strong, self.ratio, 1.0)
        numerator, denominator = fit_rational(
            1j * self.frequency / scale, wanted * np.exp(2j * np.pi * self.frequency * delay_s),
            weight, order, least_damping_hz / scale,
            (slowest_hz / scale, _FASTEST * self.frequency[-1] / scale))
        return effect_of("empirical_link")(tuple(numerator.tolist()), tuple(denominator.tolist()),
                                           float(scale), delay_s)


class _Lags(_Known):
    """A filter of so many samples before and after, and rational ones like it."""

    def __init__(self, x, span, weights, lag_s, interval_s):
        self.lags_s = np.arange(span[0], span[1] + 1) * lag_s
        self.weights = weights
        # what is slower than all of it counts, too
        frequency = np.linspace(0, 0.5 / lag_s, 2 * len(weights))
        frequency[0] = frequency[1] / 100
        power = np.abs(rfft(x * np.hanning(len(x))))**2
        edges = (np.r_[0.0, frequency] + np.r_[frequency, frequency[-1]]) / 2
        edges = np.clip(edges * len(x) * interval_s, 0, len(power) - 1)
        super().__init__(
            frequency, np.exp(-2j * np.pi * np.outer(frequency, self.lags_s)) @ weights,
            np.array([power[int(a):int(b) + 1].mean() for a, b in zip(edges, edges[1:])]))

    def delays_s(self):
        """No delay, and those at which the weights begin."""
        so_far = np.cumsum(self.weights**2)
        return sorted({0.0, *(float(self.lags_s[np.searchsorted(so_far, share * so_far[-1])])
                              for share in _BEGINS)}, key=abs)

    def fit(self, left):
        """Order, effect and band of the smallest order that is about as good as the filter itself,
        which leaves a share of the power; or as any."""
        weight = np.sqrt(np.where(self.strong, self.power / self.power.max(), _STRONG))
        best, chosen, fades_hz = np.inf, None, 1 / (2 * np.pi * np.ptp(self.lags_s))
        for order, delay_s in itertools.product(_ORDERS, self.delays_s()):
            effect = self.nearest(order, delay_s, weight, fades_hz, fades_hz)
            error = left + self.apart(effect)
            if error < (_CLEARLY**2 if chosen else 1.0) * best:
                best, chosen = error, (order, effect, self.band_hz)
            if best * _CLEARLY**2 < left:
                break
        return chosen


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


class _Response(_Known):
    """Averaged response of some segments, and fits to it."""

    def __init__(self, x, y, rate):
        size = x.shape[1]
        window = np.hanning(size)
        x, y = rfft(x * window, axis=1)[:, 1:], rfft(y * window, axis=1)[:, 1:]
        own, other = (np.mean(np.abs(v)**2, axis=0) for v in (x, y))
        shared = np.mean(np.conj(x) * y, axis=0)
        super().__init__(rfftfreq(size, 1 / rate)[1:], shared / np.maximum(own, 1e-300), own)
        coherence = np.clip(np.abs(shared)**2 / np.maximum(own * other, 1e-300), 1e-6, 1 - 1e-9)
        variance = np.abs(self.ratio)**2 * (1 - coherence) / (2 * len(x) * coherence)
        # what a filter of too low an order does best: what is known best, or is most of the output;
        # no better known than in a hundredth of its spread: leakage is as large
        self.weights = {"known": 1 / np.sqrt(variance + 1e-8),
                        "loud": np.sqrt(own / own.max()) * 1e4}

    def delay_s(self):
        """Slope of the phase over frequency, where there is power."""
        share = np.sqrt(self.power) * self.strong
        phase, wave = np.unwrap(np.angle(self.ratio)), 2 * np.pi * self.frequency
        return float(-np.sum(share * phase * wave) / np.sum(share * wave**2))

    def fit(self, order, delay_s, weight):
        """EmpiricalLink of an order, best where the response is `known` best, or where the motion
        is `loud`."""
        return self.nearest(order, delay_s, np.where(self.strong, self.weights[weight], 1.0),
                            _LEAST_DAMPING * self.band_hz[1], self.band_hz[0])
