"""Samples that only repeat the one before: a slower sensor behind a faster clock."""

import numpy as np

# Share of the samples that repeat the one before, and of those in runs of equal ones that are about
# as long as most, from which values are held: on a coarse lattice, and at rest, runs are of any
# length.
_REPEATS, _ALIKE = 0.3, 0.95
# Runs that show it.
_FEWEST = 32


def first_of_held(samples):
    """Samples without those that repeat the one before, where values are held.

    A bus or a logger that is faster than its sensor sends each value several times: all but the
    first are no samples, and stand for motion that nobody has measured.

    Parameters
    ----------
    samples : Samples

    Returns
    -------
    Samples, float
        The same and 1 where values are not held; else the first of each run, and the mean length
        of a run.
    """
    if len(samples.stamps_ns) < _FEWEST:
        return samples, 1.0
    new = np.r_[True, np.any(samples.values[1:] != samples.values[:-1], axis=1)]
    length = np.diff(np.r_[np.flatnonzero(new), len(new)])
    if np.mean(~new) < _REPEATS or len(length) < _FEWEST \
            or length[np.abs(length - np.median(length)) <= 1].sum() < _ALIKE * len(new):
        return samples, 1.0
    return type(samples).of(samples.stamps_ns[new], samples.values[new], samples.variance[new],
                            samples.frame_id), float(np.mean(length))
