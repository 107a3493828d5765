"""Faults of a reference that are its own: the sensor shows nothing of what it does there."""

import numpy as np
from scipy.linalg import LinAlgError, solve_toeplitz

from ..shown import several

# Samples on either side that the filter between the two reaches, and those that say what a sample
# between them should be.
_REACH, _NEIGHBOURS = 24, 12
# Standard deviations beyond which a value counts no further when filters are fitted.
_WILD = 8.0
# Standard deviations beyond which all values are as far.
_BOUND = 1e6
# Part of the power that is added to a spectrum, so that its filters are bounded.
_FLOOR = 1e-6
# Share of the reference's standard deviation that its filter from the sensor may leave.
_ALIKE = 0.3
# Standard deviations (by the median) of what filters leave from which a sample is far out, in both
# directions.
_FAR = 8.0
# The same of what the neighbours do not say: by so much the reference must stand out, by as many
# times as much as the sensor, and as the reference itself does beside, and the sensor at most.
_JUMPS, _TIMES, _QUIET = 6.0, 3.0, 5.0
# Share of what the filter makes of the faulty samples (power) that the fault must be: a sensor that
# bends strong motion follows the most of these. Share of what the sensor lacks of the reference
# that the fault may leave, and where the reference is as good as dead, to so many times its power:
# one that bends motion, or rings on, lacks something else.
_PART, _LEAVES, _DEAD, _LEAVES_DEAD = 0.15, 0.03, 100.0, 0.3
# Samples up to which what is far out is one event, around it where the sensor must be quiet, and
# beside it where the reference shows what is usual.
_TOGETHER, _AROUND, _BESIDE = 16, 8, 50
# Samples at the largest or smallest value that make it a limit, and how near the ones beside a run
# come to it then [of the range].
_PILE, _COMES_TO = 3, 0.2
# Share of the samples above which they are no exception.
_RARE = 0.05


def glitches(reference, sensor, valid):
    """Samples at which a reference alone does what no motion does.

    Parameters
    ----------
    reference, sensor : ndarray, shape (n,)
        On the same instants.
    valid : ndarray of bool, shape (n,)

    Returns
    -------
    list of slice
        Runs of such samples.

    Notes
    -----
    A motion shows on both sides. Where neither is what a filter makes of the other, one of them is
    wrong: the one that is not what its neighbours on both sides say (best linear interpolation,
    A. Papoulis, *Signal Analysis* (1977)), while the other goes on as before. What the sensor lacks
    then is what the filter makes of the fault alone. That is not so of a jolt that a slow sensor
    smooths, and after which it rings for longer than the filter, nor of a burst that it bends.
    """
    if np.count_nonzero(valid) < 8 * (2 * _REACH + 1):
        return []
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        pair = [np.where(valid, values - np.median(values[valid]), 0.0)
                for values in (reference, sensor)]
        spreads = [_spread(values[valid]) for values in pair]
        if not (min(spreads) > 0 and np.isfinite(max(spreads))):
            return []
        # each in its own spread, whatever numbers a damaged record has
        pair = [np.clip(values / spread, -_BOUND, _BOUND)
                for values, spread in zip(pair, spreads)]
    # what is far beyond all else must not bend the filters by which it is found
    tame = [np.clip(values, -_WILD, _WILD) for values in pair]
    try:
        taps = [filter_between(tame[1 - to], tame[to], range(-_REACH, _REACH + 1)) for to in (0, 1)]
        back, there = (pair[to] - through(pair[1 - to], taps[to]) for to in (0, 1))
        alone = [_unsaid(values, of) for values, of in zip(pair, tame)]
    except LinAlgError:
        return []
    if _spread(back[valid]) > _ALIKE:
        return []
    fault, missed = back, there
    back, there, own, other = (_in_spreads(values, valid) for values in (back, there, *alone))
    far = np.flatnonzero(valid & (back > _FAR))
    if not len(far):
        return []
    faulty = np.where(back > _FAR, [fault, pair[0]], 0.0)
    found, near = [], np.zeros(len(valid), bool)
    runs = [slice(max(run[0] - 1, 0), min(run[-1] + 2, len(valid)))
            for run in np.split(far, np.flatnonzero(np.diff(far) > _TOGETHER) + 1)]
    for rows in runs:
        # as far as it makes others stand out, too
        near[max(rows.start - _NEIGHBOURS, 0):rows.stop + _NEIGHBOURS] = True
    for rows in runs:
        around = slice(max(rows.start - _AROUND, 0), rows.stop + _AROUND)
        beside = slice(max(rows.start - _BESIDE, 0), rows.stop + _BESIDE)
        as_usual = own[beside][~near[beside]]
        quiet = float(np.max(other[around]))
        if np.max(own[around]) > max(_JUMPS, _TIMES * quiet,
                                     _TIMES * np.max(as_usual, initial=0.0)) \
                and quiet < _QUIET and np.max(there[around]) > _FAR and valid[around].all() \
                and _goes_with(missed, faulty, rows, taps[1]):
            found.append(rows)
    count = sum(rows.stop - rows.start for rows in found)
    return found if count <= _RARE * len(valid) else []


