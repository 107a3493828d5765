"""Stamps of a sensor that jump: samples are lost there, it paused, or its clock was set."""

import dataclasses

import numpy as np

from ..signals.convolution import at_positions, refined
from .glitches import filter_between, through
from .instants import put_back

# Samples on both sides of a jump that are compared, and those that a filter between the two
# reaches.
_BESIDE, _REACH = 4000, 24
# Share of what the filter leaves otherwise that it must leave where one thing is true, and of the
# sensor's power.
_BETTER, _TELLS = 0.5, 0.25
# Factor by which the motion is refined before it is read between samples.
_REFINED = 4


def settle(paired, topic, words):
    """Have a sensor's clock say where the motion of the reference shows its samples to be, behind
    the longest gap of the stamps or where they jump; words on it are added.

    Parameters
    ----------
    paired : pairing.Paired
    topic : Topic
        Of the sensor.
    words : list of str

    Returns
    -------
    bool
        Whether the pair must be laid out anew.

    Notes
    -----
    A filter from one to the other, learnt before, tells where the samples behind it belong: after
    the one before as ever, where their stamps say, or on the instants nearest to these.
    """
    if "sensor" in paired.resampled or topic.is_moved:
        return False
    clock, stamps = topic.clock, topic.stamps_ns
    even = clock if clock.jump else clock.without_gap(stamps)
    if even is None:
        return False
    at = int(np.searchsorted((stamps - stamps[0]) * 1e-9, even.jump.at_s))
    lost = int(clock.slot[at] - clock.slot[at - 1]) - 1
    late = even.jump.size_s * even.rate_hz - lost
    left, power = _left(paired, topic, at, lost, (-lost, late, 0.0))
    if left is None or min(left) > _TELLS * power:
        return False
    if lost and left[0] < _BETTER * min(left[1:]):
        topic.clock = even
        return True
    if left[1] < _BETTER * min(left[0], left[2]):
        topic.clock = dataclasses.replace(even, slot=clock.slot, jump=None)
        put_back(topic, np.where(np.arange(len(topic)) >= at, late, 0.0))
        words.append(f"{even.jump.at_s:.6g} s after the start the sensor's samples begin anew, "
                     f"{abs(late):.2g} of an interval {'after' if late > 0 else 'before'} the "
                     "instants of those before: they are put on these")
        return True
    return False


def _left(paired, topic, at, lost, places):
    """Variances of what a filter from the reference leaves of the samples behind a jump, each for
    these at other `places` from where they are [samples], and their own; None where too few."""
    begin = round((1e-9 * (int(topic.stamps_ns[at]) - paired.start_ns) - paired.lag_s)
                  * paired.sampling_rate_hz)
    before = slice(max(begin - lost - _BESIDE, 0), begin - lost)
    count = min(_BESIDE, len(paired.valid) - begin)
    if min(before.stop - before.start, count) < 4 * _REACH:
        return None, 0.0
    column = int(np.argmax(np.std(paired.sensor[before], axis=0)
                           * (np.std(paired.reference[before], axis=0) > 0)))
    reference, sensor = (values[before.start:begin + count, column]
                         - np.mean(values[before, column])
                         for values in (paired.reference, paired.sensor))
    learnt = before.stop - before.start
    taps = filter_between(reference[:learnt], sensor[:learnt], range(-_REACH, _REACH + 1))
    fine = refined(through(reference, taps), _REFINED)
    rows = np.arange(learnt + lost + _REACH, len(sensor) - _REACH)
    return [float(np.var(sensor[rows] - at_positions(fine, _REFINED * (rows + place))))
            for place in places], float(np.var(sensor[rows]))
