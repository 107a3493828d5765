"""What a residual still holds besides noise."""

import dataclasses

import numpy as np
from scipy.fft import irfft, rfft
from scipy.ndimage import uniform_filter1d
from scipy.optimize import nnls

from ..model.effects.fit_starts import bulk_shift
from ..record.resampling import BAND

_SEGMENTS = 48
_SHIFTS = 40
_ALIKE = 4
# Length of the stretches that count as loud or quiet, and the signal's power in the loudest of them
# from which others are loud too.
_BLOCK = 64
_LOUD = 0.1
# Share of the sensor's power that must follow the reference, and its score against chance.
_SHARED = 0.05
_RELATED = 8.0
# Share of the power, times the number of independent frequencies, that unrelated signals share at
# the best of all lags; more than the other is always enough.
_BY_CHANCE = 12.0
_ALWAYS = 0.5
# Times that rounding is simulated, factor by which its largest share and score may be exceeded, and
# halvings of the range of the noise before it.
_ROUNDINGS = 3
SCATTER = 1.2
_HALVINGS = 12
# Standard deviations of the statistic under independence by which a residual is no noise.
_SIGNIFICANT = 6.0
# Share that must grow with the signal, so that noise with a long memory is not taken for it.
_LEAST_GROWN = 0.05


@dataclasses.dataclass(frozen=True)
class Leftover:
    """Shares of a residual's power that noise cannot have made.

    Attributes
    ----------
    rms : float
        RMS of the residual [output units].
    linear : float
        Share that a linear time-invariant system would still explain from the reference.
    level : float
        Share that comes and goes with the size of the signal or of its derivatives.
    linear_score, level_score : float
        Both in standard deviations of the same statistic for an unrelated residual.
    """

    rms: float
    linear: float
    level: float
    linear_score: float
    level_score: float

    @property
    def share(self):
        """Share of the residual's power that is not noise; 0 where neither is significant."""
        shares = [share for share, score, least in (
            (self.linear, self.linear_score, 0.0), (self.level, self.level_score, _LEAST_GROWN))
            if score > _SIGNIFICANT and share > least]
        return max(shares, default=0.0)

    @property
    def only_grows(self):
        """Whether all but little of what is no noise only comes and goes with the motion."""
        return self.share > 0 and dataclasses.replace(self, level_score=0.0).share < _LEAST_GROWN

    @property
    def noise_rms(self):
        """RMS of what may be noise [output units]."""
        return self.rms * np.sqrt(max(1 - self.share, 0.0))


def leftover(residual, simulated, used, across=(), step=None):
    """Judge a residual.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        0 where a sample does not count.
    simulated : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    across : sequence of ndarray, shape (n,)
        Accelerations along the other axes.
    step : float, optional
        Lattice of the measured values [output units]. What rounding makes of the simulated ones,
        with as much noise as the residual's size asks for, is taken off all shares and scores: on a
        coarse lattice it follows the motion.

    Returns
    -------
    Leftover
    """
    found = _leftover(residual, simulated, used, across)
    if not step:
        return found
    expected = [_leftover(error, simulated, used, across)
                for error in rounding_errors(residual, simulated, used, step)]
    linear, level, linear_score, level_score = SCATTER * np.max([
        (max(e.linear, 0), e.level, max(e.linear_score, 0), max(e.level_score, 0))
        for e in expected], axis=0)
    return Leftover(found.rms, max(found.linear - linear, 0.0), max(found.level - level, 0.0),
                    found.linear_score - linear_score, found.level_score - level_score)


def rounding_errors(residual, simulated, used, step):
    """Errors that rounding leaves of noisy simulated values, as large as the residual.

    Yields an ndarray, shape (n,), for each seed of the noise; see `leftover` for the parameters.
    """
    size = np.sqrt(np.mean(residual[used]**2))
    for seed in range(_ROUNDINGS):
        noise = size * np.random.default_rng(seed).standard_normal(len(simulated))
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            share = (low + high) / 2
            error = step * np.round((simulated + share * noise) / step) - simulated
            if np.mean(error[used]**2) < size**2:
                low = share
            else:
                high = share
        yield error * used


def _leftover(residual, simulated, used, across):
    rng = np.random.default_rng(0)
    rms = float(np.sqrt(np.mean(residual[used]**2)))
    if not np.ptp(simulated):
        return Leftover(rms, 0.0, 0.0, 0.0, 0.0)  # nothing follows a motion that is none
    below = _below_folding(residual) * used
    kept = float(np.mean(below[used]**2)) / max(rms, 1e-300)**2
    linear, linear_score = max((_linear(residual, signal, rng) for signal in
                                (simulated, *across)), key=lambda pair: pair[1])
    level, level_score = max(_level(below, simulated, used, rng),
                             _quiet(below, simulated, used), key=lambda pair: pair[0]
                             * (pair[1] > _SIGNIFICANT))
    return Leftover(rms, linear, kept * level, linear_score, level_score)


def _below_folding(values):
    """Values up to where motion above the Nyquist frequency may fold: what does there comes and
    goes with the motion, too, and no model of the sensor says it."""
    lines = rfft(values)
    lines[int(BAND * len(values)):] = 0.0
    return irfft(lines, len(values))


