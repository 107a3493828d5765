"""What changes slowly along the record: weights of a few columns that are smooth in time."""

import numpy as np

from .blocks import FOLDS
from .filters import Normal

# Stretches of each block in which the course of a weight counts as constant.
_STRETCHES = 4


def cosines(place, orders):
    """Cosines of some orders at places along the record, shape (n, orders)."""
    return np.cos(np.pi * np.outer(place, orders))


class Modulated:
    r"""Cross-validated predictions :math:`p_t = \sum_j c_j(t) \sum_m w_{jm} \cos(\pi m t / T)`.

    Parameters
    ----------
    columns : callable
        Gives the columns c, shape (stop - start, p), of the samples from start to stop.
    target : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
    blocks : Blocks
    """

    def __init__(self, columns, target, used, blocks):
        self._columns, self._n = columns, blocks.n
        self._runs, folds, grams, rights = [], [], [], []
        for block, start, stop in blocks:
            edges = np.unique(np.linspace(start, stop, _STRETCHES + 1).astype(int))
            self._runs += list(zip(edges[:-1], edges[1:]))
            folds += [block % FOLDS] * (len(edges) - 1)
        for start, stop in self._runs:
            matrix = columns(start, stop) * used[start:stop, None]
            grams.append(matrix.T @ matrix)
            rights.append(matrix.T @ target[start:stop])
        self._folds, self._grams, self._rights = map(np.array, (folds, grams, rights))

    def predict(self, orders, courses=cosines):
        """Prediction, shape (n,), by cosines of certain orders m; 0 is a constant weight.

        Other `courses` are columns at places from 0 to 1 along the record, given these and the
        orders.
        """
        centre = np.array([(start + stop) / 2 for start, stop in self._runs]) / self._n
        course = courses(centre, orders)
        count, columns = course.shape[1], self._grams.shape[1]
        result = np.zeros(self._n)
        for fold in range(FOLDS):
            judged = self._folds == fold
            # the stretches next to what is judged are its guards
            learnt = ~(judged | np.r_[judged[1:], False] | np.r_[False, judged[:-1]])
            c = course[learnt]
            pairs = np.einsum("sm,sk->smk", c, c).reshape(len(c), -1)
            gram = (pairs.T @ self._grams[learnt].reshape(len(c), -1)).reshape(
                count, count, columns, columns).transpose(0, 2, 1, 3)
            size = count * columns
            weights = Normal(gram.reshape(size, size),
                             (c.T @ self._rights[learnt]).ravel()).solve()
            weights = course @ weights.reshape(count, -1)
            for place in np.flatnonzero(judged):
                start, stop = self._runs[place]
                result[start:stop] = self._columns(start, stop) @ weights[place]
        return result
