"""Small systems of normal equations, whatever the sizes of their columns."""

import numpy as np


def solve(matrix, right, size=None, rcond=1e-12):
    """Solution of a normal system, of least length where it is singular.

    Parameters
    ----------
    matrix : ndarray, shape (p, p)
    right : ndarray, shape (p,) or (p, k)
    size : ndarray, shape (p,), optional
        Squared lengths of the columns, by which all is scaled. Default: the diagonal.
    rcond : float
        Ratio of singular values, after scaling, below which a direction is none.
    """
    scale = np.sqrt(np.maximum(np.diag(matrix) if size is None else size, 1e-300))
    rows = scale if right.ndim == 1 else scale[:, None]
    return np.linalg.lstsq(matrix / np.outer(scale, scale), right / rows, rcond=rcond)[0] / rows