def related(measured, simulated, used):
    """Whether a signal follows the simulated output, and the share of its power that does.

    Both are moved together first, by the lag at which they are most alike. A relation shows in the
    coherence of many stretches of the record, or, for a shock, in the correlation of the whole,
    which chance alone makes the larger, the fewer independent frequencies both have in common.
    """
    values = np.where(used, measured - measured[used].mean(), 0.0)
    expected = np.where(used, simulated - simulated[used].mean(), 0.0)
    lag = bulk_shift(simulated, measured, used)
    ahead = slice(max(lag, 0), len(values) + min(lag, 0))
    behind = slice(max(-lag, 0), len(values) - max(lag, 0))
    values, expected = values[ahead], expected[behind]
    share, score = _linear(values, expected, np.random.default_rng(0))
    alike = (values @ expected)**2 / max((values @ values) * (expected @ expected), 1e-300)
    both = np.abs(rfft(values))**2 * np.abs(rfft(expected))**2
    independent = np.sum(both)**2 / max(np.sum(both**2), 1e-300)
    follows = (score > _RELATED and share > _SHARED) \
        or alike > min(max(_BY_CHANCE / independent, _SHARED), _ALWAYS)
    return bool(follows), max(share, alike)


def _linear(residual, simulated, rng):
    """Coherence of the residual with the simulated output, above that of an unrelated one."""
    size = max(64, 2 * len(residual) // _SEGMENTS)
    starts = np.arange(0, len(residual) - size + 1, size // 2)
    window = np.hanning(size)
    place = starts[:, None] + np.arange(size)
    x, r = (rfft((v[place] - v[place].mean(axis=1, keepdims=True)) * window, axis=1)
            for v in (simulated, residual))
    own = np.sum(np.abs(x)**2, axis=0)
    strong = own > 1e-6 * own.max()
    kept = strong & (np.arange(len(own)) < BAND * size)
    strong = kept if kept.any() else strong
    x, r, own = x[:, strong], r[:, strong], own[strong]

    def explained(x):
        return float(np.sum(np.abs(np.sum(np.conj(x) * r, axis=0))**2 / own))
    # random phases break any relation, and keep both spectra and envelopes; the window makes
    # neighbouring frequencies alike
    groups = np.arange(x.shape[1]) // _ALIKE
    turns = (np.exp(2j * np.pi * rng.random((len(starts), groups[-1] + 1)))[:, groups]
             for _ in range(_SHIFTS))
    chance = [explained(x * turn) for turn in turns]
    power = float(np.sum(np.abs(r)**2))
    found, mean, spread = explained(x), np.mean(chance), max(np.std(chance), 1e-300)
    return (found - mean) / max(power, 1e-300), (found - mean) / spread


def _level(residual, simulated, used, rng):
    """Share of the residual's power that grows with the signal's or its derivatives'."""
    first = np.gradient(simulated)
    features = [simulated**2, first**2, simulated**4, first**4]
    smooth = [uniform_filter1d(f, 3) for f in features]
    matrix = np.stack([f[used] / f[used].mean() for f in smooth], axis=1)
    squared = residual[used]**2
    mean = squared.mean()
    # robust against single outliers: a stop hits rarely and hard
    columns = np.c_[np.ones(len(squared)), matrix]
    gram, right = columns.T @ columns, columns.T @ squared

    def grown(right):
        factor = np.linalg.cholesky(gram + 1e-12 * np.diag(np.diag(gram)))
        weights, _ = nnls(factor.T, np.linalg.solve(factor, right))
        return 1 - weights[0] / mean
    found = grown(right)
    chance = []
    for _ in range(_SHIFTS):
        moved = np.roll(squared, int(rng.integers(len(squared) // 10, 9 * len(squared) // 10)))
        chance.append(grown(columns.T @ moved))
    return max(found - np.mean(chance), 0.0), (found - np.mean(chance)) / max(np.std(chance), 1e-3)


def _quiet(residual, simulated, used):
    """Share of the residual's power that is missing where the sensor is quiet."""
    steps = np.diff(simulated, append=simulated[-1:])
    swing = simulated - simulated[used].mean()
    signal = swing**2 / np.mean(swing**2) + steps**2 / max(np.mean(steps**2), 1e-300)
    count = len(residual) // _BLOCK
    power, signal, weight = (values[:count * _BLOCK].reshape(count, _BLOCK).sum(axis=1)
                             for values in (residual**2, signal, used.astype(float)))
    here = weight > _BLOCK // 2
    power, signal, weight = power[here], signal[here], weight[here]
    quiet = np.argsort(signal)[:len(signal) // 2]
    if len(quiet) < 8:
        return 0.0, 0.0
    loud = signal > _LOUD * signal.max()
    loud[quiet] = False
    if not loud.any():
        return 0.0, 0.0
    level = np.log(power / weight + 1e-300)
    spread = np.std(level[quiet]) * np.sqrt(1 / loud.sum() + 1 / len(quiet))
    score = (level[loud].mean() - level[quiet].mean()) / max(spread, 1e-12)
    missing = 1 - (power[quiet].sum() / weight[quiet].sum()) / (power.sum() / weight.sum())
    return max(missing, 0.0), score
