"""What a fleet knows that one bag does not: weak effects, common causes, odd vehicles.

Every bag of a screened diagnosis tells what each cause would be on its own, with its uncertainty
and with the correlations of the causes' effects. Those of a vehicle are averaged; over a group of
vehicles they are pooled by the random-effects model.
"""

import dataclasses

import numpy as np
from scipy.special import ndtr
from scipy.stats import hypergeom

from .false_discoveries import discoveries
from .random_effects import pool

# Largest share of false ones among what is discovered.
FALSE_DISCOVERY_RATE = 0.01
# Fewest vehicles whose estimates are pooled, and that make a group.
FEWEST = 8
# Most weak effects that are told apart; each takes a pass over all groups.
_MOST = 20
# Variances by which the discovered cause must fit a group better than a rival.
_CLEAR = 10.0
# Median absolute deviation to standard deviation of normal values.
_MAD = 1.4826


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates:
    """First-order estimates of some owners: bags, or vehicles.

    Attributes
    ----------
    names : list of (str, str)
        Cause and parameter.
    units : list of str
    values, stds, sizes : ndarray, shape (n, p)
        NaN where an owner has none; `sizes` are RMS effects of one unit [output units].
    correlations : ndarray, shape (n, p, p)
        Of the effects on the output; NaN where there is none.
    """

    names: list
    units: list
    values: np.ndarray
    stds: np.ndarray
    sizes: np.ndarray
    correlations: np.ndarray

    @classmethod
    def of(cls, screened):
        """Of what `Diagnosis.screened` says of each bag."""
        units = {}
        for one in screened:
            units.update({(e["cause"], e["parameter"]): e["unit"] for e in one["estimates"]})
        names = sorted(units)
        place = {name: i for i, name in enumerate(names)}
        shape = len(screened), len(names)
        values, stds, sizes = np.full((3, *shape), np.nan)
        correlations = np.full((*shape, len(names)), np.nan, np.float32)
        for i, one in enumerate(screened):
            own = [place[e["cause"], e["parameter"]] for e in one["estimates"]]
            for array, key in ((values, "value"), (stds, "std"), (sizes, "size")):
                array[i, own] = [e[key] for e in one["estimates"]]
            upper = np.triu_indices(len(own), 1)
            block = np.eye(len(own))
            block[upper] = one["correlations"]
            block.T[upper] = block[upper]
            correlations[i][np.ix_(own, own)] = block
        return cls(names, [units[name] for name in names], values, stds, sizes, correlations)

    def by_owner(self, owners):
        """The same of owners who have several bags each, and who they are."""
        found, first = {}, list(dict.fromkeys(owners))
        owners = np.array(owners, object)
        for owner in first:
            rows = np.flatnonzero(owners == owner)
            weight = np.where(np.isfinite(self.stds[rows]), 1 / self.stds[rows]**2, 0.0)
            total = weight.sum(axis=0)
            with np.errstate(invalid="ignore", divide="ignore"):
                mean = np.nansum(weight * np.nan_to_num(self.values[rows]), axis=0) / total
                # bags that scatter more than they say make their mean less certain
                scatter = np.nansum(weight * (np.nan_to_num(self.values[rows]) - mean)**2, axis=0)
                freedom = np.maximum((weight > 0).sum(axis=0) - 1, 1)
                std = np.sqrt(np.maximum(scatter / freedom, 1.0) / total)
            found[owner] = mean, std, rows[0]
        values, stds, place = zip(*found.values())
        place = list(place)
        return first, dataclasses.replace(
            self, values=np.array(values), stds=np.array(stds), sizes=self.sizes[place],
            correlations=self.correlations[place])

    def without(self, rows, cause, mean):
        """The same after an effect of some owners has been taken out of all their estimates.

        What one unit of it adds to another cause's own estimate is the correlation of the two
        effects times the ratio of their sizes.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (self.correlations[rows, :, cause] * self.sizes[rows, cause][:, None]
                     / self.sizes[rows])
        values = self.values.copy()
        values[rows] -= mean * np.nan_to_num(share)
        return dataclasses.replace(self, values=values)


@dataclasses.dataclass(frozen=True)
class WeakEffect:
    """A cause that a group of vehicles shows together.

    Attributes
    ----------
    group : str
        Such as ``lot = B``.
    cause, parameter, unit : str
    pooled : Pooled
    confusable_with : list of str
        Causes that would say the same of this group.
    """

    group: str
    cause: str
    parameter: str
    unit: str
    pooled: object
    confusable_with: list


def weak_effects(estimates, groups, rate=FALSE_DISCOVERY_RATE):
    """Causes that groups of vehicles show together, the clearest first.

    In each pass all causes in all groups are tested against a mean of zero, and of the discoveries
    (`discoveries`, for tests that depend on each other) the clearest is taken and taken out of its
    vehicles, so that neither its rivals nor groups with the same vehicles are found by it again.

    Parameters
    ----------
    estimates : Estimates
    groups : dict of str to ndarray of bool, shape (n,)
    rate : float

    Returns
    -------
    effects : list of WeakEffect
    rest : Estimates
        Without these effects.
    """
    found = []
    for _ in range(_MOST):
        table = {(name, cause): pooled for name, rows in groups.items()
                 for cause, pooled in _tested(estimates, rows)}
        keys = list(table)
        passed = discoveries([table[key].p_value for key in keys], rate)
        if not passed.any():
            break
        clearest = min((key for key, good in zip(keys, passed) if good),
                       key=lambda key: (table[key].p_value, -_score(table[key])))
        name, cause = clearest
        best = _best_of_group(estimates, groups[name], cause, table, name)
        found.append(WeakEffect(name, *estimates.names[best], estimates.units[best],
                                table[name, best],
                                _rivals(estimates, groups[name], best, table, name)))
        estimates = estimates.without(groups[name] & np.isfinite(estimates.values[:, best]), best,
                                      table[name, best].mean)
    return found, estimates


def _tested(estimates, rows):
    for cause in range(len(estimates.names)):
        own = rows & np.isfinite(estimates.values[:, cause]) & (estimates.stds[:, cause] > 0)
        if own.sum() >= FEWEST:
            yield cause, pool(estimates.values[own, cause], estimates.stds[own, cause])


def _score(pooled):
    """Squares that a mean explains, in variances."""
    return (pooled.mean / pooled.std)**2


def _best_of_group(estimates, rows, cause, table, name):
    """The cause that explains most of what a group shows together."""
    return max((other for group, other in table if group == name),
               key=lambda other: _score(table[name, other]), default=cause)


def _rivals(estimates, rows, cause, table, name):
    """Causes that explain nearly as much of the same group."""
    least = _score(table[name, cause]) - _CLEAR
    return sorted({estimates.names[other][0] for group, other in table
                   if group == name and other != cause and _score(table[group, other]) > least}
                  - {estimates.names[cause][0]})


def odd_vehicles(estimates, owners, rate=FALSE_DISCOVERY_RATE):
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
    with np.errstate(invalid="ignore", divide="ignore"):
        count = np.isfinite(values).sum(axis=0)
        centre = np.array([np.median(v[np.isfinite(v)]) if n >= FEWEST else np.nan
                           for v, n in zip(values.T, count)])
        standard = (values - centre) / stds
        # what the peers' own uncertainties do not account for
        excess = np.array([_MAD * np.median(np.abs(z[np.isfinite(z)])) if n >= FEWEST else np.nan
                           for z, n in zip(standard.T, count)])
        deviations = standard / np.maximum(excess, 1.0)
    odd = discoveries((2 * ndtr(-np.abs(deviations))).ravel(), rate).reshape(values.shape)
    found = []
    for row in np.flatnonzero(odd.any(axis=1)):
        cause = int(np.nanargmax(np.where(odd[row], np.abs(deviations[row]), np.nan)))
        found.append({"vehicle": owners[row], "cause": estimates.names[cause][0],
                      "parameter": estimates.names[cause][1], "unit": estimates.units[cause],
                      "value": float(values[row, cause]), "std": float(stds[row, cause]),
                      "peers": float(centre[cause]), "deviations": float(deviations[row, cause])})
    return sorted(found, key=lambda entry: -abs(entry["deviations"]))


def common_causes(named, groups, rate=FALSE_DISCOVERY_RATE):
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
    passed = discoveries([entry["p_value"] for entry in found], rate)
    return sorted((entry for entry, good in zip(found, passed) if good),
                  key=lambda entry: entry["p_value"])
