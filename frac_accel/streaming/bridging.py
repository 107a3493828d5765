r"""What a bridged gap leaves open: how far the missing samples may be from the straight line.

The record itself says it: laid over the last `HISTORY` samples, the same bridge is wrong by errors
whose covariance is found from all places where its ends and the samples between are there (each
pair of them for itself, as others may be lost). Where there are too few such places, the
covariance follows from the structure function :math:`D(\tau) = E (x_{t+\tau} - x_t)^2`
(N. Cressie, *Statistics for Spatial Data*, 1993, section 3.2):

.. math:: Cov(e_k, e_l) = -\tfrac12 \sum_{ij} \lambda_{ki} \lambda_{lj} D(t_i - t_j)

with :math:`e_k = x_k - (1-s_k) x_a - s_k x_b`. Errors within a gap belong together, and so do the
filter's responses to them: an ensemble of `MEMBERS` errors with exactly this covariance runs
through the filter beside the samples, and the mean of the squares is the variance.

Neighbours belong together, too. A line is wrong by what the second differences of the samples that
it replaces add up to, :math:`e = -G \Delta^2 x`, whatever the gap, so that the autocovariance of
the second difference, known from the triples that are there, says how the errors of a gap go with
those of the gaps before it. Each member follows its own errors there by linear regression; what is
left of the gap's covariance is drawn beside it, orthogonal to the last `MEMBERS` draws.
"""

import collections
import functools

import numpy as np

from ..signals.parallel_filter import FilterState

# Samples from which all is found, and those after which it is found anew.
HISTORY = 4096
_ANEW = 256
# Samples that are put together at a time, at least: many small blocks take much memory.
_TOGETHER = 64
# Fewest pairs of samples that a lag is known from, and fewest places of a bridge.
_PAIRS, _PLACES = 16, 30
# Places within the length of one bridge that are looked at: those closer say the same.
_DENSE = 16
MEMBERS = 32
# Points of a longer gap at which the covariance is taken.
_POINTS = 48
# Of its size, what the response to a gap may still have when it is no longer followed, and the
# longest time [samples] that it is.
_FADED, _LONGEST = 1e-5, 20_000
# Gaps of at most `_SHORT` samples are drawn with the last `_GAPS` before them, no more than `_NEAR`
# samples earlier; share of noise in what is known of these.
_SHORT, _GAPS, _NEAR, _RIDGE = 12, 6, 40, 0.02
# Samples of an ensemble that are filtered at once.
_PIECE = 1024


def _hadamard(order):
    matrix = np.ones((1, 1))
    while len(matrix) < order:
        matrix = np.block([[matrix, matrix], [matrix, -matrix]])
    return matrix


_SIGNS = _hadamard(MEMBERS)


