"""Counts over the rows of `trial.run`; each function takes rows and knows nothing of files."""

from collections import Counter
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import logit
from scipy.stats import binomtest, chi2, ncx2

# Causes that a model identified from the record itself has taken in.
ABSORBED = {"sensitivity_error", "offset", "core_parameter_shift", "time_delay"}
# Effects on stamps, which carry no noise: there is no limit that noise would set.
ON_STAMPS = {"timestamp_jitter", "dropped_samples"}
# What a parameter is where there is no effect, where that is not zero.
_NEUTRAL = {"gain": 1.0, "damping_order": 1.0}


class Share(NamedTuple):
    """Successes of n, with the exact (Clopper-Pearson) 95 % interval."""

    successes: int
    n: int
    low: float
    high: float

    def __str__(self):
        if not self.n:
            return "-"
        return (f"{100 * self.successes / self.n:.1f} % ({self.successes}/{self.n}; "
                f"{100 * self.low:.1f} to {100 * self.high:.1f})")


def share(flags):
    """Share of true flags."""
    flags = [bool(flag) for flag in flags]
    if not flags:
        return Share(0, 0, 0.0, 1.0)
    interval = binomtest(sum(flags), len(flags)).proportion_ci(method="exact")
    return Share(sum(flags), len(flags), float(interval.low), float(interval.high))


def of_group(rows, group):
    """Rows of one group."""
    return [row for row in rows if row["group"] == group]


def named(row):
    """Causes that the diagnosis names."""
    return set(row["findings"])


def wrong(row):
    """Names of causes that are neither hidden nor part of the surroundings."""
    return named(row) - set(row["causes"]) - set(row.get("besides", ()))


def exact(row):
    """True where all hidden causes are named and no wrong one."""
    return row["error"] is None and set(row["causes"]) <= named(row) and not wrong(row)


def consistent(row):
    """True where a sensor as modelled is said to be one."""
    return row["verdict"] == "consistent" and not row["findings"]


def quiet(row):
    """True where nothing is named and no alarm is given: undecided is as good as consistent."""
    return row["verdict"] in ("consistent", "undecided") and not row["findings"]


def answered_without_a_wrong_name(row):
    """True where there is an answer and what it names is there."""
    return row["error"] is None and row["verdict"] != "insufficient_data" and not wrong(row)


def unexplained(row):
    """True where physics outside the catalogue is seen, or left undecided, and given no name.

    What is merely said to be there besides it, and is, may be named.
    """
    seen = row["verdict"] in ("unexplained", "partly_explained", "undecided")
    return row["error"] is None and seen and not wrong(row)


def right(row):
    """Whether a diagnosis is what it should be for its group; None for the power study.

    `undecided` names nothing: right where there is no cause of the catalogue, a miss elsewhere.
    """
    judges = {"single": exact, "multiple": exact, "clean": quiet, "outside": unexplained,
              "without_model": lambda row: row["error"] is None and not wrong(row),
              "second_set": exact, "road_single": exact, "road_multiple": exact,
              "road_clean": answered_without_a_wrong_name, "road_outside": unexplained}
    return judges[row["group"]](row) if row["group"] in judges else None


def confusion(rows):
    """True causes (joined by +) -> Counter of the causes named; `nothing` where none is."""
    table = {}
    for row in rows:
        entry = table.setdefault("+".join(row["causes"]) or "none", Counter())
        entry.update(named(row) or {"nothing" if row["error"] is None else "error"})
    return table


class ParameterErrors(NamedTuple):
    """Errors of one parameter over the rows that name its cause.

    Attributes
    ----------
    of_value, of_departure : Share
        Within 10 % of the true value, and of its difference from no effect.
    covered : Share
        True value within 1.96 stated standard uncertainties.
    without_std : int
        Findings without a usable uncertainty.
    """

    of_value: Share
    of_departure: Share
    covered: Share
    without_std: int


def parameter_errors(rows):
    """(cause, parameter) -> ParameterErrors; uses the findings whose cause is truly there."""
    collected = {}
    for row in rows:
        for cause, truth in row["truth"].items():
            for name, true in truth.items() if cause in row["findings"] else ():
                if isinstance(true, str):  # a filter's family is right or wrong, not near
                    continue
                entry = collected.setdefault((cause, name), ([], [], [], []))
                found = row["findings"][cause].get(name, {"value": np.nan, "std": None})
                error = abs(found["value"] - true)
                neutral = _NEUTRAL.get(name, 0.0)
                if cause == "core_parameter_shift":
                    neutral = row["core"][name]
                entry[0].append(error <= 0.1 * abs(true))
                entry[1].append(error <= 0.1 * abs(true - neutral))
                std = found["std"]
                if std is None or not np.isfinite(std):
                    entry[3].append(True)
                else:
                    entry[2].append(error <= 1.96 * std)
    return {key: ParameterErrors(share(value), share(departure), share(covered), len(missing))
            for key, (value, departure, covered, missing) in collected.items()}


