"""Whether a residual is white, and whether it still depends on the reference."""

import dataclasses

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import chdtrc, ndtri

from ...errors import FracAccelError

# Lags to both sides of zero.
LAGS = 25
# A statistic that chance exceeds this rarely is significant, and bands hold the rest.
SIGNIFICANCE = 0.01
# Order of the noise model up to which Akaike's criterion chooses.
_HIGHEST_ORDER = 40
_FEWEST = 10 * LAGS
# Combinations of lags in which the reference has less than this share of its largest power are not
# excited; those of whose noise the fit has taken all but this share are no longer free.
_EXCITED = 1e-4
_FREE = 0.05
_BLOCK = 16384
# Share that is left of a noise model's memory where it counts as none.
_FORGOTTEN = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class ResidualTests:
    """Autocorrelation of a residual and its correlation with the reference.

    Attributes
    ----------
    lags : ndarray of int, shape (25,)
        1 ... 25 samples.
    autocorrelation, autocorrelation_band : ndarray, shape (25,)
        Coefficients, and what 99 % of them stay within (to both sides) if the residual is white.
    whiteness_statistic, whiteness_p_value : float
        Chi-squared of 25 degrees of freedom.
    reference_lags : ndarray of int, shape (51,)
        Samples by which the reference is earlier than the residual.
    reference_correlation, reference_band : ndarray, shape (51,)
        Coefficients, and the 99 % band if the residual is noise of the spectrum that it has.
    independence_statistic, independence_p_value : float
        Chi-squared of `independence_freedom` degrees of freedom.
    independence_freedom : int
        Combinations of lags that the reference excites and the fit has left free.
    noise_order : int
        Order of the autoregressive model of the residual's spectrum; 0 where it is white.
    dependent_share : float
        RMS of what the reference still explains of the residual within these lags, what chance
        explains taken off, over the RMS of the residual.
    """

    lags: np.ndarray
    autocorrelation: np.ndarray
    autocorrelation_band: np.ndarray
    whiteness_statistic: float
    whiteness_p_value: float
    reference_lags: np.ndarray
    reference_correlation: np.ndarray
    reference_band: np.ndarray
    independence_statistic: float
    independence_p_value: float
    independence_freedom: int
    noise_order: int
    dependent_share: float

    @property
    def white(self):
        """Whether a white residual would often look like this one."""
        return self.whiteness_p_value >= SIGNIFICANCE

    @property
    def independent(self):
        """Whether a residual without relation to the reference would often look like this one."""
        return self.independence_p_value >= SIGNIFICANCE

    def as_dict(self):
        """Plain numbers and lists."""
        return {**{field.name: value.tolist() if isinstance(value, np.ndarray) else value
                   for field in dataclasses.fields(self)
                   for value in [getattr(self, field.name)]},
                "white": self.white, "independent": self.independent}


def p_words(p_value):
    """A p value as text."""
    return "p < 1e-6" if p_value < 1e-6 else f"p = {p_value:.2g}"


