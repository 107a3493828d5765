"""A few short places where far more is left than anywhere else, the record's start among them."""

import numpy as np

from .problem import acts_on_spring

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
# Logarithm of what is left of a free motion where the start of a record ends, that start's share of
# the record at most, and times what is left later (RMS) that must be left in it.
_FORGOTTEN, _AT_MOST, _UNKNOWN = 9.0, 0.0625, 3.0


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


def start(engine, fitted):
    """Mask of a record's first samples, shape (n,), where a fit with a force leaves more of them:
    how the mass moved before is not known, and only a linear sensor's free motion can be projected
    out. Empty where that is not so.

    Parameters
    ----------
    engine : Engine
    fitted : Fitted
    """
    p, mask = engine.problem, np.zeros(len(engine.record), bool)
    if len(mask) != len(p.used) or not any(map(acts_on_spring, fitted.effects.values())):
        return mask
    slowest = -np.max(p.axis_model(fitted.effects).effective_core.poles().real, initial=-np.inf)
    count = min(_FORGOTTEN * p.rate / slowest, _AT_MOST * len(mask))
    early = p.used & (np.arange(len(mask)) < count)
    if early.any() and np.mean(fitted.residual[early]**2) \
            > _UNKNOWN**2 * np.mean(fitted.residual[p.used & ~early]**2):
        mask[:int(np.ceil(count))] = True
    return mask
