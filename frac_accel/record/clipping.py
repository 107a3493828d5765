"""Samples that a converter or an amplifier has clipped.

Samples pile up at an extreme in other ways too (a sensor at rest, the crests of a coarsely
quantised sine, a long dwell). A pile that is large enough is certain by itself (`certain`); of a
smaller one a model of the other samples decides (`clipped`).
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..errors import IdentificationError
from ..shown import several

# Samples at the extreme, at least, and how many more than at any of the next distinct values make
# a pile, and one that is certain where values repeat. The crests of a quantised sine come to 2.4
# times the next level.
_FEWEST = 5
# As many where no other value comes twice.
_FEWEST_OF_ALL = 3
_PILE_UP = 1.5
_CERTAIN = 4
_NEXT_VALUES = 2
# What stands at one value for a larger share of the record rests there.
_RESTING = 0.4
# How far the model goes in the middle of the clipped samples beyond what those next to them lead to
# expect: steps of the lattice (half a step is rounding), standard deviations of the channel (a
# slightly nonlinear sensor stays below the model at its crests), and of what the model leaves of
# the others: fewer where the limit is reached often, more of few samples [over the square roots of
# the numbers of stays and samples].
_BEYOND_STEPS = 0.55
_BEYOND = 0.05
_BEYOND_NOISE = 0.5
_BEYOND_OFTEN = 5.0
_BEYOND_FEW = 5.0
# Samples next to a limit, at least, and per sample at it.
_NEXT = 20


class Pile(NamedTuple):
    """Samples at the greatest value, their number, and the largest of the next values' numbers; and
    whether its few stays are no longer than values are held elsewhere."""

    limit: float
    count: int
    next_count: int
    is_held: bool


@dataclasses.dataclass(frozen=True)
class Clipping:
    """What is clipped of one channel.

    Attributes
    ----------
    samples : ndarray of bool, shape (n,)
    lower, upper : float or None
        Values at which the samples stand.
    """

    samples: np.ndarray
    lower: float | None = None
    upper: float | None = None

    @property
    def words(self):
        """Where the limits are."""
        return " and ".join(f"{limit:.6g}" for limit in (self.lower, self.upper)
                            if limit is not None)


def at_limits(values, lower, upper):
    """Words for the values that lie at each limit that is not None."""
    return [several(int(np.sum(values == limit)), "sample lies", "samples lie")
            + f" exactly at the {side} limit {limit:.6g}"
            for limit, side in ((lower, "lower"), (upper, "upper")) if limit is not None]


def pile_up(values):
    """`Pile` at the greatest value if suspiciously many samples have it, else None."""
    top = values.max()
    count = int(np.count_nonzero(values == top))
    if count < _FEWEST_OF_ALL or count >= _RESTING * len(values) \
            or (count < _FEWEST and len(np.unique(values)) + count <= len(values)):
        return None
    # few samples say what the next values are, as a rule
    below, next_count, level = values[values < top], 0, top
    for _ in range(_NEXT_VALUES):
        if not len(below):
            return None
        level = below.max()
        next_count = max(next_count, int(np.count_nonzero(below == level)))
        below = below[below < level]
    return Pile(float(top), count, next_count, _is_held(values, top)) \
        if count >= _PILE_UP * next_count else None


def _beyond(values, expected, at_limit, others):
    """How far the middle of what is expected at the greatest values lies beyond what it is at those
    next to them: of what a model does not know, such as noise, both have their share."""
    rows = np.flatnonzero(others)
    count = min(max(_NEXT, int(at_limit.sum())), len(rows))
    near = rows[np.argpartition(values[rows], -count)[-count:]]
    apart = values[at_limit][0] - np.mean(values[near])
    centred = values[rows] - np.mean(values[rows])
    slope = centred @ expected[rows] / max(centred @ centred, 1e-300)
    return np.median(expected[at_limit]) - np.median(expected[near]) - slope * apart


def _times_noise(samples):
    """How far a limit must lie beyond what a model leaves where these samples stand at it."""
    stays = np.count_nonzero(np.diff(np.r_[False, samples].astype(int)) > 0)
    return max(_BEYOND_FEW / np.sqrt(samples.sum()),
               min(_BEYOND_NOISE, _BEYOND_OFTEN / np.sqrt(stays)))


def _is_held(values, top):
    """Whether the top is reached a few times only, and values elsewhere stay the same for as long,
    as often."""
    starts = np.flatnonzero(np.r_[True, np.diff(values) != 0])
    lengths, there = np.diff(np.r_[starts, len(values)]), values[starts] == top
    return bool(there.sum() < _FEWEST and lengths[there].max() > 1
                and np.sum(lengths[~there] >= lengths[there].max()) >= there.sum())


def certain(pile, step):
    """Limit of a pile that no model need confirm, or None.

    On a lattice (of that step, if any) the tail falls from level to level, and a value that is held
    may be any.
    """
    if pile is None or pile.is_held or (step and pile.count <= _CERTAIN * pile.next_count):
        return None
    return pile.limit


def clipped(values, valid, step, model):
    """Piled-up samples beyond whose limit a model of the others goes.

    Parameters
    ----------
    values : ndarray, shape (n,)
    valid : ndarray of bool, shape (n,)
    step : float or None
        Of the values' lattice.
    model : callable
        Gives the expected values, shape (n,), from a mask of the samples that it may learn from;
        raises IdentificationError where these do not tell.

    Returns
    -------
    Clipping
    """
    piles = {side: pile_up(side * values[valid]) for side in (-1, 1)}
    suspect = {side: valid & (values == side * pile.limit) for side, pile in piles.items() if pile}
    none = np.zeros(len(values), bool)
    if not suspect:
        return Clipping(none)
    others = valid & ~np.any(list(suspect.values()), axis=0)
    try:
        expected = model(others)
    except IdentificationError:
        # what the other samples cannot tell stays unknown; the fit of all of them will say why
        return Clipping(none)
    noise = np.std((values - expected)[others])
    least = max(_BEYOND_STEPS * (step or 0.0), _BEYOND * np.std(values[valid]))
    found = {side: samples for side, samples in suspect.items()
             if _beyond(side * values, side * expected, samples, others)
             > max(least, noise * _times_noise(samples))}
    limits = (float(values[found[side]][0]) if side in found else None for side in (-1, 1))
    return Clipping(np.any([none, *found.values()], axis=0), *limits)
