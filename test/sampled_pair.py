"""Two loggers of signals along x that were made at a far higher rate."""

import numpy as np

from frac_accel import Samples


def sampled_pair(rng, signals, finer, rate_hz, noise):
    """`Samples` of each of some signals of shape (finer * n,), every `finer`-th value with white
    noise (standard deviation)."""
    taken = [values[::finer] for values in signals]
    stamps = np.round(np.arange(len(taken[0])) * 1e9 / rate_hz).astype(np.int64)
    return tuple(Samples.of(stamps, np.outer(values + rng.normal(0, noise, len(values)), [1, 0, 0]))
                 for values in taken)
