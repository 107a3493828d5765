"""How two topics belong together at all, whatever their axes: the offset of their clocks."""

import dataclasses

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

# Means that a topic is reduced to for the correlation, at most.
_MEANS = 1 << 16
# Share of the sensor's power that the reference must explain at the peak, what may be explained
# beside it, of that, or how little it may leave of what is left beside it, and how many times as
# many lags as the peak is wide must say so.
_EXPLAINED = 0.3
_BESIDE, _LEAVES = 0.6, 0.1
_WIDTHS = 40
# Axes with less power than this, of the strongest one, do not move.
_RESTS = 1e-4
# Blocks of the record that uncertainties come from, and samples that one has at least.
BLOCKS = 16
_FEWEST = 8
# Sizes of which products are still numbers, in any unit.
_SMALLEST, _LARGEST = 1e-60, 1e60
# Samples around the first guess of a lag that are tried, and their distance.
_AROUND = 8
_FINE = 0.125
# Stretches [samples] for spectra, the shortest and longest, and their number; probability with
# which what is not coherent counts; highest frequency [of the sampling rate], and
# largest coherence, which bounds what one frequency can weigh.
_SHORTEST, _LONGEST = 16, 2048
_STRETCHES = 64
_BY_CHANCE = 1e-3
_UPPER = 0.4
_MOST_COHERENT = 0.99


@dataclasses.dataclass(frozen=True)
class Offset:
    """How much later the sensor's stamps are for the same motion.

    Attributes
    ----------
    seconds, std_s : float
        Below zero: the reference's are later.
    explained : float
        Share of the sensor's power that the reference's axes explain together at that offset.
    """

    seconds: float
    std_s: float
    explained: float


def clock_offset(reference, sensor, origin_ns):
    """Offset at which two topics move alike, or None where the correlation has no clear peak.

    What all axes of the reference explain together of all of the sensor's does not depend on how
    the sensor lies.

    Parameters
    ----------
    reference, sensor : Topic
    origin_ns : int
        Any instant near the first stamps.

    Returns
    -------
    Offset or None
        To an interval of the slower topic; `refined` knows it better.
    """
    topics = reference, sensor
    starts = [(int(topic.stamps_ns[0]) - origin_ns) * 1e-9 for topic in topics]
    spans = [float(topic.stamps_ns[-1] - topic.stamps_ns[0]) * 1e-9 for topic in topics]
    interval = max(1 / min(topic.clock.rate_hz for topic in topics), max(spans) / _MEANS)
    one, two = (_means(topic, interval) for topic in topics)
    one = _whitened(one)
    moves = np.ptp(two, axis=0) > 0
    if one is None or not moves.any():
        return None
    two = two[:, moves] - two[:, moves].mean(axis=0)
    length = next_fast_len(len(one) + len(two), real=True)
    moving, answer = (rfft(values, length, axis=0) for values in (one, two))
    explained = sum(irfft(np.conj(x) * y, length)**2 for x in moving.T for y in answer.T)
    explained /= len(one) * np.sum(two**2)
    # lags in ascending order
    explained = np.r_[explained[-(len(one) - 1):], explained[:len(two)]]
    peak = int(np.argmax(explained))
    if not 0 < peak < len(explained) - 1 or not _clear(explained, peak):
        return None
    lag = peak - (len(one) - 1) + _vertex(explained[peak - 1:peak + 2])
    return Offset(float(starts[1] - starts[0] + lag * interval), interval, float(explained[peak]))


