"""Values at other instants: band-limited, without aliases, whatever the ratio of the rates.

`scipy.signal` and `scipy.interpolate` are imported where they are used: most records need neither.
"""

import functools

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ..signals.convolution import exponentials
from .clock import merged

# Highest frequency that is kept, and lowest that is gone, of the rate that is asked for: what lies
# between is folded to above the band. Attenuation [dB] and Kaiser's shape for it.
BAND = 0.4
_GONE = 0.6
_ATTENUATION_DB = 80.0
_KAISER = 0.1102 * (_ATTENUATION_DB - 8.7)
# Half-width of the filter [intervals of the rate that is asked for].
REACH = int(np.ceil((_ATTENUATION_DB - 7.95) / (2.285 * 2 * np.pi * (_GONE - BAND)) / 2))
# Share of a band that is kept where nothing beyond it may count, lines on which the filter's
# response is known, and its half-width [periods of the band's edge].
_INNER = 0.8
_LINES = 8192
_INNER_TAPS = (_ATTENUATION_DB - 7.95) / (2.285 * 2 * np.pi * (1 - _INNER)) / 2
# Half-width of the filter by which what is missing of one signal is guessed from the other, samples
# that are enough to fit it to, and share of the power that it may leave.
_GUESSED_TAPS, _GUESSED_ROWS, _GUESSED_LEFT = 16, 20_000, 0.1
# Steps by which samples are bridged, and share of what they leave beyond the band (power) from
# which there are no more.
_STEPS, _BRIDGED = 12, 1e-6
# Oversampling at which a spline of degree 5 is wrong by 1e-4 at the band's edge.
_OVERSAMPLED = 2.2
_DEGREE = 5
# Samples that are worked on at once, and half-width of what a spline depends on.
_BLOCK = 1 << 16
_MARGIN = 24
# Distance [intervals of the rate that is asked for] up to which a missing sample shows, and a gap
# of half such an interval or more.
_TOUCHED = 1.5
_TOUCHED_LONG = 6.0
# Share of the instants far from long gaps that must be far from short ones, for these to count.
_CLEAR = 0.5
# Samples in a row that a spline bridges; a longer gap is crossed by a straight line.
_SPLINED = 2


