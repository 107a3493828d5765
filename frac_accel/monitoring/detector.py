r"""Sequential detection of a change with a stated rate of false alarms.

Every so many blocks give a handful of scores: how far the residual has moved along each direction,
in the standard deviations of a learning time, and its size. A score is turned into a p value by its
rank among all scores before it. While nothing changes, that is, as long as scores come in no
particular order, these p values are independent and uniform whatever the noise's distribution
(V. Vovk, A. Gammerman, G. Shafer, *Algorithmic Learning in a Random World*, 2005, theorem 2.2); how
the scores depend on each other within one instant does not matter either. Each becomes a bet on
small ones with the expected value one,

.. math:: e(p) = \int_0^1 \kappa p^{\kappa - 1} d\kappa = \frac{1 - p + p \ln p}{p \ln^2 p},

and the bets a Shiryaev-Roberts statistic :math:`R_k = (1 + R_{k-1}) e_k`. Then
:math:`R_k - k` is a martingale, so is the mean over the scores, and the mean time to an alarm at
:math:`R \ge A` is at least A (M. Pollak, *Annals of Statistics* 15 (1987) 749-779; J. Shin,
A. Ramdas, A. Rinaldo, *New England Journal of Statistics in Data Science* 2 (2024) 229-260).
"""

import bisect

import numpy as np

from ..signals.normal_equations import solve
from .blocks import BLOCK_S, DIRECTIONS

# Mean time between false alarms [h].
FALSE_ALARM_H = 1000.0
# Blocks that make one score: longer than what a residual remembers.
TOGETHER = 8
# Groups of blocks from which the scores' scale is learnt; the ranks begin after them, so that the
# score is a fixed function of each group.
LEARNING = 60
# Scores that are remembered at most; beyond, which of them go is drawn.
_REMEMBERED = 20_000


class Detector:
    """Watches blocks for a change.

    Parameters
    ----------
    false_alarm_h : float
        Mean time between false alarms [h].
    seed : int

    Attributes
    ----------
    learnt : Learnt or None
        None while it is learning.
    statistic : float
        Mean of the Shiryaev-Roberts statistics.
    threshold : float
    """

    def __init__(self, false_alarm_h=FALSE_ALARM_H, seed=0):
        self.threshold = false_alarm_h * 3600 / (BLOCK_S * TOGETHER)
        self.learnt, self.statistic = None, 0.0
        self._rng = np.random.default_rng(seed)
        self._waiting, self._scores = [], [[] for _ in range(len(DIRECTIONS) + 1)]
        self._statistics = np.zeros(len(DIRECTIONS) + 1)

    def add(self, merged):
        """Take in blocks of `TOGETHER`; whether there is an alarm."""
        if self.learnt is None:
            self._waiting.append(merged)
            if sum(len(part.power) for part in self._waiting) < LEARNING:
                return False
            self.learnt, self._waiting = Learnt(type(merged).joined(self._waiting)), []
            return False
        alarm = False
        for scores in self.learnt.scores(merged):
            p_values = self._remember(scores)
            self._statistics = (1 + self._statistics) * _bet(p_values)
            self.statistic = float(np.mean(self._statistics))
            alarm |= self.statistic >= self.threshold
        return alarm

    def _remember(self, scores):
        """p values of new scores among all before, which they join."""
        p_values = np.empty(len(scores))
        for i, (score, known) in enumerate(zip(scores, self._scores)):
            above = len(known) - bisect.bisect_right(known, score)
            equal = len(known) - above - bisect.bisect_left(known, score)
            p_values[i] = (above + self._rng.random() * (equal + 1)) / (len(known) + 1)
            bisect.insort(known, score)
            if len(known) > _REMEMBERED:
                del known[self._rng.integers(len(known))]
        return p_values


class Learnt:
    """What a healthy residual is like.

    Parameters
    ----------
    merged : Blocks

    Attributes
    ----------
    mean : ndarray, shape (p,)
        The model's own error along each direction.
    variance : float
        Of a sample's noise [output units²].
    inflation : ndarray, shape (p,)
        By how much more the sums scatter than those of white noise: the residual's memory, and
        what the model gets wrong now and then.
    """

    def __init__(self, merged):
        self.mean = solve(merged.gram.sum(axis=0), merged.shared.sum(axis=0), rcond=1e-9)
        self.variance = float(np.sum(self.left(merged)) / np.sum(merged.count))
        self.inflation = np.maximum(np.mean(self._standard(merged)**2, axis=0), 1e-12)

    def scores(self, merged):
        """Scores of each block, shape (k, p + 1): none where a direction is not there."""
        moved = np.abs(self._standard(merged)) / np.sqrt(self.inflation)
        size = np.log(np.maximum(self.left(merged), 1e-300)
                      / np.maximum(merged.count, 1.0) / self.variance)
        return np.c_[moved, np.abs(size)]

    def left(self, merged):
        """Power of the residual without the model's own error, shape (k,)."""
        return (merged.power - 2 * merged.shared @ self.mean
                + np.einsum("i,kij,j->k", self.mean, merged.gram, self.mean))

    def _standard(self, merged):
        """Sums along each direction, over those of white noise."""
        own = np.diagonal(merged.gram, axis1=1, axis2=2)
        return ((merged.shared - merged.gram @ self.mean)
                / np.sqrt(np.maximum(own * self.variance, 1e-300)) * (own > 0))


def _bet(p_values):
    """Expected value one for uniform ones, large for small ones."""
    p = np.clip(p_values, 1e-12, 1 - 1e-6)
    log = np.log(p)
    return (1 - p + p * log) / (p * log**2)
