"""Blocks of a record: which samples a fit learns from and which judge it, and intervals."""

import dataclasses

import numpy as np
from scipy.stats import t as student

# Folds of the cross-validation, and blocks of a long and of a short record, interleaved over them.
FOLDS = 5
_MANY, _FEW, _FEWEST = 40, 20, 10
_LONG, _SHORT = 8000, 800
_RESAMPLES = 500


@dataclasses.dataclass(frozen=True)
class Blocks:
    """Consecutive blocks of a record; block i is judged in fold i modulo `FOLDS`.

    Attributes
    ----------
    edges : ndarray of int, shape (blocks + 1,)
    """

    edges: np.ndarray

    @classmethod
    def of(cls, reference):
        """Blocks that hold as much of the record's time and of the reference's energy as any.

        In a steady record they are equally long; where all motion lies in one shock, half of them
        part it.

        Parameters
        ----------
        reference : ndarray, shape (n,)
            Of the axis, without its mean.
        """
        n = len(reference)
        count = _MANY if n >= _LONG else _FEW if n >= _SHORT else _FEWEST
        weight = np.cumsum(1 / n + reference**2 / max(reference @ reference, 1e-300))
        edges = np.searchsorted(weight, np.linspace(0, weight[-1], count + 1)[1:-1])
        return cls(np.unique(np.r_[0, edges, n]))

    def __len__(self):
        return len(self.edges) - 1

    @property
    def n(self):
        """Samples of the record."""
        return int(self.edges[-1])

    @property
    def shortest(self):
        """Samples of the usual short block (the lower decile)."""
        return int(np.quantile(np.diff(self.edges), 0.1))

    def coarser(self, length):
        """Fewer blocks, each put together of the same number, of about a length at least."""
        together = 1
        while self.shortest * together < length and len(self) // (2 * together) >= FOLDS:
            together *= 2
        return Blocks(np.unique(np.r_[self.edges[::together], self.n])) if together > 1 else self

    def thinned(self, step):
        """Blocks of every step-th sample."""
        return Blocks(np.unique(-(-self.edges // step)))

    def __iter__(self):
        return zip(range(len(self)), self.edges[:-1], self.edges[1:])

    def guarded(self, block, guard):
        """A block with its guards: what the fit that it judges must not have seen.

        At most half of a neighbour is a guard.
        """
        start, stop = self.edges[block], self.edges[block + 1]
        before = min(guard, (start - self.edges[block - 1]) // 2) if block else 0
        after = min(guard, (self.edges[block + 2] - stop) // 2) if block + 1 < len(self) else 0
        return int(start - before), int(stop + after)

    def sums(self, values):
        """Sum of values, shape (..., n), over each block."""
        return np.add.reduceat(values, self.edges[:-1], axis=-1)


def intervals(reductions, shares, power):
    """Intervals of 95 % by a bootstrap over blocks.

    Blocks are resampled (H. Kuensch, Ann. Statist. 17 (1989) 1217), the spread is widened by
    Student's factor for as many blocks as carry the power.

    Parameters
    ----------
    reductions : ndarray, shape (parts, blocks)
        Held-out power that each part takes, block by block.
    shares : ndarray, shape (parts,)
        Estimates about which the intervals lie.
    power : ndarray, shape (blocks,)

    Returns
    -------
    ndarray, shape (parts, 2)
    """
    count = len(power)
    if count < 2:
        return np.tile([0.0, 1.0], (len(shares), 1))
    drawn = np.random.default_rng(0).multinomial(
        count, np.full(count, 1 / count), _RESAMPLES).astype(float)
    ratios = (drawn @ reductions.T) / np.maximum(drawn @ power, 1e-300)[:, None]
    away = ratios - reductions.sum(axis=1) / max(power.sum(), 1e-300)
    carrying = max(power.sum()**2 / max(power @ power, 1e-300), 2.0)
    wider = student.ppf(0.975, carrying - 1) / 1.96 * np.sqrt(carrying / (carrying - 1))
    # basic, not percentile: what is skewed one way in the draws is uncertain the other way
    low, high = np.quantile(away, (0.975, 0.025), axis=0)
    return np.clip(np.stack([shares - wider * low, shares - wider * high], axis=1), 0.0, 1.0)