class BridgeErrors:
    """Ensembles of what the bridges over gaps are wrong by.

    Parameters
    ----------
    longest : int
        Longest gap [samples].
    """

    def __init__(self, longest):
        self.longest = longest
        self._blocks, self._length = collections.deque(), 0
        self._latest, self._latest_length = [], 0
        self._total, self._found_at = 0, None
        self._roots, self._next = {}, 0
        self._near = collections.deque()
        self._random = np.random.default_rng(0)

    def add(self, values):
        """Append samples that follow each other, shape (n, 3); NaN where one is missing."""
        self._total += len(values)
        self._latest.append(values[-HISTORY:])
        self._latest_length += len(self._latest[-1])
        if self._latest_length < _TOGETHER:
            return
        self._blocks.append(np.concatenate(self._latest))
        self._length += self._latest_length
        self._latest, self._latest_length = [], 0
        while self._length - len(self._blocks[0]) >= HISTORY:
            self._length -= len(self._blocks.popleft())

    def draw(self, missing, change, noise):
        """Errors of a bridge over so many missing samples.

        Parameters
        ----------
        missing : int
        change : ndarray, shape (3,)
            From the sample before the gap to the one after it.
        noise : ndarray, shape (3,)
            Variance of the samples' own noise; 0 where it is not known.

        Returns
        -------
        ndarray, shape (missing, 3, MEMBERS)
        """
        due = min(_ANEW, self._total // 8)
        if self._found_at is None or self._total - self._found_at >= due:
            self._values = np.concatenate(
                [*self._blocks, *self._latest, np.empty((0, 3))])[-HISTORY:]
            self._structure = _structure(self._values, self.longest + 2)
            self._curvature = _curvature(self._values)
            self._found_at = self._total
            self._roots = {}
        key, structure = (missing, noise.tobytes()), self._structure
        if not structure[missing + 1].any():
            # nothing is known but what changes over the gap itself, as in a random walk
            structure = np.arange(len(structure))[:, None] / (missing + 1) * np.square(change)
            self._roots = {}
        if key not in self._roots:
            self._roots[key] = _roots(self._values, structure, missing, noise)
        # where the motion grows, the change over the gap says so
        grown = np.square(change) / np.maximum(4 * structure[missing + 1], 1e-300)
        roots = [root * np.sqrt(_more(root, factor, size)) for root, factor, size in zip(
            self._roots[key], grown, np.abs(change))]
        result = self._following(missing)
        if result is None:
            result = np.zeros((3, missing, MEMBERS))
        else:
            roots = _rest(roots, result)
        flips = 1 - 2 * self._random.integers(0, 2, (3, MEMBERS, 1))
        rows = (self._next + np.arange(MEMBERS)) % MEMBERS
        for axis, root in enumerate(roots):
            count = root.shape[1]
            result[axis] += root @ (_SIGNS[rows[:count]] * flips[axis, :count])
        self._next += min(missing, MEMBERS)
        self._near.append((self._total, result))
        return result.transpose(1, 0, 2)

    def _following(self, missing):
        """What the gaps just before tell of a gap, (3, missing, MEMBERS); None: nothing."""
        while self._near and (self._total - self._near[0][0] > _NEAR or len(self._near) > _GAPS):
            self._near.popleft()
        lengths = [near.shape[1] for _, near in self._near]
        if not lengths or max(*lengths, missing) > _SHORT:
            return None
        places = np.concatenate([start + np.arange(length) for start, length in zip(
            [*(start for start, _ in self._near), self._total], [*lengths, missing])])
        green = _block_diagonal([_green(length) for length in (*lengths, missing)])
        joint = green @ self._curvature[:, np.abs(places[:, None] - places)] @ green.T
        before, known = joint[:, :-missing, :-missing], joint[:, -missing:, :-missing]
        size = before.max(axis=(1, 2))
        before += _RIDGE * np.where(size > 0, size, 1.0)[:, None, None] * np.eye(len(before[0]))
        weights = np.linalg.solve(before, known.transpose(0, 2, 1)).transpose(0, 2, 1)
        return weights @ np.concatenate([near for _, near in self._near], axis=1)

    def forget(self):
        """What comes does not follow what was."""
        self._near.clear()


def _more(root, grown, change):
    """By what a covariance is multiplied: no bridge is wrong by more than the change over it where
    the record has no motion to compare it with."""
    size = np.square(root).sum(axis=1).max(initial=0.0)
    return max(1.0, min(grown, change**2 / size)) if size else 1.0


def _rest(roots, known):
    """Roots of what is left of each covariance beside an ensemble (3, m, MEMBERS)."""
    left = [root @ root.T - own @ own.T / MEMBERS for root, own in zip(roots, known)]
    size, directions = np.linalg.eigh(left)
    return directions * np.sqrt(np.maximum(size, 0.0))[:, None]


@functools.cache
def _green(missing):
    """Error of a bridge by the second differences at its samples, up to the sign, (m, m)."""
    at = np.arange(1, missing + 1)
    whole = missing + 1
    return np.minimum.outer(at, at) * (whole - np.maximum.outer(at, at)) / whole


def _block_diagonal(blocks):
    ends = np.cumsum([len(block) for block in blocks])
    result = np.zeros((ends[-1], ends[-1]))
    for end, block in zip(ends, blocks):
        result[end - len(block):end, end - len(block):end] = block
    return result


def _curvature(values):
    """Autocovariance (3, lags) of the second difference; samples (n, 3), NaN where missing."""
    bend = np.diff(values, 2, axis=0)
    there = ~np.isnan(bend[:, 0])
    lags = _NEAR + _SHORT + 1
    length = 1 << int(np.ceil(np.log2(len(there) + lags + 1)))
    power = np.abs(np.fft.rfft(np.where(there[:, None], bend, 0.0), length, axis=0))**2
    pairs = np.fft.irfft(np.abs(np.fft.rfft(there, length))**2)[:lags]
    covariance = np.fft.irfft(power, axis=0)[:lags].T / np.maximum(np.round(pairs), 1)
    # from few pairs each lag is off by itself: nothing has such a spectrum
    taper = np.cos(np.pi / 2 * np.arange(lags) / lags)**2
    spectrum = np.fft.hfft(covariance * taper, axis=1)
    return np.fft.ihfft(np.maximum(spectrum, 0.0), axis=1).real


def _structure(values, lags):
    """D at the lags from 0 on, shape (lags, 3), of samples (n, 3) with NaN where one is missing."""
    there = ~np.isnan(values[:, 0])
    result = np.full((lags, 3), np.nan)
    result[0] = 0.0
    if there.sum() < 2:
        return np.zeros((lags, 3))
    values = np.where(there[:, None], values - values[there].mean(axis=0), 0.0).T
    length = 1 << int(np.ceil(np.log2(len(there) + lags)))
    known = np.fft.rfft(there.astype(float), length)
    signal, square = np.fft.rfft(values, length), np.fft.rfft(values**2, length)
    pairs = np.round(np.fft.irfft(np.abs(known)**2, length)[:lags])
    total = np.fft.irfft(2 * (square * known.conj()).real - 2 * np.abs(signal)**2,
                         length)[:, :lags]
    enough = pairs[1:] >= min(_PAIRS, there.sum() - 1)
    # a difference of large numbers: rounding must not make it nothing
    total = np.maximum(total, 1e-12 * (values**2).sum(axis=1)[:, None])
    result[1:][enough] = (total[:, 1:][:, enough] / pairs[1:][enough]).T
    return _extended(result, 2 * np.ptp(values, axis=1)**2)


def _extended(structure, most):
    """Lags that are not known are those of a random walk (of a line, no bridge would be wrong)."""
    for lag in range(1, len(structure)):
        if np.isnan(structure[lag, 0]):
            structure[lag] = structure[lag - 1] * lag / (lag - 1) if lag > 1 else most
    return structure


def _roots(values, structure, missing, noise):
    """Square roots of the covariance of a bridge's errors, (missing, r), r <= MEMBERS, by axis."""
    at = np.arange(1, missing + 1)
    points = at if missing <= _POINTS else np.unique(
        np.round(np.linspace(1, missing, _POINTS)).astype(int))
    s = points / (missing + 1)
    ends = np.outer(1 - s, 1 - s) + np.outer(s, s)
    seen = _seen_covariance(values, missing, points)
    # The noise of the ends is in the line, too, and in the samples themselves: together they weigh
    # so much more in a slow output than if they were independent.
    together = 1 + 4 / missing
    roots = []
    for axis in range(3):
        covariance = (seen[axis] if seen is not None
                      else _inferred_covariance(structure[:, axis], missing, points))
        # the noise of the missing samples themselves is no error of the bridge
        covariance = covariance + noise[axis] * ((together - 1) * ends - np.eye(len(points)))
        size, directions = np.linalg.eigh(covariance)
        size, directions = size[::-1][:MEMBERS], directions[:, ::-1][:, :MEMBERS]
        root = directions * np.sqrt(np.maximum(size, 0.0))
        if len(points) < missing:
            root = np.stack([np.interp(at, points, column) for column in root.T], axis=1)
        roots.append(root)
    return roots


def _seen_covariance(values, missing, points):
    """Covariance by axis, (3, k, k), over the places in the record; None: there are too few."""
    whole = missing + 1
    starts = np.arange(0, len(values) - whole, max(whole // _DENSE, 1))
    ends_there = ~(np.isnan(values[starts, 0]) | np.isnan(values[starts + whole, 0]))
    starts = starts[ends_there]
    if len(starts) < _PLACES:
        return None
    share = (points / whole)[:, None]
    before, after = values[starts][:, None], values[starts + whole][:, None]
    error = values[starts[:, None] + points] - before - share * (after - before)
    there = ~np.isnan(error[:, :, 0])
    counts = there.T.astype(float) @ there
    if counts.min() < _PLACES:
        return None
    error = np.where(there[:, :, None], error, 0.0).transpose(2, 0, 1)
    return error.transpose(0, 2, 1) @ error / counts


def _inferred_covariance(structure, missing, points):
    """Covariance (k, k) by the structure function of one axis."""
    whole = missing + 1
    s = points / whole
    to_a, to_b, across = structure[points], structure[whole - points], structure[whole]
    return 0.5 * (
        np.outer(to_a, 1 - s) + np.outer(to_b, s) + np.outer(1 - s, to_a) + np.outer(s, to_b)
        - (np.outer(1 - s, s) + np.outer(s, 1 - s)) * across
        - structure[np.abs(points[:, None] - points)])


class BridgeEnsemble:
    """Variance that bridged gaps leave in the output of a filter, in blocks of any length.

    Parameters
    ----------
    parallel_filter : ParallelFilter
    axes : int
        Axes that run through it.
    """

    def __init__(self, parallel_filter, axes):
        self._filter, self._axes = parallel_filter, axes
        self._state, self._left = None, 0
        self._lasts = _fading_time(parallel_filter)

    def process(self, count, errors):
        """Variance of the next outputs, shape (axes, count); None where no gap is felt.

        errors : list of (int, ndarray of shape (m, axes, MEMBERS))
            First sample of each gap, ascending, and what it may be wrong by.
        """
        if not self._left and not errors:
            return None
        spans = [[0, self._left, []]] if self._left else []
        for start, members in errors:
            end = start + len(members) + self._lasts
            if spans and start < spans[-1][1]:
                spans[-1][1] = max(end, spans[-1][1])
                spans[-1][2].append((start, members))
            else:
                spans.append([start, end, [(start, members)]])
        result = np.zeros((self._axes, count))
        for start, end, own in spans:
            self._run(result, start, min(end, count), own)
            self._left = max(end - count, 0)
            if not self._left:
                self._state = None
        return result

    def _run(self, result, start, stop, errors):
        if self._state is None:
            self._state = FilterState(self._filter, np.zeros(self._axes * MEMBERS))
        for first in range(start, stop, _PIECE):
            last = min(first + _PIECE, stop)
            whole = np.zeros((self._axes, MEMBERS, last - first))
            for at, members in errors:
                low, high = max(at, first), min(at + len(members), last)
                if low < high:
                    whole[:, :, low - first:high - first] = (
                        members[low - at:high - at].transpose(1, 2, 0))
            output = self._state.process(whole.reshape(-1, last - first))
            output *= output
            # one after the other, so that the sum does not depend on the block's length
            total = output.reshape(self._axes, MEMBERS, -1)
            result[:, first:last] = np.add.accumulate(total, axis=1)[:, -1] / MEMBERS


def _fading_time(parallel_filter):
    """Samples after which the filter has forgotten a gap."""
    taps = len(parallel_filter.taps) + parallel_filter.lead
    if not len(parallel_filter.poles):
        return taps
    size = np.sqrt(np.sum(parallel_filter.impulse_head**2))
    at = np.geomspace(1, _LONGEST, 100).astype(int)
    left = (np.abs(parallel_filter.residues) * np.abs(parallel_filter.poles)**(
        taps + at[:, None])).sum(axis=1)
    faded = np.flatnonzero(left < _FADED * size)
    return taps + int(at[faded[0]] if len(faded) else _LONGEST)
