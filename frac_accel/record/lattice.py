"""The lattice that quantised values lie on."""

import numpy as np

# Samples that are looked at, and the share of them that may be distinct.
_SAMPLES = 20_000
_DISTINCT = 0.5
# Gaps [of the range] that rounding of the numbers makes, and how far from the lattice [steps] a
# value may be.
_ROUNDING = 1e-9
_OFF = 1e-3
# Neighbouring blocks of values, each of both states of a bit, that must be visited for a bit that
# never changes to be stuck.
_BLOCKS = 4


def lattice_step(values):
    """Step of which all differences between values are multiples, or None.

    Numbers that are simply stored with few digits have a lattice too; its step is then small, and
    whether it matters is not decided here.
    """
    levels = np.unique(values[:_SAMPLES])
    if len(levels) < 3 or len(levels) > _DISTINCT * min(len(values), _SAMPLES):
        return None
    gaps = np.diff(levels)
    gaps = gaps[gaps > _ROUNDING * np.ptp(levels)]
    step = gaps.min()
    for _ in range(3):
        counts = np.round(gaps / step)
        if np.any(counts < 1):
            return None
        step = float(np.sum(gaps) / np.sum(counts))
    places = (levels - levels[0]) / step
    return step if np.max(np.abs(places - np.round(places))) < _OFF else None


def stuck_bit(values, step):
    """What the bit is worth that no value changes although values pass it time and again, or None.

    Parameters
    ----------
    values : ndarray, shape (n,)
    step : float or None
        That of their lattice.
    """
    levels = np.unique(values[:_SAMPLES]) / step if step else np.empty(0)
    counts = np.round(levels).astype(np.int64)
    if not len(counts) or np.max(np.abs(levels - counts)) > 0.1:
        return None
    bit = 1
    while np.ptp(counts) > 2 * _BLOCKS * bit:
        is_set = counts & bit != 0
        blocks = np.unique(counts // (2 * bit))
        if (is_set.all() or not is_set.any()) and np.any(
                blocks[_BLOCKS - 1:] - blocks[:-_BLOCKS + 1] == _BLOCKS - 1):
            return float(bit * step)
        bit *= 2
    return None
