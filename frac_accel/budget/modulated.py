"""What changes slowly along the record: weights of a few columns that are smooth in time."""

import numpy as np

from .blocks import FOLDS
from .filters import solve

# Stretches of each block in which the course of a weight counts as constant.
_STRETCHES = 4


def modulated(columns, orders, target, used, blocks):
    r"""Cross-validated prediction :math:`p_t = \sum_j c_j(t) \sum_m w_{jm} \cos(\pi m t / T)`.

    Parameters
    ----------
    columns : callable
        Gives the columns c, shape (stop - start, p), of the samples from start to stop.
    orders : sequence of int
        The m; 0 is a constant weight.
    target : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    blocks : Blocks

    Returns
    -------
    ndarray, shape (n,)
    """
    runs, folds = [], []
    for block, start, stop in blocks:
        edges = np.unique(np.linspace(start, stop, _STRETCHES + 1).astype(int))
        runs += list(zip(edges[:-1], edges[1:]))
        folds += [block % FOLDS] * (len(edges) - 1)
    folds = np.array(folds)
    centre = np.array([(start + stop) / 2 for start, stop in runs]) / blocks.n
    course = np.cos(np.pi * np.outer(centre, orders))
    grams, rights = [], []
    for start, stop in runs:
        matrix = columns(start, stop) * used[start:stop, None]
        grams.append(matrix.T @ matrix)
        rights.append(matrix.T @ target[start:stop])
    grams, rights = np.array(grams), np.array(rights)
    result = np.zeros(blocks.n)
    for fold in range(FOLDS):
        judged = folds == fold
        # the stretches next to what is judged are its guards
        learnt = ~(judged | np.r_[judged[1:], False] | np.r_[False, judged[:-1]])
        c, g, r = course[learnt], grams[learnt], rights[learnt]
        pairs = np.einsum("sm,sk->smk", c, c).reshape(len(c), -1)
        gram = (pairs.T @ g.reshape(len(c), -1)).reshape(
            len(orders), len(orders), g.shape[1], g.shape[1]).transpose(0, 2, 1, 3)
        size = len(orders) * g.shape[1]
        weights = solve(gram.reshape(size, size), (c.T @ r).ravel())
        weights = course @ weights.reshape(len(orders), -1)
        for place in np.flatnonzero(judged):
            start, stop = runs[place]
            result[start:stop] = columns(start, stop) @ weights[place]
    return result
