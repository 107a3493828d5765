"""Stamps whose clock has jumped, put right (or wrong) without ever going back."""

import numpy as np


def moved(since_ns, steps):
    """Times after jumps of a clock.

    Parameters
    ----------
    since_ns : ndarray of int64, shape (n,)
        Times since the record's start [ns].
    steps : iterable of tuple of float
        Instants [s] and jumps [s], in the order of time; a jump forwards is positive.

    Returns
    -------
    ndarray of int64, shape (n,)
        The same, from each instant on moved by its jump. After a jump back, time goes on at half
        its pace until that is made up for, so that stamps stay in order: for twice the jump, they
        are less and less off.
    """
    result = since_ns
    for at_s, step_s in steps:
        at, step = round(1e9 * at_s), round(1e9 * step_s)
        beyond = since_ns - at
        added = np.full(len(since_ns), step) if step > 0 else np.maximum(-(beyond // 2), step)
        result = result + np.where(beyond >= 0, added, 0)
    return result
