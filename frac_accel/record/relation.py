"""Which way two topics belong together at all: the offset of their clocks, whatever the axes."""

import dataclasses

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

# Means that a topic is reduced to for the correlation, at most.
_MEANS = 1 << 16
# Share of the power of whitened axes that must be common, and how much more of it than chance
# leaves at the best lag; what is left beside the peak, of it.
_COMMON = 0.3
_CHANCE = 30.0
_BESIDE = 0.6
# Axes with less power than this, of the strongest one, do not move.
_RESTS = 1e-4
# Blocks that the uncertainty comes from.
_BLOCKS = 8


@dataclasses.dataclass(frozen=True)
class Offset:
    """How much later the sensor's stamps are for the same motion.

    Attributes
    ----------
    seconds, std_s : float
        Below zero: the reference's are later. The standard uncertainty is the scatter between
        eighths of the record.
    common : float
        Largest squared correlation that a combination of axes has there.
    """

    seconds: float
    std_s: float
    common: float


def clock_offset(reference, sensor, origin_ns):
    """Offset at which two topics move alike, or None where the correlation has no clear peak.

    The axes are decorrelated first, so that a sensor that is turned shows the same peak.

    Parameters
    ----------
    reference, sensor : Topic
    origin_ns : int
        Any instant near the first stamps.

    Returns
    -------
    Offset or None
    """
    topics = reference, sensor
    starts = [(int(topic.stamps_ns[0]) - origin_ns) * 1e-9 for topic in topics]
    spans = [float(topic.stamps_ns[-1] - topic.stamps_ns[0]) * 1e-9 for topic in topics]
    interval = max(1 / min(topic.clock.rate_hz for topic in topics), max(spans) / _MEANS)
    one, two = (_whitened(_means(topic, interval)) for topic in topics)
    if one is None or two is None:
        return None
    length = next_fast_len(len(one) + len(two), real=True)
    spectra = [rfft(values, length, axis=0) for values in (one, two)]
    common = sum(irfft(np.conj(x) * y, length)**2 for x in spectra[0].T for y in spectra[1].T)
    common /= min(len(one), len(two))**2
    lags = np.r_[0:len(two), -(len(one) - 1):0]
    order = np.argsort(lags, kind="stable")
    lags, common = lags[order], common[lags[order]]
    peak = int(np.argmax(common))
    if not 0 < peak < len(common) - 1 or not _clear(common, peak, spectra, len(one) + len(two)):
        return None
    lag = lags[peak] + _vertex(common[peak - 1:peak + 2])
    std = _scatter(one, two, int(lags[peak]))
    return Offset(float(starts[1] - starts[0] + lag * interval), float(std * interval),
                  float(common[peak]))


def _means(topic, interval_s):
    """Means of the values over intervals from the first stamp on, bridged where there are none."""
    place = ((topic.stamps_ns - topic.stamps_ns[0]) * (1e-9 / interval_s)).astype(np.int64)
    count = np.bincount(place)
    here = np.flatnonzero(count)
    grid = np.arange(len(count))
    return np.stack([np.interp(grid, here, np.bincount(place, topic.values[:, i])[here]
                               / count[here]) for i in range(3)], axis=1)


def _whitened(values):
    """Orthogonal columns of unit power that span the axes that move, or None."""
    values = values - values.mean(axis=0)
    power, turn = np.linalg.eigh(values.T @ values / len(values))
    moves = power > _RESTS * power[-1]
    return values @ turn[:, moves] / np.sqrt(power[moves]) if power[-1] > 0 else None


def _clear(common, peak, spectra, samples):
    """Whether a peak is high, above chance, and alone."""
    power = [np.sum(np.abs(x)**2, axis=1) for x in spectra]
    both = power[0] * power[1]
    independent = np.sum(both)**2 / max(np.sum(both**2), 1e-300)
    # padding makes neighbouring frequencies alike
    independent *= samples / 2 / len(both) / 2
    if common[peak] < max(_COMMON, _CHANCE / independent):
        return False
    low = common < common[peak] / 2
    before, after = np.flatnonzero(low[:peak]), np.flatnonzero(low[peak:])
    rest = np.r_[common[:before[-1]] if len(before) else [],
                 common[peak + after[0]:] if len(after) else []]
    return not len(rest) or rest.max() < _BESIDE * common[peak]


def _vertex(three):
    """Place of a parabola's vertex through three values around a peak."""
    left, middle, right = three
    bend = left - 2 * middle + right
    return 0.5 * (left - right) / bend if bend < 0 else 0.0


def _scatter(one, two, lag):
    """Standard uncertainty of the lag, by blocks [intervals]."""
    first, last = max(0, -lag) + 1, min(len(one), len(two) - lag) - 1
    edges = np.linspace(first, last, _BLOCKS + 1).astype(int)
    found = []
    for start, stop in zip(edges[:-1], edges[1:]):
        x = one[start:stop]
        around = [float(np.sum((x.T @ two[start + lag + step:stop + lag + step])**2))
                  for step in (-1, 0, 1)]
        if stop - start > 4 and around[1] > 0:
            found.append(np.clip(_vertex(around), -1, 1))
    return np.std(found) / np.sqrt(len(found)) if len(found) > 1 else np.nan
