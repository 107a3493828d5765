"""Several records of one sensor: whether their models agree, and the model of them all."""

import dataclasses

import numpy as np
from scipy.stats import chi2

from .fit_validation import p_words
from .residual_tests import SIGNIFICANCE

# It changes with temperature and with how the sensor lies: no sign of another sensor.
_OWN_TO_EACH_RECORD = ("offset",)


@dataclasses.dataclass(frozen=True, eq=False)
class Combination:
    r"""Weighted mean of the parameters of several fits.

    .. math:: \hat\theta = C \sum_i C_i^{-1} \theta_i, \quad C = \Big(\sum_i C_i^{-1}\Big)^{-1},
              \quad \chi^2 = \sum_i (\theta_i - \hat\theta)^T C_i^{-1} (\theta_i - \hat\theta)

    Attributes
    ----------
    values : ndarray, shape (p,)
    covariance : ndarray, shape (p, p)
        Multiplied by the square of `birge_factor`.
    statistic, p_value : float
        Chi-squared of `freedom` degrees of freedom, over the parameters that should agree.
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

    @property
    def agree(self):
        """Whether records of one sensor would often differ as much."""
        return self.p_value >= SIGNIFICANCE

    def words(self):
        """The verdict as a sentence."""
        if self.agree:
            return (f"the {len(self.records)} records agree on the parameters "
                    f"({p_words(self.p_value)}); the model is their mean, weighted by the inverse "
                    "covariances")
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
    shared = estimated & [name not in _OWN_TO_EACH_RECORD for name in names]
    values, covariance = fits[0].values.copy(), np.zeros_like(fits[0].covariance)
    place = np.ix_(estimated, estimated)
    values[estimated], covariance[place], _ = _weighted_mean(
        [fit.values[estimated] for fit in fits], [fit.covariance[place] for fit in fits])
    place = np.ix_(shared, shared)
    *_, statistic = _weighted_mean([fit.values[shared] for fit in fits],
                                   [fit.covariance[place] for fit in fits])
    freedom = int((len(fits) - 1) * shared.sum())
    p_value = float(chi2.sf(statistic, freedom))
    birge = float(np.sqrt(statistic / freedom)) if p_value < SIGNIFICANCE else 1.0
    return Combination(values, covariance * birge**2, statistic, freedom, p_value, birge)


def agreement(names, fits, combination, nrmse, combined_nrmse, complete):
    """RecordAgreement of the fits of named records; parameters as its attributes."""
    values, std = (np.stack([getattr(fit, part) for fit in fits]) for part in ("values", "std"))
    shared = [i for i, name in enumerate(fits[0].names)
              if name not in _OWN_TO_EACH_RECORD and np.all(std[:, i] > 0)]
    worst = max((abs(values[a, i] - values[b, i]) / np.hypot(std[a, i], std[b, i]), i, a, b)
                 for i in shared for a in range(len(fits)) for b in range(a))
    difference, parameter, second, first = worst
    return RecordAgreement(
        tuple(names), np.asarray(nrmse, float), np.asarray(combined_nrmse, float), fits[0].names,
        values, std, combination.statistic, combination.freedom, combination.p_value,
        combination.birge_factor, fits[0].names[parameter], (names[first], names[second]),
        float(difference), bool(complete))


def _weighted_mean(values, covariances):
    """Weighted mean, its covariance and chi-squared."""
    scale = np.sqrt(np.mean([np.diag(covariance) for covariance in covariances], axis=0))
    weights = [np.linalg.pinv(covariance / np.outer(scale, scale), 1e-12, hermitian=True)
               for covariance in covariances]
    scaled = [value / scale for value in values]
    covariance = np.linalg.pinv(sum(weights), 1e-12, hermitian=True)
    mean = covariance @ sum(weight @ value for weight, value in zip(weights, scaled))
    statistic = sum((value - mean) @ weight @ (value - mean)
                    for weight, value in zip(weights, scaled))
    return mean * scale, covariance * np.outer(scale, scale), float(statistic)
