"""Columns that are zero but in a few rows, as motions are that fade away."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ..simulation.free_motion import at_level, shares_within

# Share of the largest singular value that counts as none.
_NONE = 1e-6
# Share of its bound from which a column is held there.
_HELD = 1 - 1e-9


class ShortColumns(NamedTuple):
    """Columns of shape (n, m) by blocks with rows and columns of their own, zero elsewhere.

    Attributes
    ----------
    length : int
        Number of all rows, n.
    blocks : list of (ndarray of int, shape (r,); ndarray, shape (r, k))
        Rows and values.
    most : ndarray, shape (m,)
        Largest size of each, over the level of what they describe; infinite where it may be any.
    """

    length: int
    blocks: list
    most: np.ndarray

    @classmethod
    def of(cls, columns, most=None):
        """The same of columns as they are, in one block."""
        rows = np.flatnonzero(columns.any(axis=1))
        return cls(len(columns), [(rows, columns[rows])],
                   np.full(columns.shape[1], np.inf) if most is None else most)

    @classmethod
    def in_turn(cls, parts):
        """Those of parts of a record that follow each other, each with columns of its own."""
        begins = np.cumsum([0, *(part.length for part in parts)])
        return cls(int(begins[-1]), [(begin + rows, values) for begin, part in zip(begins, parts)
                                     for rows, values in part.blocks],
                   np.concatenate([part.most for part in parts]))

    @property
    def count(self):
        """Number of columns."""
        return sum(values.shape[1] for _, values in self.blocks)

    def whole(self):
        """The columns as they are, shape (n, m)."""
        columns, first = np.zeros((self.length, self.count)), 0
        for rows, values in self.blocks:
            columns[rows, first:first + values.shape[1]] = values
            first += values.shape[1]
        return columns

    def products(self, values):
        """Products with values, shape (n,) or (n, p), as (m,) or (m, p)."""
        return np.concatenate([own.T @ values[rows] for rows, own in self.blocks])

    def add_to(self, values, shares):
        """Values, shape (n,) or (n, p), with the sum of the columns by their shares: in place."""
        first = 0
        for rows, own in self.blocks:
            values[rows] += own @ shares[first:first + own.shape[1]]
            first += own.shape[1]
        return values

    def describing(self, values, used, level):
        """Sizes of the columns, shape (m,), that describe values best where samples count, each at
        most `most` times a level; and orthonormal columns of those that are not held there."""
        free, back = self.orthonormal(used)
        shares = back @ free.products(values)
        if np.all(np.abs(shares) <= at_level(self.most, level)):
            return shares, free
        found, loose, first = [], [], 0
        for rows, columns in self.blocks:
            most, counts = self.most[first:first + columns.shape[1]], used[rows]
            found.append(shares_within(columns[counts], most, level, values[rows[counts]]))
            loose.append((rows, columns[:, np.abs(found[-1]) < _HELD * at_level(most, level)]))
            first += len(most)
        return np.concatenate(found), _unbounded(self.length, loose).orthonormal(used)[0]

    def orthonormal(self, used):
        """Orthonormal columns that span the same space where samples count (elsewhere they are
        zero), and what makes components of these columns of theirs, shape (m, k)."""
        # block by block: of a record's stretches at once, it would take most time and memory
        parts = []
        for rows, values in self.blocks:
            counts = used[rows]
            parts.append((rows[counts], *np.linalg.svd(values[counts], full_matrices=False)))
        least = _NONE * max(np.max(sizes, initial=0.0) for _, _, sizes, _ in parts)
        kept = [(rows, vectors[:, sizes > least], sizes[sizes > least], turned[sizes > least])
                for rows, vectors, sizes, turned in parts]
        return (_unbounded(self.length, [(rows, vectors) for rows, vectors, _, _ in kept]),
                block_diag(*(turned.T / sizes for _, _, sizes, turned in kept)))


def _unbounded(length, blocks):
    return ShortColumns(length, blocks, np.full(sum(own.shape[1] for _, own in blocks), np.inf))
