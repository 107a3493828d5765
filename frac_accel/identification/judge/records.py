"""Several records of one sensor: whether their models agree, and the model of them all."""

import dataclasses

import numpy as np

from .residual_tests import SIGNIFICANCE, p_words

# It changes with temperature and with how the sensor lies: no sign of another sensor.
_OWN_TO_EACH_RECORD = ("offset",)
_POSITIVE = ("natural_frequency_hz", "damping_ratio")
# Residual with another record's model, over that with its own, from which the records differ.
_PREDICTED_WORSE = 1.5
# Relative standard uncertainty of those with which they are open.
_OPEN = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class Combination:
    r"""Weighted mean of the parameters of several fits.

    .. math:: \hat\theta = C \sum_i C_i^{-1} \theta_i, \quad C = \Big(\sum_i C_i^{-1}\Big)^{-1},
              \quad \chi^2 = \sum_i (\theta_i - \hat\theta)^T C_i^{-1} (\theta_i - \hat\theta)

    where the parameters that have bounds enter in coordinates without (the logarithms of frequency
    and damping). Of fits that disagree, the correlations would carry such a mean far outside all of
    them (Peelle's puzzle, D. L. Smith, *Probability, Statistics, and Data Uncertainties in Nuclear
    Science and Technology*, 1991): each parameter is then averaged with its own variances alone,
    as where a fit leaves a frequency or damping open, for which a covariance means little.

    Attributes
    ----------
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Multiplied by the square of `birge_factor`.
    statistic, p_value : float
        Chi-squared of `freedom` degrees of freedom, over the parameters that should agree and
        that no fit leaves open.
    freedom : int
    birge_factor : float
        :math:`\sqrt{\chi^2 / \mathrm{freedom}}` where the fits disagree, otherwise 1 (R. T. Birge,
        *Phys. Rev.* 40 (1932) 207-227).
    """

    values: np.ndarray
    covariance: np.ndarray
    statistic: float
    freedom: int
    p_value: float
    birge_factor: float


@dataclasses.dataclass(frozen=True, eq=False)
class RecordAgreement:
    """Models of several records, judged on each other.

    Attributes
    ----------
    records : tuple of str
        Names of the records.
    nrmse : ndarray, shape (k, k)
        Row: the record that the model was fitted to; column: the record that it was judged on. RMS
        of the residual, after the model's own settling time, over the output's standard deviation.
    combined_nrmse : ndarray, shape (k,)
        The same of the combined model.
    parameters : tuple of str
    values, std : ndarray, shape (k, p)
        Of each record's own model.
    statistic, p_value, birge_factor : float
    freedom : int
        See `Combination`.
    worst_parameter : str
        The one that differs by most standard uncertainties between two records.
    worst_records : tuple of str
        These two.
    worst_difference : float
        In standard uncertainties of the difference.
    complete : bool
        Whether no record's own residual depends on its reference.
    held : tuple of str
        Parameters that a record leaves open, taken as equal in all to compare the others.
    """

    records: tuple
    nrmse: np.ndarray
    combined_nrmse: np.ndarray
    parameters: tuple
    values: np.ndarray
    std: np.ndarray
    statistic: float
    freedom: int
    p_value: float
    birge_factor: float
    worst_parameter: str
    worst_records: tuple
    worst_difference: float
    complete: bool
    held: tuple

    @property
    def agree(self):
        """Whether records of one sensor would often differ as much."""
        return self.p_value >= SIGNIFICANCE

    def words(self):
        """The verdict as a sentence."""
        if self.agree:
            agreed = f"the {len(self.records)} records agree on the parameters " \
                     f"({p_words(self.p_value)})"
            if self.held:
                agreed += f" with the same {' and '.join(self.held)}, which they leave open"
            own = np.diag(self.nrmse)
            model, judged = np.unravel_index(np.nanargmax(self.nrmse / own), self.nrmse.shape)
            if self.nrmse[model, judged] > _PREDICTED_WORSE * own[judged]:
                return (f"{agreed}, as far as these are determined, but not in what they predict: "
                        f"{self.records[judged]} to {self.nrmse[model, judged]:.2%} by the model "
                        f"of {self.records[model]}, to {own[judged]:.2%} by its own")
            return f"{agreed}; the model is their mean"
        reason = "not the same sensor or not the same mounting" if self.complete else \
            "the model lacks something, or it is not the same sensor or not the same mounting"
        return (f"the records disagree ({p_words(self.p_value)}): {self.worst_parameter} differs "
                f"by {self.worst_difference:.1f} standard uncertainties between "
                f"{' and '.join(self.worst_records)}: {reason}; uncertainties are "
                f"{self.birge_factor:.1f} times as large for it (Birge factor)")

    def as_dict(self):
        """Plain numbers and lists."""
        return {**{field.name: value.tolist() if isinstance(value, np.ndarray) else
                   list(value) if isinstance(value, tuple) else value
                   for field in dataclasses.fields(self)
                   for value in [getattr(self, field.name)]}, "agree": self.agree}


