"""Filters of several inputs, fitted to a residual by least squares and judged by other blocks."""

from itertools import groupby

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import CubicSpline
from scipy.linalg.lapack import dposv
from scipy.signal import oaconvolve

from .blocks import FOLDS

# Ridges, of the products of inputs scaled to the same size: what the excitation hardly holds must
# not be fitted to noise.
_RIDGES = (1e-9, 1e-6, 1e-4, 1e-2)
# And where the target is free of noise.
_NO_NOISE = 1e-12
# Products that are worked out at once, and lags from which transforms are faster.
_TOGETHER, _MANY_LAGS = 1 << 19, 100
# Samples that are enough to learn from: of longer records, the first part of each block.
_ENOUGH = 150_000
# Counted samples for each coefficient, and the fewest that are left where lags are longer.
SAMPLES = 10
_FEWEST = 1000


def lag_step(signals, used, highest, faster):
    """Samples of a lag: more than one where signals, each of mean 0, are far slower than that.

    Parameters
    ----------
    signals : sequence of ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    highest : float
        Share of their power up to which they have frequencies.
    faster : float
        Lags in a cycle there.
    """
    n, top = len(used), 0.0
    for values in signals:
        energy = np.cumsum(np.abs(rfft(values * used * np.hanning(n)))**2)
        top = max(top, np.searchsorted(energy, highest * energy[-1]) / n)
    return int(np.clip(1 / (faster * max(top, 1e-9)), 1, max(n // _FEWEST, 1)))


def can_be_judged(blocks, used, coefficients, span, step):
    """Whether a record is long enough for a filter of so many coefficients that spans so many
    lags."""
    return coefficients * SAMPLES * step <= used.sum() and (
        span <= 1 or 2 * span * step <= blocks.shortest * len(blocks) / FOLDS)


class Filters:
    r"""Prediction :math:`p_t = \sum_i \sum_k h_{ik} u_{i,t-k}` of a residual.

    The products of the shifted inputs over a run of samples follow from their first row and column:
    :math:`G_{j+1,k+1} = G_{jk} + a_{s-1-j} b_{s-1-k} - a_{e-1-j} b_{e-1-k}` for the run from s to e
    (covariance method; L. Ljung, *System Identification*, 2nd ed., 1999, section 10.1), so that
    they cost no more than the shifts do.

    Parameters
    ----------
    inputs : list of ndarray, shape (n,)
    lags : list of (int, int)
        First and last lag of each input [samples]; negative ones look ahead.
    blocks : Blocks
    used : ndarray of bool, shape (n,)
        Samples that count.
    step : int
        Lags count in so many samples, where the inputs are that much slower than the record.
        Inputs and residual are then smoothed alike before every step-th sample is taken, which
        leaves the filter between them as it is.
    """

    def __init__(self, inputs, lags, blocks, used, step=1):
        self._step, self._all = step, used
        self._lags = lags
        self._outputs = _groups(lags, [values[::step] for values in inputs])
        if step > 1:
            blocks = blocks.thinned(step)
            inputs = [_thinned(values, step) for values in inputs]
            used = used[::step]
        self._blocks, self._used = blocks, used
        # what the weights are applied to is not smoothed
        self._inputs = self._outputs if step == 1 else _groups(lags, inputs)
        self._guard = max(high - low for low, high in lags)
        self.size = sum(high - low + 1 for low, high in lags)
        # what lies before the record and after it is not known
        self._first = max(0, *(high for _, high in lags))
        self._last = blocks.n + min(0, *(low for low, _ in lags))
        # long filters need long blocks between their guards
        self._blocks = blocks = blocks.coarser(2 * self._guard)
        self._learnt = [self._within(0, blocks.n)]
        self._runs = [self._within(*blocks.guarded(block, self._guard))
                      for block in range(len(blocks))]
        if blocks.n > _ENOUGH:
            share = _ENOUGH / blocks.n
            self._learnt = self._runs = [self._within(start, start + int(share * (stop - start)))
                                         for _, start, stop in blocks]
        self._unseen = self._grams(self._runs, FOLDS)
        self._whole = self._unseen.sum(axis=0) if self._learnt is self._runs \
            else self._grams(self._learnt, 1)[0]

    def _within(self, start, stop):
        return min(max(start, self._first), self._last), max(min(stop, self._last), self._first)

    def predict(self, target, left_out=None):
        """Prediction of each block by the filter that the others outside its guards give.

        Parameters
        ----------
        target : ndarray, shape (n,)
        left_out : ndarray of bool, shape (n,), optional
            Further samples that do not count.

        Returns
        -------
        ndarray, shape (n,)
        """
        if self._step > 1:
            counted = self._all if left_out is None else self._all & ~left_out
            values = self._slower(target, counted)
            result = self._predict(values, None if left_out is None else left_out[::self._step])
            return _thickened(result, self._step, len(target))
        return self._predict(target, left_out)

    def learnt(self, target):
        """The weights that all counted samples give, shape (size,), and the share of the target's
        power that those of the folds leave of what they have not seen."""
        values = np.where(self._used, self._slower(target, self._all), 0.0)
        judged, whole = self._products_with(values)
        _, ridge, gained = self._best_weights(self._whole, self._unseen, whole, judged)
        power = sum(np.sum(values[start:stop]**2) for start, stop in self._runs)
        return Normal(self._whole, whole).solve(ridge), 1 - gained / max(power, 1e-300)

    def passed(self, target, others):
        """Other signals through the filter of the first input that fits a target best.

        Parameters
        ----------
        target : ndarray, shape (n,)
        others : list of ndarray, shape (n,)

        Returns
        -------
        list of ndarray, shape (n,)
        """
        step, span = self._step, self._lags[0]
        values = np.where(self._all, target, 0.0)
        values = _thinned(values, step) if step > 1 else values
        right = self._rights(values, self._learnt).sum(axis=0)
        taps = Normal(self._whole, right).solve(_NO_NOISE)[:span[1] - span[0] + 1]
        result = []
        for other in others:
            other = _thinned(other, step) if step > 1 else other
            run = _moving(other[None], span, np.zeros(1, int), len(other))[0, 0]
            through = oaconvolve(run, taps, "valid")
            result.append(_thickened(through, step, len(target)) if step > 1 else through)
        return result

    def _predict(self, target, left_out):
        used, gram, unseen = self._used, self._whole, self._unseen
        if left_out is not None and left_out.any():
            used = used & ~left_out
            total, by_fold = self._products_of(np.flatnonzero(left_out & self._used))
            gram, unseen = gram - total, unseen - by_fold
        values = np.where(used, target, 0.0)
        judged, whole = self._products_with(values)
        best = self._held_out(self._best_weights(gram, unseen, whole, judged)[0])
        for edge in (slice(0, self._first), slice(self._last, None)):
            if np.sum(((2 * values - best) * best * used)[edge]) < 0:
                best[edge] = 0.0
        return best

    def _slower(self, target, counted):
        """Every step-th sample of a target, smoothed as the inputs are."""
        if self._step == 1:
            return target
        return _thinned(np.where(counted, target, 0.0), self._step) \
            / np.maximum(_thinned(counted.astype(float), self._step), 1e-3)

    def _products_with(self, values):
        """Products of the inputs with a target: by the folds that judge them, and of all."""
        rights = self._rights(values, self._runs)
        judged = np.array([rights[fold::FOLDS].sum(axis=0) for fold in range(FOLDS)])
        return judged, judged.sum(axis=0) if self._learnt is self._runs \
            else self._rights(values, self._learnt)[0]

    def _best_weights(self, gram, unseen, whole, judged):
        """Weights of each fold, by the ridge that takes most from what they have not seen; that
        ridge, and what is taken."""
        best, chosen, most = None, _RIDGES[0], -np.inf
        normal = [Normal(gram - other, whole - right) for other, right in zip(unseen, judged)]
        for ridge in _RIDGES:
            weights = [equations.solve(ridge) for equations in normal]
            gain = sum(2 * w @ right - w @ other @ w
                       for w, right, other in zip(weights, judged, unseen))
            if gain <= most:
                break
            best, chosen, most = weights, ridge, gain
        return best, chosen, most

    def _held_out(self, weights):
        """Each block's output of the filter that the others give."""
        result = np.zeros(self._blocks.n)
        edges = self._blocks.edges
        for rows, length in _alike(edges[:-1], edges[1:]):
            starts, stops = edges[:-1][rows], edges[1:][rows]
            total = np.zeros((len(rows), length))
            for span, inputs, columns in self._outputs:
                taps = np.array([weights[block % FOLDS][columns] for block in rows])
                _add_output(total, taps.reshape(len(rows), len(inputs), -1),
                            _moving(inputs, span, starts, length))
            for values, start, stop in zip(total, starts, stops):
                result[start:stop] = values[:stop - start]
        return result

    def _grams(self, runs, folds):
        """Products of all shifted inputs over the samples of runs that count, added up by folds."""
        total = np.zeros((folds, self.size, self.size))
        together = max(_TOGETHER // self.size**2, 1)
        for first in range(0, len(runs), together):
            some = [(place % folds, *run) for place, run in enumerate(runs)
                    if first <= place < first + together and run[1] > run[0]]
            if some:
                fold, starts, stops = np.array(some).T
                for place, gram in zip(fold, self._products(starts, stops)):
                    total[place] += gram
        return total

    def _products(self, starts, stops):
        """Products of all shifted inputs over the samples of each run that count, shape (runs,
        size, size)."""
        grams = np.empty((len(starts), self.size, self.size))
        for rows, length in _alike(starts, stops):
            own = starts[rows], stops[rows]
            fixed = [_fixed(inputs, span[0], *own, length) for span, inputs, _ in self._inputs]
            moving = [_moving(inputs, span, own[0], length) for span, inputs, _ in self._inputs]
            for i, one in enumerate(self._inputs):
                for j, other in enumerate(self._inputs[i:], start=i):
                    first = _sums(fixed[i], moving[j])
                    column = first if j == i else _sums(fixed[j], moving[i])
                    part = self._filled(one, other, first, column, *own)
                    grams[rows, one[-1], other[-1]] = part
                    if j > i:
                        grams[rows, other[-1], one[-1]] = part.transpose(0, 2, 1)
        for gram, start, stop in zip(grams, starts, stops):
            unused = start + np.flatnonzero(~self._used[start:stop])
            if len(unused):
                gram -= self._outer(unused)
        return grams

    def _filled(self, one, other, first, column, starts, stops):
        """Products of two groups of shifted inputs, from those with the first lag of either, shape
        (runs, size of one, size of the other)."""
        (span, a, _), (its_span, b, _) = one, other
        part = np.empty((len(starts), len(a), span[1] - span[0] + 1,
                         len(b), its_span[1] - its_span[0] + 1))
        part[:, :, 0] = first
        part[:, :, :, :, 0] = column.transpose(0, 2, 3, 1)
        (a_in, b_in), (a_out, b_out) = ((_shifts(a, span, at - 1)[..., None, None],
                                         _shifts(b, its_span, at - 1)[:, None, :, :-1])
                                        for at in (starts, stops))
        for row in range(1, part.shape[2]):
            into = part[:, :, row, :, 1:]
            np.subtract(a_in[:, :, row - 1] * b_in, a_out[:, :, row - 1] * b_out, out=into)
            into += part[:, :, row - 1, :, :-1]
        return part.reshape(len(starts), part.shape[1] * part.shape[2], -1)

    def _rights(self, target, runs):
        """Products of all shifted inputs with a target over each run, shape (runs, size)."""
        result = np.zeros((len(runs), self.size))
        starts, stops = np.array(runs).T
        for rows, length in _alike(starts, stops):
            fixed = _fixed(target[None], 0, starts[rows], stops[rows], length)
            for span, inputs, columns in self._inputs:
                result[rows, columns] = _sums(
                    fixed, _moving(inputs, span, starts[rows], length)).reshape(len(rows), -1)
        return result

    def _outer(self, rows):
        """Products over single samples."""
        total = np.zeros((self.size, self.size))
        for some in np.array_split(rows, len(rows) // 4096 + 1) if len(rows) else ():
            matrix = np.concatenate([_shifts(inputs, span, some).reshape(len(some), -1)
                                     for span, inputs, _ in self._inputs], axis=1)
            total += matrix.T @ matrix
        return total

    def _products_of(self, rows):
        """Products over single samples: of all, and of those that each fold does not learn from."""
        by_fold, total = np.zeros((FOLDS, self.size, self.size)), 0.0
        for block, (start, stop) in enumerate(self._runs):
            by_fold[block % FOLDS] += self._outer(rows[(rows >= start) & (rows < stop)])
        if self._learnt is self._runs:
            return by_fold.sum(axis=0), by_fold
        for start, stop in self._learnt:
            total = total + self._outer(rows[(rows >= start) & (rows < stop)])
        return total, by_fold


def _groups(lags, inputs):
    """Inputs that have the same lags, one after the other: the lags, the inputs, shape (inputs, n),
    and the slice of their coefficients."""
    groups, first = [], 0
    for span, some in groupby(zip(lags, inputs), key=lambda entry: entry[0]):
        some = [values for _, values in some]
        values = np.array(some) if some[1:] else some[0][None]
        last = first + len(values) * (span[1] - span[0] + 1)
        groups.append((span, values, slice(first, last)))
        first = last
    return groups


def _alike(starts, stops):
    """Places of runs whose lengths are alike, as many as there are, and the longest one's."""
    lengths = np.asarray(stops) - starts
    classes = np.ceil(2 * np.log2(np.maximum(lengths, 1)))
    for one in np.unique(classes[lengths > 0]):
        rows = np.flatnonzero((classes == one) & (lengths > 0))
        yield rows, int(lengths[rows].max())


def _window(inputs, starts, length):
    """Inputs, shape (inputs, n), from each start on, shape (runs, inputs, length); 0 beyond the
    record."""
    before = max(-int(starts.min()), 0)
    after = max(int(starts.max()) + length - inputs.shape[1], 0)
    if before or after:
        inputs = np.pad(inputs, ((0, 0), (before, after)))
    return sliding_window_view(inputs, length, axis=1)[:, starts + before].transpose(1, 0, 2)


def _fixed(inputs, lag, starts, stops, length):
    """Inputs with one lag over each run, shape (runs, inputs, length); 0 after its end."""
    run = _window(inputs, starts - lag, length)
    return run * (np.arange(length) < (stops - starts)[:, None])[:, None]


def _moving(inputs, span, starts, length):
    """Inputs as all lags of a span meet them from each start on, shape (runs, inputs, length and
    lags)."""
    return _window(inputs, starts - span[1], length + span[1] - span[0])


def _sums(fixed, moving):
    """Sums of the products of some runs with others, shape (runs, fixed, moving, lags)."""
    length = fixed.shape[2]
    lags = moving.shape[2] - length + 1
    result = np.empty((len(fixed), fixed.shape[1], moving.shape[1], lags))
    if min(length, lags) < _MANY_LAGS:
        for lag in range(lags):
            place = lags - 1 - lag
            result[..., lag] = fixed @ moving[:, :, place:place + length].transpose(0, 2, 1)
        return result
    many = next_fast_len(moving.shape[2], True)
    one, other = rfft(fixed, many).conj(), rfft(moving, many)
    for i in range(fixed.shape[1]):
        for j in range(moving.shape[1]):
            result[:, i, j] = irfft(one[:, i] * other[:, j], many)[:, lags - 1::-1]
    return result


def _add_output(total, taps, moving):
    """Add what filters, shape (runs, inputs, lags), make of runs, to totals of shape (runs,
    length)."""
    length, lags = total.shape[1], taps.shape[2]
    if lags < _MANY_LAGS:
        for lag in range(lags):
            place = lags - 1 - lag
            total += (taps[:, None, :, lag] @ moving[:, :, place:place + length])[:, 0]
        return
    many = next_fast_len(moving.shape[2], True)
    for i in range(taps.shape[1]):
        # what wraps round lies before the first sample of the run
        total += irfft(rfft(taps[:, i], many) * rfft(moving[:, i], many),
                       many)[:, lags - 1:lags - 1 + length]


def _shifts(inputs, span, at):
    """Values of inputs, shape (inputs, n), at some samples, shape (samples, inputs, lags)."""
    # within the record as far as it is used
    return np.take(inputs, at[:, None] - np.arange(span[0], span[1] + 1), axis=1,
                   mode="clip").transpose(1, 0, 2)


def _thinned(values, step):
    """Every step-th sample of values smoothed by a triangle, its weights adding up to 1."""
    kernel = np.convolve(np.ones(step), np.ones(step)) / step**2
    return np.convolve(values, kernel, "same")[::step]


def _thickened(values, step, count):
    """Back to all samples, by a cubic spline."""
    place = np.arange(count) / step
    return CubicSpline(np.arange(len(values)), values)(np.minimum(place, len(values) - 1))


class Normal:
    """Equations of a least squares, their inputs scaled to the same size.

    Parameters
    ----------
    gram : ndarray, shape (size, size)
    right : ndarray, shape (size,)
    """

    def __init__(self, gram, right):
        scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
        self._there = scale > 1e-12 * max(scale.max(), 1e-300)
        self._scale = scale[self._there]
        if not self._there.all():
            gram, right = gram[np.ix_(self._there, self._there)], right[self._there]
        self._right = right / self._scale
        self._gram = gram / self._scale / self._scale[:, None]

    def solve(self, ridge=_RIDGES[0]):
        """Weights beside a ridge, or the next one with which there are any; 0 without."""
        weights = np.zeros(len(self._there))
        if not self._right.any():
            return weights
        while ridge < 1:
            scaled = self._gram.copy()
            scaled[np.diag_indices_from(scaled)] += ridge
            _, found, failed = dposv(scaled, self._right, lower=1)
            if not failed:
                weights[self._there] = found / self._scale
                break
            ridge *= 100
        return weights