def band_limited(values, rate_hz, start_s, target_hz, target_start_s, count):
    """Uniform samples at other uniform instants.

    A low-pass filter of linear phase without delay (Kaiser's window method: A. V. Oppenheim,
    R. W. Schafer, *Discrete-Time Signal Processing*, 3rd ed., section 7.6) and a spline of degree 5
    through its oversampled output.

    Parameters
    ----------
    values : ndarray, shape (n, m)
    rate_hz, start_s : float
        Rate and instant of the first sample.
    target_hz, target_start_s : float
        Wanted ones; the band kept is `BAND` of the lower rate.
    count : int

    Returns
    -------
    ndarray, shape (count, m)
        Meaningless closer than `REACH` intervals of the lower rate to the ends of `values`.
    """
    from scipy.ndimage import map_coordinates
    from scipy.signal import firwin, oaconvolve, resample_poly
    lower = min(rate_hz, target_hz)
    up = int(np.ceil(_OVERSAMPLED * lower / rate_hz))
    half = int(np.ceil(REACH * up * rate_hz / lower))
    taps = firwin(2 * half + 1, (BAND + _GONE) / 2 * lower, window=("kaiser", _KAISER),
                  fs=up * rate_hz)
    reach = -(-half // up) + _MARGIN
    # outputs of one block, so that little is in memory at a time
    block = max(1, int(max(_BLOCK, 8 * reach) * target_hz / rate_hz))
    result = np.empty((count, values.shape[1]))
    means = values.mean(axis=0)
    moving = np.ptp(values, axis=0) > 0
    result[:] = means
    for first in range(0, count, block):
        rows = np.arange(first, min(first + block, count))
        place = (target_start_s + rows / target_hz - start_s) * rate_hz
        low = max(int(place[0]) - reach, 0)
        part = slice(low, max(int(place[-1]) + reach + 1, low + 1))
        for axis in np.flatnonzero(moving):
            x = values[part, axis] - means[axis]
            fine = resample_poly(x, up, 1, window=taps) if up > 1 else \
                oaconvolve(x, taps, mode="full")[half:half + len(x)]
            result[rows, axis] += map_coordinates(fine, [(place - low) * up], order=_DEGREE,
                                                  mode="nearest")
    return result


def inner_taps(rate_hz, band_hz, count):
    """The filter by which `within` leaves out what is beyond a band of so many samples."""
    from scipy.signal import firwin
    half = min(int(np.ceil(_INNER_TAPS * rate_hz / band_hz)), count - 1)
    return firwin(2 * half + 1, inner_edge(band_hz), window=("kaiser", _KAISER), fs=rate_hz)


def inner_edge(band_hz):
    """Frequency [Hz] at which half of the amplitude is left."""
    return (1 + _INNER) / 2 * band_hz


def taken_away(rate_hz, band_hz, count, frequencies_hz):
    """Share of the power at some frequencies, shape (m,), that it leaves out; all of what no signal
    of that rate can have."""
    from scipy.signal import freqz
    lines_hz, response = freqz(inner_taps(rate_hz, band_hz, count), worN=_LINES, fs=rate_hz)
    return 1 - np.interp(frequencies_hz, lines_hz, np.abs(response)**2, right=0.0)


def inner_filter(rate_hz, band_hz, count, every=1):
    """The same as a function of so many samples, without delay; of what it leaves, which is slow,
    each so many-th sample is enough. These may be taken `late`, by a part of a sample."""
    half, length, transfer = _inner_transfer(rate_hz, band_hz, count, every)

    def inside(values, late=0.0):
        # an odd reflection at both ends
        longer = np.zeros(length * every)
        first, behind = half + count, min(half, count - 1)
        longer[half:first] = values
        longer[half - behind:half] = 2 * values[0] - values[behind:0:-1]
        longer[first:first + behind] = 2 * values[-1] - values[-2:-2 - behind:-1]
        lines = rfft(longer)[:len(transfer)]
        lines *= transfer
        if late:
            lines *= exponentials(0.0, -2j * np.pi * late / len(longer), len(lines))
        return irfft(lines, length)[half // every:][:-(-count // every)]
    return inside


@functools.lru_cache(maxsize=8)
def _inner_transfer(rate_hz, band_hz, count, every):
    """Half-width of that filter, a multiple of `every`; samples of what comes out of a transform
    that holds it with the reflections at both ends; and its response on the lines of these."""
    taps = inner_taps(rate_hz, band_hz, count)
    reach = len(taps) // 2
    half = -(-reach // every) * every
    length = next_fast_len(-(-(count + 2 * half) // every), real=True)
    centred = np.zeros(length * every)
    centred[:reach + 1], centred[len(centred) - reach:] = taps[reach:], taps[:reach]
    # symmetric, so that its response is real
    return half, length, rfft(centred)[:length // 2 + 1].real / every


def within(values, rate_hz, band_hz, unknown):
    """Uniform samples without what is beyond a band, by a filter of linear phase without delay.

    Parameters
    ----------
    values : ndarray, shape (n,)
    rate_hz, band_hz : float
    unknown : ndarray of bool, shape (n,)
        Samples whose values are a guess, from which they are changed so that least of all is beyond
        the band.

    Returns
    -------
    ndarray, shape (n,)
    """
    inside = inner_filter(rate_hz, band_hz, len(values))
    return inside(_bridged(values, unknown, _beyond(inside)))


def guessed(values, other, unknown, inside):
    """Values of which some are unknown, these so that within a band they differ least from what a
    short filter of another signal has there, which fits the rest.

    Where the two share too little, so that least of the values is beyond the band.

    Parameters
    ----------
    values, other : ndarray, shape (n,)
    unknown : ndarray of bool, shape (n,)
    inside : callable
        The filter that keeps the band (`inner_filter`).

    Returns
    -------
    ndarray, shape (n,)
    """
    from scipy.signal import fftconvolve
    if not unknown.any() or unknown.all():
        return values
    place, known = np.arange(len(values)), np.flatnonzero(~unknown)
    mean, other = values[known].mean(), other - other.mean()
    values = np.interp(place, known, values[known])
    moving, kept = inside(values) - mean, inside(other)
    shared = np.abs(fftconvolve(np.where(unknown, 0.0, moving), kept[::-1]))
    lags = np.argmax(shared) - len(other) + 1 + np.arange(-_GUESSED_TAPS, _GUESSED_TAPS + 1)
    rows = known[::max(len(known) // _GUESSED_ROWS, 1)]
    columns = np.take(kept, rows[:, None] - lags, mode="clip")
    taps, *_ = np.linalg.lstsq(columns, moving[rows], rcond=1e-6)
    if not np.var(moving[rows] - columns @ taps) < _GUESSED_LEFT * np.var(moving[rows]):
        return _bridged(values, unknown, _beyond(inside))
    alike = mean + sum(tap * np.take(other, place - lag, mode="clip")
                       for tap, lag in zip(taps, lags))
    return alike + _bridged(np.where(unknown, 0.0, values - alike), unknown, inside)


def _beyond(inside):
    """What a filter takes away."""
    return lambda values: values - inside(values)


def _bridged(values, missing, part):
    """Values, where some are missing changed so that least of all is in a part of the band.

    Least squares by conjugate gradients, of which there are few, as long gaps are not determined
    (after A. Papoulis, *IEEE Trans. Circuits Syst.* 22 (1975) 735-742).
    """
    def twice(values):
        return part(part(values))[missing]
    change, step = np.zeros(missing.sum()), -twice(values)
    residual, power = step, step @ step
    enough = _BRIDGED * power
    for _ in range(_STEPS):
        if power <= enough:
            break
        full = np.zeros(len(values))
        full[missing] = step
        curved = twice(full)
        size = power / (step @ curved)
        change, residual = change + size * step, residual - size * curved
        power, before = residual @ residual, power
        step = residual + power / before * step
    values = values.copy()
    values[missing] += change
    return values


def untouched(present, rate_hz, start_s, target_hz, target_start_s, count):
    """Whether each wanted instant is far enough from samples that are not present.

    A gap of less than half an interval of the rate that is asked for is bridged by a spline; where
    there are so many that they would leave little, they do not count.
    """
    if present.all():
        return np.ones(count, bool)
    interval = rate_hz / min(rate_hz, target_hz)
    place = (target_start_s + np.arange(count) / target_hz - start_s) * rate_hz
    edges = np.flatnonzero(np.diff(np.r_[True, present, True].astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    long = stops - starts > interval / 2
    free = []
    for which, intervals in ((~long, _TOUCHED), (long, _TOUCHED_LONG)):
        gaps = starts[which] - intervals * interval, stops[which] - 1 + intervals * interval
        # no more gaps begin before an instant than have ended
        free.append(np.searchsorted(gaps[0], place) == np.searchsorted(gaps[1], place))
    clear = free[0] & free[1]
    # where few instants are left, those count that only lie near single samples that are missing
    return clear if clear.sum() > _CLEAR * free[1].sum() else free[1]


def filled(slot, values):
    """Values on all whole instants from the first slot to the last, and which of them are present.

    Parameters
    ----------
    slot : ndarray of whole numbers, shape (n,), ascending
    values : ndarray, shape (n, 3)
    """
    if len(slot) == slot[-1] - slot[0] + 1 and np.all(np.diff(slot) == 1):
        return values, np.ones(len(slot), bool)
    first = np.r_[True, np.diff(slot) > 0]
    slot, values = slot[first], values[first]
    place = (slot - slot[0]).astype(np.int64)
    present = np.zeros(place[-1] + 1, bool)
    present[place] = True
    missing = np.flatnonzero(~present)
    result = np.empty((len(present), values.shape[1]))
    result[place] = values
    steps = np.diff(place)
    long = np.repeat(steps - 1 > _SPLINED, np.maximum(steps - 1, 0))
    if len(missing):
        from scipy.interpolate import CubicSpline
        result[missing] = CubicSpline(place, values)(missing)
        result[missing[long]] = np.stack(
            [np.interp(missing[long], place, values[:, i]) for i in range(values.shape[1])], 1)
    return result, present


def on_grid(seconds, values, rate_hz):
    """Values with uneven stamps on a uniform grid from the first stamp on.

    A cubic spline by stamps, after those that are almost the same have become one.

    Returns
    -------
    values : ndarray, shape (m, 3)
    present : ndarray of bool, shape (m,)
        False within gaps of more than three of the longer steps.
    """
    from scipy.interpolate import CubicSpline
    seconds, values = merged(seconds, values)
    steps = np.diff(seconds)
    grid = seconds[0] + np.arange(int((seconds[-1] - seconds[0]) * rate_hz) + 1) / rate_hz
    wide = steps > 3 * np.percentile(steps, 95)
    within = np.clip(np.searchsorted(seconds, grid, side="right") - 1, 0, len(steps) - 1)
    result = CubicSpline(seconds, values)(grid)
    gap = wide[within]
    if gap.any():
        result[gap] = np.stack([np.interp(grid[gap], seconds, values[:, i])
                                for i in range(values.shape[1])], 1)
    return result, ~gap