def combine(fits):
    """Combination of fits of the same parameters.

    Parameters
    ----------
    fits : sequence of Fit
        With the same names. What a fit has chosen and not estimated (no variance) is taken from
        the first.

    Returns
    -------
    Combination
    """
    names = fits[0].names
    estimated = np.all([fit.std > 0 for fit in fits], axis=0)
    # far from linear: such a covariance would call records of one sensor different
    opened = np.array([is_open(name, fits) for name in names])
    shared = estimated & ~opened & [name not in _OWN_TO_EACH_RECORD for name in names]
    free = [_unbounded(names, fit.values) for fit in fits]
    points = [point for point, _ in free]
    spreads = [fit.covariance * np.outer(slope, slope) for fit, (_, slope) in zip(fits, free)]
    place = np.ix_(shared, shared)
    statistic = _statistic([point[shared] for point in points],
                           [matrix[place] for matrix in spreads])
    from scipy.stats import chi2
    freedom = int((len(fits) - 1) * shared.sum())
    p_value = float(chi2.sf(statistic, freedom))
    disagree = p_value < SIGNIFICANCE
    birge = float(np.sqrt(statistic / freedom)) if disagree else 1.0
    mean, spread = points[0].copy(), np.zeros_like(spreads[0])
    place = np.ix_(estimated, estimated)
    mean_of = _separate_means if disagree or opened.any() else _weighted_mean
    mean[estimated], spread[place] = mean_of(
        [point[estimated] for point in points], [matrix[place] for matrix in spreads])
    values, slope = _bounded(names, mean)
    covariance = spread * np.outer(slope, slope)
    return Combination(values, covariance * birge**2, statistic, freedom, p_value, birge)


def is_open(name, fits):
    """Whether one of the fits leaves a frequency or a damping open."""
    if name not in _POSITIVE or name not in fits[0].names:
        return False
    place = fits[0].names.index(name)
    return any(fit.std[place] > _OPEN * fit.values[place] for fit in fits)


def freed(combination, fits, held):
    """Combination of fits with held parameters, with the uncertainty that these bring.

    Parameters
    ----------
    combination : Combination
        Of fits in which each held parameter has one value.
    fits : sequence of Fit
        In which all are free.
    held : dict of str to Fit
        Held parameters, and the fits that they have their values from: their covariances say how
        uncertain these are, and how the other parameters go with them.
    """
    covariance = combination.covariance.copy()
    for name, fit in held.items():
        along = fit.covariance[:, fit.names.index(name)]
        covariance += np.outer(along, along) / along[fit.names.index(name)]
    return dataclasses.replace(combination, covariance=covariance)


def agreement(names, fits, combination, nrmse, combined_nrmse, complete, compared=None, held=()):
    """RecordAgreement of the fits of named records; parameters as its attributes.

    `compared` are the fits that tell which parameter differs most, with the `held` parameters.
    """
    values, std = (np.stack([getattr(fit, part) for fit in fits]) for part in ("values", "std"))
    own, own_std = values, std
    if compared is not None:
        values, std = (np.stack([getattr(fit, part) for fit in compared])
                       for part in ("values", "std"))
    shared = [i for i, name in enumerate(fits[0].names)
              if name not in _OWN_TO_EACH_RECORD and np.all(std[:, i] > 0)]
    worst = max((abs(values[a, i] - values[b, i]) / np.hypot(std[a, i], std[b, i]), i, a, b)
                 for i in shared for a in range(len(fits)) for b in range(a))
    difference, parameter, second, first = worst
    return RecordAgreement(
        tuple(names), np.asarray(nrmse, float), np.asarray(combined_nrmse, float), fits[0].names,
        own, own_std, combination.statistic, combination.freedom, combination.p_value,
        combination.birge_factor, fits[0].names[parameter], (names[first], names[second]),
        float(difference), bool(complete), tuple(held))


def _separate_means(values, covariances):
    """Like `_weighted_mean`, each value with its own variances alone."""
    weights = np.array([1 / np.diag(covariance) for covariance in covariances])
    weights /= weights.sum(axis=0)
    covariance = sum(np.outer(weight, weight) * matrix
                     for weight, matrix in zip(weights, covariances))
    return np.sum(weights * values, axis=0), covariance


def _unbounded(names, values):
    """Values in coordinates without bounds, and their derivatives by the values."""
    points, slopes = np.array(values, float), np.ones(len(names))
    for i, name in enumerate(names):
        if name in _POSITIVE:
            points[i], slopes[i] = np.log(values[i]), 1 / values[i]
        elif name == "damping_order":
            rest = 2 - values[i]
            points[i], slopes[i] = np.log(values[i] / rest), 2 / (values[i] * rest)
    return points, slopes


def _bounded(names, points):
    """Inverse of `_unbounded`: values, and their derivatives by the coordinates."""
    values = np.array(points, float)
    for i, name in enumerate(names):
        if name in _POSITIVE:
            values[i] = np.exp(points[i])
        elif name == "damping_order":
            values[i] = 2 / (1 + np.exp(-points[i]))
    return values, 1 / _unbounded(names, values)[1]


def _weighted_mean(values, covariances):
    """Mean weighted by the inverse covariances, and its covariance."""
    scale = _scale(covariances)
    weights = _weights(covariances, scale)
    covariance = np.linalg.pinv(sum(weights), 1e-12, hermitian=True)
    mean = covariance @ sum(weight @ (value / scale) for weight, value in zip(weights, values))
    return mean * scale, covariance * np.outer(scale, scale)


def _statistic(values, covariances):
    """Chi-squared of the values against their weighted mean."""
    scale = _scale(covariances)
    mean, _ = _weighted_mean(values, covariances)
    errors = [(value - mean) / scale for value in values]
    return float(sum(error @ weight @ error
                     for weight, error in zip(_weights(covariances, scale), errors)))


def _scale(covariances):
    return np.sqrt(np.mean([np.diag(covariance) for covariance in covariances], axis=0))


def _weights(covariances, scale):
    return [np.linalg.pinv(covariance / np.outer(scale, scale), 1e-12, hermitian=True)
            for covariance in covariances]