def residual_tests(residual, reference, valid=None, gradient=None):
    r"""Test a residual for whiteness and for independence of the reference.

    The idea is that of L. Ljung, *System Identification*, 2nd ed., section 16.6. Whiteness:
    the statistic of G. M. Ljung, G. E. P. Box, *Biometrika* 65 (1978) 297-303. An output-error fit
    takes no degree of freedom from it, since the simulated output has no part in the noise.

    Independence: with the columns of :math:`U` the reference at the lags, and :math:`J` the
    model's derivatives by the fitted parameters, the residual of a complete model is
    :math:`M e`, :math:`M = I - J (J^T J)^{-1} J^T`, with noise :math:`e` of covariance
    :math:`\Gamma`, so :math:`r = U^T M e` is Gaussian with

    .. math:: C = U^T M \Gamma M U, \quad r^T C^{+} r \sim \chi^2(\operatorname{rank} C).

    For a stationary reference without fitted parameters the diagonal of C is Ljung's
    :math:`\sum_k R_\varepsilon(k) R_u(k)`, but C holds for a shock as well. Correlated noise
    therefore makes no false alarm: :math:`\Gamma` is that of an autoregressive model of the
    residual, of an order chosen by Akaike's criterion.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Measured less simulated; NaN where not judged.
    reference : ndarray, shape (n,)
        At the same instants, without gaps.
    valid : ndarray of bool, shape (n,), optional
        Samples that count.
    gradient : ndarray, shape (p, n), optional
        Derivatives of the simulated output by the parameters that have been fitted to these very
        data, in any units.

    Returns
    -------
    ResidualTests

    Raises
    ------
    FracAccelError
        If fewer than 250 samples count, or the shapes differ.

    Notes
    -----
    The noise is taken as stationary. O(n), in blocks.
    """
    residual, reference = np.asarray(residual, float), np.asarray(reference, float)
    if residual.shape != reference.shape or residual.ndim != 1:
        raise FracAccelError(f"residual and reference have shapes {residual.shape} and "
                             f"{reference.shape}, expected the same length")
    used = np.isfinite(residual) & (True if valid is None else valid)
    count = int(used.sum())
    if count < _FEWEST:
        raise FracAccelError(f"{count} samples of the residual, expected at least {_FEWEST}")
    error = np.where(used, residual, 0.0)
    error[used] -= error[used].mean()
    if not error.any():
        raise FracAccelError("the residual is zero, there is nothing to test")

    covariance, pairs = _autocovariance(error, used, max(LAGS, _HIGHEST_ORDER))
    autocorrelation = covariance[1:LAGS + 1] / covariance[0]
    # each pair of samples is one piece of evidence: missing samples leave fewer
    weight = pairs[1:LAGS + 1] * (count + 2) / count
    whiteness = float(np.sum(weight * autocorrelation**2 * count / (count - 1)))
    noise = _noise_model(covariance, count)
    quantile = ndtri(1 - SIGNIFICANCE / 2)
    lags = np.arange(-LAGS, LAGS + 1)
    cross = _cross(error, reference - reference.mean(), used, lags, gradient, noise)
    return ResidualTests(
        lags=np.arange(1, LAGS + 1), autocorrelation=autocorrelation,
        autocorrelation_band=quantile / np.sqrt(weight),
        whiteness_statistic=whiteness, whiteness_p_value=float(chdtrc(LAGS, whiteness)),
        reference_lags=lags, reference_correlation=cross.correlation,
        reference_band=quantile * cross.std,
        independence_statistic=cross.statistic,
        independence_p_value=float(chdtrc(cross.freedom, cross.statistic))
        if cross.freedom else 1.0,
        independence_freedom=cross.freedom, noise_order=len(noise[0]) - 1,
        dependent_share=cross.share)


@dataclasses.dataclass(frozen=True)
class _Cross:
    """Correlation with the reference, its standard deviation by chance, and the statistic."""

    correlation: np.ndarray
    std: np.ndarray
    statistic: float
    freedom: int
    share: float


def _cross(error, reference, used, lags, gradient, noise):
    """Joint test of all lags."""
    count = len(lags)
    gram, coloured, right = _moments(error, reference, used, lags, gradient, noise)
    # what the fit has already taken out of residual and lags
    taken = gram[count:, count:]
    scale = np.sqrt(np.maximum(np.diag(taken), 1e-300))
    project = np.eye(count, len(gram))
    project[:, count:] = -(np.linalg.pinv(taken / np.outer(scale, scale), 1e-12, hermitian=True)
                           @ (gram[count:, :count] / scale[:, None])).T / scale
    own = project @ gram @ project.T
    spread = project @ coloured @ project.T
    moment = project @ right
    size = np.sqrt(np.diag(gram)[:count] * (error @ error))
    size = np.where(size > 0, size, np.inf)

    power, vectors = np.linalg.eigh(gram[:count, :count])
    excited = vectors[:, power > _EXCITED * power[-1]]
    before = excited.T @ coloured[:count, :count] @ excited
    after = excited.T @ spread @ excited
    # directions in which the noise is one before the fit: what is left of it there
    root = np.linalg.inv(np.linalg.cholesky(before))
    left, basis = np.linalg.eigh(root @ after @ root.T)
    free = left > _FREE
    basis = excited @ root.T @ basis[:, free]
    scores = basis.T @ moment
    explained = basis.T @ own @ basis
    inverse = np.linalg.pinv(explained, 1e-10, hermitian=True)
    energy = scores @ inverse @ scores - np.trace(inverse * left[free])
    return _Cross(moment / size, np.sqrt(np.maximum(np.diag(spread), 0)) / size,
                  float(np.sum(scores**2 / left[free])), int(free.sum()),
                  float(np.sqrt(max(energy, 0.0) / (error @ error))))