def _goes_with(missed, faulty, rows, taps):
    """Whether what the sensor lacks of the reference is what a filter makes of a fault in these
    rows, and that is a good part of what it makes of the faulty samples; `faulty`: fault and
    samples."""
    around = slice(max(rows.start - _REACH, 0), rows.stop + _REACH)
    seen = missed[around]
    fault, whole = (through(_only(values, rows, around), taps)[:len(seen)] for values in faulty)
    power, of_all = np.sum(fault**2), np.sum(whole**2)
    leaves = np.sum((seen + fault)**2) / np.sum(seen**2)
    return power > _PART * of_all \
        and leaves < (_LEAVES_DEAD if power > _DEAD * of_all else _LEAVES)


def _only(values, rows, around):
    """Values around some rows, with zeros beside these."""
    part = np.zeros(around.stop - around.start)
    part[rows.start - around.start:rows.stop - around.start] = values[rows]
    return part


def is_cut_off(values, there):
    """Whether a run of samples stands at a limit to which the signal has come by itself.

    Parameters
    ----------
    values : ndarray, shape (n,)
        As published.
    there : ndarray of bool, shape (n,)
        The run.
    """
    rows = np.flatnonzero(there)
    if not len(rows):
        return False
    ends = values[np.maximum(rows[0] - 1, 0)], values[np.minimum(rows[-1] + 1, len(values) - 1)]
    return any(np.count_nonzero(values == limit) >= _PILE and (values[rows] == limit).any()
               and min(abs(end - limit) for end in ends) < _COMES_TO * np.ptp(values)
               for limit in (np.nanmin(values), np.nanmax(values)))


def glitch_words(count, seconds):
    """What is said of so many samples, in runs that begin at certain times [s]."""
    places = ", ".join(f"{at:.4g}" for at in seconds[:3]) + (" ..." if len(seconds) > 3 else "")
    return (f"the reference alone jumps where the sensor goes on as before, "
            f"{several(len(seconds), 'time')} (at {places} s): a fault of the reference; "
            f"{several(count, 'sample')} of it {'does' if count == 1 else 'do'} not count")


def _spread(values):
    """Standard deviation by the median of the distance from zero."""
    return 1.4826 * float(np.median(np.abs(values)))


def _in_spreads(values, valid):
    return np.abs(values) / max(_spread(values[valid]), np.finfo(float).tiny)


def _shared(one, two, reach):
    """Sums of products of one signal with another that is up to so many samples later."""
    n = len(one)
    return np.array([one[max(-lag, 0):n - max(lag, 0)] @ two[max(lag, 0):n - max(-lag, 0)]
                     for lag in reach])


def _own(values, count):
    """A signal's products with itself at so many lags, with the floor that bounds its filters."""
    own = _shared(values, values, range(count))
    own[0] *= 1 + _FLOOR
    return own


def filter_between(values, target, lags):
    """Filter of least squares from one signal to another, at successive lags."""
    return solve_toeplitz(_own(values, len(lags)), _shared(values, target, lags))


def _unsaid(values, tame):
    """What the samples on both sides do not say of the one between them."""
    count = 2 * _NEIGHBOURS + 1
    # a row of the inverse covariance is the error of interpolation but for a factor
    inverse = solve_toeplitz(_own(tame, count), np.arange(count) == _NEIGHBOURS)
    return through(values, inverse / inverse[_NEIGHBOURS])


def through(values, taps):
    """A signal behind a filter whose middle tap is without delay."""
    return np.convolve(values, taps)[len(taps) // 2:][:len(values)]
