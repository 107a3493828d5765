"""What a residual holds that has nothing to do with the motion: bursts, tones, a moving offset."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import uniform_filter1d
from scipy.stats import gamma

# From median absolute value to the standard deviation of normal noise.
_NORMAL = 1.4826
# Robust standard deviations beyond which a sample is a burst (normal noise: 2e-9 of all).
_SPIKE = 6.0
# Samples in which a weaker burst is looked for, its power over the usual, and the robust standard
# deviations of the usual power's logarithm that it must stand out by.
_WINDOW = 32
_POWER = 9.0
_STANDS_OUT = 6.0
# Share of the samples that is no longer short, and samples that a level's scale is taken from.
_SHORT = 0.25
_LEVEL_SAMPLES = 50
# Parts of the record in which the scale may differ.
_PARTS = 20
# Scale, of the residual's RMS, below which no scatter is believed (values on a lattice).
_LEAST = 1e-3
# Probability of as many bursts where much moves, below which it is no chance, and share of their
# power that those have which are looked at.
_RELATED, _MATTERS = 0.005, 0.99

# Tones at most, bins of the spectrum whose median is the floor, and what the highest of n bins of
# noise exceeds its mean by more than ln n in 6 of a million records.
_TONES = 16
_FLOOR_BINS = 64
_PEAK = 12.0
# Harmonics of a reference's own tones that its nonlinear answer may have.
_HARMONICS = 10
FEW_TONES = 4
# Median amplitude of a tone along the record, of its RMS.
_LASTING = 0.5
# Courses of a tone's amplitude and phase that are tried.
LINE_COURSES = (1, 4, 12)

# Stretches in which an offset is constant, at most and at least, and the times of correlation that
# such a stretch must last.
_STRETCHES = 40
FEWEST = 8
_TIMES = 10


def scale(values, motion, used):
    """Robust standard deviation of a residual at each sample, shape (n,).

    It may differ along the record and with the size of the motion, so that what grows with the
    motion (a shock's answer) is no burst.
    """
    size = np.abs(values)
    there = size[used]
    if not len(there):
        return np.ones(len(values))
    least = _LEAST * np.sqrt(np.mean(there**2))
    envelope = _envelope(motion)
    level = np.floor(2 * np.log2(np.maximum(envelope / max(envelope.max(), 1e-300), 2.0**-12)))
    by_level, lowest, last = np.empty(len(values)), least, None
    order = np.argsort(level, kind="stable")
    edges = np.flatnonzero(np.diff(level[order])) + 1
    group = np.empty(0, int)
    for rows in np.split(order, edges):
        group = np.r_[group, rows]
        counted = group[used[group]]
        if len(counted) < _LEVEL_SAMPLES:
            continue
        lowest = max(lowest, _NORMAL * np.median(size[counted]))
        by_level[group] = lowest
        group, last = np.empty(0, int), lowest
    by_level[group] = _NORMAL * np.median(there) if last is None else last
    count = max(1, min(_PARTS, len(values) // 100))
    edges = np.linspace(0, len(values), count + 1).astype(int)
    centre, middle = [], []
    for start, stop in zip(edges[:-1], edges[1:]):
        part = size[start:stop][used[start:stop]]
        if len(part) >= _LEVEL_SAMPLES:
            centre.append((start + stop) / 2)
            middle.append(_NORMAL * np.median(part))
    if not centre:
        return np.maximum(by_level, least)
    # a part's own scale replaces the level's only where it is larger
    return np.maximum(by_level, np.interp(np.arange(len(values)), centre, middle))


def bursts(values, motion, used):
    """Samples of a residual that are short and strong, and not only where much moves.

    Parameters
    ----------
    values : ndarray, shape (n,)
        What no other part explains.
    motion : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    size = np.where(used, np.abs(values) / np.maximum(scale(values, motion, used), 1e-300), 0.0)
    found = (size > _SPIKE) & used
    if len(values) >= 8 * _WINDOW:
        # without the spikes, whose windows would all count
        power = uniform_filter1d(np.where(found, 0.0, size**2), _WINDOW)
        usual = np.log(power[used & (power > 0)] + 1e-300)
        if len(usual):
            middle = np.median(usual)
            spread = _NORMAL * np.median(np.abs(usual - middle))
            most = np.exp(middle + max(np.log(_POWER), _STANDS_OUT * spread))
            strong = power > most
            # to the ends of a burst: half of a window beyond its middle
            found |= used & (uniform_filter1d(strong.astype(float), _WINDOW // 2) > 1e-9)
    count = int(found.sum())
    if not count or count > _SHORT * used.sum():
        return np.zeros(len(values), bool)
    return np.zeros(len(values), bool) if _where_much_moves(found, size, motion, used) else found


def _where_much_moves(found, size, motion, used):
    """Whether samples lie where much moves more often than chance would have it.

    By Fisher's sum of the logarithms of the ranks from above, one of each group that matters: what
    little stands out of noise that grows with the motion says nothing of strong bursts.
    """
    envelope = _envelope(motion)
    rows = np.flatnonzero(found)
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > _WINDOW) + 1)
    power = np.array([np.sum(size[group]**2) for group in groups])
    order = np.argsort(-power)
    most = 1 + int(np.searchsorted(np.cumsum(power[order]), _MATTERS * power.sum()))
    groups = [groups[i] for i in order[:most]]
    middle = np.array([np.median(envelope[group]) for group in groups])
    above = 1 - np.searchsorted(np.sort(envelope[used]), middle) / (used.sum() + 1)
    return bool(gamma.sf(-np.sum(np.log(above)), len(groups)) < _RELATED)


def _envelope(motion):
    moving = np.abs(motion) + np.abs(np.gradient(motion))
    return np.sqrt(np.maximum(uniform_filter1d(moving**2, 9), 0.0))


def spectrum_peaks(values):
    """Peaks of a spectrum above its floor: places [bins of 1/n, fractional] and power ratios.

    Also the ratio of every bin to the floor.
    """
    n = len(values)
    power = np.abs(rfft(values * np.hanning(n)))**2
    size = min(_FLOOR_BINS, max(8, len(power) // 8))
    count = max(1, len(power) // size)
    size = min(size, len(power))
    rows = power[:count * size].reshape(count, size)
    # exponentially distributed power: median to mean
    floor = np.log(np.median(rows, axis=1) / np.log(2) + 1e-300)
    floor = np.exp(np.interp(np.arange(len(power)), (np.arange(count) + 0.5) * size, floor))
    ratio = power / np.maximum(floor, 1e-300 + 1e-24 * power.max())
    high = np.flatnonzero((ratio[1:-1] > np.log(n) + _PEAK) & (power[1:-1] > power[:-2])
                          & (power[1:-1] >= power[2:])) + 1
    left, middle, right = (np.log(power[high + k] + 1e-300) for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    place = high + np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, -1.0), 0.0)
    order = np.argsort(-power[high])
    return place[order], ratio[high][order], ratio


def tones(values, reference_ratio, reference_tones, period, used):
    """Frequencies [cycles per sample] of tones that the reference does not have.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Residual; 0 where it does not count.
    reference_ratio : ndarray, shape (n // 2 + 1,)
        The reference's spectrum over its floor, the largest of its axes.
    reference_tones : ndarray
        Frequencies of the reference's tones, where it is made of a few.
    period : int
        Of the reference [samples]; 0 where it does not repeat.
    used : ndarray of bool, shape (n,)
    """
    n = len(values)
    place, _, _ = spectrum_peaks(values)
    found = []
    for peak in place:
        near = int(round(peak))
        if near < 3 or near > n // 2 - 3:
            continue
        around = reference_ratio[max(near - 2, 0):near + 3]
        if np.max(around) > np.log(n) + _PEAK:
            continue
        if period and abs(peak * period / n - round(peak * period / n)) < min(1.5 * period / n, .3):
            continue
        if any(_folded_distance(peak / n, k * own) < 2 / n for own in reference_tones
               for k in range(1, _HARMONICS + 1)):
            continue
        frequency = _refined(values, peak / n)
        if not _lasts(values, frequency, used):
            continue
        if all(abs(frequency - other) > 3 / n for other in found):
            found.append(frequency)
        if len(found) == _TONES:
            break
    return np.array(found)


def _folded_distance(frequency, other):
    other = other % 1
    return abs(frequency - min(other, 1 - other))


def _lasts(values, frequency, used):
    """Whether a tone is there most of the time, and not the ringing of one event."""
    count = min(16, max(len(values) // 64, 4))
    edges = np.linspace(0, len(values), count + 1).astype(int)[:-1]
    turned = values * np.exp(-2j * np.pi * frequency * np.arange(len(values)))
    size = np.abs(np.add.reduceat(turned, edges)) / np.maximum(
        np.add.reduceat(used.astype(float), edges), 1)
    return np.median(size) > _LASTING * np.sqrt(np.mean(size**2))


def _refined(values, frequency):
    """Frequency by the turn of the phase between the parts of the record."""
    n, count = len(values), 8
    if n < 16 * count:
        return frequency
    turned = values * np.exp(-2j * np.pi * frequency * np.arange(n))
    sums = np.add.reduceat(turned, np.linspace(0, n, count + 1).astype(int)[:-1])
    step = np.sum(sums[1:] * np.conj(sums[:-1]))
    return frequency + float(np.clip(np.angle(step) / (2 * np.pi * n / count), -1 / n, 1 / n))


def tone_waves(frequencies):
    """Columns of `modulated`: cosine and sine of each frequency."""
    turn = 2 * np.pi * np.asarray(frequencies)

    def columns(start, stop):
        angle = np.outer(np.arange(start, stop), turn)
        return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    return columns


def slow_candidates(target, used, lowest, floor_values):
    """Predictions of an offset that moves: each stretch from its neighbours, none from itself.

    Parameters
    ----------
    target : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    lowest : float
        Lowest frequency [cycles per sample] of the excitation.
    floor_values : ndarray, shape (n,)
        What the time of correlation is taken from.

    Yields
    ------
    (int, ndarray of shape (n,))
        Number of stretches, and the prediction.
    """
    n = len(target)
    time = _correlation_time(floor_values, used)
    for count in (FEWEST, 2 * FEWEST, _STRETCHES):
        if n / count < max(_TIMES * time, 16) or (count > FEWEST and count / n > 2 * lowest):
            if count == FEWEST and n / count >= 4:
                yield count, _from_neighbours(target, used, count, _level)
            return
        for law in (_level, _curve):
            yield count, _from_neighbours(target, used, count, law)


def _correlation_time(values, used):
    """Samples over which a residual is alike, without what moves slower than the stretches."""
    n = len(values)
    high = np.where(used, values, 0.0)
    edges = np.linspace(0, n, _STRETCHES + 1).astype(int)
    for start, stop in zip(edges[:-1], edges[1:]):
        part = used[start:stop]
        if part.any():
            high[start:stop][part] -= high[start:stop][part].mean()
    spectrum = np.abs(rfft(high, next_fast_len(2 * n, real=True)))**2
    alike = irfft(spectrum, next_fast_len(2 * n, real=True))[:max(n // _STRETCHES, 2)]
    alike = alike / max(alike[0], 1e-300)
    ended = np.flatnonzero(alike < 0.1)
    # integral time up to where it has died away
    return float(np.sum(alike[:ended[0] if len(ended) else len(alike)]))


def _from_neighbours(target, used, count, law):
    """Each stretch from the means of its neighbours, by a law of these and their places."""
    n = len(target)
    edges = np.linspace(0, n, count + 1).astype(int)
    # what lies next to a stretch resembles it by chance
    centres, means = np.empty(count), np.full(count, np.nan)
    for i, (start, stop) in enumerate(zip(edges[:-1], edges[1:])):
        guard = (stop - start) // 8
        inner = slice(start + guard, stop - guard)
        centres[i] = (start + stop - 1) / 2
        if used[inner].any():
            means[i] = target[inner][used[inner]].mean()
    result = np.zeros(n)
    known = np.isfinite(means)
    for i, (start, stop) in enumerate(zip(edges[:-1], edges[1:])):
        others = known.copy()
        others[i] = False
        if others.any():
            place = (np.arange(start, stop) - centres[i]) / n
            result[start:stop] = law(place, (centres[others] - centres[i]) / n, means[others])
    return result


def _level(place, centres, means):
    """The straight line between the neighbours, in the middle."""
    return np.interp(0.0, centres, means)


def _curve(place, centres, means):
    """A parabola through the four next ones, everywhere."""
    near = np.argsort(np.abs(centres), kind="stable")[:4]
    return np.polyval(np.polyfit(centres[near], means[near], min(2, len(near) - 1)), place)
