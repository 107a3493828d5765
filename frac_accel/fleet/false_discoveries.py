"""Which of many hypotheses to reject at a given false discovery rate."""

import numpy as np
from scipy.stats import false_discovery_control

# Largest share of false ones among what is discovered.
FALSE_DISCOVERY_RATE = 0.01


def discoveries(p_values, rate):
    """Hypotheses to reject, whose tests may depend on each other in any way.

    Y. Benjamini, D. Yekutieli, *Annals of Statistics* 29 (2001) 1165-1188.

    Parameters
    ----------
    p_values : array_like, shape (m,)
        NaN where there is no test.
    rate : float
        Largest expected share of wrong ones among the rejected.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    p_values = np.asarray(p_values, float)
    tested = np.isfinite(p_values)
    rejected = np.zeros(len(p_values), bool)
    # a sum of probabilities may exceed one by rounding
    rejected[tested] = false_discovery_control(np.minimum(p_values[tested], 1.0),
                                               method="by") <= rate
    return rejected
