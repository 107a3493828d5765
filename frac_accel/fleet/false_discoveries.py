"""Which of many hypotheses to reject at a given false discovery rate."""

import numpy as np

# Largest share of false ones among what is discovered.
FALSE_DISCOVERY_RATE = 0.01


def discoveries(p_values, rate, dependent=True):
    """Hypotheses to reject.

    Parameters
    ----------
    p_values : ndarray, shape (m,)
        NaN where there is no test.
    rate : float
        Largest expected share of wrong ones among the rejected.
    dependent : bool
        Whether the tests may depend on each other in any way: Y. Benjamini, D. Yekutieli, *Annals
        of Statistics* 29 (2001) 1165-1188, whose threshold is lower by the sum of 1/i. Otherwise
        Y. Benjamini, Y. Hochberg, *Journal of the Royal Statistical Society B* 57 (1995) 289-300.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    p_values = np.asarray(p_values, float)
    tested = np.flatnonzero(np.isfinite(p_values))
    order = tested[np.argsort(p_values[tested])]
    rejected = np.zeros(len(p_values), bool)
    if not len(order):
        return rejected
    ranks = np.arange(1, len(order) + 1)
    threshold = rate * ranks / len(order) / (np.sum(1 / ranks) if dependent else 1.0)
    below = np.flatnonzero(p_values[order] <= threshold)
    if len(below):
        rejected[order[:below[-1] + 1]] = True
    return rejected