def _moments(error, reference, used, lags, gradient, noise):
    """X'X, X'(noise covariance)X and X'error of X = (reference at the lags, ones, gradient).

    With noise that white innovations drive through 1/A(z), the second is the square of X filtered
    by 1/A backwards in time.
    """
    n = len(error)
    denominator, variance = noise
    others = [np.ones(n), *(row.astype(float) for row in ([] if gradient is None else gradient))]
    edges = _edges(used)
    if len(edges) == 2:
        stretch = _Stretch(error, reference, edges, lags, others)
        gram, right = stretch.gram(np.array([1.0, 0.0]), None), stretch.right()
        coloured = gram if len(denominator) == 1 else stretch.gram(*_autoregressive(denominator, n))
        return gram, variance * coloured, right
    from scipy.signal import lfilter
    width = len(lags) + len(others)
    gram, coloured, right = np.zeros((width, width)), np.zeros((width, width)), np.zeros(width)
    reach = lags[-1]
    padded = np.r_[np.zeros(reach), reference, np.zeros(reach)]
    state = np.zeros((len(denominator) - 1, width))
    for stop in range(n, 0, -_BLOCK):
        start = max(0, stop - _BLOCK)
        columns = np.concatenate(
            [padded[start + reach - lags[:, None] + np.arange(stop - start)].T,
             np.array([row[start:stop] for row in others]).T], axis=1)
        # without the lags that reach out of the record, every column is zero there by padding
        columns *= used[start:stop, None]
        gram += columns.T @ columns
        right += columns.T @ error[start:stop]
        if len(denominator) > 1:
            backwards, state = lfilter([1.0], denominator, columns[::-1], axis=0, zi=state)
            coloured += backwards.T @ backwards
    # before the record's first sample the filter still rings
    for _ in range(10_000):
        if len(denominator) == 1 or not np.max(np.abs(state)) > 1e-6 * np.max(np.abs(padded)):
            break
        tail, state = lfilter([1.0], denominator, np.zeros((256, width)), axis=0, zi=state)
        coloured += tail.T @ tail
    return gram, variance * (coloured if len(denominator) > 1 else gram), right


def _edges(used):
    """Where used samples begin and end, in turn."""
    return np.flatnonzero(np.diff(used, prepend=False, append=False))


def _autoregressive(denominator, n):
    """Autocovariance of 1/A(z) driven by white noise, and its product with rows, as functions.

    Of n samples, and over twice as many at most: what wraps around has decayed there.
    """
    slowest = np.max(np.abs(np.roots(denominator)))
    memory = min(int(np.log(_FORGOTTEN) / np.log(slowest)) + 1, n) if 0 < slowest < 1 else n
    length = next_fast_len(n + memory, real=True)
    power = 1 / np.square(np.abs(rfft(denominator, length)))

    def weigh(row):
        return irfft(rfft(row, length) * power, length)[:len(row)]
    return irfft(power, length)[:memory + 1], weigh