def refined(reference, sensor, valid, sampling_rate_hz, guess_s, band_hz=None):
    """Offset near a guess, from samples on the same instants.

    The delay of greatest likelihood between each of the sensor's axes and what the reference's axes
    together predict of it: the phase counts by its frequency and coherence (C. H. Knapp, G. C.
    Carter, *IEEE Trans. ASSP* 24 (1976) 320-327; "HT processor").

    Parameters
    ----------
    reference, sensor : ndarray, shape (n, 3)
    valid : ndarray of bool, shape (n,)
    sampling_rate_hz, guess_s : float
    band_hz : float, optional
        Highest frequency that counts.

    Returns
    -------
    Offset or None
        With the standard uncertainty of a jackknife over stretches of the record; None where
        nothing is coherent, the best is at the end of what is tried, or too little is left.
    """
    middle = round(guess_s * sampling_rate_hz)
    sums = products(reference, sensor, valid, np.array([middle]))
    if sums is None:
        return None
    own, shared, other = (part.sum(axis=0)[0] for part in sums)
    share = _explained(own[None], shared[None], other[None])[0]
    map_ = np.linalg.pinv(own, rcond=_RESTS, hermitian=True) @ shared
    first, last = max(0, -middle), len(valid) - max(0, middle)
    size = min(_LONGEST, max(_SHORTEST, 2 * (last - first) // (_STRETCHES + 1)))
    starts = np.linspace(first, last - size, _STRETCHES).astype(int)
    means = [_mean(values, valid) for values in (reference, sensor)]
    window = np.hanning(size)[:, None]
    cross, powers = [], []
    for start in starts:
        x, y = (np.where(valid[at:at + size, None], values[at:at + size] - mean, 0.0) * window
                for values, at, mean in zip((reference, sensor), (start, start + middle), means))
        x, y = rfft(x @ map_, axis=0), rfft(y, axis=0)
        cross.append(np.conj(x) * y)
        powers.append([np.abs(x)**2, np.abs(y)**2])
    cross, powers = np.array(cross), np.sum(powers, axis=0)
    total = cross.sum(axis=0)
    # what chance makes of so many stretches, half of each in the next one
    least = 1 - _BY_CHANCE**(2 / (min(_STRETCHES, 2 * (last - first) / size) - 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(total)**2 / (powers[0] * powers[1]))
        coherence = np.where(coherence > least, np.minimum(coherence, _MOST_COHERENT), 0.0)
        weight = np.nan_to_num(coherence / (1 - coherence) / np.abs(total))
    frequency = np.fft.rfftfreq(size, 1 / sampling_rate_hz)
    weight[(frequency > (band_hz or _UPPER * sampling_rate_hz)) | (frequency == 0)] = 0
    lags = np.arange(-_AROUND, _AROUND + _FINE / 2, _FINE)
    turn = np.exp(2j * np.pi * np.outer(lags, frequency) / sampling_rate_hz)
    curves = np.real((cross * weight).sum(axis=2) @ turn.T)
    curve = curves.sum(axis=0)
    peak = int(np.argmax(curve))
    if not 0 < peak < len(lags) - 1 or not weight.any():
        return None
    tries = []
    for one in curves:
        rest = curve - one
        at = int(np.clip(np.argmax(rest), 1, len(lags) - 2))
        tries.append(lags[at] + _FINE * _vertex(rest[at - 1:at + 2]))
    std = np.sqrt((len(starts) - 1) * np.var(tries))
    lag = middle + lags[peak] + _FINE * _vertex(curve[peak - 1:peak + 2])
    return Offset(float(lag / sampling_rate_hz), float(std / sampling_rate_hz), float(share))


def products(reference, sensor, valid, lags):
    """Sums of products by blocks of the record, for each lag [samples] of the sensor.

    Returns
    -------
    tuple of ndarray, or None
        Reference with reference, shape (blocks, 1, 3, 3), reference with sensor, shape
        (blocks, lags, 3, 3), and sensor with sensor, as the first; means are taken off.
    """
    n = len(valid)
    first, last = max(0, -int(lags[0])), n - max(0, int(lags[-1]))
    sizes = [float(np.max(np.abs(values))) for values in (reference, sensor)]
    if last - first < BLOCKS * _FEWEST or not (min(sizes) > _SMALLEST and max(sizes) < _LARGEST):
        return None
    means = [_mean(values, valid) for values in (reference, sensor)]
    lags = lags.tolist()
    edges = np.linspace(first, last, BLOCKS + 1).astype(int)
    own, shared, other = [], [], []
    for start, stop in zip(edges[:-1], edges[1:]):
        # all that any lag needs of a block: a copy of the whole record would take most memory
        part, around = (np.where(valid[rows, None], values[rows] - mean, 0.0)
                        for values, mean, rows in zip(
                            (reference, sensor), means,
                            (slice(start, stop), slice(start + lags[0], stop + lags[-1]))))
        later = [around[lag - lags[0]:][:stop - start] for lag in lags]
        middle = later[len(lags) // 2]
        own.append([part.T @ part])
        shared.append([part.T @ values for values in later])
        other.append([middle.T @ middle])
    return np.array(own), np.array(shared), np.array(other)


def _mean(values, valid):
    """Mean of the valid rows, without a copy where all are."""
    return (values if valid.all() else values[valid]).mean(axis=0)


def _explained(own, shared, other):
    """Share of the sensor's power that the reference explains, by lag."""
    power, turn = np.linalg.eigh(own[0])
    moves = power > _RESTS * power[-1]
    turned = turn[:, moves].T / np.sqrt(power[moves])[:, None]
    return np.sum((turned @ shared)**2, axis=(1, 2)) / np.trace(other[0])


def _means(topic, interval_s):
    """Means of the values about instants from the first stamp on, bridged where there are none."""
    place = np.round((topic.stamps_ns - topic.stamps_ns[0]) * (1e-9 / interval_s)).astype(np.int64)
    count = np.bincount(place)
    here = np.flatnonzero(count)
    grid = np.arange(len(count))
    # of any unit: only shares of power are asked for
    size = float(np.max(np.abs(topic.values)))
    return np.stack([np.interp(grid, here, np.bincount(place, topic.values[:, i] / size)[here]
                               / count[here]) for i in range(3)], axis=1)


def _whitened(values):
    """Orthogonal columns of unit power that span the axes that move, or None."""
    values = values - values.mean(axis=0)
    power, turn = np.linalg.eigh(values.T @ values / len(values))
    moves = power > _RESTS * power[-1]
    return values @ turn[:, moves] / np.sqrt(power[moves]) if power[-1] > 0 else None


def _clear(explained, peak):
    """Whether a peak is high, and alone."""
    low = explained < explained[peak] / 2
    before, after = np.flatnonzero(low[:peak]), np.flatnonzero(low[peak:])
    if explained[peak] < _EXPLAINED or not len(before) or not len(after):
        return False
    left, right = before[-1], peak + after[0]
    beside = max(explained[:left].max(initial=0.0), explained[right:].max())
    wide = len(explained) > _WIDTHS * (right - left)
    return wide and (beside < _BESIDE * explained[peak]
                     or 1 - explained[peak] < _LEAVES * (1 - beside))


def _vertex(three):
    """Place of a parabola's vertex through three values around a peak."""
    left, middle, right = three
    bend = left - 2 * middle + right
    return 0.5 * (left - right) / bend if bend < 0 else 0.0
