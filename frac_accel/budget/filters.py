"""Filters of several inputs, fitted to a residual by least squares and judged by other blocks."""

import numpy as np
from scipy.fft import rfft
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import fftconvolve, oaconvolve

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
        self._outputs = [values[::step] for values in inputs]
        if step > 1:
            blocks = blocks.thinned(step)
            inputs = [_thinned(values, step) for values in inputs]
            used = used[::step]
        self._blocks, self._used = blocks, used
        self._inputs = inputs
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
        return solve(self._whole, whole, ridge), 1 - gained / max(power, 1e-300)

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
        right = sum(self._right(values, *run) for run in self._learnt)
        taps = solve(self._whole, right, _NO_NOISE)[:span[1] - span[0] + 1]
        result = []
        for other in others:
            other = _thinned(other, step) if step > 1 else other
            run = self._run(other, -span[1], len(other) - span[0])
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
        judged = np.zeros((FOLDS, self.size))
        for block, run in enumerate(self._runs):
            judged[block % FOLDS] += self._right(values, *run)
        return judged, judged.sum(axis=0) if self._learnt is self._runs \
            else self._right(values, *self._learnt[0])

    def _best_weights(self, gram, unseen, whole, judged):
        """Weights of each fold, by the ridge that takes most from what they have not seen; that
        ridge, and what is taken."""
        best, chosen, most = None, _RIDGES[0], -np.inf
        for ridge in _RIDGES:
            weights = [solve(gram - other, whole - right, ridge)
                       for other, right in zip(unseen, judged)]
            gain = sum(2 * w @ right - w @ other @ w
                       for w, right, other in zip(weights, judged, unseen))
            if gain <= most:
                break
            best, chosen, most = weights, ridge, gain
        return best, chosen, most

    def _held_out(self, weights):
        """Each block's output of the filter that the others give."""
        result = np.empty(self._blocks.n)
        for block, start, stop in self._blocks:
            result[start:stop] = self._output(weights[block % FOLDS], start, stop)
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
        ends = np.cumsum([0] + [high - low + 1 for low, high in self._lags])
        grams = np.empty((len(starts), self.size, self.size))
        inputs = [*zip(self._inputs, self._lags, map(slice, ends[:-1], ends[1:]))]
        for place, (a, span, rows) in enumerate(inputs):
            for b, other, columns in inputs[place:]:
                part = grams[:, rows, columns]
                self._fill_pair(part, a, b, span, other, starts, stops)
                if columns != rows:
                    grams[:, columns, rows] = part.transpose(0, 2, 1)
        for gram, start, stop in zip(grams, starts, stops):
            unused = start + np.flatnonzero(~self._used[start:stop])
            if len(unused):
                gram -= self._outer(unused)
        return grams

    def _fill_pair(self, part, a, b, span, other, starts, stops):
        for gram, start, stop in zip(part, starts, stops):
            gram[0] = self._shifted_sums(a[start - span[0]:stop - span[0]], b, other, start, stop)
            gram[:, 0] = gram[0] if a is b and span == other else self._shifted_sums(
                b[start - other[0]:stop - other[0]], a, span, start, stop)
        (a_in, b_in), (a_out, b_out) = ((self._shifts(a, span, at - 1)[..., None],
                                         self._shifts(b, other, at - 1)[:, :-1])
                                        for at in (starts, stops))
        for row in range(1, part.shape[1]):
            np.subtract(a_in[:, row - 1] * b_in, a_out[:, row - 1] * b_out, out=part[:, row, 1:])
            part[:, row, 1:] += part[:, row - 1, :-1]

    def _run(self, values, start, stop):
        """Input from one sample to another; 0 beyond the record."""
        before, after = max(-start, 0), max(stop - len(values), 0)
        run = values[max(start, 0):stop]
        return np.pad(run, (before, after)) if before or after else run

    def _shifts(self, values, span, at):
        """Values of an input at some samples, at all lags."""
        # within the record as far as it is used
        return np.take(values, at[:, None] - np.arange(span[0], span[1] + 1), mode="clip")

    def _shifted_sums(self, fixed, values, span, start, stop):
        """Sums of one run times an input at all lags."""
        moving = self._run(values, start - span[1], stop - span[0])
        if min(len(fixed), span[1] - span[0]) < _MANY_LAGS:
            return np.correlate(moving, fixed, "valid")[::-1]
        return fftconvolve(moving, fixed[::-1], "valid")[::-1]

    def _right(self, target, start, stop):
        if stop <= start:
            return np.zeros(self.size)
        return np.concatenate([
            self._shifted_sums(target[start:stop], values, span, start, stop)
            for values, span in zip(self._inputs, self._lags)])

    def _outer(self, rows):
        """Products over single samples."""
        total = np.zeros((self.size, self.size))
        for some in np.array_split(rows, len(rows) // 4096 + 1):
            matrix = np.concatenate([
                values[some[:, None] - np.arange(low, high + 1)]
                for values, (low, high) in zip(self._inputs, self._lags)], axis=1)
            total += matrix.T @ matrix
        return total

    def _products_of(self, rows):
        """Products over single samples: of all, and of those that each fold does not learn from."""
        by_fold, total = np.zeros((FOLDS, self.size, self.size)), 0.0
        for block, (start, stop) in enumerate(self._runs):
            here = rows[(rows >= start) & (rows < stop)]
            if len(here):
                by_fold[block % FOLDS] += self._outer(here)
        if self._learnt is self._runs:
            return by_fold.sum(axis=0), by_fold
        for start, stop in self._learnt:
            total = total + self._outer(rows[(rows >= start) & (rows < stop)])
        return total, by_fold

    def _output(self, weights, start, stop):
        total, first = np.zeros(stop - start), 0
        for values, (low, high) in zip(self._outputs, self._lags):
            taps = weights[first:first + high - low + 1]
            first += len(taps)
            run = self._run(values, start - high, stop - low)
            total += (np.convolve(run, taps, "valid") if len(taps) < 64
                      else oaconvolve(run, taps, "valid"))
        return total


def _thinned(values, step):
    """Every step-th sample of values smoothed by a triangle, its weights adding up to 1."""
    kernel = np.convolve(np.ones(step), np.ones(step)) / step**2
    return np.convolve(values, kernel, "same")[::step]


def _thickened(values, step, count):
    """Back to all samples, by a cubic spline."""
    place = np.arange(count) / step
    return CubicSpline(np.arange(len(values)), values)(np.minimum(place, len(values) - 1))


def solve(gram, right, ridge=_RIDGES[0]):
    """Weights of the least squares, of inputs scaled to the same size."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    there = scale > 1e-12 * max(scale.max(), 1e-300)
    weights = np.zeros(len(right))
    if not there.any() or not np.any(right):
        return weights
    size = scale[there]
    scaled = gram[np.ix_(there, there)] / np.outer(size, size)
    while ridge < 1:
        scaled[np.diag_indices_from(scaled)] += ridge
        try:
            factor = cho_factor(scaled, check_finite=False)
        except np.linalg.LinAlgError:
            ridge *= 100
            continue
        weights[there] = cho_solve(factor, right[there] / size, check_finite=False) / size
        break
    return weights