class _Stretch:
    """X of `_moments` for one stretch of samples without gaps, without building it."""

    def __init__(self, error, reference, edges, lags, others):
        self.start, self.stop = edges
        self.reach, self.lags = lags[-1] + 1, lags
        self.padded = np.r_[np.zeros(self.reach), reference, np.zeros(self.reach)]
        *self.others, self.error = (row[self.start:self.stop] for row in (*others, error))

    def shifted(self, lag, first=0, last=None):
        """Reference at a lag, at the stretch's samples from `first` to before `last`."""
        begin = self.reach - lag + self.start
        return self.padded[begin + first:begin + (self.stop - self.start if last is None else last)]

    def at_lags(self, row):
        """Products of a row with the reference at each lag; in blocks that caches hold."""
        found = np.zeros(len(self.lags))
        for first in range(0, len(row), _BLOCK):
            part = row[first:first + _BLOCK]
            found += [part @ self.shifted(lag, first, first + len(part)) for lag in self.lags]
        return found

    def right(self):
        """X'error."""
        return np.array([*self.at_lags(self.error),
                         *(self.error @ row for row in self.others)])

    def gram(self, covariance, weigh):
        """X'C X with noise of some covariance by lags (`weigh`: its product with a row).

        Of the reference at two lags, the product differs from that at both lags one longer by the
        samples at the ends.
        """
        count, length = len(self.lags), self.stop - self.start
        gram = np.empty((count + len(self.others),) * 2)
        # one after the other: of a long record, all weighed rows would take most memory
        for place, row in enumerate(self.others, count):
            weighed = row if weigh is None else weigh(row)
            gram[:count, place] = self.at_lags(weighed)
            gram[place, count:] = [weighed @ other for other in self.others]
        gram[count:, :count] = gram[:count, count:].T
        first = self.shifted(self.lags[0])
        weighed = first if weigh is None else weigh(first)
        gram[0, :count] = gram[:count, 0] = self.at_lags(weighed)
        before, last = (self.padded[self.reach - self.lags + place - 1]
                        for place in (self.start, self.stop))
        # the weighed reference a sample before the stretch, and at its last one
        reach = min(len(covariance) - 1, length)
        ahead = np.array([covariance[1:reach + 1] @ self.shifted(lag, 0, reach)
                          for lag in self.lags])
        behind = np.array([covariance[reach - 1::-1] @ self.shifted(lag, length - reach)
                           for lag in self.lags])
        change = np.outer(ahead, before) - np.outer(behind, last)
        far = covariance[length] if length < len(covariance) else 0.0
        change -= far * np.outer(before, last)
        change += change.T + covariance[0] * (np.outer(before, before) + np.outer(last, last))
        for i in range(1, count):
            gram[i, 1:count] = gram[i - 1, :count - 1] + change[i - 1, :-1]
        return gram


def _autocovariance(error, used, most):
    """Autocovariance from the pairs of samples that exist, and their numbers; lags 0 ... most."""
    n = len(error)
    present = used.astype(float)
    if len(_edges(used)) == 2:
        pairs = used.sum() - np.arange(most + 1.0)
    else:
        pairs = np.array([present[lag:] @ present[:n - lag] for lag in range(most + 1)])
    sums = np.array([error[lag:] @ error[:n - lag] for lag in range(most + 1)])
    return sums / np.maximum(pairs, 1), pairs


def _noise_model(covariance, count):
    """Denominator A(z) and innovation variance of an autoregressive model (Levinson-Durbin)."""
    denominator, variance = np.zeros(_HIGHEST_ORDER + 1), covariance[0]
    denominator[0] = 1.0
    best = count * np.log(variance), 0, denominator.copy(), variance
    for order in range(1, _HIGHEST_ORDER + 1):
        reflection = -(denominator[:order] @ covariance[order:0:-1]) / variance
        if not abs(reflection) < 1:
            # pairs around missing samples need not belong to any process: the smaller order will do
            break
        denominator[:order + 1] += reflection * denominator[order::-1]
        variance *= 1 - reflection**2
        criterion = count * np.log(variance) + 2 * order
        if criterion < best[0]:
            best = criterion, order, denominator.copy(), variance
    _, order, denominator, variance = best
    return denominator[:order + 1], variance