def coverage(rows):
    """For each parameter of a rightly named cause, whether its 95 % interval holds the truth."""
    found = parameter_errors(rows).values()
    return [hit < entry.covered.successes for entry in found for hit in range(entry.covered.n)]


def error_over_oracle(rows):
    """Extended model's held-out error over that of the true sensor, of the rows that name a cause.

    Returns
    -------
    ndarray
    """
    return np.array([row["extended_rmse"] / row["oracle_rmse"] for row in rows
                     if row["findings"] and row["extended_rmse"] is not None])


def correction_share(rows):
    """Share of the oracle's gain in power that correction by the extended model reaches.

    Returns
    -------
    shares : ndarray
    not_measured : Counter
        Words of the errors where a model could not be inverted.
    """
    shares, errors = [], Counter()
    for row in rows:
        c = row["correction"]
        if isinstance(c, str):
            errors[c] += 1
        elif c is not None and c["in_use"] > 1.05 * c["oracle"]:  # else there is nothing to gain
            shares.append((c["in_use"] ** 2 - c["extended"] ** 2)
                          / (c["in_use"] ** 2 - c["oracle"] ** 2))
    return np.array(shares), errors


class Power(NamedTuple):
    """Where a cause begins to be found.

    Attributes
    ----------
    found_in_90_percent : float
        Effect's RMS over the noise's that is found in 90 % of the runs; NaN where none was found.
    limit : float
        The same for the likelihood-ratio test that knows the cause.
    smallest, largest : float
        Range that was tried.
    found : Share
    """

    found_in_90_percent: float
    limit: float
    smallest: float
    largest: float
    found: Share


def power(rows, false_alarm):
    """Power for one cause.

    Parameters
    ----------
    rows : sequence of dict
        Of one cause, with effects of different strengths.
    false_alarm : float
        Level of the likelihood-ratio test.
    """
    cause = rows[0]["causes"][0]
    strength = np.array([row["strength"][cause] for row in rows])
    found = np.array([cause in row["findings"] for row in rows])
    limit = np.nan
    if cause not in ON_STAMPS:
        limit = float(np.median([likelihood_ratio_limit(
            row["samples"], len(row["truth"][cause]), false_alarm) for row in rows]))
    return Power(logistic_threshold(strength, found), limit, float(strength.min()),
                 float(strength.max()), share(found))


def logistic_threshold(strength, found, probability=0.9):
    """Strength at which the probability of being found is reached; NaN where nothing was found.

    Logistic regression on the logarithm of the strength with the weak prior that its slope is not
    much steeper than ten decades' worth, without which separated data would have no solution.
    """
    if not found.any():
        return float("nan")
    x = np.log10(strength)

    def cost(p):
        score = p[1] * (x - p[0])
        return np.sum(np.logaddexp(0, np.where(found, -score, score))) + 0.5 * (p[1] / 20) ** 2

    starts = [(place, slope) for place in np.quantile(x, (0.1, 0.5, 0.9)) for slope in (2.0, 8.0)]
    fits = [minimize(cost, start, method="L-BFGS-B",
                     bounds=[(x.min() - 2, x.max() + 2), (0.1, 200)]) for start in starts]
    middle, slope = min(fits, key=lambda fit: fit.fun).x
    return float(10 ** (middle + logit(probability) / slope))


def likelihood_ratio_limit(samples, parameters, false_alarm, probability=0.9):
    """Effect's RMS over the noise's that the likelihood-ratio test finds, the cause being known.

    The statistic of n white samples is chi-squared with noncentrality n r**2 for an effect of r
    times the noise, in the limit of small effects (S. Kay, Fundamentals of Statistical Signal
    Processing II, 1998, 6.5).
    """
    threshold = chi2.isf(false_alarm, parameters)
    low, high = 0.0, 1e4
    for _ in range(100):
        middle = (low + high) / 2
        low, high = ((low, middle) if ncx2.sf(threshold, parameters, middle) > probability
                     else (middle, high))
    return float(np.sqrt(high / samples))
