"""Causes that a group of vehicles shows together, where no single bag shows any.

A cause's estimates are pooled over a group by the random-effects model. A discovery says that a
group is not as modelled; which cause it is, is another question, since causes whose effects look
alike are discovered together. The answer is a confidence set: the causes beside whose own, freely
differing effects in every vehicle nothing else is left in the group. The true one is missing in it
only as often as the test errs. If no single cause is enough, two are tried.
"""

import dataclasses
import itertools

import numpy as np

from .false_discoveries import FALSE_DISCOVERY_RATE, discoveries
from .groups import FEWEST
from .peers import usual_scatter
from .random_effects import pool

# Most weak effects that are told apart; each takes a pass over all groups.
_MOST = 20
# Values by whose standard deviation a scale would be known as well as by the median of one.
_MEDIANS = 0.37


@dataclasses.dataclass(frozen=True)
class WeakEffect:
    """A cause that a group of vehicles shows together.

    Attributes
    ----------
    group : str
        Such as ``lot = B``.
    cause, parameter, unit : str
        What explains most, of all that explain enough.
    pooled : Pooled
    confusable_with : list of str
        Other causes that would explain the group as well.
    at_work : int
        How many of them are needed together: 1, 2, or 3 for more than two.
    """

    group: str
    cause: str
    parameter: str
    unit: str
    pooled: object
    confusable_with: list
    at_work: int = 1

    @property
    def rivals(self):
        """The others in words; empty where there are none."""
        if not self.confusable_with:
            return ""
        count = {1: "or", 2: "two of it and", 3: "several of it and"}[self.at_work]
        return f"{count} {', '.join(self.confusable_with)}"


def weak_effects(estimates, groups):
    """Causes that groups of vehicles show together, the clearest first.

    In each pass all causes in all groups are tested against a mean of zero and the scatter that a
    cause's estimates have in the whole fleet (B. Efron, *Journal of the American Statistical
    Association* 99 (2004) 96-104), and of the discoveries (`discoveries`, for tests that depend on
    each other) the clearest is taken. All causes that may
    be behind it are then left free in its vehicles, so that neither its rivals nor groups with the
    same vehicles are found by it again. Discoveries have half of the rate, and their names the
    other half.

    Parameters
    ----------
    estimates : Estimates
    groups : dict of str to ndarray of bool, shape (n,)

    Returns
    -------
    effects : list of WeakEffect
    rest : Estimates
        Without the means of these effects.
    """
    found, rest = [], estimates
    for _ in range(_MOST):
        usual = usual_scatter(estimates)
        tests = {(name, cause): own for name, rows in groups.items()
                 for cause, *own in _tested(estimates, rows, usual)}
        passed = [key for key, good in zip(tests, discoveries(
            [pooled.p_value for pooled, _ in tests.values()], FALSE_DISCOVERY_RATE / 2)) if good]
        if not passed:
            break
        group = max(passed, key=lambda key: tests[key][1])[0]
        rows, shown = groups[group], [cause for name, cause in passed if name == group]
        behind, at_work = _behind(estimates, rows, shown)
        best = max(behind, key=lambda cause: tests[group, cause][1])
        pooled = tests[group, best][0]
        names = {estimates.names[cause][0] for cause in behind} - {estimates.names[best][0]}
        found.append(WeakEffect(group, *estimates.names[best], estimates.units[best], pooled,
                                sorted(names), at_work))
        rest = rest.without(rows & np.isfinite(estimates.values[:, best]), best, pooled.mean)
        estimates = estimates.beside(rows, behind)
    return found, rest


def _tested(estimates, rows, usual):
    """Tests of a group's causes against the scatter that is usual in the fleet.

    Yields the cause, `Pooled`, and the squares that a mean explains, in variances.
    """
    known = np.isfinite(estimates.values) & (estimates.stds > 0)
    for cause in range(len(estimates.names)):
        own = rows & known[:, cause]
        if own.sum() >= FEWEST:
            values, stds = estimates.values[own, cause], estimates.stds[own, cause] * usual[cause]
            weight = stds**-2
            yield (cause, pool(values, stds, _MEDIANS * (known[:, cause].sum() - 1)),
                   (weight @ values)**2 / weight.sum())


def _behind(estimates, rows, shown):
    """Causes that may be behind what a group shows, and how many of them are needed."""
    own = dataclasses.replace(estimates, **{name: getattr(estimates, name)[rows] for name in (
        "values", "stds", "sizes", "correlations")})
    tested = [cause for cause in range(len(own.names))
              if np.isfinite(own.values[:, cause]).sum() >= FEWEST]
    # a cause that the group does not show by itself leaves what it does show as it is
    for at_work, choices in ((1, [(cause,) for cause in tested]),
                             (2, list(itertools.combinations(shown, 2)))):
        enough = [causes for causes in choices if _is_enough(own, causes)]
        if enough:
            return sorted(set().union(*enough)), at_work
    return shown, 3


def _is_enough(own, causes):
    """Whether nothing is left in a group beside some causes."""
    everyone = np.ones(len(own.values), bool)
    p_values = [pooled.p_value for _, pooled, _ in _tested(
        own.beside(everyone, causes), everyone, np.ones(len(own.names)))]
    return min(p_values, default=1.0) * len(p_values) > FALSE_DISCOVERY_RATE / 2
