"""A few short places where far more is left than anywhere else."""

import numpy as np

# Samples of a window, and power of a place over the loudest of all other windows.
_WINDOW = 64
_STANDS_OUT = 30.0
# How many places there may be, and share of the record in them: more are no exception.
_MOST, _RARE = 3, 0.02
# Share of what is left that must lie there, and share of the motion that may: in a shock all does.
_HOLDS, _OF_MOTION = 0.5, 0.2
# Mean of the error in a place, over its RMS there, up to which it may be one: what rectifies strong
# motion, or shifts with it, has one sign.
_ONE_SIDED = 0.3


def event(residual, motion, used):
    """Mask of the places, shape (n,); empty where none stands out.

    What happens once, such as a knock on one of the two or a pothole that folds in a slow
    logger, cannot be told from a cause by one sight of it, and hides all that is smaller.

    Parameters
    ----------
    residual, motion : ndarray, shape (n,)
    used : ndarray of bool, shape (n,)
        Samples that count.
    """
    none = np.zeros(len(residual), bool)
    count = len(residual) // _WINDOW
    if count * _RARE < _MOST:
        return none
    size = count * _WINDOW
    left, moving = (np.where(used, values, 0.0)[:size].reshape(count, _WINDOW) for values in
                    (residual, motion - motion[used].mean()))
    one_sided = np.abs(left.mean(axis=1)) > _ONE_SIDED * np.sqrt(np.mean(left**2, axis=1))
    left, moving = np.sum(left**2, axis=1), np.sum(moving**2, axis=1)
    marked = np.zeros(count, bool)
    for _ in range(_MOST):
        top = int(np.argmax(np.where(marked, 0.0, left)))
        if one_sided[top]:
            break
        # its edges lie in the windows beside it
        marked[max(top - 1, 0):top + 2] = True
        if left[top] > _STANDS_OUT * left[~marked].max() \
                and left[marked].sum() > _HOLDS * left.sum() \
                and moving[marked].sum() < _OF_MOTION * moving.sum():
            return np.r_[np.repeat(marked, _WINDOW), none[size:]]
    return none
