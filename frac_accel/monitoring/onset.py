"""When a change began, with an interval: of one that came at once, or grew."""

from typing import NamedTuple

import numpy as np

from .blocks import BLOCK_S

# Blocks that must lie on either side of an onset.
_SIDE = 4
_COVERAGE = 0.95


class Onset(NamedTuple):
    """Beginning of a change.

    Attributes
    ----------
    ns, low_ns, high_ns : int
        Stamp at which it began, and its 95 % interval.
    is_gradual : bool
        Whether a growing change describes the residual better than a sudden one.
    """

    ns: int
    low_ns: int
    high_ns: int
    is_gradual: bool


def onset(blocks, learnt):
    r"""Posterior of the instant at which a residual has changed, all instants being as likely.

    Before it, the residual is what was learnt; after it, each direction has a share of its own and
    the noise a size of its own (sudden), or the shares grow with time (gradual). Both have the
    same number of parameters, which are profiled. All logarithms of likelihoods are divided by the
    factor by which the healthy residual's sums scatter more than those of white noise, so that
    correlated samples do not count as independent ones.

    Parameters
    ----------
    blocks : Blocks
        From before the change until now.
    learnt : Learnt

    Returns
    -------
    Onset
    """
    shared = blocks.shared - blocks.gram @ learnt.mean
    power = np.maximum(learnt.left(blocks), 1e-300)
    time = np.arange(len(power), dtype=float)
    places = np.arange(_SIDE, len(power) - _SIDE)
    inflation = max(float(np.max(learnt.inflation)), 1.0)
    before = -np.cumsum(power) / (2 * learnt.variance) \
        - np.cumsum(blocks.count) / 2 * np.log(learnt.variance)

    def after(values):
        return np.cumsum(values[::-1], axis=0)[::-1]
    count, left = after(blocks.count), after(power)
    sums = [after(blocks.gram * w[:, None, None]) for w in (np.ones_like(time), time, time**2)]
    of_shared = [after(shared * w[:, None]) for w in (np.ones_like(time), time)]
    likelihoods = []
    for is_gradual in (False, True):
        if is_gradual:
            at = places.astype(float)[:, None]
            gram = sums[2][places] - 2 * at[..., None] * sums[1][places] \
                + at[..., None]**2 * sums[0][places]
            with_residual = of_shared[1][places] - at * of_shared[0][places]
        else:
            gram, with_residual = sums[0][places], of_shared[0][places]
        explained = _explained(gram, with_residual)
        rest = np.maximum(left[places] - explained, 1e-12 * left[places])
        n = count[places]
        likelihoods.append(before[places - 1] - n / 2 * np.log(rest / np.maximum(n, 1)) - n / 2)
    likelihoods = np.array(likelihoods) / inflation
    weight = np.exp(likelihoods - likelihoods.max())
    is_gradual = bool(weight[1].sum() > weight[0].sum())
    share = np.cumsum(weight.sum(axis=0)) / weight.sum()
    low, middle, high = (int(places[min(np.searchsorted(share, level), len(places) - 1)])
                         for level in ((1 - _COVERAGE) / 2, 0.5, (1 + _COVERAGE) / 2))
    step = round(BLOCK_S * 1e9)
    # it began within a block, or just before it
    return Onset(int(blocks.start_ns[middle]), int(blocks.start_ns[low] - step),
                 int(blocks.start_ns[high] + step), is_gradual)


def _explained(gram, shared):
    """Squares that least squares explain, for each of many normal equations."""
    size = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 1e-300))
    scaled = gram / (size[:, :, None] * size[:, None, :])
    scaled = scaled + 1e-9 * np.eye(gram.shape[1])
    right = shared / size
    return np.sum(right * np.linalg.solve(scaled, right[..., None])[..., 0], axis=1)
