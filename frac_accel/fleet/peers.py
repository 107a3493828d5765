"""What stands out in a fleet: vehicles among their peers, causes that a group names more often."""

import numpy as np
from scipy.special import ndtr
from scipy.stats import hypergeom

from .false_discoveries import FALSE_DISCOVERY_RATE, discoveries
from .groups import FEWEST

# Median absolute deviation to standard deviation of normal values.
_MAD = 1.4826


def odd_vehicles(estimates, owners):
    """Vehicles that differ from their peers in a cause.

    The peers' centre and spread are the median and the median absolute deviation, which a few odd
    ones do not move.

    Parameters
    ----------
    estimates : Estimates
        Without what groups have in common.
    owners : list of str

    Returns
    -------
    list of dict
        ``vehicle``, ``cause``, ``parameter``, ``unit``, ``value``, ``std``, ``peers`` (their
        median), ``deviations`` (in standard deviations of an estimate among the peers); the largest
        of each vehicle, the largest first.
    """
    values, stds = estimates.values, estimates.stds
    centre = _median(values)
    with np.errstate(invalid="ignore", divide="ignore"):
        deviations = (values - centre) / stds / usual_scatter(estimates)
    odd = discoveries((2 * ndtr(-np.abs(deviations))).ravel(),
                      FALSE_DISCOVERY_RATE).reshape(values.shape)
    found = []
    for row in np.flatnonzero(odd.any(axis=1)):
        cause = int(np.nanargmax(np.where(odd[row], np.abs(deviations[row]), np.nan)))
        found.append({"vehicle": owners[row], "cause": estimates.names[cause][0],
                      "parameter": estimates.names[cause][1], "unit": estimates.units[cause],
                      "value": float(values[row, cause]), "std": float(stds[row, cause]),
                      "peers": float(centre[cause]), "deviations": float(deviations[row, cause])})
    return sorted(found, key=lambda entry: -abs(entry["deviations"]))


def usual_scatter(estimates):
    """By how much more than they say a fleet's estimates of each cause scatter, shape (p,).

    The median and the median absolute deviation, which a few odd ones do not move; at least 1.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        standard = (estimates.values - _median(estimates.values)) / estimates.stds
    return np.maximum(np.nan_to_num(_MAD * _median(np.abs(standard)), nan=1.0), 1.0)


def _median(values):
    """Of each column; NaN where there are too few."""
    return np.array([np.median(own) if len(own) >= FEWEST else np.nan
                     for own in (column[np.isfinite(column)] for column in values.T)])


def common_causes(named, groups):
    """Causes that single bags name more often in a group of vehicles than elsewhere.

    Parameters
    ----------
    named : list of set of str
        Causes of each vehicle.
    groups : dict of str to ndarray of bool, shape (n,)

    Returns
    -------
    list of dict
        ``group``, ``cause``, ``vehicles`` (with it, in the group), ``of`` (all in the group),
        ``elsewhere``, ``of_elsewhere``, ``p_value`` (Fisher's exact test, one-sided).
    """
    found = []
    for cause in sorted(set().union(*named)):
        has = np.array([cause in own for own in named])
        for name, rows in groups.items():
            if rows.all() or rows.sum() < 2:
                continue
            inside = int(has[rows].sum())
            found.append({
                "group": name, "cause": cause, "vehicles": inside, "of": int(rows.sum()),
                "elsewhere": int(has.sum()) - inside, "of_elsewhere": int((~rows).sum()),
                "p_value": float(hypergeom.sf(inside - 1, len(has), has.sum(), rows.sum()))})
    passed = discoveries([entry["p_value"] for entry in found], FALSE_DISCOVERY_RATE)
    return sorted((entry for entry, good in zip(found, passed) if good),
                  key=lambda entry: entry["p_value"])
