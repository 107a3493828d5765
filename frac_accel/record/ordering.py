"""Samples in the order of their stamps, where a recorder has mixed them."""

import numpy as np

from ..shown import several

# Places by which a recorder may have mixed samples, and share of the usual step below which two of
# them are too close together for that.
_MIXED, _TOO_CLOSE = 64, 0.6


def in_order(samples):
    """Samples in the order of their stamps, and how many of them came after a later one; see
    `order_of`."""
    order, late = order_of(samples.stamps_ns)
    return (_taken(samples, order) if late else samples), late


class Reordering:
    """`in_order` of samples that come in blocks, each with more that belongs to it.

    The last 64 samples are held back until it is known that none comes after them that belongs
    before.

    Attributes
    ----------
    late : int
        Samples that came after a later one.
    """

    def __init__(self):
        self.late = 0
        self._samples, self._others = None, None

    def add(self, samples, *others):
        """The next samples, with lists of what belongs to each; what is certain by now."""
        if self._samples is not None:
            samples = type(samples).concatenate([self._samples, samples])
            others = [held + new for held, new in zip(self._others, others)]
        order, late = order_of(samples.stamps_ns)
        if late:
            samples = _taken(samples, order)
            others = [[each[place] for place in order.tolist()] for each in others]
            self.late += late
        count = max(len(samples.stamps_ns) - _MIXED, 0)
        self._samples = _taken(samples, slice(count, None))
        self._others = [each[count:] for each in others]
        return (_taken(samples, slice(count)), *(each[:count] for each in others))

    def rest(self):
        """What is still held back; None where nothing has come."""
        return self._samples and (self._samples, *self._others)


def order_of(stamps):
    """Order in which stamps rise, and how many come after a later one; None and 0 where that is no
    order of the samples, or they are in it.

    It is one where a recorder has mixed them only: none is far from its place, and once they are
    in order they are no closer together than others. Behind a clock that was set back they are.
    """
    steps = np.diff(stamps)
    back = int(np.count_nonzero(steps < 0))
    if not back:
        return None, 0
    order = np.argsort(stamps, kind="stable")
    steps = np.diff(stamps[order])
    if np.max(np.abs(order - np.arange(len(order)))) > _MIXED \
            or np.count_nonzero(steps < _TOO_CLOSE * np.median(steps)) > back / 2:
        return None, 0
    return order, int(np.count_nonzero(stamps < np.maximum.accumulate(stamps)))


def _taken(samples, rows):
    return samples._replace(stamps_ns=samples.stamps_ns[rows], values=samples.values[rows],
                            variance=samples.variance[rows])


def late_words(late, name):
    """What a user must know of a topic with samples that came after a later one."""
    return (f"{several(late, 'sample')} of the {name} came after a later one: all are put in the "
            "order of their stamps")
